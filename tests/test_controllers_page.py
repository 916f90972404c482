"""The page of recurrent controllers shows what is in benchmarks/wirings.csv."""

from pathlib import Path

import numpy as np
import pandas as pd

from epuckhebb.adaptation.controller import GA, HEBBIAN
from epuckhebb.analysis.statistics import bootstrap_mean, sign_flip, wilson_by_champion
from epuckhebb.analysis.tables import markdown_table
from epuckhebb.tmaze.scenario import TRAINED

ROOT = Path(__file__).parents[1]
HEAD = ["experiment", "network", "champions", "solve both sides", "training world", "changed worlds", "with plasticity"]
HEAD += ["plasticity on less off", "less `mlp`, both off"]


def by_seed(rows):
    return rows.groupby("seed")[["successes", "trials"]].sum()


def share(rows):
    champions = by_seed(rows)
    low, high = wilson_by_champion(champions.successes.to_numpy(), champions.trials.to_numpy())
    return f"{champions.successes.sum() / champions.trials.sum():.2f} [{low:.2f}, {high:.2f}]"


def difference(rows, others):
    one, other = by_seed(rows), by_seed(others)
    assert (one.index == other.index).all()
    assert (one.trials == other.trials).all()
    more = (one.successes - other.successes).to_numpy(np.int64)
    shares = more / one.trials.to_numpy()
    low, high = bootstrap_mean(shares, seed=0, bounds=(-1, 1))
    return f"{shares.mean():+.2f} [{low:+.2f}, {high:+.2f}], p = {sign_flip(more):.2g}"


def cells(experiment, wiring, rows, layers):
    trained = rows.scenario == TRAINED[experiment]
    off, on = rows.controller == GA, rows.controller == HEBBIAN
    of_sides = rows[trained & off].assign(solved=lambda one: 2 * one.successes >= one.trials).groupby("seed").solved
    against = layers[(layers.scenario != TRAINED[experiment]) & (layers.controller == GA)]
    return [
        experiment,
        f"`{wiring.partition(',')[0]}`{wiring.removeprefix(wiring.partition(',')[0])}",
        str(rows.seed.nunique()),
        str(int(of_sides.all().sum())),
        share(rows[trained & off]),
        share(rows[~trained & off]),
        share(rows[~trained & on]),
        difference(rows[~trained & on], rows[~trained & off]),
        "–" if wiring == "mlp" else difference(rows[~trained & off], against),
    ]


def test_the_page_shows_the_table_of_champions(generated):
    table = pd.read_csv(ROOT / "benchmarks" / "wirings.csv")
    lines, seeds = [], sorted(table.seed.unique())
    for experiment in TRAINED:
        own = table[table.experiment == experiment]
        layers = own[own.wiring == "mlp"]
        for wiring in ("mlp", "ctrnn", "ctrnn, held", "elman"):
            rows = own[own.wiring == wiring]
            assert sorted(rows.seed.unique()) == seeds
            assert set(rows.trials) == {10}
            lines.append(cells(experiment, wiring, rows, layers))
    # What the page says of them: Holm's method begins with the smallest.
    found = sorted(float(cell.partition("p = ")[2]) for line in lines for cell in line[-2:] if cell != "–")
    assert (len(found), sum(p < 0.05 for p in found), 14 * found[0] > 0.05) == (14, 3, True)
    solved = {(line[0], line[1]): int(line[3]) for line in lines}
    assert solved["light", "`ctrnn`"] == 1
    assert all(solved[one, "`mlp`"] > solved[one, f"`{other}`"] for one in TRAINED for other in ("ctrnn", "elman"))
    text = f"Seeds {', '.join(map(str, seeds))}.\n\n{markdown_table(HEAD, lines)}\n"
    generated(ROOT / "docs" / "controllers.md", "wirings", text)
