"""The kinds of physics, one file each; `epuckhebb.sim.space` says what one must offer."""
