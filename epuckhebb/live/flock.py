"""A flock on a plane that drives as far as it is asked to, while someone moves and breaks robots."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from inspect import getdoc
from typing import Any

from epuckhebb.config import load
from epuckhebb.flock.plane import HOLD, FlockRun
from epuckhebb.flock.tables import coupling_title
from epuckhebb.studies.flock import FlockStudy
from epuckhebb.tmaze.maze import Pose
from epuckhebb.tmaze.robot import EPUCK

WORD = "flock"  # the first word of the settings, which are those of `epuckhebb flock`


class LiveFlock:
    """A flock with one coupling, which can be switched, with the methods that a server calls.

    words: settings. steps: how many have been run; robots decide every few of them. is_over: after a day.
    """

    PAGE, side, is_over, steps = "flock.html", "right", False, 0

    def __init__(self, words: Sequence[str], config_dir: str | None = None) -> None:
        study = load(FlockStudy, list(words[1:]), config_dir)
        flock = replace(study.conditions[0].flocks[-1], duration_s=86_400.0)
        self.words, self._run, self._asked = list(words), FlockRun(flock, study.seed), 0
        self._rows = {row.name: row for row in study.rows if not row.is_control}
        self._coupling = next(iter(self._rows))

    def run(self, steps: int) -> int:
        """Run so many steps more, up to the last decision before their end; returns how many were run."""
        start, self._asked, last = self.steps, self._asked + steps, self._run.flock.decisions
        self._run.advance(min(self._asked // HOLD, last), self._rows[self._coupling].coupling)
        self.steps, self.is_over = self._run.done * HOLD, self._run.done == last
        return self.steps - start

    def wish(self, values: Mapping[str, Any]) -> None:
        """Switch the `coupling`, break the robot `broken`, or put a robot somewhere: `put`, its number, x and y [m]."""
        places, coupling = [Pose(*row[:3]) for row in self._run.motion.tolist()], values.get("coupling", self._coupling)
        robot, *position = values.get("put", [values.get("broken", 0)])
        if robot not in range(len(places)) or coupling not in self._rows or not all(map(math.isfinite, position)):
            raise ValueError(f"there is no such robot, place or coupling among {', '.join(self._rows)}: {values}")
        if "broken" in values and self._run.broken >= 0:
            raise ValueError("a robot is broken already; begin a new flock to break another")
        if position:
            if min(math.dist(pose[:2], position) for pose in places[:robot] + places[robot + 1 :]) < 2 * EPUCK.radius_m:
                raise ValueError("a robot cannot stand where another is")
            places[robot] = places[robot]._replace(x=position[0], y=position[1])
            self._run.space.place_robot(*places)
        if "broken" in values:
            self._run.break_robot(robot)
        self._coupling = coupling

    def facts(self) -> dict[str, Any]:
        """What stays as it is while the flock drives."""
        couplings = {name: [coupling_title(name), getdoc(row.coupling)] for name, row in self._rows.items()}
        flock = self._run.flock
        return {"robots": flock.robots, "knowers": flock.knowers, "radius": EPUCK.radius_m, "couplings": couplings}

    def state(self) -> dict[str, Any]:
        """Where the robots are, and whom they listen to."""
        poses, weights, broken = self._run.motion[:, :3].tolist(), self._run.weights.tolist(), self._run.broken
        return {"poses": poses, "weights": weights, "coupling": self._coupling, "broken": broken, "steps": self.steps}

    shown = property(state, doc="When this is another one, pages get the flock anew.")
