"""Three-dimensional physics, by the Open Dynamics Engine: the e-puck as Webots has it, with wheels that have friction.

The robot is a body on two hinged, driven wheels and stands on a floor between walls. It rocks, leans and has limited
traction. Constants are those of the published world file and of Webots' defaults; nothing was fitted. Each step finds
the contacts, at most the ten deepest of each pair, and lets `dWorldStep` solve them.

Source of the model: Webots' e-puck and its world defaults, see `conf/physics/ode.yaml` and `docs/ode.md`.
"""

import math
import weakref
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.compiling.kernel import compiled
from epuckhebb.controller.ranges import within
from epuckhebb.tmaze import libode
from epuckhebb.tmaze.libode import (
    attach,
    collide,
    copy_position,
    copy_rotation,
    create_contact,
    empty_group,
    matrix_rows,
    rotation,
    set_hinge,
    world_step,
)
from epuckhebb.tmaze.light import Lights
from epuckhebb.tmaze.maze import Pose
from epuckhebb.tmaze.physics_engine import Move, Physics, Space
from epuckhebb.tmaze.robot import STEP_S, Robot, Solid
from epuckhebb.tmaze.sensors import Kernels, LightSensors, SensorGroup

_CONTACT = 31  # numbers in a record dContact; see libode's headers: mode, mu, ..., at 15 the geometry, at 23 its depth
_MODE, _MU, _BOUNCE, _BOUNCE_SPEED, _ERP, _CFM, _GEOMETRY, _DEPTH = 0, 1, 6, 7, 8, 9, 15, 23
_BYTES = 8
_SURFACE = 0x4 | 0x8 | 0x10 | 0x7000  # bounces, is soft by ERP and CFM, friction in proportion to the normal force
_FOUND, _KEPT = 100, 10  # contacts of a pair, as in Webots
_SPEED, _MOST_TORQUE = 2, 5  # parameters of a hinge
_ALL_DATA = 0xFFFFFFFF  # that ODE keeps for a thread
_ALONG_Y = 2  # direction of a wheel's axle
_X, _Y, _HEADING, _ROLL, _PITCH, _HEIGHT = range(6)  # places in Handles.state
_UPRIGHT = 0.7  # cosine of the tilt of a robot that has not fallen over
_ON_FLOOR_M = 0.01  # a robot higher, or lower, than this has left the floor
_MARGIN_M = 1e-4  # by which walls may be nearer than they are thought


class Handles(NamedTuple):
    """What compiled code needs to reach a space; addresses are numbers.

    state: x, y [m], heading, roll, pitch [rad], height of its base [m]. walls: (boxes, 4). geometries: of the walls.
    parts: (4, 2) geometry and body of left wheel, hull, underside and right wheel. turned: (12,) rotation of the body,
    row by row. position: (4,) of its centre of mass. contacts: (_FOUND, _CONTACT). ..._at: where an array is in memory.
    """

    state: Floats
    walls: Floats
    geometries: NDArray[np.int64]
    parts: NDArray[np.int64]
    floor: int
    world: int
    group: int
    body: int
    left: int
    right: int
    turned: Floats
    turned_at: int
    position: Floats
    position_at: int
    contacts: Floats
    contacts_at: int


class _Body:
    """The robot in a world of its own, at a pose and at rest."""

    def __init__(self, physics: "Ode", robot: Robot, solid: Solid, pose: Pose) -> None:
        ode = libode.library()
        self.world, self.group = ode.dWorldCreate(), ode.dJointGroupCreate(0)
        threading = ode.dThreadingAllocateSelfThreadedImplementation()  # several threads each step a world of their own
        functions = ode.dThreadingImplementationGetFunctions(threading)
        ode.dWorldSetStepThreadingImplementation(self.world, functions, threading)
        ode.dWorldSetGravity(self.world, 0.0, 0.0, -physics.gravity_m_s2)
        ode.dWorldSetERP(self.world, physics.erp)
        ode.dWorldSetCFM(self.world, physics.joint_cfm)
        self.hull, *wheels = [ode.dBodyCreate(self.world) for _ in range(3)]
        mass, centre = np.zeros(17), solid.centre_of_mass_m  # of a record dMass
        ode.dMassSetParameters(mass.ctypes.data, solid.mass_kg, 0.0, 0.0, 0.0, *solid.inertia_kg_m2, 0.0, 0.0, 0.0)
        ode.dBodySetMass(self.hull, mass.ctypes.data)
        low, high = solid.hull_m
        under = solid.underside
        hull = ode.dCreateCylinder(None, robot.radius_m, high - low)
        box = ode.dCreateBox(None, under.length, under.width, under.height)
        for shape, middle in ((hull, (low + high) / 2), (box, under.middle)):
            ode.dGeomSetBody(shape, self.hull)
            ode.dGeomSetOffsetPosition(shape, 0.0, 0.0, middle - centre)
        turned = rotation(0.0, 0.0, 1.0, pose.heading) @ rotation(*physics.put_down)
        across = matrix_rows(rotation(1.0, 0.0, 0.0, math.pi / 2))
        rows, foot = matrix_rows(turned), np.array([pose.x, pose.y, 0.0])
        ode.dBodySetPosition(self.hull, *(foot + turned @ (0.0, 0.0, centre)))
        ode.dBodySetRotation(self.hull, rows.ctypes.data)
        self.hinges, tyres = [], []
        for wheel, side in zip(wheels, (1, -1), strict=True):
            ode.dMassSetCylinderTotal(
                mass.ctypes.data, solid.wheel_mass_kg, _ALONG_Y, robot.wheel_radius_m, solid.wheel_width_m
            )
            ode.dBodySetMass(wheel, mass.ctypes.data)
            tyre = ode.dCreateCylinder(None, robot.wheel_radius_m, solid.wheel_width_m)
            ode.dGeomSetBody(tyre, wheel)
            ode.dGeomSetOffsetRotation(tyre, across.ctypes.data)
            axle = foot + turned @ (0.0, side * robot.axle_m / 2, robot.wheel_radius_m)
            ode.dBodySetPosition(wheel, *axle)
            ode.dBodySetRotation(wheel, rows.ctypes.data)
            hinge = ode.dJointCreateHinge(self.world, None)
            ode.dJointAttach(hinge, wheel, self.hull)
            ode.dJointSetHingeAnchor(hinge, *axle)
            ode.dJointSetHingeAxis(hinge, *(turned @ (0.0, 1.0, 0.0)))
            ode.dJointSetHingeParam(hinge, _MOST_TORQUE, solid.motor_torque_n_m)
            self.hinges.append(hinge)
            tyres.append(tyre)
        self.parts = np.array([(tyres[0], wheels[0]), (hull, self.hull), (box, self.hull), (tyres[1], wheels[1])])
        self.state, self.turned, self.position = np.zeros(6), rows, np.zeros(4)
        self.state[:3] = pose
        weakref.finalize(self, _destroy, ode, self.world, self.group, threading, [hull, box, *tyres])


def _destroy(ode: Any, world: int, group: int, threading: int, shapes: list[int]) -> None:
    for shape in shapes:
        ode.dGeomDestroy(shape)
    ode.dJointGroupDestroy(group)
    ode.dWorldDestroy(world)
    ode.dThreadingFreeImplementation(threading)


class OdeSpace(Space):
    """Walls on a floor; each lifetime has a robot, and with it a world of ODE, of its own.

    boxes: (boxes, 4) left, right, bottom, top edge of each wall [m]. height: of the walls [m].
    """

    def __init__(self, physics: "Ode", boxes: Floats, height: float, robot: Robot) -> None:
        assert robot.solid is not None  # `Ode.check` has looked
        self._physics, self._robot, self._solid = physics, robot, robot.solid
        ode = libode.library()
        self._floor = ode.dCreatePlane(None, 0.0, 0.0, 1.0, 0.0)
        geometries = []
        for left, right, bottom, top in boxes.tolist():
            wall = ode.dCreateBox(None, right - left, top - bottom, height)
            ode.dGeomSetPosition(wall, (left + right) / 2, (bottom + top) / 2, height / 2)
            geometries.append(wall)
        self._walls, self._geometries = boxes, np.array(geometries, np.int64)
        self._contacts = np.zeros((_FOUND, _CONTACT))
        self._contacts[:, [_MU, _BOUNCE, _BOUNCE_SPEED, _ERP, _CFM]] = (
            *(physics.friction, physics.bounce, physics.bounce_speed_m_s),
            *(physics.erp, physics.contact_cfm),
        )
        self._contacts.view(np.int32)[:, 2 * _MODE] = _SURFACE
        weakref.finalize(self, lambda shapes: list(map(ode.dGeomDestroy, shapes)), [self._floor, *geometries])

    def place_robot(self, pose: Pose) -> None:
        """Start a lifetime: put the robot at this pose, at rest, without traces of what was before."""
        self._body = _Body(self._physics, self._robot, self._solid, pose)

    def take_over(self, old: "OdeSpace") -> None:
        """Put the robot of another space, which keeps no contacts, among these walls."""
        self._body = old._body

    @property
    def handles(self) -> Handles:
        """What compiled code needs, in the thread that asks, in which ODE may work from now on."""
        libode.library().dAllocateODEDataForThread(_ALL_DATA)
        body, contacts = self._body, self._contacts
        return Handles(
            state=body.state,
            walls=self._walls,
            geometries=self._geometries,
            parts=body.parts,
            floor=self._floor,
            world=body.world,
            group=body.group,
            body=body.hull,
            left=body.hinges[0],
            right=body.hinges[1],
            turned=body.turned,
            turned_at=body.turned.ctypes.data,
            position=body.position,
            position_at=body.position.ctypes.data,
            contacts=contacts,
            contacts_at=contacts.ctypes.data,
        )


@dataclass(frozen=True, kw_only=True)
class Ode(Physics):
    """Rigid bodies in three dimensions.

    friction: coefficient, of all contacts. erp: share of an overlap that a step mends. contact_cfm, joint_cfm: softness
    of contacts and of joints. bounce: share of the speed that a contact faster than bounce_speed_m_s gives back.
    sun_up: upward part of the unit vector towards the sun. lamp_m: height of the lamps above the floor. put_down: axis
    in the robot's frame and angle [rad] by which a robot is turned when it is put somewhere, besides its heading.
    """

    ray_numbers: ClassVar[int] = 10
    tilts: ClassVar[int] = 3

    gravity_m_s2: float = within(0, above=True, default=9.81)
    friction: float = within(0, default=1.0)
    erp: float = within(0, 1, default=0.2)
    contact_cfm: float = within(0, above=True, default=0.001)
    joint_cfm: float = within(0, above=True, default=1e-5)
    bounce: float = within(0, 1, default=0.5)
    bounce_speed_m_s: float = within(0, default=0.01)
    sun_up: float = within(0, 1, default=0.776)
    lamp_m: float = within(0, default=0.0)
    put_down: tuple[float, ...] = (-1.0, 1.0, 1.0, -0.004395102393195)

    def __post_init__(self) -> None:
        """Validate the settings."""
        super().__post_init__()
        if len(self.put_down) != 4 or not any(self.put_down[:3]):
            raise ValueError(f"physics.put_down must be [x, y, z, angle], x, y, z not all 0, got {list(self.put_down)}")

    def space(self, walls: Floats, world: Any) -> OdeSpace:
        """A space with these walls, (boxes, 4), for the robot of a world."""
        return OdeSpace(self, walls, world.maze.wall_height_m, world.robot)

    def check(self, world: Any) -> None:
        """Check that a world says what three dimensions need; else a ValueError."""
        robot, maze = world.robot, world.maze
        if robot.solid is None:
            raise ValueError(f"physics=ode needs the keys robot.solid, and robot {robot.name} has none")
        if maze.wall_height_m is None:
            raise ValueError(f"physics=ode needs maze.wall_height_m [m], and maze {maze.name} has none")
        if world.task.has_trials:
            raise ValueError(f"physics=ode cannot put the robot back during a lifetime, as task={world.task.name} does")
        if world.wall_friction:
            raise ValueError(f"physics=ode needs scenario.wall_friction=0, got {world.wall_friction}; give friction")

    def mover(self, robot: Robot) -> Move:
        """The function `move(space, cos, sin, left, right)` that moves the robot for one step."""
        libode.library()
        assert robot.solid is not None  # `check` has looked
        top, centre = robot.solid.hull_m[1], robot.solid.centre_of_mass_m
        wheel = math.hypot(robot.axle_m / 2 + robot.solid.wheel_width_m / 2, robot.wheel_radius_m)
        under = math.hypot(robot.solid.underside.length, robot.solid.underside.width) / 2
        reach = np.array([wheel, robot.radius_m, under, wheel]) + _MARGIN_M  # how far each part gets from the middle

        @compiled  # the plane needs the heading
        def move(space: Handles, cos: float, sin: float, left: float, right: float) -> None:  # noqa: ARG001
            state, turned = space.state, space.turned
            if not (math.isfinite(left) and math.isfinite(right)):
                state[_HEADING] = math.nan  # ODE would end the process
                return
            set_hinge(space.left, _SPEED, left)
            set_hinge(space.right, _SPEED, right)
            empty_group(space.group)
            leans = math.sqrt(max(0.0, 1.0 - turned[10] * turned[10]))
            for part in range(space.parts.shape[0]):
                near = reach[part] + top * leans
                for wall in range(space.walls.shape[0] - 1, -1, -1):
                    beside = max(space.walls[wall, 0] - state[_X], state[_X] - space.walls[wall, 1], 0.0)
                    ahead = max(space.walls[wall, 2] - state[_Y], state[_Y] - space.walls[wall, 3], 0.0)
                    if beside * beside + ahead * ahead < near * near:
                        touch(space, part, space.geometries[wall])
                touch(space, part, space.floor)
            world_step(space.world, STEP_S)
            copy_position(space.body, space.position_at)
            copy_rotation(space.body, space.turned_at)
            state[_X] = space.position[0] - turned[2] * centre
            state[_Y] = space.position[1] - turned[6] * centre
            state[_HEIGHT] = space.position[2] - turned[10] * centre
            state[_ROLL] = math.atan2(turned[9], turned[10])
            state[_PITCH] = -math.asin(min(1.0, max(-1.0, turned[8])))
            turn = math.atan2(turned[4], turned[0]) - state[_HEADING]
            state[_HEADING] += turn - 2.0 * math.pi * np.rint(turn / (2.0 * math.pi))
            if not (turned[10] > _UPRIGHT and abs(state[_HEIGHT]) < _ON_FLOOR_M):
                state[_HEADING] = math.nan

        return move

    def put_rays(self, robot: Robot) -> Callable[..., None]:
        """The function that fills the rays of the sensors, each with its height [m] and the vector of its look."""
        assert robot.solid is not None  # `check` has looked
        height = robot.solid.sensor_height_m

        @compiled  # the plane needs the heading
        def put(space: Handles, x: float, y: float, cos: float, sin: float, places: Floats, rays: Floats) -> None:  # noqa: ARG001
            turned = space.turned
            for i in range(places.shape[1]):
                ahead, left, look_ahead, look_left = places[0, i], places[1, i], places[2, i], places[3, i]
                rays[0, i] = x + turned[0] * ahead + turned[1] * left + turned[2] * height
                rays[1, i] = y + turned[4] * ahead + turned[5] * left + turned[6] * height
                rays[6, i] = space.state[_HEIGHT] + turned[8] * ahead + turned[9] * left + turned[10] * height
                rays[7, i] = turned[0] * look_ahead + turned[1] * look_left
                rays[8, i] = turned[4] * look_ahead + turned[5] * look_left
                rays[9, i] = turned[8] * look_ahead + turned[9] * look_left
                level = math.sqrt(rays[7, i] * rays[7, i] + rays[8, i] * rays[8, i])
                rays[2, i], rays[3, i] = rays[7, i] / level, rays[8, i] / level
                rays[4, i], rays[5, i] = 1.0 / rays[2, i], 1.0 / rays[3, i]

        return put

    def kernels(self, group: SensorGroup, first: int, radius_m: float) -> Kernels:
        """The functions of a group of sensors: light falls from above and the floor, all else is as in the plane."""
        if not isinstance(group, LightSensors):
            return group.kernels(first, radius_m)
        lamp_height, sun_up = self.lamp_m, self.sun_up

        @compiled
        def irradiance(rays: Floats, i: int, lit: Lights) -> float:
            bright: float = 1.0 + lit.sun * max(
                0.0, rays[7, i] * lit.sun_x + rays[8, i] * lit.sun_y + rays[9, i] * sun_up
            )
            if lit.second_intensity > 0.0:
                bright += lit.second_intensity * lamp(rays, i, lit.second_x, lit.second_y, lamp_height, 0.0, 0.0, -1.0)
            if lit.lamp_intensity > 0.0:
                towards = lit.lamp_towards_x, lit.lamp_towards_y, lit.cos_beam
                bright += lit.lamp_intensity * lamp(rays, i, lit.lamp_x, lit.lamp_y, lamp_height, *towards)
            return bright

        return group.kernels(first, radius_m, irradiance)

    def record_tilt(self) -> Callable[..., None]:
        """The function `record(space, tilt, sample)` that writes the tilt of the robot into a sample."""

        @compiled
        def record(space: Handles, tilt: Floats, sample: int) -> None:
            for k in range(3):
                tilt[sample, k] = space.state[_ROLL + k]

        return record


@compiled
def lamp(
    rays: Floats, i: int, x: float, y: float, height: float, towards_x: float, towards_y: float, cos_beam: float
) -> float:
    """Irradiance on sensor i from a lamp of intensity 1 at (x, y, height) that shines along (towards_x, towards_y)."""
    to_x, to_y, to_z = x - rays[0, i], y - rays[1, i], height - rays[6, i]
    distance = math.sqrt(to_x * to_x + to_y * to_y + to_z * to_z)
    if -(towards_x * to_x + towards_y * to_y) < cos_beam * distance:  # outside the beam
        return 0.0
    facing: float = max(0.0, rays[7, i] * to_x + rays[8, i] * to_y + rays[9, i] * to_z)
    return facing / (distance * distance * distance)


@compiled
def touch(space: Handles, part: int, geometry: int) -> None:
    """Make the contacts of a part of the robot with a wall or the floor, the ten deepest."""
    contacts = space.contacts
    count = collide(space.parts[part, 0], geometry, _FOUND, space.contacts_at + _GEOMETRY * _BYTES, _CONTACT * _BYTES)
    for k in range(min(count, _KEPT)):
        if count > _KEPT:
            deepest = k
            for candidate in range(k + 1, count):
                if contacts[candidate, _DEPTH] > contacts[deepest, _DEPTH]:
                    deepest = candidate
            for number in range(_CONTACT):
                contacts[k, number], contacts[deepest, number] = contacts[deepest, number], contacts[k, number]
        joint = create_contact(space.world, space.group, space.contacts_at + k * _CONTACT * _BYTES)
        attach(joint, space.parts[part, 1], 0)
