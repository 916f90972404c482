"""The worlds of training: where the individuals of a generation live, and what counts as fitness there.

As in the paper, all of them live at home: in the scenario as it is. They can also live at another pace in each
generation, or a part of their lifetimes in worlds that are drawn anew for each generation. What is drawn depends on the
seed, the generation and the loop alone. The layouts and the dead sensor of the scenarios that test a champion are never
drawn; their light levels and weak wheels lie inside what is drawn, so there a test is one of interpolation.
"""

import math
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from epuckhebb.sim import random
from epuckhebb.sim.life import Lifetime
from epuckhebb.sim.random import Stream
from epuckhebb.sim.scenario import Scenario

FIRST_LAYOUT = 10  # of training; those before are kept for tests
_SHARES = ("light_share", "obstacles_share", "dead_sensor_share", "wheel_share")


class World(NamedTuple):
    """Where and how a loop of a generation is lived. start_noise: how much starts vary."""

    scenario: Scenario
    lifetime: Lifetime
    start_noise: float


@dataclass(kw_only=True)
class Training:
    """In which worlds individuals are judged.

    success_bonus: added to the fitness of a lifetime that ends at the goal. gain_rad_s: least and greatest gain; that
    of a generation is log-uniform between them, and its lifetimes last as long as it takes to drive as far as at
    `lifetime.gain_rad_s`; None for that gain. unvaried_loops: loops of a generation in the scenario as it is; others
    are varied, if anything is. start_noise: how much starts vary in them. light_share, obstacles_share,
    dead_sensor_share, wheel_share: in which share of them the light is drawn from `light`, obstacles stand in a layout
    of `layouts`, one sensor is dead (any but the first), one wheel turns at a share of its speed from `wheel`.

    Raises:
        ValueError: a value is outside the range named in the message.
    """

    name: str = ""
    success_bonus: float = 0.0
    gain_rad_s: list[float] | None = None
    unvaried_loops: int = 1
    start_noise: float = 0.0
    light_share: float = 0.0
    light: list[float] = field(default_factory=lambda: [0.05, 1.2])
    obstacles_share: float = 0.0
    layouts: list[int] = field(default_factory=lambda: [FIRST_LAYOUT, 59])
    dead_sensor_share: float = 0.0
    wheel_share: float = 0.0
    wheel: list[float] = field(default_factory=lambda: [0.8, 1.0])

    def __post_init__(self) -> None:
        """Refuse trainings that cannot be."""
        for name in ("success_bonus", "start_noise"):
            if not (math.isfinite(getattr(self, name)) and getattr(self, name) >= 0):
                raise ValueError(f"training.{name} must be 0 or more, got {getattr(self, name)}")
        if self.unvaried_loops < 0:
            raise ValueError(f"training.unvaried_loops must be 0 or more, got {self.unvaried_loops}")
        for name in _SHARES:
            if not 0 <= getattr(self, name) <= 1:
                raise ValueError(f"training.{name} must lie in [0, 1], got {getattr(self, name)}")
        if self.gain_rad_s is not None:
            _check_range("gain_rad_s", self.gain_rad_s, 0.01, math.inf)
        _check_range("light", self.light, 0.0, math.inf)
        _check_range("wheel", self.wheel, 0.0, 1.0)
        _check_range("layouts", self.layouts, FIRST_LAYOUT, math.inf)  # no tests' own: that is the point

    @property
    def is_varied(self) -> bool:
        """Whether there are loops in other worlds than home."""
        return self.start_noise > 0 or any(getattr(self, name) > 0 for name in _SHARES)

    @property
    def loops(self) -> int:
        """The least number of loops in which each kind of world comes up: one at home, or one more where it varies."""
        return self.unvaried_loops + 1 if self.is_varied else 1

    def stretch(self, lifetime: Lifetime) -> float:
        """How many times as long as `lifetime` a lifetime of training lasts on average."""
        if self.gain_rad_s is None:
            return 1.0
        least, most = self.gain_rad_s
        mean = 1 / least if least == most else (1 / least - 1 / most) / math.log(most / least)
        return lifetime.gain_rad_s * mean

    def check(self, home: Scenario, lifetime: Lifetime, loops: int) -> None:
        """Refuse what this world, this pace or so many loops do not allow.

        Raises:
            ValueError: they do not.
        """
        if self.is_varied and loops <= self.unvaried_loops:
            raise ValueError(
                f"training.unvaried_loops must be less than the loops of a generation, which are {loops}: there would "
                f"be no varied world; got {self.unvaried_loops}"
            )
        if self.obstacles_share > 0 and not (home.maze.niches and any(home.maze.obstacle_counts)):
            raise ValueError(
                f"training.obstacles_share must be 0 in maze {home.maze.name}, which has no niches for obstacles at "
                f"random, got {self.obstacles_share}"
            )
        if self.dead_sensor_share > 0 and home.robot.sensor_numbers < 2:
            raise ValueError(
                f"training.dead_sensor_share must be 0 for robot {home.robot.name}, which has but one sensor, "
                f"got {self.dead_sensor_share}"
            )
        if self.gain_rad_s is None:
            return
        if home.task.has_trials:
            raise ValueError(
                f"training.gain_rad_s must be null with task={home.task.name}, whose trials have their time whatever "
                f"the gain, got {list(self.gain_rad_s)}"
            )
        most = self.gain_rad_s[1]
        if most > home.robot.motor_limit_rad_s:
            raise ValueError(
                f"training.gain_rad_s must be at most {home.robot.motor_limit_rad_s:g}, the fastest of robot "
                f"{home.robot.name}, got {most}"
            )
        if home.changes and home.changes[-1]["at_s"] >= self._at_gain(lifetime, most).duration_s:
            raise ValueError(
                f"scenario.changes must come before {self._at_gain(lifetime, most).duration_s:g} s, the end of a life "
                f"at training.gain_rad_s = {most:g}, got {home.changes[-1]['at_s']}"
            )

    def worlds(self, home: Scenario, lifetime: Lifetime, loops: int, seed: int, generation: int) -> list[World]:
        """The world of each loop of a generation."""
        lived = lifetime
        if self.gain_rad_s is not None:
            drawn = random.rng(seed, Stream.training_world, generation).random()
            least, most = self.gain_rad_s
            lived = self._at_gain(lifetime, least * (most / least) ** drawn)
        in_training = World(home, lived, 0.0)
        if not self.is_varied:
            return [in_training] * loops
        return [
            in_training
            if loop < self.unvaried_loops
            else World(
                self._varied(home, random.rng(seed, Stream.training_world, generation, loop)), lived, self.start_noise
            )
            for loop in range(loops)
        ]

    def _at_gain(self, lifetime: Lifetime, gain: float) -> Lifetime:
        """A lifetime at another gain, in which as far can be driven: gain times duration stays what it is."""
        return replace(lifetime, gain_rad_s=gain, duration_s=lifetime.duration_s * lifetime.gain_rad_s / gain)

    def _varied(self, home: Scenario, rng: np.random.Generator) -> Scenario:
        """Another world. All numbers are drawn, whatever is used of them, so that shares do not change each other."""
        changed: dict[str, Any] = {}
        drawn = rng.random(10).tolist()
        if drawn[0] < self.light_share:
            changed["light"] = _between(self.light, drawn[1])
        if drawn[2] < self.obstacles_share:
            counts = [count for count in home.maze.obstacle_counts if count]
            changed["obstacles"] = counts[int(drawn[3] * len(counts))]
            changed["layout"] = self.layouts[0] + int(drawn[4] * (self.layouts[1] - self.layouts[0] + 1))
        if drawn[5] < self.dead_sensor_share:
            changed["dead_sensors"] = (1 + int(drawn[6] * (home.robot.sensor_numbers - 1)),)
        if drawn[7] < self.wheel_share:
            changed["left_wheel" if drawn[8] < 0.5 else "right_wheel"] = _between(self.wheel, drawn[9])
        world = replace(home, **changed)
        if "layout" in changed:
            world.check()
        return world


def _between(bounds: list[float], drawn: float) -> float:
    return bounds[0] + (bounds[1] - bounds[0]) * drawn


def _check_range(name: str, given: list[float] | list[int], least: float, most: float) -> None:
    """Refuse what is not two numbers in order, within bounds.

    Raises:
        ValueError: it is not.
    """
    if not (len(given) == 2 and all(map(math.isfinite, given)) and least <= given[0] <= given[1] <= most):
        bound = f"{least:g} or more" if math.isinf(most) else f"from {least:g} to {most:g}"
        raise ValueError(f"training.{name} must be two numbers, the lesser first, {bound}, got {list(given)}")


UNVARIED = Training(name="unvaried")
