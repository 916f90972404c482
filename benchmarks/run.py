"""All benchmarks: tables on the terminal, and `benchmarks/results.md` with date, machine, versions and load."""

import os
import platform
import sys
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path

import commands
import parts
import scale
import step
from rich.console import Console
from rich.table import Table

RESULTS = Path(__file__).with_name("results.md")
SECTIONS = {
    "A control step against the plain loop (CPU time)": step.measure,
    "Its parts, each in a loop of its own (CPU time)": parts.measure,
    "Scale (CPU time a robot-step; gain in wall time)": scale.measure,
    "Whole commands (wall time, on a machine that others use too; CPU time beside it)": commands.measure,
}


def main() -> None:
    """Measure everything and tell."""
    console = Console()
    packages = ", ".join(f"{name} {version(name)}" for name in ("pymunk", "numba", "numpy"))
    lines = [
        "# Benchmarks\n",
        f"{datetime.now(UTC):%Y-%m-%d}, {_processor()}, {os.cpu_count()} cores, Python {platform.python_version()}, "
        f"{packages}; load average at the start {os.getloadavg()[0]:.2f}. Medians; `nox -s bench` measures anew.\n",
    ]
    for title, measure in SECTIONS.items():
        table = Table(title=title, title_justify="left", show_header=False)
        lines.append(f"## {title}\n\n| | |\n| --- | ---: |")
        for name, figure in measure():
            table.add_row(name, figure)
            lines.append(f"| {name} | {figure} |")
        lines.append("")
        console.print(table)
    RESULTS.write_text("\n".join(lines), encoding="utf-8")
    console.print(f"Written to {RESULTS.relative_to(Path.cwd()) if RESULTS.is_relative_to(Path.cwd()) else RESULTS}")


def _processor() -> str:
    if sys.platform == "linux":
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    return platform.processor()


if __name__ == "__main__":
    main()
