"""What can change in an environment at a step of a lifetime: its physics, its readings, its actions.

A name that is none of `CHANGES` is an attribute of the environment, as NS-Gym has them: `masspole` and `length` of the
cart-pole, `LINK_MASS_1` of the acrobot. Factors are of the value at the start of the lifetime: 1 restores it.
"""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from epuckhebb.controller.own_class import calling

AT, FUNCTION, DELAY, DEAD = "at", "function", "action_delay", "dead_readings"
_DRAWN = ("screen_width", "screen_height", "screen_dim", "SCREEN_DIM", "isopen", "np_random_seed")
_INERT = {  # numbers that are drawn, or computed anew from others, by the name of their class
    "Env": _DRAWN,
    "MujocoEnv": ("width", "height"),
    "CartPoleEnv": ("total_mass", "polemass_length"),
    "AcrobotEnv": ("LINK_LENGTH_2", "actions_num"),
}


@dataclass(kw_only=True)
class Faults:
    """What is wrong between an environment and its controller.

    readings: their names. dead: numbers of readings that are 0. noise: standard deviation by the number of a reading,
    after its scale. delay: steps that actions wait. start: arrays of a model of MuJoCo before any change.
    """

    readings: Sequence[str]
    dead: list[int] = field(default_factory=list)
    noise: dict[int, float] = field(default_factory=dict)
    delay: int = 0
    start: dict[str, Any] = field(default_factory=dict)

    def initial_array(self, model: Any, name: str) -> Any:
        """An array of a model as it was before any change of this lifetime."""
        return self.start.setdefault(name, getattr(model, name).copy())


def _number(value: Any, name: str, least: float = -math.inf) -> float:
    is_number = isinstance(value, int | float | np.number) and not isinstance(value, bool)
    if not is_number or not least <= value < math.inf:
        raise ValueError(f"{name} must be a finite number{'' if least else ', 0 or more'}, got {value!r}")
    return float(value)


def _whole(value: Any) -> bool:
    return isinstance(value, int | np.integer) and not isinstance(value, bool)


def _pairs(values: Any, name: str, what: str) -> Mapping[Any, Any]:
    if isinstance(values, Mapping) and values:
        return values
    raise ValueError(f"{name} must be {{{what}}}, got {values!r}")


def _model(env: Any, name: str) -> Any:
    if not hasattr(env, "model"):
        raise ValueError(f"{name} is for environments of MuJoCo, and {type(env).__name__} is none")
    return env.model


def _factors(values: Any, parts: Iterable[str], name: str) -> dict[str, float]:
    """The factor of each part of a body that is named."""
    for part in _pairs(values, name, "PART: FACTOR"):
        if part not in parts:
            raise ValueError(f"{name}.{part} is not there; this body has {', '.join(parts) or 'none'}")
    return {part: _number(factor, f"{name}.{part}", 0) for part, factor in values.items()}


def _derive(model: Any) -> None:
    """Compute what MuJoCo derives from masses and motors: inverse weights set how soft contacts and limits are."""
    import mujoco

    mujoco.mj_setConst(model, mujoco.MjData(model))  # it overwrites the state that it is given


def _gravity(env: Any, value: Any, _faults: Faults) -> None:
    """Let things fall with this acceleration [m/s^2]."""
    if hasattr(env, "model"):
        env.model.opt.gravity[2] = -_number(value, "gravity")
    elif hasattr(getattr(env, "world", None), "gravity"):  # of Box2D, which is made with each reset
        env.world.gravity = (0.0, -_number(value, "gravity"))
    else:
        _attribute(env, "gravity", value)


def _friction(env: Any, value: Any, faults: Faults) -> None:
    """Multiply the friction of all surfaces, and of pairs of them that have their own."""
    model, factor = _model(env, "friction"), _number(value, "friction", 0)
    for name in ("geom_friction", "pair_friction"):
        getattr(model, name)[:] = faults.initial_array(model, name) * factor


def _mass(env: Any, values: Any, faults: Faults) -> None:
    """Multiply the mass of bodies, by their names, and their inertia."""
    model = _model(env, "mass")
    bodies = {model.body(k).name: k for k in range(1, model.nbody) if model.body(k).name}
    for body, factor in _factors(values, bodies, "mass").items():
        for name in ("body_mass", "body_inertia"):
            getattr(model, name)[bodies[body]] = faults.initial_array(model, name)[bodies[body]] * factor
    _derive(model)


def _motors(model: Any) -> dict[str, list[int]]:
    """The numbers of the motors of each joint, and of each motor, by their names; a name of both is the joint's."""
    import mujoco

    ways, joints, named = mujoco.mjtTrn, dict[str, list[int]](), dict[str, list[int]]()
    for k in range(model.nu):
        if model.actuator_trntype[k] in (int(ways.mjTRN_JOINT), int(ways.mjTRN_JOINTINPARENT)):
            joints.setdefault(model.joint(int(model.actuator_trnid[k, 0])).name, []).append(k)
        named[model.actuator(k).name] = [k]
    return {name: motors for name, motors in (named | joints).items() if name}


def _joint_strength(env: Any, values: Any, faults: Faults) -> None:
    """Multiply the strength of motors, by the names of their joints or their own; 0: dead."""
    model = _model(env, "joint_strength")
    motors = _motors(model)
    for name, factor in _factors(values, motors, "joint_strength").items():
        for motor in motors[name]:
            _strengthen(model, motor, factor, faults)
    _derive(model)


def _strengthen(model: Any, motor: int, factor: float, faults: Faults) -> None:
    """Multiply the force of one motor, and neither where a servo goes nor what its gear does to inertia."""
    import mujoco

    def multiply(name: str, columns: Any = slice(None)) -> None:
        getattr(model, name)[motor, columns] = faults.initial_array(model, name)[motor, columns] * factor

    gain = mujoco.mjtGain(int(model.actuator_gaintype[motor])).name
    bias = mujoco.mjtBias(int(model.actuator_biastype[motor])).name
    extras = [getattr(model, f"actuator_{name}", None) for name in ("armature", "damping")]  # MuJoCo 3.4 has none
    match gain, bias:
        case "mjGAIN_FIXED", "mjBIAS_NONE" if not any(each is not None and np.any(each[motor]) for each in extras):
            multiply("actuator_gear")
        case "mjGAIN_FIXED" | "mjGAIN_AFFINE", "mjBIAS_NONE" | "mjBIAS_AFFINE":
            for name in ("actuator_gainprm", "actuator_biasprm", "actuator_forcerange"):
                multiply(name)
        case "mjGAIN_MUSCLE", "mjBIAS_MUSCLE":
            for name in ("actuator_gainprm", "actuator_biasprm"):
                force = faults.initial_array(model, name)[motor, 2]
                multiply(name, 2 if force >= 0 else 3)  # a force below 0 is computed from the scale beside it
            multiply("actuator_forcerange")
        case _:
            raise ValueError(
                f"joint_strength: motor {model.actuator(motor).name or motor} has {gain} and {bias}, and known are "
                f"fixed, affine and muscle; give {FUNCTION}: FILE.py:NAME"
            )


def _reading_numbers(values: Any, name: str, faults: Faults) -> list[int]:
    """The numbers of readings that a change gives by number or by name. name: of the change."""
    names, numbers = {reading: number for number, reading in enumerate(faults.readings)}, list[Any]()
    if isinstance(values, list | Mapping):
        numbers = [names.get(value, value) if isinstance(value, str) else value for value in values]
    if not numbers or not all(_whole(number) and 0 <= number < len(names) for number in numbers):
        allowed = f"from 0 to {len(names) - 1}, or names of {', '.join(names)}"
        raise ValueError(f"{name} must have readings, {allowed}, got {values!r}")
    return numbers


def _dead_readings(_env: Any, numbers: Any, faults: Faults) -> None:
    """Let readings, by their numbers or names, be 0."""
    faults.dead = _reading_numbers(numbers, DEAD, faults)


def _noisy_readings(_env: Any, values: Any, faults: Faults) -> None:
    """Add normal noise to readings: {number or name: standard deviation}."""
    deviations = _pairs(values, "noisy_readings", "READING: STANDARD DEVIATION")
    numbers = _reading_numbers(deviations, "noisy_readings", faults)
    faults.noise = {
        number: _number(value, "noisy_readings", 0) for number, value in zip(numbers, deviations.values(), strict=True)
    }


def _action_delay(_env: Any, value: Any, faults: Faults) -> None:
    """Let actions take effect so many steps later."""
    if not _whole(value) or value < 0:
        raise ValueError(f"{DELAY} must be a whole number of steps, 0 or more, got {value!r}")
    faults.delay = int(value)


def _numbers(env: Any) -> list[str]:
    """The names of the numbers of an environment that can be set and that its physics may read."""
    inert = [name for kind in type(env).__mro__ for name in _INERT.get(kind.__name__, ())]

    def can_be_set(name: str) -> bool:
        attribute = getattr(type(env), name, None)
        is_fixed = isinstance(attribute, property) and attribute.fset is None
        return not (name.startswith("_") or name in inert or is_fixed)

    kinds = bool | int | float | np.number | np.bool_
    return [name for name in dir(env) if can_be_set(name) and isinstance(getattr(env, name, None), kinds)]


def _attribute(env: Any, name: str, value: Any) -> None:
    """Set a number that the environment has, and what a cart-pole makes of it."""
    numbers = _numbers(env)
    if name not in numbers:
        choices = ", ".join([*CHANGES, FUNCTION, *numbers])
        raise ValueError(f"{type(env).__name__} has no number {name} that acts; a change is one of {choices}")
    present = getattr(env, name)
    is_switch = isinstance(present, bool | np.bool_)
    if is_switch and value not in (True, False):
        raise ValueError(f"{name} must be true or false, got {value!r}")
    number = value if is_switch else _number(value, name)
    setattr(env, name, int(number) if _whole(present) and float(number).is_integer() else number)
    if hasattr(env, "polemass_length"):
        env.total_mass, env.polemass_length = env.masspole + env.masscart, env.masspole * env.length


CHANGES: dict[str, Callable[[Any, Any, Faults], None]] = {
    "gravity": _gravity,
    "friction": _friction,
    "mass": _mass,
    "joint_strength": _joint_strength,
    DEAD: _dead_readings,
    "noisy_readings": _noisy_readings,
    DELAY: _action_delay,
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
