"""The physics of the plane: a pymunk space with walls and robots, stepped by machine code. All of pymunk is here.

A lifetime takes thousands of steps, and a call from Python costs more than the physics. So pymunk builds the space
through its public interface, and the compiled lifetime calls the same C functions that pymunk's own `Space.step` and
`pymunk.batch` call. Their addresses are registered with LLVM by name, so the machine code can be cached on disk.
`tests/reference.py` runs the same lifetime through pymunk's public interface and must agree.

The robot is pushed, never placed: by the force and torque that give the wanted speeds in one step, in a space with full
damping. Overwriting velocities instead would discard the solver's corrections and sink the robot into walls.

Far from walls a step of pymunk is one line of arithmetic. So pymunk is called only when a wall is near or was recently.
The result is bit-identical and takes a fraction of the time (`tests/test_physics.py` checks both). The one exception is
a robot that touches two walls at once: pymunk solves their contacts in an order that depends on earlier calls
(`docs/contribute.md`). Either order is right, and ours is the same in every run.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any, ClassVar, NamedTuple

import llvmlite.binding
import numpy as np
import pymunk
from numba import types
from numpy.typing import NDArray
from pymunk._chipmunk_cffi import ffi, lib
from pymunk.batch import BodyFields

from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.compiling.kernel import compiled
from epuckhebb.tmaze.maze import Pose
from epuckhebb.tmaze.physics_engine import Move, Physics, Space
from epuckhebb.tmaze.robot import STEP_S, Robot

COLLISION_SLOP = 1e-4  # m; pymunk's default, 0.1, is larger than the robot
ITERATIONS = 10  # of the contact solver, pymunk's default
_SPARE = 4  # numbers in an exchange buffer behind those of the bodies: pymunk moves a buffer that is full, or aborts
_CLEAR_GAP = 1e-3  # m between robot and walls that counts as free of contact
_CLEAR_STEPS = 4.0  # steps without contact after which pymunk keeps nothing of the last one (it keeps 3)
MOTION = 6  # numbers of a body's motion, as pymunk.batch has it
_X, _Y, _HEADING, _V_X, _V_Y, _TURN = range(MOTION)  # places in Handles.state: the robot's motion,
_CLEAR_FOR = 12  # and, behind the row of the body that holds the walls, for how many steps nothing was touched


def _address(pointer: object) -> int:
    return int(ffi.cast("uintptr_t", pointer))


def _c_function(name: str, *arguments: types.Type) -> Any:
    """A function of pymunk's C library, for compiled code."""
    llvmlite.binding.add_symbol(name, _address(ffi.addressof(lib, name)))
    return types.ExternalFunction(name, types.void(*arguments))


_space_step = _c_function("cpSpaceStep", types.intp, types.float64)
_for_each_body = _c_function("cpSpaceEachBody", types.intp, types.intp, types.intp)
_remove_disc = _c_function("cpSpaceRemoveShape", types.intp, types.intp)
_add_disc = _c_function("cpSpaceAddShape", types.intp, types.intp)
_update_position = _c_function("cpBodyUpdatePosition", types.intp, types.float64)


class Handles(NamedTuple):
    """What compiled code needs to reach a space: addresses, and the buffers through which it reads and writes.

    state: of each robot x, y [m], heading [rad], velocity x, y [m/s], turn [rad/s]; at `_CLEAR_FOR`, for how many
    steps nothing was touched. body, disc: of the first robot.
    """

    state: Floats
    walls: Floats
    space: int
    body: int
    disc: int
    get: int
    put: int
    state_data: int
    state_count: NDArray[np.int32]
    push_data: int
    push_count: NDArray[np.int32]
    push: Floats


class _Exchange:
    """A batch buffer of pymunk's C extension, with its memory visible to NumPy."""

    def __init__(self, fields: BodyFields, room: int) -> None:
        self._floats = ffi.new("double[]", room)
        self._array = ffi.new("pmFloatArray *", {"num": 0, "max": room, "arr": self._floats})
        self._no_ids = ffi.new("pmIntArray *", {"num": 0, "max": 0, "arr": ffi.NULL})
        self._batch = ffi.new("pmBatchedData *")
        self._batch.floatArray, self._batch.intArray, self._batch.fields = self._array, self._no_ids, fields.value
        self.address = _address(self._batch)
        self.count = np.frombuffer(ffi.buffer(self._array), np.int32, 1)
        self.values = np.frombuffer(ffi.buffer(self._floats), np.float64)


class PymunkSpace(Space):
    """Walls and robots. The space is built once; `place_robot` starts each lifetime without traces of the last.

    boxes: (boxes, 4) left, right, bottom, top edge of each wall [m]. wall_friction: coefficient of friction between
    robot and walls. count: how many robots there are. Their order is that of their contacts in pymunk, so it is part of
    every result.
    """

    def __init__(self, boxes: Floats, robot: Robot, wall_friction: float = 0.0, count: int = 1) -> None:
        self._space = pymunk.Space()
        self._space.damping = 0
        self._space.collision_slop = COLLISION_SLOP
        self._space.iterations = ITERATIONS
        for left, right, bottom, top in boxes.tolist():
            wall = pymunk.Poly(self._space.static_body, [(left, bottom), (right, bottom), (right, top), (left, top)])
            wall.friction = wall_friction  # 0 in the paper's world: with it the paper's tables do not come out
            self._space.add(wall)
        self._robots = []
        for _ in range(count):
            body = pymunk.Body(robot.mass_kg, robot.inertia_kg_m2)
            disc = pymunk.Circle(body, robot.radius_m)
            disc.friction = float(wall_friction > 0)  # pymunk multiplies it by the wall's, or the other robot's
            self._space.add(body, disc)
            self._robots.append((body._body, disc._shape))
        motion = BodyFields.POSITION | BodyFields.ANGLE | BodyFields.VELOCITY | BodyFields.ANGULAR_VELOCITY
        room = MOTION * (count + 1) + _SPARE  # the body that holds the walls has a row, too
        self._exchanges = state, push = _Exchange(motion, room), _Exchange(BodyFields.FORCE | BodyFields.TORQUE, room)
        self._handles = Handles(
            state=state.values,
            walls=boxes,
            space=_address(self._space._space),
            body=_address(self._robots[0][0]),
            disc=_address(self._robots[0][1]),
            get=_address(ffi.addressof(lib, "pmSpaceBodyGetIteratorFuncBatched")),
            put=_address(ffi.addressof(lib, "pmSpaceBodySetIteratorFuncBatched")),
            state_data=state.address,
            state_count=state.count,
            push_data=push.address,
            push_count=push.count,
            push=push.values,
        )

    @property
    def handles(self) -> Handles:
        """What compiled code needs, in the thread that asks."""
        return self._handles

    def place_robot(self, *poses: Pose) -> None:
        """Take each robot out of the space and put it in again at its pose, at rest.

        pymunk then keeps nothing of what it touched. These are the C functions behind pymunk's methods; a new body and
        a new disc would take six times as long.
        """
        space = self._space._space
        self.handles.state[:] = 0.0
        for body, disc in self._robots:  # all of them before any is put in: pymunk moves the last into the free place
            lib.cpSpaceRemoveShape(space, disc)
            lib.cpSpaceRemoveBody(space, body)
        for number, ((body, disc), pose) in enumerate(zip(self._robots, poses, strict=True)):
            lib.cpBodyUpdatePosition(body, 0.0)  # no time passes; clears what the last contact left to correct, v_bias
            lib.cpBodySetPosition(body, (pose.x, pose.y))
            lib.cpBodySetAngle(body, pose.heading)
            lib.cpBodySetVelocity(body, (0.0, 0.0))
            lib.cpBodySetAngularVelocity(body, 0.0)
            lib.cpSpaceAddBody(space, body)
            lib.cpSpaceAddShape(space, disc)
            self.handles.state[MOTION * number : MOTION * number + 3] = pose

    def take_over(self, old: "PymunkSpace") -> None:
        """Put a robot where the one of another space is, with the same motion and without its contacts."""
        motion = old.handles.state[:_CLEAR_FOR].copy()
        self.place_robot(Pose(*motion[:3].tolist()))
        body, _ = self._robots[0]
        lib.cpBodySetVelocity(body, tuple(motion[[_V_X, _V_Y]].tolist()))
        lib.cpBodySetAngularVelocity(body, float(motion[_TURN]))
        self.handles.state[:_CLEAR_FOR] = motion


@compiled
def _give(space: Handles) -> None:
    """Give pymunk the motion that is in `state`."""
    space.state_count[0] = 0
    _for_each_body(space.space, space.put, space.state_data)


@compiled
def _step(space: Handles) -> None:
    """Let pymunk apply the forces that are in `push`, step, and fill `state`."""
    space.push_count[0] = 0
    _for_each_body(space.space, space.put, space.push_data)
    _space_step(space.space, STEP_S)
    space.state_count[0] = 0
    _for_each_body(space.space, space.get, space.state_data)


@compiled
def put_back(space: Handles, x: float, y: float, heading: float) -> None:
    """Put the robot at a place, at rest, without traces of what was before."""
    state = space.state
    state[_X], state[_Y], state[_HEADING] = x, y, heading
    state[_V_X], state[_V_Y], state[_TURN] = 0.0, 0.0, 0.0
    state[_CLEAR_FOR] = 0.0
    _remove_disc(space.space, space.disc)
    _update_position(space.body, 0.0)
    _give(space)
    _add_disc(space.space, space.disc)


@cache
def _pusher(robot: Robot) -> Callable[[float, float], tuple[float, float]]:
    """The function that gives the force ahead and the torque for wheels that turn at left and right [rad/s]."""
    mass, inertia, wheel_radius, axle = robot.mass_kg, robot.inertia_kg_m2, robot.wheel_radius_m, robot.axle_m

    @compiled
    def push(left: float, right: float) -> tuple[float, float]:
        speed, turn = wheel_radius * (left + right) / 2.0, wheel_radius * (right - left) / axle
        return mass * speed / STEP_S, inertia * turn / STEP_S

    return push


@cache
def mover(robot: Robot) -> Move:
    """The function `move(space, cos, sin, left, right)` that moves a robot of this kind for one step.

    It pushes a robot that looks along (cos, sin) so that its wheels turn at left and right [rad/s]. pymunk moves
    bodies first and applies forces afterwards, so the command takes effect in the *next* step.
    """
    mass, inertia, push = robot.mass_kg, robot.inertia_kg_m2, _pusher(robot)
    near = (robot.radius_m + _CLEAR_GAP) ** 2

    @compiled
    def move(space: Handles, cos: float, sin: float, left: float, right: float) -> None:
        force, torque = push(left, right)
        state = space.state
        x = state[_X] + state[_V_X] * STEP_S
        y = state[_Y] + state[_V_Y] * STEP_S
        clear = _is_clear(x, y, space.walls, near)
        if clear and state[_CLEAR_FOR] >= _CLEAR_STEPS:
            state[_X], state[_Y] = x, y
            state[_HEADING] += state[_TURN] * STEP_S
            state[_V_X] = force * cos * (1.0 / mass) * STEP_S
            state[_V_Y] = force * sin * (1.0 / mass) * STEP_S
            state[_TURN] = torque * (1.0 / inertia) * STEP_S
            return
        if state[_CLEAR_FOR] >= _CLEAR_STEPS:
            _give(space)
        space.push[0], space.push[1], space.push[2] = force * cos, force * sin, torque
        _step(space)
        state[_CLEAR_FOR] = state[_CLEAR_FOR] + 1.0 if clear and state[_CLEAR_FOR] < _CLEAR_STEPS else 0.0

    return move


@cache
def mover_of_all(robot: Robot) -> Callable[[Handles, Floats, Floats], None]:
    """The function `move_all(space, motion, wheels)` that moves all robots of a space at once for one step.

    motion: (robots, 6), the view of the space's state. wheels: (robots, 4) left and right wheel [rad/s], and where each
    robot looks, cosine and sine. pymunk is called if any robot is near a wall or another robot, or was recently.
    """
    mass, inertia, push = robot.mass_kg, robot.inertia_kg_m2, _pusher(robot)
    near, apart = (robot.radius_m + _CLEAR_GAP) ** 2, (2.0 * robot.radius_m + _CLEAR_GAP) ** 2

    @compiled
    def move_all(space: Handles, motion: Floats, wheels: Floats) -> None:
        robots, state = motion.shape[0], space.state
        clear_for = MOTION * (robots + 1)
        clear = True
        for i in range(robots):
            x = motion[i, _X] + motion[i, _V_X] * STEP_S
            y = motion[i, _Y] + motion[i, _V_Y] * STEP_S
            clear = clear and _is_clear(x, y, space.walls, near)
            for j in range(i):
                to_x = motion[j, _X] + motion[j, _V_X] * STEP_S - x
                to_y = motion[j, _Y] + motion[j, _V_Y] * STEP_S - y
                clear = clear and to_x * to_x + to_y * to_y >= apart
        easy = clear and state[clear_for] >= _CLEAR_STEPS
        if not easy and state[clear_for] >= _CLEAR_STEPS:
            _give(space)
        for i in range(robots):
            left, right, cos, sin = wheels[i, 0], wheels[i, 1], wheels[i, 2], wheels[i, 3]
            force, torque = push(left, right)
            if easy:
                motion[i, _X] += motion[i, _V_X] * STEP_S
                motion[i, _Y] += motion[i, _V_Y] * STEP_S
                motion[i, _HEADING] += motion[i, _TURN] * STEP_S
                motion[i, _V_X] = force * cos * (1.0 / mass) * STEP_S
                motion[i, _V_Y] = force * sin * (1.0 / mass) * STEP_S
                motion[i, _TURN] = torque * (1.0 / inertia) * STEP_S
            else:
                space.push[3 * i], space.push[3 * i + 1], space.push[3 * i + 2] = force * cos, force * sin, torque
        if easy:
            return
        _step(space)
        state[clear_for] = state[clear_for] + 1.0 if clear and state[clear_for] < _CLEAR_STEPS else 0.0

    return move_all


@compiled
def _is_clear(x: float, y: float, walls: Floats, near: float) -> bool:
    """Whether a robot with its centre at (x, y) touches no wall. near: square of the distance of contact [m2]."""
    for wall in range(walls.shape[0]):
        beside = max(walls[wall, 0] - x, x - walls[wall, 1], 0.0)
        ahead = max(walls[wall, 2] - y, y - walls[wall, 3], 0.0)
        if beside * beside + ahead * ahead < near:
            return False
    return True


@dataclass(frozen=True, kw_only=True)
class Pymunk(Physics):
    """Rigid bodies in the plane, which has no settings."""

    ignores: ClassVar[tuple[str, ...]] = ("robot.solid", "maze.wall_height_m")

    def space(self, walls: Floats, world: Any) -> PymunkSpace:
        """A space with these walls, (boxes, 4), for the robot of a world."""
        return PymunkSpace(walls, world.robot, world.wall_friction)

    def mover(self, robot: Robot) -> Move:
        """The function `move(space, cos, sin, left, right)` that moves the robot for one step."""
        return mover(robot)

    def placer(self) -> Callable[..., None]:
        """The function `place(space, x, y, heading)`, which does what `Space.place_robot` does."""
        return put_back


PYMUNK = Pymunk()
