"""Lifetimes that run one after the other in one call of machine code: what they carry and their outcomes, in arrays."""

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.compiling.errors import PartError, explained
from epuckhebb.controller.compiling.readonly import map_arrays, readonly
from epuckhebb.controller.genotype import initial_states
from epuckhebb.controller.own_class import OwnClass, user_classes
from epuckhebb.controller.plasticity.control import NO_YOKING, Track
from epuckhebb.controller.plasticity.rule import weight_bound
from epuckhebb.tmaze.faults import initial_past
from epuckhebb.tmaze.fitness import History, initial_history
from epuckhebb.tmaze.individual import Individual
from epuckhebb.tmaze.life import INITIAL_TALLY, Life, Lifetime, Setup, stack_rows
from epuckhebb.tmaze.outcome import Outcome, measure_outcomes
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

    starts: where each robot starts. lives: what each lifetime carries, arrays with an axis of lifetimes in front (and
    the last one again, where there are several). life: what the lifetime that runs carries. world: in which it runs.
    setup: what holds there. samples: what is recorded of a lifetime that is alone.

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
        who = self._who
        self._first = world = self.world
        self.kind = kind = simulator.kind(who.controller, who.network)
        self._nominal = who.nominal if who.controller.adaptation.acts else None
        self._is_usual = self._nominal is None and history is None
        self.history = history or initial_history(who.controller.rule)
        self.starts = [world.maze.start if individual.start is None else individual.start for individual in individuals]
        self._rows, self.lives = stack_rows(self._initial_lives(individuals), len(individuals))
        self._poses, last = np.array(self.starts, float), map_arrays(self.lives, lambda array: array[-1])
        genotype = last.genotype._replace(synapse_state=kind.synapse_state, signs=self._signs())
        self.life: Life = last._replace(
            genotype=readonly(genotype),
            recent=np.zeros((who.controller.rule.average, who.network.neurons)),
            workspace=kind.workspace,
            senses=kind.senses,
            past=initial_past(world.robot),
            track=self._track(last.track, master),
        )
        self.record_every = lifetime.record_every if who.record else 0
        samples = -(-lifetime.steps // self.record_every) if self.record_every else 0
        self.samples = empty_samples(samples, who.network, world.physics, len(simulator.world.phases))

    def _signs(self) -> Floats:
        """The signs of updates; a ValueError if they do not fit."""
        who, default = self._who, self.kind.signs
        signs, synapses = default if who.signs is None else who.signs, who.network.synapses
        if signs is None or signs.shape != (synapses,):
            count = "none" if signs is None else signs.size
            raise ValueError(f"sign=shuffled needs Individual.signs, {synapses} signs of updates, got {count}")
        return np.ascontiguousarray(signs, float)

    def _initial_lives(self, individuals: Sequence[Individual]) -> Any:
        """What the lifetimes carry before their first step, but for what they may share."""
        who, kind, world = self._who, self.kind, self.world
        keys = np.array([individual.key for individual in individuals], np.uint64)
        states = initial_states(
            np.array([individual.genes for individual in individuals]),
            kind.plan,
            who.network,
            who.controller.rule,
            keys.tolist(),
            synapse_state=kind.synapse_state,
            gain_rad_s=self._lifetime.gain_rad_s,
            step_s=STEP_S,
        )
        alike = {
            "adaptation": who.controller.adaptation.initial_state(world.robot),
            "score": world.fitness.initial_state(),
            "track": np.full(1, math.nan if kind.kept is None else 0.0),
        }
        different = individuals if world.task.has_trials else individuals[:1]
        drawn = [world.task.initial_trials(individual.side, individual.task_key) for individual in different]
        shared: dict[str, Any] = dict.fromkeys(("recent", "workspace", "senses", "past"), ())
        return Life(
            **states,
            **{name: map_arrays(value, lambda array: array[None]) for name, value in alike.items()},
            **shared,
            key=keys[:, None],
            tally=INITIAL_TALLY[None],
            trials=np.array([trials.view(np.uint8) for trials in drawn]).view(TRIAL),
        )

    def _track(self, path: Floats, master: "Block | None") -> Track | tuple[()]:
        """What is kept of the changes of the weights; a yoked lifetime reads what its master keeps."""
        rule, kept = self._who.controller.rule, (self if master is None else master).kind.kept
        if kept is None:
            return ()
        yoking = NO_YOKING if master is None else self._who.yoking
        if yoking is None:
            raise ValueError(f"control={rule.control.name} needs Individual.yoking, the draw of the control; got none")
        return Track(master is not None, kept, yoking, float(weight_bound(rule)), path)

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
            live(self._rows, self._poses, self.life, self.setup, space.handles, until)
        except Exception as error:  # machine code raises nothing, so it comes from compiling
            raise explained(user_parts(self._who, self.world), error) from error
        self._seen = self.world
        for group, scratch in zip(self.world.robot.sensors, self.life.senses.scratch, strict=True):
            if isinstance(group, Sensor):
                for reading, value in zip(group.readings, scratch, strict=True):
                    if not 0.0 <= value <= 1.0:
                        raise PartError(f"sensor {group.name}: {reading} must lie in [0, 1], `read` gave {value}")
        for is_wrong, kind, what, steps in self._faults():
            if is_wrong.any():
                raise kind(f"{what} at step {steps[is_wrong.argmax()]} of {self._lifetime.steps}")

    def outcomes(self) -> list[Outcome]:
        """The metrics of the lifetimes so far, of one step or more."""
        goals = list(self._first.goals_now.values())
        at_start = [min(math.dist(start[:2], goal) for goal in goals) for start in self.starts]
        bound, world = weight_bound(self._who.controller.rule), self._seen  # since then, goals may have moved
        return measure_outcomes(self.lives, world, self._who.side, at_start, bound, self._poses.tolist())

    def _faults(self) -> Iterator[tuple[Any, type[Exception], str, Any]]:
        """What must not be: whether it is so in each lifetime, its error and message, and the step in each."""
        lives, who, world = self.lives, self._who, self.world
        tally, wiring, controller = lives.tally[:, 0], who.network.wiring, who.controller
        where, steps = f"on a {who.side} trial of scenario {world.name}", tally["step"] - tally["lost"]
        if world.fitness.step:
            what = f"fitness {world.fitness.name}: `step` gave infinite or nan values {where}; noticed"
            yield ~np.isfinite(lives.score["sum"][:, 0]), PartError, what, steps
        if wiring is not None:
            what = f"wiring {wiring.name}: `neuron` gave infinite or nan activations {where}; noticed"
            yield ~np.isfinite(lives.activation).all(axis=1), PartError, what, steps
        if (signal := next(iter(controller.adaptation.parts), None)) is not None:
            failed = tally["failed_signal"]
            yield failed > 0, PartError, f"change signal {signal.__name__}: `signal` gave nan {where}", failed
        where = f"{where}, controller {controller.name},"
        are_finite = np.isfinite(lives.weights).all(axis=1) & np.isfinite(tally["weight_change_sum"])
        are_finite &= np.isfinite(lives.synapse_state.view(np.float64)).all(axis=1)
        what = f"{where} the rule {controller.rule.name} made weights infinite or nan; noticed"
        yield ~are_finite, LostRobotError, what, steps
        summed = tally["behaviour_sum"] + tally["path_length"] + tally["goal_distance"]
        what = f"{where} the robot's pose stopped being finite or left the arena"
        yield tally["lost"] | ~np.isfinite(summed), LostRobotError, what, steps


def user_parts(individual: Individual, world: Scenario) -> list[type[OwnClass]]:
    """The classes of a lifetime's parts that are the user's own."""
    controller, wiring = individual.controller, individual.network.wiring
    parts = (controller.rule, wiring, world.fitness, world.task, world.physics, *world.robot.sensors)
    return user_classes([*parts, *controller.adaptation.parts])
