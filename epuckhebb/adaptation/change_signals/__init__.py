"""The signals of change, one file each; see `epuckhebb.adaptation.change_signal`."""
