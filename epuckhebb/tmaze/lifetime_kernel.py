"""The compiled lifetime: `lifetime.live` with the parts of a robot, a network, a rule, an adaptation and a task."""

from collections.abc import Callable
from typing import Any

from epuckhebb.controller.compiling.kernel import compiled, kernel, with_parts
from epuckhebb.controller.network import Network
from epuckhebb.controller.plasticity.rule import EVERY_STEP, Rule, Schedule
from epuckhebb.controller.plasticity.update import controller_parts
from epuckhebb.controller.random import normal_numbers
from epuckhebb.tmaze.faults import sensor_faults
from epuckhebb.tmaze.individual import NoAdaptation
from epuckhebb.tmaze.lifetime import decide, live, perceive, settle
from epuckhebb.tmaze.own_fitness import score_of, scored
from epuckhebb.tmaze.physics.pymunk import mover_of_all
from epuckhebb.tmaze.robot import OUTPUTS, Robot
from epuckhebb.tmaze.scenario import Scenario
from epuckhebb.tmaze.senses import blinding, largest_distance_reading, senses
from epuckhebb.tmaze.task import Task

_kernels: dict[tuple[object, ...], Any] = {}  # those that this process has used


def kernel_of(
    rule: type[Rule],
    adaptation: NoAdaptation,
    network: Network,
    world: Scenario,
    page: Callable[..., None] = live,
    schedule: Schedule = EVERY_STEP,
) -> Any:
    """`live`, or another page that takes the parts of a lifetime (`look`, `decide_one`), compiled or from the cache.

    schedule: of the rule. Of the world only robot, task, fitness and physics matter, and of adaptation, task and
    fitness only the functions.
    """
    robot, task, physics, scoring = world.robot, world.task, world.physics, scored(world.fitness)
    values = (rule, schedule, adaptation.parts, network, robot, type(task), scoring, physics)
    if (page, values) in _kernels:
        return _kernels[page, values]
    check_inputs(network, robot, task)
    parts = {
        "OUTPUT": network.first_output,
        "HAS_TRIALS": task.has_trials,
        "HAS_SCORE": scoring.step is not None,
        "score": score_of(scoring),
        "sense": senses(robot, physics),
        "blind": blinding(robot),
        "nearest": largest_distance_reading(robot),
        "draw_noise": normal_numbers(robot.inputs),
        **controller_parts(rule, network, schedule),
        **adaptation.hooks(robot, network.post[0])._asdict(),
        "apply_sensor_faults": sensor_faults(robot),
        **task.hooks(robot.inputs)._asdict(),
        "move": physics.mover(robot),
        "move_all": mover_of_all(robot),
        "record_tilt": physics.record_tilt(),
    }
    for block in (perceive, decide, settle):
        parts[block.__name__] = compiled(with_parts(block, parts))
    _kernels[page, values] = made = kernel(page, values, **parts)
    return made


def check_inputs(network: Network, robot: Robot, task: Task) -> None:
    """Check that a network fits the sensors of a robot and the reward of its task; else a ValueError."""
    wanted = robot.inputs + sum(group.count for group in task.inputs)
    reward = f" and the reward of task={task.name}" if task.gives_reward else ""
    if network.inputs != wanted:
        raise ValueError(
            f"network.layers must begin with {wanted}, the readings of robot {robot.name}{reward}, got "
            f"{list(network.layers)}"
        )
    if network.outputs != OUTPUTS:
        raise ValueError(
            f"network.layers must end with {OUTPUTS}, the outputs for the left and the right wheel, got "
            f"{list(network.layers)}"
        )
