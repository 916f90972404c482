"""How the science becomes machine code: kernels, their digests, and what numba lacks for them."""
