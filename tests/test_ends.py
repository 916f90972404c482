"""Where a robot is at the last step: at its goal, at the wrong one, or elsewhere; by hand."""

import math
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from epuckhebb.analysis import end_charts, ends, findings
from epuckhebb.analysis.evaluate import COLUMNS
from epuckhebb.analysis.lifetimes import numeric
from epuckhebb.config import EvaluateConfig, load
from epuckhebb.tmaze.individual import GA, HEBBIAN, Individual
from epuckhebb.tmaze.life import Lifetime
from epuckhebb.tmaze.maze import SIDES, T_MAZE, Place, Pose
from epuckhebb.tmaze.outcome import End
from epuckhebb.tmaze.robot import STEP_S
from epuckhebb.tmaze.scenario import Scenario
from epuckhebb.tmaze.session import Session

LEFT, RIGHT = (T_MAZE.goals[side] for side in SIDES)
STEM = Place(0.007, -0.35)
MOVED = {"left": RIGHT, "right": LEFT}


def standing(place, side, world=None, steps=4):
    """The lifetime of a robot that stands still."""
    who = Individual(genes=np.zeros(234), side=side, key=np.uint64(1), start=Pose(*place, 1.0))
    session = Session(who, world or Scenario(), Lifetime(duration_s=8 * STEP_S))
    session.step(steps)
    return session


@pytest.mark.parametrize(
    ("place", "side", "changes", "end"),
    [
        (LEFT, "left", [], End.right),
        (RIGHT, "right", [], End.right),
        (LEFT, "right", [], End.wrong),
        (RIGHT, "left", [], End.wrong),
        (STEM, "left", [], End.elsewhere),
        (Place(LEFT.x + 0.049, LEFT.y), "right", [], End.wrong),
        (Place(LEFT.x + 0.051, LEFT.y), "right", [], End.elsewhere),
        (LEFT, "left", [{"at_s": 0.07, "goals": MOVED}], End.wrong),
        (LEFT, "right", [{"at_s": 0.07, "goals": MOVED}], End.right),
        (LEFT, "left", [{"at_s": 4 * STEP_S, "goals": MOVED}], End.right),  # after the last step
        (STEM, "right", [{"at_s": 0.07, "goals": {"left": STEM}}], End.wrong),
        (STEM, "right", [{"at_s": 0.07, "goals": {"left": STEM, "right": STEM}}], End.right),
        (STEM, "left", [{"at_s": 0.07, "put": [*RIGHT, 1.0]}], End.wrong),
    ],
)
def test_the_end_of_a_robot_that_stands(place, side, changes, end):
    outcome = standing(place, side, Scenario(changes=changes)).outcome()
    assert outcome.end is end
    assert outcome.success == (end is End.right)


def test_what_is_changed_after_the_last_step_does_not_move_the_end():
    session = standing(LEFT, "left")
    before = session.outcome()
    session.change(Scenario(goals=MOVED, put=Pose(*STEM, 1.0), maze=replace(T_MAZE, goal_radius_m=1e-9)))
    assert repr(session.outcome()) == repr(before)  # nan is not equal to itself
    session.step()
    assert session.outcome().end is End.elsewhere


@pytest.mark.parametrize(("place", "end"), [((-0.39, 0.25), End.right), ((0.39, 0.25), End.wrong)])
def test_the_two_dead_ends_between_the_goals_of_the_double_t_are_elsewhere(place, end):
    world = load(EvaluateConfig, ["maze=double_t"]).world
    assert standing(place, "left", world).outcome().end is end
    for x in (-0.07, 0.07):
        assert standing((x, 0.25), "left", world).outcome().end is End.elsewhere


def lifetimes(outcomes):
    """Lifetimes in light, from {(champion, scenario, controller): (ends on the left, on the right)}.

    A letter a repeat: r, w, e, or a for a robot that arrived and drove on.
    """
    names = {"r": "right", "w": "wrong", "e": "elsewhere", "a": "elsewhere"}
    rows = []
    for (genome, scenario, controller), sides in outcomes.items():
        for side, letters in zip(SIDES, sides, strict=True):
            for repeat, letter in enumerate(letters):
                row = dict.fromkeys(COLUMNS, "0") | {"genome": genome, "experiment": "light", "scenario": scenario}
                row |= {"controller": controller, "N": "0.0" if controller == GA else "0.002", "side": side}
                row |= {"repeat": str(repeat), "end": names[letter], "success": str(int(letter == "r"))}
                rows.append(row | {"time_to_goal_s": "60.0" if letter in "ra" else ""})
    return pd.DataFrame(rows)


ROWS = lifetimes(
    {
        # a: both sides solved; dimmed light breaks both, the rule drives it to the right end on both
        ("a", "highlight", GA): ("rrr", "rrr"),
        ("a", "lowlight", GA): ("www", "eee"),
        ("a", "highlight", HEBBIAN): ("rrr", "www"),
        ("a", "lowlight", HEBBIAN): ("rrr", "rra"),
        # b: the right is not solved; the left is broken, and the rule drives it to the wrong end
        ("b", "highlight", GA): ("rrw", "ree"),
        ("b", "lowlight", GA): ("rww", "rrr"),
        ("b", "highlight", HEBBIAN): ("rrr", "rrr"),
        ("b", "lowlight", HEBBIAN): ("wwr", "www"),
        # c: the left stays intact; no end has most of its repeats on the right, which arrives in most
        ("c", "highlight", GA): ("rrr", "rrr"),
        ("c", "lowlight", GA): ("rrr", "wwa"),
        ("c", "highlight", HEBBIAN): ("eee", "eee"),
        ("c", "lowlight", HEBBIAN): ("rrw", "raw"),
    }
)


def of(table, scenario, controller, **more):
    (row,) = table[
        (table[["scenario", "controller", *more]] == [scenario, controller, *more.values()]).all(axis=1)
    ].to_dict("records")
    return row


@pytest.mark.parametrize(
    ("letters", "end", "arrived"),
    [
        ("rrr", "right", True),
        ("rrw", "right", True),
        ("rwe", "elsewhere", False),
        ("rrww", "elsewhere", False),
        ("wwwra", "wrong", False),
        ("wwaaa", "elsewhere", True),
        ("raw", "elsewhere", True),
    ],
)
def test_a_trial_has_the_end_of_most_of_its_repeats(letters, end, arrived):
    rows = lifetimes({("g", "highlight", GA): (letters, "rr")})
    trial = ends.trials(rows).set_index("side").loc["left"]
    assert (trial.end, trial.arrived) == (end, arrived)


def test_the_fate_of_a_trial_is_that_without_plasticity():
    each = ends.trials(ROWS).set_index(["scenario", "controller", "genome", "side"]).sort_index().fate
    for controller in (GA, HEBBIAN):
        own = each.loc["lowlight", controller]
        assert own["a"].tolist() == ["broken", "broken"]
        assert own["b"].tolist() == ["broken", "unsolved"]
        assert own["c"].tolist() == ["intact", "broken"]
        assert each.loc["highlight", controller]["b"].tolist() == ["intact", "unsolved"]


def counts(row):
    return [row[name] for name in ("trials", "right", "wrong", "elsewhere", "arrived")]


def test_ends_by_hand():
    table = ends.tables(ROWS)["ends"]
    dim = {among: of(table, "lowlight", HEBBIAN, among=among) for among in ("all", "broken", "intact", "unsolved")}
    assert counts(dim["all"]) == [6, 3, 2, 1, 4]
    assert counts(dim["broken"]) == [4, 2, 1, 1, 3]
    assert counts(dim["intact"]) == [1, 1, 0, 0, 1]
    assert counts(dim["unsolved"]) == [1, 0, 1, 0, 0]
    assert counts(of(table, "lowlight", GA, among="broken")) == [4, 0, 3, 1, 0]
    assert dim["all"]["right_less_wrong"] == pytest.approx((2 - 2 + 1) / 3)
    assert dim["all"]["sign_flip_p"] == 1.0
    assert math.isnan(dim["all"]["right_less_wrong_low"])  # three champions are too few
    assert dim["broken"]["right_less_wrong"] == pytest.approx((2 - 1 + 0) / 3)
    assert (dim["intact"]["champions"], dim["intact"]["right_less_wrong"]) == (1, 1.0)
    assert set(table[table.scenario == "highlight"].among) == {"all", "intact", "unsolved"}


def test_another_champion_stands_in_for_each():
    """The rule of b runs in the trials of a, that of c in those of b, that of a in those of c."""
    table = ends.tables(ROWS)["ends"]
    assert counts(of(table, "lowlight", ends.OTHER, among="broken")) == [4, 2, 2, 0, 2]
    assert counts(of(table, "lowlight", ends.OTHER, among="intact")) == [1, 1, 0, 0, 1]
    assert not ((table.controller == ends.OTHER) & (table.among == "all")).any()


def test_draws_of_a_control_are_one():
    drawn = {("a", 0): ("r", "w"), ("b", 0): ("r", "r"), ("a", 1): ("e", "w"), ("b", 1): ("w", "r")}
    alone = {(genome, "highlight", GA): ("r", "r") for genome in "ab"}
    rows = lifetimes(alone | {(one, "highlight", f"shuffled_{k}"): letters for (one, k), letters in drawn.items()})
    one = {"sign": "shuffled"}
    draws = ends.draws([{"shuffled_0": one, "shuffled_1": {**one, "sign_draw": 1}}])
    row = of(ends.tables(rows, controls=draws)["ends"], "highlight", "shuffled", among="all")
    assert counts(row) == [4, 2, 1.5, 0.5, 2]
    assert (row["draws"], row["champions"], row["right_less_wrong"]) == (2, 2, ((0 - 1) / 2 + (2 + 0) / 2) / 2)
    assert set(ends.tables(rows, controls=draws)["ends_by_champion"].controller) == {GA, "shuffled_0", "shuffled_1"}
    one = rows[rows.controller != "shuffled_1"]
    assert "shuffled_0" in set(ends.tables(one, controls=draws)["ends"].controller)
    taken = rows.replace({"controller": {GA: "shuffled"}})
    assert set(ends.ends(ends.trials(taken), draws).controller) == {"shuffled", "shuffled_0", "shuffled_1"}


@pytest.mark.parametrize(
    ("compared", "merged"),
    [
        ([{"a_0": {"N": 0.1}, "a_1": {"N": 0.1, "sign_draw": 1}}], {"a_0": "a", "a_1": "a"}),
        ([{"leak_1": {"leak": 0.5}, "leak_2": {"leak": 0.9}}], {}),
        ([{"a_0": {"N": 0.1}, "a_1": {"N": 0.1}}, {"a_0": {"N": 0.1}, "a_1": {"N": 0.2}}], {}),
        ([{"a_0": {"N": 1}, "a_1": {"N": 1}, "a_2": {"N": 2}, "a_3": {"N": 2}}], {}),
        ([{"anti": {"sign": "anti"}}], {"anti": "anti"}),
    ],
)
def test_controls_are_draws_of_one_if_they_differ_in_their_draw_alone(compared, merged):
    assert ends.draws(compared) == merged


def test_discrimination_by_hand():
    row = of(ends.tables(ROWS)["discrimination"], "lowlight", HEBBIAN)
    assert [row[f"right_{name}"] for name in ("left", "right", "both", "expected")] == [2, 1, 1, 2 * 1 / 3]
    assert [row[f"wrong_{name}"] for name in ("left", "right", "both", "expected")] == [1, 1, 1, 1 / 3]


def test_all_can_be_recomputed_from_the_table_by_champion():
    tables = ends.tables(ROWS)
    own = tables["ends_by_champion"].set_index(["scenario", "controller", "genome"]).sort_index()
    own = own.loc["lowlight", HEBBIAN]
    assert own.loc["a", ["end_left", "end_right", "fate_left", "fate_right"]].tolist() == ["right"] * 2 + ["broken"] * 2
    row = of(tables["ends"], "lowlight", HEBBIAN, among="all")
    assert own[["right", "wrong", "elsewhere", "arrived"]].sum().tolist() == counts(row)[1:]
    broken = sum(((own[f"fate_{side}"] == "broken") & (own[f"end_{side}"] == "wrong")).sum() for side in SIDES)
    assert broken == of(tables["ends"], "lowlight", HEBBIAN, among="broken")["wrong"]


def test_the_intervals_of_many_champions():
    rng = np.random.default_rng(1)
    drawn = {name: ("".join(rng.choice(list("rwe"), 1)), "".join(rng.choice(list("rwe"), 1))) for name in range(40)}
    rows = lifetimes({(str(name), "highlight", GA): letters for name, letters in drawn.items()})
    row = of(ends.tables(rows)["ends"], "highlight", GA, among="all")
    less = np.array([sum((letter == "r") - (letter == "w") for letter in letters) for letters in drawn.values()])
    assert row["right_less_wrong"] == less.mean()
    for name, level in (("", 0.95), ("_90", 0.9)):
        drawn = stats.bootstrap((less,), np.mean, confidence_level=level, method="percentile", rng=1)
        found = drawn.confidence_interval
        assert row[f"right_less_wrong{name}_low"] == pytest.approx(found.low, abs=0.03)
        assert row[f"right_less_wrong{name}_high"] == pytest.approx(found.high, abs=0.03)
    p = stats.permutation_test((less,), np.sum, permutation_type="samples", n_resamples=9999, rng=1).pvalue
    assert row["sign_flip_p"] == pytest.approx(p, abs=0.02)


def test_settings_tell_conditions_apart():
    noisy = [ROWS.assign(**{"lifetime.noise": noise, "hebbian.floor": floor}) for noise in "01" for floor in "ab"]
    rows = pd.concat(noisy, ignore_index=True)
    rows = rows[(rows.controller != GA) | (rows["hebbian.floor"] == "a")]
    rows.loc[rows.controller == GA, "hebbian.floor"] = "any"
    table = ends.tables(rows, ["scenario", "genome", "N", "lifetime.noise", "hebbian.floor"])["ends"]
    own = table[(table.scenario == "lowlight") & (table.controller == HEBBIAN) & (table.among == "broken")]
    assert (own["lifetime.noise"] + own["hebbian.floor"]).tolist() == ["0a", "0b", "1a", "1b"]
    assert set(own.trials) == {4}


def test_without_the_training_world_there_is_no_fate():
    dim = ROWS[ROWS.scenario == "lowlight"]
    assert set(ends.tables(dim)["ends"].among) == {"all"}
    assert set(ends.tables(ROWS, ["light"])["ends"].among) == {"all"}


def test_rescue_stands_beside_the_ends_of_the_broken():
    each = findings.trials(numeric(ROWS))
    for table in (findings.rescue_and_harm(each), findings.rescue_totals(findings.rescue_by_champion(each))):
        assert table.iloc[-1][list(findings.COUNTS[:5])].tolist() == [4, 2, 1, 1, 3]


def test_the_picture_has_a_bar_of_all_trials_for_each_controller():
    figure = end_charts.ends(ends.tables(ROWS)["ends"])
    bright, dim = figure.axes
    assert bright.get_title() == "bright light (training)\nn = 6 trials"
    assert [label.get_text() for label in bright.get_yticklabels()] == ["no plasticity", "paper's rule"]
    widths = np.array([[bar.get_width() for bar in bars] for bars in dim.containers])  # (ends, controllers)
    assert widths * 6 == pytest.approx(np.array([[2, 3], [3, 2], [1, 1]]))
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["right end", "wrong end", "elsewhere"]


def test_the_picture_begins_a_row_for_each_experiment_and_names_what_differs():
    other = ROWS.assign(experiment="obstacles", scenario="base")
    rows = pd.concat([ROWS[ROWS.scenario == "lowlight"], other[ROWS.scenario == "lowlight"]], ignore_index=True)
    rows = pd.concat([rows.assign(task=name) for name in "xy"], ignore_index=True)
    light, obstacles = end_charts.ends(ends.tables(rows, ["task"])["ends"]).axes
    assert obstacles.get_title().startswith("no obstacles (training)")
    names = [label.get_text() for label in light.get_yticklabels()]
    assert names == ["no plasticity, task x", "paper's rule, task x", "no plasticity, task y", "paper's rule, task y"]
