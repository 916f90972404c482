"""Prints what a genome is made of and what it remembers of its training world."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console

from epuckhebb.cli.console import print_line, print_table
from epuckhebb.sim.adaptation.nominal import Nominal
from epuckhebb.sim.adaptation.self_check.findings import find
from epuckhebb.sim.adaptation.self_check.memory import SelfMemory
from epuckhebb.sim.physics.pymunk import PYMUNK
from epuckhebb.sim.scenario import EXPERIMENTS
from epuckhebb.store import Genome, is_bundled, load_genome


def genomes_named(what: str) -> list[tuple[Genome, str]]:
    """The genomes of a champion's file, or of a bundled champion in either experiment; none if it is something else."""
    if is_bundled(what):
        return [(load_genome(what, experiment), experiment) for experiment in EXPERIMENTS]
    path = Path(what)
    if path.suffix not in (".npz", ".npy") or path.is_dir():
        return []
    genome = load_genome(what, "")
    return [(genome, genome.experiment or "unknown")]


def genome_as_json(genome: Genome, experiment: str) -> dict[str, Any]:
    """A genome as JSON values."""
    parts = {part.name: part.size for part in genome.plan.parts}
    known = {"layers": list(genome.network.layers), "parts": parts, "robot": genome.robot}
    physics = genome.physics or PYMUNK.name
    evolved = {"optimizer": genome.optimizer, "training": genome.training, "physics": physics}
    return {"genome": genome.name, "sha256": genome.sha256, "experiment": experiment, **known, **evolved}


def print_champion(genome: Genome, console: Console) -> None:
    """What a champion is made of, what it remembers of its training world, and how well it can check itself."""
    print_line(console, f"Genome: {genome.plan.text()}; network {genome.network}; robot {genome.robot}")
    if genome.optimizer:
        rule = f", with rule {genome.rule}" if genome.rule else ""
        task = f", for task {genome.task}" if genome.task else ""
        fitness = f", for fitness {genome.fitness_function}" if genome.fitness_function else ""
        physics = f", in physics {genome.physics or PYMUNK.name}"
        line = f"Evolved by {genome.optimizer}, in training worlds {genome.training}{physics}{rule}{task}{fitness}"
        print_line(console, line)
    if genome.nominal is not None:
        _print_nominal(genome.nominal, genome, console)
    if genome.self_memory is not None:
        _print_self_memory(genome.self_memory, console)


def _print_self_memory(memory: SelfMemory, console: Console) -> None:
    """How well a robot that remembers this can check itself."""
    expected = find(memory.mean[0], memory)
    rows = [
        (f"{wheel} wheel", f"± {100 * error:.1f} % of its speed")
        for wheel, error in zip(("Left", "Right"), expected.wheel_loss_error, strict=True)
    ]
    rows.append(("Light", f"± {100 * expected.light_ratio_error:.1f} % of {memory.scenario}'s"))
    title = f"Self-check: a calibration of {len(memory.spread)} steps, remembered of {memory.scenario}; standard errors"
    print_table(console, title, ("", "is known to"), rows)


def _print_nominal(nominal: Nominal, genome: Genome, console: Console) -> None:
    """What a champion remembers of its training world."""
    rows: list[tuple[str, ...]] = []
    for name, numbers in {
        "At the goal in the end": nominal.success,
        "Slowest arrival (s)": nominal.time_to_goal_s,
        "Longest away afterwards (s)": nominal.away_s,
    }.items():
        rows.append((name, *("never" if np.isnan(number) else f"{number:g}" for number in numbers.round(2))))
    rows.append((f"Least live fitness, over {nominal.fitness.shape[1]} s", *map(_course, nominal.fitness)))
    own = genome.sensors.split(", ") if genome.sensors else []
    end = genome.network.inputs - len(own)
    names = [f"Light reading {place}" for place in range(genome.lights)]
    names += [f"Distance reading {place}" for place in range(end - genome.lights)]
    for name, means, spreads in zip([*names, *own], nominal.reading_mean.T, nominal.reading_spread.T, strict=True):
        cells = (f"{mean:.2f} ± {spread:.2f}" for mean, spread in zip(means, spreads, strict=True))
        rows.append((name, *cells))
    if nominal.sun is not None and nominal.echo is not None:
        bearing, level, lamp_side = nominal.sun
        rows.append(("Sun: from the start's heading, level", f"{np.degrees(bearing):.1f}°, {level:.2f}", ""))
        rows.append(("Goal when the lamp is lit", "" if lamp_side < 0 else "here", "here" if lamp_side < 0 else ""))
        nearest, farthest = 1000 * nominal.echo[1, [0, -1]]
        rows.append(("Echo curve", f"{nominal.echo.shape[1]} points", f"{nearest:.0f} to {farthest:.0f} mm"))
    title = f"Nominal: {nominal.scenario} at {nominal.gain_rad_s:g} rad/s"
    print_table(console, title, ("", "left (lamp off)", "right (lamp on)"), rows)


def _course(fitness: NDArray[np.float64]) -> str:
    """The course of fitness as twelve bars from 0 to 1, and the means of its first and last twelfth."""
    parts = [part.mean() for part in np.array_split(fitness, min(12, len(fitness)))]
    return "".join("▁▂▃▄▅▆▇█"[min(7, int(8 * max(0.0, part)))] for part in parts) + f" {parts[0]:.2f} → {parts[-1]:.2f}"
