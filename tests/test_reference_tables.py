"""The committed tables of runs/reference/ are what the program makes of the rows by champion beside them."""

import io
import runpy
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml
from cases import first_of

from epuckhebb.analysis import claims, environments, findings, leaderboard, published
from epuckhebb.analysis.statistics import bootstrap, mean
from epuckhebb.flock import tables as flock
from epuckhebb.runtime.resources import data_folder
from epuckhebb.studies.flock import FlockStudy
from epuckhebb.tmaze.individual import GA

ROOT = Path(__file__).parents[1]
REFERENCE = ROOT / "runs" / "reference"
BOARDS = {"reversal": 10, "spikes": 12, "leaderboard": 12, "leaderboard_unseen": 20}  # champions of a method
NO_ENDS = {"end": "", "arrived": False}  # which these rows do not say
ENDS = ("broken_wrong", "broken_elsewhere", "broken_arrived")
COUNTS = {"successes_off": "Int64", "successes_inverted": "Int64"}


def read(name, **how):
    return pd.read_csv(REFERENCE / f"{name}.csv", **how)


@pytest.fixture
def committed(request):
    """Compare a table with the committed one, but for rounding, or write it with --regenerate."""

    def compare(name, table):
        text = table.to_csv(index=False, lineterminator="\n")
        try:
            pd.testing.assert_frame_equal(read(name), pd.read_csv(io.StringIO(text)), rtol=1e-12, atol=1e-12)
        except AssertionError:
            assert request.config.getoption("--regenerate"), (
                f"stale; run: pytest tests/{request.path.name} --regenerate"
            )
            (REFERENCE / f"{name}.csv").write_text(text)

    return compare


@pytest.mark.parametrize("folder", first_of(BOARDS))
def test_leaderboards(folder, committed):
    told, champions = (
        read(f"{folder}/leaderboard").fillna({"matched_control": ""}),
        read(f"{folder}/champions", dtype=COUNTS),
    )
    names = ("experiment", "method", "kind", "matched_control", "evolved_parameters", "knowledge", "knowledge_class")
    rows = [leaderboard.Row(**row) for row in told[list(names)].to_dict("records")]
    committed(f"{folder}/leaderboard", leaderboard.table(rows, champions))
    worlds = read(f"{folder}/worlds").groupby(["experiment", "method"])[["trials", "successes"]].sum()
    for row in told.itertuples():
        assert (row.trials, row.successes) == tuple(worlds.loc[row.experiment, row.method])
        assert row.champions == BOARDS[folder]


@pytest.mark.parametrize("folder", ["leaderboard", "spikes"])
def test_anytime_curves(folder, committed):
    committed(f"{folder}/anytime", leaderboard.anytime(read(f"{folder}/anytime_by_champion")))


def test_claims(committed):
    tables = yaml.safe_load((data_folder("conf") / "paper" / "tables.yaml").read_text())
    committed("claims", claims.claims(read("trials"), published.published_values(tables)))


def test_rescue_and_harm_at_the_rates_of_the_paper(committed):
    """The trials of other rates are too many to be committed; their rows stay."""
    key = ["experiment", "scenario", "controller", "N"]
    trials = read("trials")
    told, own = (table.set_index(key) for table in (read("rescue_and_harm"), findings.rescue_and_harm(trials)))
    rows = told.to_dict("index") | own[told.columns].to_dict("index")
    committed("rescue_and_harm", pd.DataFrame(rows.values(), told.index).reset_index())


@pytest.mark.parametrize("folder", ["many_obstacles", "second_physics"])
def test_rescue_and_harm_from_successes(folder, committed):
    told, counts = read(f"{folder}/rescue_and_harm"), read(f"{folder}/successes")
    repeats, by_champion = counts[GA].max(), []
    for experiment in told.experiment.unique():
        rows = told[told.experiment == experiment]
        of = counts[counts.scenario.isin(rows.scenario)].set_index("scenario").loc[rows.scenario.unique()].reset_index()
        for name, rate in [(GA, 0.0), *rows[["controller", "N"]].drop_duplicates().itertuples(index=False)]:
            trials = of[["scenario", "genome", "side"]].assign(experiment=experiment, controller=name, N=rate)
            by_champion.append(trials.assign(succeeds=2 * of[name] > repeats, **NO_ENDS))
    own = findings.rescue_and_harm(pd.concat(by_champion)).reindex(columns=told.columns)
    committed(f"{folder}/rescue_and_harm", own.assign(**{name: told[name] for name in ENDS if name in told}))


class Committed:
    """The tables of a study where a run has them."""

    def __init__(self, folder):
        self.folder = folder

    def has(self, name):
        return (REFERENCE / self.folder / name).is_file()

    def table(self, name):
        return read(f"{self.folder}/{name.removesuffix('.csv')}")


def test_evolve_or_adapt(committed):
    study = runpy.run_path(str(ROOT / "examples" / "evolve_or_adapt.py"))["EvolveOrAdapt"]()
    for name, table in study.tables([Committed("evolve_or_adapt")]).items():
        committed(f"evolve_or_adapt/{name}", table)


@pytest.mark.parametrize("run", ["anti_hebbian", "anti_hebbian_reached"])
def test_anti_hebbian(committed, run):
    told, gains = read(f"{run}/effects"), read(f"{run}/gains").groupby(["world", "change"], sort=False)
    ends = []
    for _, own in gains:
        hebb, anti = own.gain_hebbian.to_numpy(), own.gain_anti.to_numpy()
        ends.append(bootstrap(mean, (anti - hebb) / np.sqrt((hebb.var(ddof=1) + anti.var(ddof=1)) / 2)))
    committed(f"{run}/effects", told.assign(**dict(zip(("d_low", "d_high"), np.transpose(ends), strict=True))))


@pytest.mark.parametrize("budget", ["legs", "legs_300", "legs_fresh"])
def test_legs(budget, committed):
    """The effects, and the ends of the intervals of returns; the rest of the summary is of all lifetimes."""
    champions, told = (
        read(f"{budget}/champions", keep_default_na=False).assign(environment="halfcheetah"),
        read(f"{budget}/summary"),
    )
    committed(f"{budget}/effects", environments.effects(champions, ["environment", "change"]))
    own = champions.groupby(["change", "controller"], sort=False)
    for name in ("return", "return_before", "return_after"):
        ends = [
            bootstrap(mean, own.get_group(key)[name].to_numpy())
            for key in zip(told.change.fillna(""), told.controller, strict=True)
        ]
        told[f"{name}_low"], told[f"{name}_high"] = np.transpose(ends)
    committed(f"{budget}/summary", told)


def test_flocks(committed):
    committed("flock/flock", flock.table(read("flock/runs"), FlockStudy.seed))
