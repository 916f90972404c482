"""How controllers are evolved: optimizers, the worlds of training, and the loop over generations (`evolve`)."""
