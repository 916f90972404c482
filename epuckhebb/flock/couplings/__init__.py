"""Couplings between robots, one file each: a subclass of `epuckhebb.flock.coupling.Coupling`."""
