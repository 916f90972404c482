"""A lifetime: sense, act, score, learn, move, every 32 ms, from the genome's weights to its end.

`live` is the whole of it for one robot, and `live_in_turn`, which Python calls, runs it for one robot after the other.
The names in capitals and the functions that are not of this file are its parts: `simulator` puts those of the robot,
the network, the plasticity rule, the adaptation and the task in their place. All that a lifetime carries is in one
record (`epuckhebb.tmaze.life.Life`). So it can be paused at any step, and resumed bit-identically.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.compiling.kernel import compiled
from epuckhebb.controller.plasticity.update import StepContext, effective_rate
from epuckhebb.tmaze import fitness
from epuckhebb.tmaze.faults import turn_wheels
from epuckhebb.tmaze.life import Life, Setup
from epuckhebb.tmaze.maze import Pose, Region
from epuckhebb.tmaze.physics_engine import Handles, is_lost, pose
from epuckhebb.tmaze.robot import STEP_S
from epuckhebb.tmaze.samples import Samples
from epuckhebb.tmaze.sensors import Goal

CONTACT = 0.8  # a distance reading above this counts as contact, as in the published code

# The parts of a lifetime; `epuckhebb.tmaze.simulator` puts them here.
_part: Any = None
INPUTS, OUTPUT, SUBSTEPS, HAS_RULE, HAS_TRIALS, HAS_SCORE, resets = 0, 0, 1, False, False, False, False
draw_noise = sense = apply_sensor_faults = blind = reward_input = scale = _part  # sense
forward = nearest = score = _part  # act, score
open_gate = average = modulate = is_due = learn = begin_updates = end_updates = record_tilt = _part  # learn
explore = move = to_goal = end_step = place = _part  # move


def live_in_turn(rows: NDArray[np.uint64], poses: Floats, life: Life, setup: Setup, space: Handles, until: int) -> None:
    """Run lifetimes one after the other, each until before step `until`; the first robot stands in `space` already.

    rows: what each lifetime carries, updated; the arrays of `life` are the last row. poses: (lifetimes, 3) where each
    robot starts [m, m, rad], then where it is.
    """
    current = rows.shape[0] - 1
    for robot in range(poses.shape[0]):
        if robot > 0:
            place(space, poses[robot, 0], poses[robot, 1], poses[robot, 2])
        copy(rows[robot], rows[current])
        live(life, setup, space, until)
        copy(rows[current], rows[robot])
        at = pose(space)
        poses[robot, 0], poses[robot, 1], poses[robot, 2] = at.x, at.y, at.heading


def live(life: Life, setup: Setup, space: Handles, until: int) -> None:
    """Run the lifetime of the robot that stands in `space` until before step `until`. life: updated."""
    tally, at = life.tally[0], pose(space)
    tally.goal_distance = to_goal(setup, at.x, at.y)

    for step in range(tally.step, until):
        cos, sin = math.cos(at.heading), math.sin(at.heading)
        left, right = decide(life, setup, space, at, cos, sin, step)

        # Move.
        left, right = turn_wheels(setup.faults, tally, life.past, left, right, setup.gain, life.key[0], step)
        move(space, cos, sin, left, right)
        last, at = at, pose(space)
        if settle(tally, setup, last, at, step):
            break

        # Begin again.
        if HAS_TRIALS:
            end_step(life, space, setup)
            if tally.over:
                break
            at = pose(space)
            tally.goal_distance = to_goal(setup, at.x, at.y)


def decide(
    life: Life, setup: Setup, space: Handles, at: Pose, cos: float, sin: float, step: int
) -> tuple[float, float]:
    """Sense, act, score and learn at a pose; returns the outputs for the left and the right wheel."""
    tally, weights, activation, workspace = life.tally[0], life.weights, life.activation, life.workspace

    # Sense.
    perceive(life, setup, space, at, cos, sin, activation)
    scale(life, setup, step)

    # Act.
    forward(weights, activation, workspace.drive, life.neurons, workspace.substeps)
    left, right = activation[OUTPUT], activation[OUTPUT + 1]

    # Score.
    if contains(setup.arm, at.x, at.y):
        tally.junction = 1.0
    nearness = nearest(activation)
    undirected = fitness.combined(left, right, nearness, 0.0)
    behaviour = undirected + tally.junction / 5.0
    tally.undirected_sum += undirected
    tally.behaviour_sum += behaviour
    tally.contacts += nearness > CONTACT
    live_fitness = fitness.live_fitness(setup, tally, activation, left, right, behaviour, step)
    if HAS_SCORE:
        state, contact, readings = life.score[0], nearness > CONTACT, activation[:INPUTS]
        worth = score(
            tally, state, setup.fitness, left, right, nearness, contact, behaviour, at, readings, step * STEP_S
        )
        state.sum += worth
        if setup.signal == fitness.OWN:
            live_fitness = worth

    # Learn.
    need = open_gate(life, setup, live_fitness, step)
    if resets and tally.need > 0.0 and need == 0.0:
        reset_to_genes(life)
    tally.need = need
    base_rate = rate = effective_rate(setup.rate, need, live_fitness, setup.floor)
    begin_updates(weights, life.track, step)
    for k in range(SUBSTEPS):
        number = step * SUBSTEPS + k
        read = average(life.recent, workspace.substeps[k] if SUBSTEPS > 1 else activation, number, workspace.mean)
        if HAS_RULE and setup.rate > 0.0 and need > 0.0:
            rate = base_rate * modulate(life.genotype.modulatory, read)
            if is_due(number, setup.rule):
                context = StepContext(live_fitness, life.key[0], number, STEP_S / SUBSTEPS)
                tally.weight_change = learn(
                    weights, life.synapse_state, life.genotype, read, rate, context, setup.rule, workspace
                )
    genes, change = life.genotype.weights, workspace.change
    tally.weight_change = end_updates(weights, genes, life.track, step, change, tally.weight_change)
    tally.weight_change_sum += tally.weight_change + tally.scaling
    if setup.record_every > 0 and step % setup.record_every == 0:
        sample = step // setup.record_every
        time = step * STEP_S
        record(setup.samples, sample, time, at, tally, weights, activation, workspace.substeps, live_fitness, rate)
        record_tilt(space, setup.samples.tilt, sample)

    left, right = explore(life, setup, left, right)
    return left, right


def perceive(life: Life, setup: Setup, space: Handles, at: Pose, cos: float, sin: float, readings: Floats) -> None:
    """Fill the inputs of the network, as sensors and task give them: with noise and faults."""
    tally, noise = life.tally[0], life.senses.noise
    if setup.noise_level > 0.0:
        draw_noise(life.key[0], tally.step, noise)
    goal = Goal(setup.goal_x, setup.goal_y, tally.goal_distance)
    sense(at.x, at.y, cos, sin, space, setup.lit, noise, setup.noise_level, life.senses, readings, goal)
    apply_sensor_faults(readings, setup.faults, life.past, tally.step)
    blind(readings, setup.faults.dead_sensors)
    reward_input(readings, tally.reward)


def settle(tally: Any, setup: Setup, last: Pose, at: Pose, step: int) -> bool:
    """Count a step that moved the robot to a new pose; returns whether it is lost."""
    tally.step = step + 1
    if is_lost(at.x, at.y, at.heading, setup.arena):
        tally.lost = True
        return True
    tally.path_length += math.sqrt((at.x - last.x) * (at.x - last.x) + (at.y - last.y) * (at.y - last.y))
    tally.goal_distance = to_goal(setup, at.x, at.y)
    if math.isnan(tally.time_to_goal) and tally.goal_distance < setup.goal_radius:
        tally.time_to_goal = (step + 1) * STEP_S
    return False


def look(life: Life, setup: Setup, space: Handles, readings: Floats) -> None:
    """Fill the inputs that the next step will have: its noise is numbered, so it is the same then."""
    tally, at = life.tally[0], pose(space)
    tally.goal_distance = to_goal(setup, at.x, at.y)
    perceive(life, setup, space, at, math.cos(at.heading), math.sin(at.heading), readings)


@compiled
def copy(row: NDArray[np.uint64], to: NDArray[np.uint64]) -> None:
    """Copy all that a lifetime carries."""
    for word in range(row.shape[0]):
        to[word] = row[word]


@compiled
def contains(region: Region, x: float, y: float) -> bool:
    """Whether a point [m] lies in a region."""
    return region.left < x < region.right and region.bottom < y < region.top


@compiled
def reset_to_genes(life: Life) -> None:
    """Reset the weights to the genes, and each synapse to its initial state."""
    for k in range(life.weights.shape[0]):
        life.weights[k] = life.genotype.weights[k]
        life.synapse_state[k] = life.genotype.synapse_state[k]
    life.tally[0].weight_change = 0.0


@compiled
def record(
    samples: Samples,
    sample: int,
    time: float,
    at: Pose,
    tally: Any,
    weights: Floats,
    activation: Floats,
    substeps: Floats,
    live_fitness: float,
    rate: float,
) -> None:
    """Write a sample. sample: its number.

    It takes no whole `Life`, whose type depends on the rule: so it is compiled once for all rules.
    """
    samples.time[sample] = time
    samples.pose[sample, 0], samples.pose[sample, 1], samples.pose[sample, 2] = at.x, at.y, at.heading
    inputs, synapses = samples.sensors.shape[1], samples.weights.shape[1]
    outputs = samples.motors.shape[1]
    for i in range(inputs):
        samples.sensors[sample, i] = activation[i]
    for k in range(outputs):
        samples.motors[sample, k] = activation[activation.shape[0] - outputs + k]
    samples.fitness[sample], samples.change_signal[sample] = live_fitness, tally.change_signal
    samples.rate[sample], samples.weight_change[sample] = rate, tally.weight_change + tally.scaling
    for k in range(synapses):
        samples.weights[sample, k] = weights[k]
    neurons = samples.activations.shape[1]
    for j in range(neurons):
        k, count = activation.shape[0] - neurons + j, substeps.shape[0]
        total = activation[k]  # of the last substep
        for substep in range(count - 1):
            total += substeps[substep, k]
        samples.activations[sample, j] = total / count
