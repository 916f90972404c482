"""The science: maze, light, robot, controller, plasticity and fitness, and the lifetime that joins them.

Everything here is written for one robot, in the paper's symbols. It knows NumPy, numba and (in `world` alone)
pymunk; it reads no file, prints nothing and has no global random generator.
"""
