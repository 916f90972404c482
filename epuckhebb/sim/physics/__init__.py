"""The kinds of physics, one file each; `epuckhebb.sim.physics_engine` says what one must offer."""
