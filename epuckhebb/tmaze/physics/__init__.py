"""The kinds of physics, one file each; `epuckhebb.tmaze.physics_engine` says what one must offer."""
