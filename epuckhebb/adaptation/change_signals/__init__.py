"""Signals of change, one file each: a subclass of `epuckhebb.adaptation.change_signal.ChangeSignal`."""
