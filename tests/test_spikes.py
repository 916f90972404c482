"""Spikes: neurons and rules beside closed forms and the oracle, substeps, the spiking change signal, what is shown."""

import json
import math
import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from cases import SMALL_GA, done, first_of, refused

from epuckhebb.adaptation.change_signal import SignalContext, no_nominal, signal_function
from epuckhebb.adaptation.change_signals import spiking
from epuckhebb.controller.controller import Controller as Loop
from epuckhebb.controller.genome import make_plan
from epuckhebb.controller.network import Network, decayed
from epuckhebb.controller.own_class import stored
from epuckhebb.controller.plasticity.rules.abcd_traces import ABCDTraces
from epuckhebb.controller.plasticity.rules.stdp import STDP
from epuckhebb.controller.wirings.ctrnn import CTRNN
from epuckhebb.controller.wirings.lif import LIF
from epuckhebb.live import page
from epuckhebb.store import load_genome
from epuckhebb.tmaze.individual import GA_ALONE, Controller
from epuckhebb.tmaze.robot import STEP_S

NETWORK = Network((16, *LIF().sizes), wiring=LIF())


def by_spikes(rule, pre, post, step_s):
    """The changes of a weight in each substep, by trains of 0 and 1."""
    state = SimpleNamespace(**rule.synapse_state)
    return [rule.synapse(x, y, state, step_s, rule) for x, y in zip(pre, post, strict=True)]


@pytest.mark.parametrize("step_ms", [32, 4, 1])
def test_a_pair_of_spikes_changes_a_weight_by_the_closed_form_of_the_window(step_ms):
    rule = STDP(A_plus=0.7, A_minus=0.9, tau_plus_s=0.02, tau_minus_s=0.03)
    for apart in range(1, 60):
        first, second = ([float(k == own) for k in range(60)] for own in (0, apart))
        dt = apart * step_ms / 1000
        before, after = by_spikes(rule, first, second, dt / apart), by_spikes(rule, second, first, dt / apart)
        assert sum(before) == pytest.approx(0.7 * math.exp(-dt / 0.02), rel=1e-12, abs=1e-99)
        assert sum(after) == pytest.approx(-0.9 * math.exp(-dt / 0.03), rel=1e-12, abs=1e-99)
    assert by_spikes(rule, [1.0], [1.0], 0.001) == pytest.approx([0.7 - 0.9])


def test_what_decays_ends_at_0():
    assert decayed(1e-90, 0.1, 0.02) == pytest.approx(1e-90 * math.exp(-5), rel=1e-12)
    assert [decayed(value, 1.0, 0.02) for value in (1e-90, -1e-90)] == [0.0, 0.0]


@pytest.mark.parametrize("substeps", [1, 8, 32])
def test_the_rate_of_a_neuron_has_its_analytic_form(substeps):
    """A bias drives one neuron; refractory + tau ln(I / (I - threshold)) from spike to spike, in whole substeps."""
    wiring = LIF(hidden=1, outputs=1, substeps=substeps, tau_s=0.05, threshold=0.5, refractory_s=0.064)
    network, dt = Network((1, 1, 1), wiring=wiring), STEP_S / substeps
    for drive in (0.51, 0.6, 0.9, 1.7):
        loop, seen = Loop([0.0, drive, 0.0, 1.0], network, STDP(N=1e-9), step_s=STEP_S), []
        for _ in range(300):
            loop.act([0.0])
            rows = loop.state.workspace.substeps if substeps > 1 else [loop.state.activation]
            seen += [row[2] for row in rows]
        needed = round(0.064 / dt) + math.ceil(0.05 / dt * math.log(drive / (drive - 0.5)) - 1e-9)
        times = np.flatnonzero(seen)
        assert set(np.diff(times)) == {needed}
        assert len(times) == 1 + (300 * substeps - 1 - times[0]) // needed


RULES = [STDP(N=2e-4), None, STDP(N=1e-3, average=3, every=5), ABCDTraces(N=0.001)]


@pytest.mark.parametrize("rule", first_of(RULES), ids=lambda rule: type(rule).__name__)
def test_a_spiking_robot_agrees_with_the_oracle_spike_by_spike(beside_the_oracle, rule):
    controller = GA_ALONE if rule is None else Controller(name="spikes", rule=rule)
    genes = np.random.default_rng(5).uniform(-0.4, 1, make_plan(NETWORK, type(controller.rule)).genes)
    shared = {"controller": controller, "network": NETWORK}
    outcome, samples, robot = beside_the_oracle(genes, "right", seconds=8, gain=2.0, **shared)
    spikes = np.reshape(robot.spikes, (-1, 8, 10))
    assert 0.01 < spikes.mean() < 0.5
    assert samples.activations[:, :10].tobytes() == spikes.mean(axis=1).astype(np.float32).tobytes()
    assert (outcome.weight_change_mean > 0.01) == (rule is not None)


def test_substeps_are_bit_identical_to_shorter_steps_with_the_same_inputs():
    rng, outputs = np.random.default_rng(3), []
    inputs, genes = rng.uniform(-1, 1, (20, 4)), None
    for substeps in (4, 1):
        wiring = CTRNN(hidden=3, tau_gain_rad_s=0.0, substeps=substeps)
        network = Network((4, *wiring.sizes), wiring=wiring)
        genes = rng.uniform(-1, 1, make_plan(network).genes) if genes is None else genes
        loop = Loop(genes, network, step_s=0.032 / 4 * substeps)
        outputs.append([[loop.act(one) for _ in range(4 // substeps)][-1] for one in inputs])
    np.testing.assert_array_equal(*outputs)


def test_the_spiking_signal_is_silent_up_to_its_threshold_and_then_the_rate_of_a_neuron():
    signal, state = signal_function(spiking.Spiking), stored(spiking.Spiking.state, 1).view(np.recarray)
    nominal = no_nominal(16, 8)._replace(reading_spread=np.full((2, 16), 1.0 - 0.01))

    def after_a_minute(novelty):
        context = SignalContext(0.0, 0.0, False, np.full(17, novelty))
        return [signal(context, nominal, state[0]) for _ in range(2000)][-1]

    assert after_a_minute(1.99) == 0.0
    for novelty in (2.5, 4.0):
        steps = math.ceil(spiking.TAU_S / STEP_S * math.log(novelty / (novelty - spiking.THRESHOLD)))
        assert after_a_minute(novelty) == pytest.approx(1 / (steps * STEP_S), rel=0.15)
    assert after_a_minute(0.0) < 1e-4


@pytest.mark.usefixtures("here")
def test_a_champion_that_spikes_is_evolved_learns_later_and_shows_its_spikes():
    done("evolve", "network.wiring=lif", "network.hidden=4", *SMALL_GA, "ga.generations=1", "hydra.run.dir=champion")
    offered = page._rules(SimpleNamespace(genome=load_genome("champion", "obstacles")))
    assert "stdp" in offered
    assert "abcd_shared" not in offered  # a rule of layers
    words = ["genome=champion", "hebbian=stdp", "scenario=4obstacles", "lifetime.duration_s=2", "repeats=1"]
    done("evaluate", *words, "adaptation=spiking", "hydra.run.dir=run")
    config = Path("run/.hydra/config.yaml").read_text()
    assert [line in config for line in ("  wiring: lif\n", "  substeps: 8\n", "  tau_minus_s: 0.02\n")] == [True] * 3
    done("replay", "run")
    data = re.search(r'id="data">(.*?)</script>', Path("run/replay.html").read_text(), re.DOTALL)[1]
    assert json.loads(data)["spiking"] == 4
    assert "network.substeps" in refused("evolve", "network.wiring=lif", "network.substeps=0")
