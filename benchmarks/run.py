"""All benchmarks: tables on the terminal, and `benchmarks/results.md` with date, machine, versions and load.

`python run.py [COMMIT PYTHON FOLDER]`: with the `benchmarks` folder of an earlier version, and a Python that has it
installed, both are measured in turn, round by round, and their figures stand side by side.
"""

import json
import os
import platform
import re
import subprocess
import sys
from collections.abc import Iterable
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from statistics import median
from typing import NamedTuple

from rich.console import Console
from rich.table import Table

HERE = Path(__file__).parent
RESULTS = HERE / "results.md"


class Section(NamedTuple):
    """A file of this folder, how often each of its measurements is done in a round, and how many rounds there are.

    in_turn: whether an earlier version is measured, too.
    """

    title: str
    module: str
    repeats: int
    rounds: int
    in_turn: bool = True


SECTIONS = (
    Section("A control step against the plain loop (CPU time)", "step", 3, 7),
    Section("Its parts, each in a loop of its own (CPU time)", "parts", 3, 7),
    Section("Scale (CPU time a robot-step; gain in wall time)", "scale", 3, 3),
    Section("The Python of a lifetime of one step (CPU time)", "lifetime", 1, 3),
    Section("A live world", "play", 3, 3, in_turn=False),
    Section("Whole commands (wall time; CPU time beside it)", "commands", 1, 3),
    Section("Warm commands (wall time; CPU time beside it)", "warm", 1, 7),
    Section("Studies (wall time; CPU time beside it)", "studies", 1, 1),
    Section("The whole study (wall time; CPU time beside it)", "whole_study", 1, 1, in_turn=False),
)


class Version(NamedTuple):
    """What is measured: its name in tables, the Python that has it, and its folder of benchmarks."""

    name: str
    python: str
    folder: Path


def main() -> None:
    """Measure everything and tell."""
    console = Console()
    packages = ", ".join(f"{name} {version(name)}" for name in ("pymunk", "numba", "numpy"))
    versions = [Version("now", sys.executable, HERE)]
    if len(sys.argv) > 1:
        commit, python, folder = sys.argv[1:]
        versions.insert(0, Version(f"before ({commit})", python, Path(folder)))
    in_turn = "; the version before and this one in turn" if len(versions) > 1 else ""
    lines = [
        "# Benchmarks\n",
        f"{datetime.now(UTC):%Y-%m-%d}, {_processor()}, {os.cpu_count()} cores, Python {platform.python_version()}, "
        f"{packages}; load average at the start {os.getloadavg()[0]:.2f}. Medians{in_turn}; `nox -s bench` measures "
        "anew.\n",
    ]
    for section in SECTIONS:
        measured = versions if section.in_turn else versions[-1:]
        names = [version.name for version in measured] + ["now / before"] * (len(measured) - 1)
        table = Table("", *names, title=section.title, title_justify="left")
        lines.append(f"## {section.title}\n")
        lines.append(f"| {' | '.join(['', *names])} |")
        lines.append(f"| --- |{' ---: |' * len(names)}")
        for row in _measured(section, measured):
            table.add_row(*row)
            lines.append(f"| {' | '.join(row)} |")
        lines.append("")
        console.print(table)
        RESULTS.write_text("\n".join(lines), encoding="utf-8")  # section by section: the last ones take long
    console.print(f"Written to {RESULTS.relative_to(Path.cwd()) if RESULTS.is_relative_to(Path.cwd()) else RESULTS}")


def _measured(section: Section, versions: list[Version]) -> list[list[str]]:
    """The rows of a section: name, each version's median over the rounds, and of two versions the median ratio.

    The ratio is that of a round, in which one version follows the other: what else a machine does changes it less.
    Every second round begins with the other version, so neither is always first.
    """
    told: list[dict[str, list[str]]] = [{} for _ in versions]
    for number in range(section.rounds):
        in_turn = list(zip(versions, told, strict=True))
        for measured, figures in reversed(in_turn) if number % 2 else in_turn:
            for name, figure in _once(section, measured):
                figures.setdefault(name, []).append(figure)
    names = dict.fromkeys(name for figures in reversed(told) for name in figures)  # in the order of the newest
    rows = []
    for name in names:
        of_versions = [figures.get(name, []) for figures in told]
        rows.append([name, *map(_median, of_versions), *([_ratio(*of_versions)] if len(versions) > 1 else [])])
    return rows


def _once(section: Section, measured: Version) -> Iterable[tuple[str, str]]:
    has_it = (measured.folder / f"{section.module}.py").exists()
    folder = measured.folder if has_it else HERE  # what is new here must only start commands
    words: list[str | Path] = [measured.python, HERE / "section.py", folder, section.module, str(section.repeats)]
    done = subprocess.run(words, check=True, stdout=subprocess.PIPE, text=True)
    return [(name, figure) for name, figure in json.loads(done.stdout.splitlines()[-1])]


def _median(figures: list[str]) -> str:
    """Of figures such as `1.20 us` or `2.2 s (CPU 2.8 s)` the one in the middle by its first number."""
    ordered = sorted(figures, key=_number)
    return ordered[len(ordered) // 2] if ordered else "–"


def _ratio(before: list[str], now: list[str]) -> str:
    if not (before and now):
        return "–"
    return f"{median(_number(after) / _number(earlier) for earlier, after in zip(before, now, strict=True)):.2f}"


def _number(figure: str) -> float:
    """The first number of a figure."""
    return float(re.findall(r"[\d.]+", figure.replace(",", ""))[0])


def _processor() -> str:
    if sys.platform == "linux":
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    return platform.processor()


if __name__ == "__main__":
    main()
