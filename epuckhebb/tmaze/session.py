"""A lifetime in progress, run any number of steps at a time; at its end, its outcome: success and all other metrics.

A lifetime that is run in pieces is bit-identical to the same lifetime run at once. `epuckhebb.tmaze.batch` runs whole
lifetimes; with `Session` one can watch a robot, or change its world, between two steps.
"""

import math

import numpy as np

from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.compiling.errors import PartError, explained
from epuckhebb.controller.genotype import initial_state
from epuckhebb.controller.own_class import OwnClass, own_of
from epuckhebb.controller.plasticity.control import NO_YOKING, Track
from epuckhebb.controller.plasticity.rule import bound_of
from epuckhebb.tmaze import fitness
from epuckhebb.tmaze.faults import initial_past
from epuckhebb.tmaze.individual import Individual
from epuckhebb.tmaze.life import (
    INITIAL_BYTES,
    TALLY,
    Life,
    Lifetime,
    Setup,
    pad_samples,
    tally_of,
)
from epuckhebb.tmaze.lifetime import look
from epuckhebb.tmaze.maze import Pose, added, gap
from epuckhebb.tmaze.outcome import Outcome, outcome_of
from epuckhebb.tmaze.own_sensor import Sensor
from epuckhebb.tmaze.robot import STEP_S
from epuckhebb.tmaze.samples import empty_samples
from epuckhebb.tmaze.scenario import Scenario
from epuckhebb.tmaze.simulator import Phase, Simulator, world_setup


class LostRobotError(ArithmeticError):
    """A robot's pose or weights stopped being finite, or it left the arena: its lifetime means nothing."""


class Session:
    """A lifetime in progress, run with `step`, in a world that `change` may replace at any time.

    individual, lifetime: as given. world: the present scenario. life: the present state. setup: what holds in that
    world. samples: what is recorded, of length 0 where nothing is.

    simulator: shared by lifetimes that run one after the other; without it, any number of sessions may be in progress.
    """

    def __init__(
        self,
        individual: Individual,
        world: Scenario,
        lifetime: Lifetime | None = None,
        *,
        simulator: Simulator | None = None,
    ) -> None:
        self.individual, self.lifetime = individual, Lifetime() if lifetime is None else lifetime
        master = individual.master
        if simulator is None:
            simulator = Simulator(world, self.lifetime, kept=int(master is not None))
        self._simulator = simulator
        self._phases = list(simulator.phases)
        self._kind = simulator.kind_of(individual.controller, individual.network)
        self._first = first = self._phases[0].scenario
        self._nominal = individual.nominal if individual.controller.adaptation.acts else None
        self._is_usual = self._nominal is None and individual.after is None
        self._record_every = self.lifetime.record_every if individual.record else 0
        self._history = fitness.initial_history(individual.controller.rule)
        if individual.after is not None:
            before = Session(individual.after, world, self.lifetime, simulator=simulator)
            before.step(self.lifetime.steps)
            tally, (steps, summed) = tally_of(before.life), before._history
            self._history = fitness.History(steps + float(tally.step - tally.began), summed + tally.undirected_sum)
        self._master: Session | None = None
        if master is not None:
            self._master = Session(master, world, self.lifetime, simulator=simulator.of_masters)
        self.life: Life = self._initial_life(first)
        count = -(-self.lifetime.steps // self._record_every) if self._record_every else 0
        self.samples = empty_samples(count, individual.network, first.physics, len(world.phases))
        self._not_begun = {step: number for number, (step, _) in enumerate(world.phases)}
        self._start = first.maze.start if individual.start is None else individual.start
        self._space = self._phases[0].space
        self._space.place_robot(self._start)
        self._enter(self._phases.pop(0))
        self._last_step = self.world, self.pose

    def _initial_life(self, world: Scenario) -> Life:
        """The lifetime before its first step; a ValueError if the individual's genes or signs do not fit."""
        who, kind = self.individual, self._kind
        rule, network = who.controller.rule, who.network
        of_updates = kind.signs if who.signs is None else who.signs
        if of_updates is None or of_updates.shape != (network.synapses,):
            given = "none" if of_updates is None else of_updates.size
            raise ValueError(f"sign=shuffled needs Individual.signs, {network.synapses} signs of updates, got {given}")
        state = initial_state(
            who.genes,
            kind.plan,
            network,
            rule,
            int(who.key),
            signs=of_updates,
            synapse_state=kind.synapse_state,
            gain_rad_s=self.lifetime.gain_rad_s,
            step_s=STEP_S,
        )
        return Life(
            **state,
            key=np.uint64(who.key),
            tally=INITIAL_BYTES.copy().view(TALLY),
            adaptation=who.controller.adaptation.initial_state(world.robot),
            trials=world.task.initial_trials(who.side, who.task_key),
            score=world.fitness.initial_state(),
            workspace=kind.workspace,
            senses=kind.senses,
            past=initial_past(world.robot),
            track=self._initial_track(),
        )

    def _initial_track(self) -> Track | tuple[()]:
        """What is kept of the changes of the weights; a yoked lifetime reads what its master keeps."""
        who, master = self.individual, self._master
        rule, kept = who.controller.rule, (self._kind if master is None else master._kind).kept
        if kept is None:
            return ()
        yoking = NO_YOKING if master is None else who.yoking
        if yoking is None:
            raise ValueError(f"control={rule.control.name} needs Individual.yoking, the draw of the control; got none")
        return Track(master is not None, kept, yoking, float(bound_of(rule)), np.zeros(1))

    @property
    def steps(self) -> int:
        """How many steps have been run."""
        return int(self.life.tally[0]["step"])

    @property
    def is_over(self) -> bool:
        """Whether the lifetime has ended: its time is over, or all trials of its task are."""
        return self.steps >= self.lifetime.steps or self._has_ended()

    @property
    def pose(self) -> Pose:
        """Where the robot is."""
        return Pose(*self._space.handles.state[:3].tolist())

    def step(self, count: int = 1) -> int:
        """Run so many steps, fewer if the lifetime ends before.

        Returns:
            How many were run.

        Raises:
            NotCompiledError: the rule, or another part of the user's, does not compile.
            PartError: the user's fitness or neurons gave no number, or a sensor none from 0 to 1.
            LostRobotError: a pose or a weight stopped being finite; the message says whose and when.
        """
        first = self.steps
        last = min(first + count, self.lifetime.steps)
        if self._master is not None:
            self._lead(last)
        while (now := self.steps) < last and not self._has_ended():
            self._enter_due()
            phase, until = self._phase, min(last, self._phases[0].step) if self._phases else last
            while self._space is not phase.space and self.steps < until and not self._has_ended():
                self._move_to_new_walls()
                if self._space is not phase.space:
                    self._live(self.steps + 1)  # the new walls wait until the robot has left
            if not self._has_ended():
                self._live(until)
            if self._has_ended() and self._record_every:
                pad_samples(self.samples, self.life, self.world.robot, self._record_every, self._space.handles.state)
        return now - first

    def change(self, world: Scenario) -> None:
        """Put the robot into this world from the next step on.

        The world's own `changes` count from the start of the lifetime: past ones hold already, others come in their
        time. A wall that would appear where the robot stands waits until it has left.
        """
        for kind in ("robot", "task", "fitness", "physics"):
            new, old = getattr(world, kind), getattr(self.world, kind)
            if new != old:
                raise ValueError(f"the {kind} may not change during a lifetime: got {new.name} for {old.name}")
        if self._master is not None:
            self._master.change(world)
        self._phases = self._simulator.phases_of(world, self.steps, self._phase)
        self._enter(self._phases.pop(0))

    def look(self) -> Floats:
        """The inputs that the network will have in the next step, (inputs,)."""
        self._enter_due()
        self._move_to_new_walls()
        readings = np.zeros(self.individual.network.inputs)
        who = self.individual
        kernel = self._simulator.kernel(look, who.controller, who.network)
        kernel(self.life, self.setup, self._space.handles, readings)
        return readings

    def outcome(self) -> Outcome:
        """The metrics of the lifetime so far, of one step or more."""
        at_start = min(math.dist(self._start[:2], goal) for goal in self._first.goals_now.values())
        bound = bound_of(self.individual.controller.rule)
        world, pose = self._last_step  # since then, `change` may have moved goals or the robot
        return outcome_of(self.life, world, self.individual.side, at_start, bound, pose)

    def _lead(self, until: int) -> None:
        """Run the master until before a step; where it ends earlier, its weights no longer change."""
        master = self._master
        assert master is not None
        master.step(until - master.steps)
        if master._has_ended():
            master.life.track.kept[master.steps :] = 0.0

    def _has_ended(self) -> bool:
        return len(self.life.trials) > 0 and bool(self.life.tally[0]["over"])

    def _enter_due(self) -> None:
        """Begin the phases that the next step belongs to."""
        while self._phases and self._phases[0].step <= self.steps:
            self._enter(self._phases.pop(0))

    def _move_to_new_walls(self) -> None:
        """Put the robot among the walls of this phase, unless it stands in their way."""
        phase, handles = self._phase, self._space.handles
        if self._space is phase.space:
            return
        x, y = handles.state[:2].tolist()
        if gap(x, y, added(handles.walls, phase.walls)) >= self.world.robot.radius_m:
            phase.space.take_over(self._space)
            self._space = phase.space
            self._note_begin()

    def _note_begin(self) -> None:
        """Record that all phases that are due have begun: their walls stand."""
        for step in [step for step in self._not_begun if step <= self._phase.step]:
            number = self._not_begun.pop(step)
            if self._record_every:
                self.samples.phase_began[number] = self.steps * STEP_S

    def _enter(self, phase: Phase) -> None:
        """Begin a phase; its walls appear as soon as the robot is not in their way."""
        individual, lifetime, kind = self.individual, self.lifetime, self._kind
        self._phase, self.world = phase, phase.scenario
        if self.world.put is not None:
            self._space = phase.space  # there is room for it among the new walls
            self._space.place_robot(self.world.put)
        if self._space is phase.space:
            self._note_begin()
        if self.world.reset:
            genotype = self.life.genotype
            self.life.weights[:], self.life.synapse_state[:] = genotype.weights, genotype.synapse_state
            self.life.tally[0]["weight_change"] = 0.0
        self.setup = Setup(
            **{
                **kind.setup,
                "rate": kind.setup["rate"] * float(self.world.rate),
                "history": self._history,
                **({} if self._nominal is None else {"nominal": self._nominal}),
            },
            **world_setup(self.world, individual.side, self._start),
            gain=float(lifetime.gain_rad_s),
            noise_level=float(lifetime.noise),
            record_every=self._record_every,
            samples=self.samples,
        )

    def _live(self, until: int) -> None:
        live = self._kind.usual.call if self._is_usual else self._kind.live
        try:
            live(self.life, self.setup, self._space.handles, until)
        except Exception as error:  # machine code raises nothing, so it comes from compiling
            raise explained(own_parts(self.individual, self.world), error) from error
        self._last_step = self.world, self.pose
        self._check()

    def _check(self) -> None:
        """Check that the lifetime still has finite numbers."""
        life, who, tally = self.life, self.individual, tally_of(self.life)
        for group, scratch in zip(self.world.robot.sensors, life.senses.scratch, strict=True):
            if isinstance(group, Sensor):
                for reading, value in zip(group.readings, scratch, strict=True):
                    if not 0.0 <= value <= 1.0:
                        raise PartError(f"sensor {group.name}: {reading} must lie in [0, 1], `read` gave {value}")
        wiring, score = who.network.wiring, life.score["sum"][0] if self.world.fitness.step else 0.0
        where = f"on a {who.side} trial of scenario {self.world.name}"
        when = f"at step {tally.step - tally.lost} of {self.lifetime.steps}"
        if not math.isfinite(score):
            name = self.world.fitness.name
            raise PartError(f"fitness {name}: `step` gave infinite or nan values {where}; noticed {when}")
        if wiring is not None and not np.isfinite(life.activation).all():
            name = wiring.name
            raise PartError(f"wiring {name}: `neuron` gave infinite or nan activations {where}; noticed {when}")
        if tally.failed_signal:
            name, first = who.controller.adaptation.parts[0].__name__, tally.failed_signal
            raise PartError(f"change signal {name}: `signal` gave nan {where} at step {first} of {self.lifetime.steps}")
        where = f"{where}, controller {who.controller.name},"
        stored = life.weights, life.synapse_state.view(np.float64), tally.weight_change_sum
        if not all(np.isfinite(values).all() for values in stored):
            raise LostRobotError(f"{where} the rule {who.controller.rule.name} made weights infinite or nan {when}")
        if tally.lost or not math.isfinite(tally.behaviour_sum + tally.path_length + tally.goal_distance):
            raise LostRobotError(f"{where} the robot's pose stopped being finite or left the arena {when}")


def own_parts(individual: Individual, world: Scenario) -> list[type[OwnClass]]:
    """The classes of a lifetime's parts that are the user's own."""
    controller, wiring = individual.controller, individual.network.wiring
    parts = (controller.rule, wiring, world.fitness, world.task, world.physics, *world.robot.sensors)
    return own_of([*parts, *controller.adaptation.parts])
