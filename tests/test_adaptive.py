"""An adaptation as a user meets it: evaluate, compare, show, sweep, and each mistake."""

import json

import numpy as np
import pandas as pd
import pytest
from cases import call, described_columns, done, first_of

from epuckhebb.adaptation.nominal import measure_nominal
from epuckhebb.config import training_world
from epuckhebb.config.compose import composed
from epuckhebb.config.schema import EvaluateConfig, typed
from epuckhebb.controller.network import PAPER_NETWORK
from epuckhebb.store.genome import load_genome
from epuckhebb.tmaze.individual import GA
from epuckhebb.tmaze.scenario import TRAINED

BRIEF = ["lifetime.duration_s=3", "lifetime.record_every=0", "repeats=2"]
TINY = ["ga.population=6", "ga.generations=2", "ga.elites=2", "ga.loops=1", "lifetime.duration_s=3"]


@pytest.mark.parametrize("scenario", first_of(["4obstacles", "lowlight"]))
def test_needs_no_other_setting(here, scenario):
    printed = json.loads(
        call("evaluate", "adaptation=late", f"scenario={scenario}", *BRIEF, "lifetime.record_every=8", "--json").stdout
    )
    metrics = pd.DataFrame(printed["runs"][0]["metrics"])
    assert list(metrics.controller.unique()) == [GA, "late"]
    assert (metrics.weight_change_mean == 0).all()  # three seconds are not late
    with np.load(next((here / "runs").rglob("traces.npz"))) as file:
        traces = dict(file)
    late = traces["change_signal"][[name == "late" for name in traces["controller"]]]
    assert (np.diff(late, axis=1) > 0).all()
    assert np.isnan(traces["change_signal"][[name == GA for name in traces["controller"]]]).all()


@pytest.mark.thorough
def test_the_bundled_champions_remember():
    for experiment, scenario in TRAINED.items():
        world = training_world(typed(composed("evaluate", [f"scenario={scenario}"]), EvaluateConfig))
        for where in ("reference", "reference_1", "reference_140"):
            genome = load_genome(where, experiment)
            assert (genome.network, genome.robot, genome.plan.text()) == (PAPER_NETWORK, "epuck", "234 weights")
            again = measure_nominal(genome.weights, world)
            for name in genome.nominal.__dataclass_fields__:
                value = getattr(genome.nominal, name)
                if value is not None:  # the oldest champions store neither sun nor lamp nor echo
                    np.testing.assert_array_equal(value, getattr(again, name), err_msg=f"{where} {name}")


@pytest.mark.thorough
@pytest.mark.usefixtures("here")
def test_older_champions_live_again():
    np.save("old.npy", load_genome("reference_20", "obstacles").genes)
    done("evaluate", "adaptation=late", "genome=old.npy", *BRIEF)
    done("evaluate", "adaptation=late", "genome=reference_20", "lifetime.gain_rad_s=4", *BRIEF)


SMALL_STUDY = """
# @package _global_
defaults: [{override /adaptation: late}]
compare: {always: {N: 0.002}}
hydra: {sweeper: {params: {scenario: "base,2obstacles", genome: "reference_1,reference_2"}}}
"""


def test_a_sweep_over_champions_and_worlds_tells_of_rescue_and_harm(here):
    (here / "mine" / "experiment").mkdir(parents=True)
    (here / "mine" / "experiment" / "small.yaml").write_text(SMALL_STUDY.lstrip())
    words = ["sweep", "small", "--config-dir", "mine", *BRIEF, "hydra/launcher=basic", "hydra.sweep.dir=out"]
    result = done(*words)
    assert "The obstacles experiment" in result.stdout
    each = pd.read_csv(here / "out" / "rescue_and_harm.csv")
    assert each[["scenario", "controller"]].to_numpy().tolist() == [
        [scenario, controller] for controller in ("late", "always") for scenario in ("base", "2obstacles")
    ]
    report = (here / "out" / "report.md").read_text()
    assert "reference_1" in report
    assert "### Each world" in report
    assert (here / "out" / "figures" / "rescue_and_harm.png").read_bytes().startswith(b"\x89PNG")
    of_ends, of_rescue = ("ends", "ends_by_champion", "discrimination"), ("over_all", "and_harm", "by_champion")
    for name in (*of_ends, *(f"rescue_{which}" for which in of_rescue)):
        columns = list(pd.read_csv(here / "out" / f"{name}.csv"))
        assert columns[columns.index("experiment") :] == described_columns(f"{name}.csv"), name
    at_end = pd.read_csv(here / "out" / "ends.csv").query("among == 'all'")
    assert (at_end[["right", "wrong", "elsewhere"]].sum(axis=1) == at_end.trials).all()
    assert set(at_end.trials) == {4}
    assert "right less wrong" in result.stdout
    assert "| right end | wrong end | elsewhere |" in report
    before = (here / "out" / "rescue_over_all.csv").read_bytes()
    assert "4 done before, 0 to do" in call(*words).stderr
    assert (here / "out" / "rescue_over_all.csv").read_bytes() == before
