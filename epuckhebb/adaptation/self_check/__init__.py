"""The self-check: before its lifetime a robot compares its sensors and wheels with training, and corrects them.

`calibration` is the manoeuvre that it drives, `memory` the same manoeuvre measured in the training world, `findings`
what has changed, `corrections` the correction in every step, and `check` puts them together for one robot.
"""
