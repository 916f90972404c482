"""What a physics must offer: a space with walls in which a robot stands, moves and senses.

A physics is one file of `physics/`, with a subclass of `Physics` that holds its settings, and a file of `conf/physics/`
with their values. `pymunk` is that of the paper's experiments, in the plane; `ode` is three-dimensional.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.compiling.kernel import compiled, nothing
from epuckhebb.controller.own_class import OwnClass
from epuckhebb.tmaze.maze import Pose
from epuckhebb.tmaze.robot import Robot
from epuckhebb.tmaze.sensors import Kernels, SensorGroup, put_rays

# What compiled code needs of a space: `state`, whose first numbers are x, y [m] and heading [rad] of the robot, and
# `walls`, (boxes, 4) left, right, bottom and top edge [m]. Each physics adds its own.
Handles = Any


class Space(ABC):
    """Walls and one robot."""

    @property
    @abstractmethod
    def handles(self) -> Any:
        """What compiled code needs in the thread that asks: `state`, `walls`, and what the physics adds."""

    @abstractmethod
    def place_robot(self, pose: Pose) -> None:
        """Start a lifetime: put the robot at this pose, at rest, without traces of what was before."""

    @abstractmethod
    def take_over(self, old: Any) -> None:
        """Put a robot where the one of another space is, with the same motion and without its contacts."""


Move = Callable[[Any, float, float, float, float], None]


@dataclass(frozen=True, kw_only=True)
class Physics(OwnClass, ABC):
    """A physics with its settings.

    ray_numbers: how many describe the ray of a sensor. tilts: how many numbers tell its tilt. ignores: keys of the
    configuration that describe a world in three dimensions, and act in no lifetime with this physics.
    """

    PART: ClassVar[str] = "physics"
    KEY: ClassVar[str] = "physics.kind"
    ray_numbers: ClassVar[int] = 6
    tilts: ClassVar[int] = 0
    ignores: ClassVar[tuple[str, ...]] = ()

    @abstractmethod
    def space(self, walls: Floats, world: Any) -> Space:
        """A space with these walls, (boxes, 4), for the robot of a world, a `Scenario`."""

    @abstractmethod
    def mover(self, robot: Robot) -> Move:
        """The function `move(space, cos, sin, left, right)` that moves a robot of this kind for one step.

        The robot looks along (cos, sin); its wheels are to turn at left and right [rad/s].
        """

    def placer(self) -> Callable[..., None] | None:
        """The function `place(space, x, y, heading)`, which does what `Space.place_robot` does; None if Python must."""
        return None

    def put_rays(self, robot: Robot) -> Callable[..., None]:  # noqa: ARG002  # others need it
        """The function `put(space, x, y, cos, sin, places, rays)` that fills the rays of a robot's sensors."""
        return put_rays

    def kernels(self, group: SensorGroup, first: int, radius_m: float) -> Kernels:
        """The functions of a group of sensors. first: place of its first input. radius_m: of the robot."""
        return group.kernels(first, radius_m)

    def record_tilt(self) -> Callable[..., None]:
        """The function `record(space, tilt, sample)` that writes the tilt of the robot into a sample."""
        return nothing

    def check(self, world: Any) -> None:  # most worlds can be in any
        """Check that a world can be in this physics; else a ValueError."""


@compiled
def pose(space: Handles) -> Pose:
    """The robot's x, y [m] and heading [rad]."""
    return Pose(space.state[0], space.state[1], space.state[2])


@compiled
def is_lost(x: float, y: float, heading: float, arena: float) -> bool:
    """Whether a pose is not finite or outside the arena [m]; no physics reports either."""
    return not (abs(x) < arena and abs(y) < arena and math.isfinite(heading))
