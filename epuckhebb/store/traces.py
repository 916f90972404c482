"""Writes and reads `traces.npz`."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from epuckhebb.analysis.evaluate import Traces
from epuckhebb.controller.network import Network
from epuckhebb.store.disk import TRACES, convert_errors, parse_arrays
from epuckhebb.store.genome import parse_network, wiring_arrays
from epuckhebb.store.run import Run
from epuckhebb.tmaze.samples import Samples, empty_samples


def traces_arrays(traces: Traces, weights: NDArray[np.float64], network: Network) -> dict[str, NDArray[Any]]:
    """Recorded lifetimes as arrays by name, with the weights and the network that they began with."""
    lifetimes = {"controller": np.array(traces.controller), "side": np.array(traces.side)}
    of_network = {"genome": weights, "layers": np.array(network.layers), **wiring_arrays(network)}
    samples = {name: array for name, array in traces.samples._asdict().items() if 0 not in array.shape[2:]}
    return lifetimes | of_network | samples


def read_traces(run: Run) -> tuple[Traces, NDArray[np.float64], Network]:
    """Read the recorded lifetimes of a run folder, and the weights and the network that they began with."""
    with convert_errors(f"{run.path / TRACES} cannot be read (the run is {run.status['state']})"):
        if not (run.path / TRACES).is_file():
            raise ValueError("there is no such file")
        arrays = parse_arrays(run.content(TRACES))
        network = parse_network(arrays)
        shape = arrays["time"].shape
        samples = {
            name: arrays[name] if name in arrays else np.zeros((*shape, *empty.shape[1:]))
            for name, empty in empty_samples(0, network)._asdict().items()
        }
        controllers, sides = arrays["controller"].tolist(), arrays["side"].tolist()
        return Traces(controller=controllers, side=sides, samples=Samples(**samples)), arrays["genome"], network
