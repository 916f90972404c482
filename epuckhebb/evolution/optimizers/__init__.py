"""How genomes are sought, one optimizer a file; see `epuckhebb.evolution.optimizer`."""
