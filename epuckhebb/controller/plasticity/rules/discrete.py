"""Discrete plasticity: a table gives the update for each state of two neurons and each reinforcement.

    a = 1 if x > threshold, else 0                  state of a neuron
    m = 1 if F > high, else -1 if F < low, else 0   reinforcement, of the live fitness F
    D = eta r(m, a_j, a_i)                          r from a table of -1, 0 and 1, eight entries; r(0, ..) = 0

After each update the incoming weights of each neuron get back their initial length (`normalise`). Evolved are the
table, eta, the threshold, and `high` and `low`.

Source: Yaman, Iacca, Mocanu, Coler, Fletcher & Pechenizkiy, Evolving plasticity for autonomous learning under changing
environmental conditions, Evolutionary Computation 29, 2021 (arXiv 1904.01709). There the task gives the reinforcement;
here the live fitness does. A robot at rest has .6 and one that drives ahead .8, so `high` is evolved around .8 and
`low` around .6. There the length is 1 and the initial weights are random; here both are evolved.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.evolved import Evolved
from epuckhebb.controller.plasticity.rule import Normalise, Rule


@dataclass(frozen=True, kw_only=True)
class Discrete(Rule):
    """Plasticity from a table, 12 numbers. An entry of the table is -1 below -.5, 1 above .5, and 0 between.

    The live fitness does not scale the rate (`floor` is 1, its maximum) but chooses the half of the table. N holds at
    the wheel gain of training.
    """

    evolved: ClassVar = {
        "when_better": Evolved(4),  # (a_j, a_i) = (0, 0), (0, 1), (1, 0), (1, 1)
        "when_worse": Evolved(4),
        "eta": Evolved(start=1.0, limit=2.0),
        "threshold": Evolved(start=0.5, limit=1.0),
        "high": Evolved(),
        "low": Evolved(),
    }
    coefficients: ClassVar = (
        *("both_better", "pre_better", "post_better", "none_better"),
        *("both_worse", "pre_worse", "post_worse", "none_worse"),
        *("threshold", "high", "low"),
    )

    N_gain_rad_s: float = 4.0
    floor: float = 1.0
    normalise: Normalise = Normalise.length

    @classmethod
    def express(cls, parameters: Mapping[str, Floats]) -> Mapping[str, Floats]:
        """The table as sums, multiplied by eta: r = both a_j a_i + pre a_j + post a_i + none."""
        p = parameters
        expressed = {"threshold": p["threshold"], "high": 0.8 + 0.2 * p["high"], "low": 0.6 + 0.2 * p["low"]}
        for when in ("better", "worse"):
            r00, r01, r10, r11 = p["eta"] * np.rint(np.clip(p[f"when_{when}"], -1.0, 1.0))
            expressed |= {f"both_{when}": r11 - r10 - r01 + r00, f"pre_{when}": r10 - r00}
            expressed |= {f"post_{when}": r01 - r00, f"none_{when}": r00}
        return expressed

    @staticmethod
    def synapse(
        pre: float,
        post: float,
        fitness: float,
        both_better: float,
        pre_better: float,
        post_better: float,
        none_better: float,
        both_worse: float,
        pre_worse: float,
        post_worse: float,
        none_worse: float,
        threshold: float,
        high: float,
        low: float,
    ) -> float:
        """D = eta r(m, a_j, a_i)."""
        a_j = 1.0 if pre > threshold else 0.0
        a_i = 1.0 if post > threshold else 0.0
        better = 1.0 if fitness > high else 0.0
        worse = 1.0 - better if fitness < low else 0.0  # sums of products, as branches would cost more
        both, pre_alone = better * both_better + worse * both_worse, better * pre_better + worse * pre_worse
        post_alone, none = better * post_better + worse * post_worse, better * none_better + worse * none_worse
        return both * a_j * a_i + pre_alone * a_j + post_alone * a_i + none
