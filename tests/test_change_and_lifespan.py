"""The study of changes and lifespans: its jobs, its tables, one small job of each method."""

import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from cases import done, first_of, refused

EXAMPLES = Path(__file__).parents[1] / "examples"
STUDY = f"{EXAMPLES}/change_and_lifespan.py:ChangeAndLifespan"


@pytest.fixture
def study(monkeypatch):
    monkeypatch.syspath_prepend(EXAMPLES)
    import change_and_lifespan

    yield change_and_lifespan
    del sys.modules["change_and_lifespan"]


def champion(study, cell, method, seed, **shares):
    names = dict(zip(study.CELL, cell, strict=True)) | {"method": method, "seed": seed, "lifetimes": 200}
    return names | dict.fromkeys(study.SHARES, np.nan) | shares


def test_its_jobs_are_those_of_the_plan(study):
    jobs = pd.DataFrame(study.ChangeAndLifespan().plan())
    counts = jobs.groupby([*study.CELL, "method"]).seed.agg(list)
    assert counts[(*study.PRIMARY, "modulated")] == [*range(601, 617)]
    others = counts.drop(index=(*study.PRIMARY, "modulated"))
    assert len(others) == 10 + 2 * 7
    assert all(seeds == [*range(601, 607)] for seeds in others)
    assert {*jobs[jobs.method != "modulated"].trials} == {5, 10}
    assert {*jobs[study.CELL].itertuples(index=False, name=None)} == {*study.CELLS}
    assert study.PRIMARY in study.CELLS
    for cell in study.CELLS:
        assert 0.5 <= study.limits(*cell)["chance"] <= study.limits(*cell)["optimum"] <= 1
    assert study.limits(0, 30, "left") == {"chance": 1, "optimum": 1}


def test_more_seeds_go_into_the_same_folder_and_leave_the_jobs_of_others(study):
    one, more = study.ChangeAndLifespan(seeds=[601]), study.ChangeAndLifespan(seeds=[602, 601])
    assert one.folder([]) == more.folder([]) != study.ChangeAndLifespan(repeats=9).folder([])
    assert [job for job in more.plan() if job["seed"] == 601] == one.plan()


@pytest.mark.parametrize("seeds", ["[]", "[601,601]"])
def test_seeds_that_are_no_set_are_refused(seeds):
    assert "seeds" in refused("sweep", STUDY, f"seeds={seeds}")


def test_its_tables_compare_a_rule_with_its_own_controls(study):
    rows = [
        champion(study, cell, "modulated", seed, rewarded=0.8 + 0.01 * (seed % 2), frozen=0.6, off=0.5, inverted=0.2)
        for cell in (study.PRIMARY, (0, 5, "left"))
        for seed in range(8)
    ]
    rows += [champion(study, study.PRIMARY, "ctrnn", seed, rewarded=0.7) for seed in range(8)]
    champions = pd.DataFrame(rows)
    cells = study._cells(champions).set_index([*study.CELL, "method"])
    own = cells.loc[(*study.PRIMARY, "modulated")]
    assert own[["champions", "rewarded", "frozen", "chance"]].tolist() == pytest.approx([8, 0.805, 0.6, 0.5])
    assert 0.8 <= own.rewarded_low < 0.805 < own.rewarded_high <= 0.81
    differences = study._differences(champions).set_index([*study.CELL, "control"])
    assert differences.difference.tolist() == pytest.approx([0.305, 0.205, 0.305, 0.205])
    assert differences.p.dropna().to_dict() == {(*study.PRIMARY, "off"): 2 / 2**8}  # all eight one way
    figure = study._shares(cells.reset_index())
    assert [axes.get_title() for axes in figure.axes] == ["5 trials", "30 trials"]


@pytest.mark.parametrize("method", first_of(["modulated", "ctrnn", "layers"]))
def test_a_job_is_the_same_again_and_has_the_controls_of_its_method(study, method):
    job = {"switches": 1, "trials": 5, "first": "drawn", "method": method, "seed": 3, "repeats": 2, "generations": 1}
    first, again = (study.ChangeAndLifespan.do(job)["champions"] for _ in range(2))
    pd.testing.assert_frame_equal(first, again)
    has = {"modulated": [*study.SHARES], "ctrnn": ["rewarded", "inverted"], "layers": ["rewarded"]}
    assert first.columns[first.notna().all()].intersection(study.SHARES).tolist() == has[method]
    assert (first.lifetimes[0], first.seed[0], first.trials[0]) == (4, 3, 5)


@pytest.mark.thorough
@pytest.mark.usefixtures("here")
def test_a_smoke_test_leaves_a_page_and_goes_on():
    done("sweep", STUDY, "quick=true", "hydra.sweep.dir=study")
    champions = Path("study/champions.csv").read_bytes()
    assert len(pd.read_csv("study/champions.csv")) == 25
    done("sweep", STUDY, "quick=true", "seeds=[602]", "hydra.sweep.dir=study")
    assert set(pd.read_csv("study/champions.csv").seed) == {602}
    done("sweep", STUDY, "quick=true", "hydra.sweep.dir=study")
    assert Path("study/champions.csv").read_bytes() == champions
