"""Reversal learning: what a life of many trials is, beside the oracle and by hand, and from `evolve` to `show`."""

import itertools
import math
import re
from collections import Counter
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from cases import done, first_of, refused

from epuckhebb.analysis import charts, reversal
from epuckhebb.analysis.image import image
from epuckhebb.config import EvaluateConfig, load
from epuckhebb.controller.genome import make_plan
from epuckhebb.controller.network import Network
from epuckhebb.controller.plasticity.rule import Acts, Reward, modulatory_weights, part_values
from epuckhebb.controller.plasticity.rules.modulated import Modulated
from epuckhebb.controller.plasticity.rules.paper import Paper
from epuckhebb.controller.plasticity.update import make_modulation
from epuckhebb.controller.random import Stream, rng
from epuckhebb.evolution.optimizer import initial
from epuckhebb.store.genome import load_genome
from epuckhebb.tmaze.batch import run_lifetimes
from epuckhebb.tmaze.fitness import Signal
from epuckhebb.tmaze.individual import GA_ALONE, Controller, Individual
from epuckhebb.tmaze.life import Lifetime
from epuckhebb.tmaze.light import Lamp
from epuckhebb.tmaze.scenario import Scenario
from epuckhebb.tmaze.task import TRIAL
from epuckhebb.tmaze.tasks.reversal import First, Reversal

REWARDED = Network((17, 7, 5, 8, 4, 2), rewarded=True)
MODULATED = Controller(name="modulated", rule=Modulated(N=0.003))
SMALL = ["optimizer=sep_cma_es", "optimizer.population=4", "optimizer.starts=3", "optimizer.confirm=2"]
SMALL += ["optimizer.generations=1", "task.trials=2", "task.last_switch=2", "task.time_out_s=2", "threads=1", "-q"]


def world(**task):
    return Scenario(task=Reversal(**task), lamp=Lamp(intensity=0.0))


def switching(trial, **task):
    """A world in which the other end is rewarded from this trial on, for certain."""
    return world(first_switch=trial, last_switch=trial, never=0.0, **task)


def drawn(seed):
    """Genes of the network with a reward input, and of a rule that receives it."""
    return initial(np.random.default_rng(seed), 1, make_plan(REWARDED, Modulated))[0]


# Beside the oracle


@pytest.mark.parametrize(
    ("controller", "side", "seed"),
    first_of(
        [
            (MODULATED, "left", 897),  # comes to one end, to none, to the other
            (MODULATED, "right", 897),
            (GA_ALONE, "left", 2547),  # to one in each trial
            (Controller(name="paper", rule=Paper(N=0.00002, signal=Signal.lifetime_mean)), "right", 2547),
        ]
    ),
)
def test_a_life_of_trials_agrees_with_the_oracle(controller, side, seed, beside_the_oracle):
    genes = drawn(seed) if controller is MODULATED else drawn(seed)[: REWARDED.synapses]
    scenario = switching(2, trials=3, time_out_s=16.0, time_outs=2)
    outcome, samples, robot = beside_the_oracle(genes, side, scenario, controller, REWARDED, seconds=55.0)
    assert robot.over
    assert len(robot.trials) == 3
    names = {"left": -1, "right": 1, None: 0}
    for trial, expected in zip(outcome.trials, robot.trials, strict=True):
        assert (trial["good"], trial["reached"]) == (names[expected["good"]], names[expected["reached"]])
        assert trial["steps"] == expected["steps"]
        assert trial["nearest"] == pytest.approx(expected["nearest"], rel=1e-9)
    assert {1.0, -1.0} & set(samples.sensors[:, 16])


# A life by hand


@pytest.fixture(scope="module")
def recorded():
    """A life that comes to the right end in each trial, of which the left is rewarded first, and its samples."""
    genes = drawn(2547)[: REWARDED.synapses]
    individual = Individual(genes=genes, side="left", key=np.uint64(9), network=REWARDED, record=True)
    lifetime = Lifetime(duration_s=60, gain_rad_s=4.0, record_every=1)
    return run_lifetimes([individual], switching(3, trials=3), lifetime)[0]


def test_the_reward_is_given_for_the_last_second_at_an_end(recorded):
    outcome, samples = recorded
    assert outcome.trials["good"].tolist() == [-1, -1, 1]
    assert outcome.trials["reached"].tolist() == [1, 1, 1]
    expected, first = np.zeros(len(samples.time)), 0
    for steps, reward in zip(outcome.trials["steps"], (-1, -1, 1), strict=True):
        expected[first + steps : first + steps + 31] = reward  # 31 whole steps are in a second
        first += steps + 31
    np.testing.assert_array_equal(samples.sensors[:, 16], expected)
    assert outcome.steps == first < 60 / 0.032


@pytest.mark.thorough
def test_wheels_that_lag_begin_each_trial_at_rest():
    """A network whose weights are 0 never moves."""
    scenario = Scenario(task=Reversal(trials=3, time_out_s=2.0), lamp=Lamp(intensity=0.0), mass_ratio=2.0)
    still = Individual(genes=np.zeros(REWARDED.synapses), side="left", key=np.uint64(9), network=REWARDED, record=True)
    ((outcome, samples),) = run_lifetimes([still], scenario, Lifetime(duration_s=10, record_every=1))
    assert len(outcome.trials) == 3
    assert (samples.pose == scenario.maze.start).all()


def test_each_trial_begins_at_the_start_at_rest(recorded):
    outcome, samples = recorded
    begins = np.cumsum(outcome.trials["steps"] + 31)[:-1]
    start = Scenario().maze.start
    assert (samples.pose[begins] == start).all()
    assert (samples.pose[begins + 1] == start).all()  # a command moves the robot in the step after
    assert (np.abs(samples.pose[begins - 1] - start).max(axis=1) > 0.3).all()
    assert outcome.path_length == pytest.approx(
        sum(
            np.hypot(*np.diff(part[:, :2], axis=0).T).sum() for part in np.split(samples.pose, [*begins, outcome.steps])
        ),
        abs=0.003 * 3,  # the last step of a trial is in no sample
    )


def test_a_robot_stays_where_its_life_was_over(recorded):
    outcome, samples = recorded
    after = slice(outcome.steps, None)
    assert np.ptp(samples.pose[after], axis=0).max() == 0
    assert (samples.motors[after] == 0).all()
    np.testing.assert_allclose(np.diff(samples.time), 0.032)


@pytest.mark.thorough
def test_weights_live_on_and_the_history_of_the_fitness_does_not():
    genes, lifetime = drawn(897), Lifetime(duration_s=60, gain_rad_s=4.0, record_every=1)
    settings = {"genes": genes, "side": "left", "key": np.uint64(9), "network": REWARDED, "record": True}
    ((outcome, samples),) = run_lifetimes(
        [Individual(controller=MODULATED, **settings)], switching(2, trials=3), lifetime
    )
    begin = int(outcome.trials["steps"][0]) + 31
    before, after = samples.weights[begin - 1], samples.weights[begin]
    assert np.abs(before - samples.weights[0]).max() > 0.1
    assert np.abs(after - before).max() < 0.01
    mean = Controller(name="paper", rule=Paper(N=1e-9, signal=Signal.lifetime_mean))
    settings |= {"genes": drawn(2547)[: REWARDED.synapses]}
    ((outcome, samples),) = run_lifetimes([Individual(controller=mean, **settings)], switching(2, trials=3), lifetime)
    begin = int(outcome.trials["steps"][0]) + 31
    assert samples.fitness[begin] == pytest.approx(samples.fitness[0], abs=1e-4) != samples.fitness[begin - 1]


def test_a_trial_has_its_time_and_a_life_so_many_time_outs():
    still = Individual(genes=np.zeros(REWARDED.synapses), side="left", key=np.uint64(1), network=REWARDED)
    ((outcome, _),) = run_lifetimes([still], world(time_out_s=1.0), Lifetime(duration_s=20))
    assert outcome.trials["steps"].tolist() == [31, 31] + 8 * [0]
    assert outcome.steps == 62
    assert not outcome.trials["reached"].any()
    assert outcome.fitness == 0


# What is drawn, and what can be expected of it


def test_one_switch_is_drawn_as_in_earlier_results():
    task = Reversal()
    for key in range(200):
        never, place = rng(key, Stream.switches).random(2)
        assert task.drawn_switches(key) == ([] if never < 1 / 8 else [2 + int(place * 7)])


def sets_of(task):
    """All sets of switches two trials or more apart, with the probability of each."""
    trials = range(task.first_switch, task.last_switch + 1)
    sets = [one for one in itertools.combinations(trials, task.switches) if all(np.diff(one) >= 2)]
    never = task.never if task.switches else 0.0
    return {(): never} | {one: (1 - never) / len(sets) for one in sets}


@pytest.mark.parametrize(
    "task", [Reversal(), Reversal(switches=3), Reversal(switches=2, last_switch=6, never=0.3), Reversal(switches=0)]
)
def test_all_sets_of_switches_are_equally_likely(task):
    counts, keys = Counter(tuple(task.drawn_switches(key)) for key in range(6000)), 6000
    expected = {one: keys * chance for one, chance in sets_of(task).items() if chance}
    assert counts.keys() == expected.keys()
    assert all(abs(counts[one] - count) <= 5 * math.sqrt(count) for one, count in expected.items())


@pytest.mark.parametrize("switches", [0, 1, 3])
def test_the_rewarded_end_changes_at_every_switch(switches):
    drawn, left = (Reversal(switches=switches, first=first) for first in First)
    for key in range(20):
        one, other = (drawn.initial_trials(side, key)["good"] for side in ("left", "right"))
        assert (one == -other).all()
        assert one[0] == -1
        assert (np.flatnonzero(np.diff(one)) + 2).tolist() == drawn.drawn_switches(key)
        for side in ("left", "right"):
            assert (left.initial_trials(side, key)["good"] == one).all()


def test_the_default_of_the_last_switch_fits_the_trials():
    assert [Reversal(trials=trials).last_switch for trials in (2, 5, 8, 30)] == [2, 5, 8, 8]


@pytest.mark.parametrize(("trials", "switches", "most"), [(10, 5, 4), (5, 3, 2), (2, 2, 1)])
def test_switches_that_do_not_fit_are_refused(trials, switches, most):
    with pytest.raises(
        ValueError, match=rf"task\.switches must be at most {most}\b.*task\.trials={trials}\b.*got {switches}"
    ):
        Reversal(trials=trials, switches=switches)
    assert Reversal(trials=trials, switches=most).drawn_switches(1)


def test_any_fixed_sequence_of_ways_gets_half_of_the_rewards_exactly():
    task = Reversal(trials=5, switches=2)
    for ways in itertools.product((-1, 1), repeat=5):
        for key in range(10):
            trials = [task.initial_trials(side, key)["good"] for side in ("left", "right")]
            assert np.mean([good == ways for good in trials]) == 0.5


def courses(task):
    """The good ends of all lifetimes that can be, 1 for the end that may be first, with the probability of each."""
    for first in (1, -1) if task.first is First.drawn else (1,):
        for switches, chance in sets_of(task).items():
            ends = [first * (-1) ** sum(switch <= trial for switch in switches) for trial in range(1, task.trials + 1)]
            yield ends, chance / (2 if task.first is First.drawn else 1)


def best_choices(task):
    """How probable either end is in the next trial, -1 first, by the good ends of all trials before."""
    weights = {}
    for ends, chance in courses(task):
        for trial, end in enumerate(ends):
            weights.setdefault(tuple(ends[:trial]), [0.0, 0.0])[end > 0] += chance
    return weights


def all_small_tasks():
    for trials, never, first in itertools.product(range(2, 8), (0.0, 0.125, 0.7, 1.0), First):
        for begin, end in itertools.combinations_with_replacement(range(2, trials + 1), 2):
            for switches in range((end - begin) // 2 + 2):
                window = {"first_switch": begin, "last_switch": end}
                yield Reversal(trials=trials, switches=switches, never=never, first=first, **window)


def test_the_limits_are_those_of_all_lifetimes_that_can_be():
    for task in all_small_tasks():
        optimum = sum(map(max, best_choices(task).values()))
        fixed = sum(
            max(sum(chance for ends, chance in courses(task) if ends[trial] == end) for end in (-1, 1))
            for trial in range(task.trials)
        )
        expected = {"chance": fixed / task.trials, "optimum": optimum / task.trials}
        assert task.limits() == pytest.approx(expected, abs=1e-12), task


@pytest.mark.parametrize(
    ("task", "chance", "optimum"),
    [
        (Reversal(), 0.5, 0.8625),
        (Reversal(first_switch=4, last_switch=4, never=0.0), 0.5, 0.95),  # a change that is certain can be counted
        (Reversal(trials=5, never=0.0), 0.5, (0.5 + 0.75 + 0.75 + 0.75 + 1) / 5),  # the last switch shows itself early
        (Reversal(trials=5, switches=0), 0.5, 0.9),
        (Reversal(trials=5, switches=0, first=First.left), 1.0, 1.0),
        (Reversal(trials=5, first=First.left, never=0.0), (1 + 0.75 + 0.5 + 0.75 + 1) / 5, 0.85),
        (Reversal(trials=5, switches=2, last_switch=4, never=0.0), 0.5, 0.9),  # at 2 and 4, nowhere else
    ],
)
def test_limits_by_hand(task, chance, optimum):
    assert task.limits() == pytest.approx({"chance": chance, "optimum": optimum})


@pytest.mark.parametrize("first", First)
def test_who_chooses_best_gets_the_optimum(first):
    task = Reversal(trials=30, switches=3, last_switch=20, first=first)
    weights, shares = best_choices(task), []
    for key in range(2000):
        for side in ("left", "right"):
            ends = (-task.initial_trials(side, key)["good"]).tolist()
            best = [weights[tuple(ends[:trial])] for trial in range(30)]
            shares.append(
                np.mean([(right >= left) == (end > 0) for (left, right), end in zip(best, ends, strict=True)])
            )
    error = np.std(shares) / math.sqrt(2000)  # the lifetimes of a pair are not independent
    assert abs(np.mean(shares) - task.limits()["optimum"]) < 4 * error


def test_the_fitness_is_the_rewarded_share_and_a_little_for_coming_near():
    trials = np.zeros(10, TRIAL)
    trials["good"], trials["nearest"] = 1, math.inf
    trials["reached"][:4] = 1, 1, 1, -1
    trials["nearest"][4:6] = 0.3, 0.6
    assert Reversal().fitness(0.5, 0.5, trials, 0.6) == pytest.approx(0.3 + 0.1 * 0.4 + 0.1 * (4 + 0.5) / 10)


# The reward and the rule


def test_the_modulatory_neuron_hears_the_reward_or_its_inverse():
    network = Network((3, 2, 2), rewarded=True)
    genes = {"v": np.array([1.0, -2.0, 0.5]), "vr": np.array([-0.5]), "eta": np.array([0.3])}
    values = part_values(Modulated, network, genes)
    assert values["eta"] * 0.003 == pytest.approx(10**-1.7)
    modulate, activation = make_modulation(Modulated, network), np.zeros(network.neurons)
    activation[4:6] = 1.0, 0.5
    for reward in (0.0, 1.0, -1.0):
        activation[2] = reward
        for given, sign in ((Reward.given, 1), (Reward.inverted, -1)):
            weights = modulatory_weights(Modulated, values, given)
            drive = 0.2 * (1.0 - 1.0 + 0.5) + sign * 2.0 * reward
            assert modulate(weights, activation) == pytest.approx(np.tanh(drive / 2), rel=1e-14)
    assert make_plan(REWARDED, Modulated).text() == "241 weights, 5 v, 1 A, 1 B, 1 C, 1 D, 1 eta, 1 vr"


# Frozen weights


@pytest.fixture(scope="module")
def frozen():
    """Lifetimes of a rule and of the same rule that acts before the change, in worlds of these switches."""

    def of(scenario):
        lifetime = Lifetime(duration_s=90, gain_rad_s=4.0, record_every=1)
        shared = {"genes": drawn(897), "side": "left", "key": np.uint64(9), "network": REWARDED, "record": True}
        rules = (Modulated(N=0.003, acts=acts) for acts in Acts)
        individuals = [Individual(controller=Controller(name="m", rule=rule), **shared) for rule in rules]
        return run_lifetimes(individuals, scenario, lifetime)

    return of


@pytest.mark.parametrize(
    ("scenario", "frozen_from"),
    first_of(
        [
            (switching(3, trials=5, time_out_s=16.0, time_outs=9), 3),
            (world(trials=5, switches=2, last_switch=4, never=0.0, time_out_s=16.0, time_outs=9), 2),  # at 2 and 4
            (world(trials=5, switches=0, time_out_s=16.0, time_outs=9), 3),  # (2 + 5) // 2
            (world(trials=5, never=1.0, time_out_s=16.0, time_outs=9), 3),
        ]
    ),
)
def test_weights_are_frozen_from_the_first_switch_on(frozen, scenario, frozen_from):
    (own, samples), (outcome, its) = frozen(scenario)
    earlier = outcome.trials[: frozen_from - 1]
    begin = int((earlier["steps"] + 31 * (earlier["reached"] != 0)).sum())
    assert 0 < begin < outcome.steps
    for name in ("pose", "sensors", "weights"):
        np.testing.assert_array_equal(getattr(its, name)[:begin], getattr(samples, name)[:begin])
    assert np.abs(its.weights[begin] - its.weights[0]).max() > 0.1
    assert np.ptp(its.weights[begin - 1 :], axis=0).max() == 0
    assert np.ptp(samples.weights[begin:], axis=0).max() > 0.1
    assert (own.trials["frozen"] == outcome.trials["frozen"]).all()
    assert outcome.trials["frozen"].tolist() == [trial >= frozen_from for trial in range(1, 6)]


# From `evolve` to `show`


@pytest.fixture(scope="module")
def champions(tmp_path_factory):
    """A folder with an evolution of a rule for the task; not to be changed."""
    folder = tmp_path_factory.mktemp("champions")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        done("evolve", "task=reversal", "hebbian=modulated", *SMALL, "hydra.run.dir=modulated")
    return folder


@pytest.mark.usefixtures("here")
def test_from_evolve_to_show(champions):
    champion, run = str(champions / "modulated"), "run"
    genome = load_genome(champion, "obstacles")
    assert (genome.network, genome.task, genome.nominal) == (REWARDED, "reversal", None)
    shown = " ".join(done("show", champion).stdout.split())
    assert "rule modulated, task reversal" in shown
    assert "reached its goal" not in shown
    brief = ["repeats=2", "task.time_out_s=2", "threads=1", "hydra.run.dir=run"]
    shown = done("evaluate", f"genome={champion}", "task=reversal", "hebbian=modulated", *brief).stdout
    assert "(task=reversal, task.time_out_s=2): genome modulated" in shown
    assert re.findall(r"^(chance|optimum) +(\S+)", shown, re.MULTILINE) == [("chance", "0.500"), ("optimum", "0.863")]
    assert not re.search("Success|the goal|lamp", shown)
    assert not Path(f"{run}/table.csv").exists()
    rows, trials = pd.read_csv(f"{run}/metrics.csv"), pd.read_csv(f"{run}/reversal_trials.csv")
    names = ["GA", "modulated", "modulated (reward inverted)"]
    assert list(rows.controller.unique()) == names
    assert len(rows) == 3 * 2 * 2
    assert rows.end.isna().all()  # a lifetime of many trials has none
    assert len(trials) == len(rows) * 10
    assert (rows.groupby("repeat").switch_trial.nunique(dropna=False) == 1).all()  # both sides, all controllers
    assert rows.changed.unique().tolist() == ["task=reversal, task.time_out_s=2"]
    summary = pd.read_csv(f"{run}/reversal.csv").set_index("controller").rewarded_share
    assert summary.index.tolist() == [*names, "chance", "optimum"]
    assert summary.tolist()[3:] == [0.5, 0.8625]
    for name in names:
        shares = [
            rows[rows.controller == name].rewarded_share.mean(),
            trials[trials.controller == name].rewarded.mean(),
        ]
        assert shares == pytest.approx([summary[name]] * 2)
    done("replay", run, "--output=page.html")
    done("rerun", run, "-q")


@pytest.mark.usefixtures("here")
def test_a_champion_beside_its_own_frozen_weights_and_beside_none_that_change(champions):
    brief = ["repeats=2", "task.time_out_s=2", "task.time_outs=3", "task.trials=3", "task.never=0"]
    brief += ["threads=1", "hydra.run.dir=run"]
    controls = ["compare.frozen={acts: before_change}", "compare.off={N: 0}"]
    done("evaluate", f"genome={champions / 'modulated'}", "task=reversal", "hebbian=modulated", *controls, *brief)
    rows = pd.read_csv("run/metrics.csv").drop(columns=["N", "signal", "weight_path"]).set_index("controller")
    assert rows.index.unique().tolist() == ["GA", "modulated", "modulated (reward inverted)", "frozen", "off"]
    assert rows.loc["off"].reset_index(drop=True).equals(rows.loc["GA"].reset_index(drop=True))
    changes = rows.weight_change_mean
    assert (changes["frozen"].to_numpy() < changes["modulated"].to_numpy()).all()


@pytest.mark.usefixtures("here")
def test_a_lifetime_is_as_long_as_its_trials_and_both_of_a_pair_may_have_the_left_end_first(champions):
    words = ["task=reversal", "hebbian=modulated", "task.trials=4", "task.time_out_s=2", "task.first=left"]
    done("evaluate", f"genome={champions / 'modulated'}", *words, "repeats=3", "threads=1", "hydra.run.dir=run")
    rows, trials = pd.read_csv("run/metrics.csv"), pd.read_csv("run/reversal_trials.csv")
    assert load(EvaluateConfig, words).lifetime.duration_s == 12
    assert trials[trials.trial == 1].rewarded_side.unique().tolist() == ["left"]
    assert (rows.groupby("repeat").switch_trial.nunique(dropna=False) == 1).all()
    assert not rows[rows.controller == "GA"].path_length_m.duplicated().any()  # no lifetime is there twice
    shares = pd.read_csv("run/reversal.csv").set_index("controller").rewarded_share
    assert shares["chance"] == pytest.approx(Reversal(trials=4, first=First.left).limits()["chance"])
    of_pairs = rows[rows.controller == "GA"].groupby("repeat").rewarded_share.mean()
    assert shares["GA"] == pytest.approx(of_pairs.mean())


@pytest.mark.parametrize(
    ("words", "named"),
    [([], "task="), (["task=reversal", "adaptation=late"], "adaptation=late"), (["task=revrsal"], "reversal")],
)
def test_what_makes_no_sense_is_refused(words, named, champions, monkeypatch):
    monkeypatch.chdir(champions)
    assert named in refused("evaluate", "genome=modulated", "hebbian=modulated", *words)


def test_the_figure_and_table_of_no_switch_and_of_ties():
    """All lifetimes alike: no interval, and no place around the switch in lifetimes without one."""
    row = {"genome": "g", "controller": "GA", "seed": 1}
    lifetimes = [{**row, "side": side, "repeat": 0} for side in ("left", "right")]
    metrics = pd.DataFrame([{**lifetime, "rewarded_share": 0.5} for lifetime in lifetimes])
    each = [{"trial": n, "rewarded_side": "left", "reached_side": "left", "rewarded": 1} for n in (1, 2)]
    trials = pd.DataFrame([{**lifetime, **trial} for lifetime in lifetimes for trial in each])
    table = reversal.table(metrics, trials, Reversal(), 1)
    assert table.rewarded_share.tolist() == [0.5, 0.5, 0.8625]
    assert image(charts.reversal(table, trials, "a title")).startswith(b"\x89PNG")
    assert "| optimum | 0.863 |" in reversal.readable(table).markdown()


def test_the_figure_shows_trials_around_every_switch():
    """Rewarded but in the two trials in which the end has just changed."""
    sides = [*["left"] * 2, *["right"] * 3, *["left"] * 2]
    rows = [
        {"controller": "GA", "side": "left", "repeat": 0, "trial": trial, "rewarded_side": side}
        | {"rewarded": int(trial not in (3, 6))}
        for trial, side in enumerate(sides, start=1)
    ]
    table = pd.DataFrame({"controller": ["GA", "chance"], "lifetimes": [1, None], "rewarded_share": [5 / 7, 0.5]})
    line = charts.reversal(table, pd.DataFrame(rows), "a title").axes[0].lines[0]
    assert line.get_xdata().tolist() == [-2, -1, 0, 1, 2]
    assert line.get_ydata().tolist() == [1, 1, 0, 1, 1]
