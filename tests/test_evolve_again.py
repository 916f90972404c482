"""Evolution from a champion, worlds that come back, devices for worlds that change, and the Baldwin effect."""

import json
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from cases import contents, described_columns, done, evolve_in_maze, refused

import epuckhebb
from epuckhebb.analysis.evolutions import readable, summary
from epuckhebb.config import EvolveConfig, load
from epuckhebb.controller.genome import GenomePlan, Part
from epuckhebb.controller.plasticity.rules.paper import Paper
from epuckhebb.evolution import evolve as evolution
from epuckhebb.evolution.optimizers.ga import GA
from epuckhebb.evolution.optimizers.open_es import OpenEs
from epuckhebb.evolution.optimizers.sep_cma_es import SepCmaEs
from epuckhebb.evolution.search import LEARNT, Search
from epuckhebb.evolution.training import UNVARIED, Training
from epuckhebb.runs import prepare_evolution
from epuckhebb.store import load_genome
from epuckhebb.studies.sweep import summarise_multirun
from epuckhebb.tmaze.individual import Controller
from epuckhebb.tmaze.life import Lifetime
from epuckhebb.tmaze.scenario import Scenario

PLAN = GenomePlan((Part("weights", 20), Part("rate", 3, start=0.5, limit=0.75)))
START = np.linspace(-0.7, 0.7, 23)
TINY = ["ga.population=3", "ga.elites=1", "ga.generations=2", "ga.loops=1", "lifetime.duration_s=1", "threads=1"]
TINY += ["figures=none", "-q"]
BRIEF = ["scenario.paper_duration_s=10", "figures=none"]
OTHER, ORIGIN, SHORT = Scenario(left_slip=0.4), Scenario(), Lifetime(duration_s=3, gain_rad_s=4)


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize("key", ["start", "genome"])
def test_a_champion_that_an_evolution_was_given_stays(key):
    np.save("given.npy", load_genome("reference_4", "obstacles").genes)
    rule = ["hebbian=abcd"] if key == "genome" else []
    done("evolve", f"{key}=given.npy", *rule, *TINY, "hydra.run.dir=run")
    np.save("given.npy", load_genome("reference_5", "obstacles").genes)
    assert f"{key}=given.npy" in refused("evolve", "resume=run", "ga.generations=3")
    np.save("given.npy", load_genome("reference_4", "obstacles").genes)
    done("evolve", "resume=run", "ga.generations=3")


@pytest.mark.parametrize("optimizer", [GA(population=6, elites=2), SepCmaEs(sigma=1e-9), OpenEs(sigma=1e-9)])
def test_a_search_begins_at_a_genome(optimizer):
    search = Search(optimizer, PLAN, 5, start=START)
    first = search.ask()
    assert len(first) == optimizer.population
    np.testing.assert_allclose(first[0], START, atol=1e-6)
    if isinstance(optimizer, GA):  # the others are its mutants
        changed = (first[1:] != START).mean(axis=1)
        assert ((changed >= 0) & (changed < 0.4)).all()
        assert changed.any()
    search.tell(np.arange(len(first), dtype=float), {})
    following = search.ask()
    assert Search(optimizer, PLAN, 5, search.log, START).ask().tobytes() == following.tobytes()


def test_a_run_begins_at_a_champion_and_its_file_says_so(here):
    done("evolve", "start=reference_4", *TINY, "hydra.run.dir=one")
    champion, start = load_genome("one", ""), load_genome("reference_4", "obstacles")
    assert champion.start == f"reference_4 (SHA-256 {start.sha256})"
    assert champion.start in done("show", "one").stdout
    done("evolve", "start=one", *TINY, "ga.generations=1", "hydra.run.dir=two")
    done("evolve", "start=one", *TINY, "hydra.run.dir=whole")
    done("evolve", "resume=two", "ga.generations=2", "-q")
    assert contents(here / "two")["history.csv"] == contents(here / "whole")["history.csv"]
    assert "bit-identical" in done("rerun", "two").stdout
    done("evolve", "start=reference_4", "hebbian=baldwin_n", *TINY, "hydra.run.dir=rule")  # its rate begins at 0
    assert load_genome("rule", "").plan.genes == 235


@pytest.mark.parametrize(
    ("words", "texts"),
    [
        (["start=reference_4", "network.layers=[16,4,2]"], ["start=", "network.layers"]),
        (["start=reference_4", "network.wiring=elman"], ["start=", "network.wiring"]),
        (["start=none.npz"], ["start=", "none.npz"]),
        (["start=reference_4", "ga.gene_limit=0.1"], ["start=reference_4", "ga.gene_limit"]),
        (["ga.immigrants=0.9", "ga.memory=5"], ["ga.immigrants", "ga.memory"]),
        (["training=seasons"], ["training.season"]),
        (["training=rehearsal", "change=[slip_left]", "ga.loops=1"], ["training.rehearsal"]),
        (["training.lamarckian=true"], ["training.lamarckian", "hebbian"]),
        (["training.rule_off=true", "hebbian=abcd"], ["training.rule_off", "hebbian"]),
        (["training.lamarckian=true", "hebbian=baldwin", "optimizer=open_es"], ["training.lamarckian"]),
    ],
)
@pytest.mark.usefixtures("here")
def test_what_cannot_be_evolved_is_refused(words, texts):
    told = refused("evolve", *words)
    assert [text for text in texts if text not in told] == []
    assert not Path("runs").exists()


def test_worlds_come_in_turn_and_are_rehearsed():
    turns = Training(season=2)
    worlds = [turns.worlds(OTHER, SHORT, 2, 1, number, ORIGIN) for number in range(8)]
    assert [loops[0].scenario == OTHER for loops in worlds] == [True, True, False, False] * 2
    loops = Training(rehearsal=1).worlds(OTHER, SHORT, 3, 1, 0, ORIGIN)
    assert [world.scenario for world in loops] == [OTHER, OTHER, ORIGIN]
    assert Training(rehearsal=1).loops == 2
    origin = prepare_evolution(load(EvolveConfig, ["scenario=lowlight", "training=seasons"])).world.origin
    assert (origin.light, origin.name) == (1.0, "highlight")


def test_the_limits_of_a_season():
    """Of one generation: over two of them the worlds of a mixture. Longer than the evolution: always the scenario."""
    one = [Training(season=1).worlds(OTHER, SHORT, 1, 1, number, ORIGIN)[0] for number in range(2)]
    assert one == Training(rehearsal=1).worlds(OTHER, SHORT, 2, 1, 0, ORIGIN)
    varied = replace(load(EvolveConfig, ["training=varied", "ga.loops=2"]).training, season=1)
    drawn = replace(varied, season=None)
    for number in range(4):  # what varies is drawn anew for each generation, whichever world it is drawn about
        about = ORIGIN if number % 2 else OTHER
        assert varied.worlds(OTHER, SHORT, 2, 1, number, ORIGIN) == drawn.worlds(about, SHORT, 2, 1, number)
    ga = GA(population=4, elites=1, loops=1, generations=2)
    never, long = (
        list(evolve_in_maze(ga, OTHER, SHORT, 3, training=training, origin=ORIGIN))
        for training in (UNVARIED, Training(season=2))
    )
    assert all((one.fitness == other.fitness).all() for one, other in zip(never, long, strict=True))


def tracked(ga, bests):
    """The generations that a GA asks for, if the best fitness of each is given."""
    search, asked = Search(ga, PLAN, 5), []
    for best in bests:
        asked.append(search.ask())
        search.tell(np.linspace(best, best - 1, len(asked[-1])), {})
    return [*asked, search.ask()]


FALL = [1.0, 1.0, 0.5, 0.5, 0.5, 0.5, 0.5, 1.0, 0.4]
SMALL = GA(population=12, elites=2, mutation_rate=0.0)


def test_devices_that_are_off_change_nothing_and_immigrants_are_random():
    plain, off = tracked(SMALL, FALL), tracked(replace(SMALL, fall=0.2), FALL)
    assert all((one == other).all() for one, other in zip(plain, off, strict=True))
    known = set(plain[0].ravel())
    newcomers = [[not set(who) & known for who in own] for own in tracked(replace(SMALL, immigrants=0.25), FALL)[1:2]]
    assert newcomers == [[False] * 9 + [True] * 3]


def test_more_genes_mutate_while_fitness_has_fallen():
    asked = tracked(replace(SMALL, hypermutation=1.0), FALL)
    mutated = [bool(set(own.ravel()) - set(before.ravel())) for before, own in pairwise(asked)]
    # .5 is below the mean of the last five generations until all of these are at .5
    assert mutated == [False, False, True, True, True, True, True, False, True]


def test_champions_of_earlier_worlds_return_after_a_fall():
    asked = tracked(replace(SMALL, memory=2), FALL)
    before = [asked[1][0], asked[7][0]]  # the fittest of the generation before each fall
    np.testing.assert_array_equal(asked[3][-1], before[0])
    np.testing.assert_array_equal(asked[9][[-1, -2]], before)


def test_children_inherit_what_was_learnt():
    rule = Controller(name="Hebbian", rule=Paper(N=0.01))
    learns = {"lifetime": SHORT, "seed": 3, "controller": rule, "training": Training(lamarckian=True)}
    ga = GA(population=2, elites=2, loops=1, generations=2, gene_limit=0.9)
    first, last = evolve_in_maze(ga, Scenario(), **learns)
    learnt = first.log[0].measures[LEARNT]
    assert learnt.shape == (2, 234)
    search = Search(ga, load(EvolveConfig, []).plan, 3)
    genes = search.ask()
    assert 0 < np.abs(learnt - genes).max() < 1
    search.tell(*first.log[0][1:])
    best = np.argsort(-first.fitness)
    np.testing.assert_array_equal(search.ask(), np.clip(learnt, -0.9, 0.9)[best])
    (resumed,) = evolve_in_maze(ga, Scenario(), after=first, **learns)
    assert (resumed.fitness == last.fitness).all()


def needle(individuals, *_):
    """Hinton and Nowlan's landscape (Complex Systems 1 (1987) 495): 20 alleles, right, wrong or learnt by guessing.

    Fitness is 1 + 19 n / 1000 if none is wrong and n of 1000 trials are left, as expected, once all are guessed, or 1.
    """
    found = []
    for one in individuals:
        alleles = one.genes[:20]
        undecided = int((np.abs(alleles) < 0.5).sum()) if one.controller.rule.N else 0
        p = 0.0 if (alleles < (-0.5 if one.controller.rule.N else 0.5)).any() else 0.5**undecided
        left = 1000 - (1 - (1 - p) ** 1000) / p if p else 0.0
        found.append((SimpleNamespace(fitness=1 + 19 * left / 1000, success=False, steps=1), None))
    return found


def test_the_baldwin_effect_of_hinton_and_nowlan(monkeypatch):
    monkeypatch.setattr(evolution, "run_lifetimes", needle)
    ga = GA(population=1000, elites=0, loops=1, generations=13, mutation_rate=0.0, tournament=20)
    learns = {"controller": Controller(name="Hebbian", rule=Paper(N=0.1)), "training": Training(rule_off=True)}
    learning = list(evolve_in_maze(ga, Scenario(), SHORT, 2, **learns))
    instinct = list(evolve_in_maze(ga, Scenario(), SHORT, 2))
    assert max(one.fitness.max() for one in instinct) == 1  # a needle in a haystack: nobody finds it
    middle = next(one for one in learning if one.fitness.mean() > 5)
    assert (learning[0].remeasured[1], middle.remeasured[1]) == (1, 1)  # learnt first,
    assert middle.remeasured[0] > 5
    assert min(learning[-1].remeasured) > 19.9  # then innate
    assert evolution.history_row(learning[-1])["best_fitness_rule_off"] > 19.9
    assert "best_fitness_rule_off" not in evolution.history_row(instinct[-1])


@pytest.mark.usefixtures("here")
def test_a_multirun_of_evolutions_ends_with_a_table():
    words = ["-m", "ga.population=3,4", "seed=1,2", "hydra.sweep.dir=runs/evolve/many", *TINY[1:-1]]
    assert "summary.csv" in done("evolve", *words).stdout
    table = pd.read_csv("runs/evolve/many/summary.csv")
    assert list(table.columns[-len(described := described_columns("summary.csv of evolve")) :]) == described
    assert (list(table["ga.population"]), list(table.n)) == ([3, 4], [2, 2])
    assert readable(table).rows[0][:2] == ["3", "2"]
    assert "summary.csv" in done("show", "runs/evolve/many").stdout
    assert done("figure", "runs/evolve/many").stdout.split() == ["learning"]
    assert Path(done("figure", "runs/evolve/many", "learning", "-f", "svg").stdout.strip()).is_file()
    own = [epuckhebb.evolve(*TINY[1:-1], "ga.population=4", f"seed={seed}", progress=False) for seed in (1, 2)]
    assert epuckhebb.compare({4: own}).best_fitness[0] == pytest.approx(table.best_fitness[1])
    folders = [Path("runs/evolve/many", str(number)) for number in range(4)]
    np.testing.assert_array_equal(epuckhebb.compare({3: folders[:2], 4: folders[2:]}).n, 2)
    np.testing.assert_array_equal(epuckhebb.compare({4: own * 3, 3: [*folders[:2], folders[0]]}).n, 2)
    with pytest.raises(ValueError, match=r"many/0 and runs/evolve/many/2 in ga"):
        epuckhebb.compare({"all": folders})
    with pytest.raises(ValueError, match="nowhere"):
        epuckhebb.compare({"none": ["nowhere"]})
    for wrong in ({}, [own], {"a": []}, {"a": own[0]}, {"a": "runs"}, {"a": [1]}, {"a": None}):
        with pytest.raises(ValueError, match="names with lists of evolutions"):
            epuckhebb.compare(wrong)


@pytest.mark.usefixtures("here")
def test_an_evolution_counts_once_and_only_when_it_is_finished():
    words = ["-m", "seed=1,1,2", "threads=1,2", *TINY[:5], *BRIEF, "hydra.sweep.dir=many"]
    assert "4 of 6 evolutions are copies" in done("evolve", *words).stderr
    (table,) = pd.read_csv("many/summary.csv").to_dict("records")
    histories = [pd.read_csv(f"many/{number}/history.csv") for number in (0, 4)]
    assert table["n"] == 2
    assert table["best_fitness"] == pytest.approx(np.mean([one.best_fitness.iloc[-1] for one in histories]), rel=1e-12)
    status = json.loads(Path("many/4/status.json").read_text())
    Path("many/4/status.json").write_text(json.dumps(status | {"state": "interrupted"}))
    with pytest.raises(ValueError, match=r"many/4 .* interrupted; resume it with: epuckhebb evolve resume=many/4"):
        epuckhebb.compare({"a": ["many/0", "many/4"]})
    evaluate = ["evaluate", "lifetime.duration_s=0.064", "repeats=1", "figures=none"]
    for number, is_said in ((0, False), (4, True)):
        assert (f"evolve resume=many/{number}" in done(*evaluate, f"genome=many/{number}").stderr) == is_said
    Path("many/5/status.json").write_text("{}")
    told = done(
        "evolve", "-m", "seed=7,7", *TINY[:5], *BRIEF, "hydra.sweep.dir=many", "hydra.sweep.subdir=more${hydra.job.num}"
    )
    assert "Not counted: many/4" in told.stderr
    (table,) = pd.read_csv("many/summary.csv").to_dict("records")
    assert table["n"] == 2
    done("evolve", "resume=many/0", "ga.generations=3", "-q")
    summarise_multirun(Path("many"))
    ways = pd.read_csv("many/summary.csv")
    assert dict(zip(ways.generations, ways.n, strict=True)) == {2: 2, 3: 1}


def test_hours_to_success_are_a_median_over_all_evolutions():
    def history(reached):
        success = [0.5, 0.5, *([1.0, 1.0] if reached else [0.5, 0.5])]
        return pd.DataFrame({"best_fitness": 0.8, "best_success": success, "robot_steps": 112_500})  # an hour each

    few, most = (summary([({}, [history(number < reached) for number in range(8)])]).iloc[0] for reached in (3, 7))
    assert (few.n_reached, most.n_reached, round(most.robot_hours, 9)) == (3, 7, 4)
    assert np.isnan(few.hours_to_success)
    assert most.hours_to_success == pytest.approx(3)
    assert summary([({}, [history(False)])], fitness=0.8).hours_to_success[0] == pytest.approx(1)
    without = summary([({}, [history(False).drop(columns="best_success")])])  # an environment
    assert list(without.columns[:3]) == ["n", "robot_steps", "best_fitness"]
    assert readable(without).rows[0][-1] == "4.5e+05"
