"""The bits of today: metrics of bundled champions in every scenario with every plasticity, and a tiny evolution.

A change that must not change results leaves this file's numbers alone. `--regenerate` writes them anew; whoever does
that says in the changelog which results are others now.
"""

import hashlib

import numpy as np
import pytest

from epuckhebb.app import files
from epuckhebb.app.config import EvaluateConfig, EvolveConfig, typed
from epuckhebb.app.data import groups
from epuckhebb.app.hydra_bridge import composed
from epuckhebb.evolution.evolve import evolve
from epuckhebb.study.evaluate import COLUMNS, GA_ALONE, evaluate

METRICS = list(COLUMNS[COLUMNS.index("success") :])
CHAMPIONS = ("reference_1", "reference_101")
TREATMENTS = {  # name -> overrides
    "paper": ["hebbian=paper"],
    "final": ["hebbian.signal=final"],
    "lifetime_mean": ["hebbian.signal=lifetime_mean"],
    "light_code": ["hebbian.signal=light_code"],
    "anti": ["hebbian.sign=anti"],
    "shuffled": ["hebbian.sign=shuffled"],
    "other_constants": ["hebbian.N=0.01", "hebbian.trace_decay=0.5", "hebbian.trace_update=0.3", "hebbian.w_max=1.5"],
    "adaptive": ["hebbian=adaptive"],
    "adaptive_unshaken": ["hebbian=adaptive_unshaken"],
    "adaptive_shortfall": ["hebbian=adaptive_shortfall"],
    "adaptive_novelty": ["hebbian=adaptive_novelty"],
    "adaptive_anti": ["hebbian=adaptive", "hebbian.sign=anti"],
    "adaptive_shuffled": ["hebbian=adaptive", "hebbian.sign=shuffled", "hebbian.ramp=0.5"],
    "shaken_only": ["hebbian=adaptive", "hebbian.N=0"],
}


def digest(numbers):
    return hashlib.sha256(np.ascontiguousarray(numbers, "<f8").tobytes()).hexdigest()[:16]


def evaluated(overrides, scenario):
    words = [*overrides, f"scenario={scenario}", "lifetime.record_every=0"]
    config = typed(composed("evaluate", words), EvaluateConfig)
    parts = []
    for where in CHAMPIONS:
        genome = files.load_genome(where, config.scenario.experiment)
        rows, _ = evaluate(
            genome.genes,
            config.scenario,
            config.plasticities,
            config.lifetime,
            genome.memory,
            repeats=1,
            seed=3,
            threads=2,
        )
        parts.append(rows)
    return parts


@pytest.fixture(scope="module")
def scenarios():
    return groups("evaluate")["scenario"]


def test_lifetimes_have_the_same_bits(scenarios, golden):
    told = []
    for name, overrides in TREATMENTS.items():
        rows = [part for scenario in scenarios for part in evaluated(overrides, scenario)]
        if name == "paper":
            told.append(f"GA {digest([r[r.controller == GA_ALONE][METRICS].to_numpy(float) for r in rows])}")
        told.append(f"{name} {digest([r[r.controller != GA_ALONE][METRICS].to_numpy(float) for r in rows])}")
    golden("lifetimes.digest", "\n".join(told) + "\n")


@pytest.mark.parametrize("overrides", [["ga=textbook"], ["ga=as_coded", "scenario=highlight", "ga.start_noise=1"]])
def test_an_evolution_has_the_same_bits(overrides, golden):
    small = ["ga.population=8", "ga.generations=3", "ga.elites=2", "ga.loops=1", "lifetime.duration_s=20", "seed=5"]
    config = typed(composed("evolve", [*overrides, *small]), EvolveConfig)
    *_, last = evolve(config.ga, config.scenario, config.lifetime, config.seed, threads=2)
    told = [digest(part) for part in (last.population, last.fitness, last.champion)]
    golden(f"evolution_{overrides[0].partition('=')[2]}.digest", "\n".join(told) + "\n")
