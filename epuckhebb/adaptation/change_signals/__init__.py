"""The signals of change, one file each; `epuckhebb.adaptation.change_signal` says what a signal may use."""
