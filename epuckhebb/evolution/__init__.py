"""How controllers are evolved: optimizers, which say who lives next, and the loop in which they live (`evolve`)."""
