"""Couplings between robots, a file each; see `epuckhebb.sim.coupling`."""
