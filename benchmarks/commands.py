"""What whole commands cost when nothing is compiled yet; their peak memory, and what they write."""

import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from statistics import median

REPEATS = 5
EPUCKHEBB = shutil.which("epuckhebb", path=str(Path(sys.executable).parent)) or "epuckhebb"


def measure() -> list[tuple[str, str]]:
    """Seconds and megabytes of the first `evaluate` and `evolve`, and bytes written with and without recording."""
    with tempfile.TemporaryDirectory() as folder:
        here = Path(folder)
        cold = spent(here, "evaluate", "scenario=4obstacles")
        rows = [("evaluate, first start (compiles)", told(cold))]
        rows.append(("--help", told(*(spent(here, "--help") for _ in range(REPEATS)))))
        rows.append(("evolve, the first (compiles the calibration)", told(spent(here, "evolve"))))
        rows += [(f"evolve, inside steps (CPU): {what}", share) for what, share in _inside(here)]
        peak = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024
        rows.append(("peak memory of any of them", f"{peak:.0f} MB"))
        for seconds in (60, 250):
            for every in (0, 8, 1):
                words = [
                    f"lifetime.duration_s={seconds}",
                    f"lifetime.record_every={every}",
                    f"hydra.run.dir=r{seconds}_{every}",
                ]
                spent(here, "evaluate", *words)
                written = sum(f.stat().st_size for f in (here / f"r{seconds}_{every}").rglob("*") if f.is_file())
                rows.append((f"written: {seconds} s, a sample every {every} steps", f"{written / 1e6:.2f} MB"))
    return rows


def _inside(here: Path) -> list[tuple[str, str]]:
    script = Path(__file__).with_name("inside.py")
    printed = subprocess.run(
        [sys.executable, script, "hydra.run.dir=inside"],
        cwd=here,
        env=environment(here),
        check=True,
        capture_output=True,
        text=True,
    ).stdout
    return list(
        zip(("of the whole process", "of the generations"), (f"{share} %" for share in printed.split()), strict=True)
    )


def environment(here: Path) -> dict[str, str]:
    """This process's environment, but for kernels of its own, and bytecode, which some installers do not write."""
    usual = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    return {**usual, "XDG_CACHE_HOME": str(here / "cache")}


def told(*times: tuple[float, float]) -> str:
    """Medians of wall and CPU times, in words."""
    wall, cpu = (median(column) for column in zip(*times, strict=True))
    return f"{wall:.2f} s (CPU {cpu:.2f} s)"


def spent(here: Path, *words: str) -> tuple[float, float]:
    """Wall and CPU seconds of a command, run in this folder."""
    return spent_by([EPUCKHEBB, *words, *([] if words[0] == "--help" else ["--quiet"])], here)


def spent_by(program: Sequence[str], here: Path) -> tuple[float, float]:
    """Wall and CPU seconds of a program, run in this folder."""
    began, cpu_before = time.perf_counter(), _cpu_of_children()
    subprocess.run(program, cwd=here, env=environment(here), check=True, capture_output=True)
    return time.perf_counter() - began, _cpu_of_children() - cpu_before


def _cpu_of_children() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime
