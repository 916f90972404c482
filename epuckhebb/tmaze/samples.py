"""What is recorded of a lifetime, every so many steps."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.network import Network
from epuckhebb.tmaze.physics.pymunk import PYMUNK
from epuckhebb.tmaze.physics_engine import Physics


class Samples(NamedTuple):
    """What is recorded of a lifetime, every so many steps; first axis: samples, but of `phase_began`.

    time [s]; pose: x, y [m], heading [rad]; sensors: the network's inputs; motors: the 2 network outputs; fitness:
    live F; change_signal: nan if there is none; rate: N_e; weight_change: sum of |W - W_gene|, that of homeostasis
    included; weights: (samples, synapses), after the step's update, without the scale of homeostasis; activations:
    (samples, neurons) of those of a wiring, means over the substeps of that step; none of layers; tilt: roll,
    pitch [rad] and height above the floor [m], nothing in the plane; phase_began:
    (phases,) when each world of the lifetime began [s], its new walls standing, nan if it did not.
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
    phase_began: Floats


def empty_samples(count: int, network: Network, physics: Physics = PYMUNK, phases: int = 1) -> Samples:
    """Arrays for so many samples, and for the phases of a world."""
    return Samples(
        time=np.zeros(count),
        pose=np.zeros((count, 3)),
        sensors=np.zeros((count, network.inputs)),
        motors=np.zeros((count, network.outputs)),
        fitness=np.zeros(count),
        change_signal=np.full(count, np.nan),
        rate=np.zeros(count),
        weight_change=np.zeros(count),
        weights=np.zeros((count, network.synapses), np.float32),
        activations=np.zeros((count, sum(network.layers[1:]) if network.wiring else 0), np.float32),
        tilt=np.zeros((count, physics.tilts)),
        phase_began=np.array([0.0, *[np.nan] * (phases - 1)]),
    )
