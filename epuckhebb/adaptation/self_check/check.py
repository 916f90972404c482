"""The self-check of one robot: drive the calibration manoeuvre, find what has changed, decide what to correct.

It corrects a finding only if it is clear and explained:

    light    |rho - 1| > max(0.1, 3 standard errors)        if the light readings fit
    wheels   |loss| > max(0.02, 3 standard errors)          if the distance readings fit
    dead     always

A careful robot corrects dead sensors alone where any readings are unexplained: what it does not know may have caused
the other findings. It also turns back where the manoeuvre has left it turned.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from epuckhebb.adaptation.self_check.calibration import STEPS, calibrate
from epuckhebb.adaptation.self_check.corrections import Corrections, no_corrections, sunlit
from epuckhebb.adaptation.self_check.findings import MISFIT, Findings, find
from epuckhebb.adaptation.self_check.memory import SelfMemory, check_robot, regression
from epuckhebb.controller import random
from epuckhebb.controller.random import Stream
from epuckhebb.tmaze.life import CalibrationRecord
from epuckhebb.tmaze.maze import Pose, Side
from epuckhebb.tmaze.robot import Robot
from epuckhebb.tmaze.scenario import Scenario

LEAST_LIGHT, LEAST_LOSS = 0.1, 0.02  # smaller changes are not corrected
ERRORS = 3.0  # nor those within so many standard errors
DEAD = "dead sensors"


@dataclass(frozen=True, kw_only=True)
class Checked:
    """The result of a self-check.

    calibration: the manoeuvre and its sensor readings. corrected: which of the findings are corrected: `left wheel`,
    `right wheel`, `light`, `dead sensors`. corrections: as numbers for the lifetime. turned_back: whether the robot,
    being careful, noticed that the manoeuvre had left it turned.
    """

    calibration: CalibrationRecord
    found: Findings
    corrected: tuple[str, ...]
    corrections: Corrections
    turned_back: bool

    @property
    def end(self) -> Pose:
        """Where the manoeuvre ended and the lifetime starts."""
        return Pose(*self.calibration.poses[-1].tolist())


def check(
    memory: SelfMemory,
    world: Scenario,
    side: Side,
    key: np.uint64,
    noise: float = 1.0,
    start: Pose | None = None,
    *,
    careful: bool = False,
) -> Checked:
    """Run the self-check in a world as it is at the start.

    key: of the lifetime that follows; the manoeuvre draws other noise.

    Raises:
        ValueError: the robot lacks the sensors, or the memory is of another robot.
    """
    check_robot(world.robot)
    if memory.inputs != world.robot.inputs or memory.lights != world.robot.light.count:
        raise ValueError(
            f"the self-check was measured with a robot of {memory.lights} light sensors and {memory.inputs} "
            f"readings; robot {world.robot.name} has {world.robot.light.count} and {world.robot.inputs}"
        )
    own_key = random.key(int(key), Stream.calibration_noise)
    calibration = calibrate(world.phases[0][1], side, own_key, noise, start, careful=careful)
    found = find(calibration.readings[: len(STEPS)], memory)
    corrected = tuple(clear(found))
    if careful and unexplained(found):
        corrected = tuple(finding for finding in corrected if finding == DEAD)
    return Checked(
        calibration=calibration,
        found=found,
        corrected=corrected,
        corrections=corrections_for(found, corrected, memory, world.robot),
        turned_back=len(calibration.readings) > len(STEPS),
    )


def unexplained(found: Findings) -> tuple[str, ...]:
    """Which sensor readings, `distance` or `light`, no known cause explains."""
    return tuple(kind for kind in ("distance", "light") if getattr(found, f"{kind}_misfit") > MISFIT)


def clear(found: Findings) -> Iterator[str]:
    """Which findings are clear enough to be corrected. A wheel that does not turn cannot be."""
    unknown = unexplained(found)
    for place, wheel in enumerate(("left wheel", "right wheel")):
        loss, error = found.wheel_loss[place], found.wheel_loss_error[place]
        if "distance" not in unknown and abs(loss) > max(LEAST_LOSS, ERRORS * error) and loss < 1.0:
            yield wheel
    ratio, error = found.light_ratio, found.light_ratio_error
    large = abs(ratio - 1.0) > max(LEAST_LIGHT, ERRORS * error)
    if "light" not in unknown and large and ratio > 0.0 and math.isfinite(1.0 / ratio):
        yield "light"
    if found.dead_sensors:
        yield DEAD


def corrections_for(found: Findings, corrected: tuple[str, ...], memory: SelfMemory, robot: Robot) -> Corrections:
    """The corrections of these findings, as numbers for a lifetime."""
    by = no_corrections(robot)
    if DEAD in corrected:
        places = np.array(found.dead_sensors)
        dead = np.concatenate([places, robot.inputs_of(robot.distance).start + places])
        others = np.setdiff1d(np.arange(robot.inputs), dead)
        by.seeing[places] = 0.0
        by = by._replace(dead=dead, others=others, regression=regression(memory.moments, memory.inputs, dead, others))
    if "light" in corrected:
        by = by._replace(
            light_ratio=found.light_ratio,
            sun_now=sunlit(robot, memory.light * found.light_ratio),
            sun_training=sunlit(robot, memory.light),
        )
    if "left wheel" in corrected:
        by = by._replace(left_loss=float(found.wheel_loss[0]))
    if "right wheel" in corrected:
        by = by._replace(right_loss=float(found.wheel_loss[1]))
    return by
