"""Earlier runs: what their stored configuration would be today, so that they can be watched and repeated."""

from typing import Any

from omegaconf import OmegaConf

from epuckhebb.app.data import data_folder

_GATE = {  # key of `hebbian` then -> key of `adaptation` now
    "surprise": "change_signal",
    "tolerance": "threshold",
    "spell_s": "active_s",
    "rest_s": "rest_s",
    "motor_noise": "motor_noise",
}


def of_today(told: dict[str, Any]) -> dict[str, Any]:
    """The plain values of a stored configuration, in the keys of today; they are changed in their place."""
    if "scenario" not in told:
        return told
    for world in (told["scenario"], *told["scenario"].get("changes", [])):
        if "dead_sensor" in world:
            dead = world.pop("dead_sensor")
            world["dead_sensors"] = [] if dead is None else [dead]
    if "maze" not in told:
        _since_parts(told)
    return told


def _since_parts(told: dict[str, Any]) -> None:
    """What version 0.1 had not yet, or had in other places."""
    for group, choice in (("maze", "t_maze"), ("robot", "epuck")):
        told[group] = OmegaConf.to_container(OmegaConf.load(data_folder("conf") / group / f"{choice}.yaml"))
    told["network"], told["changed"] = {"layers": None}, ""
    if "hebbian" in told:
        told["adaptation"] = _adaptation(told["hebbian"])
        told["hebbian"] = _rule(told["hebbian"])
    else:
        told["hebbian"] = {"rule": "none"}
    for name, settings in told.get("compare", {}).items():
        over = _adaptation({"name": name, **settings})
        told["compare"][name] = {"N": 0.0, **_rule(settings), **({"adaptation": over} if over else {})}


def _rule(settings: dict[str, Any]) -> dict[str, Any]:
    """The settings of the paper's rule among those that `hebbian` had."""
    if settings.get("name") == "none":
        return {"rule": "none", "name": "none"}
    kept = {key: value for key, value in settings.items() if key not in (*_GATE, "ramp")}
    return {"rule": "paper", **kept}


def _adaptation(settings: dict[str, Any]) -> dict[str, Any]:
    """What was laid over the rule; nothing without a signal of change."""
    if settings.get("surprise", "none") == "none":
        return {}
    over = {now: settings[then] for then, now in _GATE.items() if then in settings}
    ramp = float(settings.get("ramp", 0.0))
    return {"name": settings["name"], **over, "slope": 1.0 / ramp if ramp else float("inf")}
