"""The genetic algorithm: how genomes are varied and selected (`ga`) and the loop that evolves them (`evolve`)."""
