"""The physical world: a pymunk space with walls and one robot, stepped from compiled code. The only file with pymunk.

A lifetime takes thousands of steps, and a call from Python costs more than the physics. So pymunk builds the space
through its public interface, and the compiled lifetime calls the same C functions that pymunk's own `Space.step` and
`pymunk.batch` call. Their addresses are registered with LLVM by name, hence the machine code can be cached on disk.
`tests/reference.py` lives the same lifetime through pymunk's public interface and must agree.

The robot is pushed, never placed: force and torque that would give the wanted speeds in one step, in a space that
damps everything else away. Overwriting velocities instead discards the solver's corrections and sinks it into walls.
"""

import math
from typing import NamedTuple

import llvmlite.binding
import numpy as np
import pymunk
from numba import types
from numpy.typing import NDArray
from pymunk._chipmunk_cffi import ffi, lib
from pymunk.batch import BodyFields

from epuckhebb.sim.compiled import compiled
from epuckhebb.sim.epuck import AXLE, INERTIA, MASS, RADIUS, STEP_S, WHEEL_RADIUS
from epuckhebb.sim.maze import Pose

COLLISION_SLOP = 1e-4  # m; pymunk's default, 0.1, is larger than the robot
ITERATIONS = 10  # of the contact solver, pymunk's default
_ROOM = 16  # numbers in an exchange buffer; a body takes three, and the space has two


def _address(pointer: object) -> int:
    return int(ffi.cast("uintptr_t", pointer))


for _name in ("cpSpaceStep", "cpSpaceEachBody"):
    llvmlite.binding.add_symbol(_name, _address(ffi.addressof(lib, _name)))
_space_step = types.ExternalFunction("cpSpaceStep", types.void(types.intp, types.float64))
_for_each_body = types.ExternalFunction("cpSpaceEachBody", types.void(types.intp, types.intp, types.intp))


class Handles(NamedTuple):
    """What compiled code needs to reach a space: addresses, and two buffers through which it reads and pushes."""

    space: int
    read: int
    read_data: int
    read_count: NDArray[np.int32]
    pose: NDArray[np.float64]
    push: int
    push_data: int
    push_count: NDArray[np.int32]
    force: NDArray[np.float64]


class _Exchange:
    """A batch buffer of pymunk's C extension, with its memory visible to NumPy."""

    def __init__(self, fields: BodyFields) -> None:
        self._floats = ffi.new("double[]", _ROOM)
        self._array = ffi.new("pmFloatArray *", {"num": 0, "max": _ROOM, "arr": self._floats})
        self._no_ids = ffi.new("pmIntArray *", {"num": 0, "max": 0, "arr": ffi.NULL})
        self._batch = ffi.new("pmBatchedData *")
        self._batch.floatArray, self._batch.intArray, self._batch.fields = self._array, self._no_ids, fields.value
        self.address = _address(self._batch)
        self.count = np.frombuffer(ffi.buffer(self._array), np.int32, 1)
        self.values = np.frombuffer(ffi.buffer(self._floats), np.float64)


class World:
    """Walls and one robot. Built once, then the robot is replaced for each lifetime, which leaves no trace of the last.

    boxes: (boxes, 4) left, right, bottom, top edge of each wall [m].
    """

    def __init__(self, boxes: NDArray[np.float64]) -> None:
        self._space = pymunk.Space()
        self._space.damping = 0
        self._space.collision_slop = COLLISION_SLOP
        self._space.iterations = ITERATIONS
        for left, right, bottom, top in boxes.tolist():
            wall = pymunk.Poly(
                self._space.static_body, [(left, bottom), (right, bottom), (right, top), (left, top)]
            )
            wall.friction = 0  # with friction the robot jams in the stem, and the paper's tables do not come out
            self._space.add(wall)
        self._robot: tuple[pymunk.Body, pymunk.Circle] | None = None
        self._read = _Exchange(BodyFields.POSITION | BodyFields.ANGLE)
        self._push = _Exchange(BodyFields.FORCE | BodyFields.TORQUE)
        self.handles = Handles(
            space=_address(self._space._space),
            read=_address(ffi.addressof(lib, "pmSpaceBodyGetIteratorFuncBatched")),
            read_data=self._read.address,
            read_count=self._read.count,
            pose=self._read.values,
            push=_address(ffi.addressof(lib, "pmSpaceBodySetIteratorFuncBatched")),
            push_data=self._push.address,
            push_count=self._push.count,
            force=self._push.values,
        )

    def place_robot(self, pose: Pose) -> None:
        """Put a new robot, at rest, in the place of the old one."""
        if self._robot is not None:
            self._space.remove(*self._robot)
        body = pymunk.Body(MASS, INERTIA)
        body.position = (pose.x, pose.y)
        body.angle = pose.heading
        disc = pymunk.Circle(body, RADIUS)
        disc.friction = 0
        self._space.add(body, disc)
        self._robot = (body, disc)


@compiled
def read_pose(world: Handles) -> tuple[float, float, float]:
    """The robot's x, y [m] and heading [rad]."""
    world.read_count[0] = 0
    _for_each_body(world.space, world.read, world.read_data)
    return world.pose[0], world.pose[1], world.pose[2]


@compiled
def move(world: Handles, cos: float, sin: float, left: float, right: float) -> None:
    """Push a robot that looks along (cos, sin) so that its wheels turn at left and right [rad/s], and let a step pass.

    pymunk moves bodies first and applies forces afterwards: the robot moves by this command in the *next* step.
    """
    speed = WHEEL_RADIUS * (left + right) / 2.0
    turn = WHEEL_RADIUS * (right - left) / AXLE
    push = MASS * speed / STEP_S
    world.force[0] = push * cos
    world.force[1] = push * sin
    world.force[2] = INERTIA * turn / STEP_S
    world.push_count[0] = 0
    _for_each_body(world.space, world.push, world.push_data)
    _space_step(world.space, STEP_S)


@compiled
def is_finite(x: float, y: float, heading: float) -> bool:
    """Whether a pose is made of numbers; pymunk lets infinite forces through in silence."""
    return math.isfinite(x) and math.isfinite(y) and math.isfinite(heading)
