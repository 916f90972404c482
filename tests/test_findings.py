"""The statistics of the study, on cases small enough to count by hand."""

import math

import numpy as np
import pandas as pd
import pytest
import yaml

from epuckhebb.app.data import data_folder
from epuckhebb.study import findings, published
from epuckhebb.study.evaluate import GA_ALONE, HEBBIAN
from epuckhebb.study.statistics import bootstrap_mean, bootstrap_ratio, mcnemar, wilson


@pytest.mark.parametrize(
    ("k", "n", "low", "high"), [(20, 20, 0.8389, 1.0), (0, 10, 0.0, 0.2775), (7, 22, 0.1636, 0.5268)]
)
def test_wilson(k, n, low, high):
    assert wilson(k, n) == pytest.approx((low, high), abs=1e-4)


def test_no_trials_no_interval():
    assert all(map(math.isnan, wilson(0, 0)))


@pytest.mark.parametrize(("b", "c", "p"), [(0, 0, 1.0), (6, 0, 2 / 64), (1, 5, 14 / 64), (5, 5, 1.0)])
def test_mcnemar_is_exact(b, c, p):
    assert mcnemar(b, c) == pytest.approx(p)


def test_bootstrap_covers_the_mean_and_collapses_where_all_agree():
    low, high = bootstrap_mean(np.random.default_rng(0).normal(3, 1, 50), seed=1)
    assert low < 3 < high
    assert high - low == pytest.approx(2 * 1.96 / math.sqrt(50), rel=0.25)
    assert bootstrap_mean(np.ones(5), seed=1) == (1, 1)
    assert bootstrap_mean(np.array([1.0, np.nan]), seed=1) == (1, 1)


def lifetimes(outcomes, repeats=3):
    """Metrics of lifetimes from {(champion, scenario, controller, N): (successes left, right)} of the repeats."""
    rows = []
    for (genome, scenario, controller, rate), sides in outcomes.items():
        for side, successes in zip(("left", "right"), sides, strict=True):
            for repeat in range(repeats):
                succeeds = repeat < successes
                rows.append(
                    {"genome": genome, "experiment": "obstacles", "scenario": scenario, "controller": controller}
                    | {"N": rate, "side": side, "repeat": repeat, "success": int(succeeds)}
                    | {"time_to_goal_s": 100.0 if succeeds else math.nan, "path_length_m": 1.0}
                    | {"final_position_error_m": 0.03 if succeeds else 0.3, "weight_change_mean": 3.0 * (rate > 0)}
                )
    return pd.DataFrame(rows)


N = 0.000015
EACH = findings.trials(
    lifetimes(
        {
            # a: mastered on both sides; 4 obstacles break the left, plasticity rescues it and harms the right
            ("a", "base", GA_ALONE, 0.0): (3, 2),
            ("a", "base", HEBBIAN, N): (3, 3),
            ("a", "2obstacles", GA_ALONE, 0.0): (3, 3),
            ("a", "2obstacles", HEBBIAN, N): (3, 3),
            ("a", "4obstacles", GA_ALONE, 0.0): (1, 3),
            ("a", "4obstacles", HEBBIAN, N): (2, 0),
            # b: the right is not mastered, so nothing of it can be broken; the left is broken and stays so
            ("b", "base", GA_ALONE, 0.0): (3, 1),
            ("b", "base", HEBBIAN, N): (0, 3),
            ("b", "2obstacles", GA_ALONE, 0.0): (3, 0),
            ("b", "2obstacles", HEBBIAN, N): (3, 3),
            ("b", "4obstacles", GA_ALONE, 0.0): (0, 0),
            ("b", "4obstacles", HEBBIAN, N): (0, 3),
        }
    )
)


def test_a_trial_succeeds_if_most_of_its_repeats_do():
    own = EACH[(EACH.genome == "a") & (EACH.scenario == "4obstacles")].set_index(["controller", "side"])
    assert own.succeeds.to_dict() == {
        (GA_ALONE, "left"): False,
        (GA_ALONE, "right"): True,
        (HEBBIAN, "left"): True,
        (HEBBIAN, "right"): False,
    }


def test_rescue_and_harm_by_hand():
    found = findings.rescue_and_harm(EACH).set_index("scenario")
    counts = found[["mastered", "broken", "rescued", "sound", "harmed"]]
    assert counts.loc["base"].tolist() == [3, 0, 0, 3, 1]
    assert counts.loc["2obstacles"].tolist() == [3, 0, 0, 3, 0]
    assert counts.loc["4obstacles"].tolist() == [3, 2, 1, 1, 1]
    assert math.isnan(found.rescued_share["base"])
    assert found.difference["4obstacles"] == pytest.approx((0 + 0.5) / 2)  # a: +1 -1, b: 0 +1
    assert found.mcnemar_p["4obstacles"] == 1.0


def test_rescue_over_all_changed_worlds_by_hand():
    (found,) = findings.rescue_over_all(EACH).to_dict("records")
    assert (found["broken"], found["rescued"], found["sound"], found["harmed"]) == (2, 1, 4, 1)
    assert (found["home_mastered"], found["home_harmed"]) == (3, 1)
    assert (found["rescued_share"], found["harmed_share"]) == (0.5, 0.25)
    assert (found["rescued_low"], found["rescued_high"]) == (0.0, 1.0)  # a: 1 of 1, b: 0 of 1
    assert findings.changed(EACH, "obstacles") == ["2obstacles", "4obstacles"]


def test_bootstrap_ratio_weighs_champions_by_their_trials():
    part, whole = np.array([1, 0, 3]), np.array([2, 0, 3])
    low, high = bootstrap_ratio(part, whole, seed=1)
    assert 0.5 == low < 0.8 < high == 1.0
    assert all(map(math.isnan, bootstrap_ratio(part, np.zeros(3, int), seed=1)))


def test_success_counts_champions():
    found = findings.success(EACH).set_index(["scenario", "controller", "side"])
    assert tuple(found.loc[("base", GA_ALONE, "right"), ["successes", "n"]]) == (1, 2)
    assert tuple(found.loc[("base", GA_ALONE, "right"), ["low", "high"]]) == wilson(1, 2)
    assert tuple(found.loc[("base", GA_ALONE, "both"), ["successes", "n"]]) == (1, 2)


def test_claims_by_hand():
    found = findings.claims(EACH, {"obstacles": 2}).set_index("claim")
    assert tuple(found.loc["4 obstacles defeat the GA", ["true", "n"]]) == (2, 3)
    assert tuple(found.loc["N = 1.5e-05 rescues it at 4", ["true", "n"]]) == (1, 2)
    assert tuple(found.loc["Weight change grows with obstacles", ["true", "n"]]) == (0, 4)
    assert found.verdict["The genome is unchanged after a lifetime"] == "holds"
    assert found.verdict["N = 1.5e-05 rescues it at 2"] == "no trial to judge by"


@pytest.mark.parametrize(("true", "n", "verdict"), [(19, 20, "holds"), (1, 20, "does not hold"), (10, 20, "mixed")])
def test_verdicts(true, n, verdict):
    assert findings.Claim("light", "", "", true, n).verdict == verdict
    assert findings.Claim("light", "", "", true, n, always=True).verdict == "does not hold"


@pytest.fixture(scope="module")
def paper():
    return yaml.safe_load((data_folder("conf") / "paper" / "tables.yaml").read_text())


def test_showcase_is_the_likest_of_the_masters(paper):
    assert findings.showcase(EACH, published.published_success(paper), "obstacles") == ("a", 8, 12)


def test_published_values_are_the_papers(paper):
    values = published.published_values(paper)
    assert values.published.notna().sum() == 20 + 2 * (5 + 4 + 4) + 6 * 6
    cell = values[(values.scenario == "4obstacles") & (values.controller == HEBBIAN) & (values.side == "right")]
    assert cell.set_index("metric").published["time_to_goal_s"] == 161.25
    said = published.published_success(paper).set_index(["scenario", "controller", "side"]).success
    assert said["lowlight", GA_ALONE, "left"] == 0
    assert said["highlight", HEBBIAN, "right"] == 0


def test_a_missing_published_value_is_named(paper):
    broken = {**paper, "table2": {**paper["table2"], "cells": [{"scenario": "base", "controller": "GA", "left": {}}]}}
    with pytest.raises(ValueError, match=r"table2: every cell needs .*right"):
        published.published_values(broken)


def test_comparison_puts_ours_beside_theirs(paper):
    values = published.published_values(paper)
    found = published.compare(values, EACH, {"obstacles": "a"}).set_index(["scenario", "controller", "side", "metric"])
    cell = found.loc[("base", GA_ALONE, "left", "time_to_goal_s")]
    assert (cell.ours, cell.published, cell.n) == (100.0, 213.82, 2)
    assert cell.relative_deviation == pytest.approx(100 / 213.82 - 1)
    text = published.to_markdown(found.reset_index(), of_all=False)
    assert "| **Time-to-Goal (s)** | 100.00 (213.82) |" in text
