"""Tasks: what a robot is to do in a lifetime. One file each."""
