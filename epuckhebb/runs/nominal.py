"""The nominal statistics that the adaptations of an evaluation compare with: from the champion's file, or measured."""

from collections.abc import Callable

import numpy as np

from epuckhebb.adaptation.nominal import REPEATS, Nominal, measure_nominal
from epuckhebb.config import EvaluateConfig, check_library, part_from, usual_physics
from epuckhebb.config import training_world as world_of_training
from epuckhebb.runtime import ConfigError
from epuckhebb.store import Genome
from epuckhebb.tmaze.physics.pymunk import PYMUNK
from epuckhebb.tmaze.scenario import TRAINED, Scenario

_measured: dict[tuple[object, ...], Nominal] = {}  # in this process: many jobs of a sweep need the same


def nominal_for(genome: Genome, config: EvaluateConfig, threads: int, report: Callable[[str], None]) -> Nominal | None:
    """Nominal statistics for the adaptations of an evaluation; None where no adaptation needs them.

    If they must be measured in the training world first, `report` is given a sentence.
    """
    adaptations = [controller.adaptation for controller in config.controllers]
    if not any(one.needs_nominal for one in adaptations):
        return None
    experiment, known = config.world.experiment, genome.nominal
    if known is not None and known.experiment != experiment:
        raise ConfigError(
            f"genome={genome.name} remembers {known.scenario}, a world of the {known.experiment} experiment; it "
            f"cannot tell what is new in a scenario of the {experiment} experiment. Give a champion of that "
            "experiment, or adaptation=none"
        )
    gain = config.lifetime.gain_rad_s
    if known is not None and (known.gain_rad_s == gain or not any(one.is_gated for one in adaptations)):
        return known
    report(
        f"genome={genome.name} has no nominal statistics at {gain:g} rad/s: it runs {REPEATS} lifetimes a side in "
        f"{TRAINED[experiment]} first."
    )
    world = training_world(config, genome.physics)
    check_library(world)
    key = (gain, genome.sha256, genome.network, repr(world))
    if key not in _measured:
        _measured[key] = measure_nominal(genome.network_genes, world, gain, threads, genome.network)
    nominal = _measured[key]
    if "late" in {one.change_signal for one in adaptations} and np.isnan(nominal.time_to_goal_s).all():
        raise ConfigError(
            f"adaptation.change_signal=late needs a time to the goal to remember, and genome={genome.name} reached "
            f"neither goal in {nominal.scenario}; give a champion that does, or change_signal=novelty or shortfall"
        )
    return nominal


def training_world(config: EvaluateConfig, evolved_in: str = "") -> Scenario:
    """The world in which controllers of this experiment are evolved, in the maze of the evaluation, for its robot.

    evolved_in: the name of their physics, which may be another than that of the evaluation; "" for that of the plane.
    """
    physics = part_from("physics", config.physics, "physics")
    if physics.name != (evolved_in or PYMUNK.name):
        physics = usual_physics(evolved_in or PYMUNK.name)
    return world_of_training(config, config.world.experiment, physics)
