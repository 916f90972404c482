"""Recognising the goal by the senses alone: a compass, a lamp, walls, and what they look like at the goal's dead end.

`compass` follows the heading by the sun and the wheels, and counts light that the sun does not explain; `walls` knows
where walls were sensed; `place` puts both together. Everything is made of what the robot senses, what it commands, and
four facts of its training world: where the sun stands, how bright it is, how far a wall is by its echo, and on which
side the goal lies when the lamp is lit.
"""
