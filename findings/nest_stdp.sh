# NEST 3.10.0: the weight of an `stdp_synapse` that is read after a run lacks the spikes after its last presynaptic one.
set -- nest-simulator==3.10.0 numpy==2.4.6
. "$(dirname "$0")/run.sh" <<'PYTHON'
import nest

nest.verbosity = nest.VerbosityLevel.ERROR


def weight(before, after):
    """The weight after 100 ms, with spikes of the two neurons at these times [ms]."""
    nest.ResetKernel()
    neurons = nest.Create("parrot_neuron", 2)
    for neuron, times in zip(neurons, (before, after)):
        nest.Connect(nest.Create("spike_generator", params={"spike_times": times}), neuron)
    plastic = {"synapse_model": "stdp_synapse", "weight": 1.0, "delay": 1.0, "receptor_type": 1}
    nest.Connect(neurons[0], neurons[1], syn_spec=plastic)
    nest.Simulate(100.0)
    return nest.GetConnections(*neurons).weight


pre, post = [10.0, 30.0, 50.0], [15.0, 35.0, 55.0]
few, more = weight(pre, post), weight(pre, [*post, 60.0, 62.0, 64.0])
print("NEST", nest.__version__, "weight:", few, "with three more postsynaptic spikes:", more)
late = [weight([*pre, 90.0], times) for times in (post, [*post, 60.0, 62.0, 64.0])]
print("the same, with one more presynaptic spike at 90 ms:", *late)
assert few == more
assert late[0] < late[1]
PYTHON
