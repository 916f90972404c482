"""The study that measures evolution in a changed world against plasticity: its jobs, its tables, one small job."""

import sys
from itertools import product
from pathlib import Path

import pandas as pd
import pytest

EXAMPLES = Path(__file__).parents[1] / "examples"


@pytest.fixture
def study(monkeypatch):
    monkeypatch.syspath_prepend(EXAMPLES)
    import evolve_or_adapt

    yield evolve_or_adapt
    del sys.modules["evolve_or_adapt"]


def test_its_jobs_are_those_of_the_plan(study):
    jobs = study.EvolveOrAdapt().plan()
    assert len(jobs) == 60 + 8 + 30
    assert len(study.EvolveOrAdapt(quick=True).plan()) == 4 + 1 + 3
    assert all(job["marks"] == [1, 2, 4, 8, 16] for job in jobs[:60])
    assert [job["champion"] for job in jobs[:60]] == [*study.CHAMPIONS["light"], *study.CHAMPIONS["obstacles"]]
    assert {len(set(seeds)) for seeds in study.CHAMPIONS.values()} == {30}


def test_its_tables_compare_ways_over_champions(study):
    kinds = {("from the champion", study.ALONE, 16): (True, False), ("from scratch", study.ALONE, 16): (False, False)}
    kinds |= {("with rehearsal", study.ALONE, 16): (True, True), ("from the champion", study.ALONE, 1): (False, True)}
    kinds |= {(*way, 0): (False, True) for way in (study.NOTHING, *study.REPLACES)}
    kinds[study.FIXED, study.PAPER, 0] = (True, True)
    rows = [
        {"experiment": "light", "champion": champion, "world": world, "way": way, "controller": name}
        | {"generation": mark, "robot_hours": 5.0 * mark, "contact_hours": 1.0 * mark}
        | {"recovered": recovered, "retained": retained}
        for ((way, name, mark), (recovered, retained)), champion, world in product(kinds.items(), range(8), "ab")
    ]
    recovery = pd.DataFrame(rows)
    ways = study._ways(recovery)
    own = ways[(ways.world == "all") & (ways.way == "from the champion") & (ways.generation == 16)].iloc[0]
    assert (own.cases, own.recovered, own.retained, own.robot_hours) == (16, 1, 0, 80)
    assert 0.5 < own.recovered_low < 1
    half = study._half(ways).set_index(["way", "controller"]).robot_hours
    assert (half["from the champion", study.ALONE], half["with rehearsal", study.ALONE]) == (80, 80)
    tests = study._tests(recovery, 16)
    assert list(tests.difference) == [1, 0, 0, 1, -1]
    assert tests.p[0] == 2 / 2**8  # all eight champions one way
    assert tests.p_holm[0] == pytest.approx(5 * 2 / 2**8)
    claims = study._claims(recovery, 16)
    assert list(claims.verdict[:4]) == ["holds", "does not hold", "holds", "does not hold"]
    assert list(claims.true[:4]) == [16, 0, 16, 0]
    assert set(claims.n * claims.champions) == {16 * 8}
    drawn = study._plane(ways[ways.world == "all"]).axes[0]
    assert "80 h" in [text.get_text() for text in drawn.texts]


def test_what_the_rule_adds_is_compared_between_thirds(study):
    gaps = [0.3, 0.1, 0.0]
    rows = [
        {"way": "genes", "seed": seed, "generation": number, "fitness": 0.8, "rule_off": 0.8 - gap - 0.01 * seed}
        for seed in range(8)
        for number, gap in enumerate(gaps)
    ]
    (test,) = study._innate_tests(pd.DataFrame(rows)).to_dict("records")
    assert (round(test["difference"], 9), test["seeds"]) == (0.3, 8)


def test_a_job_judges_at_the_fixed_generations_alone(study):
    shared = {"marks": [1], "rule_generations": 1, "repeats": 1}
    job = {"experiment": "light", "champion": 6, "worlds": ["lowlight"], **shared}
    first, again = (study.EvolveOrAdapt.do(job) for _ in range(2))
    assert all(first[name].equals(again[name]) for name in first)
    recovery = first["recovery"]
    assert set(recovery.way) == {study.FIXED, *study.RULES, *study.EVOLUTIONS}
    assert set(recovery.generation) == {0, 1}
    assert (recovery.robot_hours == 5.0 * recovery.generation).all()


@pytest.mark.thorough
def test_a_job_of_seasons_has_all_devices_and_one_of_innateness_all_ways(study):
    seasons = {"experiment": "light", "champion": 6, "periods": [1], "generations": 2, "repeats": 1}
    rows = study.EvolveOrAdapt.do(seasons)["seasons"]
    assert set(rows.device) == {study.FIXED, *study.DEVICES}
    ways = [{"way": way, "seed": 401, "generations": 1} for way in study.INHERITED]
    innate = [study.EvolveOrAdapt.do(way)["innate"].loc[0] for way in ways]
    assert [one.fitness == one.rule_off for one in innate] == [False, False, True]  # the last learns at no rate
    assert set(rows.period) == {"1", study.NEVER, study.WITHIN}


def test_devices_are_compared_at_one_period(study):
    shared = {"period": "3", "lifetimes": 10}
    good = {("memory", study.ALONE): 8, ("plain", study.ALONE): 4}
    ways = [*((device, study.ALONE) for device in study.DEVICES), (study.FIXED, study.PAPER)]
    sums = pd.DataFrame(
        {"device": device, "controller": controller, "champion": champion, **shared}
        | {"succeeded": good.get((device, controller), 4)}
        for device, controller in ways
        for champion in range(8)
    )
    tests = study._season_tests(sums, "3")
    assert list(tests.difference) == [0, 0, 0.4, 0]
    assert tests.p_holm[2] == pytest.approx(4 * 2 / 2**8)
    assert study._periods(sums).success.max() == 0.8
