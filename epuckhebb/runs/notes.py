"""What a reader must know beside the table of an evaluation: a line for each note."""

import csv
from dataclasses import asdict

from epuckhebb.config import EvaluateConfig, training_world
from epuckhebb.runtime import REFERENCE, data_folder
from epuckhebb.store import Genome
from epuckhebb.tmaze.individual import HEBBIAN
from epuckhebb.tmaze.own_fitness import PAPER_FITNESS
from epuckhebb.tmaze.physics.pymunk import PYMUNK
from epuckhebb.tmaze.scenario import Scenario


def notes_of(genome: Genome, config: EvaluateConfig) -> list[str]:
    """The notes on an evaluation of this genome; `provenance.json`, tables and the replay page have them."""
    rates = [float(one.rule.N) for one in config.controllers if one.name == HEBBIAN]
    notes = [showcase(genome, "" if config.changed else config.scenario.name, rates[0] if rates else 0.0)]
    world, fitness = config.world, genome.fitness_function or PAPER_FITNESS.name
    if genome.experiment and genome.experiment != world.experiment:
        trained = training_world(config, genome.experiment, world.physics)
        before, now = _facts(trained), _facts(world)
        differ = [f"{name} {value} -> {now[name]}" for name, value in before.items() if now[name] != value]
        same = "" if "light" in " ".join(differ) else f"; the light, {now['light']}, is the same"
        notes.append(
            f"This champion was evolved in {trained.name}, of the {trained.experiment} experiment; "
            f"{config.scenario.name} is of the {world.experiment} experiment. They differ in {', '.join(differ)}{same}."
        )
    if genome.optimizer and fitness != world.fitness.name:
        key = "fitness=paper" if fitness == PAPER_FITNESS.name else f"fitness.function=FILE.py:{fitness}"
        notes.append(
            f"This champion was evolved for fitness {fitness}; the fitness shown here is {world.fitness.name}. "
            f"For that: {key}."
        )
    physics = genome.physics or PYMUNK.name
    if genome.experiment and physics != world.physics.name:
        notes.append(
            f"This champion was evolved with physics={physics}, in which its nominal statistics are measured, too; "
            f"this world has physics={world.physics.name}. See docs/ode.md."
        )
    return [note for note in notes if note]


def showcase(genome: Genome, scenario: str | None = None, rate: float = 0.0) -> str:
    """That a genome is a bundled showcase, and how many champions show the pattern that it shows; nothing elsewhere.

    The pattern: a champion fails without plasticity on one side at least, and succeeds with it on both.

    scenario, rate: where, and with which N of the paper's rule; None for a table over many worlds. There is no note
    where the reference results do not count the pattern.
    """
    if genome.name != REFERENCE:
        return ""
    with (data_folder("runs/reference") / "success.csv").open(encoding="utf-8", newline="") as file:
        rows = [row for row in csv.DictReader(file) if (row["experiment"], row["side"]) == (genome.experiment, "both")]
    n = max(int(row["n"]) for row in rows)
    gained = {(row["scenario"], row["controller"], float(row["N"])): row["gained"] for row in rows}
    cell, where = (scenario, HEBBIAN, rate), f"scenario={scenario} hebbian.N={rate:g} "
    if scenario is None:
        pattern, where = "chosen because it shows the paper's pattern in the paper's worlds", ""
    elif cell in gained:
        pattern = f"{gained[cell]} of {n} champions fail in {scenario} without plasticity and succeed with N = {rate:g}"
    else:
        return ""
    every_genome = f"genome={REFERENCE}_1,...,{REFERENCE}_{n}"
    return f"A showcase: {pattern}. To run all {n}: epuckhebb evaluate -m {where}{every_genome}"


def _facts(world: Scenario) -> dict[str, str]:
    """What the experiments differ in, as text by its name."""
    facts = {"light": world.light, "N": world.paper_N, "duration_s": world.paper_duration_s}
    facts |= {f"lamp.{name}": value for name, value in asdict(world.lamp).items()}
    return {name: f"{value:g}" for name, value in facts.items()}
