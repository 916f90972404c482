"""The oracle: one robot in plain Python, NumPy and pymunk's public interface, from the paper's equations.

Nothing here is shared with the compiled lifetime but the facts of the world (walls, sensor table, sun and lamp) and the
noise numbers. It is also the loop that `benchmarks/step.py` compares with: the program as one would first write it.
"""

import math
from itertools import pairwise

import numpy as np
import pymunk

from epuckhebb.sim import epuck, light, noise
from epuckhebb.sim.maze import GOAL_RADIUS, GOALS, START, boxes

STEP = 0.032
SHAPES = ((17, 7), (7, 5), (5, 8), (8, 4), (4, 2))


class Robot:
    """A robot in a pymunk space; `live` takes it through its control steps."""

    def __init__(self, genome, scenario, side, hebbian, gain=1.0, noise_level=1.0, key=0, start=START, remembered=None):
        self.space = pymunk.Space()
        self.space.damping, self.space.collision_slop, self.space.iterations = 0, 1e-4, 10
        for left, right, bottom, top in boxes(scenario.obstacles, scenario.layout).tolist():
            corners = [(left, bottom), (right, bottom), (right, top), (left, top)]
            wall = pymunk.Poly(self.space.static_body, corners)
            wall.friction, wall.filter = 0, pymunk.ShapeFilter(categories=1)
            self.space.add(wall)
        self.body = pymunk.Body(epuck.MASS, epuck.INERTIA)
        self.body.position, self.body.angle = (start.x, start.y), start.heading
        disc = pymunk.Circle(self.body, epuck.RADIUS)
        disc.friction, disc.filter = 0, pymunk.ShapeFilter(categories=2)
        self.space.add(self.body, disc)

        cuts = np.cumsum([n * m for n, m in SHAPES])[:-1]
        genome = np.clip(genome, -2, 2)
        self.genes = [part.reshape(shape) for part, shape in zip(np.split(genome, cuts), SHAPES, strict=True)]
        self.weights = [part.copy() for part in self.genes]
        self.traces = [np.zeros(shape) for shape in SHAPES]
        self.hebbian, self.gain, self.noise_level, self.key = hebbian, gain, noise_level, np.uint64(key)
        self.scenario, self.lamp_on, self.goal = scenario, side == "right", GOALS[side]
        self.numbers = np.zeros(16)
        self.junction, self.undirected, self.step_number = 0.0, 0.0, 0
        self.remembered, self.recent, self.arrived, self.away, self.surprised = remembered, None, False, 0.0, 0.0

    def step(self):
        """One control step: sense, act, score, learn, move. Returns what happened."""
        x, y = self.body.position
        heading = self.body.angle
        readings = self.sense(x, y, heading)
        activations = self.act(readings)
        left, right = activations[-1]
        if y > 0.10 and (x > 0.08 if self.goal[0] > 0 else x < -0.08):
            self.junction = 1.0
        forward = min(1.0, max(0.0, (left + right) / 1.5))
        spin = max(0.0, 1 - abs(right - left) / 2)
        avoid = 1 - max(readings[8:]) ** 3
        combined = (forward + 2 * avoid + spin + self.junction) / 5
        self.undirected += (forward + 2 * avoid + spin) / 5
        self.step_number += 1
        fitness = self.live_fitness(readings, left, right, combined, math.dist((x, y), self.goal))
        need = self.need(readings, fitness, (x, y)) if self.hebbian.surprise else 1.0
        rate = self.hebbian.N * need * max(self.hebbian.floor, fitness)
        if need == 0:
            self.weights, self.traces = [g.copy() for g in self.genes], [0 * g for g in self.genes]
        elif self.hebbian.N > 0:
            self.learn(activations, rate)
        change = sum(np.abs(w - g).sum() for w, g in zip(self.weights, self.genes, strict=True))
        self.move(left, right, heading)
        return x, y, heading, readings, left, right, combined, fitness, rate, change

    def sense(self, x, y, heading):
        if self.noise_level > 0:
            noise.normal_numbers(self.key, self.step_number, self.numbers)
        cos, sin = math.cos(heading), math.sin(heading)
        place_x = x + cos * epuck.PLACE_X - sin * epuck.PLACE_Y
        place_y = y + sin * epuck.PLACE_X + cos * epuck.PLACE_Y
        look_x, look_y = np.cos(heading + epuck.AZIMUTH), np.sin(heading + epuck.AZIMUTH)

        irradiance = 1 + light.SUN_IRRADIANCE * self.scenario.light * np.maximum(
            0, look_x * light.SUN_X + look_y * light.SUN_Y
        )
        if self.lamp_on:
            lamp = self.scenario.lamp
            to_x, to_y = lamp.x_m - place_x, lamp.y_m - place_y
            away = np.hypot(to_x, to_y)
            cosine = np.maximum(0, (look_x * to_x + look_y * to_y) / away)
            irradiance += (np.arccos(to_x / away) <= lamp.beam_rad) * lamp.intensity * cosine / away**2
        dark = np.clip(2 - irradiance, 0, 1) * (1 + self.noise_level * 0.01 * self.numbers[:8])

        distance = np.full(8, epuck.REACH)
        for i in range(8):
            start = (place_x[i], place_y[i])
            end = (place_x[i] + look_x[i] * epuck.REACH, place_y[i] + look_y[i] * epuck.REACH)
            hit = self.space.segment_query_first(start, end, 0, pymunk.ShapeFilter(mask=1))
            if hit is not None:
                distance[i] = hit.alpha * epuck.REACH
        apparent = distance * epuck.APPARENT_DISTANCE
        value = np.interp(apparent, epuck.INFRARED[:, 0], epuck.INFRARED[:, 1])
        fraction = np.interp(apparent, epuck.INFRARED[:, 0], epuck.INFRARED[:, 2])
        echo = value * (1 + self.noise_level * fraction * self.numbers[8:])
        readings = np.clip(np.concatenate([dark, echo / 2000]), 0, 1)
        if self.scenario.dead_sensor is not None:
            readings[[self.scenario.dead_sensor, 8 + self.scenario.dead_sensor]] = 1, 0
        return readings

    def act(self, readings):
        activations = [np.append(readings, 1.0)]
        for weights in self.weights:
            activations.append(np.tanh(activations[-1] @ weights))
        return activations

    def live_fitness(self, readings, left, right, combined, distance):
        signal = self.hebbian.signal.name
        if signal == "behaviour":
            return combined
        if signal == "final":
            return (combined + 1 - min(1, (1.7 * distance) ** 3)) / 2
        if signal == "lifetime_mean":
            before = 2 * 250 / STEP
            return (before * 0.5 + self.undirected) / (before + self.step_number)
        forward = min(1.0, max(0.0, (left + right) / 1.5))
        spin = max(0.0, 1 - abs(right - left) / 2)
        follow = 1 - abs(np.mean(readings[:4]) - np.mean(readings[4:8]))
        return (forward + 2 * (1 - max(readings[3:11]) ** 3) + spin + follow) / 6

    def need(self, readings, fitness, place):
        now, rule, memory = (self.step_number - 1) * STEP, self.hebbian, self.remembered
        felt = np.append(readings, fitness)
        self.recent = felt if self.recent is None else self.recent + STEP / (5 + STEP) * (felt - self.recent)
        at_goal = math.dist(place, self.goal) < GOAL_RADIUS
        self.arrived, self.away = self.arrived or at_goal, 0.0 if at_goal else self.away + STEP
        if rule.surprise.name == "lateness":
            surprise = self.away / (max(5.0, memory.away) if self.arrived else memory.time_to_goal)
        elif rule.surprise.name == "shortfall":
            surprise = memory.fitness[min(int(now), len(memory.fitness) - 1)] - self.recent[16]
        else:
            unlike = np.abs(self.recent[:16] - memory.reading_mean) / (memory.reading_spread + 0.01)
            surprise = unlike.mean(axis=1).min()
        self.surprise = surprise
        over = surprise - rule.tolerance
        need = 0.0 if at_goal or not over > 0 else min(1.0, over / rule.ramp) if rule.ramp else 1.0
        self.surprised = self.surprised + STEP if need else 0.0
        rests = rule.spell_s and self.surprised % (rule.spell_s + rule.rest_s) >= rule.spell_s
        return 0.0 if rests else need

    def learn(self, activations, rate):
        rule = self.hebbian
        for layer, (pre, post) in enumerate(pairwise(activations)):
            correlation = np.outer(pre, post)
            self.traces[layer] = rule.trace_decay * self.traces[layer] + rule.trace_update * correlation
            self.weights[layer] = np.clip(self.weights[layer] + rate * self.traces[layer], -rule.w_max, rule.w_max)

    def move(self, left, right, heading):
        left, right = left * self.scenario.left_wheel, right * self.scenario.right_wheel
        speed = self.gain * epuck.WHEEL_RADIUS * (left + right) / 2
        turn = self.gain * epuck.WHEEL_RADIUS * (right - left) / epuck.AXLE
        push = epuck.MASS * speed / STEP
        self.body.force = (push * math.cos(heading), push * math.sin(heading))
        self.body.torque = epuck.INERTIA * turn / STEP
        self.space.step(STEP)


def live(robot, steps):
    """A whole lifetime: the metrics of `epuckhebb.sim.lifetime.Outcome`, in the same order, and the steps."""
    told, path, arrived, changes, behaviour, contacts = [], 0.0, math.nan, 0.0, 0.0, 0
    for step in range(steps):
        happened = robot.step()
        x, y, _, readings, _, _, combined, _, _, change = happened
        told.append(happened)
        path += math.dist((x, y), robot.body.position)
        distance = math.dist(robot.body.position, robot.goal)
        if math.isnan(arrived) and distance < GOAL_RADIUS:
            arrived = (step + 1) * STEP
        changes += change
        behaviour += combined
        contacts += max(readings[8:]) > 0.8
    reward = 1 - min(1, (1.7 * distance) ** 3)
    return (arrived, path, distance, behaviour / steps, reward, changes / steps, change, contacts / steps, steps), told
