"""A lifetime: sense, act, score, learn, move, every 32 ms, from birth with the genome's weights to forgetting them.

`live` is the whole story of one robot, compiled. The names in capitals and the functions that are not of this file
are its parts: `kernel_of` puts those of the robot, the network, the plasticity rule, the adaptation and the task in
their place.
All that a life carries is in one record (`Life`), so that it can be paused at any step and go on to the same bits.
"""

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from epuckhebb.sim import faults, fitness
from epuckhebb.sim.adaptation import adaptation as over
from epuckhebb.sim.adaptation.adaptation import AdaptationRoom, Gate, adaptation_room
from epuckhebb.sim.adaptation.change_signal import BaselineOfSide
from epuckhebb.sim.compiled import compiled, kernel
from epuckhebb.sim.faults import Faults
from epuckhebb.sim.light import Lights
from epuckhebb.sim.maze import Region
from epuckhebb.sim.network import OUTPUTS, PAPER_NETWORK, Network, forward_pass
from epuckhebb.sim.physics import Handles, is_lost, mover, pose
from epuckhebb.sim.plasticity.rule import NoRule, Rule
from epuckhebb.sim.plasticity.update import Now, effective_rate, modulation_of, update_of
from epuckhebb.sim.plasticity.weight_change import room as weight_change_room
from epuckhebb.sim.random import normal_numbers, room_for_noise
from epuckhebb.sim.robot import EPUCK, STEP_S, Robot, SenseRoom, blinding, largest_distance_reading, sense_room, senses
from epuckhebb.sim.task import NO_TRIALS, Task
from epuckhebb.sim.tasks.trial import ONE_TRIAL

_LONGEST_S = 1e9  # 31 years: more is surely a slip
CONTACT = 0.8  # a distance reading above this counts as contact, as in the published code

TALLY = np.dtype(
    [
        ("step", np.int64),  # lived so far
        ("contacts", np.int64),  # steps with a distance reading above 0.8
        ("arrived", np.bool_),  # whether the robot ever was at its goal
        ("lost", np.bool_),  # whether its pose stopped making sense
        ("junction", np.float64),  # 1 once it has been in the correct arm
        ("undirected_sum", np.float64),  # of combined fitness without the junction term
        ("behaviour_sum", np.float64),  # of combined fitness
        ("weight_change", np.float64),  # sum of |W - W_gene|
        ("weight_change_sum", np.float64),
        ("scale", np.float64),  # of the light synapses, by homeostasis
        ("scaling", np.float64),  # sum of |W - W_gene| that it amounts to
        ("path_length", np.float64),  # m
        ("goal_distance", np.float64),  # m
        ("time_to_goal", np.float64),  # s, nan until it arrives
        ("need", np.float64),  # g of the last step
        ("change_signal", np.float64),  # nan without a signal
        ("away_s", np.float64),  # since birth, or since it was at the goal
        ("late_s", np.float64),  # for how long the signal of change has been above its threshold
        ("noise_left", np.float64),  # on the wheels' outputs, of exploration
        ("noise_right", np.float64),
        ("left_speed", np.float64),  # rad/s at which the wheels move a robot that is slow to follow
        ("right_speed", np.float64),
        ("trial", np.int64),  # its number, from 0, where a life is many trials
        ("began", np.int64),  # the step with which it began
        ("time_outs", np.int64),  # trials that were over without an arrival
        ("reward", np.float64),  # as the network is told it
        ("over", np.bool_),  # whether all trials are over
    ],
    align=True,
)
_TALLY_AT_BIRTH = np.zeros(1, TALLY)
_TALLY_AT_BIRTH["time_to_goal"], _TALLY_AT_BIRTH["change_signal"] = math.nan, math.nan
_TALLY_AT_BIRTH["need"], _TALLY_AT_BIRTH["scale"] = 1.0, 1.0


class Room(NamedTuple):
    """Workspace of a step; nothing in it outlasts the step, so lives may share it, one after the other."""

    senses: SenseRoom
    noise: NDArray[np.float64]
    drive: NDArray[np.float64]
    synapses: NDArray[np.float64]
    change: NDArray[np.float64]


def room_for(network: Network, robot: Robot) -> Room:
    """Workspace for this network and robot."""
    return Room(
        senses=sense_room(robot),
        noise=np.zeros(room_for_noise(robot.inputs)),
        drive=np.empty(max(network.post)),
        synapses=np.empty((3, network.synapses)),
        change=np.empty(weight_change_room(network)),
    )


class Life(NamedTuple):
    """All that a life carries from step to step, but for the pymunk space in which the robot stands.

    tally: one record of `TALLY`. weights: (synapses,). kept: (synapses,) records, what the synapses keep. activation:
    (neurons,). over: of the adaptation. trials: records of `epuckhebb.sim.task.TRIAL`, none where a life is one trial.
    room: workspace.
    """

    tally: NDArray[np.void]
    weights: NDArray[np.float64]
    kept: NDArray[np.void]
    activation: NDArray[np.float64]
    over: AdaptationRoom
    trials: NDArray[np.void]
    room: Room


class Birth(NamedTuple):
    """What a life begins with and never changes.

    weights: (synapses,), the genes. kept: (synapses,) records, what each synapse keeps at birth. coefficients: (names,
    synapses) evolved parameters of the rule. modulatory: weights of its modulatory neuron, none if it has none.
    lengths: (neurons,) of each neuron's incoming weights, none if the rule does not keep them. signs: (synapses,) of
    the updates.
    """

    weights: NDArray[np.float64]
    kept: NDArray[np.void]
    coefficients: NDArray[np.float64]
    modulatory: NDArray[np.float64]
    lengths: NDArray[np.float64]
    signs: NDArray[np.float64]


class Trial(NamedTuple):
    """What the robot is to do, and what is wrong with it.

    goal_x, goal_y, goal_radius: m. arm: the region in which it has turned the right way. arena: m, half side.
    faults: what is wrong. terms: the numbers of its task, a tuple of a type of their own.
    """

    goal_x: float
    goal_y: float
    goal_radius: float
    arm: Region
    arena: float
    faults: Faults
    terms: tuple[Any, ...] = ()


class Plasticity(NamedTuple):
    """The settings of a rule and of what is laid over it, as numbers.

    rate: N at the pace of this life. floor, signal: of the live fitness. numbers: all settings of the rule. gate: of
    the adaptation.
    """

    rate: float
    floor: float
    signal: int
    numbers: tuple[float, ...]
    gate: Gate


class Samples(NamedTuple):
    """What is recorded of a lifetime, every so many steps; first axis: samples.

    time [s]; pose: x, y [m], heading [rad]; sensors: the network's inputs; motors: the 2 network outputs; fitness:
    live F; change_signal: nan if there is none; rate: N_e; weight_change: sum of |W - W_gene|, that of homeostasis
    included; weights: (samples, synapses), after the step's update, without the scale of homeostasis.
    """

    time: NDArray[np.float64]
    pose: NDArray[np.float64]
    sensors: NDArray[np.float64]
    motors: NDArray[np.float64]
    fitness: NDArray[np.float64]
    change_signal: NDArray[np.float64]
    rate: NDArray[np.float64]
    weight_change: NDArray[np.float64]
    weights: NDArray[np.float32]


class Danced(NamedTuple):
    """What a robot did and felt while it danced before its life, to check itself.

    poses: (steps + 1, 3) x, y [m], heading [rad]. speeds: (steps, 2) wheels as commanded [rad/s]. readings: (steps,
    inputs) as sensed.
    """

    poses: NDArray[np.float64]
    speeds: NDArray[np.float64]
    readings: NDArray[np.float64]


# The parts of a life, as the paper's robot without plasticity has them; `kernel_of` puts others in their place.
WHEELS, HAS_RULE, HAS_TRIALS = PAPER_NETWORK.wheels, False, False
sense, blind, nearest = senses(EPUCK), blinding(EPUCK), largest_distance_reading(EPUCK)
draw_noise, forward, move = normal_numbers(EPUCK.inputs), forward_pass(PAPER_NETWORK), mover(EPUCK)
learn, modulate = update_of(NoRule, PAPER_NETWORK), modulation_of(NoRule, PAPER_NETWORK)
correct, scale, open_gate, explore, compensate = over.hooks(over.NONE, EPUCK)
misread, turn_wheels = faults.hooks(EPUCK, more=False)
tell, to_goal, judge = ONE_TRIAL.hooks(EPUCK.inputs)


def live(
    life: Life,
    birth: Birth,
    space: Handles,
    lit: Lights,
    trial: Trial,
    plasticity: Plasticity,
    baseline: BaselineOfSide,
    gain: float,
    noise_level: float,
    key: np.uint64,
    until: int,
    record_every: int,
    samples: Samples,
) -> None:
    """Let the robot that stands in `space` live on until a step.

    life: updated. gain: wheel speed [rad/s] of a network output of 1. key: of its sensor noise. until: the step before
    which to stop. record_every: steps between two samples, 0 for none; samples: written.
    """
    tally = life.tally[0]
    weights, activation = life.weights, life.activation
    corrections, correcting = life.over.corrections, life.over.correcting
    x, y, heading = pose(space)
    tally.goal_distance = to_goal(trial, x, y)

    for step in range(tally.step, until):
        # Sense.
        cos, sin = math.cos(heading), math.sin(heading)
        if noise_level > 0.0:
            draw_noise(key, step, life.room.noise)
        sense(x, y, cos, sin, space.walls, lit, life.room.noise, noise_level, life.room.senses, activation)
        misread(activation, trial.faults)
        blind(activation, trial.faults.dead_sensors)
        correct(activation, corrections, correcting)
        scale(activation, weights, tally, life.over.homeostasis, baseline, step)
        tell(activation, tally.reward)

        # Act.
        forward(weights, activation, life.room.drive)
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
        live_fitness = fitness.live_fitness(
            plasticity.signal,
            activation,
            left,
            right,
            behaviour,
            tally.goal_distance,
            step + 1.0 - tally.began,
            tally.undirected_sum,
        )

        # Learn.
        at_goal = tally.goal_distance < trial.goal_radius
        need = open_gate(plasticity.gate, tally, life.over, activation, live_fitness, baseline, at_goal, step, key)
        if tally.need > 0.0 and need == 0.0:
            forget(life, birth)
        tally.need = need
        rate = effective_rate(plasticity.rate, need, live_fitness, plasticity.floor)
        if HAS_RULE and plasticity.rate > 0.0 and need > 0.0:
            rate *= modulate(birth.modulatory, activation)
            tally.weight_change = learn(
                weights,
                life.kept,
                birth.weights,
                birth.coefficients,
                activation,
                rate,
                Now(live_fitness, key, step),
                birth.lengths,
                birth.signs,
                plasticity.numbers,
                life.room.synapses,
                life.room.change,
            )
        tally.weight_change_sum += tally.weight_change + tally.scaling

        if record_every > 0 and step % record_every == 0:
            record(samples, step // record_every, step * STEP_S, x, y, heading, life, live_fitness, rate)

        # Move.
        left, right = explore(plasticity.gate, tally, life.over, activation, left, right, gain)
        left = compensate(left, corrections.left_loss, gain)
        right = compensate(right, corrections.right_loss, gain)
        left, right = turn_wheels(trial.faults, tally, left, right, gain, key, step)
        move(space, cos, sin, left, right)
        new_x, new_y, heading = pose(space)
        tally.step = step + 1
        if is_lost(new_x, new_y, heading, trial.arena):
            tally.lost = True
            break
        tally.path_length += math.sqrt((new_x - x) * (new_x - x) + (new_y - y) * (new_y - y))
        x, y = new_x, new_y
        tally.goal_distance = to_goal(trial, x, y)
        if math.isnan(tally.time_to_goal) and tally.goal_distance < trial.goal_radius:
            tally.time_to_goal = (step + 1) * STEP_S

        # Begin again.
        if HAS_TRIALS:
            judge(life, space, trial)
            if tally.over:
                break
            x, y, heading = pose(space)
            tally.goal_distance = to_goal(trial, x, y)


@compiled
def is_in(region: Region, x: float, y: float) -> bool:
    """Whether a point [m] lies in a region."""
    return region.left < x < region.right and region.bottom < y < region.top


@compiled
def forget(life: Life, birth: Birth) -> None:
    """Back to the genes, and to what the synapses kept at birth."""
    for k in range(life.weights.shape[0]):
        life.weights[k] = birth.weights[k]
        life.kept[k] = birth.kept[k]
    life.tally[0].weight_change = 0.0


@compiled
def record(
    samples: Samples,
    place: int,
    time: float,
    x: float,
    y: float,
    heading: float,
    life: Life,
    live_fitness: float,
    rate: float,
) -> None:
    """Write the sample at a place."""
    tally = life.tally[0]
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


_kernels: dict[tuple[object, ...], Any] = {}  # those that this process has used


def kernel_of(
    rule: type[Rule],
    change_signal: str,
    network: Network,
    robot: Robot,
    *,
    follows_walls: bool = False,
    self_check: bool = False,
    homeostatic: bool = False,
    more_faults: bool = False,
    task: Task = ONE_TRIAL,
) -> Any:
    """`live` with these parts: rule, signal of change, network, robot, exploration, self-check, homeostasis and task.

    It is compiled, or comes from the cache.

    more_faults: whether it can do more faults than dead sensors and weak wheels. task: of which only the kind matters.

    Raises:
        ValueError: the rule asks for something that there is not, the network does not fit the robot and the task, or
            the robot cannot do what the adaptation asks of it.
    """
    laid = over.hooks(
        change_signal,
        robot,
        network.post[0],
        follows_walls=follows_walls,
        self_check=self_check,
        homeostatic=homeostatic,
    )
    place = (rule, laid, network, robot, more_faults, type(task))
    if place not in _kernels:
        _kernels[place] = _made(rule, laid, network, robot, more_faults, task)
    return _kernels[place]


def _made(rule: type[Rule], laid: over.Hooks, network: Network, robot: Robot, more_faults: bool, task: Task) -> Any:
    check_inputs(network, robot, task)
    misread, turn_wheels = faults.hooks(robot, more_faults)
    tell, to_goal, judge = task.hooks(network.inputs)
    return kernel(
        live,
        WHEELS=network.wheels,
        HAS_RULE=rule is not NoRule,
        HAS_TRIALS=task.has_trials,
        sense=senses(robot),
        blind=blinding(robot),
        nearest=largest_distance_reading(robot),
        draw_noise=normal_numbers(robot.inputs),
        forward=forward_pass(network),
        learn=update_of(rule, network),
        modulate=modulation_of(rule, network),
        correct=laid.correct,
        scale=laid.scale,
        open_gate=laid.open_gate,
        explore=laid.explore,
        compensate=laid.compensate,
        misread=misread,
        turn_wheels=turn_wheels,
        tell=tell,
        to_goal=to_goal,
        judge=judge,
        move=mover(robot),
    )


def check_inputs(network: Network, robot: Robot, task: Task) -> None:
    """Refuse a network that does not fit what a robot reads and what its task tells it.

    Raises:
        ValueError: it does not; the message says how many inputs it must have, and why.
    """
    wanted = robot.inputs + task.rewards
    reward = f" and the reward of task={task.name}" if task.rewards else ""
    if network.inputs != wanted:
        raise ValueError(
            f"network.layers must begin with {wanted}, the readings of robot {robot.name}{reward}, got "
            f"{list(network.layers)}"
        )
    if network.rewarded != task.tells_reward:
        other = "tells" if network.rewarded else "does not tell"
        raise ValueError(f"the last input of the network {other} a reward, and task={task.name} has it otherwise")


def born(
    birth: Birth,
    network: Network,
    robot: Robot,
    room: Room | None = None,
    over: AdaptationRoom | None = None,
    trials: NDArray[np.void] = NO_TRIALS,
) -> Life:
    """A life before its first step.

    room, over: workspace to use, and what an adaptation keeps, corrections among it; None for some of its own, without
    corrections. trials: those that it will be.

    Raises:
        ValueError: the genes are not as many as the network has weights.
    """
    if birth.weights.shape != (network.synapses,) or birth.signs.shape != (network.synapses,):
        raise ValueError(
            f"a network of layers {network} has {network.synapses} weights, got {birth.weights.shape[0]} genes and "
            f"{birth.signs.shape[0]} signs"
        )
    activation = np.zeros(network.neurons)
    activation[network.bias] = 1.0
    return Life(
        tally=_TALLY_AT_BIRTH.copy(),
        weights=birth.weights.copy(),
        kept=birth.kept.copy(),
        activation=activation,
        over=adaptation_room(robot) if over is None else over,
        trials=trials,
        room=room_for(network, robot) if room is None else room,
    )


def count_dance(life: Life, danced: Danced, gain: float, record_every: int, samples: Samples) -> None:
    """Let a dance be the first steps of a life: its time and its way count, and it is in the samples.

    It is not scored: its live fitness is 0. gain, record_every, samples: as in `live`.
    """
    steps, inputs = danced.readings.shape
    tally = life.tally
    tally["step"], tally["away_s"] = steps, steps * STEP_S
    tally["path_length"] = np.hypot(*np.diff(danced.poses[:, :2], axis=0).T).sum()
    life.over.recent[:inputs] = danced.readings[-1]
    if record_every:
        recorded = np.arange(0, steps, record_every)
        places = slice(0, len(recorded))
        samples.time[places], samples.pose[places] = recorded * STEP_S, danced.poses[recorded]
        samples.sensors[places], samples.motors[places] = danced.readings[recorded], danced.speeds[recorded] / gain
        samples.weights[places] = life.weights


def stay(samples: Samples, life: Life, robot: Robot, record_every: int, pose: NDArray[np.float64]) -> None:
    """Fill the samples after the end of a life that was over early: the robot stands where it was, and all is still.

    record_every: as in `live`. pose: x, y [m], heading [rad] at the end.
    """
    tally = life.tally[0]
    after = slice(-(-int(tally["step"]) // record_every), None)
    samples.time[after] = np.arange(len(samples.time))[after] * record_every * STEP_S
    samples.pose[after], samples.weights[after] = pose[:3], life.weights
    samples.sensors[after, : robot.inputs] = life.activation[: robot.inputs]  # and no reward is told
    samples.weight_change[after] = tally["weight_change"] + tally["scaling"]


def empty_samples(count: int, network: Network) -> Samples:
    """Room for so many samples."""

    def numbers(*shape: int) -> NDArray[np.float64]:
        return np.zeros((count, *shape))

    return Samples(
        time=numbers(),
        pose=numbers(3),
        sensors=numbers(network.inputs),
        motors=numbers(OUTPUTS),
        fitness=numbers(),
        change_signal=np.full(count, np.nan),
        rate=numbers(),
        weight_change=numbers(),
        weights=np.zeros((count, network.synapses), np.float32),
    )


def sample_bytes(network: Network) -> int:
    """How many bytes of memory a sample takes."""
    return sum(array.nbytes for array in empty_samples(1, network))


@dataclass(kw_only=True)
class Lifetime:
    """How a lifetime is run.

    duration_s: its length [s]. gain_rad_s: wheel speed [rad/s] of a network output of 1. noise: 1 for the sensors' own
    noise, 0 for none, other values scale it. record_every: steps between two recorded samples, 0 to record nothing.

    Raises:
        ValueError: a value is outside the range named in the message.
    """

    duration_s: float = 250.0
    gain_rad_s: float = 1.0
    noise: float = 1.0
    record_every: int = 0

    def __post_init__(self) -> None:
        """Refuse lifetimes that cannot be."""
        if not STEP_S <= self.duration_s <= _LONGEST_S:
            raise ValueError(
                f"lifetime.duration_s must be at least one step, {STEP_S} s, and at most {_LONGEST_S:g} s, "
                f"got {self.duration_s}"
            )
        if not (math.isfinite(self.gain_rad_s) and self.gain_rad_s > 0):
            raise ValueError(f"lifetime.gain_rad_s must be more than 0, got {self.gain_rad_s}")
        if not (math.isfinite(self.noise) and self.noise >= 0):
            raise ValueError(f"lifetime.noise must be 0 or more, got {self.noise}")
        if not 0 <= self.record_every <= _LONGEST_S / STEP_S:
            raise ValueError(
                f"lifetime.record_every must be 0 or more, and at most the steps of {_LONGEST_S:g} s, "
                f"got {self.record_every}"
            )

    @property
    def steps(self) -> int:
        """Whole control steps of 32 ms in the lifetime."""
        return math.floor(self.duration_s / STEP_S + 1e-9)
