"""What a reader must know beside the table of an evaluation, a line for each note, and beside its paths."""

import csv
from collections.abc import Sequence

from epuckhebb.analysis import tables
from epuckhebb.config import EvaluateConfig, WorldConfig
from epuckhebb.controller.ranges import unusual
from epuckhebb.runtime import REFERENCE, data_folder
from epuckhebb.store import Genome
from epuckhebb.tmaze.individual import HEBBIAN
from epuckhebb.tmaze.own_fitness import PAPER_FITNESS
from epuckhebb.tmaze.physics.pymunk import PYMUNK


def evaluation_notes(genome: Genome, config: EvaluateConfig) -> list[str]:
    """The notes on an evaluation of this genome; `provenance.json`, tables and the replay page have them."""
    rates = [float(one.rule.N) for one in config.controllers if one.name == HEBBIAN]
    notes = [_showcase(genome, "" if config.changed else config.scenario.name, rates[0] if rates else 0.0)]
    world = config.world
    if genome.experiment:
        here = {"experiment": world.experiment, "fitness": world.fitness.name, "physics": world.physics.name}
        trained = {
            "experiment": genome.experiment,
            "fitness": genome.fitness_function or PAPER_FITNESS.name,
            "physics": genome.physics or PYMUNK.name,
        }
        differ = [f"{name} {trained[name]} (here {value})" for name, value in here.items() if value != trained[name]]
        if differ:
            notes.append(f"This champion was evolved for another world: {', '.join(differ)}.")
    return [*(note for note in notes if note), *unusual_values(config)]


def unusual_values(config: WorldConfig) -> list[str]:
    """Notes on values that are far from those with which anything here was evolved."""
    parts = {"scenario": config.world, "scenario.lamp": config.world.lamp, "lifetime": config.lifetime}
    return [note for key, part in {**parts, "hebbian": config.rule}.items() for note in unusual(part, key)]


def _showcase(genome: Genome, scenario: str, rate: float) -> str:
    """That a genome is a bundled showcase, and how many champions show the pattern that it shows; nothing elsewhere.

    The pattern: a champion fails without plasticity on one side at least, and succeeds with it on both. scenario, rate:
    where, and with which N of the paper's rule. There is no note where the reference results do not count the pattern.
    """
    if genome.name != REFERENCE:
        return ""
    with (data_folder("runs/reference") / "success.csv").open(encoding="utf-8", newline="") as file:
        rows = [row for row in csv.DictReader(file) if (row["experiment"], row["side"]) == (genome.experiment, "both")]
    n = max(int(row["n"]) for row in rows)
    for row in rows:
        if (row["scenario"], row["controller"], float(row["N"])) == (scenario, HEBBIAN, rate):
            return (
                f"A showcase: {row['gained']} of {n} champions fail in {scenario} on one side or both, and succeed on "
                f"both with N = {rate:g}. To run all {n}: epuckhebb evaluate -m scenario={scenario} hebbian.N={rate:g} "
                f"genome={REFERENCE}_1,...,{REFERENCE}_{n}"
            )
    return ""


def caption(config: EvaluateConfig, genome_name: str, controllers: Sequence[tuple[str, float]] | None = None) -> str:
    """Which lifetimes the traces of a run show, in one line; controllers: names and N, if not the configured."""
    if controllers is None:
        controllers = [(controller.name, float(controller.rule.N)) for controller in config.controllers]
    rate = tables.rates(controllers)
    changed = f" ({config.changed})" if config.changed else ""
    return (
        f"{config.world.name}{changed} · genome {genome_name} · {f'{rate} · ' if rate else ''}"
        f"repeat 1 of {config.repeats}, seed {config.seed}"
    )
