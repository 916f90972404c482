"""A lifetime: sense, act, score, learn, move, every 32 ms, from birth with the genome's weights to forgetting them.

`live` is the whole story of one robot, compiled. `live_block` lives many of them, on as many threads as asked for;
no robot knows of another, so results do not depend on how the lifetimes are shared out.
"""

import math
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from epuckhebb.sim import fitness
from epuckhebb.sim import surprise as signals
from epuckhebb.sim.compiled import compiled_and_cached
from epuckhebb.sim.controller import BIAS, GENES, INPUTS, NEURONS, OUTPUTS, POST, WHEELS, forward, weights_at_birth
from epuckhebb.sim.epuck import MOTOR_LIMIT, SENSORS, STEP_S, cast, sense, sensor_rays
from epuckhebb.sim.light import Lights, lights
from epuckhebb.sim.maze import GOAL_RADIUS, GOALS, START, Pose, Side, boxes, in_correct_arm
from epuckhebb.sim.noise import normal_numbers
from epuckhebb.sim.plasticity import CHANGE_ROOM, Hebbian, Rule, effective_rate, learn, rule
from epuckhebb.sim.scenario import Scenario
from epuckhebb.sim.surprise import NOTHING, RECENT_ROOM, Remembered, Surprise
from epuckhebb.sim.world import Handles, World, is_lost, move, pose

CONTACT = 0.8  # a proximity reading above this counts as contact, as in the published code
_ALWAYS = int(Surprise.none)  # plasticity is not asked whether there is need of it
_FAR = 2**40  # motor noise is heard where no step of the sensor noise ever comes
_HELD = round(2.0 / STEP_S)  # steps for which motor noise stays the same
_HEBBIAN_SIGNS = np.ones(GENES)
_LIVES_PER_BLOCK = 50  # lifetimes that share a World, one after the other


class Samples(NamedTuple):
    """What is recorded of a lifetime, every so many steps; first axis: samples.

    time [s]; pose: x, y [m], heading [rad]; sensors: the 16 network inputs; motors: the 2 network outputs; fitness:
    live F; surprise: the signal of change, nan if there is none; rate: N_e; weight_change: sum of |W - W_gene|;
    weights: (samples, 234), after the step's update.
    """

    time: NDArray[np.float64]
    pose: NDArray[np.float64]
    sensors: NDArray[np.float64]
    motors: NDArray[np.float64]
    fitness: NDArray[np.float64]
    surprise: NDArray[np.float64]
    rate: NDArray[np.float64]
    weight_change: NDArray[np.float64]
    weights: NDArray[np.float32]


class Body(NamedTuple):
    """What is wrong with the robot: the place of its dead sensor, -1 for none, and how well each wheel turns."""

    dead_sensor: int
    left_wheel: float
    right_wheel: float


class Outcome(NamedTuple):
    """What a lifetime came to.

    time_to_goal: s, first time within 5 cm of the goal, nan if never. path_length: m. final_distance: m from the goal.
    behaviour: mean combined fitness over the steps. reward: goal reward at the end. weight_change_mean,
    weight_change_final: sum over weights of |W - W_gene|. contact_fraction: share of steps with a proximity reading
    above 0.8. steps: lived; fewer than asked for only if the robot was lost.
    """

    time_to_goal: float
    path_length: float
    final_distance: float
    behaviour: float
    reward: float
    weight_change_mean: float
    weight_change_final: float
    contact_fraction: float
    steps: int

    @property
    def success(self) -> bool:
        """Whether the robot was within 5 cm of its goal at the last step."""
        return self.final_distance < GOAL_RADIUS

    @property
    def fitness(self) -> float:
        """The paper's final fitness: mean of the behaviour fitness and of the goal reward at the end."""
        return (self.behaviour + self.reward) / 2.0


@compiled_and_cached
def live(
    world: Handles,
    lit: Lights,
    goal_x: float,
    goal_y: float,
    genes: NDArray[np.float64],
    body: Body,
    plasticity: Rule,
    signs: NDArray[np.float64],
    signal: int,
    remembered: Remembered,
    gain: float,
    noise_level: float,
    key: np.uint64,
    steps: int,
    record_every: int,
    samples: Samples,
) -> Outcome:
    """One lifetime of the robot that stands in `world`.

    genes: (234,) weights at birth, not written. signs: (234,) of the plastic updates. remembered: what surprise is
    measured by. gain: wheel speed [rad/s] of an output of 1. record_every: steps between two samples, 0 for none.
    """
    weights = genes.copy()
    trace = np.zeros(GENES)
    activation = np.zeros(NEURONS)
    activation[BIAS] = 1.0
    rays, distances, noise = np.empty((6, SENSORS)), np.empty(SENSORS), np.zeros(INPUTS)
    drive, correlation, change = np.empty(max(POST)), np.empty(GENES), np.empty(CHANGE_ROOM)
    recent, surprise, need, plastic = np.zeros(RECENT_ROOM), math.nan, 1.0, True
    away_s, surprised_s, arrived = 0.0, 0.0, False
    shake_left, shake_right = 0.0, 0.0

    junction, undirected_sum, behaviour_sum = 0.0, 0.0, 0.0
    weight_change, weight_change_sum = 0.0, 0.0
    path_length, time_to_goal, contacts, lived = 0.0, math.nan, 0, 0
    x, y, heading = pose(world)
    goal_distance = fitness.distance_to(x, y, goal_x, goal_y)

    for step in range(steps):
        # Sense.
        cos, sin = math.cos(heading), math.sin(heading)
        sensor_rays(x, y, cos, sin, rays)
        cast(x, y, rays, world.walls, distances)
        if noise_level > 0.0:
            normal_numbers(key, step, noise)
        sense(rays, distances, lit, noise, noise_level, activation)
        if body.dead_sensor >= 0:
            activation[body.dead_sensor], activation[SENSORS + body.dead_sensor] = 1.0, 0.0  # dark, and no wall

        # Act.
        forward(weights, activation, drive)
        left, right = activation[WHEELS], activation[WHEELS + 1]

        # Score.
        if in_correct_arm(x, y, goal_x):
            junction = 1.0
        nearest = fitness.largest(activation, SENSORS)
        undirected = fitness.combined(left, right, nearest, 0.0)
        behaviour = undirected + junction / 5.0
        undirected_sum += undirected
        behaviour_sum += behaviour
        contacts += nearest > CONTACT

        # Learn.
        live_fitness = fitness.live_fitness(
            signal, activation, left, right, behaviour, goal_distance, step + 1.0, undirected_sum
        )
        if plasticity.surprise != _ALWAYS:
            signals.keep_recent(recent, activation, live_fitness, step)
            at_goal = goal_distance < GOAL_RADIUS
            arrived, away_s = arrived or at_goal, 0.0 if at_goal else away_s + STEP_S
            surprise = signals.surprise(plasticity.surprise, step * STEP_S, away_s, arrived, recent, remembered)
            need = 0.0 if at_goal else signals.need(surprise, plasticity.tolerance, plasticity.ramp)
            surprised_s = surprised_s + STEP_S if need > 0.0 else 0.0
            if signals.resting(surprised_s, plasticity.spell_s, plasticity.rest_s):
                need = 0.0
            if plastic and need == 0.0:  # forget
                weights[:] = genes
                trace[:] = 0.0
                weight_change = 0.0
            plastic = need > 0.0
            if plasticity.motor_noise > 0.0 and step % _HELD == 0:
                normal_numbers(key, _FAR + step, noise)
                shake_left, shake_right = plasticity.motor_noise * noise[0], plasticity.motor_noise * noise[1]
        rate = effective_rate(plasticity.rate, need, live_fitness, plasticity.floor)
        if plasticity.rate > 0.0 and plastic:
            weight_change = learn(weights, trace, genes, activation, rate, plasticity, signs, correlation, change)

        weight_change_sum += weight_change

        if record_every > 0 and step % record_every == 0:
            k = step // record_every
            samples.time[k] = step * STEP_S
            samples.pose[k, 0], samples.pose[k, 1], samples.pose[k, 2] = x, y, heading
            samples.sensors[k] = activation[:INPUTS]
            samples.motors[k, 0], samples.motors[k, 1] = left, right
            samples.fitness[k], samples.surprise[k] = live_fitness, surprise
            samples.rate[k], samples.weight_change[k] = rate, weight_change
            samples.weights[k] = weights

        # Move.
        if plasticity.motor_noise > 0.0 and plastic:
            fastest = MOTOR_LIMIT / gain
            left = min(fastest, max(-fastest, left + shake_left))
            right = min(fastest, max(-fastest, right + shake_right))
        move(world, cos, sin, gain * body.left_wheel * left, gain * body.right_wheel * right)
        new_x, new_y, heading = pose(world)
        if is_lost(new_x, new_y, heading):
            break
        path_length += math.sqrt((new_x - x) * (new_x - x) + (new_y - y) * (new_y - y))
        x, y = new_x, new_y
        goal_distance = fitness.distance_to(x, y, goal_x, goal_y)
        if math.isnan(time_to_goal) and goal_distance < GOAL_RADIUS:
            time_to_goal = (step + 1) * STEP_S
        lived = step + 1

    return Outcome(
        time_to_goal,
        path_length,
        goal_distance,
        behaviour_sum / steps,
        fitness.reward(goal_distance),
        weight_change_sum / steps,
        weight_change,
        contacts / steps,
        lived,
    )


@dataclass(kw_only=True)
class Lifetime:
    """How a lifetime is run.

    duration_s: its length [s]. gain_rad_s: wheel speed [rad/s] of a network output of 1. noise: 1 for the sensors' own
    noise, 0 for none, other values scale it. record_every: steps between two recorded samples, 0 to record nothing.
    """

    duration_s: float = 250.0
    gain_rad_s: float = 1.0
    noise: float = 1.0
    record_every: int = 0

    def __post_init__(self) -> None:
        """Refuse lifetimes that cannot be.

        Raises:
            ValueError: a value is outside the range named in the message.
        """
        if not (math.isfinite(self.duration_s) and self.duration_s >= STEP_S):
            raise ValueError(f"lifetime.duration_s must be at least one step, {STEP_S} s, got {self.duration_s}")
        if not 0 < self.gain_rad_s <= MOTOR_LIMIT:
            raise ValueError(
                f"lifetime.gain_rad_s must be more than 0 and at most {MOTOR_LIMIT}, the e-puck's fastest, "
                f"got {self.gain_rad_s}"
            )
        if not (math.isfinite(self.noise) and self.noise >= 0):
            raise ValueError(f"lifetime.noise must be 0 or more, got {self.noise}")
        if self.record_every < 0:
            raise ValueError(f"lifetime.record_every must be 0 or more, got {self.record_every}")

    @property
    def steps(self) -> int:
        """Whole control steps of 32 ms in the lifetime."""
        return math.floor(self.duration_s / STEP_S + 1e-9)


@dataclass(frozen=True, kw_only=True)
class Life:
    """A lifetime to be lived: a genome (234,), a side, a plasticity, a noise key, a start; recorded or not.

    remembered: what a plasticity with a signal of surprise compares with.
    """

    genome: NDArray[np.float64]
    side: Side
    hebbian: Hebbian
    key: np.uint64
    start: Pose = START
    signs: NDArray[np.float64] | None = None
    remembered: Remembered = NOTHING
    record: bool = False


class LostRobotError(ArithmeticError):
    """A robot's pose stopped being finite or left the arena, so nothing that it did afterwards means anything."""


def live_block(
    lives: Sequence[Life], scenario: Scenario, lifetime: Lifetime, threads: int = 1
) -> list[tuple[Outcome, Samples]]:
    """Live many lifetimes in the same scenario; the outcomes come in the order of `lives`, whatever `threads` is.

    Samples have length 0 where a life is not recorded.

    Raises:
        LostRobotError: a pose stopped being finite; the message says whose and when.
    """
    size = min(_LIVES_PER_BLOCK, -(-len(lives) // threads))
    blocks = [lives[first : first + size] for first in range(0, len(lives), size)]
    # A pool even for one thread: Ctrl-C while numba builds a result would crash the process.
    with ThreadPoolExecutor(threads) as pool:
        lived = list(pool.map(lambda block: _live_in_one_world(block, scenario, lifetime), blocks))
    return [life for block in lived for life in block]


def _live_in_one_world(lives: Sequence[Life], scenario: Scenario, lifetime: Lifetime) -> list[tuple[Outcome, Samples]]:
    world = World(boxes(scenario.obstacles, scenario.layout))
    return [_live_one(life, world, scenario, lifetime) for life in lives]


def _live_one(life: Life, world: World, scenario: Scenario, lifetime: Lifetime) -> tuple[Outcome, Samples]:
    world.place_robot(life.start)
    record_every = lifetime.record_every if life.record else 0
    samples = _empty_samples(-(-lifetime.steps // record_every)) if record_every else _NO_SAMPLES
    outcome = live(
        world.handles,
        lights(scenario.light, scenario.lamp, lamp_on=life.side == "right"),
        *GOALS[life.side],
        weights_at_birth(life.genome),
        Body(
            -1 if scenario.dead_sensor is None else scenario.dead_sensor,
            float(scenario.left_wheel),
            float(scenario.right_wheel),
        ),
        rule(life.hebbian),
        _HEBBIAN_SIGNS if life.signs is None else life.signs,
        int(life.hebbian.signal),
        life.remembered,
        float(lifetime.gain_rad_s),
        float(lifetime.noise),
        life.key,
        lifetime.steps,
        record_every,
        samples,
    )
    if outcome.steps < lifetime.steps:
        raise LostRobotError(
            f"on a {life.side} trial of scenario {scenario.name} the robot's pose stopped being finite or left the "
            f"arena at step {outcome.steps} of {lifetime.steps}"
        )
    return outcome, samples


def _empty_samples(count: int) -> Samples:
    def numbers(*shape: int) -> NDArray[np.float64]:
        return np.zeros((count, *shape))

    return Samples(
        time=numbers(),
        pose=numbers(3),
        sensors=numbers(INPUTS),
        motors=numbers(OUTPUTS),
        fitness=numbers(),
        surprise=np.full(count, np.nan),
        rate=numbers(),
        weight_change=numbers(),
        weights=np.zeros((count, GENES), np.float32),
    )


_NO_SAMPLES = _empty_samples(0)


def load_kernel() -> None:
    """Load `live` from the cache, or compile it, as the first lifetime would."""
    unborn = Life(genome=np.zeros(GENES), side="left", hebbian=Hebbian(), key=np.uint64(0))
    live_block([unborn], Scenario(), Lifetime(duration_s=STEP_S))
