"""Evaluate a genome: lifetimes in a scenario with and without plasticity, one row of metrics for each.

Every lifetime with plasticity has a twin without it (GA, the control) that hears the same sensor noise, so that all
comparisons are paired.
"""

import zlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from epuckhebb.sim import streams
from epuckhebb.sim.lifetime import Life, Lifetime, Outcome, Samples, live_block
from epuckhebb.sim.maze import SIDES, Side
from epuckhebb.sim.memory import Memory
from epuckhebb.sim.plasticity import Hebbian, Sign, signs
from epuckhebb.sim.scenario import Scenario
from epuckhebb.sim.streams import Stream
from epuckhebb.sim.surprise import NOTHING, Surprise

GA_ALONE, HEBBIAN = "GA", "Hebbian"  # the values of the column `controller`, in the paper's words
CONTROLLER = {Sign.hebbian: HEBBIAN, Sign.anti: "anti-Hebbian", Sign.shuffled: "shuffled signs"}
COLUMNS = (
    "genome",
    "experiment",
    "scenario",
    "light",
    "obstacles",
    "controller",
    "N",
    "signal",
    "side",
    "repeat",
    "seed",
    "success",
    "time_to_goal_s",
    "path_length_m",
    "average_speed_m_s",
    "final_position_error_m",
    "weight_change_mean",
    "weight_change_final",
    "fitness",
    "contact_fraction",
)
_NOT_PLASTIC = Hebbian(N=0.0)


@dataclass(frozen=True, kw_only=True)
class Traces:
    """Recorded lifetimes, all of equal length; first axis: lifetimes.

    controller, side: which lifetime. samples: as in `epuckhebb.sim.lifetime.Samples`, each with the axis of lifetimes
    in front.
    """

    controller: list[str]
    side: list[str]
    samples: Samples


def evaluate(
    genome: NDArray[np.float64],
    scenario: Scenario,
    plasticities: Sequence[Hebbian],
    lifetime: Lifetime,
    memory: Memory | None = None,
    *,
    repeats: int,
    seed: int,
    threads: int = 1,
    name: str = "genome",
) -> tuple[pd.DataFrame, Traces]:
    """Live `repeats` lifetimes a side without plasticity, and as many with each of `plasticities`.

    genome: (234,). memory: what it remembers, for plasticities with a signal of surprise. name: what the column
    `genome` says. Returns one row a lifetime, with the columns `COLUMNS`, and the traces of the first repeat (empty if
    `lifetime.record_every` is 0).

    Raises:
        ValueError: a plasticity needs a memory, and there is none.
        LostRobotError: a pose stopped being finite.
    """
    if memory is None and any(hebbian.surprise is not Surprise.none for hebbian in plasticities):
        raise ValueError("a plasticity with a signal of surprise needs a memory of the training world")
    wanted: list[tuple[str, Hebbian, Side, int]] = [
        (controller, hebbian, side, repeat)
        for controller, hebbian in [(GA_ALONE, _NOT_PLASTIC), *((controller_of(h), h) for h in plasticities)]
        for side in SIDES
        for repeat in range(repeats)
    ]
    lives = [
        Life(
            genome=genome,
            side=side,
            hebbian=hebbian,
            key=streams.key(seed, Stream.evaluation_noise, repeat, SIDES.index(side)),
            signs=signs(hebbian.sign, streams.rng(seed, Stream.shuffled_signs, zlib.crc32(genome.tobytes()))),
            remembered=NOTHING if memory is None else memory.of(side),
            record=repeat == 0,
        )
        for _, hebbian, side, repeat in wanted
    ]
    lived = live_block(lives, scenario, lifetime, threads)
    rows = [
        {
            "genome": name,
            "experiment": scenario.experiment,
            "scenario": scenario.name,
            "light": scenario.light,
            "obstacles": scenario.obstacles,
            "controller": controller,
            "N": hebbian.N,
            "signal": hebbian.signal.name if controller != GA_ALONE else "",
            "side": side,
            "repeat": repeat,
            "seed": seed,
            **_metrics(outcome, lifetime),
        }
        for (controller, hebbian, side, repeat), (outcome, _) in zip(wanted, lived, strict=True)
    ]
    recorded = [(w, samples) for w, (_, samples) in zip(wanted, lived, strict=True) if w[3] == 0]
    traces = Traces(
        controller=[controller for (controller, *_), _ in recorded],
        side=[side for (_, _, side, _), _ in recorded],
        samples=Samples(*(np.stack(arrays) for arrays in zip(*(samples for _, samples in recorded), strict=True))),
    )
    return pd.DataFrame(rows, columns=list(COLUMNS)), traces


def controller_of(hebbian: Hebbian) -> str:
    """What the column `controller` says: the paper's word for the paper's rule, else the rule's own name."""
    return CONTROLLER[hebbian.sign] if hebbian.name in ("none", "paper") else hebbian.name


def _metrics(outcome: Outcome, lifetime: Lifetime) -> dict[str, float]:
    return {
        "success": int(outcome.success),
        "time_to_goal_s": outcome.time_to_goal,
        "path_length_m": outcome.path_length,
        "average_speed_m_s": outcome.path_length / lifetime.duration_s,
        "final_position_error_m": outcome.final_distance,
        "weight_change_mean": outcome.weight_change_mean,
        "weight_change_final": outcome.weight_change_final,
        "fitness": outcome.fitness,
        "contact_fraction": outcome.contact_fraction,
    }
