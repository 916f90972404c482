"""Writes and reads `traces.npz`."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from epuckhebb.analysis.evaluate import Traces
from epuckhebb.controller.genome import plan_of
from epuckhebb.controller.network import PAPER_NETWORK, Network
from epuckhebb.store.disk import TRACES
from epuckhebb.store.genome import checked_genes, network_from, wiring_arrays
from epuckhebb.store.npz import Arrays, compressed, one_error
from epuckhebb.store.run import Run
from epuckhebb.tmaze.maze import SIDES
from epuckhebb.tmaze.samples import Samples, empty_samples

_TILT = "tilt"  # there is none where no robot tilts


def traces_file(traces: Traces, weights: NDArray[np.float64], network: Network) -> bytes:
    """The content of `traces.npz`."""
    return compressed(traces_arrays(traces, weights, network))


def traces_arrays(traces: Traces, weights: NDArray[np.float64], network: Network) -> dict[str, NDArray[Any]]:
    """Recorded lifetimes as arrays by name, with the weights and the network that they began with; `columns.TRACES`."""
    lifetimes = {"controller": np.array(traces.controller), "side": np.array(traces.side)}
    of_network = {"genome": weights, "layers": np.array(network.layers), **wiring_arrays(network)}
    samples = {name: array for name, array in traces.samples._asdict().items() if 0 not in array.shape[2:]}
    return lifetimes | of_network | samples


def read_traces(run: Run, lifetimes: int, samples: int) -> tuple[Traces, NDArray[np.float64], Network]:
    """Read the recorded lifetimes of a run folder, and the weights and the network that they began with.

    lifetimes: how many there must be. samples: how many samples each must have.
    """
    with one_error(f"{run.path / TRACES} cannot be read (the run is {run.status['state']})"):
        if not (run.path / TRACES).is_file():
            raise ValueError("there is no such file")
        arrays = Arrays(run.content(TRACES))
        network = network_from(arrays, arrays.layers() or PAPER_NETWORK.layers)
        found = {}
        for name, empty in empty_samples(0, network)._asdict().items():
            shape = (lifetimes, samples, *empty.shape[1:])
            if name == _TILT and name in arrays:
                found[name] = arrays.take(name, "f", (*shape[:2], None))
            else:
                found[name] = np.zeros(shape) if 0 in empty.shape[1:] else arrays.take(name, "f", shape)
            if name != "change_signal" and not np.isfinite(found[name]).all():
                raise ValueError(f"{name} must hold finite numbers")
        if (np.diff(found["time"], prepend=0.0) < 0).any():
            raise ValueError("time must begin at 0 or later, and never decrease")
        controllers, sides = (arrays.take(name, "U", (lifetimes,)).tolist() for name in ("controller", "side"))
        if not set(sides) <= set(SIDES) or len(set(zip(controllers, sides, strict=True))) < lifetimes:
            raise ValueError(f"side must be one of {', '.join(SIDES)}, and each controller's lifetime there one")
        traces = Traces(controller=controllers, side=sides, samples=Samples(**found))
        return traces, checked_genes(arrays.take("genome", "f", (network.synapses,)), TRACES, plan_of(network)), network
