"""What can change in an environment at a step of a lifetime: its physics, its readings, its actions.

A name that is none of `CHANGES` is an attribute of the environment, as NS-Gym has them: `masspole` and `length` of the
cart-pole, `LINK_MASS_1` of the acrobot.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from epuckhebb.controller.own_class import calling

AT, FUNCTION = "at", "function"


@dataclass
class Faults:
    """What is wrong between an environment and its controller.

    dead: readings that are 0. noise: standard deviation by the number of a reading, after its scale. delay: steps that
    actions wait.
    """

    dead: list[int] = field(default_factory=list)
    noise: dict[int, float] = field(default_factory=dict)
    delay: int = 0


def _number(value: Any, name: str, least: float = -math.inf) -> float:
    if not isinstance(value, int | float) or isinstance(value, bool) or not least <= value < math.inf:
        raise ValueError(f"{name} must be a finite number{'' if least else ', 0 or more'}, got {value!r}")
    return float(value)


def _pairs(values: Any, name: str, what: str) -> Mapping[Any, Any]:
    if isinstance(values, Mapping):
        return values
    raise ValueError(f"{name} must be {{{what}}}, got {values!r}")


def _model(env: Any, name: str) -> Any:
    if not hasattr(env, "model"):
        raise ValueError(f"{name} is for environments of MuJoCo, and {type(env).__name__} is none")
    return env.model


def _factors(values: Any, known: Mapping[str, int], name: str) -> dict[int, float]:
    """The factor of each part of a body that is named, by its number."""
    for part in _pairs(values, name, "PART: FACTOR"):
        if part not in known:
            raise ValueError(f"{name}.{part} is not there; this body has {', '.join(known)}")
    return {known[part]: _number(factor, f"{name}.{part}", 0) for part, factor in values.items()}


def _gravity(env: Any, value: Any, _faults: Faults) -> None:
    """Let things fall with this acceleration [m/s^2]."""
    if hasattr(env, "model"):
        env.model.opt.gravity[2] = -_number(value, "gravity")
    else:
        _attribute(env, "gravity", value)


def _friction(env: Any, value: Any, _faults: Faults) -> None:
    """Multiply the friction of all surfaces."""
    _model(env, "friction").geom_friction[:] *= _number(value, "friction", 0)


def _mass(env: Any, values: Any, _faults: Faults) -> None:
    """Multiply the mass of bodies, by their names, and their inertia."""
    model = _model(env, "mass")
    known = {model.body(k).name: k for k in range(1, model.nbody) if model.body(k).name}
    for body, factor in _factors(values, known, "mass").items():
        model.body_mass[body] *= factor
        model.body_inertia[body] *= factor


def _joint_strength(env: Any, values: Any, _faults: Faults) -> None:
    """Multiply the strength of motors, by the names of their joints; 0: dead."""
    model = _model(env, "joint_strength")
    known = {model.joint(int(model.actuator_trnid[k, 0])).name: k for k in range(model.nu)}
    for motor, factor in _factors(values, known, "joint_strength").items():
        model.actuator_gear[motor] *= factor


def _places(env: Any, numbers: Any, name: str) -> list[int]:
    count = readings_of(env.observation_space)
    for number in numbers if isinstance(numbers, list | Mapping) else [numbers]:
        if not isinstance(number, int) or not 0 <= number < count:
            raise ValueError(f"{name} must have numbers of readings, from 0 to {count - 1}, got {numbers!r}")
    return list(numbers)


def _dead_readings(env: Any, numbers: Any, faults: Faults) -> None:
    """Let readings, by their numbers, be 0."""
    faults.dead = _places(env, numbers, "dead_readings")


def _noisy_readings(env: Any, values: Any, faults: Faults) -> None:
    """Add normal noise to readings: {number: standard deviation}."""
    places = _places(env, _pairs(values, "noisy_readings", "NUMBER: STANDARD DEVIATION"), "noisy_readings")
    faults.noise = {place: _number(values[place], "noisy_readings", 0) for place in places}


def _action_delay(_env: Any, value: Any, faults: Faults) -> None:
    """Let actions take effect so many steps later."""
    if not isinstance(value, int) or isinstance(value, bool) or value < 0:
        raise ValueError(f"action_delay must be a whole number of steps, 0 or more, got {value!r}")
    faults.delay = value


def _attribute(env: Any, name: str, value: Any) -> None:
    """Set a number that the environment has, and what a cart-pole makes of it."""
    numbers = [own for own in dir(env) if not own.startswith("_") and type(getattr(env, own, None)) in (int, float)]
    if name not in numbers:
        known = ", ".join([*CHANGES, FUNCTION, *numbers])
        raise ValueError(f"{type(env).__name__} has no number {name}; a change is one of {known}")
    setattr(env, name, _number(value, name))
    if hasattr(env, "polemass_length"):
        env.total_mass, env.polemass_length = env.masspole + env.masscart, env.masspole * env.length


CHANGES: dict[str, Callable[[Any, Any, Faults], None]] = {
    "gravity": _gravity,
    "friction": _friction,
    "mass": _mass,
    "joint_strength": _joint_strength,
    "dead_readings": _dead_readings,
    "noisy_readings": _noisy_readings,
    "action_delay": _action_delay,
}


def apply(change: Mapping[str, Any], env: Any, faults: Faults, functions: Mapping[str, Callable[[Any], None]]) -> None:
    """Change an environment, unwrapped, and what is between it and its controller. functions: the user's, by name."""
    for name, value in change.items():
        if name == FUNCTION:
            with calling(f"environment.changes: {value}"):
                functions[value](env)
        elif name in CHANGES:
            CHANGES[name](env, value, faults)
        elif name != AT:
            _attribute(env, name, value)


def readings_of(space: Any, what: str = "observations") -> int:
    """How many readings observations of a space are; a ValueError if they are none of Box and Discrete."""
    kind = type(space).__name__
    if kind not in ("Box", "Discrete"):
        raise ValueError(f"{what} must be of Box or Discrete, and are of {kind}")
    return int(space.n if kind == "Discrete" else max(1, np.prod(space.shape)))
