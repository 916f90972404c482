"""Whether a champion's file has what an adaptation compares with, and its measurement where it is missing."""

from collections.abc import Callable
from typing import NamedTuple, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from epuckhebb.adaptation.nominal import (
    REPEATS,
    Nominal,
    Recorded,
    measure_nominal,
    nominal_of,
    run_in_training_world,
)
from epuckhebb.adaptation.self_check.memory import SelfMemory, can_check_itself, measure_self
from epuckhebb.analysis.self_checks import Checks, self_checks
from epuckhebb.config import EvaluateConfig, check_library, part_from, usual_physics
from epuckhebb.config import training_world as world_of_training
from epuckhebb.controller.network import Network
from epuckhebb.runtime import ConfigError
from epuckhebb.store import Genome
from epuckhebb.tmaze.physics.pymunk import PYMUNK
from epuckhebb.tmaze.scenario import TRAINED, Scenario
from epuckhebb.tmaze.session import LostRobotError

_Memory = TypeVar("_Memory", Nominal, SelfMemory)
_made: dict[tuple[object, ...], Nominal | SelfMemory] = {}
_MOST_MADE = 256  # a self-check's memory takes 0.2 MB


class Remembered(NamedTuple):
    """What the adaptations of an evaluation compare with; None where no adaptation needs it."""

    nominal: Nominal | None  # statistics at its wheel gain
    checks: Checks | None  # self-checks of its lifetimes


def remembered_for(genome: Genome, config: EvaluateConfig, threads: int, report: Callable[[str], None]) -> Remembered:
    """What the adaptations of an evaluation compare with.

    It is in the champion's file, or is measured in the training world again; then `report` is given a sentence.
    """
    adaptations = [controller.adaptation for controller in config.controllers]
    genes, network, gain = genome.network_genes, genome.network, config.lifetime.gain_rad_s
    nominal, checks = None, None
    if any(one.needs_nominal for one in adaptations):
        missing, known = missing_nominal(config, genome.nominal), genome.nominal
        nominal = _remembered(
            genome, config, known, missing, report, lambda one: measure_nominal(genes, one, gain, threads, network)
        )
        is_new = known is None or known.gain_rad_s != gain
        if is_new and "late" in {one.change_signal for one in adaptations} and np.isnan(nominal.time_to_goal_s).all():
            raise ConfigError(
                f"adaptation.change_signal=late needs a time to the goal to remember, and genome={genome.name} reached "
                f"neither goal in {nominal.scenario}; give a champion that does, or change_signal=novelty or shortfall"
            )
        if any(one.recognise for one in adaptations) and not nominal.has_facts:
            raise ConfigError(
                f"adaptation.recognise=true needs echoes of walls to remember, and genome={genome.name} came near "
                f"none in {nominal.scenario}; give another maze, or adaptation.recognise=false"
            )
    if any(one.self_check for one in adaptations):
        missing = "has no memory for a self-check" if genome.self_memory is None else ""
        try:
            memory = _remembered(
                genome,
                config,
                genome.self_memory,
                missing,
                report,
                lambda one: _self_memory(run_in_training_world(genes, one, 1.0, threads, network), one),
            )
            kinds = {one.careful for one in adaptations if one.self_check}
            world, noise, repeats = config.world, config.lifetime.noise, config.repeats
            checks = self_checks(memory, world, noise, repeats=repeats, seed=config.seed, careful=kinds)
        except (ValueError, LostRobotError) as error:
            raise error if isinstance(error, ConfigError) else ConfigError(str(error)) from error
    return Remembered(nominal, checks)


def missing_nominal(config: EvaluateConfig, nominal: Nominal | None) -> str:
    """Why nominal statistics must be measured again before adaptations can use them; nothing if they need not be."""
    adaptations = [controller.adaptation for controller in config.controllers]
    gain = config.lifetime.gain_rad_s
    at_another = nominal is not None and nominal.gain_rad_s != gain and any(one.is_gated for one in adaptations)
    if any(one.needs_nominal for one in adaptations) and (nominal is None or at_another):
        return f"has no nominal statistics at {gain:g} rad/s"
    if any(one.recognise for one in adaptations) and nominal is not None and nominal.sun is None:
        return "has no nominal statistics of sun, lamp and walls"
    return ""


def _remembered(
    genome: Genome,
    config: EvaluateConfig,
    known: _Memory | None,
    missing: str,
    report: Callable[[str], None],
    make: Callable[[Scenario], _Memory],
) -> _Memory:
    """What a champion's file holds or, if something is missing, what is measured in its training world.

    It is measured once a process: many jobs of a sweep need the same.
    """
    experiment = config.world.experiment
    if known is not None and known.experiment != experiment:
        raise ConfigError(
            f"genome={genome.name} remembers {known.scenario}, a world of the {known.experiment} experiment; it "
            f"cannot tell what is new in a scenario of the {experiment} experiment. Give a champion of that "
            "experiment, or adaptation=none"
        )
    if known is not None and not missing:
        return known
    report(f"genome={genome.name} {missing}: it runs {REPEATS} lifetimes a side in {TRAINED[experiment]} first.")
    world = training_world(config, genome.physics)
    check_library(world)
    key = (missing, genome.sha256, genome.network, repr(world))
    if key not in _made:
        if len(_made) >= _MOST_MADE:
            _made.clear()
        _made[key] = make(world)
    return cast(_Memory, _made[key])


def training_world(config: EvaluateConfig, evolved_in: str = "") -> Scenario:
    """The world in which controllers of this experiment are evolved, in the maze of the evaluation, for its robot.

    evolved_in: the name of their physics, which may be another than that of the evaluation; "" for that of the plane.
    """
    physics = part_from("physics", config.physics, "physics")
    if physics.name != (evolved_in or PYMUNK.name):
        physics = usual_physics(evolved_in or PYMUNK.name)
    return world_of_training(config.world.experiment, config.scenario.name, config.maze, config.robot, physics)


def remember_training_world(
    genes: NDArray[np.float64], world: Scenario, threads: int, network: Network
) -> tuple[Nominal, SelfMemory | None]:
    """What a champion remembers of its training world; nothing for a self-check that its robot cannot do there."""
    sides = run_in_training_world(genes, world, threads=threads, network=network)
    return nominal_of(sides, world, 1.0), _self_memory(sides, world) if can_check_itself(world) else None


def _self_memory(sides: list[Recorded], world: Scenario) -> SelfMemory:
    return measure_self(world, [samples.sensors for side in sides for _, samples in side])
