"""Lifetimes that run one after the other in one call of machine code: what they carry and their outcomes, in arrays."""

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.compiling.errors import PartError, explained
from epuckhebb.controller.compiling.readonly import readonly, with_arrays
from epuckhebb.controller.genotype import initial_states
from epuckhebb.controller.own_class import OwnClass, own_of
from epuckhebb.controller.plasticity.control import NO_YOKING, Track
from epuckhebb.controller.plasticity.rule import bound_of
from epuckhebb.tmaze.faults import initial_past
from epuckhebb.tmaze.fitness import History, initial_history
from epuckhebb.tmaze.individual import Individual
from epuckhebb.tmaze.life import INITIAL_TALLY, Life, Lifetime, Rows, Setup, in_rows
from epuckhebb.tmaze.outcome import Outcome, outcomes_of
from epuckhebb.tmaze.own_sensor import Sensor
from epuckhebb.tmaze.physics_engine import Space
from epuckhebb.tmaze.robot import STEP_S
from epuckhebb.tmaze.samples import empty_samples
from epuckhebb.tmaze.scenario import Scenario
from epuckhebb.tmaze.simulator import Simulator, world_setup
from epuckhebb.tmaze.task import TRIAL


class LostRobotError(ArithmeticError):
    """A robot's pose or weights stopped being finite, or it left the arena: its lifetime means nothing."""


class Block:
    """Lifetimes of individuals that differ in nothing but genes, keys and starts (or one lifetime, in any pieces).

    starts: where each robot starts. lives: what each lifetime carries, arrays with an axis of lifetimes in front. life:
    the same of the lifetime that runs. world: in which it runs. setup: what holds there. samples: what is recorded of a
    lifetime that is alone.

    history: what the live fitness starts from; None for that of the rule. master: of a yoked lifetime.
    """

    def __init__(
        self,
        individuals: Sequence[Individual],
        lifetime: Lifetime,
        simulator: Simulator,
        *,
        history: History | None = None,
        master: "Block | None" = None,
    ) -> None:
        self._who, self._lifetime, self.world = individuals[0], lifetime, simulator.phases[0].scenario
        who, count = self._who, len(individuals)
        self._first = world = self.world
        self.kind = kind = simulator.kind_of(who.controller, who.network)
        self._nominal = who.nominal if who.controller.adaptation.acts else None
        self._is_usual = self._nominal is None and history is None
        self.history = history or initial_history(who.controller.rule)
        self.starts = [world.maze.start if one.start is None else one.start for one in individuals]
        states, every = in_rows(self._initial_lives(individuals), count)
        shared = {
            "recent": np.zeros((who.controller.rule.average, who.network.neurons)),
            "workspace": kind.workspace,
            "past": initial_past(world.robot),
        }
        self.lives: Life = with_arrays(every, lambda array: array[:count])
        life = with_arrays(every, lambda array: array[-1])._replace(**shared)
        track = self._track(life.track, master)
        self.life: Life = life._replace(genotype=readonly(life.genotype), track=track)
        self._rows = Rows(states, np.array(self.starts, float))
        self.record_every = lifetime.record_every if who.record else 0
        samples = -(-lifetime.steps // self.record_every) if self.record_every else 0
        self.samples = empty_samples(samples, who.network, world.physics, len(simulator.world.phases))

    def _initial_lives(self, individuals: Sequence[Individual]) -> Any:
        """The lifetimes before their first step; a ValueError if the individuals' genes or signs do not fit."""
        who, kind, world = self._who, self.kind, self.world
        rule, network = who.controller.rule, who.network
        of_updates = kind.signs if who.signs is None else who.signs
        if of_updates is None or of_updates.shape != (network.synapses,):
            given = "none" if of_updates is None else of_updates.size
            raise ValueError(f"sign=shuffled needs Individual.signs, {network.synapses} signs of updates, got {given}")
        keys = np.array([one.key for one in individuals], np.uint64)
        states = initial_states(
            np.array([one.genes for one in individuals]),
            kind.plan,
            network,
            rule,
            keys.tolist(),
            signs=of_updates,
            synapse_state=kind.synapse_state,
            gain_rad_s=self._lifetime.gain_rad_s,
            step_s=STEP_S,
        )
        shared: dict[str, Any] = dict.fromkeys(("recent", "workspace", "past"), ())  # they need no rows
        different = individuals if world.task.has_trials else individuals[:1]
        alike = {
            "tally": INITIAL_TALLY,
            "adaptation": who.controller.adaptation.initial_state(world.robot),
            "score": world.fitness.initial_state(),
            "senses": kind.senses,
            "track": np.full(1, math.nan if kind.kept is None else 0.0),
        }
        drawn = [world.task.initial_trials(one.side, one.task_key) for one in different]
        return Life(
            **states,
            **{name: with_arrays(value, lambda array: array[None]) for name, value in alike.items()},
            key=keys[:, None],
            trials=np.array([trials.view(np.uint8) for trials in drawn]).view(TRIAL),
            **shared,
        )

    def _track(self, path: Floats, master: "Block | None") -> Track | tuple[()]:
        """What is kept of the changes of the weights; a yoked lifetime reads what its master keeps."""
        rule, kept = self._who.controller.rule, (self if master is None else master).kind.kept
        if kept is None:
            return ()
        yoking = NO_YOKING if master is None else self._who.yoking
        if yoking is None:
            raise ValueError(f"control={rule.control.name} needs Individual.yoking, the draw of the control; got none")
        return Track(master is not None, kept, yoking, float(bound_of(rule)), path)

    def enter(self, world: Scenario) -> None:
        """Let a world hold from the next step on."""
        who, kind, lifetime, self.world = self._who, self.kind, self._lifetime, world
        self.setup = Setup(
            **{
                **kind.setup,
                "rate": kind.setup["rate"] * float(world.rate),
                "history": self.history,
                **({} if self._nominal is None else {"nominal": self._nominal}),
            },
            **world_setup(world, who.side, self.starts[0]),
            gain=float(lifetime.gain_rad_s),
            noise_level=float(lifetime.noise),
            record_every=self.record_every,
            samples=self.samples,
        )

    def live(self, space: Space, until: int) -> None:
        """Run until before a step. The first robot stands in the space already.

        Raises:
            NotCompiledError, PartError, LostRobotError: as `Session.step`.
        """
        live = self.kind.usual.call if self._is_usual else self.kind.live
        try:
            live(self._rows, self.life, self.setup, space.handles, until)
        except Exception as error:  # machine code raises nothing, so it comes from compiling
            raise explained(own_parts(self._who, self.world), error) from error
        self._seen = self.world
        for is_wrong, kind, what, steps in self._faults():
            if is_wrong.any():
                raise kind(f"{what} at step {steps[is_wrong.argmax()]} of {self._lifetime.steps}")

    def outcomes(self) -> list[Outcome]:
        """The metrics of the lifetimes so far, of one step or more."""
        goals = list(self._first.goals_now.values())
        at_start = [min(math.dist(start[:2], goal) for goal in goals) for start in self.starts]
        bound, world = bound_of(self._who.controller.rule), self._seen  # since then, goals may have moved
        return outcomes_of(self.lives, world, self._who.side, at_start, bound, self._rows.poses.tolist())

    def _faults(self) -> Iterator[tuple[Any, type[Exception], str, Any]]:
        """What must not be: whether it is so in each lifetime, its error and message, and the step in each."""
        lives, who, world = self.lives, self._who, self.world
        tally, wiring, controller = lives.tally[:, 0], who.network.wiring, who.controller
        where, steps = f"on a {who.side} trial of scenario {world.name}", tally["step"] - tally["lost"]
        for group, scratch in zip(world.robot.sensors, lives.senses.scratch, strict=True):
            if isinstance(group, Sensor):
                for reading, values in zip(group.readings, scratch.T, strict=True):
                    is_wrong = ~((values >= 0.0) & (values <= 1.0))
                    gave = f"`read` gave {values[is_wrong.argmax()]} {where}; noticed"
                    yield is_wrong, PartError, f"sensor {group.name}: {reading} must lie in [0, 1], {gave}", steps
        if world.fitness.step:
            what = f"fitness {world.fitness.name}: `step` gave infinite or nan values {where}; noticed"
            yield ~np.isfinite(lives.score["sum"][:, 0]), PartError, what, steps
        if wiring is not None:
            what = f"wiring {wiring.name}: `neuron` gave infinite or nan activations {where}; noticed"
            yield ~_all_finite(lives.activation), PartError, what, steps
        if (signal := next(iter(controller.adaptation.parts), None)) is not None:
            failed = tally["failed_signal"]
            yield failed > 0, PartError, f"change signal {signal.__name__}: `signal` gave nan {where}", failed
        where = f"{where}, controller {controller.name},"
        stored = lives.weights, lives.synapse_state.view(np.float64), tally["weight_change_sum"][:, None]
        what = f"{where} the rule {controller.rule.name} made weights infinite or nan"
        yield ~np.logical_and.reduce(list(map(_all_finite, stored))), LostRobotError, what, steps
        summed = tally["behaviour_sum"] + tally["path_length"] + tally["goal_distance"]
        what = f"{where} the robot's pose stopped being finite or left the arena"
        yield tally["lost"] | ~np.isfinite(summed), LostRobotError, what, steps


def _all_finite(values: Floats) -> Any:
    """Whether all numbers of each lifetime are finite, (lifetimes,) of (lifetimes, numbers)."""
    return np.isfinite(values).all(axis=1)


def own_parts(individual: Individual, world: Scenario) -> list[type[OwnClass]]:
    """The classes of a lifetime's parts that are the user's own."""
    controller, wiring = individual.controller, individual.network.wiring
    parts = (controller.rule, wiring, world.fitness, world.task, world.physics, *world.robot.sensors)
    return own_of([*parts, *controller.adaptation.parts])
