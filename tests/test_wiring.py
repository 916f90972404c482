"""Wirings: the compiled kernel beside plain Python, blocks of synapses, plasticity, pieces, and what is recorded."""

import numpy as np
import pytest

from epuckhebb.sim.controller import GA_ALONE, Controller
from epuckhebb.sim.genome import plan_of
from epuckhebb.sim.network import Network
from epuckhebb.sim.plasticity.rules.paper import Paper
from epuckhebb.sim.wirings.ctrnn import CTRNN
from epuckhebb.sim.wirings.elman import Elman

LEARNING = Controller(name="Hebbian", rule=Paper(N=0.0005))


def network_of(wiring):
    return Network((16, *wiring.sizes), wiring=wiring)


def genes_of(network, seed=5):
    return np.random.default_rng(seed).uniform(-1, 1, plan_of(network).genes)


@pytest.mark.parametrize("controller", [GA_ALONE, LEARNING], ids=["GA", "Hebbian"])
@pytest.mark.parametrize("wiring", [CTRNN(hidden=5), CTRNN(tau_gain_rad_s=0.0), Elman()], ids=["5", "unscaled", "elman"])
def test_a_wiring_agrees_with_the_oracle_step_by_step(beside_the_oracle, wiring, controller):
    network = network_of(wiring)
    genes = genes_of(network)
    # At a wall a recurrent network lets rounding errors grow from step to step; this ends before.
    outcome, samples, _ = beside_the_oracle(
        genes, "right", controller=controller, network=network, seconds=6, gain=2.0
    )
    assert samples.motors.std() > 0.05
    assert (outcome.weight_change_mean > 0.01) == (controller is LEARNING)
