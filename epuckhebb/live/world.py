"""Robots that live the same lifetime, with and without plasticity, and all that someone does to them by hand.

Each robot is alone in its own space of the same world, with the same noise. What is done by hand is done to all of
them at the same step. An ordinary evaluation with `scenario.hand=FILE` is bit-identical.
"""

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from epuckhebb.analysis.evaluate import make_individuals
from epuckhebb.config import EvaluateConfig, hand, load, quoted
from epuckhebb.runs import compile_kernels, evaluate_into, hydra, prepare_evaluation
from epuckhebb.runtime import ConfigError
from epuckhebb.store import Run, write_atomic
from epuckhebb.tmaze.changes import first_step
from epuckhebb.tmaze.individual import GA_ALONE, has_control
from epuckhebb.tmaze.maze import SIDES, Side, added, gap
from epuckhebb.tmaze.robot import STEP_S
from epuckhebb.tmaze.scenario import Scenario
from epuckhebb.tmaze.session import Session
from epuckhebb.tmaze.simulator import Simulator

_LONGEST_S = 1200.0  # of a lifetime, unless one asks for another: all its samples are kept
_SETTINGS = ("lifetime.duration_s", "lifetime.record_every", "repeats")  # of an evaluation; a world has its own


class LiveWorld:
    """Robots in a lifetime that goes on as far as it is asked to, in a world that someone changes by hand.

    words: settings, as on the command line. robots: one lifetime in progress for each controller, the first without
    plasticity. changes: what was done by hand. wishes: what will be done before the next step.

    planned: changes by hand that are done in their time, those of another world like this one.
    """

    PAGE = "play.html"

    def __init__(
        self, words: Sequence[str], side: str, config_dir: str | None = None, planned: Sequence[Mapping[str, Any]] = ()
    ) -> None:
        if side not in SIDES:
            raise ConfigError(f"side must be {' or '.join(SIDES)}, got {side!r}")
        self.words, self._config_dir = list(words), config_dir
        self.side: Side = "right" if side == "right" else "left"
        keys = {word.partition("=")[0] for word in words}
        default = [] if keys & {_SETTINGS[0], "lifetime", "task"} else [f"{_SETTINGS[0]}={_LONGEST_S:g}"]
        words = [*default, *words, "lifetime.record_every=8", "repeats=1"]
        prepared = prepare_evaluation(load(EvaluateConfig, words, config_dir))
        self.config, self.genome = config, genome = prepared.config, prepared.genome
        if config.scenario.hand is not None:
            raise ConfigError(f"scenario.hand={config.scenario.hand}: play writes such a file; evaluate repeats it")
        replace(config.world, changes=planned)  # it refuses what cannot be
        self.controllers = [GA_ALONE, *config.controllers]
        compile_kernels(self.controllers, genome.network, config.world)
        self.lifetime = replace(config.lifetime, record_every=1)
        lifetimes = [(number, self.side, 0) for number in range(len(self.controllers))]
        nominal, plan, network = prepared.world.nominal(genome, 1), genome.plan, genome.network
        individuals = make_individuals(
            genome.genes, self.controllers, lifetimes, nominal, plan, network, config.seed, genome.signs
        )
        kept = int(has_control(self.controllers))
        simulators = [Simulator(config.world, self.lifetime, kept=kept) for _ in individuals]
        self.robots = [
            Session(individual, config.world, self.lifetime, simulator=simulator)
            for individual, simulator in zip(individuals, simulators, strict=True)
        ]
        self.changes: list[dict[str, Any]] = []
        self.wishes: dict[str, Any] = {}
        self._planned: list[Mapping[str, Any]] = []
        self.run(1)  # a change comes after the first step
        self._planned += planned

    @property
    def steps(self) -> int:
        """How many steps have been run."""
        return max(robot.steps for robot in self.robots)

    @property
    def shown(self) -> object:
        """When this is another one, pages get the world anew."""
        return self.robots[0].world

    @property
    def is_over(self) -> bool:
        """Whether all robots are at the end of their lifetime."""
        return all(robot.is_over for robot in self.robots)

    @property
    def scenario(self) -> Scenario:
        """The world as it will be with the next step: whoever pauses sees what they do."""
        now = self.robots[0].world
        return now.changed(self.wishes) if self.wishes else now

    def wish(self, values: Mapping[str, Any]) -> None:
        """Let something change before the next step, or raise a ValueError; wishes before that step are joined."""
        if self.is_over:
            raise ValueError("this life has ended; begin a new one")
        if "at_s" in values:
            raise ValueError(f"at_s is no wish: it acts before the next step, got {values['at_s']!r}")
        joined = {**self.wishes, **values}
        if isinstance(values.get("lamp"), Mapping):
            joined["lamp"] = {**self.wishes.get("lamp", {}), **values["lamp"]}
        now = self.robots[0].world
        wished = now.changed(joined)
        new, radius = added(now.boxes, wished.boxes), wished.robot.radius_m
        if wished.put is None and any(gap(*robot.pose[:2], new) < radius for robot in self.robots):
            raise ValueError("a block cannot stand where a robot is")
        self.wishes = joined

    def run(self, steps: int) -> int:
        """Run so many steps of all robots, what was wished or planned for first; returns how many were run."""
        start = self.steps
        while self._planned and (due := first_step(self._planned[0])) < start + steps:
            if due > self.steps:
                self._run(due - self.steps)
            self.wish({key: value for key, value in self._planned.pop(0).items() if key != "at_s"})
        self._run(start + steps - self.steps)
        return self.steps - start

    def _run(self, steps: int) -> None:
        """Make the change that was wished for, then run so many steps of all robots."""
        start = self.steps
        if self.wishes and not self.is_over:
            planned = [change for change in self.config.world.changes if first_step(change) >= start]
            world = replace(self.scenario, changes=planned)
            for robot in self.robots:
                if not robot.is_over:
                    robot.change(world)
            self.changes.append({"at_s": start * STEP_S, **self.wishes})
            self.wishes = {}
        for robot in self.robots:
            robot.step(start + steps - robot.steps)

    def save(self, folder: Path = Path("runs")) -> dict[str, Any]:
        """Run the lifetime again as `evaluate` does, into a run folder.

        Returns `run`, its folder; `same`, whether it went as it was seen; and `command`, which repeats it. A lifetime
        of many trials that has not ended is a ValueError.
        """
        task = self.config.world.task
        if task.has_trials and not self.is_over:
            raise ValueError(f"a life with task={task.name} can be saved when all its trials are over")
        duration_s = self.lifetime.duration_s if self.is_over else self.steps * STEP_S
        name = f"{hydra.new_stamp()}_{self.config.world.name}_seed{self.config.seed}_played"
        words = [word for word in self.words if word.partition("=")[0] not in _SETTINGS]
        words += [f"lifetime.duration_s={duration_s!r}", "repeats=1"]
        if self.changes:
            file = folder / "play" / f"{name}.json"
            write_atomic(file, hand.written(self.changes))
            words.append(f"scenario.hand={quoted(str(file))}")
        run = folder / "evaluate" / name
        config = load(EvaluateConfig, words, self._config_dir)
        more = ["--config-dir", self._config_dir] if self._config_dir else []
        facts = {"command_line": ["epuckhebb", "play", *self.words, *more]}
        evaluate_into(run, config, words, facts, threads=1)
        metrics = Run(run).table("metrics.csv").query("side == @self.side").set_index("controller")
        names = [controller.name for controller in self.controllers]
        seen = {name: robot.outcome().fitness for name, robot in zip(names, self.robots, strict=True)}
        same = seen == metrics.fitness.to_dict()  # the mean over all steps, of all that robots sense and do
        return {"run": str(run), "same": same, "command": shlex.join(["epuckhebb", "evaluate", *words, *more])}
