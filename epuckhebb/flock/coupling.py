"""Couplings between robots: how much each listens to each other, and how that changes while they drive.

Plasticity between agents, after the idea of Masumori, Doi & Ikegami (2024). A coupling here is plain Python: it changes
every 6.4 s, which costs little beside the steps in between.
"""

from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np

from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.compiling.errors import PartError
from epuckhebb.controller.compiling.readonly import readonly
from epuckhebb.controller.own_class import OwnClass, calling
from epuckhebb.controller.ranges import within


class Moment(NamedTuple):
    """What a coupling is given when it changes.

    weights: (robots, robots), how much the robot of a row listens to that of a column; a row has the mean 1, without
    the robot itself. transfer_entropy: (robots, robots) [nats], from the robot of a column to that of a row.
    fitness: (robots,), progress to the goal since the last change, 1 for straight there at full speed. broken: the
    number of the robot that broke, -1 for none. time_s: since the start.
    """

    weights: Floats
    transfer_entropy: Floats
    fitness: Floats
    broken: int
    time_s: float


@dataclass(frozen=True, kw_only=True)
class Coupling(OwnClass):
    """How couplings change: w <- max(0, w + N drive - decay (w - 1)), then each row is scaled to the mean 1.

    A subclass has `drive`, which gives a number for each pair, or `weights` for another law, and adds settings as
    fields. N: rate of a change. decay: by how much a weight returns to 1.
    """

    PART: ClassVar[str] = "coupling"
    KEY: ClassVar[str] = "flock.coupling"
    METHODS: ClassVar[tuple[str, ...]] = ("drive", "weights")

    N: float = within(0, default=0.3)
    decay: float = within(0, 1, default=0.03)

    def drive(self, now: Moment) -> Floats:
        """What moves each weight, (robots, robots); nothing here."""
        return np.zeros_like(now.weights)

    def weights(self, now: Moment) -> Floats:
        """The new weights, (robots, robots); the diagonal does not count."""
        return np.maximum(0.0, now.weights + self.N * self.drive(now) - self.decay * (now.weights - 1.0))


def changed(coupling: Coupling, now: Moment) -> Floats:
    """The couplings after a change; a robot that listens to nobody has zeros.

    Raises:
        PartError: the coupling failed, or its weights are not finite, negative, or not as many as pairs.
    """
    name, count = type(coupling).__name__, len(now.fitness)
    with calling(f"coupling {name}"):
        weights = np.array(coupling.weights(readonly(now)), float)
    if weights.shape != (count, count):
        raise PartError(f"coupling {name} must give {count} rows of {count} weights, it gave shape {weights.shape}")
    np.fill_diagonal(weights, 0.0)
    if not np.isfinite(weights).all() or (weights < 0.0).any():
        wrong = weights[~(np.isfinite(weights) & (weights >= 0.0))][0]
        raise PartError(f"coupling {name} must give finite weights of 0 or more, it gave {wrong:g}")
    sums = weights.sum(axis=1, keepdims=True)
    return weights * ((count - 1) / np.where(sums > 0.0, sums, 1.0))


def shuffled(now: Moment, rng: np.random.Generator) -> Moment:
    """The control of a coupling: the transfer entropy of other pairs, drawn anew, and the fitness of another robot."""
    count = len(now.fitness)
    pairs = ~np.eye(count, dtype=bool)
    entropy = now.transfer_entropy.copy()
    entropy[pairs] = rng.permutation(entropy[pairs])
    return now._replace(transfer_entropy=entropy, fitness=np.roll(now.fitness, -max(1, count // 3)))


def transfer_entropy(series: Floats) -> Floats:
    """Transfer entropy [nats] between all pairs of series, (series, series), from the column to the row.

    For Gaussian series, with one step of history: half the logarithm of the variance of x_i(t + 1) that x_i(t) leaves
    unexplained, over the variance that x_i(t) and x_j(t) leave. Without any link it is 1 / 2n on average, for n steps.
    Source: Schreiber, Phys. Rev. Lett. 85 (2000) 461; for Gaussian series Barnett, Barrett & Seth, Phys. Rev. Lett. 103
    (2009) 238701.

    series: (steps, series).
    """
    after, before = series[1:] - series[1:].mean(axis=0), series[:-1] - series[:-1].mean(axis=0)
    steps = len(before)
    # einsum adds in one order on every machine; a matrix product need not.
    same, across = (np.einsum("ti,tj->ij", x, before) / steps for x in (before, after))
    variance, last = np.diag(same), np.diag(across)
    with np.errstate(divide="ignore", invalid="ignore"):
        left = (after**2).mean(axis=0) - last**2 / variance  # of x_i(t + 1), once x_i(t) is known
        added = variance[None, :] - same**2 / variance[:, None]  # of x_j(t), once x_i(t) is known
        explained = (across - last[:, None] * same / variance[:, None]) ** 2 / added
        entropy = -0.5 * np.log1p(-explained / left[:, None])
    is_known = (added > 1e-14 * variance[None, :]) & np.isfinite(entropy)
    return np.where(is_known & ~np.eye(len(variance), dtype=bool), entropy, 0.0)
