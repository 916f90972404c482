"""The statistics of the study, on cases small enough to count by hand."""

import math
import re

import numpy as np
import pandas as pd
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from epuckhebb.analysis import findings, published, report, rescue
from epuckhebb.analysis.statistics import bootstrap_mean, bootstrap_ratio, sign_flip, wilson, wilson_by_champion
from epuckhebb.runtime.resources import data_folder
from epuckhebb.tmaze.individual import GA, HEBBIAN


@pytest.mark.parametrize(
    ("k", "n", "low", "high"), [(20, 20, 0.8389, 1.0), (0, 10, 0.0, 0.2775), (7, 22, 0.1636, 0.5268)]
)
def test_wilson(k, n, low, high):
    assert wilson(k, n) == pytest.approx((low, high), abs=1e-4)


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


@pytest.mark.parametrize(("gained", "lost"), [(6, 0), (1, 5), (5, 5), (13, 4)])
def test_sign_flip_is_mcnemar_where_each_champion_has_one_trial(gained, lost):
    differences = np.repeat([1, -1, 0], [gained, lost, 3])
    assert sign_flip(differences) == pytest.approx(stats.binomtest(gained, gained + lost, 0.5).pvalue)


def test_sign_flip_agrees_with_scipy_and_is_exact_for_many():
    differences = np.array([2, 1, -1, 0, 2, -2, 1, 1, 2])
    expected = stats.permutation_test((differences,), np.sum, permutation_type="samples", n_resamples=2**9).pvalue
    assert sign_flip(differences) == pytest.approx(expected)
    assert sign_flip(np.full(60, 2)) == 2 / 2**60


def test_sign_flip_wants_whole_trials():
    with pytest.raises(TypeError, match="float64"):
        sign_flip(np.array([0.5, 1.0]))


def test_one_trial_from_each_champion_is_wilson():
    assert wilson_by_champion(np.array([1] * 3 + [0] * 17), np.ones(20, int)) == pytest.approx(wilson(3, 20))


def test_sides_that_always_agree_are_worth_one_trial():
    alike = wilson_by_champion(np.array([2] * 10 + [0] * 10), np.full(20, 2))
    assert width(alike) > width(wilson(10, 20)) > 1.3 * width(wilson(20, 40))
    assert alike == pytest.approx(wilson(10, 20), abs=0.005)


def test_sides_that_have_nothing_to_do_with_each_other_are_worth_two():
    apart = wilson_by_champion(np.array([2] * 5 + [1] * 10 + [0] * 5), np.full(20, 2))
    assert apart == pytest.approx(wilson(20, 40), abs=0.005)


def test_an_interval_by_hand():
    # 3 of 4 by champions with 2 of 2 and 1 of 2: off by 0.5 and -0.5, variance 2 (0.25 + 0.25) / 16 = 1/16, and of
    # independent trials 0.75 * 0.25 / 3 = 1/16. The design effect is 1, the effective number of cases 4
    assert wilson_by_champion(np.array([2, 1]), np.array([2, 2])) == pytest.approx(wilson(3, 4))


@pytest.mark.parametrize("interval", [wilson_by_champion, lambda part, whole: bootstrap_ratio(part, whole, seed=1)])
@pytest.mark.parametrize(
    ("part", "whole", "k", "n"),
    [([2] * 10, [2] * 10, 10, 10), ([0] * 13, [2] * 13, 0, 13), ([2, 1], [2, 1], 2, 2), ([0, 0], [2, 0], 0, 1)],
)
def test_where_all_champions_agree_each_counts_once(interval, part, whole, k, n):
    assert interval(np.array(part), np.array(whole)) == pytest.approx(wilson(k, n))


@pytest.mark.parametrize(("part", "whole"), [([3], [2]), ([-1], [2]), ([1], [1, 2])])
def test_counts_that_cannot_be_are_refused(part, whole):
    with pytest.raises(ValueError, match="champion"):
        wilson_by_champion(np.array(part), np.array(whole))
    with pytest.raises(ValueError, match="champion"):
        bootstrap_ratio(np.array(part), np.array(whole), seed=0)


CHAMPIONS = st.lists(
    st.integers(0, 4).flatmap(lambda whole: st.tuples(st.integers(0, whole), st.just(whole))), min_size=1, max_size=25
)


@given(CHAMPIONS)
def test_an_interval_holds_its_share_and_is_never_surer_than_independent_trials(champions):
    part, whole = np.array(champions).T
    if not whole.sum():
        assert all(map(math.isnan, wilson_by_champion(part, whole)))
        return
    for low, high in (wilson_by_champion(part, whole), bootstrap_ratio(part, whole, seed=0)):
        assert 0 <= low <= part.sum() / whole.sum() <= high <= 1
        assert low < high
    assert width(wilson_by_champion(part, whole)) >= width(wilson(int(part.sum()), int(whole.sum()))) - 1e-9


@given(st.lists(st.integers(0, 1), min_size=1, max_size=40), st.integers(2, 5))
def test_sides_alike_do_not_narrow_an_interval_nor_a_p_value(outcomes, copies):
    part, whole = np.array(outcomes), np.ones(len(outcomes), int)
    one, many = wilson_by_champion(part, whole), wilson_by_champion(part * copies, whole * copies)
    assert many[0] <= one[0] + 1e-9
    assert many[1] >= one[1] - 1e-9
    assert bootstrap_ratio(part * copies, whole * copies, seed=0) == bootstrap_ratio(part, whole, seed=0)
    assert sign_flip(part * copies) == sign_flip(part)


def test_bootstrap_covers_the_mean():
    low, high = bootstrap_mean(np.random.default_rng(0).normal(3, 1, 50), seed=1)
    assert low < 3 < high
    assert high - low == pytest.approx(2 * 1.96 / math.sqrt(50), rel=0.25)


def test_bootstrap_where_all_agree():
    assert bootstrap_mean(np.ones(20), seed=1, bounds=(0, 1)) == pytest.approx(wilson(20, 20))
    unseen = wilson(0, 20)[1]
    assert bootstrap_mean(np.zeros(20), seed=1, bounds=(-1, 1)) == pytest.approx((-unseen, unseen))
    assert bootstrap_mean(np.array([0.5, np.nan]), seed=1, bounds=(0, 1)) == pytest.approx((0.1033, 0.8967), abs=1e-4)
    assert bootstrap_mean(np.ones(5), seed=1) == (1, 1)  # no bounds: nothing can be said of others
    assert all(map(math.isnan, bootstrap_mean(np.array([1.0, np.nan]), seed=1)))


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
    assert (found.difference_low["2obstacles"], found.difference_high["2obstacles"]) == (0.0, 0.5)
    assert tuple(found.loc["4obstacles", ["rescued_low", "rescued_high"]]) == pytest.approx(wilson(1, 2))
    assert tuple(found.loc["base", ["harmed_low", "harmed_high"]]) == pytest.approx((0.0395, 0.8588), abs=1e-4)
    # that is Wilson's for 1/3 of 27/16: a is off by 0 - 2/3, b by 1 - 1/3, variance 2 (8/9) / 9, design effect 16/9
    assert found[["rescued_low", "rescued_high"]].loc["base"].isna().all()


def test_rescue_over_all_changed_worlds_by_hand():
    (found,) = findings.rescue_over_all(EACH).to_dict("records")
    assert (found["broken"], found["rescued"], found["intact"], found["harmed"]) == (2, 1, 4, 1)
    assert (found["training_solved"], found["training_harmed"]) == (3, 1)
    assert (found["rescued_share"], found["harmed_share"]) == (0.5, 0.25)
    assert (found["rescued_low"], found["rescued_high"]) == (0.0, 1.0)  # a: 1 of 1, b: 0 of 1
    assert findings.changed(EACH, "obstacles") == ["2obstacles", "4obstacles"]


def one_sided():
    """Champion l always turns left and solves the left everywhere. Champion m solves both, and fewer when changed."""
    outcomes = {}
    for scenario, m in (("base", (3, 3)), ("2obstacles", (3, 0)), ("4obstacles", (0, 0))):
        outcomes |= {("l", scenario, GA, 0.0): (3, 0), ("m", scenario, GA, 0.0): m}
        outcomes |= {("l", scenario, HEBBIAN, N): (3, 0), ("m", scenario, HEBBIAN, N): (0, 3)}
    return findings.trials(lifetimes(outcomes))


def test_retention_counts_one_sided_champions_apart():
    found = findings.retention(one_sided()).set_index(["controller", "solves"])
    columns = ["champions", "trials", "retained"]
    assert found.loc[(GA, "any"), columns].tolist() == [2, 6, 3]  # l: 2 of 2, m: 1 of 4
    assert found.loc[(GA, "both"), columns].tolist() == [1, 4, 1]
    assert found.loc[(HEBBIAN, "any"), columns].tolist() == [2, 6, 4]
    assert found.loc[(HEBBIAN, "both"), columns].tolist() == [1, 4, 2]
    assert found.share[GA, "both"] == 0.25
    assert tuple(found.loc[(GA, "any"), ["low", "high"]]) == (0.25, 1.0)
    assert width(found.loc[(GA, "both"), ["low", "high"]]) == pytest.approx(wilson(0, 1)[1])  # one champion
    page = rescue.retention_table(found.reset_index()).markdown()
    assert "| GA | 3 of 6: 0.50 [0.25, 1.00], 2 champions | 1 of 4: 0.25 [0.05, 0.85], 1 champion |" in page


def test_retention_where_nothing_is_solved():
    each = one_sided()
    found = findings.retention(each[each.genome == "l"]).set_index(["controller", "solves"])
    assert found.trials[GA, "both"] == 0
    assert math.isnan(found.share[GA, "both"])
    assert (
        "| GA | 2 of 2: 1.00 [0.21, 1.00], 1 champion | 0 of 0 |"
        in rescue.retention_table(found.reset_index()).markdown()
    )


def test_bootstrap_ratio_weighs_champions_by_their_trials():
    part, whole = np.array([1, 0, 3]), np.array([2, 0, 3])
    low, high = bootstrap_ratio(part, whole, seed=1)
    assert 0.5 == low < 0.8 < high == 1.0
    assert all(map(math.isnan, bootstrap_ratio(np.zeros(3, int), np.zeros(3, int), seed=1)))


def test_success_counts_champions():
    found = findings.success(EACH).set_index(["scenario", "controller", "side"])
    assert tuple(found.loc[("base", GA, "right"), ["successes", "n"]]) == (1, 2)
    assert tuple(found.loc[("base", GA, "right"), ["low", "high"]]) == wilson(1, 2)
    assert tuple(found.loc[("base", GA, "both"), ["successes", "n"]]) == (1, 2)
    assert tuple(found.loc[("2obstacles", HEBBIAN, "both"), ["successes", "gained"]]) == (2, 1)  # b, with plasticity
    assert tuple(found.loc[("4obstacles", HEBBIAN, "left"), ["successes", "gained"]]) == (1, 1)
    assert not found.xs(GA, level="controller").gained.any()


def test_claims_by_hand():
    found = findings.claims(EACH).set_index("claim")
    assert tuple(found.loc["4 obstacles defeat the GA", ["true", "n"]]) == (2, 3)
    assert tuple(found.loc["N = 1.5e-05 rescues it at 4", ["true", "n"]]) == (1, 2)
    assert tuple(found.loc["Weight change grows with obstacles", ["true", "n"]]) == (0, 4)
    unchanged = found.loc["The genome is unchanged after a lifetime"]
    assert unchanged.verdict == "check passed"
    assert math.isnan(unchanged.low)  # it is no statistic
    assert found.verdict["N = 1.5e-05 rescues it at 2"] == "no trial to judge by"


def test_sides_of_a_champion_are_one_piece_of_evidence():
    part, whole = np.array([2, 2, 0]), np.array([2, 2, 1])
    row = findings.claim("", "", part, whole)
    assert (row["true"], row["n"], row["champions"]) == (4, 5, 3)
    assert (row["low"], row["high"]) == wilson_by_champion(part, whole)
    assert width((row["low"], row["high"])) > width(wilson(4, 5))


@pytest.mark.parametrize(
    ("part", "whole", "verdict"),
    [
        ([1] * 19 + [0], [1] * 20, "holds"),
        ([1] + [0] * 19, [1] * 20, "does not hold"),
        ([1] * 10 + [0] * 10, [1] * 20, "mixed"),
        ([0] * 3, [2] * 3, "inconclusive (n = 6)"),
        ([1] * 3, [1] * 3, "inconclusive (n = 3)"),
        ([1] * 4, [1] * 4, "holds"),
        ([2, 2], [2, 2], "inconclusive (n = 4)"),  # four trials, but two champions
        ([], [], "no trial to judge by"),
    ],
)
def test_verdicts(part, whole, verdict):
    assert findings.claim("", "", np.array(part, int), np.array(whole, int))["verdict"] == verdict


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
    assert findings.verdict(low, high, 7) == verdict


def test_every_claim_is_judged_by_the_one_rule():
    light = EACH.assign(experiment="light", scenario=EACH.scenario.map({"base": "highlight", "4obstacles": "lowlight"}))
    found = findings.claims(pd.concat([EACH, light[light.scenario.notna()]]))
    assert len(found) == 13
    judged = found[~found.verdict.str.startswith("check")]
    assert [findings.verdict(row.low, row.high, row.n) for row in judged.itertuples()] == list(judged.verdict)
    assert (found.n == 0).equals(found.verdict == "no trial to judge by")


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
    page = report.html(table, lambda _: b"")
    assert not re.search(r"<[^>]* style=", page)
    assert '<td>2obstacles</td>\n<td class="number">0.56 [0.36, 0.74]</td>\n<td>–</td>' in page
    assert '<th>scenario</th>\n<th class="number">share</th>' in page
