"""A scenario: the world in which a robot lives, as the paper varies it."""

import math
from dataclasses import dataclass, field

from epuckhebb.sim.light import Lamp
from epuckhebb.sim.maze import OBSTACLE_COUNTS

EXPERIMENTS = ("light", "obstacles")


@dataclass(kw_only=True)
class Scenario:
    """How light it is, how many obstacles stand in the maze, and where its lamp is; lit on right trials.

    light: level of the sun, 1 as in bright training, 0.1 dimmed. obstacles: 0, 2 or 4. experiment: which of the
    paper's two this belongs to, `light` or `obstacles`. paper_N, paper_duration_s: the base rate and the time [s] of
    an evaluation that the paper used in that experiment.
    """

    name: str = "base"
    experiment: str = "obstacles"
    light: float = 0.1
    obstacles: int = 0
    lamp: Lamp = field(default_factory=Lamp)
    paper_N: float = 0.000015
    paper_duration_s: float = 250.0

    def __post_init__(self) -> None:
        """Refuse a world that cannot be.

        Raises:
            ValueError: a value is outside the range named in the message.
        """
        if self.experiment not in EXPERIMENTS:
            raise ValueError(f"scenario.experiment must be one of {', '.join(EXPERIMENTS)}, got {self.experiment!r}")
        if not (math.isfinite(self.light) and self.light >= 0):
            raise ValueError(f"scenario.light must be a number, 0 or more, got {self.light}")
        if self.obstacles not in OBSTACLE_COUNTS:
            allowed = ", ".join(map(str, OBSTACLE_COUNTS))
            raise ValueError(f"scenario.obstacles must be one of {allowed}, got {self.obstacles}")
