"""A flock on a plane that drives as far as it is asked to, while someone moves and breaks robots."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from inspect import getdoc
from typing import Any

from epuckhebb.config import load
from epuckhebb.flock.plane import HOLD, FlockRun
from epuckhebb.flock.tables import title_of
from epuckhebb.studies.flock import FlockStudy
from epuckhebb.tmaze.maze import Pose
from epuckhebb.tmaze.robot import EPUCK

WORD = "flock"  # the first word of the settings, which are those of `epuckhebb flock`
_LONGEST_S = 86_400.0


class LiveFlock:
    """A flock of ten robots with one coupling, which can be switched; it has what `LiveWorld` has for a server.

    coupling: the name of the coupling that acts. changes: how often somebody changed something.
    """

    PAGE = "flock.html"

    def __init__(self, words: Sequence[str], config_dir: str | None = None) -> None:
        study = load(FlockStudy, list(words[1:]), config_dir)
        flock = replace(study.conditions[0].flocks[-1], duration_s=_LONGEST_S)
        self._run, self._asked = FlockRun(flock, study.seed), 0
        self._rows = {row.name: row for row in study.rows if not row.other}
        self.words, self.side, self.changes = list(words), "right", 0
        self.coupling = next(iter(self._rows))

    @property
    def steps(self) -> int:
        """How many steps have been run: robots decide every few of them."""
        return self._run.done * HOLD

    @property
    def shown(self) -> object:
        """Pages are told of the flock when this is another one."""
        return self.state()

    @property
    def is_over(self) -> bool:
        """Whether the flock has driven for a day."""
        return self._run.done >= self._run.flock.decisions

    def run(self, steps: int) -> int:
        """Run so many steps more, up to the last decision before their end; returns how many were run."""
        before, row, last = self.steps, self._rows[self.coupling], self._run.flock.decisions
        self._asked += steps
        self._run.advance(min(self._asked // HOLD, last), row.coupling, other=row.other)
        return self.steps - before

    def wish(self, values: Mapping[str, Any]) -> None:
        """Switch the `coupling`, break the robot `broken`, or put a robot somewhere: `put`, its number, x and y [m]."""
        places = [Pose(*row[:3]) for row in self._run.motion.tolist()]
        if values.get("coupling", self.coupling) not in self._rows:
            raise ValueError(f"coupling must be one of {', '.join(self._rows)}, got {values['coupling']}")
        robot, *place = values.get("put", [values.get("broken", 0)])
        if robot not in range(len(places)) or not all(map(math.isfinite, place)):
            raise ValueError(f"a flock of {len(places)} robots has no robot {robot}, or no such place: {place}")
        others = [math.dist(other[:2], place) for number, other in enumerate(places) if place and number != robot]
        if place and min(others) < 2 * EPUCK.radius_m:
            raise ValueError("a robot cannot stand where another is")
        if place:
            places[robot] = places[robot]._replace(x=place[0], y=place[1])
            self._run.place(places)
        if "broken" in values and self._run.broken >= 0:
            raise ValueError(f"robot {self._run.broken} is broken already; begin a new flock to break another")
        if "broken" in values:
            self._run.break_robot(robot)
        self.coupling, self.changes = values.get("coupling", self.coupling), self.changes + 1

    def facts(self) -> dict[str, Any]:
        """What stays as it is while the flock drives."""
        flock = self._run.flock
        couplings = {row.name: [title_of(row.name), getdoc(row.coupling)] for row in self._rows.values()}
        return {"robots": flock.robots, "knowers": flock.knowers, "radius": EPUCK.radius_m, "couplings": couplings}

    def state(self) -> dict[str, Any]:
        """Where the robots are, and whom they listen to."""
        return {
            "poses": self._run.motion[:, :3].tolist(),
            "weights": self._run.weights.tolist(),
            "coupling": self.coupling,
            "broken": self._run.broken,
            "steps": self.steps,
        }
