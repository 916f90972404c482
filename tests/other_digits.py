"""What an evolution has otherwise where the C library may not fuse multiplications and additions: `nox -s digits`.

So it is on another processor: exp, tanh, sin and cos have other last digits there. Needs glibc on a processor with FMA.
"""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import pandas as pd

from epuckhebb.store import Run

EVOLVE = ["evolve", "seed=1", "ga.generations=3", "figures=none", "--quiet"]
WITHOUT = {"GLIBC_TUNABLES": "glibc.cpu.hwcaps=-FMA,-FMA4"}


def evolved(folder, environment):
    words = [sys.executable, "-m", "epuckhebb", *EVOLVE, f"hydra.run.dir={folder}"]
    subprocess.run(words, env=os.environ | environment, check=True)
    return Run(folder).provenance["functions"], Run(folder).table("history.csv")


def main():
    with tempfile.TemporaryDirectory() as name:
        here, history = evolved(Path(name, "fused"), {})
        there, others = evolved(Path(name, "apart"), WITHOUT)
    if here == there:
        sys.exit("the C library has the same digits without FMA")
    gap = (history / others - 1).abs().select_dtypes("number")
    table = {"first generation that differs": gap.gt(0).idxmax().where(gap.gt(0).any()), "largest, relative": gap.max()}
    print(pd.DataFrame(table).to_string())


if __name__ == "__main__":
    main()
