"""Plays a champion of epuckhebb on the e-puck of Webots, with its plasticity if it has any.

This file is a Webots controller. `epuckhebb export RUN --webots` copies it, with `champion.json` beside it, into a
folder of the same name; put that below `controllers/` of a Webots project and choose it in the field `controller` of
the robot. It needs no package but the `controller` of Webots, and it is no part of the program that exports it.

Give `controllerArgs` "left" or "right", where the goal is, and the robot a GPS named "gps", if the live fitness is to
know that it has turned the right way or how far the goal is. Without them it is taken not to have turned. Restart the
simulation for each trial: then the robot begins again with its evolved weights.
"""

import json
import math
import sys
from itertools import pairwise
from pathlib import Path
from typing import Any

from controller import Robot

STEP_MS = 32
WEIGHT_LIMIT = 2.0  # genes are loaded clipped to it


class Player:
    """A network that drives the robot and may learn while it does.

    champion: what `champion.json` holds. side: `left`, `right` or nothing.
    """

    def __init__(self, champion: dict[str, Any], side: str = "") -> None:
        """Begin with the genes."""
        self.champion, self.rule, self.side = champion, champion["rule"], side
        sizes = [champion["layers"][0] + 1, *champion["layers"][1:]]  # the first layer has the bias, a constant 1
        self.weights, self.traces = [], []
        genes = iter(champion["weights"])
        for inputs, outputs in pairwise(sizes):
            rows = [[max(-WEIGHT_LIMIT, min(WEIGHT_LIMIT, next(genes))) for _ in range(outputs)] for _ in range(inputs)]
            self.weights.append(rows)
            self.traces.append([[0.0] * outputs for _ in range(inputs)])
        self.junction, self.undirected_sum, self.steps = 0.0, 0.0, 0

    def step(self, readings: list[float], position: tuple[float, float] | None) -> tuple[float, float]:
        """One step of 32 ms: act, score, learn. Returns the speeds of the left and the right wheel [rad/s]."""
        activations = [[*readings, 1.0]]
        for rows in self.weights:
            inputs = activations[-1]
            drives = [sum(x * row[j] for x, row in zip(inputs, rows, strict=True)) for j in range(len(rows[0]))]
            activations.append([math.tanh(drive) for drive in drives])
        left, right = activations[-1]
        fitness = self.live_fitness(readings, left, right, position)
        if self.rule is not None:
            self.learn(activations, self.rule["N"] * max(self.rule["floor"], fitness))
        return self.champion["gain_rad_s"] * left, self.champion["gain_rad_s"] * right

    def live_fitness(
        self, readings: list[float], left: float, right: float, position: tuple[float, float] | None
    ) -> float:
        """The live fitness F of this step, as the run had it."""
        forward = min(1.0, max(0.0, (left + right) / 1.5))
        spin = max(0.0, 1.0 - abs(right - left) / 2.0)
        nearest = max(readings[self.champion["lights"] :])
        if self.side and position is not None and self.is_in_arm(*position):
            self.junction = 1.0
        undirected = (forward + 2.0 * (1.0 - nearest**3) + spin) / 5.0
        behaviour = undirected + self.junction / 5.0
        self.undirected_sum += undirected
        self.steps += 1
        signal = self.rule["signal"] if self.rule is not None else "behaviour"
        if signal == "final":
            away = math.inf
            if self.side and position is not None:
                away = math.dist(position, self.champion["goals"][self.side])
            return (behaviour + 1.0 - min(1.0, (1.7 * away) ** 3)) / 2.0
        if signal == "lifetime_mean":
            earlier_steps, mean = float(self.rule["history_steps"]), float(self.rule["history_mean"])
            return (earlier_steps * mean + self.undirected_sum) / (earlier_steps + self.steps)
        if signal == "light_code":
            follow = 1.0 - abs(sum(readings[:4]) - sum(readings[4:8])) / 4.0
            return (forward + 2.0 * (1.0 - max(readings[3:11]) ** 3) + spin + follow) / 6.0
        return behaviour

    def is_in_arm(self, x: float, y: float) -> bool:
        """Whether the robot has turned into the arm of its goal; a bound that is None is infinite."""
        arm = self.champion["arms"][self.side]
        return all(
            bound is None or (coordinate - bound) * sign > 0
            for coordinate, name, sign in ((x, "left", 1), (x, "right", -1), (y, "bottom", 1), (y, "top", -1))
            for bound in [arm[name]]
        )

    def learn(self, activations: list[list[float]], rate: float) -> None:
        """The paper's rule; new weights are in force from the next step on."""
        decay, update, w_max = self.rule["trace_decay"], self.rule["trace_update"], self.rule["w_max"]
        for (inputs, outputs), rows, traces in zip(pairwise(activations), self.weights, self.traces, strict=True):
            for x, row, trace in zip(inputs, rows, traces, strict=True):
                for j, y in enumerate(outputs):
                    trace[j] = decay * trace[j] + update * x * y
                    row[j] = min(max(row[j] + rate * trace[j], -w_max), w_max)


def main() -> None:
    """Drive the robot until Webots ends the simulation."""
    champion = json.loads((Path(__file__).parent / "champion.json").read_text(encoding="utf-8"))
    player = Player(champion, sys.argv[1] if len(sys.argv) > 1 else "")
    robot = Robot()
    lights = [robot.getDevice(f"ls{i}") for i in range(champion["lights"])]
    distances = [robot.getDevice(f"ps{i}") for i in range(champion["layers"][0] - champion["lights"])]
    gps = robot.getDevice("gps")
    for device in (*lights, *distances, *([gps] if gps else [])):
        device.enable(STEP_MS)
    motors = [robot.getDevice(f"{side} wheel motor") for side in ("left", "right")]
    for motor in motors:
        motor.setPosition(math.inf)
        motor.setVelocity(0.0)
    while robot.step(STEP_MS) != -1:
        readings = [min(1.0, max(0.0, sensor.getValue() / champion["light_full_scale"])) for sensor in lights]
        readings += [min(1.0, max(0.0, sensor.getValue() / champion["distance_full_scale"])) for sensor in distances]
        position = None
        if gps:
            values = gps.getValues()
            x, y = (sign * values[axis] for axis, sign in champion["gps_axes"])
            position = (x, y)
        for motor, speed in zip(motors, player.step(readings, position), strict=True):
            motor.setVelocity(speed)


if __name__ == "__main__":
    main()
