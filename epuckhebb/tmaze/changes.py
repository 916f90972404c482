"""What may change in a world during a lifetime, planned or by hand, and which values that may have.

`epuckhebb.tmaze.scenario` says what each means, and `epuckhebb.tmaze.session` does it.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.ranges import Range, check_value
from epuckhebb.tmaze.faults import KINDS
from epuckhebb.tmaze.light import BRIGHTEST, Lamp
from epuckhebb.tmaze.maze import SIDES, Box, Maze, Pose, gap
from epuckhebb.tmaze.robot import STEP_S

WHOLE = [name for name, kind in KINDS.items() if kind is int]  # faults that are whole numbers
GROUPED = {"lamp": Lamp}  # keys with keys of their own
AT_ONCE: Mapping[str, Any] = {"put": None, "reset": False}  # what happens at one step, and is over
CHANGEABLE = (
    *("light", "sun_turn_deg", *GROUPED, "second_lamp", "obstacles", "layout", "goals", "dead_sensors", *KINDS),
    *("mass_ratio", "wall_friction", "lamp_on", "placed", "rate", *AT_ONCE),
)
MOST_BLOCKS = 20
SPARE = 0.001  # m: by about this much a robot sinks into a wall in the physics
SMALLEST_M, LARGEST_M = 0.005, 0.5  # sides of a block


def _are_numbers(value: Any, count: int) -> bool:
    return (
        isinstance(value, list | tuple) and len(value) == count and all(number in Range(-math.inf) for number in value)
    )


def _are_goals(value: Any) -> bool:
    sides = isinstance(value, Mapping) and set(value) <= set(SIDES)
    return value is None or (sides and all(_are_numbers(goal, 2) for goal in value.values()))


_KINDS: dict[str, tuple[Callable[[Any], bool], str]] = {  # what a value must be
    **dict.fromkeys(("obstacles", "layout", *WHOLE), (lambda value: type(value) is int, "a whole number")),
    "lamp_on": (lambda value: value is None or isinstance(value, bool), "true, false, or null for what the side says"),
    "reset": (lambda value: isinstance(value, bool), "true or false"),
    "second_lamp": (
        lambda value: value is None or (_are_numbers(value, 3) and 0 <= value[2] <= BRIGHTEST),
        f"[x, y, intensity], in m and from 0 to {BRIGHTEST:g}, or null for none",
    ),
    "put": (lambda value: value is None or _are_numbers(value, 3), "[x, y, heading] in m and rad"),
    "placed": (
        lambda value: isinstance(value, list | tuple) and all(_are_numbers(box, 4) for box in value),
        "a list of [x, y, width, height] in m",
    ),
    "goals": (_are_goals, "{left: [x, y], right: [x, y]}, or one of them"),
}


def check_kind(key: str, value: object) -> None:
    """Check that a new value is of the right kind; else a ValueError."""
    is_right, what = _KINDS.get(key.removeprefix("scenario."), (lambda _: True, ""))
    if not is_right(value):
        raise ValueError(f"{key} must be {what}, got {value!r}")


def check_changes(key: str, changes: Sequence[Mapping[str, Any]]) -> None:
    """Check the keys and the times of changes, `scenario.changes` or `scenario.hand`; else a ValueError."""
    last = 0.0
    for number, change in enumerate(changes):
        where = f"scenario.{key}[{number}]"
        if not set(change) <= {"at_s", *CHANGEABLE} or len(change) < 2 or "at_s" not in change:
            raise ValueError(f"{where} must have at_s and some of {', '.join(CHANGEABLE)}, got {[*change]}")
        at_s = change["at_s"]
        check_value(f"{where}.at_s", at_s, Range(last, above=True))
        last = at_s


def first_step(change: Mapping[str, Any]) -> int:
    """The first step that is not before a change."""
    return math.ceil(float(change["at_s"]) / STEP_S - 1e-9)


def check_placed(placed: Sequence[Box], maze: Maze) -> None:
    """Refuse too many blocks, blocks of no sensible size, and blocks outside the maze."""
    if len(placed) > MOST_BLOCKS:
        raise ValueError(f"placed must hold at most {MOST_BLOCKS} blocks, got {len(placed)}")
    for box in placed:
        if not all(SMALLEST_M <= side <= LARGEST_M for side in (box.width, box.height)):
            raise ValueError(f"placed: the sides of a block must be {SMALLEST_M:g} to {LARGEST_M:g} m, got {list(box)}")
        if max(abs(box.x), abs(box.y)) > maze.arena_m:
            raise ValueError(f"placed: the middle of a block must be in the maze, got {list(box)}")


def check_room(key: str, pose: Pose, maze: Maze, radius: float, standing: Floats) -> None:
    """Check that a robot of this radius [m] has room at a pose; else a ValueError. standing: (boxes, 4), all walls."""
    if max(abs(pose.x), abs(pose.y)) > maze.arena_m or gap(pose.x, pose.y, standing) < radius - SPARE:
        raise ValueError(f"{key} = {pose.x:g}, {pose.y:g}: there is no room for a robot of radius {radius:g} m")
