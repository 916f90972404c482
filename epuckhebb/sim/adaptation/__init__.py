"""Adaptation: what is laid over a plasticity rule. When it acts, exploration while it acts, what is remembered of home.

`adaptation` puts together what `lifetime.live` calls: a signal of change (`change_signals/`, one file each), the gate
that it opens (`gate`), exploration (`exploration`), and the baseline of the training world (`baseline`).
"""
