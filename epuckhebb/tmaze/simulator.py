"""What lifetimes that run one after the other share: the world's phases, spaces, kernels and workspaces."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.compiling.kernel import SameTypes
from epuckhebb.controller.genome import GenomePlan, plan_of
from epuckhebb.controller.network import Network
from epuckhebb.controller.own_class import stored
from epuckhebb.controller.plasticity.control import Sign, signs
from epuckhebb.controller.plasticity.rule import Rule, schedule_of
from epuckhebb.controller.plasticity.rules.paper import Paper
from epuckhebb.controller.plasticity.update import Workspace, workspace_for
from epuckhebb.tmaze.changes import AT_ONCE
from epuckhebb.tmaze.faults import Faults, faults_of
from epuckhebb.tmaze.fitness import initial_history, signal_number
from epuckhebb.tmaze.individual import Controller
from epuckhebb.tmaze.life import Lifetime
from epuckhebb.tmaze.lifetime import live
from epuckhebb.tmaze.lifetime_kernel import kernel_of
from epuckhebb.tmaze.light import lights
from epuckhebb.tmaze.maze import Pose, Region, Side
from epuckhebb.tmaze.physics_engine import Space
from epuckhebb.tmaze.samples import Samples, empty_samples
from epuckhebb.tmaze.scenario import Scenario
from epuckhebb.tmaze.senses import SenseWorkspace, sense_workspace

_PAPER = Paper()
_NOWHERE = Region(math.inf, -math.inf, math.inf, -math.inf)  # the arm of a task that has no correct side


class Phase(NamedTuple):
    """The world from a step on: its scenario, the space with its walls, and the faults of the robot."""

    step: int
    scenario: Scenario
    space: Space
    walls: Floats
    faults: Faults


class Kind(NamedTuple):
    """What individuals with the same controller and network share.

    live: the kernel. usual: the same, for individuals without nominal statistics and a history of their own; their
    records are made here, so they have the same types. setup: the fields of `Setup` that follow from the controller.
    """

    live: Callable[..., None]
    usual: SameTypes
    setup: dict[str, Any]
    plan: GenomePlan
    synapse_state: NDArray[np.void]
    signs: Floats | None
    workspace: Workspace
    senses: SenseWorkspace
    no_samples: Samples


class Simulator:
    """What lifetimes that run one after the other share: the world's spaces, kernels and workspaces.

    fallback_rule: individuals without a rule share its kernel, with N = 0. The results are bit-identical, and there is
    one kernel less to compile.
    """

    def __init__(self, world: Scenario, lifetime: Lifetime, fallback_rule: Rule = _PAPER) -> None:
        self.world, self.lifetime, self._fallback_rule = world, lifetime, fallback_rule
        self.phases = self.phases_of(world)
        self._kinds: dict[tuple[int, int], Kind] = {}

    def phases_of(self, world: Scenario, since: int = 0, before: Phase | None = None) -> list[Phase]:
        """The phases of a world from step `since` on. before: the phase until then."""
        begins = world.phases
        steps = [step for step, _ in begins]
        first = max(number for number, step in enumerate(steps) if step < since or number == 0)
        phases: list[Phase] = []
        for step, now in begins[first:]:
            if phases and step >= self.lifetime.steps:
                break  # it changes after the end
            walls = now.boxes
            last = phases[-1] if phases else before
            same = last and np.array_equal(last.walls, walls) and last.scenario.wall_friction == now.wall_friction
            space = last.space if last and same else now.physics.space(walls, now)
            has_begun = step < since and step > 0  # what was to happen at once has happened
            phases.append(Phase(step, replace(now, **AT_ONCE) if has_begun else now, space, walls, faults_of(now)))
        return phases

    def kernel(self, page: Callable[..., None], controller: Controller, network: Network) -> Any:
        """A function of `lifetime.py`, compiled for such individuals in this world."""
        rule = self._fallback_rule if controller.is_ga_alone else controller.rule
        return kernel_of(type(rule), controller.adaptation, network, self.world, page, schedule_of(rule))

    def kind_of(self, controller: Controller, network: Network) -> Kind:
        """What individuals with this controller and network share."""
        place = (id(controller), id(network))
        if place in self._kinds:
            return self._kinds[place]
        rule, adaptation, robot = controller.rule, controller.adaptation, self.world.robot
        compiled_for = self._fallback_rule if controller.is_ga_alone else rule
        own = compiled_for is rule
        factor = self.lifetime.gain_rad_s / rule.N_gain_rad_s if rule.N_gain_rad_s else 1.0
        kernel = self.kernel(live, controller, network)
        self._kinds[place] = kind = Kind(
            live=kernel,
            usual=SameTypes(kernel),
            setup={
                "rate": float(rule.N) * factor if own else 0.0,
                "floor": float(rule.floor),
                "signal": signal_number(rule),
                "history": initial_history(rule),
                "rule": rule.numbers() if own else (0.0,) * len(compiled_for.settings()),
                "adaptation": adaptation.numbers(),
                "nominal": adaptation.no_nominal(robot),
            },
            plan=plan_of(network, type(rule)),
            synapse_state=stored(compiled_for.synapse_state, network.synapses),
            signs=None if rule.sign is Sign.shuffled else signs(rule.sign, network.synapses),
            workspace=workspace_for(network),
            senses=sense_workspace(robot, self.world.physics),
            no_samples=empty_samples(0, network, self.world.physics),
        )
        return kind


def world_setup(world: Scenario, side: Side, start: Pose, faults: Faults) -> dict[str, Any]:
    """The fields of `Setup` that follow from a world. start: of each trial. faults: of this world."""
    goals, maze, task = world.goals_now, world.maze, world.task
    lamp_on = side == "right" if world.lamp_on is None else world.lamp_on
    return {
        "lit": lights(world.light, world.lamp, lamp_on, world.sun_turn_deg, world.second_lamp),
        "goal_x": float(goals[side].x),
        "goal_y": float(goals[side].y),
        "goal_radius": float(maze.goal_radius_m),
        "arm": _NOWHERE if task.has_trials else Region(*map(float, maze.arms[side])),
        "arena": float(maze.arena_m),
        "faults": faults,
        "terms": task.terms(goals, start),
        "fitness": world.fitness.numbers() if world.fitness.step else (),
    }
