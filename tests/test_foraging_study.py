"""The studies of foraging: their jobs, when a robot turns round, their tables, one small job of each kind."""

import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from cases import done, first_of
from scipy import stats

EXAMPLES = Path(__file__).parents[1] / "examples"
JOB = {"seed": 3, "season": 20, "steps": 80, "known": False, "repeats": 3, "generations": 1}


@pytest.fixture
def study(monkeypatch):
    monkeypatch.syspath_prepend(EXAMPLES)
    import foraging

    yield foraging
    del sys.modules["foraging"]


def test_its_jobs_are_those_of_the_plan(study):
    jobs = pd.DataFrame(study.Methods().plan())
    seeds = jobs.groupby("method").seed.agg(list)
    assert all(seeds[method] == [*range(911, 921)] for method in study.METHODS)
    assert all(len(seeds[name]) == 1 for name in study.FORAGERS)
    cells = pd.DataFrame(study.Lifespans().plan()).groupby(["season", "steps", "known", "method"]).size()
    assert cells.unstack()[study.LEARNERS].to_numpy().tolist() == [[6, 6, 6]] * 8
    assert [*cells.unstack().index] == sorted(study.CELLS)


def test_a_robot_turns_round_where_its_reward_since_the_switch_is_least(study):
    season = [1, 1, 1, 1, -1, -1, 1, 1]  # a switch after four steps
    rewards = np.array([season, season])
    assert study.turn_round(rewards, 4) == 2
    assert study.turn_round(np.abs(rewards), 4) == 0
    assert study.turn_round(np.array([[1, 1, -1, -1]]), 2) == 2
    assert np.isnan(study.turn_round(rewards, 8))


def seasons(study, reward):
    """Rows of eight champions of each method; reward: from method, controller and seed."""
    rows = []
    for method in study.METHODS:
        for controller in ("rule", "frozen") if method in study.RULES else ("network",):
            names = {"method": method, "controller": controller, "turn_round": 100.0}
            rows += [
                {**names, "seed": seed, "number": number, "reward": reward(method, controller, seed) + number}
                for seed in range(8)
                for number in (1, 2, 3, 4)
            ]
    return pd.DataFrame(rows)


def test_its_tests_are_those_of_scipy(study):
    drawn = np.random.default_rng(2).normal(size=(8, 2, 8))
    methods = [*study.METHODS]
    rows = seasons(
        study, lambda method, controller, seed: drawn[methods.index(method), int(controller == "frozen"), seed]
    )
    found = study.differences(rows).set_index(["ours", "other"])
    assert len(found) == 11
    rule, frozen = drawn[methods.index("abcd")]
    assert found.difference["abcd", "frozen"] == pytest.approx(3 * (rule - frozen).mean())
    expected = stats.permutation_test((rule - frozen,), np.mean, permutation_type="samples", n_resamples=np.inf)
    assert found.p["abcd", "frozen"] == pytest.approx(expected.pvalue)
    plain = drawn[methods.index("plain")][0]
    assert found.difference["abcd", "plain"] == pytest.approx(4 * (rule.mean() - plain.mean()))
    apart = stats.permutation_test((rule, plain), lambda a, b: a.mean() - b.mean(), n_resamples=np.inf)
    assert found.p["abcd", "plain"] == pytest.approx(apart.pvalue)
    means = study.method_means(rows).set_index(["method", "controller"])
    assert means.season_2["abcd", "frozen"] == pytest.approx(2 + frozen.mean())
    assert means.reward["plain", "network"] == pytest.approx(10 + 4 * plain.mean())


@pytest.mark.parametrize("method", first_of(["modulated", "plain, no reward", "elman", "discrete"]))
def test_a_job_is_the_same_again_and_has_the_controls_of_its_method(study, method):
    first, again = (study.Methods.do({**JOB, "method": method})["seasons"] for _ in range(2))
    pd.testing.assert_frame_equal(first, again)
    controls = {"off", "anti", "shuffled", "frozen", *(["inverted"] if method == "modulated" else [])}
    assert set(first.controller) == ({"rule", *controls} if method in study.RULES else {"network"})
    assert first.turn_round.isna().all() == (method == "plain, no reward")
    one = first.groupby("controller").reward.agg(list)
    if method in study.RULES:
        assert one["rule"][0] == one["frozen"][0]  # the first season is the same


def test_innate_tastes_earn_nothing(study):
    """The two lifetimes of a pair differ in their first season alone."""
    found = study.Methods.do({**JOB, "method": "innate", "seed": None})["seasons"]
    assert found.reward.tolist() == [0.0] * 4
    known = study.Methods.do({**JOB, "method": "innate", "season": 80, "known": True})["seasons"]
    knows = study.Methods.do({**JOB, "method": "knows", "season": 80, "known": True})["seasons"]
    assert known.reward.tolist() == knows.reward.tolist() > [0.0]


@pytest.mark.thorough
@pytest.mark.usefixtures("here")
@pytest.mark.parametrize("name", ["Methods", "Lifespans"])
def test_a_smoke_test_leaves_a_page(name):
    done("sweep", f"{EXAMPLES}/foraging.py:{name}", "quick=true", "hydra.sweep.dir=study")
    assert Path("study/report.html").is_file()
    assert [file.suffix for file in Path("study/figures").iterdir()] == [".png"]
