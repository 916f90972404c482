"""Couplings between robots, a file each; see `epuckhebb.flock.coupling`."""
