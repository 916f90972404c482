"""The oracle: one robot in plain Python, NumPy and pymunk's public interface, from the equations.

It shares with the compiled lifetime only the facts of the world (walls, sensor places and curve, sun and lamp), the
user's settings (controller, network, scenario) and the noise numbers. `benchmarks/step.py` compares its speed: it is
the program as one would first write it.
"""

import math
from dataclasses import replace
from itertools import pairwise

import numba
import numpy as np
import pymunk

from epuckhebb.adaptation.adaptation import Adaptation
from epuckhebb.controller import random
from epuckhebb.controller.network import PAPER_NETWORK
from epuckhebb.controller.plasticity.control import Control
from epuckhebb.tmaze import light
from epuckhebb.tmaze.maze import boxes

STEP = 0.032
WALL, ROBOT = pymunk.ShapeFilter(categories=1), pymunk.ShapeFilter(categories=2)
_NOISE, _BITS, _NORMAL = {}, numba.njit(random.bits), numba.njit(random.normal)


def noise(key, step, count):
    """Standard normal numbers of a step, from the program, which has tests of its own for them."""
    if count not in _NOISE:
        _NOISE[count] = numba.njit(random.normal_numbers(count)), np.zeros(random.noise_workspace_size(count))
    fill, numbers = _NOISE[count]
    fill(key, step, numbers)
    return numbers[:count].copy()


def fraction(key, number):
    """A random number in [0, 1) for a key and a number, from the program too."""
    return int(_BITS(np.uint64(key), np.uint64(number))) / 2**64


class Robot:
    """A robot in a pymunk space; `live` takes it through its control steps."""

    def __init__(
        self,
        genes,
        scenario,
        side,
        controller,
        *,
        network=PAPER_NETWORK,
        gain=1.0,
        noise_level=1.0,
        key=0,
        start=None,
        nominal=None,
        signs=None,
        yoking=None,
    ):
        self.kind, self.side, self.gain, self.noise_level = scenario.robot, side, gain, noise_level
        self.key, self.step_number = np.uint64(key), 0
        self.space = pymunk.Space()
        self.space.damping, self.space.collision_slop, self.space.iterations = 0, 1e-4, 10
        self.start = scenario.maze.start if start is None else start
        self.put_robot()
        self.changes = [(math.ceil(change["at_s"] / STEP - 1e-9), change) for change in scenario.changes]
        self.walls, self.wanted, self.placed_walls = None, None, []
        self.rubbing, self.speeds = None, [0.0, 0.0]
        self.felt, self.commands = [], []
        self.enter(scenario)
        self.put_walls()

        synapses, network_parts = self.shape(network, genes)
        self.genes = self.split_layers(np.clip(genes[:synapses], -2, 2))
        if controller.rule.initial_weights.name == "random":
            drawn = random.rng(int(self.key), random.Stream.initial_weights).uniform(-0.1, 0.1, synapses)
            self.genes = self.split_layers(drawn)
        self.signs = self.split_layers(np.ones(sum(g.size for g in self.genes)) if signs is None else signs)
        self.controller, self.rule = controller, controller.rule
        self.substeps = network.wiring.substeps if network.wiring else 1
        # Activations of the last substeps; s from update to update.
        self.last, self.between = [], STEP / self.substeps * self.rule.every
        self.adaptation = controller.adaptation if controller.adaptation.acts else Adaptation()
        self.task = scenario.task if scenario.task.name == "reversal" else None
        self.trials, self.reward, self.over, self.time_outs = [], 0.0, False, 0
        if self.task is not None:
            self.begin_trial()
        self.evolved = self.space_parts(genes[network_parts:])
        self.initialise()
        self.junction, self.undirected, self.before_trial = 0.0, 0.0, 0
        self.nominal, self.recent, self.arrived, self.away, self.late = nominal, None, False, 0.0, 0.0
        self.change_signal, self.exploring, self.at_goal, self.halted = math.nan, False, False, False
        self.hand = None
        self.scale, self.novelty, self.brightness, self.used_scale = 1.0, None, None, 1.0
        self.yoking, self.master, self.path = yoking, None, 0.0
        if yoking is not None:
            alone = replace(controller, rule=replace(controller.rule, control=Control.none))
            same = {"network": network, "gain": gain, "noise_level": noise_level, "key": key, "start": start}
            self.master = type(self)(genes, scenario, side, alone, nominal=nominal, signs=signs, **same)

    def shape(self, network, genes):
        """Find the shapes of the weights; returns how many weights the network has, and how many genes in all."""
        self.shapes = list(pairwise([*network.layers]))
        self.shapes[0] = (network.layers[0] + 1, network.layers[1])
        return (sum(n * m for n, m in self.shapes),) * 2

    def put_robot(self):
        """A robot at the start, at rest."""
        self.body = pymunk.Body(self.kind.mass_kg, self.kind.inertia_kg_m2)
        self.body.position, self.body.angle = (self.start.x, self.start.y), self.start.heading
        disc = pymunk.Circle(self.body, self.kind.radius_m)
        disc.friction, disc.filter = 1, ROBOT
        self.space.add(self.body, disc)

    def split_layers(self, values):
        cuts = np.cumsum([n * m for n, m in self.shapes])[:-1]
        return [part.reshape(shape) for part, shape in zip(np.split(values, cuts), self.shapes, strict=True)]

    def space_parts(self, genes):
        """The evolved parameters of the rule by name: a number, or lists by layer, by neuron, by synapse."""
        layers = [self.shapes[0][0], *(m for _, m in self.shapes)]
        sizes = {
            "network": 1,
            "layer": len(self.shapes),
            "neuron": sum(layers),
            "modulator": layers[-2] + 1,
            "reward": 1,
        }
        parts, rewarded = {}, self.task is not None
        for name, evolved in {**self.rule.evolved, **(self.rule.with_reward if rewarded else {})}.items():
            size = sizes.get(evolved.per, evolved.per)
            part, genes = np.split(genes, [sum(g.size for g in self.genes) if size == "synapse" else size])
            if size == "synapse":
                part = self.split_layers(part)
            elif evolved.per == "neuron":
                part = np.split(part, np.cumsum(layers)[:-1])
            parts[name] = part
        if rewarded and "vr" in parts:
            eta = 10 ** np.clip(parts["eta"], -1.5, 1) / 0.3
            parts |= {"v": 0.2 * parts["v"], "vr": 4 * (1 + parts["vr"]), "eta": eta}
        return parts

    def initialise(self):
        """The weights are the genes, and synapse states are new."""
        self.weights = [g.copy() for g in self.genes]
        self.synapse_state = [
            {name: np.zeros(shape) for name in ("trace", "pre", "post", "square")} for shape in self.shapes
        ]

    def enter(self, world):
        """Live in this world; its walls come with `put_walls`."""
        self.world, self.goal = world, np.array(world.goals_now[self.side])
        self.wanted = boxes(world.maze, world.obstacles, world.layout).tolist()

    def put_walls(self):
        if self.wanted == self.walls and self.rubbing == self.world.wall_friction:
            return
        x, y = self.body.position
        for left, right, bottom, top in self.wanted:
            away = math.hypot(max(left - x, 0, x - right), max(bottom - y, 0, y - top))
            if self.walls and [left, right, bottom, top] not in self.walls and away < self.kind.radius_m:
                return  # not where the robot stands
        self.space.remove(*self.placed_walls)
        self.placed_walls = []
        for left, right, bottom, top in self.wanted:
            corners = [(left, bottom), (right, bottom), (right, top), (left, top)]
            wall = pymunk.Poly(self.space.static_body, corners)
            wall.friction, wall.filter = self.world.wall_friction, WALL
            self.space.add(wall)
            self.placed_walls.append(wall)
        self.walls, self.rubbing = self.wanted, self.world.wall_friction

    def change(self):
        """The world changes when it is time."""
        for step, change in self.changes:
            if step == self.step_number:
                new = {key: value for key, value in change.items() if key != "at_s"}
                old = {name: getattr(self.world, name) for name in self.world.__dataclass_fields__}
                if "lamp" in new:
                    new["lamp"] = light.Lamp(**{**vars(old["lamp"]), **new["lamp"]})
                if "goals" in new:
                    new["goals"] = {**self.world.goals_now, **new["goals"]}
                self.enter(type(self.world)(**{**old, "changes": (), **new}))
        self.put_walls()

    def step(self):
        """One control step: sense, act, score, learn, move. Returns what happened."""
        if self.master is not None:
            self.master.step()
        self.change()
        x, y = self.body.position
        heading = self.body.angle
        readings = self.scaled(self.sense(x, y, heading))
        seen = readings if self.task is None else np.append(readings, self.reward)
        passes = [self.act(seen) for _ in range(self.substeps)]
        left, right = passes[-1][-1][-2:]
        arm = self.world.maze.arms[self.side]
        if self.task is None and arm.left < x < arm.right and arm.bottom < y < arm.top:
            self.junction = 1.0
        forward = min(1.0, max(0.0, (left + right) / 1.5))
        spin = max(0.0, 1 - abs(right - left) / 2)
        avoid = 1 - max(readings[self.kind.light.count :]) ** 3
        combined = (forward + 2 * avoid + spin + self.junction) / 5
        self.undirected += (forward + 2 * avoid + spin) / 5
        self.step_number += 1
        fitness = self.live_fitness(readings, left, right, combined, self.goal_distance((x, y)))
        need = self.need(readings, fitness, (x, y)) if self.adaptation.is_gated else 1.0
        rate = self.rule.N * need * max(self.rule.floor, fitness)
        if self.rule.N_gain_rad_s:
            rate *= self.gain / self.rule.N_gain_rad_s
        rate = rate if self.master is None else 0.0
        self.fitness = fitness
        if need == 0 and self.adaptation.plastic_when.name != "goal_signal":
            self.initialise()
        before = np.concatenate([w.ravel() for w in self.weights])
        for number, activations in enumerate(passes, 1 + (self.step_number - 1) * self.substeps):
            self.last = [*self.last, activations][-self.rule.average :]
            read = [sum(layer) / len(self.last) for layer in zip(*self.last, strict=True)]
            if "v" in self.evolved and self.rule.N > 0:
                *v, v0 = self.evolved["v"]
                of_reward = self.evolved["vr"][0] * read[0][-2] if self.task is not None else 0
                rate *= np.tanh((np.dot(v, read[-2]) + v0 + of_reward) / 2)
            if need > 0 and self.rule.N > 0 and number % self.rule.every == 0 and self.master is None:
                self.learn(read, rate)
        if self.master is not None:
            self.follow_master(before)
        self.moved_weights = np.concatenate([w.ravel() for w in self.weights]) - before
        self.path += np.abs(self.moved_weights).sum()
        change = sum(np.abs(w - g).sum() for w, g in zip(self.weights, self.genes, strict=True))
        lit = self.weights[0][: self.kind.light.count] * (1 - self.used_scale)
        change += np.abs(lit).sum() + np.abs(lit.sum(axis=0)).sum()
        self.move(*self.command(left, right, readings, need), heading)
        self.moved_to = tuple(self.body.position)
        if self.task is not None:
            self.end_step()
        return x, y, heading, seen, left, right, combined, fitness, rate, change

    def goal_distance(self, place):
        ends = self.world.goals_now.values() if self.task is not None else [self.goal]
        return min(math.dist(place, end) for end in ends)

    def begin_trial(self):
        """One more trial; the end that is rewarded in it is the other one from the trial of the switch on."""
        switched = len(self.trials) + 1 >= self.task.first_switch
        good = {"left": "right", "right": "left"}[self.side] if switched else self.side
        self.trials.append({"good": good, "reached": None, "steps": 0, "nearest": math.inf})

    def end_step(self):
        """Reward and next trial of reversal learning. The switch is certain, at `first_switch`."""
        trial, elapsed = self.trials[-1], self.step_number - self.before_trial
        if trial["reached"] is None:
            trial["nearest"] = min(trial["nearest"], self.goal_distance(self.moved_to))
            for side, end in self.world.goals_now.items():
                if math.dist(self.moved_to, end) < self.world.maze.goal_radius_m:
                    trial |= {"reached": side, "steps": elapsed}
                    self.reward = 1.0 if side == trial["good"] else -1.0
            if trial["reached"] or elapsed < int(self.task.time_out_s / STEP):
                return
            trial["steps"], self.time_outs = elapsed, self.time_outs + 1
        elif elapsed < trial["steps"] + int(self.task.reward_s / STEP):
            return
        self.reward = 0.0
        self.over = len(self.trials) == self.task.trials or self.time_outs == self.task.time_outs
        if not self.over:
            self.space.remove(self.body, *self.body.shapes)
            self.put_robot()
            self.speeds, self.undirected, self.before_trial = [0.0, 0.0], 0.0, self.step_number
            self.begin_trial()

    def sense(self, x, y, heading):
        kind = self.kind
        numbers = noise(self.key, self.step_number, kind.inputs) if self.noise_level > 0 else np.zeros(kind.inputs)
        place_x, place_y, look_x, look_y = self.placed(kind.light.places, x, y, heading)
        sun = math.atan2(light.SUN_Y, light.SUN_X) + math.radians(self.world.sun_turn_deg)
        facing = np.maximum(0, look_x * math.cos(sun) + look_y * math.sin(sun)) * math.hypot(light.SUN_X, light.SUN_Y)
        irradiance = 1 + light.SUN_IRRADIANCE * self.world.light * facing
        if self.world.second_lamp is not None:
            lamp_x, lamp_y, intensity = self.world.second_lamp
            to_x, to_y = lamp_x - place_x, lamp_y - place_y
            irradiance += intensity * np.maximum(0, look_x * to_x + look_y * to_y) / np.hypot(to_x, to_y) ** 3
        if self.side == "right":
            lamp = self.world.lamp
            to_x, to_y = lamp.x_m - place_x, lamp.y_m - place_y
            away = np.hypot(to_x, to_y)
            cosine = np.maximum(0, (look_x * to_x + look_y * to_y) / away)
            off_axis = np.arctan2(-to_y, -to_x) - math.atan2(lamp.towards_y, lamp.towards_x)
            lit = np.abs((off_axis + np.pi) % (2 * np.pi) - np.pi) <= lamp.beam_rad
            irradiance += lit * lamp.intensity * cosine / away**2
        dark = np.clip(2 - irradiance, 0, 1) * (1 + self.noise_level * 0.01 * numbers[: kind.light.count])

        distance = np.full(kind.distance.count, np.inf)
        places = zip(*self.placed(kind.distance.places, x, y, heading), strict=True)
        for i, (place_x, place_y, look_x, look_y) in enumerate(places):
            end = (place_x + look_x * kind.distance.reach_m, place_y + look_y * kind.distance.reach_m)
            hit = self.space.segment_query_first((place_x, place_y), end, 0, pymunk.ShapeFilter(mask=1))
            if hit is not None:
                distance[i] = hit.alpha * kind.distance.reach_m
        curve = np.array(kind.distance.curve)
        apparent = np.minimum(distance * kind.distance.stretch, curve[-1, 0])
        value = np.interp(apparent, curve[:, 0], curve[:, 1])
        fraction = np.interp(apparent, curve[:, 0], curve[:, 2])
        echo = value * (1 + self.noise_level * fraction * numbers[kind.light.count :])
        gain = np.where(np.array(kind.distance.places)[:, 2] > 0, self.world.left_distance_gain, 1)
        echo = np.clip(echo / kind.distance.full_scale, 0, 1) * gain * self.world.distance_gain
        echo = np.clip(echo + self.world.distance_offset, 0, 1)
        echo = echo + self.world.crosstalk * (np.roll(echo, 1) + np.roll(echo, -1))
        readings = np.clip(np.concatenate([dark, echo]), 0, 1)
        if self.world.sensor_levels:
            steps = self.world.sensor_levels - 1
            readings = np.floor(readings * steps + 0.5) / steps
        self.felt.append(readings)
        readings = self.felt[max(0, len(self.felt) - 1 - self.world.sensor_delay_steps)].copy()
        for number in self.world.dead_sensors:
            if number < kind.light.count:
                readings[number] = 1
            if number < kind.distance.count:
                readings[kind.light.count + number] = 0
        return readings

    def placed(self, places, x, y, heading):
        """Where sensors are in the maze, and the way they look."""
        cos, sin = math.cos(heading), math.sin(heading)
        own_x, own_y, azimuth = np.array(places).T
        angle = heading + np.radians(azimuth)
        return x + cos * own_x - sin * own_y, y + sin * own_x + cos * own_y, np.cos(angle), np.sin(angle)

    def scaled(self, readings):
        """Readings with the light as homeostasis scales it."""
        if not self.adaptation.homeostasis:
            return readings
        nominal, bright = self.nominal, 1 - readings[: self.kind.light.count]
        before = bright if self.brightness is None else self.brightness
        self.brightness = before + (bright - before) / max(1, self.scale)
        if self.step_number % 4 == 0:
            patterns, novelty = nominal.patterns.T, []
            for scale in (self.scale, 1.0):
                seen = np.minimum(1, scale * self.brightness)
                miss = patterns[np.argmax(patterns @ seen / nominal.lengths)] - seen
                novelty.append(np.sqrt((miss**2).mean()))
                if len(novelty) == 1:
                    pull = scale * (miss @ self.brightness) / (1e-6 + seen @ seen)
            share = 4 * STEP / (5 + 4 * STEP)
            novelty = np.array(novelty)
            self.novelty = novelty if self.novelty is None else self.novelty + share * (novelty - self.novelty)
            if self.novelty[0] > nominal.novelty:
                self.scale = np.clip(self.scale * np.exp(np.clip(3 * 4 * STEP * pull, -0.2, 0.2)), 0.05, 20)
            self.change_signal = self.novelty[0] / nominal.novelty
            self.used_scale = self.scale if self.novelty[0] < 0.7 * self.novelty[1] else 1.0
        if self.used_scale != 1:
            readings[: self.kind.light.count] = 1 - np.minimum(1, self.used_scale * self.brightness)
        return readings

    def command(self, left, right, readings, need):
        """What the wheels get of the network's outputs."""
        fastest = self.kind.motor_limit_rad_s / self.gain
        if self.adaptation.follows_walls and self.adaptation.is_gated:
            if self.exploring:
                left, right = (speed / self.gain for speed in self.follow(readings[self.kind.light.count :]))
            else:
                self.hand = None
        stay = self.adaptation.stay.name
        ends = stay == "wait" and self.away >= 1.5
        self.halted = stay in ("halt", "wait") and (self.at_goal or (self.halted and not ends))
        if self.halted:
            left, right = 0.0, 0.0
        return (np.clip(out, -fastest, fastest) for out in (left, right))

    def follow(self, near):
        """Wheel speeds [rad/s] along the nearer wall; of an e-puck."""
        sides = {"left": (near[5], near[6]), "right": (near[2], near[1])}
        if self.hand is None:
            self.hand = "left" if sum(sides["left"]) >= sum(sides["right"]) else "right"
        wall, other = max(sides[self.hand]), max(sides["right" if self.hand == "left" else "left"])
        drive, towards = 1.0, np.clip(2 * (0.3 - wall), -0.8, 0.5)
        if max(near[0], near[7]) > 0.3:
            drive, towards = 0.0, -1.0
        elif wall > 0.3 and other > 0.3:
            towards = (other - wall) / 2
        turn = towards if self.hand == "left" else -towards
        return 5 * np.clip(drive - turn, -1, 1), 5 * np.clip(drive + turn, -1, 1)

    def act(self, readings):
        activations = [np.append(readings, 1.0)]
        for weights in self.weights:
            activations.append(np.tanh(activations[-1] @ weights))
        return activations

    def live_fitness(self, readings, left, right, combined, distance):
        signal = str(self.rule.signal)
        if signal == "behaviour":
            return combined
        if signal == "final":
            return (combined + 1 - min(1, (1.7 * distance) ** 3)) / 2
        if signal == "lifetime_mean":
            before = 2 * 250 / STEP
            return (before * 0.5 + self.undirected) / (before + self.step_number - self.before_trial)
        forward = min(1.0, max(0.0, (left + right) / 1.5))
        spin = max(0.0, 1 - abs(right - left) / 2)
        follow = 1 - abs(np.mean(readings[:4]) - np.mean(readings[4:8]))
        return (forward + 2 * (1 - max(readings[3:11]) ** 3) + spin + follow) / 6

    def need(self, readings, fitness, place):
        now, over, nominal = (self.step_number - 1) * STEP, self.adaptation, self.nominal
        felt = np.append(readings, fitness)
        self.recent = felt if self.recent is None else self.recent + STEP / (5 + STEP) * (felt - self.recent)
        at_goal = math.dist(place, self.goal) < self.world.maze.goal_radius_m
        self.arrived, self.away = self.arrived or at_goal, 0.0 if at_goal else self.away + STEP
        if over.change_signal == "late":
            signal = self.away / (max(5.0, nominal.away_s) if self.arrived else nominal.time_to_goal_s)
        elif over.change_signal == "shortfall":
            signal = nominal.fitness[min(int(now), len(nominal.fitness) - 1)] - self.recent[-1]
        else:
            unlike = np.abs(self.recent[:-1] - nominal.reading_mean) / (nominal.reading_spread + 0.01)
            signal = unlike.mean(axis=1).min()
        self.change_signal = signal
        too_much = signal - over.threshold
        need = 0.0 if at_goal or not too_much > 0 else min(1.0, too_much * over.slope)
        if now >= over.start_by_s and not self.arrived:
            need = 1.0
        self.late = self.late + STEP if need else 0.0
        rests = over.active_s and self.late % (over.active_s + over.rest_s) >= over.active_s
        need = 0.0 if rests else need
        self.exploring, self.at_goal = need > 0, at_goal
        return {"always": 1.0, "late": need, "goal_signal": float(at_goal)}[over.plastic_when.name]

    def learn(self, activations, rate):
        w_max = self.rule.w_max
        for k, (pre, post) in enumerate(pairwise(activations)):
            direction = getattr(self, type(self.rule).__name__.lower())(
                k, pre[:, None], post[None, :], self.synapse_state[k]
            )
            self.weights[k] = np.clip(self.weights[k] + rate * self.signs[k] * direction, -w_max, w_max)
            if self.rule.normalise.name == "largest" and self.weights[k].any():
                self.weights[k] = self.weights[k] / np.abs(self.weights[k]).max()
            if self.rule.normalise.name == "length":
                now, initial_weight = (np.linalg.norm(w, axis=0) for w in (self.weights[k], self.genes[k]))
                self.weights[k] = np.clip(self.weights[k] / now * initial_weight, -w_max, w_max)

    def follow_master(self, weights):
        """W' = clip(W + s d_p), d: what the master's weights have moved by in this step."""
        moves = self.yoking.signs * self.master.moved_weights[self.yoking.places]
        limit = self.rule.w_max
        self.weights = self.split_layers(np.where(moves == 0, weights, np.clip(weights + moves, -limit, limit)))

    def paper(self, layer, pre, post, state):
        state["trace"] = self.rule.trace_decay * state["trace"] + self.rule.trace_update * (pre * post)
        return state["trace"]

    def oja(self, layer, pre, post, state):
        return pre * post - post**2 * self.weights[layer]

    def bcm(self, layer, pre, post, state):
        state["square"] = state["square"] + self.between / self.rule.threshold_time_s * (post**2 - state["square"])
        return pre * post * (post - state["square"])

    def differential(self, layer, pre, post, state):
        share = self.between / self.rule.trace_time_s
        state["pre"] = state["pre"] + share * (pre - state["pre"])
        state["post"] = state["post"] + share * (post - state["post"])
        return state["pre"] * post - pre * state["post"]

    def move_traces(self, pre, post, state, before, after):
        state["pre"] = state["pre"] * math.exp(-self.between / before) + pre
        state["post"] = state["post"] * math.exp(-self.between / after) + post
        return state["pre"], state["post"]

    def stdp(self, layer, pre, post, state):
        rule = self.rule
        before, after = self.move_traces(pre, post, state, rule.tau_plus_s, rule.tau_minus_s)
        return rule.A_plus * before * post - rule.A_minus * pre * after

    def abcdtraces(self, layer, pre, post, state):
        return self.abcd(layer, *self.move_traces(pre, post, state, *[self.rule.trace_time_s] * 2), state)

    def abcd(self, layer, pre, post, state):
        A, B, C, D, eta = (self.evolved[name][layer] for name in ("A", "B", "C", "D", "eta"))
        back = self.rule.leak * (self.weights[layer] - self.genes[layer])
        return eta * (A * pre * post + B * pre + C * post + D) - back

    abcdshared = abcd

    def abcdneuron(self, layer, pre, post, state):
        (A, _), (_, B), C, D, eta = (self.evolved[name][layer : layer + 2] for name in ("A", "B", "C", "D", "eta"))
        both = C[0][:, None] * C[1] * pre * post + A[:, None] * pre + B * post + D[0][:, None] * D[1]
        return (eta[0][:, None] + eta[1]) / 2 * both - self.rule.leak * (self.weights[layer] - self.genes[layer])

    def modulated(self, layer, pre, post, state):
        A, B, C, D, eta = (self.evolved[name][0] for name in ("A", "B", "C", "D", "eta"))
        return eta * (A * pre * post + B * pre + C * post + D)

    def discrete(self, layer, pre, post, state):
        high, low = 0.8 + 0.2 * self.evolved["high"][0], 0.6 + 0.2 * self.evolved["low"][0]
        if low <= self.fitness <= high:
            return np.zeros(pre.shape[0])[:, None] * post
        table = self.evolved["when_better" if self.fitness > high else "when_worse"]
        fires = [(x > self.evolved["threshold"][0]).astype(int) for x in (pre, post)]
        return self.evolved["eta"][0] * np.round(table)[2 * fires[0] + fires[1]]

    def online(self, layer, pre, post, state):
        weights, first = self.weights[layer], sum(g.size for g in self.genes[:layer])
        if "child" not in state:
            state |= {"child": weights, "parent": weights, "best": -1, "window": []}
        state["window"].append(self.fitness)
        if len(state["window"]) == int(self.rule.window_s / self.between):
            mean = sum(state["window"]) / len(state["window"])
            if mean > state["best"]:
                state |= {"parent": state["child"], "best": mean}
            place = 2**52 + (self.step_number - 1) * 2**17 + first
            drawn = [_NORMAL(self.key, place + k) for k in range(weights.size)]
            state |= {"child": state["parent"] + self.rule.sigma * np.reshape(drawn, weights.shape), "window": []}
        return state["child"] - weights

    def baldwinn(self, layer, pre, post, state):
        return 10 ** self.evolved["theta"][0] * self.paper(layer, pre, post, state)

    def move(self, left, right, heading):
        kind = self.kind
        self.commands.append((left, right))
        late = len(self.commands) - 1 - self.world.wheel_delay_steps
        left, right = self.commands[late] if late >= 0 else (0.0, 0.0)
        left, right = left * self.world.left_wheel, right * self.world.right_wheel
        spell = (self.step_number - 1) // 16
        for wheel, (output, slip) in enumerate([(left, self.world.left_slip), (right, self.world.right_slip)]):
            slips = fraction(self.key, 2**50 + 2 * spell + wheel) < slip
            wanted = self.gain * output * (0.5 if slips else 1)
            self.speeds[wheel] += (wanted - self.speeds[wheel]) / self.world.mass_ratio
        left, right = self.speeds
        speed = kind.wheel_radius_m * (left + right) / 2
        turn = kind.wheel_radius_m * (right - left) / kind.axle_m
        push = kind.mass_kg * speed / STEP
        self.body.force = (push * math.cos(heading), push * math.sin(heading))
        self.body.torque = kind.inertia_kg_m2 * turn / STEP
        self.space.step(STEP)


class Continuous(Robot):
    """A robot with a continuous-time recurrent network (Beer 1995), written from its equations.

    tau y' = -y + W [inputs, x], x = tanh(y + bias). All neurons respond at once; the last two are the wheels.
    """

    def shape(self, network, genes):
        self.neurons, inputs = sum(network.layers[1:]), network.layers[0]
        synapses, self.shapes = (inputs + self.neurons) * self.neurons, [(inputs + self.neurons, self.neurons)]
        tau, self.bias = genes[synapses : synapses + 2 * self.neurons].reshape(2, -1)
        self.tau = 0.1 * 10 ** (tau / 2)
        self.y, self.x = np.zeros(self.neurons), np.zeros(self.neurons)
        scaled = network.wiring.tau_gain_rad_s
        self.neuron_step = STEP * self.gain / scaled if scaled else STEP
        return synapses, synapses + 2 * self.neurons

    def act(self, readings):
        drive = np.concatenate([readings, self.x]) @ self.weights[0]
        self.y = self.y + np.minimum(1.0, self.neuron_step / self.tau) * (drive - self.y)
        self.x = np.tanh(self.y + self.bias)
        return [np.concatenate([readings, self.x]), self.x]


class Recurrent(Robot):
    """A robot with a simple recurrent network (Elman 1990): h = tanh(W [inputs, 1, h']), wheels = tanh(U h)."""

    def shape(self, network, genes):
        inputs, hidden, outputs = network.layers
        self.shapes, self.h = [(inputs + 1 + hidden, hidden), (hidden, outputs)], np.zeros(hidden)
        return (sum(n * m for n, m in self.shapes),) * 2

    def act(self, readings):
        self.h = np.tanh(np.concatenate([readings, [1.0], self.h]) @ self.weights[0])
        return [np.concatenate([readings, [1.0], self.h]), self.h, np.tanh(self.h @ self.weights[1])]


class Spiking(Recurrent):
    """A robot with leaky integrate-and-fire neurons: tau v' = -v + W [inputs, 1, s'], s: v >= threshold."""

    def shape(self, network, genes):
        self.wiring, (_, hidden, outputs) = network.wiring, network.layers
        self.v, self.rests, self.y, self.spikes = [0.0] * hidden, [0] * hidden, np.zeros(outputs), []
        return super().shape(network, genes)

    def act(self, readings):
        own, dt = self.wiring, STEP / self.substeps
        drives, self.h = np.concatenate([readings, [1.0], self.h]) @ self.weights[0], np.zeros(own.hidden)
        for i, drive in enumerate(drives):
            if self.rests[i]:
                self.rests[i] -= 1
                continue
            self.v[i] += (1 - math.exp(-dt / own.tau_s)) * (drive - self.v[i])
            if self.v[i] >= own.threshold:
                self.v[i], self.rests[i], self.h[i] = 0.0, round(own.refractory_s / dt), 1.0
        self.spikes.append(self.h)
        self.y = self.y + (1 - math.exp(-dt / own.readout_s)) * (self.h @ self.weights[1] - self.y)
        return [np.concatenate([readings, [1.0], self.h]), self.h, np.clip(self.y, -1, 1)]


def robot_of(network):
    """The kind of robot that has this network."""
    kinds = {None: Robot, "ctrnn": Continuous, "elman": Recurrent, "lif": Spiking}
    return kinds[network.wiring and network.wiring.name]


def live(robot, steps):
    """A whole lifetime: the metrics of `epuckhebb.tmaze.outcome.Outcome`, in the same order, and the steps."""
    done, path, arrived, changes, behaviour, contacts = [], 0.0, math.nan, 0.0, 0.0, 0
    for step in range(steps):
        done.append(robot.step())
        x, y, _, readings, _, _, combined, _, _, change = done[-1]
        path += math.dist((x, y), robot.moved_to)
        distance = robot.goal_distance(robot.moved_to)
        near = distance < robot.world.maze.goal_radius_m
        if math.isnan(arrived) and near:
            arrived = (step + 1) * STEP
        changes += change
        behaviour += combined
        contacts += max(readings[robot.kind.light.count : robot.kind.inputs]) > 0.8
        if robot.over:
            break
    steps = len(done)
    reward = 1 - min(1, (1.7 * distance) ** 3)
    return (arrived, path, distance, behaviour / steps, reward, changes / steps, change, contacts / steps, near), done
