"""The self-check: a robot dances at birth, compares what it feels with home, and corrects what has changed in itself.

`dance` is what it does, `memory` what it remembers of home, `findings` what it finds, `corrections` what it does about
it all its life, and `check` puts them together: the dance of one robot, what it found, and where its life begins.
"""
