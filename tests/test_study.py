"""Evaluation, tables and figures."""

import numpy as np
import pandas as pd
import pytest

from epuckhebb.analysis import charts, summary, tables
from epuckhebb.analysis import evaluate as analysis
from epuckhebb.analysis.evaluate import COLUMNS
from epuckhebb.analysis.paper_table import PaperTable, mean, saturation
from epuckhebb.controller.plasticity.rules.paper import Paper
from epuckhebb.controller.plasticity.weight_change import saturated_fraction
from epuckhebb.store.rows import as_csv
from epuckhebb.tmaze.individual import Controller
from epuckhebb.tmaze.life import Lifetime
from epuckhebb.tmaze.scenario import Scenario

BRIEF = Lifetime(duration_s=40, gain_rad_s=4, record_every=10)
MEASURED = list(COLUMNS[COLUMNS.index("success") : COLUMNS.index("changed")])


def hebbian(rate, name="Hebbian"):
    return Controller(name=name, rule=Paper(N=rate))


def evaluate(*arguments, **more):
    """The lifetimes as a table, and the traces."""
    rows, traces = analysis.evaluate(*arguments, **more)
    return pd.DataFrame(rows), traces


@pytest.fixture(scope="module")
def evaluated(genomes):
    return evaluate(genomes[1], Scenario(), [hebbian(0.002)], BRIEF, repeats=3, seed=4, name="one")


def test_a_row_for_every_lifetime(evaluated):
    rows, _ = evaluated
    assert tuple(rows.columns) == COLUMNS
    assert list(rows.groupby(["controller", "side"]).size()) == [3, 3, 3, 3]
    assert set(rows[rows.controller == "GA"].N) == {0}
    assert (rows[rows.controller == "GA"][["weight_change_mean", "weight_change_final"]] == 0).all(axis=None)
    assert (rows.average_speed_m_s == rows.path_length_m / 40).all()


def test_paired_controls_hear_the_same_noise(genomes):
    rows, _ = evaluate(genomes[1], Scenario(), [hebbian(0.0)], BRIEF, repeats=3, seed=4)
    ga, paired = (rows[rows.controller == name][MEASURED].to_numpy() for name in ("GA", "Hebbian"))
    np.testing.assert_array_equal(ga, paired)


def test_controllers_of_the_same_name_need_different_rates(genomes):
    rows, _ = evaluate(genomes[1], Scenario(), [hebbian(0.001), hebbian(0.002)], BRIEF, repeats=1, seed=4)
    assert list(rows.groupby(["controller", "N"]).size()) == [2, 2, 2]
    with pytest.raises(ValueError, match="the same name and N"):
        evaluate(genomes[1], Scenario(), [hebbian(0.001), hebbian(0.001)], BRIEF, repeats=1, seed=4)


def test_what_changed_is_in_every_row(genomes, evaluated):
    assert set(evaluated[0].changed) == {""}
    rows, _ = evaluate(genomes[1], Scenario(), [], BRIEF, repeats=1, seed=4, changed="light=1")
    assert set(rows.changed) == {"light=1"}


def test_repeats_differ_and_do_not_depend_on_how_many_there_are(genomes, evaluated):
    rows, _ = evaluated
    more, _ = evaluate(genomes[1], Scenario(), [hebbian(0.002)], BRIEF, repeats=5, seed=4, threads=2, name="one")
    assert rows.path_length_m.nunique() == len(rows)
    kept = more[more.repeat < 3].reset_index(drop=True)
    assert kept.to_csv() == rows.to_csv()


def test_traces_are_of_the_first_repeat(evaluated):
    rows, traces = evaluated
    assert traces.controller == ["GA", "GA", "Hebbian", "Hebbian"]
    assert traces.side == ["left", "right", "left", "right"]
    assert traces.samples.pose.shape == (4, BRIEF.steps // 10, 3)
    first = rows[rows.repeat == 0]
    near = np.hypot(*(traces.samples.pose[:, -1, :2] - [[-0.36, 0.155], [0.36, 0.155]] * 2).T)
    np.testing.assert_allclose(near, first.final_position_error_m, atol=0.03)


def test_table_in_the_papers_layout(evaluated, golden):
    rows, _ = evaluated
    table = PaperTable.from_rows(rows.to_dict("records"))
    golden(
        "table.csv", as_csv([{k: v if k == "metric" else round(v, 9) for k, v in row.items()} for row in table.rows])
    )
    golden("table.md", table.markdown())


def test_time_to_goal_is_the_mean_of_those_that_arrived(evaluated):
    rows = evaluated[0].copy()
    rows["time_to_goal_s"] = np.nan
    rows.loc[rows.index[0], "time_to_goal_s"] = 12.5
    table = PaperTable.from_rows(rows.to_dict("records")).readable()
    assert [row[3] for row in table.rows] == ["12.50", "–", "–", "–"]


def test_saturated_weights_are_counted():
    bound = 2.0
    assert saturated_fraction(np.array([0.0, 1.98, 1.991, -2.0]), bound) == 0.5
    shares = {"GA": 0.9, "mild": 0.5, "Hebbian": 0.872}
    rows = [{"controller": name, "saturated_fraction": share} for name, share in shares.items()]
    assert "87 % (Hebbian)." in saturation(rows)
    assert saturation(rows[:2]) == ""


def test_means_of_the_papers_table_are_rounded_once():
    assert mean([0.1] * 10) == 0.1
    assert mean([1e16, None, 1.0, -1e16, np.nan]) == 1 / 3
    assert np.isnan(mean([None, np.nan]))


def test_weights_end_at_their_bound_at_a_large_rate():
    fast = Controller(name="Hebbian", rule=Paper(N=10.0))
    rows, _ = evaluate(np.full(234, 2.0), Scenario(), [fast], Lifetime(duration_s=1.0), repeats=1, seed=1)
    assert list(rows.saturated_fraction[rows.controller == "GA"]) == [0, 0]
    assert (rows.saturated_fraction[rows.controller == "Hebbian"] > 0.5).all()


def lives(controller, rate, n, **settings):
    """Rows of `metrics.csv` as text, a lifetime a side and repeat, `n` of them successes on either side."""
    same = {**dict.fromkeys(COLUMNS, "0"), "genome": "g", "scenario": "base", "changed": "", "controller": controller}
    sides = [
        {"side": side, "repeat": str(k), "success": str(int(k < n))} for side in ("left", "right") for k in range(4)
    ]
    return pd.DataFrame([{**settings, **same, "N": rate, **one} for one in sides])


def test_the_dose_response_has_each_condition_and_the_genes_alone_beside_it():
    rows = [
        lives(controller, rate, n + (controller == "GA"), **{"lifetime.noise": noise})
        for n, noise in enumerate("01")
        for controller, rate in (("GA", "0"), ("Hebbian", "0.1"), ("Hebbian", "0.2"))
    ]
    doses = summary.dose_response(pd.concat(rows), ["N", "lifetime.noise"])
    assert "(over noise, g alone)" in charts.dose_response(doses).get_suptitle()
    assert [name for name, _ in doses.groupby("condition", sort=False)] == [
        "base, lifetime.noise=0: Hebbian",
        "base, lifetime.noise=1: Hebbian",
    ]
    left = doses[doses.side == "left"]
    assert list(left.N) == [0, 0.1, 0.2] * 2
    assert list(left.success) == [0.25, 0, 0, 0.5, 0.25, 0.25]
    assert (left.success_low <= left.success).all()
    assert (left.success <= left.success_high).all()


def test_the_dose_response_of_champions_is_one_panel_a_world_over_all_of_them():
    rows = [
        lives(controller, rate, n).assign(genome=genome, scenario=scenario)
        for n, genome in zip((1, 2, 3, 1, 2, 3), "abcdef", strict=True)
        for scenario in ("base", "4obstacles")
        for controller, rate in (("GA", "0"), ("Hebbian", "0.1"), ("Hebbian", "0.2"))
    ]
    doses = summary.dose_response(pd.concat(rows), ["genome", "N", "scenario"])
    assert "(over champions)" in charts.dose_response(doses).get_suptitle()
    assert list(doses.condition.unique()) == ["base: Hebbian", "4obstacles: Hebbian"]
    assert set(doses.success) == {0.5}
    assert (doses.success_low < 0.5).all()


@pytest.mark.parametrize(
    ("of", "text"),
    [
        ([("GA", 0.0)], ""),
        ([("GA", 0.0), ("Hebbian", 0.002), ("Hebbian", 0.002), ("anti", 0.002)], "N = 0.002"),
        ([("Hebbian", 1.5e-5), ("anti", 2e-4), ("oja", 1.5e-5)], "N = 1.5e-05 (Hebbian, oja), 0.0002 (anti)"),
    ],
)
def test_rates_come_with_their_controllers(of, text):
    assert tables.rates(of) == text
