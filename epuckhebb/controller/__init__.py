"""What is evolved and what learns: networks, genomes, plasticity rules, and how they become machine code."""
