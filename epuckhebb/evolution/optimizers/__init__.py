"""Optimizers, one file each: how the genomes of the next generation are chosen."""
