"""What lifetimes that run one after the other share: the world's phases, spaces, kernels and workspaces."""

import math
from collections.abc import Callable
from dataclasses import replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.compiling.kernel import SameTypes, bind_parts, compiled, kernel, nothing
from epuckhebb.controller.genome import GenomePlan, make_plan
from epuckhebb.controller.network import Network
from epuckhebb.controller.own_class import stored
from epuckhebb.controller.plasticity.control import Control, Sign, signs
from epuckhebb.controller.plasticity.rule import EVERY_STEP, Rule, Schedule, make_schedule
from epuckhebb.controller.plasticity.rules.paper import Paper
from epuckhebb.controller.plasticity.update import Workspace, controller_parts, make_workspace
from epuckhebb.controller.random import normal_numbers
from epuckhebb.tmaze.changes import AT_ONCE
from epuckhebb.tmaze.faults import make_faults, sensor_faults
from epuckhebb.tmaze.fitness import initial_history, signal_number
from epuckhebb.tmaze.individual import Controller, NoAdaptation
from epuckhebb.tmaze.life import Lifetime
from epuckhebb.tmaze.lifetime import decide, live, live_in_turn, perceive, settle
from epuckhebb.tmaze.light import lights
from epuckhebb.tmaze.maze import Pose, Region, Side
from epuckhebb.tmaze.own_fitness import make_score, scored
from epuckhebb.tmaze.physics_engine import Space
from epuckhebb.tmaze.robot import OUTPUTS
from epuckhebb.tmaze.scenario import Scenario
from epuckhebb.tmaze.senses import SenseWorkspace, blinding, largest_distance_reading, sense_workspace, senses
from epuckhebb.tmaze.task import while_not_frozen

_PAPER = Paper()
_kernels: dict[tuple[object, ...], Any] = {}  # those that this process has used
_NOWHERE = Region(math.inf, -math.inf, math.inf, -math.inf)  # the arm of a task that has no correct side


class Phase(NamedTuple):
    """The world from a step on: its scenario, and the space with its walls."""

    step: int
    scenario: Scenario
    space: Space
    walls: Floats


class Kind(NamedTuple):
    """What individuals with the same controller and network share.

    live: the kernel. usual: the same, for individuals without nominal statistics and a history of their own; their
    records are made here, so they have the same types. setup: the fields of `Setup` that follow from the controller.
    kept: as in `control.Track`; None where changes of the weights are not measured.
    """

    live: Callable[..., None]
    usual: SameTypes
    setup: dict[str, Any]
    plan: GenomePlan
    synapse_state: NDArray[np.void]
    signs: Floats | None
    workspace: Workspace
    senses: SenseWorkspace
    kept: Floats | None


class Simulator:
    """What lifetimes that run one after the other share: the world's spaces, kernels and workspaces.

    fallback_rule: individuals without a rule share its kernel, with N = 0. The results are bit-identical, and there is
    one kernel less to compile. kept: the changes of the weights in so many steps are kept; in none: not measured.
    """

    def __init__(self, world: Scenario, lifetime: Lifetime, fallback_rule: Rule = _PAPER, kept: int = 0) -> None:
        self.world, self.lifetime, self._fallback_rule, self._kept = world, lifetime, fallback_rule, kept
        self.phases = self.make_phases(world)
        self._kinds: dict[tuple[int, int], Kind] = {}
        self._room: dict[int, Floats] = {}  # for changes of so many weights

    @cached_property
    def master_simulator(self) -> "Simulator":
        """Another one, for lifetimes that others follow meanwhile: it keeps all changes of their weights."""
        return Simulator(self.world, self.lifetime, self._fallback_rule, self.lifetime.steps)

    def make_phases(self, world: Scenario, since: int = 0, current: Phase | None = None) -> list[Phase]:
        """The phases of a world from step `since` on. current: the phase until then."""
        begins = world.phases
        steps = [step for step, _ in begins]
        first = max(number for number, step in enumerate(steps) if step < since or number == 0)
        phases: list[Phase] = []
        for step, now in begins[first:]:
            if phases and step >= self.lifetime.steps:
                break  # it changes after the end
            walls = now.boxes
            last = phases[-1] if phases else current
            same = last and np.array_equal(last.walls, walls) and last.scenario.wall_friction == now.wall_friction
            space = last.space if last and same else now.physics.space(walls, now)
            has_begun = step < since and step > 0  # what was to happen at once has happened
            phases.append(Phase(step, replace(now, **AT_ONCE) if has_begun else now, space, walls))
        return phases

    def kernel(self, page: Callable[..., None], controller: Controller, network: Network) -> Any:
        """A function of `lifetime.py`, compiled for such individuals in this world."""
        rule = self._fallback_rule if controller.is_ga_alone else controller.rule
        schedule = make_schedule(rule)._replace(tracks=self._kept > 0)
        return lifetime_kernel(type(rule), controller.adaptation, network, self.world, page, schedule)

    def kind(self, controller: Controller, network: Network) -> Kind:
        """What individuals with this controller and network share."""
        key = (id(controller), id(network))
        if key in self._kinds:
            return self._kinds[key]
        rule, adaptation, robot = controller.rule, controller.adaptation, self.world.robot
        compiled_for = self._fallback_rule if controller.is_ga_alone else rule
        is_own_rule = compiled_for is rule
        room = np.empty((self._kept, 2, network.synapses))
        factor = self.lifetime.gain_rad_s / rule.N_gain_rad_s if rule.N_gain_rad_s else 1.0
        kernel = self.kernel(live_in_turn, controller, network)
        self._kinds[key] = kind = Kind(
            live=kernel,
            usual=SameTypes(kernel),
            setup={
                "rate": float(rule.N) * factor if is_own_rule and rule.control is Control.none else 0.0,
                "floor": float(rule.floor),
                "signal": signal_number(rule),
                "history": initial_history(rule),
                "rule": rule.numbers() if is_own_rule else (0.0,) * len(compiled_for.settings()),
                "adaptation": adaptation.numbers(),
                "nominal": adaptation.no_nominal(robot),
            },
            plan=make_plan(network, type(rule)),
            synapse_state=stored(compiled_for.synapse_state, network.synapses),
            signs=None if rule.sign is Sign.shuffled else signs(rule.sign, network.synapses),
            workspace=make_workspace(network),
            senses=sense_workspace(robot, self.world.physics),
            kept=self._room.setdefault(network.synapses, room) if self._kept else None,
        )
        return kind


def lifetime_kernel(
    rule: type[Rule],
    adaptation: NoAdaptation,
    network: Network,
    world: Scenario,
    page: Callable[..., None] = live_in_turn,
    schedule: Schedule = EVERY_STEP,
) -> Any:
    """`live_in_turn`, or another page that takes the parts of a lifetime (`look`), compiled or from the cache.

    schedule: of the rule. Of the world only robot, task, fitness and physics matter, and of adaptation, task and
    fitness only the functions.
    """
    robot, task, physics, scoring = world.robot, world.task, world.physics, scored(world.fitness)
    values = (rule, schedule, adaptation.parts, network, robot, type(task), scoring, physics)
    if (page, values) in _kernels:
        return _kernels[page, values]
    check_inputs(network, world)
    parts = {
        "INPUTS": network.inputs,
        "OUTPUT": network.first_output,
        "HAS_TRIALS": task.has_trials,
        "HAS_SCORE": scoring.step is not None,
        "score": make_score(scoring),
        "sense": senses(robot, physics),
        "blind": blinding(robot),
        "nearest": largest_distance_reading(robot),
        "draw_noise": normal_numbers(robot.inputs),
        **controller_parts(rule, network, schedule),
        **adaptation.hooks(robot, network.post[0])._asdict(),
        **({"open_gate": while_not_frozen} if schedule.freezes else {}),
        "apply_sensor_faults": sensor_faults(robot),
        **task.hooks(robot.inputs)._asdict(),
        "move": physics.mover(robot),
        "place": physics.placer() or nothing,
        "record_tilt": physics.record_tilt(),
    }
    for block in (perceive, decide, settle, live):
        parts[block.__name__] = compiled(bind_parts(block, parts))
    _kernels[page, values] = made = kernel(page, values, **parts)
    return made


def check_inputs(network: Network, world: Scenario) -> None:
    """Check that a network fits the sensors of a robot and the reward of its task; else a ValueError."""
    robot, task = world.robot, world.task
    reward = f" and the reward of task={task.name}" if task.gives_reward else ""
    if network.inputs != world.inputs:
        readings = f"{world.inputs}, the readings of robot {robot.name}{reward}"
        raise ValueError(f"network.layers must begin with {readings}, got {list(network.layers)}")
    if network.outputs != OUTPUTS:
        raise ValueError(f"network.layers must end with {OUTPUTS}, for the wheels, got {list(network.layers)}")


def world_setup(world: Scenario, side: Side, start: Pose) -> dict[str, Any]:
    """The fields of `Setup` that follow from a world. start: of each trial."""
    goals, maze, task = world.goals_now, world.maze, world.task
    lamp_on = side == "right" if world.lamp_on is None else world.lamp_on
    return {
        "lit": lights(world.light, world.lamp, lamp_on, world.sun_turn_deg, world.second_lamp),
        "goal_x": float(goals[side].x),
        "goal_y": float(goals[side].y),
        "goal_radius": float(maze.goal_radius_m),
        "arm": _NOWHERE if task.has_trials else Region(*map(float, maze.arms[side])),
        "arena": float(maze.arena_m),
        "faults": make_faults(world),
        "terms": task.terms(goals, start),
        "fitness": world.fitness.numbers() if world.fitness.step else (),
    }
