"""Adaptation: when plasticity acts, how the robot explores meanwhile, and what else it corrects.

`adaptation` puts together what `lifetime.live` calls: a signal of change (`change_signals/`, one file each), the gate
that it opens (`gate`), exploration (`exploration`), and the nominal statistics of the training world (`nominal`).
"""
