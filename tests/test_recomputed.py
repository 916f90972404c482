"""Numbers of runs/reference/ again, from its CSV files alone: by SciPy and by hand, with no function of the program."""

import math
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy import stats

ROOT = Path(__file__).parents[1]
REFERENCE = ROOT / "runs" / "reference"
TRAINED, RATE = {"light": "highlight", "obstacles": "base"}, {"light": 0.002, "obstacles": 0.000015}
SECTION = {"lowlight": "## 1. ", "4obstacles": "## 2. "}  # of results.md
CHANCE = np.random.default_rng(1)
UNKNOWN = (math.nan, math.nan)


def read(name):
    return pd.read_csv(REFERENCE / f"{name}.csv")


def interval(part, whole):
    """Wilson's interval of champions, as docs/methods.md has it: part, whole: a number of trials for each."""
    part, whole = np.array(part, float), np.array(whole, float)
    part, whole = part[whole > 0], whole[whole > 0]
    if len(whole) < 6:
        return UNKNOWN
    size, share = whole.mean(), (part.sum() + whole.mean() / 2) / (whole.sum() + whole.mean())
    residuals = [*(part - share * whole), share * size / math.sqrt(2), (1 - share) * size / math.sqrt(2)]
    variance = (len(whole) + 1) / len(whole) * np.square(residuals).sum() / (whole.sum() + size) ** 2
    effect = max(1.0, variance / (share * (1 - share) / (whole.sum() + size - 1)))
    cases = whole.sum() / effect
    return wilson(part.sum() / whole.sum(), cases)


def wilson(p, n):
    """The two shares from which p is 1.96 standard errors away: roots of a quadratic equation."""
    z2 = stats.norm.ppf(0.975) ** 2
    return tuple(sorted(np.roots([1 + z2 / n, -(2 * p + z2 / n), p * p]).real))


@pytest.fixture(scope="module")
def outcomes():
    """Whether a trial succeeds: experiment, scenario, controller, N: a series by champion and side."""
    rows = read("trials")
    return {
        key: own.set_index(["genome", "side"]).sort_index()
        for key, own in rows.groupby(["experiment", "scenario", "controller", "N"])
    }


def fates(outcomes, experiment, scenario, controller="Hebbian"):
    """Of each champion: trials solved in training, broken, rescued, intact, harmed."""
    solved = outcomes[experiment, TRAINED[experiment], "GA", 0.0].succeeds
    alone = outcomes[experiment, scenario, "GA", 0.0].succeeds
    plastic = outcomes[experiment, scenario, controller, RATE[experiment]].succeeds
    found = {"solved": solved, "broken": solved & ~alone, "intact": solved & alone}
    found |= {"rescued": found["broken"] & plastic, "harmed": found["intact"] & ~plastic}
    return pd.DataFrame(found).groupby("genome").sum()


def near(row, name, value, ends, digits=1e-9):
    assert row[name] == pytest.approx(value, abs=digits, nan_ok=True)
    stem = name.removesuffix("share") or ""
    stem = stem if stem in ("", "rescued_", "harmed_") else f"{stem}_"
    found = tuple(row[f"{stem}{end}"] for end in ("low", "high"))
    assert found == pytest.approx(ends, abs=digits, nan_ok=True)


@pytest.mark.parametrize("controller", ["Hebbian", "shuffled signs", "anti-Hebbian"])
@pytest.mark.parametrize(
    ("experiment", "scenario"),
    [("light", "highlight"), ("light", "lowlight"), ("obstacles", "2obstacles"), ("obstacles", "4obstacles")],
)
def test_rescue_and_harm(outcomes, experiment, scenario, controller):
    """Two shares with their intervals, and p, in twelve rows."""
    rows = read("rescue_and_harm").set_index(["experiment", "scenario", "controller", "N"])
    row, own = (
        rows.loc[experiment, scenario, controller, RATE[experiment]],
        fates(outcomes, experiment, scenario, controller),
    )
    for part, whole in (("rescued", "broken"), ("harmed", "intact")):
        share = own[part].sum() / own[whole].sum() if own[whole].sum() else math.nan
        near(row, f"{part}_share", share, interval(own[part], own[whole]))
    alone, plastic = (
        outcomes[experiment, scenario, name, rate].succeeds.groupby("genome").sum()
        for name, rate in (("GA", 0.0), (controller, RATE[experiment]))
    )
    change = (plastic - alone).to_numpy()
    p = stats.permutation_test((change[change != 0],), np.sum, permutation_type="samples", n_resamples=np.inf)
    assert row.sign_flip_p == pytest.approx(p.pvalue if change.any() else 1.0, abs=1e-9)


@pytest.mark.parametrize("n", range(13))
def test_claims(outcomes, n):
    """The share or the effect of each claim, its interval, its control, and the verdict by the printed rule."""
    row = read("claims").iloc[n]
    if row.verdict == "check passed":
        return
    words, experiment = row.claim, row.experiment
    if not math.isnan(row.paper_effect):
        column, before, after = (
            ("weight_change_mean", ("base", "Hebbian", RATE["obstacles"]), "4obstacles")
            if "Weight" in words
            else ("time_to_goal_s", ("base", "GA", 0.0), "base")
        )
        old, new = (outcomes["obstacles", *key][column] for key in (before, (after, "Hebbian", RATE["obstacles"])))
        changes = (100 * (new / old - 1)).groupby("genome").mean().dropna().to_numpy()
        assert row.effect == pytest.approx(changes.mean())
        again = stats.bootstrap(
            (changes,), np.mean, n_resamples=99999, method="percentile", rng=np.random.default_rng(1)
        ).confidence_interval
        ends = (row.effect_low, row.effect_high)
        assert ends == pytest.approx(tuple(again), abs=0.02 * (again.high - again.low))
        claimed, (low, high) = abs(row.paper_effect), sorted(np.sign(row.paper_effect) * np.array(ends))
        expected = "holds" if low > 0 else "inconclusive" if low <= claimed <= high else "does not hold"
        assert row.verdict.removesuffix(", smaller") == expected
        return
    places = {"low": "lowlight", "high": "highlight", "two": "2obstacles", "four": "4obstacles"}
    cases = {
        "The GA fails in low light": ("low", "broken", "solved"),
        "N = 0.002 rescues it": ("low", "rescued", "broken"),
        "The same N harms in high light": ("high", "harmed", "intact"),
        "2 obstacles defeat the GA": ("two", "broken", "solved"),
        "N = 1.5e-05 rescues it at 2": ("two", "rescued", "broken"),
        "4 obstacles defeat the GA": ("four", "broken", "solved"),
        "N = 1.5e-05 rescues it at 4": ("four", "rescued", "broken"),
    }
    if words in cases:
        world, part, whole = cases[words]
        own = fates(outcomes, experiment, places[world])
        assert (row.true, row.n) == (own[part].sum(), own[whole].sum())
        near(row, "share", own[part].sum() / own[whole].sum(), interval(own[part], own[whole]))
    if math.isnan(row.low):
        assert row.verdict == f"too few (n = {row.n}, {row.champions} champions)"
        assert row.champions < 6
    elif row.low > 0.5 or row.high < 0.5:
        assert row.verdict == ("holds" if row.low > 0.5 else "does not hold")
    else:
        wide = row.low < 0.25 or row.high > 0.75
        assert row.verdict == (f"inconclusive (n = {row.n})" if wide else "mixed")


FOLDERS = sorted(path.parent.name for path in REFERENCE.glob("*/rescue_by_champion.csv"))


@pytest.mark.parametrize("folder", FOLDERS)
def test_studies(folder):
    """Rescue and harm of all controllers, from the table by champion."""
    champions = read(f"{folder}/rescue_by_champion").groupby(["experiment", "controller", "N"])
    for key, row in read(f"{folder}/rescue_over_all").set_index(["experiment", "controller", "N"]).iterrows():
        own = champions.get_group(key)
        for part, whole in (("rescued", "broken"), ("harmed", "intact")):
            share = own[part].sum() / own[whole].sum() if own[whole].sum() else math.nan
            near(row, f"{part}_share", share, interval(own[part], own[whole]))


@pytest.mark.parametrize("experiment", ["light", "obstacles"])
@pytest.mark.parametrize("folder", ["leaderboard", "spikes"])
def test_leaderboard(folder, experiment):
    """Success, interquartile mean, difference, p, and Holm's correction of a table, from its champions."""
    board, champions = read(f"{folder}/leaderboard"), read(f"{folder}/champions")
    board, champions = board[board.experiment == experiment], champions[champions.experiment == experiment]
    own = {name: rows.set_index("seed") for name, rows in champions.groupby("method")}
    for _, row in board.iterrows():
        ours = own[row.method]
        share = ours.successes / ours.trials
        known = interval(ours.successes, ours.trials) if share.nunique() > 1 else UNKNOWN  # none round a constant
        near(row, "success", ours.successes.sum() / ours.trials.sum(), known)
        assert row.iqm == pytest.approx(stats.trim_mean(share, 0.25))
        if pd.isna(row.matched_control):
            continue
        others = own[row.matched_control]
        theirs = others.successes / others.trials
        assert row.difference == pytest.approx(share.mean() - theirs.mean())
        assert row.improvement == pytest.approx(stats.mannwhitneyu(share, theirs).statistic / len(share) / len(theirs))
        samples, kind = (((share - theirs),), "samples") if row.kind == "post_hoc" else ((share, theirs), "independent")
        statistic = np.mean if row.kind == "post_hoc" else lambda x, y, axis: x.mean(axis=axis) - y.mean(axis=axis)
        p = stats.permutation_test(
            samples, statistic, permutation_type=kind, n_resamples=9999, rng=np.random.default_rng(1)
        )
        assert row.p == pytest.approx(p.pvalue, abs=0.02)
    tests = pd.concat([board.p, board.best_plain_p]).dropna().sort_values()
    steps = np.maximum.accumulate(tests.to_numpy() * np.arange(len(tests), 0, -1)).clip(max=1)
    held = np.sort(pd.concat([board.p_holm, board.best_plain_p_holm]).dropna())
    assert held == pytest.approx(np.sort(steps))


@pytest.mark.parametrize(("folder", "methods"), [("leaderboard", 6), ("spikes", 4)])
def test_anytime_curves(folder, methods):
    """Each point of the curves, from the counts of champions; the last are those of the leaderboard."""
    counts, champions = read(f"{folder}/anytime_by_champion"), read(f"{folder}/champions")
    points = read(f"{folder}/anytime")
    assert len(points) == methods * 2 * 4
    for _, row in points.iterrows():
        own = counts[(counts[["experiment", "method", "mark"]] == row[["experiment", "method", "mark"]]).all(axis=1)]
        near(row, "success", own.successes.sum() / own.trials.sum(), interval(own.successes, own.trials))
        assert row.robot_steps == int(own.robot_steps.mean())
    keys = ["experiment", "method", "seed", "trials", "successes", "robot_steps"]
    last = counts[counts.mark == 3][keys]
    assert len(last.merge(champions[keys])) == len(last) == methods * 2 * 12


def test_outcomes_in_the_second_physics():
    """In how many trials the plane and three dimensions agree, from the table of successes."""
    rows = read("second_physics/successes").set_index(["scenario", "genome", "side"]).sort_index() > 1
    for row in read("second_physics/agreement").itertuples():
        plane, solid = (rows.loc[name, row.controller] for name in (row.scenario, f"{row.scenario}_3d"))
        same = (plane == solid).groupby("genome").agg(["sum", "size"])
        assert (row.successes_plane, row.successes_3d, row.same) == (plane.sum(), solid.sum(), same["sum"].sum())
        assert (row.low, row.high) == pytest.approx(interval(same["sum"], same["size"]))


def test_evolve_or_adapt():
    """Shares of cases recovered and retained with their intervals, claims, and the p values of the five tests."""
    cases = read("evolve_or_adapt/recovery")
    cases["who"] = cases.experiment + cases.champion.astype(str)
    ways = dict(iter(cases.groupby(["way", "controller", "generation"])))
    for _, row in read("evolve_or_adapt/ways").query("world == 'all'").iterrows():
        own = ways[row.way, row.controller, row.generation]
        for name in ("recovered", "retained"):
            counts = own.groupby("who")[name].agg(["sum", "size"])
            near(row, name, own[name].mean(), interval(counts["sum"], counts["size"]))
    last = cases.generation.max()

    def at_end(text):
        way, controller = text.split(" + ")
        own = ways[way, controller, 0 if (way, controller, 0) in ways else last]
        return own.set_index(["who", "world"]).sort_index()

    p = []
    for row in read("evolve_or_adapt/tests").itertuples():
        one, other = (at_end(text)[row.what].groupby("who").sum() for text in (row.way, row.other))
        change = (one - other).to_numpy()
        again = stats.permutation_test(
            (change[change != 0],), np.sum, permutation_type="samples", n_resamples=99999, rng=np.random.default_rng(1)
        )
        assert row.p == pytest.approx(again.pvalue, abs=0.01)
        p.append(row.p)
    steps = np.maximum.accumulate(np.sort(p) * np.arange(5, 0, -1)).clip(max=1)
    assert np.sort(read("evolve_or_adapt/tests").p_holm) == pytest.approx(steps)


@pytest.mark.parametrize("budget", ["legs", "legs_300", "legs_fresh"])
def test_legs(budget):
    """The twelve effects on HalfCheetah, and their p values, from the table by champion."""
    after = read(f"{budget}/champions").dropna().set_index(["change", "controller", "genome"]).sort_index().return_after
    rows = read(f"{budget}/effects")
    for row in rows.itertuples():
        ours, others = after[row.change, row.controller], after[row.change, row.against]
        others = others[ours.index] if row.is_paired else others
        assert row.effect == pytest.approx(ours.mean() - others.mean())
        kind = "samples" if row.is_paired else "independent"
        p = stats.permutation_test(
            (ours, others), lambda x, y, axis: x.mean(axis=axis) - y.mean(axis=axis), permutation_type=kind,
            n_resamples=9999, rng=np.random.default_rng(1),
        )  # fmt: skip
        assert row.p == pytest.approx(p.pvalue, abs=0.02)
    steps = np.maximum.accumulate(np.sort(rows.p) * np.arange(len(rows), 0, -1)).clip(max=1)
    assert np.sort(rows.p_holm) == pytest.approx(steps)


def test_counts_of_lifetimes_are_at_most_all_of_them():
    counted = [
        (table.lifetimes - table[name]).min()
        for file in REFERENCE.rglob("*.csv")
        if "lifetimes" in (table := pd.read_csv(file, low_memory=False))
        for name in ("reached", "recovered")
        if name in table
    ]
    assert len(counted) >= 2
    assert min(counted) == 0


def test_the_course_of_the_legs_says_when_the_gain_is_there():
    course = read("legs_fresh/course").set_index(["change", "controller"])
    sums = 100 * course[course.until_step > 500].groupby(["change", "controller"]).reward.sum()
    told = read("legs_fresh/summary").set_index(["change", "controller"]).return_after
    pd.testing.assert_series_equal(sums.sort_index(), told.sort_index(), check_names=False)
    rule, frozen = (course.loc["weak_leg", name] for name in ("normalised", "normalised (frozen at the change)"))
    gain = pd.Series(rule.reward.to_numpy() - frozen.reward.to_numpy(), rule.until_step)
    assert gain.loc[:500].eq(0).all()
    assert gain.loc[[600, 1000]].round(2).tolist() == [0.16, 0.18]


def test_foraging():
    """The eleven differences and their p values, and the means of methods, from the table by champion and season."""
    seasons, rows = read("foraging/seasons"), read("foraging/differences")
    its = seasons.set_index(["method", "controller", "number", "seed"]).reward.sort_index()
    for row in rows.itertuples():
        if row.other == "frozen":
            ours, others = (its[row.ours, name].loc[2:4].groupby("seed").sum() for name in ("rule", "frozen"))
            found = stats.permutation_test(
                (ours - others,), np.mean, permutation_type="samples", n_resamples=np.inf
            ).pvalue
        else:
            names = [(name, "rule" if (name, "rule") in its.index else "network") for name in (row.ours, row.other)]
            ours, others = (its[name].groupby("seed").sum() for name in names)
            found = stats.permutation_test(
                (ours, others), lambda x, y, axis: x.mean(axis=axis) - y.mean(axis=axis), n_resamples=99_999, rng=1
            ).pvalue
        assert row.difference == pytest.approx(ours.mean() - others.mean())
        assert row.p == pytest.approx(found, abs=0.005)
    steps = np.maximum.accumulate(np.sort(rows.p) * np.arange(11, 0, -1)).clip(max=1)
    assert np.sort(rows.p_holm) == pytest.approx(steps)
    for row in read("foraging/methods").query("champions == 10").itertuples():
        rewards = its[row.method, row.controller].groupby("seed").sum()
        assert row.reward == pytest.approx(rewards.mean())
        if np.ptp(rewards) > 0:
            again = stats.bootstrap((rewards,), np.mean, method="percentile", rng=1).confidence_interval
            assert (row.reward_low, row.reward_high) == pytest.approx(again, abs=1.0)


def test_foraging_lifespans():
    """The means of cells and the differences to plain networks, with intervals, from the table by champion."""
    cell = ["season", "steps", "known"]
    champions = read("foraging_lifespans/champions").set_index([*cell, "method", "controller"]).sort_index().reward
    for row in read("foraging_lifespans/cells").itertuples():
        place = row.season, row.steps, row.known
        names = [(*place, row.method, row.controller)], [(*place, "plain", "network")]
        ours, plain = (champions.loc[name].to_numpy() for name in names)
        assert (row.champions, row.reward) == (len(ours), pytest.approx(ours.mean()))
        assert row.over_plain == pytest.approx(ours.mean() - plain.mean(), abs=1e-12)
        if len(ours) > 1 and np.ptp(ours) > 0:
            again = stats.bootstrap(
                (ours, plain), lambda x, y, axis: x.mean(axis=axis) - y.mean(axis=axis), method="percentile", rng=1
            ).confidence_interval
            assert (row.over_plain_low, row.over_plain_high) == pytest.approx(again, abs=0.001)


@pytest.mark.parametrize("run", ["anti_hebbian", "anti_hebbian_reached"])
def test_anti_hebbian(run):
    """Both rates, gains, and Cohen's d with its interval, from the table by network."""
    gains, rates = read(f"{run}/gains"), read(f"{run}/rates")
    for row in read(f"{run}/effects").itertuples():
        own = gains[(gains.world == row.world) & (gains.change == row.change)]
        tried = rates[(rates.world == row.world) & (rates.change == row.change)].set_index(["sign", "rate"]).gain
        assert (tried["hebbian"].idxmax(), tried["anti"].idxmax()) == (row.rate_hebbian, row.rate_anti)
        assert (own.gain_hebbian.mean(), own.gain_anti.mean()) == pytest.approx((row.gain_hebbian, row.gain_anti))
        d = (own.gain_anti - own.gain_hebbian) / np.sqrt((own.gain_hebbian.var() + own.gain_anti.var()) / 2)
        assert (len(own), d.mean()) == (row.networks, pytest.approx(row.d))
        again = stats.bootstrap((d,), np.mean, method="percentile", rng=1).confidence_interval
        assert (row.d_low, row.d_high) == pytest.approx((again.low, again.high), abs=0.01)


def test_many_obstacles():
    """The table and the p values of 110 champions on the page of the reproduction."""
    page = (REFERENCE.parents[1] / "docs" / "reproduction.md").read_text()
    trials = read("many_obstacles/successes").set_index(["genome", "side"])
    wins = {name: own.iloc[:, 1:] > 5 for name, own in trials.groupby("scenario")}
    solved, p = wins["base"].GA, {"rescue": [], "harm": []}
    for scenario in ("2obstacles", "4obstacles"):
        here, cells = wins[scenario], []
        for fate, whole in (("rescue", solved & ~here.GA), ("harm", solved & here.GA)):
            counts = {name: whole & (here[name] == (fate == "rescue")) for name in ("Hebbian", "shuffled")}
            own, others = (count.groupby("genome").sum() for count in counts.values())
            total = whole.groupby("genome").sum()
            for count in (own, others):
                low, high = interval(count, total)
                share = count.sum() / total.sum()
                cells.append(f"{count.sum()} of {total.sum()}: {share:.2f} [{low:.2f}, {high:.2f}]")
            sums = np.ones(1)  # the chance of each sum, if each champion's sign is drawn
            for size in (own - others).abs():
                sums = np.convolve(sums, np.eye(1, 2 * size + 1)[0] / 2 + np.eye(1, 2 * size + 1, 2 * size)[0] / 2)
            distance = np.abs(np.arange(len(sums)) - len(sums) // 2)
            p[fate].append(sums[distance >= abs((own - others).sum())].sum())
        assert f"{(solved & ~here.GA).sum()} | {' | '.join(cells)} |" in page
    every = [*p["rescue"], *p["harm"]]
    order = np.argsort(every)
    corrected = np.empty(4)
    corrected[order] = np.maximum.accumulate(np.sort(every) * np.arange(4, 0, -1)).clip(max=1)
    rescue, harm = (" and ".join(f"{value:.2f}" for value in pair) for pair in (corrected[:2], corrected[2:]))
    assert f"rescue p = {rescue}, harm p = {harm}" in " ".join(page.split())


README = (REFERENCE.parents[1] / "README.md").read_text()
STUDIES = {  # of the front page: training world, changed world, the draws of the control, rules, rows of the table
    "which_end": ("highlight", "lowlight", [f"yoked_sign_{draw}" for draw in range(5)], ["Hebbian"], slice(3)),
    "stopping": (
        *("base", "4obstacles", [f"yoked_sign_{draw}" for draw in range(5)]),
        *(["Hebbian_0.000015", "Hebbian"], slice(3, 8)),
    ),
}


def sides_of(*studies):
    """End and fate of each trial, from tables with a row a champion: controller, scenario, champion and side."""
    tables = [pd.read_csv(REFERENCE / study / "ends_by_champion.csv", keep_default_na=False) for study in studies]
    rows = pd.concat(tables, ignore_index=True).drop_duplicates(["controller", "scenario", "genome"])
    sides = [
        rows[["controller", "scenario", "genome"]].assign(side=side, end=rows[f"end_{side}"], fate=rows[f"fate_{side}"])
        for side in ("left", "right")
    ]
    return pd.concat(sides).set_index(["controller", "scenario", "genome", "side"]).sort_index()


@pytest.mark.parametrize("study", STUDIES)
def test_the_claims_of_the_front_page(study):
    trained, changed, draws, rules, places = STUDIES[study]
    each = sides_of(study, *([f"{study}_yoked"] if study == "stopping" else []))
    fate = each.loc["GA", changed].fate
    right, wrong = (
        {key: each.end[key] == end for key in each.index.droplevel([2, 3]).unique()} for end in ("right", "wrong")
    )
    solved, broken = fate.isin(["broken", "intact"]), fate == "broken"
    assert (solved == right["GA", trained]).all()
    assert (broken == solved & ~right["GA", changed]).all()
    shown = [line for line in README.splitlines() if re.match(r"\| .*\| \*\*", line)]
    harmed = {name: ~right[name, trained] for name in (*rules, *draws)}
    rescued = {name: right[name, changed] for name in (*rules, *draws)}
    claims = [(None, None, solved, changed)]
    claims += [row for rule in rules for row in ((rule, rescued, broken, changed), (rule, harmed, solved, trained))]
    for row, (rule, true, whole, world) in zip(shown[places], claims, strict=True):
        _, _, counted, share, ends, control = (cell.strip() for cell in row.strip("|").split("|"))
        part = (broken if true is None else true[rule]) & whole
        assert counted == f"{part.sum()} of {whole.sum()}"
        low, high = interval(part.groupby("genome").sum(), whole.groupby("genome").sum())
        assert share == f"{part.sum() / whole.sum():.2f} [{low:.2f}, {high:.2f}]"
        if true is not None:
            assert ends == f"{wrong[rule, world][whole].sum()} of {whole.sum()}"
            drawn = [(true[name][whole].mean(), wrong[name, world][whole].mean()) for name in draws]
            assert control == ("–" if rule != "Hebbian" else "{:.2f}, {:.2f}".format(*np.mean(drawn, axis=0)))


def test_which_end_is_chance():
    each = sides_of("which_end")
    ends = {name: each.loc[name, "lowlight"].end for name in each.index.levels[0]}
    counts = [(ends[name] == end).sum() for name in ("Hebbian", "GA") for end in ("right", "wrong")]
    drawn = [(ends[f"yoked_sign_{k}"] == end).mean() * 220 for end in ("right", "wrong") for k in range(5)]
    less = ((ends["Hebbian"] == "right").astype(int) - (ends["Hebbian"] == "wrong")).groupby("genome").sum()
    assert len(less) == 110
    drawn_means = CHANCE.choice(less.to_numpy(), (20_000, 110)).mean(axis=1)
    low, high = np.percentile(drawn_means, [5, 95])
    assert -0.3 < low < less.mean() < high < 0.3  # by the plan: which end is chance
    p = stats.permutation_test((less,), np.sum, permutation_type="samples", n_resamples=19_999, rng=CHANCE).pvalue
    both = (ends["Hebbian"] == "right").unstack("side")
    said = re.search(
        r"in (\d+) of 220 trials, to the \*wrong\* goal in (\d+) "
        r"\((\S+) of two sides, 90 % \[(\S+), (\S+)\], p = (\S+)\)"
        r"\. Without plasticity it is not: (\d+) and (\d+) \((\S+) \[(\S+), (\S+)\]; the rule less this, looked at "
        r"afterwards: (\S+) \[(\S+), (\S+)\]\)\. With random changes of this size it is (\d+) and (\d+)\. (\d+) of 110 "
        r"champions are right on both sides; by chance (\S+) would be",
        README,
    )
    numbers = [float(number) for number in said.groups()]
    assert numbers[:2] + numbers[6:8] == counts
    assert numbers[2] == pytest.approx(less.mean(), abs=0.005)
    assert numbers[3:5] == pytest.approx([low, high], abs=0.02)
    assert numbers[5] == pytest.approx(p, abs=0.02)
    alone = ((ends["GA"] == "right").astype(int) - (ends["GA"] == "wrong")).groupby("genome").sum()
    for place, values in ((8, alone), (11, less - alone)):
        low, high = np.percentile(CHANCE.choice(values, (20_000, 110)).mean(axis=1), [2.5, 97.5])
        assert numbers[place : place + 3] == pytest.approx([values.mean(), low, high], abs=0.02)
    assert numbers[14:16] == pytest.approx([sum(drawn[:5]) / 5, sum(drawn[5:]) / 5], abs=0.5)
    assert numbers[16] == both.all(axis=1).sum()
    assert numbers[17] == pytest.approx(both.left.sum() * both.right.sum() / 110, abs=0.05)


def test_the_rule_among_obstacles():
    """The bullet of run 2: right less wrong ends of broken trials, the rule less five draws of shuffled signs."""
    each = sides_of("stopping", "stopping_yoked").xs("4obstacles", level="scenario")
    broken = each.loc["GA"].fate == "broken"
    ends = {name: each.loc[name].end[broken] for name in each.index.levels[0]}
    less = {
        name: ((end == "right").astype(int) - (end == "wrong")).groupby("genome").sum() for name, end in ends.items()
    }
    draws = [f"shuffled_{draw}" for draw in range(5)]
    difference = less["Hebbian"] - sum(less[draw] for draw in draws) / 5
    p = stats.permutation_test(
        (5 * difference,), np.sum, permutation_type="samples", n_resamples=19_999, rng=CHANCE
    ).pvalue
    low, high = np.percentile(CHANCE.choice(difference, (20_000, len(difference))).mean(axis=1), [2.5, 97.5])
    said = re.search(
        r"Of (\d+) broken trials of (\d+) champions the rule ends right in (\d+) and wrong in (\d+) at .*, "
        r"shuffled signs at theirs in (\S+) and (\S+): right less wrong differs by (\S+) a champion "
        r"\[(\S+), (\S+)\], p = (\S+)\. At the paper's N it is (\d+) and (\d+); "
        r"random changes as large as the rule's, at its chosen N, end right in (\S+) and wrong in (\S+), "
        r"its opposite sign in (\d+) and (\d+)\.\n",
        README,
    )
    counts = {name: [(end == which).sum() for which in ("right", "wrong")] for name, end in ends.items()}
    shuffled = np.mean([counts[draw] for draw in draws], axis=0)
    numbers = [float(number) for number in said.groups()]
    assert numbers[:4] == [broken.sum(), len(difference), *counts["Hebbian"]]
    assert numbers[4:6] == pytest.approx(shuffled, abs=0.05)
    assert numbers[6:9] == pytest.approx([difference.mean(), low, high], abs=0.02)
    assert numbers[9] == pytest.approx(p, abs=0.02)
    assert numbers[10:12] == counts["Hebbian_0.000015"]
    yoked = np.mean([counts[f"yoked_sign_{draw}"] for draw in range(5)], axis=0)
    assert numbers[12:] == pytest.approx([*yoked, *counts["anti"]], abs=0.05)


ROWS = {  # of the tables of results.md, with their controllers in the sweeps
    "the rule": "Hebbian",
    "no plasticity": "GA",
    "yoked: signs": "yoked_sign",
    "yoked: places": "yoked_place",
    "shuffled signs": "shuffled",
    "shuffled signs, N = 0.00015": "shuffled",
    "the opposite sign": "anti",
    "the opposite sign, N = 0.00005": "anti",
    "the rule, N = 0.00005": "Hebbian",
    "the rule, the paper's N = 0.000015": "Hebbian_0.000015",
}


@pytest.mark.parametrize(
    ("studies", "scenario", "fates"),
    [
        ([["which_end"]], "lowlight", [["all", "broken"]]),
        ([["stopping", "stopping_yoked"], ["stopping_plane"]], "4obstacles", [["broken"], ["broken"]]),
    ],
)
def test_the_ends_of_each_control(studies, scenario, fates):
    """Right and wrong ends in the tables of results.md, means over the draws of a control."""
    told = []
    for together, among in zip(studies, fates, strict=True):
        each = sides_of(*together).xs(scenario, level="scenario")
        name = each.index.get_level_values("controller").str.replace(r"_\d$", "", regex=True)
        draws = pd.Series(each.index.get_level_values("controller")).groupby(name).nunique()
        for fate in among:
            own = each.end[(each.fate == fate) | (fate == "all")]
            kind = own.index.get_level_values("controller").str.replace(r"_\d$", "", regex=True)
            told.append(pd.crosstab(kind, own.to_numpy()).reindex(columns=["right", "wrong"]).div(draws, axis=0))
    page = (ROOT / "docs" / "results.md").read_text()
    rows = re.findall(r"^\| ([^|]+) \|(.*)\|$", page.split(SECTION[scenario])[1].split("\n## ")[0], re.MULTILINE)
    found = {name: re.findall(r"([\d.]+), ([\d.]+)(?: of \d+)? \|", f"{cells}|") for name, cells in rows}
    checked = {name: ends for name, ends in found.items() if name in ROWS}
    assert len(checked) >= 4
    for name, ends in checked.items():
        expected = [table.loc[ROWS[name]].tolist() for table in told if ROWS[name] in table.index]
        np.testing.assert_allclose(np.array(ends, float), np.nan_to_num(expected), atol=1e-9, err_msg=name)


def test_who_is_sooner(outcomes):
    """Where all arrive: whether the rule is sooner than shuffled signs; all flipped signs are listed."""
    time = [
        outcomes["obstacles", "base", *one].time_to_goal_s for one in (("Hebbian", 1.5e-5), ("shuffled signs", 1.5e-5))
    ]
    known = time[0].notna() & time[1].notna() & outcomes["obstacles", "base", "GA", 0.0].time_to_goal_s.notna()
    sooner = np.sign(time[1] - time[0])[known]
    assert ((sooner > 0).sum(), len(sooner)) == (25, 37)
    sums = sooner.groupby("genome").sum().to_numpy()
    flipped = np.array(np.meshgrid(*[[-1, 1]] * np.count_nonzero(sums))).reshape(np.count_nonzero(sums), -1)
    p = (np.abs(sums[sums != 0] @ flipped) >= abs(sums.sum())).mean()
    assert p == 0.0390625
