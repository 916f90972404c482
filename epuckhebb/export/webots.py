"""`epuckhebb export RUN --webots`: a champion as a controller for Webots' e-puck."""

import io
import json
import math
from dataclasses import asdict
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np

from epuckhebb.config import EvaluateConfig, load
from epuckhebb.controller.plasticity.control import Sign
from epuckhebb.controller.plasticity.rule import EVERY_STEP, InitialWeights, schedule_of
from epuckhebb.controller.plasticity.rules.paper import Paper
from epuckhebb.controller.wiring import LAYERS
from epuckhebb.runs import config_of
from epuckhebb.runtime import ConfigError
from epuckhebb.store import Genome, Run, load_genome, resolve_run, write_atomic
from epuckhebb.tmaze.fitness import initial_history
from epuckhebb.tmaze.individual import Controller
from epuckhebb.tmaze.robot import EPUCK
from epuckhebb.tmaze.scenario import TRAINED

_LIGHT_FULL_SCALE = 4095.0  # of Webots' e-puck in the dark, where our readings are 1
_GPS_AXES = [[0, 1.0], [2, -1.0]]  # X and Y of a maze among the axes of a Webots world whose y points up
_CHAMPION = "champion.json"  # what the controller has to know
_CONTROLLER = Path(__file__).with_name("webots_controller.py")


def webots(what: str, folder: Path) -> tuple[list[Path], str]:
    """Write a controller that plays what a user names: a run of `evaluate`, with its plasticity, or a champion without.

    what: a run folder, `latest`, the file of a champion, or `reference`. folder: that of the controller, which is
    called as it is. Returns the files that were written, the controller first; and what to do with it.
    """
    genome, config = _genome_and_config(what)
    if genome.wiring != LAYERS:
        raise ConfigError(f"{what} has network.wiring={genome.wiring}; only {LAYERS} can be taken to Webots")
    if (genome.robot, genome.network.inputs) != (EPUCK.name, EPUCK.inputs):
        own = f" with the sensors {genome.sensors}" if genome.sensors else ""
        raise ConfigError(f"{what} is for robot {genome.robot}{own}; only {EPUCK.name} as it is can be taken to Webots")
    if folder.exists() and any(folder.iterdir()):
        raise ConfigError(f"{folder} holds files already; give another folder with --output")
    genes = io.BytesIO()
    np.save(genes, genome.weights.astype("<f8"))
    written = {
        folder / f"{folder.resolve().name}.py": _CONTROLLER.read_bytes(),  # Webots wants it to be called as its folder
        folder / _CHAMPION: (json.dumps(_content(genome, config), indent=1, allow_nan=False) + "\n").encode(),
        folder / "genes.npy": genes.getvalue(),
    }
    for file, content in written.items():
        write_atomic(file, content)
    return list(written), (
        f"Next: put this folder below controllers/ of a Webots project, and choose {folder.resolve().name} in "
        "the field `controller` of its e-puck. With a GPS in a world whose z axis points up, set gps_axes in "
        "champion.json to [[0, 1.0], [1, 1.0]]; see docs/webots.md."
    )


def _genome_and_config(what: str) -> tuple[Genome, EvaluateConfig]:
    """The genome and the settings of a run; of a champion those of its experiment, without plasticity."""
    path = resolve_run(what)
    run = Run(path)
    if path.is_dir() and run.provenance["command"] == "evaluate":
        config = config_of(run, "evaluate")
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
    as_in_paper = rule.sign is Sign.hebbian and rule.initial_weights is InitialWeights.evolved and not rule.N_gain_rad_s
    as_in_paper = as_in_paper and schedule_of(rule) == EVERY_STEP and not rule.carries_history
    if not isinstance(rule, Paper) or not as_in_paper or controller.adaptation.acts:
        raise ConfigError(
            f"controller {controller.name} cannot be taken to Webots: only the paper's rule can, without an "
            "adaptation, with its own signs, evolved initial weights, an N that holds at any gain, "
            "hebbian.normalise=none, hebbian.average=1, hebbian.every=1 and hebbian.carries_history=false; or none "
            "(hebbian=none)"
        )
    settings = {key: value.name if isinstance(value, Enum) else value for key, value in asdict(rule).items()}
    return {**settings, "history_steps": initial_history(rule).steps}
