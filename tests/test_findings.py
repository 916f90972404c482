"""The statistics of the study, on cases small enough to count by hand."""

import math
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from epuckhebb.analysis import claims, findings, published
from epuckhebb.analysis.page import study_page
from epuckhebb.analysis.statistics import (
    RESAMPLES,
    bootstrap,
    difference,
    holm,
    improvement,
    interquartile_mean,
    interval_title,
    mean,
    performance_profile,
    permutation,
    sign_flip,
    wilson,
    wilson_by_champion,
)
from epuckhebb.runtime.resources import data_folder
from epuckhebb.tmaze.individual import GA, HEBBIAN


@pytest.mark.parametrize(("k", "n"), [(20, 20), (0, 10), (7, 22)])
def test_wilson(k, n):
    assert wilson(k / n, n) == pytest.approx(stats.binomtest(k, n).proportion_ci(0.95, "wilson"))


def test_no_trials_no_interval():
    assert all(map(math.isnan, wilson(0, 0)))


def width(interval):
    low, high = interval
    return high - low


@pytest.mark.parametrize(
    ("differences", "p"),
    [
        ([], 1.0),
        ([0, 0, 0], 1.0),
        ([2], 1.0),  # one champion: + or -, both as far from 0
        ([2, 1], 2 / 4),  # sums 3, 1, -1, -3: two of four as far as 3
        ([2, -1], 4 / 4),
        ([2, 2, -1, 0], 4 / 8),  # sums 5, 3, 1, -1, 1, -1, -3, -5: four of eight as far as 3
        ([-2] * 5, 2 / 32),  # ten trials agree, but they are five champions: 2/1024 would be McNemar's
        ([1] * 6, 2 / 64),
    ],
)
def test_sign_flip_by_hand(differences, p):
    assert sign_flip(np.array(differences, int)) == p


def test_sign_flip_agrees_with_scipy_and_is_exact_for_many():
    differences = np.array([2, 1, -1, 0, 2, -2, 1, 1, 2])
    expected = stats.permutation_test((differences,), np.sum, permutation_type="samples", n_resamples=2**9).pvalue
    assert sign_flip(differences) == pytest.approx(expected)
    assert sign_flip(np.full(60, 2)) == 2 / 2**60


def difference_in_mean(ours, others, axis):
    return ours.mean(axis) - others.mean(axis)


@pytest.mark.parametrize("champions", [8, 30])
def test_of_other_than_whole_numbers_p_is_listed_or_drawn(champions):
    ours, others = np.random.default_rng(champions).normal([[0.4], [0.0]], 1.0, (2, champions))
    for own, test, kind in (
        (sign_flip(ours - others), ((ours - others,), np.mean), "samples"),
        (permutation(ours, others), ((ours, others), difference_in_mean), "independent"),
    ):
        expected = stats.permutation_test(*test, permutation_type=kind, n_resamples=20000, rng=1).pvalue
        assert own == pytest.approx(expected, abs=1e-12 if champions == 8 else 0.01)
    if champions == 30:  # too many choices: drawn ones, and the observed
        assert sign_flip(np.full(30, 0.5)) == permutation(np.full(30, 0.5), np.full(30, -9.5)) == 1 / (RESAMPLES + 1)
        assert sign_flip(np.full(30, 2.0)) == 2 / 2**30


def test_equal_sums_of_fractions_are_as_far():
    thirds = np.array([0.1, 0.2, -0.3, 0.7])  # .1 + .2 is not .3 in binary
    assert sign_flip(thirds) == sign_flip(np.rint(10 * thirds).astype(int))
    assert permutation(thirds[:2], thirds[2:]) == permutation(*np.rint(10 * thirds).astype(int).reshape(2, 2))


def test_permutation_of_two_groups():
    assert permutation(np.array([3, 4, 5]), np.array([0, 1, 2])) == 2 / math.comb(6, 3)  # none overlaps
    assert permutation(np.array([1, 1]), np.array([1, 1, 1])) == 1.0
    ours, others = np.array([3, 5, 2, 8, 1, 7]), np.array([1, 2, 2, 3, 9, 0])
    assert permutation(ours, others) == pytest.approx(
        stats.permutation_test((ours, others), difference_in_mean, n_resamples=1000).pvalue
    )


def test_holm_by_hand():
    assert holm([0.01, math.nan, 0.04, 0.03]) == pytest.approx([0.03, math.nan, 0.06, 0.06], nan_ok=True)
    assert holm([0.5, 0.9]).tolist() == [1.0, 1.0]


def test_one_trial_from_each_champion_is_wilson():
    assert wilson_by_champion(np.array([1] * 3 + [0] * 17), np.ones(20, int)) == pytest.approx(wilson(3 / 20, 20))


def test_an_interval_by_hand():
    # 9 of 12 by six champions, with one of 2 trials more, half of it 2 of 2 and half 0 of 2: 10 of 14. 5/7 of 2 is
    # 10/7. Three champions are off by 4/7, three by -3/7, the halves of one by 4/7 and -10/7
    squares = 3 * (4 / 7) ** 2 + 3 * (3 / 7) ** 2 + ((4 / 7) ** 2 + (10 / 7) ** 2) / 2
    effect = 7 / 6 * squares / 14**2 / (5 / 7 * 2 / 7 / 13)
    assert effect == pytest.approx(1.0292, abs=1e-4)
    found = wilson_by_champion(np.array([2, 2, 2, 1, 1, 1]), np.full(6, 2))
    assert found == pytest.approx(wilson(0.75, 12 / effect))


@pytest.mark.parametrize("champions", [6, 20, 40])
@pytest.mark.parametrize("trials", [2, 25])
def test_one_success_more_moves_an_interval_up(champions, trials):
    """None of 1,021 was once [0, .09] and 4 of 1,021 [0, .01]: two methods for two cases."""
    whole, part, before = np.full(champions, trials), np.zeros(champions, int), (-1.0, -1.0)
    for k in range(trials):
        part[0] = k
        low, high = wilson_by_champion(part, whole)
        assert low >= before[0]
        assert high >= before[1] - 0.02  # champions that differ more are worth less
        before = (low, high)


@pytest.mark.parametrize("share", [0.05, 0.5, 0.9])
@pytest.mark.parametrize("alike", [0.01, 0.3])
@pytest.mark.parametrize(("champions", "trials"), [(6, 2), (12, 20), (40, 2)])
def test_the_interval_covers_the_share(champions, trials, alike, share):
    rng, covered = np.random.default_rng(champions + trials), 0
    a, b = share * (1 / alike - 1), (1 - share) * (1 / alike - 1)
    for _ in range(400):
        part = rng.binomial(trials, rng.beta(a, b, champions))
        low, high = wilson_by_champion(part, np.full(champions, trials))
        covered += low <= share <= high
    assert covered / 400 > 0.91  # 95 %, less what few champions cost and two standard errors of 400 draws


CHAMPIONS = st.lists(
    st.integers(0, 4).flatmap(lambda whole: st.tuples(st.integers(0, whole), st.just(whole))), min_size=1, max_size=25
)


@given(CHAMPIONS)
def test_an_interval_holds_its_share_and_is_never_surer_than_independent_trials(champions):
    part, whole = np.array(champions).T
    if (whole > 0).sum() < 6:
        assert all(map(math.isnan, wilson_by_champion(part, whole)))
        return
    share = part.sum() / whole.sum()
    low, high = wilson_by_champion(part, whole)
    assert 0 <= low <= share <= high <= 1
    assert high - low >= width(wilson(share, int(whole.sum()))) - 1e-9


@given(st.lists(st.integers(0, 1), min_size=6, max_size=40), st.integers(2, 5))
def test_sides_alike_do_not_narrow_an_interval_nor_a_p_value(outcomes, copies):
    part, whole = np.array(outcomes), np.ones(len(outcomes), int)
    one, many = wilson_by_champion(part, whole), wilson_by_champion(part * copies, whole * copies)
    assert many[0] <= one[0] + 1e-9
    assert many[1] >= one[1] - 1e-9
    assert sign_flip(part * copies) == sign_flip(part)


def test_bootstrap_covers_the_mean():
    low, high = bootstrap(mean, np.random.default_rng(0).normal(3, 1, 50), seed=1)
    assert low < 3 < high
    assert high - low == pytest.approx(2 * 1.96 / math.sqrt(50), rel=0.25)


def test_a_bootstrap_knows_nothing_of_few_or_of_equals():
    for values in (np.ones(20), np.arange(5.0), np.array([1.0, np.nan, 2, 3, 4, 5])):
        assert all(map(math.isnan, bootstrap(mean, values)))
    low, high = bootstrap(difference, np.arange(12.0), np.arange(8.0))
    assert low < 2 < high


def test_another_seed_moves_an_interval_little():
    values = np.random.default_rng(5).normal(size=12)
    ends = np.array([bootstrap(mean, values, seed=seed) for seed in range(20)])
    assert ends.std(axis=0).max() < 0.01 * width(ends.mean(axis=0))


def test_the_interval_of_a_mean_is_that_of_its_resamples():
    values = np.random.default_rng(5).normal(size=30)
    assert bootstrap(mean, values) == pytest.approx(bootstrap(lambda drawn: drawn.mean(axis=-1), values), abs=1e-12)


def test_aggregates_are_those_of_rliable():
    """Numbers of rliable-fork 1.2.0: of its interquartile mean, probability of improvement and performance profile.

    Its scores are (runs, tasks); a champion is a run, and its success over all test worlds is the one task.
    """
    champions = pd.read_csv(Path(__file__).parents[1] / "runs" / "reference" / "leaderboard" / "champions.csv")
    champions["share"] = champions.successes / champions.trials
    scores = {key: own.share.to_numpy() for key, own in champions.groupby(["experiment", "method"])}
    for row in yaml.safe_load((Path(__file__).parent / "data" / "rliable.yaml").read_text()):
        ours = scores[row["experiment"], row["method"]]
        others = scores[row["experiment"], row["other"]]
        assert interquartile_mean(ours) == pytest.approx(row["iqm"], abs=1e-12)
        assert improvement(ours, others) == pytest.approx(row["improvement"], abs=1e-12)
        exceed = performance_profile(ours, np.array([0.25, 0.5, 0.75]))
        assert exceed.tolist() == pytest.approx(row["exceed"], abs=1e-12)


def lifetimes(outcomes, repeats=3):
    """Metrics of lifetimes from {(champion, scenario, controller, N): (successes left, right)} of the repeats."""
    rows = []
    for (genome, scenario, controller, rate), sides in outcomes.items():
        for side, successes in zip(("left", "right"), sides, strict=True):
            for repeat in range(repeats):
                succeeds = repeat < successes
                rows.append(
                    {"genome": genome, "experiment": "obstacles", "scenario": scenario, "controller": controller}
                    | {"end": "right" if succeeds else "wrong"}
                    | {"N": rate, "side": side, "repeat": repeat, "success": int(succeeds)}
                    | {"time_to_goal_s": 100.0 if succeeds else math.nan, "path_length_m": 1.0}
                    | {"final_position_error_m": 0.03 if succeeds else 0.3, "weight_change_mean": 3.0 * (rate > 0)}
                )
    return pd.DataFrame(rows)


N = 0.000015
EACH = findings.trials(
    lifetimes(
        {
            # a: solved on both sides; 4 obstacles break the left, plasticity rescues it and harms the right
            ("a", "base", GA, 0.0): (3, 2),
            ("a", "base", HEBBIAN, N): (3, 3),
            ("a", "2obstacles", GA, 0.0): (3, 3),
            ("a", "2obstacles", HEBBIAN, N): (3, 3),
            ("a", "4obstacles", GA, 0.0): (1, 3),
            ("a", "4obstacles", HEBBIAN, N): (2, 0),
            # b: the right is not solved, so nothing of it can be broken; the left is broken and stays so
            ("b", "base", GA, 0.0): (3, 1),
            ("b", "base", HEBBIAN, N): (0, 3),
            ("b", "2obstacles", GA, 0.0): (3, 0),
            ("b", "2obstacles", HEBBIAN, N): (3, 3),
            ("b", "4obstacles", GA, 0.0): (0, 0),
            ("b", "4obstacles", HEBBIAN, N): (0, 3),
        }
    )
)


def test_a_trial_succeeds_if_most_of_its_repeats_do():
    own = EACH[(EACH.genome == "a") & (EACH.scenario == "4obstacles")].set_index(["controller", "side"])
    assert own.succeeds.to_dict() == {
        (GA, "left"): False,
        (GA, "right"): True,
        (HEBBIAN, "left"): True,
        (HEBBIAN, "right"): False,
    }


def test_a_trial_in_which_half_of_the_repeats_succeed_fails():
    half = {
        ("a", "base", GA, 0.0): (10, 5),
        ("a", "base", HEBBIAN, N): (10, 10),
        ("a", "4obstacles", GA, 0.0): (5, 10),
        ("a", "4obstacles", HEBBIAN, N): (6, 5),
    }
    each = findings.trials(lifetimes(half, 10))
    assert list(each.succeeds) == [True, False, True, True, False, True, True, False]
    found = findings.rescue_and_harm(each).set_index("scenario").loc["4obstacles"]
    assert found[["solved", "broken", "rescued", "intact", "harmed"]].tolist() == [1, 1, 1, 0, 0]


def test_rescue_and_harm_by_hand():
    found = findings.rescue_and_harm(EACH).set_index("scenario")
    counts = found[["solved", "broken", "rescued", "intact", "harmed"]]
    assert counts.loc["base"].tolist() == [3, 0, 0, 3, 1]
    assert counts.loc["2obstacles"].tolist() == [3, 0, 0, 3, 0]
    assert counts.loc["4obstacles"].tolist() == [3, 2, 1, 1, 1]
    assert math.isnan(found.rescued_share["base"])
    assert found.difference["4obstacles"] == pytest.approx((0 + 0.5) / 2)  # a: +1 -1, b: 0 +1
    assert found.sign_flip_p["4obstacles"] == 1.0  # a: +1 -1 = 0, b: 0 +1 = 1
    assert found.sign_flip_p["base"] == 1.0  # a: 0, b: -1 +1 = 0
    assert found[["rescued_low", "harmed_high", "difference_low"]].isna().all(axis=None)  # two champions are too few


def six_of(each):
    """The champions of a table three times over, under other names."""
    return pd.concat([each.assign(genome=each.genome + str(copy)) for copy in range(3)], ignore_index=True)


def test_intervals_of_six_champions():
    found = findings.rescue_and_harm(six_of(EACH)).set_index("scenario")
    broken = wilson_by_champion(np.array([1, 0] * 3), np.array([1, 1] * 3))
    assert tuple(found.loc["4obstacles", ["rescued_low", "rescued_high"]]) == broken == pytest.approx(wilson(0.5, 6))
    assert found.difference["4obstacles"] == pytest.approx(0.25)
    assert 0 < found.difference_low["4obstacles"] < 0.25 < found.difference_high["4obstacles"]
    assert found[["rescued_low", "rescued_high"]].loc["base"].isna().all()


def test_rescue_over_all_changed_worlds_by_hand():
    by_champion = findings.rescue_by_champion(EACH)
    b = by_champion[(by_champion.genome == "b") & (by_champion.controller == HEBBIAN)].iloc[0]
    assert (b.solves, b.training_harmed, b.broken, b.rescued, b.intact, b.harmed) == (1, 1, 1, 0, 1, 0)
    (found,) = findings.rescue_totals(by_champion).to_dict("records")
    assert (found["broken"], found["rescued"], found["intact"], found["harmed"]) == (2, 1, 4, 1)
    assert (found["training_solved"], found["training_harmed"]) == (3, 1)
    assert (found["rescued_share"], found["harmed_share"]) == (0.5, 0.25)
    assert findings.changed(EACH, "obstacles") == ["2obstacles", "4obstacles"]


def test_success_counts_champions():
    found = findings.success(EACH).set_index(["scenario", "controller", "side"])
    assert tuple(found.loc[("base", GA, "right"), ["successes", "n"]]) == (1, 2)
    six = findings.success(six_of(EACH)).set_index(["scenario", "controller", "side"])
    assert tuple(six.loc[("base", GA, "right"), ["low", "high"]]) == pytest.approx(wilson(0.5, 6))
    assert tuple(found.loc[("base", GA, "both"), ["successes", "n"]]) == (1, 2)
    assert tuple(found.loc[("2obstacles", HEBBIAN, "both"), ["successes", "gained"]]) == (2, 1)  # b, with plasticity
    assert tuple(found.loc[("4obstacles", HEBBIAN, "left"), ["successes", "gained"]]) == (1, 1)
    assert not found.xs(GA, level="controller").gained.any()


@pytest.fixture(scope="module")
def paper():
    return yaml.safe_load((data_folder("conf") / "paper" / "tables.yaml").read_text())


def test_claims_by_hand(paper):
    found = claims.claims(EACH, published.published_values(paper)).set_index("claim")
    assert tuple(found.loc["4 obstacles defeat the GA", ["true", "n"]]) == (2, 3)
    assert tuple(found.loc["N = 1.5e-05 rescues it at 4", ["true", "n"]]) == (1, 2)
    assert tuple(found.loc["Weight change grows with obstacles", ["true", "n"]]) == (0, 4)
    unchanged = found.loc["The genome is unchanged after a lifetime"]
    assert unchanged.verdict == "check passed"
    assert math.isnan(unchanged.low)  # it is no statistic
    assert found.verdict["N = 1.5e-05 rescues it at 2"] == "no trial to judge by"
    assert found.verdict["N = 1.5e-05 rescues it at 4"] == "too few (n = 2, 2 champions)"
    assert found.paper_effect["Plasticity reaches the goal sooner"] == pytest.approx(-10.14, abs=0.01)


def trial_values(by_champion):
    """A series of trials, indexed as those of `findings`, from {champion: (left, right)}."""
    index = [(genome, side) for genome in by_champion for side in ("left", "right")]
    values = [value for sides in by_champion.values() for value in sides]
    return pd.Series(values, pd.MultiIndex.from_tuples(index, names=["genome", "side"]))


@pytest.mark.parametrize(
    ("changes", "verdict"),
    [
        ([-12, -9, -11, -8, -10, -13, -9], "holds"),
        ([-3, -2, -4, -3, -1, -2, -3], "holds, smaller"),  # less than 10 %
        ([-2, 1, -1, 2, -3, 1, 0], "does not hold"),
        ([-30, 20, -25, 15, 10, -20, -9], "inconclusive (n = 7)"),
        ([5, 6, 4, 5, 7, 6, 5], "does not hold"),
        ([-12, -9, -11], "too few (n = 3, 3 champions)"),
    ],
)
def test_a_claim_with_a_size_is_judged_by_its_effect(changes, verdict):
    before = trial_values({f"c{k}": (50.0, math.nan) for k in range(len(changes))})
    after = trial_values({f"c{k}": (50 * (1 + change / 100), 70.0) for k, change in enumerate(changes)})
    found = claims.effect(before, after, -10.0, before)
    assert found["verdict"] == verdict
    assert found["effect"] == pytest.approx(np.mean(changes))
    assert found["effect_absolute"] == pytest.approx(np.mean(changes) / 2)
    assert found["control_effect"] == 0


def test_sides_of_a_champion_are_one_piece_of_evidence():
    part, whole = np.array([2, 2, 0, 2, 2, 0, 2]), np.array([2, 2, 1, 2, 2, 2, 2])
    row = claims.claim("", "", part, whole, control=part // 2)
    assert (row["true"], row["n"], row["champions"]) == (10, 13, 7)
    assert (row["low"], row["high"]) == wilson_by_champion(part, whole)
    assert width((row["low"], row["high"])) > width(wilson(10 / 13, 13))
    assert (row["control_true"], row["control_low"]) == (5, wilson_by_champion(part // 2, whole)[0])


@pytest.mark.parametrize(
    ("part", "whole", "verdict"),
    [
        ([0] * 3, [2] * 3, "too few (n = 6, 3 champions)"),
        ([1], [1], "too few (n = 1, 1 champion)"),
        ([], [], "no trial to judge by"),
    ],
)
def test_verdicts_on_few_trials(part, whole, verdict):
    assert claims.claim("", "", np.array(part, int), np.array(whole, int))["verdict"] == verdict


@pytest.mark.parametrize(
    ("low", "high", "verdict"),
    [
        (0.5, 1.0, "inconclusive (n = 7)"),
        (0.51, 1.0, "holds"),
        (0.25, 0.75, "mixed"),
        (0.24, 0.75, "inconclusive (n = 7)"),
        (0.0, 0.49, "does not hold"),
    ],
)
def test_the_rule_is_as_it_is_printed(low, high, verdict):
    assert claims.verdict(low, high, 7, 7) == verdict


@pytest.mark.parametrize(
    ("low", "high", "verdict"),
    [
        (-12, -1, "holds"),  # the paper's effect is -10
        (-9, -1, "holds, smaller"),
        (-14, -11, "holds"),
        (-9, 1, "does not hold"),
        (-11, 1, "inconclusive (n = 7)"),
        (1, 12, "does not hold"),
    ],
)
def test_the_rule_of_effects_is_as_it_is_printed(low, high, verdict):
    assert claims.verdict(low, high, 7, 7, paper=-10.0) == verdict
    assert claims.verdict(-high, -low, 7, 7, paper=10.0) == verdict


def test_showcase_is_the_likest_of_the_masters(paper):
    assert claims.showcase(EACH, published.published_success(paper), "obstacles") == ("a", 8, 12)


def test_published_values_are_the_papers(paper):
    values = published.published_values(paper)
    assert values.published.notna().sum() == 20 + 2 * (5 + 4 + 4) + 6 * 6
    cell = values[(values.scenario == "4obstacles") & (values.controller == HEBBIAN) & (values.side == "right")]
    assert cell.set_index("metric").published["time_to_goal_s"] == 161.25
    said = published.published_success(paper).set_index(["scenario", "controller", "side"]).success
    assert said["lowlight", GA, "left"] == 0
    assert said["highlight", HEBBIAN, "right"] == 0


def test_comparison_puts_ours_beside_theirs(paper):
    values = published.published_values(paper)
    found = published.compare(values, EACH, {"obstacles": "a"}).set_index(["scenario", "controller", "side", "metric"])
    cell = found.loc[("base", GA, "left", "time_to_goal_s")]
    assert (cell.ours, cell.published, cell.n) == (100.0, 213.82, 2)
    assert cell.relative_deviation == pytest.approx(100 / 213.82 - 1)
    text = published.table(found.reset_index(), of_all=False).markdown()
    assert "| **Time-to-Goal (s)** | 100.00 (213.82) |" in text


def test_the_page_of_a_report_has_no_style_but_its_own_and_columns_end_at_the_right_as_markdown_has_them():
    table = "| scenario | share | p |\n| --- | ---: | --- |\n| 2obstacles | 0.56 [0.36, 0.74] | – |\n"
    page = study_page(table, lambda _: b"")
    assert not re.search(r"<[^>]* style=", page)
    assert '<td>2obstacles</td>\n<td class="number">0.56 [0.36, 0.74]</td>\n<td>–</td>' in page
    assert '<th>scenario</th>\n<th class="number">share</th>' in page


def test_a_title_says_why_there_are_no_intervals():
    assert interval_title("seeds", [6, 12]) == "95 % intervals over seeds"
    assert interval_title("seeds", [4, 12, 4]).endswith("need 6: here 4 or 12")
