"""The signals of change, one file each; `epuckhebb.sim.adaptation.change_signal` says what a signal may use."""
