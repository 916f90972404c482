"""When plasticity acts, how the robot explores meanwhile, and whether its light weights are scaled.

`adaptation` puts together what `tmaze.lifetime` calls: a signal of change (`change_signals/`, one file each), the gate
that it opens (`gate`), exploration (`exploration`), and the nominal statistics of the training world (`nominal`).
"""
