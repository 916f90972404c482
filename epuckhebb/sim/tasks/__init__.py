"""Tasks: what a robot is to do in its life. One task a file; `epuckhebb.sim.task` says what each of them has."""
