"""Ten spike trains and their STDP beside Brian2, which has both from equations; `nox -s brian`."""

import numpy as np
import pytest

from epuckhebb.controller.own_class import stored
from epuckhebb.controller.plasticity.rules.stdp import STDP
from epuckhebb.controller.wirings.lif import LIF

pytestmark = [pytest.mark.brian, pytest.mark.filterwarnings("ignore")]  # those of Brian2
NEURONS, SUBSTEPS, DT = 10, 2000, 0.004


def by_brian(drives, refractory_s):
    """Spikes, (substeps, neurons), and changed weights, (neurons, neurons), of neurons with these drives."""
    import brian2 as b

    b.prefs.codegen.target = "numpy"
    b.defaultclock.dt = DT * b.second
    names = {"I": b.TimedArray(drives, dt=DT * b.second), "tau": 20 * b.ms}
    equation = "dv/dt = (I(t, i) - v) / tau : 1 (unless refractory)"
    rest = (refractory_s + DT) * b.second  # from the beginning of the step at whose end a neuron spikes
    rules = {"threshold": "v >= 1", "reset": "v = 0", "refractory": rest, "method": "exact"}
    neurons = b.NeuronGroup(NEURONS, equation, **rules, namespace=names)
    traces = "w : 1\nda/dt = -a / tau : 1 (event-driven)\ndb/dt = -b / tau : 1 (event-driven)"
    on_pre = {"move_a": "a += 1", "weaken": "w -= 1.05 * b"}
    on_post = {"move_b": "b += 1", "strengthen": "w += a"}
    synapses = b.Synapses(neurons, neurons, traces, on_pre=on_pre, on_post=on_post, namespace=names)
    synapses.connect()
    synapses.weaken.order = synapses.strengthen.order = 1  # after the traces, as here
    spikes = b.SpikeMonitor(neurons)
    b.Network(neurons, synapses, spikes).run(SUBSTEPS * DT * b.second)
    found, weights = np.zeros((SUBSTEPS, NEURONS)), np.zeros((NEURONS, NEURONS))
    found[np.rint(spikes.t / b.second / DT).astype(int), spikes.i] = 1.0
    weights[synapses.i, synapses.j] = synapses.w
    return found, weights


@pytest.mark.parametrize("refractory_s", [0.0, 0.004, 0.012])
def test_ten_spike_trains_and_their_weights_are_those_of_brian(refractory_s):
    drives = np.repeat(np.random.default_rng(7).uniform(-1, 5, (SUBSTEPS // 5, NEURONS)), 5, axis=0)
    expected, weights = by_brian(drives, refractory_s)
    own, rule, found = LIF(refractory_s=refractory_s), STDP(), np.zeros((NEURONS, NEURONS))
    state = stored(own.state, NEURONS).view(np.recarray)
    spikes = [[own.neuron(drive, n, state[n], DT, own) for n, drive in enumerate(row)] for row in drives]
    np.testing.assert_array_equal(spikes, expected)
    assert (np.sum(spikes, axis=0) > 50).all()
    for i, j in np.ndindex(found.shape):
        synapse = stored(rule.synapse_state, 1).view(np.recarray)[0]
        found[i, j] = sum(rule.synapse(row[i], row[j], synapse, DT, rule) for row in spikes)
    np.testing.assert_allclose(found, weights, atol=1e-9)
