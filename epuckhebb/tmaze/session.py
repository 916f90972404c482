"""A lifetime in progress, run any number of steps at a time; at its end, its outcome: success and all other metrics.

A lifetime that is run in pieces is bit-identical to the same lifetime run at once. `epuckhebb.tmaze.batch` runs whole
lifetimes; with `Session` one can watch a robot, or change its world, between two steps.
"""

from collections.abc import Sequence

import numpy as np

from epuckhebb.controller.arrays import Floats
from epuckhebb.tmaze import fitness
from epuckhebb.tmaze.block import Block
from epuckhebb.tmaze.individual import Individual
from epuckhebb.tmaze.life import Life, Lifetime, pad_samples
from epuckhebb.tmaze.lifetime import look
from epuckhebb.tmaze.maze import Pose, added, gap
from epuckhebb.tmaze.outcome import Outcome
from epuckhebb.tmaze.robot import STEP_S
from epuckhebb.tmaze.scenario import Scenario
from epuckhebb.tmaze.simulator import Phase, Simulator


class Session:
    """A lifetime in progress, run with `step`, in a world that `change` may replace at any time.

    individual, lifetime: as given. life: the present state. samples: what is recorded, of length 0 where nothing is.
    block: the lifetime, as machine code has it.

    simulator: shared by lifetimes that run one after the other; without it, any number of sessions may be in progress.
    others: individuals of the same block, if all lifetimes are run at once, in one step of their whole length.
    """

    def __init__(
        self,
        individual: Individual,
        world: Scenario,
        lifetime: Lifetime | None = None,
        *,
        simulator: Simulator | None = None,
        others: Sequence[Individual] = (),
    ) -> None:
        self.individual, self.lifetime = individual, Lifetime() if lifetime is None else lifetime
        master, history = individual.master, None
        if simulator is None:
            simulator = Simulator(world, self.lifetime, kept=int(master is not None))
        self._simulator = simulator
        self._phases = list(simulator.phases)
        if individual.previous is not None:
            previous = Session(individual.previous, world, self.lifetime, simulator=simulator)
            previous.step(self.lifetime.steps)
            tally, (steps, summed) = previous.life.tally[0], previous.block.history
            history = fitness.History(
                steps + float(tally["step"] - tally["began"]), summed + float(tally["undirected_sum"])
            )
        self._master: Session | None = None
        if master is not None:
            self._master = Session(master, world, self.lifetime, simulator=simulator.master_simulator)
        leads = None if self._master is None else self._master.block
        self.block: Block = Block([individual, *others], self.lifetime, simulator, history=history, master=leads)
        self.life: Life = self.block.life
        self.samples = self.block.samples
        self._not_begun = {step: number for number, (step, _) in enumerate(world.phases)}
        self._space = self._phases[0].space
        self._space.place_robot(self.block.starts[0])
        self._enter(self._phases.pop(0))

    @property
    def world(self) -> Scenario:
        """The present world."""
        return self.block.world

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
                    self.block.live(self._space, self.steps + 1)  # the new walls wait until the robot has left
            if not self._has_ended():
                self.block.live(self._space, until)
            if self._has_ended() and self.block.record_every:
                pad_samples(
                    self.samples, self.life, self.world.robot, self.block.record_every, self._space.handles.state
                )
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
        self._phases = self._simulator.make_phases(world, self.steps, self._phase)
        self._enter(self._phases.pop(0))

    def look(self) -> Floats:
        """The inputs that the network will have in the next step, (inputs,)."""
        self._enter_due()
        self._move_to_new_walls()
        readings = np.zeros(self.individual.network.inputs)
        who = self.individual
        kernel = self._simulator.kernel(look, who.controller, who.network)
        kernel(self.life, self.block.setup, self._space.handles, readings)
        return readings

    def outcome(self) -> Outcome:
        """The metrics of the lifetime so far, of one step or more."""
        return self.block.outcomes()[0]

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
            if self.block.record_every:
                self.samples.phase_began[number] = self.steps * STEP_S

    def _enter(self, phase: Phase) -> None:
        """Begin a phase; its walls appear as soon as the robot is not in their way."""
        self._phase, life = phase, self.life
        self.block.enter(phase.scenario)
        if self.world.put is not None:
            self._space = phase.space  # there is room for it among the new walls
            self._space.place_robot(self.world.put)
        if self._space is phase.space:
            self._note_begin()
        if self.world.reset:
            life.weights[:], life.synapse_state[:] = life.genotype.weights, life.genotype.synapse_state
            life.tally[0]["weight_change"] = 0.0
