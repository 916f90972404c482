"""Many lives, one after the other in the same space, on as many threads as asked for; results do not depend on that.

No robot knows of another. A life that meets a change of its world is paused, and goes on in the changed world.
"""

import inspect
import math
import re
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from epuckhebb.sim import fitness
from epuckhebb.sim.adaptation.adaptation import AdaptationRoom, adaptation_room, gate_numbers
from epuckhebb.sim.adaptation.change_signal import BaselineOfSide, check_baseline, no_baseline
from epuckhebb.sim.adaptation.homeostasis import check_patterns, no_patterns
from epuckhebb.sim.adaptation.self_check.corrections import Corrections, check_corrections
from epuckhebb.sim.controller import GA_ALONE, Controller
from epuckhebb.sim.faults import Faults, lag_of
from epuckhebb.sim.fitness import LIGHT_CODE_SENSORS, Signal
from epuckhebb.sim.genome import WEIGHTS, GenomePlan, plan_of
from epuckhebb.sim.lifetime import (
    Birth,
    Danced,
    Life,
    Lifetime,
    Plasticity,
    Room,
    Samples,
    Trial,
    born,
    count_dance,
    empty_samples,
    kernel_of,
    room_for,
    stay,
)
from epuckhebb.sim.light import lights
from epuckhebb.sim.maze import Pose, Region, Side, added, boxes, gap
from epuckhebb.sim.network import HIDDEN, OUTPUTS, PAPER_NETWORK, Network, weights_at_birth
from epuckhebb.sim.physics import PymunkSpace
from epuckhebb.sim.plasticity.control import Sign, signs
from epuckhebb.sim.plasticity.paper import Paper
from epuckhebb.sim.plasticity.rule import (
    BIRTH_RANGE,
    Births,
    NoRule,
    Rule,
    coefficients,
    kept_at_birth,
    modulatory_weights,
    values_of,
)
from epuckhebb.sim.plasticity.update import lengths_at_birth
from epuckhebb.sim.random import Stream, rng
from epuckhebb.sim.robot import STEP_S
from epuckhebb.sim.scenario import Scenario
from epuckhebb.sim.task import NO_TRIALS

_LIVES_PER_BLOCK = 50  # lifetimes that share a space, one after the other
_SUMS = ("behaviour_sum", "weight_change_sum", "path_length", "goal_distance")  # of a tally, from which outcomes come
_NOWHERE = Region(math.inf, -math.inf, math.inf, -math.inf)  # the arm of a task in which neither way is the right one
_MESSAGE_LINES = 10  # of what is told of a rule that does not compile
_COLOUR = re.compile(r"\x1b\[[0-9;]*m")  # numba colours its messages where it can
_MAKES_AN_ARRAY = "Only accept returning of array passed into the function"  # what it says without memory of its own


class Outcome(NamedTuple):
    """What a lifetime came to.

    time_to_goal: s, first time within 5 cm of the goal, nan if never. path_length: m. final_distance: m from the goal.
    behaviour: mean combined fitness over the steps. reward: goal reward at the end. weight_change_mean,
    weight_change_final: sum over weights of |W - W_gene|. contact_fraction: share of steps with a distance reading
    above 0.8. success: whether the robot was within 5 cm of its goal at the last step. fitness: how well it did its
    task; the paper's final fitness unless that is another. steps: lived.
    """

    time_to_goal: float
    path_length: float
    final_distance: float
    behaviour: float
    reward: float
    weight_change_mean: float
    weight_change_final: float
    contact_fraction: float
    success: bool
    fitness: float
    steps: int

    @property
    def trials(self) -> NDArray[np.void]:
        """The trials of which the life was, records of `epuckhebb.sim.task.TRIAL`; none where it is one."""
        return NO_TRIALS


class OutcomeOfTrials(Outcome):
    """What a lifetime of many trials came to."""

    _trials: NDArray[np.void]

    @property
    def trials(self) -> NDArray[np.void]:
        """See `Outcome`."""
        return self._trials

    @classmethod
    def of(cls, outcome: Outcome, trials: NDArray[np.void]) -> "OutcomeOfTrials":
        """What came of the whole life, with its trials."""
        told = cls(*outcome)
        told._trials = trials
        return told


@dataclass(frozen=True, kw_only=True)
class Individual:
    """One who shall live: genes, the network that they are for, a side, a controller, a noise key, a start.

    task_key: of what its task draws; those who are compared have the same, and so have both sides.
    genes: of all parts of the genome (`epuckhebb.sim.genome`), 234 in the paper. start: None where the maze has it.
    signs: of the plastic updates, (synapses,), None for what the rule's sign says; shuffled ones must be given.
    baseline: what an adaptation compares with. corrections: what a self-check found to correct, None for nothing.
    danced: the dance before its life, if it is part of the lifetime. record: whether samples are kept.
    """

    genes: NDArray[np.float64]
    side: Side
    key: np.uint64
    controller: Controller = GA_ALONE
    network: Network = PAPER_NETWORK
    start: Pose | None = None
    task_key: int = 0
    signs: NDArray[np.float64] | None = None
    baseline: BaselineOfSide | None = None
    corrections: Corrections | None = None
    danced: Danced | None = None
    record: bool = False


class LostRobotError(ArithmeticError):
    """A robot's pose or weights stopped being finite, or it left the arena, so nothing that it did means anything."""


class RuleError(ValueError):
    """A plasticity rule cannot be compiled; says why."""


def live_block(
    individuals: Sequence[Individual], scenario: Scenario, lifetime: Lifetime, threads: int = 1
) -> list[tuple[Outcome, Samples]]:
    """Live many lifetimes in the same scenario; the outcomes come in the order of `individuals`, whatever `threads`.

    Samples have length 0 where a life is not recorded.

    Raises:
        ValueError: genes, network, robot and rule do not fit each other.
        RuleError: a rule does not compile.
        LostRobotError: a pose or a weight stopped being finite; the message says whose and when.
    """
    size = max(1, min(_LIVES_PER_BLOCK, -(-len(individuals) // threads)))
    blocks = [individuals[first : first + size] for first in range(0, len(individuals), size)]
    rules = [type(who.controller.rule) for who in individuals if not who.controller.adaptation.acts]
    spare = next((rule for rule in rules if rule is not NoRule and not rule.evolved), Paper)
    # A pool even for one thread: Ctrl-C while numba builds a result would crash the process.
    with ThreadPoolExecutor(threads) as pool:
        lived = list(pool.map(lambda block: _live_in_one_space(block, scenario, lifetime, spare), blocks))
    return [life for block in lived for life in block]


class _Phase(NamedTuple):
    """The world from a step on: its scenario and the space with its walls."""

    step: int
    scenario: Scenario
    space: PymunkSpace
    walls: NDArray[np.float64]


def _live_in_one_space(
    individuals: Sequence[Individual], scenario: Scenario, lifetime: Lifetime, spare: type[Rule]
) -> list[tuple[Outcome, Samples]]:
    robot = scenario.robot
    if lifetime.gain_rad_s > robot.motor_limit_rad_s:
        raise ValueError(
            f"lifetime.gain_rad_s must be more than 0 and at most {robot.motor_limit_rad_s:g}, the fastest of robot "
            f"{robot.name}, got {lifetime.gain_rad_s}"
        )
    phases: list[_Phase] = []
    for step, world in scenario.phases:
        if step >= lifetime.steps:
            break  # it changes after the end
        walls = boxes(world.maze, world.obstacles, world.layout)
        before = phases[-1] if phases else None
        same = before and np.array_equal(before.walls, walls) and before.scenario.wall_friction == world.wall_friction
        space = before.space if before and same else PymunkSpace(walls, world.robot, world.wall_friction)
        phases.append(_Phase(step, world, space, walls))
    more_faults = any(_faults(world).more for _, world in scenario.phases)
    kinds: dict[tuple[int, int], _Kind] = {}
    lived = []
    for who in individuals:
        place = (id(who.controller), id(who.network))
        if place not in kinds:
            kinds[place] = _kind(who.controller, who.network, scenario, lifetime.gain_rad_s, more_faults, spare)
        lived.append(_live_one(who, kinds[place], phases, lifetime))
    return lived


class _Kind(NamedTuple):
    """What individuals with the same controller and network share.

    untouched: what an adaptation would keep, of who has none and never writes there; None with an adaptation.
    """

    live: Callable[..., None]
    plasticity: Plasticity
    plan: GenomePlan
    kept: NDArray[np.void]
    signs: NDArray[np.float64] | None
    baseline: BaselineOfSide
    room: Room
    untouched: AdaptationRoom | None
    no_samples: Samples


def _kind(
    controller: Controller, network: Network, world: Scenario, gain: float, more_faults: bool, spare: type[Rule]
) -> _Kind:
    """What individuals of this kind share.

    gain: of their wheels [rad/s]. spare: a rule of others who live beside them, or the paper's. Who has no rule lives
    in its kernel, with N = 0, to the same bits and as fast: one kernel less to compile.
    """
    rule, adaptation, robot = controller.rule, controller.adaptation, world.robot
    if rule.signal is Signal.light_code and (robot.lights, robot.distances) != LIGHT_CODE_SENSORS:
        raise ValueError(
            f"hebbian.signal=light_code is of the published program, whose robot has 8 light and 8 distance sensors; "
            f"robot {robot.name} has {robot.lights} and {robot.distances}"
        )
    compiled_for = spare if controller.is_ga_alone else type(rule)
    numbers = rule.numbers() if compiled_for is type(rule) else dict.fromkeys(compiled_for.settings(), 0.0)
    return _Kind(
        live=kernel_of(
            compiled_for,
            adaptation.change_signal,
            network,
            robot,
            follows_walls=adaptation.follows_walls,
            self_check=adaptation.self_check,
            homeostatic=adaptation.homeostasis,
            more_faults=more_faults,
            task=world.task,
        ),
        plasticity=Plasticity(
            float(rule.N) * rule.pace(gain) if compiled_for is type(rule) else 0.0,
            float(rule.floor),
            int(rule.signal),
            tuple(numbers.values()),
            gate_numbers(adaptation),
        ),
        plan=plan_of(network, type(rule)),
        kept=kept_at_birth(compiled_for, network),
        signs=None if rule.sign is Sign.shuffled else signs(rule.sign, network.synapses),
        baseline=no_baseline(robot.inputs),
        room=room_for(network, robot),
        untouched=None if adaptation.acts else adaptation_room(robot),
        no_samples=empty_samples(0, network),
    )


def _live_one(who: Individual, kind: _Kind, phases: list[_Phase], lifetime: Lifetime) -> tuple[Outcome, Samples]:
    first, rule = phases[0].scenario, type(who.controller.rule)
    if who.baseline is not None:
        check_baseline(who.baseline, first.robot.inputs)
    if who.controller.adaptation.homeostasis:
        check_patterns(kind.baseline if who.baseline is None else who.baseline, first.robot.lights)
    if who.corrections is not None:
        check_corrections(who.corrections, first.robot)
    of_updates = kind.signs if who.signs is None else who.signs
    if of_updates is None:
        raise ValueError("a rule with sign=shuffled needs the signs of its updates, Individual.signs")
    parts = values_of(rule, who.network, kind.plan.split(who.genes))
    inherited = parts[WEIGHTS]
    if who.controller.rule.births is Births.random:
        inherited = rng(int(who.key), Stream.births).uniform(-BIRTH_RANGE, BIRTH_RANGE, who.network.synapses)
    weights = weights_at_birth(inherited)
    birth = Birth(
        weights,
        kind.kept,
        coefficients(rule, who.network, parts),
        modulatory_weights(rule, parts, who.controller.rule.reward),
        lengths_at_birth(rule, who.network, weights),
        of_updates,
    )
    trials = first.task.trials_at_birth(who.side, who.task_key)
    over = kind.untouched
    if over is None or who.corrections is not None:
        over = adaptation_room(first.robot, who.corrections)
    life = born(birth, who.network, first.robot, kind.room, over, trials)
    record_every = lifetime.record_every if who.record else 0
    samples = empty_samples(-(-lifetime.steps // record_every), who.network) if record_every else kind.no_samples

    if who.danced is not None:
        count_dance(life, who.danced, lifetime.gain_rad_s, record_every, samples)

    start = first.maze.start if who.start is None else who.start

    def live_until(step: int, phase: _Phase, space: PymunkSpace) -> None:
        try:
            kind.live(
                life,
                birth,
                space.handles,
                lights(phase.scenario.light, phase.scenario.lamp, lamp_on=who.side == "right"),
                trial_of(phase.scenario, who.side, start),
                kind.plasticity,
                kind.baseline if who.baseline is None else who.baseline,
                float(lifetime.gain_rad_s),
                float(lifetime.noise),
                who.key,
                step,
                record_every,
                samples,
            )
        except Exception as error:  # machine code raises nothing, so it comes from compiling
            raise RuleError(_explained(rule, error)) from error
        _check(who, life, phase.scenario, lifetime)

    space = phases[0].space
    space.place_robot(start)
    for phase, until in zip(phases, [*(later.step for later in phases[1:]), lifetime.steps], strict=True):
        while space is not phase.space and (now := int(life.tally["step"][0])) < until and not _is_over(life):
            if _is_in_the_way(space, phase):
                live_until(now + 1, phase, space)  # new walls appear where the robot is not
            else:
                phase.space.take_over(space)
                space = phase.space
        if not _is_over(life):
            live_until(until, phase, space)
    if _is_over(life) and record_every:
        stay(samples, life, first.robot, record_every, space.handles.state)
    return _outcome(life, phases, start), samples


def _is_over(life: Life) -> bool:
    return bool(life.tally["over"][0])


def _is_in_the_way(space: PymunkSpace, phase: _Phase) -> bool:
    """Whether the robot of a space stands where walls of a phase would be that are not in its space."""
    x, y = space.handles.state[:2].tolist()
    return gap(x, y, added(space.handles.walls, phase.walls)) < phase.scenario.robot.radius_m


def trial_of(scenario: Scenario, side: Side, start: Pose | None = None) -> Trial:
    """What a robot on this side is to do in a world, and what is wrong with it there.

    start: of each trial, if there are many; None where the maze has it.
    """
    goals, maze, task = scenario.goals_now, scenario.maze, scenario.task
    goal = goals[side]
    return Trial(
        float(goal.x),
        float(goal.y),
        float(maze.goal_radius_m),
        _NOWHERE if task.has_trials else Region(*map(float, maze.arms[side])),
        float(maze.arena_m),
        _faults(scenario),
        task.terms(goals, maze.start if start is None else start),
    )


def _faults(scenario: Scenario) -> Faults:
    return Faults(
        np.array(scenario.dead_sensors, np.int64),
        float(scenario.distance_gain),
        float(scenario.distance_offset),
        float(scenario.left_wheel),
        float(scenario.right_wheel),
        float(scenario.left_slip),
        float(scenario.right_slip),
        lag_of(scenario.mass_ratio),
    )


def _check(who: Individual, life: Life, scenario: Scenario, lifetime: Lifetime) -> None:
    """Refuse to go on with a life that makes no sense any more."""
    lost = bool(life.tally["lost"][0])
    sums = {name: float(life.tally[name][0]) for name in _SUMS}
    finite = bool(np.isfinite(life.weights).all() and np.isfinite(life.kept.view(np.float64)).all())
    finite = finite and math.isfinite(sums["weight_change_sum"])
    if finite and not lost and all(map(math.isfinite, sums.values())):
        return
    where = f"on a {who.side} trial of scenario {scenario.name}, controller {who.controller.name},"
    when = f"at step {int(life.tally['step'][0]) - lost} of {lifetime.steps}"
    if not finite:
        raise LostRobotError(
            f"{where} the rule {type(who.controller.rule).__name__} made weights, their change, or what synapses keep, "
            f"infinite or nan; noticed {when}"
        )
    raise LostRobotError(f"{where} the robot's pose stopped being finite or left the arena {when}")


def _outcome(life: Life, phases: list[_Phase], start: Pose) -> Outcome:
    tally, world = life.tally[0], phases[-1].scenario
    goal_distance, steps = float(tally["goal_distance"]), int(tally["step"])
    behaviour, reward = float(tally["behaviour_sum"]) / steps, fitness.reward(goal_distance)
    nearest = min(math.dist(start[:2], goal) for goal in phases[0].scenario.goals_now.values())
    outcome = Outcome(
        float(tally["time_to_goal"]),
        float(tally["path_length"]),
        goal_distance,
        behaviour,
        reward,
        float(tally["weight_change_sum"]) / steps,
        float(tally["weight_change"] + tally["scaling"]),
        int(tally["contacts"]) / steps,
        goal_distance < world.maze.goal_radius_m,
        world.task.fitness(behaviour, reward, life.trials, nearest),
        steps,
    )
    return OutcomeOfTrials.of(outcome, life.trials) if len(life.trials) else outcome


def _explained(rule: type[Rule], error: Exception) -> str:
    """Why a rule does not compile, in ten lines at most: what numba says last of the function farthest in."""
    text = _COLOUR.sub("", str(error))
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    causes = [number for number, line in enumerate(lines) if line.startswith("Rejected as")]
    told = [line for line in lines[causes[-1] + 1 if causes else 0 :] if "Failed in nopython mode" not in line]
    told = told[: next((number for number, line in enumerate(told) if line.startswith("During: Pass")), None)]
    if _MAKES_AN_ARRAY in text:
        told = ["it makes an array, and a synapse has only numbers: keep what it remembers in `kept`"]
    heading = f"rule {rule.__name__} of {inspect.getsourcefile(rule.synapse)} does not compile:"
    return "\n".join([heading, *dict.fromkeys(told)][:_MESSAGE_LINES])


def load_kernel(
    controller: Controller = GA_ALONE, network: Network | None = None, scenario: Scenario | None = None
) -> None:
    """Load or compile what lives of this kind need, as the first of them would.

    Raises:
        ValueError: network, robot and rule do not fit each other.
        RuleError: the rule does not compile.
    """
    world = scenario or Scenario()
    net = network or Network((world.inputs, *HIDDEN, OUTPUTS), world.task.tells_reward)
    unborn = Individual(
        genes=np.zeros(plan_of(net, type(controller.rule)).genes),
        side="left",
        controller=controller,
        network=net,
        signs=np.ones(net.synapses),
        baseline=no_patterns(no_baseline(world.robot.inputs), world.robot.lights),
        key=np.uint64(0),
    )
    live_block([unborn], world, Lifetime(duration_s=STEP_S, gain_rad_s=min(1.0, world.robot.motor_limit_rad_s)))
