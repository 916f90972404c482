"""What a reader must know beside the table of an evaluation: a line for each note."""

import csv
import functools
from dataclasses import asdict

from epuckhebb.adaptation.controller import HEBBIAN
from epuckhebb.config import EvaluateConfig, training_world
from epuckhebb.runtime import REFERENCE, data_folder
from epuckhebb.store import Genome, load_genome
from epuckhebb.tmaze.own_fitness import PAPER_FITNESS
from epuckhebb.tmaze.physics.pymunk import PYMUNK
from epuckhebb.tmaze.scenario import EXPERIMENTS, Scenario


def notes_of(genome: Genome, config: EvaluateConfig) -> list[str]:
    """The notes on an evaluation of this genome; `provenance.json`, tables and the replay page have them."""
    here, named = config.scenario.name, config.changed
    rates = [float(one.rule.N) for one in config.controllers if one.name == HEBBIAN]
    notes = [
        showcase(genome, "" if named else here, rates[0] if rates else 0.0),
        _other_experiment(genome, config),
        _other_fitness(genome, config),
        _other_physics(genome, config),
    ]
    return [note for note in notes if note]


def showcase(genome: Genome, scenario: str | None = None, rate: float = 0.0) -> str:
    """That a genome is a bundled showcase, and how many champions show the pattern that it shows; nothing elsewhere.

    The pattern: a champion fails without plasticity on one side at least, and succeeds with it on both. Genes are
    compared, so a copy of the bundled champion under any name is one, too.

    scenario, rate: where, and with which N of the paper's rule; None for a table over many worlds. There is no note
    where the reference results do not count the pattern.
    """
    experiment = _showcases().get(genome.sha256)
    if experiment is None:
        return ""
    with (data_folder("runs/reference") / "success.csv").open(encoding="utf-8", newline="") as file:
        known = [row for row in csv.DictReader(file) if (row["experiment"], row["side"]) == (experiment, "both")]
    n = max(int(row["n"]) for row in known)
    here = {(row["scenario"], row["controller"], float(row["N"])): row["gained"] for row in known}
    cell, where = (scenario, HEBBIAN, rate), f"scenario={scenario} hebbian.N={rate:g} "
    if scenario is None:
        pattern, where = "chosen because it shows the paper's pattern in the paper's worlds", ""
    elif cell in here:
        pattern = f"{here[cell]} of {n} champions fail in {scenario} without plasticity and succeed with N = {rate:g}"
    else:
        return ""
    all_of_them = f"{where}genome={REFERENCE}_1,...,{REFERENCE}_{n}"
    return f"A showcase: {pattern}. To run all {n}: epuckhebb evaluate -m {all_of_them}"


@functools.cache
def _showcases() -> dict[str, str]:
    """The experiment of each bundled showcase, by the SHA-256 of its genes."""
    return {load_genome(REFERENCE, experiment).sha256: experiment for experiment in EXPERIMENTS}


def _other_experiment(genome: Genome, config: EvaluateConfig) -> str:
    """What differs between the world of a champion's training and one of the other experiment."""
    world = config.world
    if not genome.experiment or genome.experiment == world.experiment:
        return ""
    trained = training_world(config, genome.experiment, world.physics)
    before, now = _facts(trained), _facts(world)
    differ = [f"{name} {value} -> {now[name]}" for name, value in before.items() if now[name] != value]
    same = "" if "light" in " ".join(differ) else f"; the light, {now['light']}, is the same"
    return (
        f"This champion was evolved in {trained.name}, of the {trained.experiment} experiment; {config.scenario.name} "
        f"is of the {world.experiment} experiment. They differ in {', '.join(differ)}{same}."
    )


def _other_fitness(genome: Genome, config: EvaluateConfig) -> str:
    """That a champion's evolution maximised another fitness than the tables of this evaluation show."""
    own = config.world.fitness.name
    trained = genome.fitness_function or PAPER_FITNESS.name
    if not genome.optimizer or trained == own:
        return ""
    key = "fitness=paper" if trained == PAPER_FITNESS.name else f"fitness.function=FILE.py:{trained}"
    return f"This champion was evolved for fitness {trained}; the fitness shown here is {own}. For that: {key}."


def _other_physics(genome: Genome, config: EvaluateConfig) -> str:
    """That the physics of this world is not that of a champion's evolution, nor of what it remembers."""
    evolved_in, here = genome.physics or PYMUNK.name, config.world.physics.name
    if not genome.experiment or evolved_in == here:
        return ""
    return (
        f"This champion was evolved with physics={evolved_in}, in which its nominal statistics are measured, too; this "
        f"world has physics={here}. See docs/ode.md."
    )


def _facts(world: Scenario) -> dict[str, str]:
    """What the experiments differ in, as text by its name."""
    lamp = asdict(world.lamp)
    facts = {"light": world.light, "N": world.paper_N, "duration_s": world.paper_duration_s}
    facts |= {f"lamp.{name}": lamp[name] for name in lamp}
    return {name: f"{value:g}" for name, value in facts.items()}
