"""Many evaluations in one table: each lifetime once, each genome under a name of its own, each idea in one column."""

import re
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from cases import done

import epuckhebb
from epuckhebb.analysis import summary, tables
from epuckhebb.analysis.evaluate import COLUMNS, _metrics
from epuckhebb.analysis.lifetimes import Evaluated, gather
from epuckhebb.analysis.statistics import bootstrap, mean
from epuckhebb.config.compose import composed
from epuckhebb.config.schema import EvaluateConfig, typed
from epuckhebb.controller.plasticity.rule import Rule
from epuckhebb.runs import evaluate
from epuckhebb.runtime import conf
from epuckhebb.store.genome import load_genome
from epuckhebb.tmaze.individual import Controller
from epuckhebb.tmaze.life import Lifetime
from epuckhebb.tmaze.outcome import Outcome

UNREADABLE = object()
SHORT = ["lifetime.duration_s=0.064", "repeats=1", "lifetime.record_every=0"]
BRIEF = {"lifetime": {"duration_s": 0.064}, "repeats": 1, "progress": False}


def evaluated(genome="g", sha="0", rate="0.1", seed="1", scenario="base", where=None, n=1, repeats=2, **settings):
    """An evaluation by the GA and by the paper's rule; with the rule `n` of the repeats succeed on either side."""
    same = {**dict.fromkeys(COLUMNS, "0"), "genome": genome, "scenario": scenario, "changed": "", "seed": seed}
    same |= {"experiment": "obstacles", "signal": ""}
    rows = [
        {**same, "controller": name, "N": N, "side": side, "repeat": str(k), "success": str(int(name == "GA" or k < n))}
        for name, N in (("GA", "0.0"), ("Hebbian", rate))
        for side in ("left", "right")
        for k in range(repeats)
    ]
    floor = settings.get("hebbian.floor", "")
    return Evaluated(
        settings={"hebbian.N": rate, "seed": seed, "scenario": scenario, "genome": where or genome, **settings},
        sha256=sha,
        ids={"GA": f"{sha}{scenario}", "Hebbian": f"{sha}{scenario}{float(rate)}{floor}"},
        rows=pd.DataFrame(rows),
    )


@pytest.mark.parametrize("other", [{}, {"rate": "1e-1"}, {"genome": "reference_20"}])
def test_a_lifetime_in_two_evaluations_counts_once(other):
    found = gather([evaluated(), evaluated(**other), evaluated(**other)])
    assert len(found.rows) == 8
    assert set(found.rows.genome) == {"g"}
    assert set(summary.summary(found.rows, found.settings).n) == {2}


def test_evaluations_with_lifetimes_of_their_own_repeat_nothing():
    found = gather([evaluated(), evaluated(rate="0.2"), evaluated(seed="2"), evaluated(repeats=3)])
    assert len(found.rows) == 8 + 4 + 8 + 4


def test_genomes_of_one_name_get_names_that_differ():
    found = gather([evaluated("champion", "aaaa"), evaluated("champion", "bbbb"), evaluated("other", "cccc")])
    assert list(found.rows.genome.unique()) == ["champion_aaaa", "champion_bbbb", "other"]


def test_each_idea_has_one_column_and_the_genes_alone_have_a_value():
    each = [evaluated(**{"hebbian.floor": floor, "lifetime.noise": "0"}) for floor in ("0.1", "0.3")]
    found = gather(each)
    assert list(found.rows) == ["hebbian.floor", "lifetime.noise", *COLUMNS]
    assert found.settings == ["N", "scenario", "genome", "hebbian.floor", "lifetime.noise"]
    sizes = found.rows.groupby(["controller", "hebbian.floor", "N"]).size()
    assert sizes.to_dict() == {("GA", "any", "0.0"): 4, ("Hebbian", "0.1", "0.1"): 4, ("Hebbian", "0.3", "0.1"): 4}


def test_a_key_that_is_left_out_is_no_condition():
    assert "~compare" not in gather([evaluated(**{"~compare": ""})]).settings


def lived(genome, controller="abcd", change="", typed=None, **config):
    """An evaluation in an environment, of one lifetime. config: its settings by group."""
    row = {"genome": genome, "environment": "room", "change": change, "controller": controller, "N": "0.05"}
    rows = pd.DataFrame([row | {"repeat": "0", "seed": "1"}])
    settings = {"genome": genome, **(typed or {})}
    return Evaluated(
        settings=settings, sha256=genome, ids={controller: genome}, rows=rows, config=dict(conf.flat(config))
    )


def test_settings_that_champions_bring_along_tell_conditions_apart():
    first = lived("a", hebbian={"leak": 0.0, "N": 0.05}, environment={"horizon": 60, "loops": 1}, seed=1)
    other = lived("b", hebbian={"leak": 0.3, "N": 0.01}, environment={"horizon": 60, "loops": 2, "options": {"x": 1}})
    found = gather([first, other])
    assert found.settings == ["genome", "hebbian.leak", "N", "environment.options.x"]
    assert found.rows[["hebbian.leak", "environment.options.x"]].to_numpy().tolist() == [["0.0", ""], ["0.3", "1"]]


def test_other_controllers_are_told_apart_by_their_name_and_the_world_alone():
    first = lived("a", hebbian={"leak": 0.0}, network={"layers": None}, environment={"horizon": 60})
    other = lived("b", "oja", hebbian={"leak": 0.3}, network={"layers": [2]}, environment={"horizon": 90})
    assert gather([first, other]).settings == ["genome", "environment.horizon"]


def test_what_follows_from_a_setting_that_was_typed_has_no_column():
    each = [lived("a", typed={"task": task}, environment={"horizon": task}) for task in "xy"]
    assert gather(each).settings == ["genome", "task"]


def test_changes_of_one_name_are_told_apart():
    each = [
        lived("a", change=text, typed={"environment.changes": file}, environment={"changes": [{"function": file}]})
        for file, text in (("a.py:shock", "shock at 20"), ("b.py:shock", "shock at 20"), ("b.py:calm", "calm at 20"))
    ]
    rows = gather([replace(one, ids={"abcd": str(place)}) for place, one in enumerate(each)]).rows
    assert rows.change.nunique() == 3
    assert "calm at 20" in set(rows.change)


def test_intervals_are_over_champions():
    found = gather([evaluated(name, name, n=n) for name, n in zip("abcdef", (2, 1, 0, 2, 1, 0), strict=True)])
    over = summary.champion_means(found.rows, found.settings).set_index(["controller", "side"])
    assert set(over.champions) == {6}
    assert over.success["Hebbian", "left"] == 0.5
    assert 0 < over.success_low["Hebbian", "left"] < 0.5 < over.success_high["Hebbian", "left"] < 1
    share, *ends = over.filter(like="saturated_fraction").loc["Hebbian", "left"]
    assert share == 0
    assert np.isnan(ends).all()  # they agree: nothing is known of the width


@pytest.mark.parametrize(
    ("scenarios", "more", "counted"),
    [
        (["4obstacles"], {}, False),
        (["base"], {}, False),
        (["base", "4obstacles"], {}, True),
        (["base", "4obstacles"], {"lifetime.noise": "01"}, False),
    ],
)
def test_rescue_and_harm_are_counted_where_each_champion_ran_once_in_its_training_world(scenarios, more, counted):
    each = [
        evaluated(name, f"{name}{value}", scenario=scenario, rate=rate, **({key: value} if key else {}))
        for name in "abcdef"
        for scenario in scenarios
        for rate in ("0.1", "0.2")
        for key, values in (more or {"": "0"}).items()
        for value in values
    ]
    rows, *_ = gather(each)
    if more:
        rows["genome"] = rows.genome.str[0]
    assert counted == (summary.rescue_and_harm(rows) is not None)


def test_the_repeats_of_a_trial_are_those_of_all_seeds():
    """Two seeds with two repeats each."""
    each = [
        evaluated(name, f"{name}{seed}", scenario=scenario, seed=seed)
        for name in "abcdef"
        for scenario in ("base", "4obstacles")
        for seed in "12"
    ]
    rows, *_ = gather(each)
    rows["genome"] = rows.genome.str[0]
    _, page = summary.rescue_and_harm(rows)
    assert re.findall(r"of its (\d+) repeats", page) == ["4"]


def ids(*words, genome="reference"):
    config = typed(composed("evaluate", list(words)), EvaluateConfig)
    return evaluate.prepare_evaluation(config, load_genome(genome, "obstacles")).lifetime_ids


def test_lifetimes_are_known_by_all_that_they_depend_on():
    one = ids("hebbian.N=0.001", "lifetime.record_every=0")
    assert one == ids("hebbian.N=1e-3", "lifetime.record_every=8", "seed=2", "repeats=3")
    assert one == ids("hebbian.N=1e-3", genome="reference_20")
    for other, shared in (
        (ids("hebbian.N=0.002"), {"GA"}),
        (ids("hebbian.N=0.001", "lifetime.noise=0"), set()),
        (ids("hebbian.N=0.001", "scenario.light=0.2"), set()),
        (ids("hebbian.N=0.001", genome="reference_1"), set()),
    ):
        assert {name for name in one if one[name] == other[name]} == shared


class Unreadable(Rule):
    @staticmethod
    def synapse(pre):
        return pre * UNREADABLE


def test_a_rule_of_which_a_part_cannot_be_read_has_lifetimes_that_are_known():
    config = replace(
        typed(composed("evaluate", []), EvaluateConfig), tested=[Controller(name="odd", rule=Unreadable(N=0.1))]
    )
    found = evaluate.PreparedEvaluation(config=config, genome=load_genome("reference", "obstacles")).lifetime_ids
    assert list(found) == ["GA", "odd"]


def test_reversal_learning_has_a_rewarded_share_and_no_success():
    each = [
        evaluated(name, name, scenario=scenario, rate=rate)
        for name in "abcdef"
        for scenario in ("base", "4obstacles")
        for rate in ("0.1", "0.2")
    ]
    rows, settings = gather(each)
    rows["rewarded_share"] = ["0.4" if name < "d" else "0.8" for name in rows.genome]
    over = summary.champion_means(rows, settings)
    assert over.rewarded_share.tolist() == pytest.approx([0.6] * len(over))
    assert over.rewarded_share_low.between(0.4, 0.6, inclusive="left").all()
    (shown,) = summary.readable({"over_champions": over})
    assert "[" in next(iter(shown.rows))[-1]  # the interval that the title names
    assert summary.dose_response(rows, settings) is summary.rescue_and_harm(rows) is None


def test_python_and_the_command_line_make_the_same_columns(here):
    for name, seed in (("x1", 1), ("x2", 2)):
        (here / name).mkdir()
        np.save(here / name / "champion.npy", epuckhebb.load(f"reference_{seed}"))
    genomes = ["x1/champion.npy", "x2/champion.npy"]
    words = [f"genome={','.join(genomes)}", "hebbian.floor=0.1,0.3", "-q"]
    done("evaluate", "-m", *SHORT, *words, "hydra.sweep.dir=out")
    over = {"genome": genomes, "hebbian.floor": [0.1, 0.3]}
    table = epuckhebb.sweep(over=over, **BRIEF)
    assert list(table) == ["hebbian.floor", *COLUMNS]
    assert len(table) == 2 * 2 * (1 + 2)  # champions, sides; the GA once, the rule with both floors
    assert table.genome.nunique() == 2
    written = pd.read_csv(here / "out" / "summary.csv")
    assert set(written.n) == {1}
    by = ["genome", "scenario", "controller", "hebbian.floor", "side"]
    ours = table.astype({"hebbian.floor": str}).groupby(by).size()
    assert ours.to_dict() == written.groupby(by).size().to_dict()
    assert set(pd.read_csv(here / "out" / "over_champions.csv").champions) == {2}


def test_values_of_a_sweep_that_are_repeated_count_once():
    arrays = [epuckhebb.load("reference_1"), epuckhebb.load("reference_2")]
    table = epuckhebb.sweep(over={"genome": arrays, "hebbian.N": [0.001, 1e-3]}, **BRIEF)
    assert len(table) == 2 * 2 * 2
    assert table.genome.nunique() == 2


def test_intervals_of_one_champion_are_over_its_lifetimes():
    """Wilson's, with z = 1.96, of 3 successes of 10; a bootstrap of the others."""
    rows = pd.DataFrame({"genome": "a", "success": [1.0] * 3 + [0.0] * 7, "weight_change_mean": np.arange(10.0)})
    found = summary._means(rows.assign(saturated_fraction=0.0), several=False)
    z, n, p = 1.959964, 10, 0.3
    middle, half = p + z**2 / (2 * n), z * np.sqrt(p * (1 - p) / n + z**2 / (4 * n**2))
    ends = ((middle - half) / (1 + z**2 / n), (middle + half) / (1 + z**2 / n))
    assert (found["success_low"], found["success_high"]) == pytest.approx(ends, abs=1e-6)
    assert (found["champions"], found["lifetimes"], found["weight_change_mean"]) == (1, 10, 4.5)
    assert (found["weight_change_mean_low"], found["weight_change_mean_high"]) == bootstrap(mean, np.arange(10.0))


def test_the_average_speed_of_a_lifetime_that_ends_early_is_over_its_own_time():
    outcome = Outcome(*(0.0,) * len(Outcome._fields))._replace(path_length=2.0, steps=1000)
    lifetime = Lifetime(duration_s=64.0)
    assert _metrics(outcome, lifetime)["average_speed_m_s"] == 2.0 / 32.0
    assert _metrics(outcome._replace(steps=2000), lifetime)["average_speed_m_s"] == 2.0 / 64.0


def test_headings_leave_out_the_groups_of_keys_unless_two_are_then_alike():
    assert tables.short_headings(["hebbian.leak", "environment.horizon"]) == ["leak", "horizon"]
    assert tables.short_headings(["hebbian.N", "network.N"]) == ["hebbian.N", "network.N"]
