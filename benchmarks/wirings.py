"""Tests champions of layers, CTRNN and Elman networks in the paper's worlds.

It writes a table (that of the page is benchmarks/wirings.csv) of the seeds whose champions are all there.

The champions come of one command, in any number of folders, which follow the table as arguments:

    epuckhebb evolve -m "seed=range(401,413)" network.wiring=mlp,ctrnn,elman scenario=base,highlight hydra.sweep.dir=DIR
    python benchmarks/wirings.py wirings.csv DIR
"""

import sys
from pathlib import Path

import pandas as pd
import yaml

import epuckhebb

WORLDS = {"base": ("base", "2obstacles", "4obstacles"), "highlight": ("highlight", "lowlight")}
REPEATS = 10
HELD = "ctrnn, held"  # its time constants hold at any wheel gain
KEYS = ["experiment", "wiring", "seed", "scenario", "controller", "side"]


def rows_of(run: Path) -> pd.DataFrame:
    """Successes of a champion in its experiment's worlds: a row for each world, controller and side."""
    config = yaml.safe_load((run / ".hydra" / "config.yaml").read_text(encoding="utf-8"))
    wiring, trained = config["network"]["wiring"], config["scenario"]["name"]
    parts = []
    for called, network in {wiring: {}, HELD: {"tau_gain_rad_s": 0}}.items():
        if called == HELD and wiring != "ctrnn":
            continue
        for scenario in WORLDS[trained]:
            keys = {"scenario": scenario, "network": network} if network else {"scenario": scenario}
            result = epuckhebb.evaluate(run, "lifetime.record_every=0", repeats=REPEATS, progress=False, **keys)
            parts.append(result.metrics.assign(wiring=called))
    metrics = pd.concat(parts).assign(seed=config["seed"])
    return metrics.groupby(KEYS, sort=False).success.agg(trials="size", successes="sum").reset_index()


if __name__ == "__main__":
    table_of, *folders = sys.argv[1:]
    champions = [file.parent for folder in folders for file in sorted(Path(folder).glob("*/champion.npz"))]
    finished = [run for run in champions if '"state": "finished"' in (run / "status.json").read_text(encoding="utf-8")]
    table = pd.concat(map(rows_of, finished)).sort_values(KEYS)
    complete = table.groupby("seed").wiring.transform("nunique") == 4
    both = table.groupby(["seed", "wiring"]).experiment.transform("nunique") == 2
    table = table[complete & both.groupby(table.seed).transform("all")]
    table.to_csv(table_of, index=False)
    print(f"{table_of}: seeds {', '.join(map(str, sorted(table.seed.unique())))}")
