"""`epuckhebb export RUN --webots`: a champion as a controller for Webots' e-puck."""

import io
import json
import math
from dataclasses import MISSING, asdict, fields
from enum import Enum
from pathlib import Path
from string import Template
from typing import Any

import numpy as np

from epuckhebb.config import EvaluateConfig, load
from epuckhebb.controller.plasticity.control import Control, Sign
from epuckhebb.controller.plasticity.rule import EVERY_STEP, InitialWeights, make_schedule
from epuckhebb.controller.plasticity.rules.paper import Paper
from epuckhebb.controller.wiring import LAYERS
from epuckhebb.runs import run_settings
from epuckhebb.runtime import ConfigError
from epuckhebb.store import Genome, Run, load_genome, resolve_run, write_atomic
from epuckhebb.tmaze.fitness import initial_history
from epuckhebb.tmaze.individual import Controller
from epuckhebb.tmaze.light import lights
from epuckhebb.tmaze.robot import EPUCK
from epuckhebb.tmaze.scenario import TRAINED, Scenario

_LIGHT_FULL_SCALE = 4095.0  # of Webots' e-puck in the dark, where our readings are 1
_GPS_AXES = [[0, 1.0], [1, 1.0]]  # X and Y of a maze among the axes of the world, whose z points up
_WALL_HEIGHT_M = 0.05  # as in the published world
_SUN_UP = 0.776  # upward part of the unit vector towards the sun, as in the published world
_CHAMPION = "champion.json"  # what the controller has to know
# Settings of a scenario that the world has.
_IN_WORLD = {"light", "lamp", "sun_turn_deg", "obstacles", "layout", "placed", "maze", "goals"}
_OF_OURS = {"name", "experiment", "paper_N", "paper_duration_s", "physics"}  # those that are none of the world
_CONTROLLER, _WORLD = (Path(__file__).with_name(f"webots_{name}") for name in ("controller.py", "world.wbt"))
_WALL = """Solid {{
  translation {x:.6f} {y:.6f} {middle:.6f}
  name "wall {number}"
  children [ Shape {{ appearance PBRAppearance {{ baseColor 1 0 0 roughness 0.5 metalness 0 }} geometry {box} }} ]
  boundingObject {box}
}}"""


def webots(what: str, folder: Path) -> tuple[list[Path], str]:
    """Write a Webots controller: of a run of `evaluate` with its plasticity, or of a champion without plasticity.

    what: a run folder, `latest`, the file of a champion, or `reference`. folder: of the controller, which gets the name
    of the folder. Returns the files that were written, the controller first; and what to do with it.
    """
    genome, config = _genome_and_config(what)
    if genome.wiring != LAYERS:
        raise ConfigError(f"{what} has network.wiring={genome.wiring}; only {LAYERS} can be taken to Webots")
    if genome.robot not in ("", EPUCK.name) or genome.network.inputs != EPUCK.inputs:
        sensors = f" with the sensors {genome.sensors}" if genome.sensors else ""
        raise ConfigError(
            f"{what} is for robot {genome.robot or 'any'}{sensors}; only {EPUCK.name} as it is can be taken to Webots"
        )
    if folder.exists() and any(folder.iterdir()):
        raise ConfigError(f"{folder} holds files already; give another folder with --output")
    genes, name = io.BytesIO(), folder.resolve().name
    np.save(genes, genome.weights.astype("<f8"))
    written = {
        folder / f"{name}.py": _CONTROLLER.read_bytes(),  # Webots wants it to be called as its folder
        folder / _CHAMPION: (json.dumps(_content(genome, config), indent=1, allow_nan=False) + "\n").encode(),
        folder / "genes.npy": genes.getvalue(),
        folder / f"{name}.wbt": _world(config.world, name).encode(),
    }
    for file, content in written.items():
        write_atomic(file, content)
    missing = left_out(config.world)
    note = f"Left out, which the files do not have: {', '.join(missing)}.\n" if missing else ""
    return list(written), note + (
        f"Next: put this folder below controllers/ of a Webots project, move {name}.wbt into its worlds/, and open it; "
        "see docs/webots.md."
    )


def left_out(world: Scenario) -> list[str]:
    """What differs from the paper's robot and task, and is not in what is written for Webots, as `scenario.KEY`."""
    defaults = {field.name: field.default if field.default is not MISSING else None for field in fields(world)}
    differs = [name for name, value in defaults.items() if getattr(world, name) not in (value, ())]
    return [f"scenario.{name}" for name in differs if name not in _IN_WORLD | _OF_OURS]


def _world(world: Scenario, controller: str) -> str:
    """The world of a right trial, as it is at the start."""
    lit = lights(world.light, world.lamp, True, world.sun_turn_deg)
    height, start = world.maze.wall_height_m or _WALL_HEIGHT_M, world.maze.start
    walls = [
        _WALL.format(
            x=(left + right) / 2,
            y=(bottom + top) / 2,
            middle=height / 2,
            number=number,
            box=f"Box {{ size {right - left:.6f} {top - bottom:.6f} {height:g} }}",
        )
        for number, (left, right, bottom, top) in enumerate(world.boxes)
    ]
    return Template(_WORLD.read_text(encoding="utf-8")).substitute(
        title=world.name,
        sun=f"{lit.sun:g}",
        sun_towards=f"{-lit.sun_x:.4f} {-lit.sun_y:.4f} {-_SUN_UP}",
        lamp=f"{lit.lamp_x:g} {lit.lamp_y:g}",
        lamp_towards=f"{lit.lamp_towards_x:g} {lit.lamp_towards_y:g}",
        lamp_intensity=f"{lit.lamp_intensity:g}",
        beam=f"{min(world.lamp.beam_rad, math.pi / 2):g}",
        walls="\n".join(walls),
        start=f"{start.x:g} {start.y:g}",
        heading=f"{start.heading:.6f}",
        controller=controller,
    )


def _genome_and_config(what: str) -> tuple[Genome, EvaluateConfig]:
    """The genome and the settings of a run; of a champion those of its experiment, without plasticity."""
    path = resolve_run(what)
    run = Run(path)
    if path.is_dir() and run.provenance["command"] == "evaluate":
        config = run_settings(run, "evaluate")
        if not isinstance(config, EvaluateConfig):
            raise ConfigError(f"{path} is of an environment; controllers for Webots are those of the maze")
        genome = load_genome(config.genome, config.world.experiment, config.shape)
        if genome.sha256 != run.provenance["genome_sha256"]:
            raise ConfigError(f"genome={config.genome} is not the genome of {path}; its SHA-256 differs")
        return genome, config
    genome = load_genome(str(path), "obstacles")
    scenario = TRAINED[genome.experiment or "obstacles"]
    return genome, load(EvaluateConfig, [f"scenario={scenario}", "hebbian=none"])


def _content(genome: Genome, config: EvaluateConfig) -> dict[str, Any]:
    """All that the controller has to know, as JSON values."""
    world = config.world
    arms = {
        side: {name: bound if math.isfinite(bound) else None for name, bound in arm._asdict().items()}
        for side, arm in world.maze.arms.items()
    }
    return {
        "genome": genome.name,
        "sha256": genome.sha256,
        "layers": list(genome.network.layers),
        "lights": EPUCK.light.count,
        "weights": genome.weights.tolist(),
        "gain_rad_s": config.lifetime.gain_rad_s,
        "light_full_scale": _LIGHT_FULL_SCALE,
        "distance_full_scale": EPUCK.distance.full_scale,
        "gps_axes": _GPS_AXES,
        "arms": arms,
        "goals": {side: list(goal) for side, goal in world.goals_now.items()},
        "rule": _rule(config.controllers[0]) if config.controllers else None,
    }


def _rule(controller: Controller) -> dict[str, Any]:
    """The settings of the rule, which must be the paper's without an adaptation."""
    rule = controller.rule
    evolved = rule.initial_weights is InitialWeights.evolved and not rule.N_gain_rad_s and not rule.carries_history
    plain = rule.sign is Sign.hebbian and rule.control is Control.none and make_schedule(rule) == EVERY_STEP
    if not (isinstance(rule, Paper) and evolved and plain) or controller.adaptation.acts:
        needs = "hebbian.normalise=none, hebbian.average=1, hebbian.every=1, hebbian.carries_history=false"
        needs += ", hebbian.control=none"
        raise ConfigError(f"controller {controller.name}: Webots has hebbian=none, or the paper's rule with {needs}")
    settings = {key: value.name if isinstance(value, Enum) else value for key, value in asdict(rule).items()}
    return {**settings, "history_steps": initial_history(rule).steps}
