"""A scenario: the world in which a robot lives, as the paper varies it."""

import math
from dataclasses import dataclass, field

from epuckhebb.sim.epuck import SENSORS
from epuckhebb.sim.light import Lamp
from epuckhebb.sim.maze import OBSTACLE_COUNTS

EXPERIMENTS = ("light", "obstacles")
TRAINED = {"light": "highlight", "obstacles": "base"}  # the scenario in which each one's controllers are evolved


@dataclass(kw_only=True)
class Scenario:
    """How light it is, how many obstacles stand in the maze, where its lamp is (lit on right trials), what is broken.

    light: level of the sun, 1 as in bright training, 0.1 dimmed. obstacles: 0, 2 or 4. layout: where they stand, 0 as
    in the paper, k > 0 moved and resized at random, the k-th way. dead_sensor: place 0 to 7 on the robot's rim where
    it is blind (feels the dark and no wall), None where nowhere. left_wheel, right_wheel: share of the commanded speed
    that the wheel turns at. experiment: which of the paper's two this belongs to, `light` or `obstacles`. paper_N,
    paper_duration_s: the base rate and the time [s] of an evaluation that the paper used in that experiment.
    """

    name: str = "base"
    experiment: str = "obstacles"
    light: float = 0.1
    obstacles: int = 0
    layout: int = 0
    dead_sensor: int | None = None
    left_wheel: float = 1.0
    right_wheel: float = 1.0
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
        if self.layout < 0:
            raise ValueError(f"scenario.layout must be 0 (as in the paper) or more, got {self.layout}")
        if self.dead_sensor is not None and not 0 <= self.dead_sensor < SENSORS:
            raise ValueError(f"scenario.dead_sensor must be null or 0 to {SENSORS - 1}, got {self.dead_sensor}")
        for wheel in ("left_wheel", "right_wheel"):
            if not 0 <= getattr(self, wheel) <= 1:
                raise ValueError(f"scenario.{wheel} must lie in [0, 1], got {getattr(self, wheel)}")
