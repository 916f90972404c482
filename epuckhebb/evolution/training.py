"""The worlds of training: the scenario itself, as in the paper, or worlds that are drawn anew in each generation.

The wheel gain may vary from generation to generation, and a part of the lifetimes may run in varied worlds. These
depend on the seed, the generation and the loop alone. The training world of the experiment may come back, in turn with
the scenario, or in some loops of every generation (rehearsal). The layouts and the dead sensor of the test scenarios
are never drawn. Their light levels and weak wheels lie inside the drawn ranges, so these tests are interpolation.
"""

import math
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from epuckhebb.controller import random
from epuckhebb.controller.random import Stream
from epuckhebb.controller.ranges import check, within
from epuckhebb.tmaze.life import Lifetime
from epuckhebb.tmaze.scenario import Scenario

FIRST_LAYOUT = 10  # of training; layouts below are for tests


class World(NamedTuple):
    """The world and the lifetime of a loop of a generation. start_noise: how much starts vary."""

    scenario: Scenario
    lifetime: Lifetime
    start_noise: float


@dataclass(kw_only=True)
class Training:
    """The worlds in which the fitness of individuals is measured.

    success_bonus: added to the fitness of a lifetime that ends at the goal. gain_rad_s: least and greatest wheel gain;
    that of a generation is log-uniform between them, and its lifetimes last as long as the same path takes; None for
    `lifetime.gain_rad_s`. unvaried_loops: loops of a generation in the scenario itself; the others are varied.
    start_noise: how much starts vary in these. light_share, obstacles_share, dead_sensor_share, wheel_share: in which
    share of these the light is drawn from `light`, obstacles stand in a layout of `layouts`, one sensor is dead (any
    but the first), one wheel turns at a share of its speed from `wheel`. season: so many generations in the scenario
    are followed by as many in the training world of its experiment, and so on; None for the scenario alone. rehearsal:
    the last loops of a generation, in that training world. lamarckian: whether individuals inherit the weights with
    which their lifetimes ended, as a mean. rule_off: whether the fittest runs fresh lifetimes, with plasticity and
    without.
    """

    name: str = ""
    success_bonus: float = within(0, default=0.0)
    gain_rad_s: list[float] | None = within(0.01, default=None)
    unvaried_loops: int = within(0, default=1)
    start_noise: float = within(0, default=0.0)
    light_share: float = within(0, 1, default=0.0)
    light: list[float] = within(0, default=[0.05, 1.2])
    obstacles_share: float = within(0, 1, default=0.0)
    layouts: list[int] = within(FIRST_LAYOUT, default=[FIRST_LAYOUT, 59])
    dead_sensor_share: float = within(0, 1, default=0.0)
    wheel_share: float = within(0, 1, default=0.0)
    wheel: list[float] = within(0, 1, default=[0.8, 1.0])
    season: int | None = within(1, default=None)
    rehearsal: int = within(0, default=0)
    lamarckian: bool = False
    rule_off: bool = False

    def __post_init__(self) -> None:
        check(self, "training")
        for name in ("gain_rad_s", "light", "layouts", "wheel"):
            pair = getattr(self, name)
            if pair is not None and (len(pair) != 2 or pair[0] > pair[1]):
                raise ValueError(f"training.{name} must be two numbers, the lesser first, got {list(pair)}")

    @property
    def is_varied(self) -> bool:
        """Whether some loops run in varied worlds."""
        shares = self.light_share, self.obstacles_share, self.dead_sensor_share, self.wheel_share
        return max(self.start_noise, *shares) > 0

    @property
    def returns(self) -> bool:
        """Whether the training world of the experiment comes back."""
        return self.season is not None or self.rehearsal > 0

    @property
    def loops(self) -> int:
        """The least number of loops with each kind of world."""
        return (self.unvaried_loops + 1 if self.is_varied else 1) + self.rehearsal

    def stretch(self, lifetime: Lifetime) -> float:
        """The mean length of a training lifetime over that of `lifetime`."""
        if self.gain_rad_s is None:
            return 1.0
        least, most = self.gain_rad_s
        mean = 1 / least if least == most else (1 / least - 1 / most) / math.log(most / least)
        return lifetime.gain_rad_s * mean

    def check(self, scenario: Scenario, lifetime: Lifetime, loops: int) -> None:
        """Check that the settings fit this scenario, this lifetime and this number of loops; else a ValueError."""
        if self.is_varied and loops <= self.unvaried_loops:
            raise ValueError(f"training.unvaried_loops must be less than the {loops} loops, got {self.unvaried_loops}")
        if self.rehearsal >= loops:
            raise ValueError(f"training.rehearsal must be less than the {loops} loops, got {self.rehearsal}")
        if self.obstacles_share > 0 and not (scenario.maze.niches and any(scenario.maze.obstacle_counts)):
            raise ValueError(f"training.obstacles_share must be 0 in {scenario.maze.name}, got {self.obstacles_share}")
        if self.gain_rad_s is None:
            return
        if scenario.task.has_trials:
            raise ValueError(f"training.gain_rad_s must be null in {scenario.task.name}, got {list(self.gain_rad_s)}")
        most, end = self.gain_rad_s[1], self._change_gain(lifetime, self.gain_rad_s[1]).duration_s
        if most > scenario.robot.motor_limit_rad_s:
            raise ValueError(f"training.gain_rad_s must be at most {scenario.robot.motor_limit_rad_s:g}, got {most}")
        if scenario.changes and scenario.changes[-1]["at_s"] >= end:
            limit, got = f"{end:g} s, the end with training.gain_rad_s", scenario.changes[-1]["at_s"]
            raise ValueError(f"scenario.changes must come before {limit}, got {got}")

    def worlds(
        self,
        scenario: Scenario,
        lifetime: Lifetime,
        loops: int,
        seed: int,
        generation: int,
        origin: Scenario | None = None,
    ) -> list[World]:
        """The world of each loop of a generation. origin: the training world of the experiment, where it comes back."""
        if origin is not None and self.season is not None and generation // self.season % 2:
            scenario = origin
        if self.gain_rad_s is not None:
            drawn = random.rng(seed, Stream.training_world, generation).random()
            least, most = self.gain_rad_s
            lifetime = self._change_gain(lifetime, least * (most / least) ** drawn)
        unvaried = min(loops, self.unvaried_loops) if self.is_varied else loops
        worlds = [World(scenario, lifetime, 0.0)] * unvaried
        for loop in range(unvaried, loops):
            rng = random.rng(seed, Stream.training_world, generation, loop)
            worlds.append(World(self._varied(scenario, rng), lifetime, self.start_noise))
        if origin is not None and self.rehearsal:
            worlds[-self.rehearsal :] = [World(origin, lifetime, 0.0)] * self.rehearsal
        return worlds

    def _change_gain(self, lifetime: Lifetime, gain: float) -> Lifetime:
        """A lifetime at another gain with the same possible path: gain times duration is constant."""
        return replace(lifetime, gain_rad_s=gain, duration_s=lifetime.duration_s * lifetime.gain_rad_s / gain)

    def _varied(self, scenario: Scenario, rng: np.random.Generator) -> Scenario:
        """A varied world. All numbers are drawn, used or not, so that the shares are independent."""
        changed: dict[str, Any] = {}
        drawn = rng.random(10).tolist()
        dark, bright = self.light
        weak, strong = self.wheel
        if drawn[0] < self.light_share:
            changed["light"] = dark + (bright - dark) * drawn[1]
        if drawn[2] < self.obstacles_share:
            counts = [count for count in scenario.maze.obstacle_counts if count]
            changed["obstacles"] = counts[int(drawn[3] * len(counts))]
            changed["layout"] = self.layouts[0] + int(drawn[4] * (self.layouts[1] - self.layouts[0] + 1))
        if drawn[5] < self.dead_sensor_share:
            changed["dead_sensors"] = (1 + int(drawn[6] * (scenario.robot.sensor_numbers - 1)),)
        if drawn[7] < self.wheel_share:
            changed["left_wheel" if drawn[8] < 0.5 else "right_wheel"] = weak + (strong - weak) * drawn[9]
        return replace(scenario, **changed)


UNVARIED = Training(name="unvaried")
