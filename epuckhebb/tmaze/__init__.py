"""The paper's world: maze, light, robot, sensors, fitness and physics, and the lifetime that joins them.

Everything here is written for one robot, in the paper's symbols. It uses NumPy, numba and (in `physics` alone) pymunk.
It reads no file, prints nothing and has no global random generator. Settings are checked where they are made.
"""
