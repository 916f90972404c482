"""A lifetime: sense, act, score, learn, move, every 32 ms, from the genome's weights to its end.

`live` is the whole of it for one robot, compiled. The names in capitals and the functions that are not of this file are
its parts: `epuckhebb.sim.lifetime_kernel` puts those of the robot, the network, the plasticity rule, the adaptation and
the task in their place. All that a lifetime carries is in one record (`epuckhebb.sim.life.Life`). So it can be paused
at any step, and resumed bit-identically.
"""

import math
from typing import Any

from epuckhebb.sim import faults, fitness
from epuckhebb.sim.adaptation import adaptation
from epuckhebb.sim.adaptation.recognise.compass import LIT
from epuckhebb.sim.arrays import Floats
from epuckhebb.sim.compiling.kernel import compiled
from epuckhebb.sim.life import Genotype, Group, Life, Setup, Trial
from epuckhebb.sim.maze import Region
from epuckhebb.sim.network import OUTPUTS, PAPER_NETWORK, forward_pass
from epuckhebb.sim.own_fitness import Fitness, score_of
from epuckhebb.sim.physics.pymunk import PYMUNK, mover, mover_of_all
from epuckhebb.sim.physics_engine import Handles, is_lost, pose
from epuckhebb.sim.plasticity.rule import NoRule
from epuckhebb.sim.plasticity.update import StepContext, effective_rate, modulation_of, update_of
from epuckhebb.sim.random import normal_numbers
from epuckhebb.sim.robot import EPUCK, STEP_S
from epuckhebb.sim.samples import Samples
from epuckhebb.sim.senses import blinding, largest_distance_reading, senses
from epuckhebb.sim.sensors import NO_ROBOTS, Goal
from epuckhebb.sim.tasks.trial import ONE_TRIAL
from epuckhebb.sim.wiring import Neurons

OWN = int(fitness.Signal.fitness)
CONTACT = 0.8  # a distance reading above this counts as contact, as in the published code

# The parts of a lifetime, as the paper's robot without plasticity has them; `kernel_of` puts others in their place.
WHEELS, HAS_RULE, HAS_TRIALS, HAS_SCORE = PAPER_NETWORK.wheels, False, False, False
score = score_of(Fitness)
sense, blind, nearest = senses(EPUCK, PYMUNK), blinding(EPUCK), largest_distance_reading(EPUCK)
draw_noise, forward, move = normal_numbers(EPUCK.inputs), forward_pass(PAPER_NETWORK), mover(EPUCK)
move_all = mover_of_all(EPUCK)
learn, modulate = update_of(NoRule, PAPER_NETWORK), modulation_of(NoRule, PAPER_NETWORK)
record_tilt = PYMUNK.record_tilt()
correct, scale, open_gate, explore, compensate, resets = adaptation.hooks(adaptation.Parts(), EPUCK)
apply_sensor_faults, turn_wheels = faults.hooks(EPUCK, more=False)
reward_input, to_goal, end_step = ONE_TRIAL.hooks(EPUCK.inputs)


def live(life: Life, setup: Setup, space: Handles, until: int) -> None:
    """Run the lifetime of the robot that stands in `space` until before step `until`. life: updated."""
    tally, trial, gain = life.tally[0], setup.trial, setup.gain
    x, y, heading = pose(space)
    tally.goal_distance = to_goal(trial, x, y)

    for step in range(tally.step, until):
        cos, sin = math.cos(heading), math.sin(heading)
        left, right = decide(life, setup, space, NO_ROBOTS, x, y, heading, cos, sin, step)

        # Move.
        left, right = turn_wheels(trial.faults, tally, life.past, left, right, gain, setup.key, step)
        move(space, cos, sin, left, right)
        new_x, new_y, heading = pose(space)
        if settle(tally, trial, x, y, new_x, new_y, heading, step):
            break
        x, y = new_x, new_y

        # Begin again.
        if HAS_TRIALS:
            end_step(life, space, trial)
            if tally.over:
                break
            x, y, heading = pose(space)
            tally.goal_distance = to_goal(trial, x, y)


def live_group(group: Group, life: Life, setup: Setup, space: Any, until: int) -> None:
    """Run the lifetimes of the robots of a space until before step `until`, or until one is lost. group: updated.

    In a step all robots sense and decide, in their order, before any moves. life, setup: of any of them, for what all
    share.
    """
    motion, wheels, trial, gain = group.motion, group.wheels, setup.trial, setup.gain
    robots, lost = motion.shape[0], False
    for step in range(group.tally[0][0].step, until):
        for i in range(robots):
            one = Life(
                group.tally[i],
                group.weights[i],
                group.synapse_state[i],
                group.activation[i],
                life.adaptation,
                life.trials,
                group.score[i],
                Neurons(group.neurons[i], group.parameters[i], life.neurons.numbers, life.neurons.step_s),
                life.workspace,
                group.past[i],
            )
            genotype = Genotype(
                group.genes[i],
                setup.genotype.synapse_state,
                group.coefficients[i],
                group.modulatory[i],
                group.lengths[i],
                group.signs[i],
            )
            own = Setup(
                genotype,
                setup.plasticity,
                setup.nominal,
                setup.lit,
                trial,
                setup.fitness,
                gain,
                setup.noise_level,
                group.keys[i],
                0,
                setup.samples,
            )
            x, y, heading = motion[i, 0], motion[i, 1], motion[i, 2]
            cos, sin = math.cos(heading), math.sin(heading)
            tally = one.tally[0]
            tally.goal_distance = to_goal(trial, x, y)
            left, right = decide(one, own, space, motion, x, y, heading, cos, sin, step)
            left, right = turn_wheels(trial.faults, tally, one.past, left, right, gain, own.key, step)
            wheels[i, 0], wheels[i, 1], wheels[i, 2], wheels[i, 3] = left, right, cos, sin
            group.before[i, 0], group.before[i, 1] = x, y
        move_all(space, motion, wheels)
        for i in range(robots):
            x, y = group.before[i, 0], group.before[i, 1]
            tally = group.tally[i][0]
            lost = settle(tally, trial, x, y, motion[i, 0], motion[i, 1], motion[i, 2], step) or lost
        if lost:
            break


def settle(tally: Any, trial: Trial, x: float, y: float, new_x: float, new_y: float, heading: float, step: int) -> bool:
    """Count a step that moved the robot from (x, y) to a new pose; returns whether it is lost."""
    tally.step = step + 1
    if is_lost(new_x, new_y, heading, trial.arena):
        tally.lost = True
        return True
    tally.path_length += math.sqrt((new_x - x) * (new_x - x) + (new_y - y) * (new_y - y))
    tally.goal_distance = to_goal(trial, new_x, new_y)
    if math.isnan(tally.time_to_goal) and tally.goal_distance < trial.goal_radius:
        tally.time_to_goal = (step + 1) * STEP_S
    return False


def decide(
    life: Life,
    setup: Setup,
    space: Handles,
    robots: Floats,
    x: float,
    y: float,
    heading: float,
    cos: float,
    sin: float,
    step: int,
) -> tuple[float, float]:
    """Sense, act, score and learn at a pose; returns the outputs for the left and the right wheel.

    It moves nothing, so that robots which share a space can all decide before any of them moves. robots: all that
    share it, as `epuckhebb.sim.sensors.Surroundings` has them.
    """
    tally, weights, activation, workspace = life.tally[0], life.weights, life.activation, life.workspace
    genotype, plasticity, trial = setup.genotype, setup.plasticity, setup.trial
    corrections = life.adaptation.corrections

    # Sense.
    if setup.noise_level > 0.0:
        draw_noise(setup.key, step, workspace.noise)
    goal = Goal(trial.goal_x, trial.goal_y, tally.goal_distance)
    noise, noise_level = workspace.noise, setup.noise_level
    sense(x, y, cos, sin, space, setup.lit, noise, noise_level, workspace.senses, activation, goal, robots)
    apply_sensor_faults(activation, trial.faults, life.past, step)
    blind(activation, trial.faults.dead_sensors)
    correct(activation, corrections, life.adaptation.correcting)
    scale(activation, weights, tally, life.adaptation.homeostasis, setup.nominal, step)
    reward_input(activation, tally.reward)

    # Act.
    forward(weights, activation, workspace.drive, life.neurons)
    left, right = activation[WHEELS], activation[WHEELS + 1]

    # Score.
    if is_in(trial.arm, x, y):
        tally.junction = 1.0
    nearness = nearest(activation)
    undirected = fitness.combined(left, right, nearness, 0.0)
    behaviour = undirected + tally.junction / 5.0
    tally.undirected_sum += undirected
    tally.behaviour_sum += behaviour
    tally.contacts += nearness > CONTACT
    trial_steps = step + 1.0 - tally.began
    live_fitness = fitness.live_fitness(
        plasticity.signal,
        activation,
        left,
        right,
        behaviour,
        tally.goal_distance,
        trial_steps,
        tally.undirected_sum,
        plasticity.history,
    )

    if HAS_SCORE:
        contact, own, time_s = nearness > CONTACT, life.score[0], step * STEP_S
        worth = score(
            tally, own, setup.fitness, left, right, nearness, contact, behaviour, x, y, heading, activation, time_s
        )
        own.sum += worth
        if plasticity.signal == OWN:
            live_fitness = worth

    # Learn.
    need = open_gate(
        plasticity.gate, tally, life.adaptation, activation, live_fitness, setup.nominal, trial, step, setup.key
    )
    if resets and tally.need > 0.0 and need == 0.0:
        reset_to_genes(life, genotype)
    tally.need = need
    rate = effective_rate(plasticity.rate, need, live_fitness, plasticity.floor)
    if HAS_RULE and plasticity.rate > 0.0 and need > 0.0:
        rate *= modulate(genotype.modulatory, activation)
        tally.weight_change = learn(
            weights,
            life.synapse_state,
            genotype.weights,
            genotype.coefficients,
            activation,
            rate,
            StepContext(live_fitness, setup.key, step),
            genotype.lengths,
            genotype.signs,
            plasticity.numbers,
            workspace.synapses,
            workspace.change,
        )
    tally.weight_change_sum += tally.weight_change + tally.scaling
    if setup.record_every > 0 and step % setup.record_every == 0:
        record(setup.samples, step // setup.record_every, step * STEP_S, x, y, heading, life, live_fitness, rate)
        record_tilt(space, setup.samples.tilt, (step // setup.record_every) % setup.samples.time.shape[0])

    # Explore, and compensate for weak wheels.
    left, right = explore(plasticity.gate, tally, life.adaptation, activation, left, right, setup.gain)
    left = compensate(left, corrections.left_loss, setup.gain)
    right = compensate(right, corrections.right_loss, setup.gain)
    return left, right


@compiled
def is_in(region: Region, x: float, y: float) -> bool:
    """Whether a point [m] lies in a region."""
    return region.left < x < region.right and region.bottom < y < region.top


@compiled
def reset_to_genes(life: Life, genotype: Genotype) -> None:
    """Reset the weights to the genes, and each synapse to its initial state."""
    for k in range(life.weights.shape[0]):
        life.weights[k] = genotype.weights[k]
        life.synapse_state[k] = genotype.synapse_state[k]
    life.tally[0].weight_change = 0.0


@compiled
def record(
    samples: Samples,
    number: int,
    time: float,
    x: float,
    y: float,
    heading: float,
    life: Life,
    live_fitness: float,
    rate: float,
) -> None:
    """Write the sample of a number; where there is no room left, it replaces the oldest one."""
    tally, place = life.tally[0], number % samples.time.shape[0]
    samples.time[place] = time
    samples.pose[place, 0], samples.pose[place, 1], samples.pose[place, 2] = x, y, heading
    inputs, synapses = samples.sensors.shape[1], samples.weights.shape[1]
    wheels = life.activation.shape[0] - OUTPUTS
    for i in range(inputs):
        samples.sensors[place, i] = life.activation[i]
    samples.motors[place, 0], samples.motors[place, 1] = life.activation[wheels], life.activation[wheels + 1]
    samples.fitness[place], samples.change_signal[place] = live_fitness, tally.change_signal
    samples.rate[place], samples.weight_change[place] = rate, tally.weight_change + tally.scaling
    for k in range(synapses):
        samples.weights[place, k] = life.weights[k]
    believed = life.adaptation.place.now[0]
    samples.belief[place, 0] = believed.heading
    samples.belief[place, 1] = 1.0 if believed.lamp >= LIT else 0.0
    samples.belief[place, 2] = believed.here
    neurons = samples.activations.shape[1]
    for j in range(neurons):
        samples.activations[place, j] = life.activation[life.activation.shape[0] - neurons + j]
