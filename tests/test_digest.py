"""The bits of today: metrics of bundled champions in every scenario with every controller, and two tiny evolutions.

A change that must not change results leaves its golden files alone. Each of them holds `SCIENCE`, too, and is written
anew only after that number was raised. In the ordinary suite only the paper's rule lives;
`pytest -m "not slow" tests/test_digest.py` has all controllers. `--regenerate` writes them anew; whoever does that
says in the changelog which results are others now.
"""

import hashlib
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from cases import evolve_in_maze

from epuckhebb.analysis.evaluate import COLUMNS, evaluate
from epuckhebb.config.compose import composed
from epuckhebb.config.schema import EvaluateConfig, EvolveConfig, typed
from epuckhebb.evolution.search import Search
from epuckhebb.store.genome import load_genome
from epuckhebb.store.provenance import SCIENCE
from epuckhebb.tmaze.individual import GA
from epuckhebb.tmaze.scenario import TRAINED

GOLDEN = Path(__file__).parent / "golden"
METRICS = list(COLUMNS[COLUMNS.index("success") : COLUMNS.index("changed")])
CHAMPIONS = ("reference_1", "reference_101")
LEARNER = Path(__file__).parents[1] / "runs" / "reference" / "reversal" / "learner_210.npz"
PAPER = {"paper": ["hebbian=paper"]}  # name, as it was when the digest was made -> overrides
OTHERS = {
    "final": ["hebbian.signal=final"],
    "lifetime_mean": ["hebbian.signal=lifetime_mean"],
    "light_code": ["hebbian.signal=light_code"],
    "anti": ["hebbian.sign=anti"],
    "shuffled": ["hebbian.sign=shuffled"],
    "other_constants": ["hebbian.N=0.01", "hebbian.trace_decay=0.5", "hebbian.trace_update=0.3", "hebbian.w_max=1.5"],
    "adaptive": ["adaptation=late"],
    "adaptive_unshaken": ["adaptation=late_steady"],
    "adaptive_shortfall": ["adaptation=shortfall"],
    "adaptive_novelty": ["adaptation=novelty"],
    "adaptive_anti": ["adaptation=late", "hebbian.sign=anti"],
    "adaptive_shuffled": ["adaptation=late", "hebbian.sign=shuffled", "adaptation.slope=2"],
    "shaken_only": ["adaptation=late", "hebbian=none"],
}
PAPER_SCENARIOS = [  # those of version 0.1
    *("2obstacles", "4obstacles", "base", "base_blind", "base_bright", "base_half", "base_moved1", "base_moved2"),
    *("base_weak", "highlight", "highlight_30", "highlight_4obstacles", "highlight_50", "highlight_70"),
    *("highlight_blind", "highlight_moved1", "highlight_weak", "lowlight"),
]


def digest(numbers):
    return hashlib.sha256(np.ascontiguousarray(numbers, "<f8").tobytes()).hexdigest()[:16]


@pytest.fixture
def bits(golden, request):
    """Compare digests with the golden file of that name."""

    def compare(name, lines):
        text, before = "\n".join([f"science {SCIENCE}", *lines, ""]), (GOLDEN / f"{name}.digest").read_text()
        if request.config.getoption("--regenerate") and before != text:
            same = before.startswith(f"science {SCIENCE}\n")
            assert not same, "results have other bits: raise SCIENCE in epuckhebb/store/provenance.py first"
        golden(f"{name}.digest", text)

    return compare


def config(*overrides):
    return typed(composed("evaluate", [*overrides, "lifetime.record_every=0"]), EvaluateConfig)


@pytest.mark.parametrize(
    ("treatments", "file"),
    [(PAPER, "lifetimes"), pytest.param(OTHERS, "other_lifetimes", marks=pytest.mark.thorough)],
    ids=["paper", "others"],
)
def test_lifetimes_have_the_same_bits(treatments, file, bits):
    worlds = {name: config(f"scenario={name}") for name in PAPER_SCENARIOS}
    champions = {(one, where): load_genome(where, one) for one in TRAINED for where in CHAMPIONS}
    told = []
    for name, overrides in treatments.items():
        controllers = {one: config(f"scenario={home}", *overrides).controllers for one, home in TRAINED.items()}
        rows = []
        for world in worlds.values():
            one = world.world.experiment
            for where in CHAMPIONS:
                genome, live = champions[one, where], (controllers[one], world.lifetime)
                lived, _ = evaluate(genome.genes, world.world, *live, genome.nominal, repeats=1, seed=3, threads=2)
                rows.append(pd.DataFrame(lived))
        if name == "paper":
            told.append(f"GA {digest([r[r.controller == GA][METRICS].to_numpy(float) for r in rows])}")
        told.append(f"{name} {digest([r[r.controller != GA][METRICS].to_numpy(float) for r in rows])}")
    bits(file, told)


def test_yoked_lifetimes_have_the_same_bits(bits):
    told, champion = [], load_genome(CHAMPIONS[1], "light")
    for control in ("yoked_sign", "yoked_place"):
        asked = config("scenario=lowlight", f"hebbian.control={control}", "hebbian.sign_draw=1")
        lived, _ = evaluate(champion.genes, asked.world, asked.controllers, asked.lifetime, repeats=1, seed=3)
        rows = pd.DataFrame(lived)
        told.append(f"{control} {digest(rows[rows.controller != GA][[*METRICS, 'weight_path']].to_numpy(float))}")
    bits("controls", told)


@pytest.mark.thorough
def test_lifetimes_of_many_trials_have_the_same_bits(bits):
    asked = config("task=reversal", "hebbian=modulated")
    genome = load_genome(str(LEARNER), asked.world.experiment)
    live, parts = (asked.world, asked.controllers, asked.lifetime), {"network": genome.network, "plan": genome.plan}
    lived, _ = evaluate(genome.genes, *live, repeats=2, seed=3, threads=2, **parts)
    told = [
        f"{name} {digest(rows[[*METRICS, 'rewarded_share']].to_numpy(float))}"
        for name, rows in pd.DataFrame(lived).groupby("controller")
    ]
    bits("reversal", told)


@pytest.mark.parametrize("overrides", [["ga=textbook"], ["ga=as_coded", "scenario=highlight", "ga.start_noise=1"]])
def test_an_evolution_has_the_same_bits(overrides, bits):
    small = ["ga.population=8", "ga.generations=3", "ga.elites=2", "ga.loops=1", "lifetime.duration_s=20", "seed=5"]
    asked = typed(composed("evolve", [*overrides, *small]), EvolveConfig)
    *_, last = evolve_in_maze(asked.ga, asked.world, asked.lifetime, asked.seed, threads=2)
    following = Search(asked.ga, asked.plan, asked.seed, last.log).ask()
    told = [digest(part) for part in (following, last.fitness, last.champion)]
    bits(f"evolution_{overrides[0].partition('=')[2]}", told)
