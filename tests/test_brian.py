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
    names = {"I": b.TimedArray(drives, dt=DT * b.second), "tau": 20 * b.ms, "before": 20 * b.ms, "after": 20 * b.ms}
    # It counts from the beginning of the step at whose end a neuron spikes.
    neurons = b.NeuronGroup(
        NEURONS,
        "dv/dt = (I(t, i) - v) / tau : 1 (unless refractory)",
        threshold="v >= 1",
        reset="v = 0",
        refractory=(refractory_s + DT) * b.second,
        method="exact",
        namespace=names,
    )
    synapses = b.Synapses(
        neurons,
        neurons,
        """w : 1
        da/dt = -a / before : 1 (event-driven)
        db/dt = -b / after : 1 (event-driven)""",
        on_pre={"move_a": "a += 1", "weaken": "w -= 1.05 * b"},
        on_post={"move_b": "b += 1", "strengthen": "w += a"},
        namespace=names,
    )
    synapses.connect()
    for path, order in ((synapses.move_a, 0), (synapses.move_b, 0), (synapses.weaken, 1), (synapses.strengthen, 1)):
        path.order = order  # as here, traces before weights
    spikes = b.SpikeMonitor(neurons)
    b.Network(neurons, synapses, spikes).run(SUBSTEPS * DT * b.second)
    found = np.zeros((SUBSTEPS, NEURONS))
    found[np.rint(spikes.t / b.second / DT).astype(int), spikes.i] = 1.0
    weights = np.zeros((NEURONS, NEURONS))
    weights[synapses.i, synapses.j] = synapses.w
    return found, weights


@pytest.mark.parametrize("refractory_s", [0.0, 0.004, 0.012])
def test_ten_spike_trains_and_their_weights_are_those_of_brian(refractory_s):
    drives = np.repeat(np.random.default_rng(7).uniform(-1, 5, (SUBSTEPS // 5, NEURONS)), 5, axis=0)
    expected, weights = by_brian(drives, refractory_s)
    own, rule = LIF(refractory_s=refractory_s), STDP()
    state = stored(own.state, NEURONS).view(np.recarray)
    spikes = [[own.neuron(drive, n, state[n], DT, own) for n, drive in enumerate(row)] for row in drives]
    np.testing.assert_array_equal(spikes, expected)
    assert (np.sum(spikes, axis=0) > 50).all()
    found = np.zeros((NEURONS, NEURONS))
    for i, j in np.ndindex(found.shape):
        synapse = stored(rule.synapse_state, 1).view(np.recarray)[0]
        for row in spikes:
            found[i, j] += rule.synapse(row[i], row[j], synapse, DT, rule)
    np.testing.assert_allclose(found, weights, atol=1e-9)
