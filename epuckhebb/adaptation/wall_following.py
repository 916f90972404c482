"""Wall-following, an exploration: while the gate is open, the robot follows a wall instead of its network.

    wall beside it                     drive ahead, turn by clip(2 (0.3 - wall), -0.8, 0.5) towards it
    walls on both sides                keep to the middle: drive ahead, turn by (other - wall) / 2
    something ahead                    turn away on the spot

The robot follows the wall that is nearer when it begins. This is a hand-written reflex on distance readings alone.
"""

from collections.abc import Callable

from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.compiling.kernel import compiled
from epuckhebb.tmaze.robot import Robot

SPEED_RAD_S = 5.0  # of the wheels
NEAR = 0.3  # the distance reading at which it keeps a wall: 12 mm from an e-puck's rim
_FRONT, _AHEAD, _SIDE = 31.5, 68.0, 112.0  # degrees: up to which a sensor looks to the front, ahead and to the side


def wall_following(robot: Robot) -> Callable[[Floats, Floats], tuple[float, float]]:
    """The function that follows a wall: `follow(readings, hand)` gives the wheels' speeds [rad/s].

    hand: (1,) 1 for a wall on its left, -1 on its right, 0 to choose the nearer one; it is written.
    """
    front, ahead_left, side_left, ahead_right, side_right = _sensors(robot)
    speed = min(SPEED_RAD_S, robot.motor_limit_rad_s)

    @compiled
    def nearest(readings: Floats, sensors: tuple[int, ...]) -> float:
        most = 0.0
        for sensor in sensors:
            most = max(most, readings[sensor])
        return most

    @compiled
    def follow(readings: Floats, hand: Floats) -> tuple[float, float]:
        left, before_left = nearest(readings, side_left), nearest(readings, ahead_left)
        right, before_right = nearest(readings, side_right), nearest(readings, ahead_right)
        if hand[0] == 0.0:
            hand[0] = 1.0 if left + before_left >= right + before_right else -1.0
        wall, opposite = max(left, before_left), max(right, before_right)
        if hand[0] < 0.0:
            wall, opposite = opposite, wall
        drive, towards = 1.0, min(0.5, max(-0.8, 2.0 * (NEAR - wall)))
        if nearest(readings, front) > NEAR:
            drive, towards = 0.0, -1.0
        elif wall > NEAR and opposite > NEAR:
            towards = 0.5 * (opposite - wall)
        turn = hand[0] * towards
        return speed * min(1.0, max(-1.0, drive - turn)), speed * min(1.0, max(-1.0, drive + turn))

    return follow


def _sensors(robot: Robot) -> list[tuple[int, ...]]:
    """Which inputs look to the front, ahead and to the side on the left, ahead and to the side on the right."""
    groups: list[list[int]] = [[], [], [], [], []]
    for number, sensor in enumerate(robot.distance.places, robot.input_places(robot.distance).start):
        azimuth = (sensor.azimuth + 180.0) % 360.0 - 180.0
        away, first = abs(azimuth), 1 if azimuth > 0 else 3
        if away <= _FRONT:
            groups[0].append(number)
        elif away <= _SIDE:
            groups[first if away <= _AHEAD else first + 1].append(number)
    if not all(groups):
        raise ValueError(f"adaptation.exploration=wall_following needs sensors all around, unlike {robot.name}")
    return [tuple(sensors) for sensors in groups]
