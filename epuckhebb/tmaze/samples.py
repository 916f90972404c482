"""What is recorded of a lifetime, every so many steps."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.network import Network
from epuckhebb.tmaze.physics.pymunk import PYMUNK
from epuckhebb.tmaze.physics_engine import Physics


class Samples(NamedTuple):
    """What is recorded of a lifetime, every so many steps; first axis: samples.

    time [s]; pose: x, y [m], heading [rad]; sensors: the network's inputs; motors: the 2 network outputs; fitness:
    live F; change_signal: nan if there is none; rate: N_e; weight_change: sum of |W - W_gene|, that of homeostasis
    included; weights: (samples, synapses), after the step's update, without the scale of homeostasis; activations:
    (samples, neurons) of those of a wiring, which weights and inputs alone do not give; none of layers; tilt: roll,
    pitch [rad] and height above the floor [m], nothing in the plane.
    """

    time: Floats
    pose: Floats
    sensors: Floats
    motors: Floats
    fitness: Floats
    change_signal: Floats
    rate: Floats
    weight_change: Floats
    weights: NDArray[np.float32]
    activations: NDArray[np.float32]
    tilt: Floats


def empty_samples(count: int, network: Network, physics: Physics = PYMUNK) -> Samples:
    """Arrays for so many samples."""

    def numbers(*shape: int) -> Floats:
        return np.zeros((count, *shape))

    return Samples(
        time=numbers(),
        pose=numbers(3),
        sensors=numbers(network.inputs),
        motors=numbers(network.outputs),
        fitness=numbers(),
        change_signal=np.full(count, np.nan),
        rate=numbers(),
        weight_change=numbers(),
        weights=np.zeros((count, network.synapses), np.float32),
        activations=np.zeros((count, recorded_neurons(network)), np.float32),
        tilt=numbers(physics.tilts),
    )


def recorded_neurons(network: Network) -> int:
    """How many activations are recorded: all neurons of a wiring, none of layers."""
    return 0 if network.wiring is None else sum(network.layers[1:])
