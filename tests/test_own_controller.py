"""A controller of the user's own: evolved, resumed, evaluated, replayed, rerun and swept; what it runs; bad ones."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from cases import SHORT, SMALL_GA, check_resumed, done, refused, refused_before, runs_of

from epuckhebb import Lifetime, Wiring
from epuckhebb.config import plugins
from epuckhebb.controller.genome import plan_of
from epuckhebb.controller.network import Network
from epuckhebb.store import load_genome
from epuckhebb.tmaze.scenario import Scenario
from epuckhebb.tmaze.session import Individual, Session

EXAMPLE = Path(__file__).parents[1] / "examples" / "own_controller" / "my_neurons.py"
OWN = "network.wiring=my_neurons.py:Ring"


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    own = [OWN, "network.hidden=5"]
    return runs_of(
        tmp_path_factory.mktemp("controller"),
        EXAMPLE.parent,
        ["evolve", *own, *SMALL_GA, "ga.generations=2", "hydra.run.dir=evolved"],
        ["evaluate", "genome=evolved", *own, "hebbian.N=0.002", *SHORT, "hydra.run.dir=evaluated"],
        ["evolve", "network.wiring=elman", *SMALL_GA, "ga.generations=1", "hydra.run.dir=elman"],
    )


@pytest.mark.thorough
@pytest.mark.usefixtures("copy")
def test_an_evolution_of_it_is_resumed_to_the_same_champion():
    check_resumed([OWN, "network.hidden=5", *SMALL_GA], ("ga.generations=1", "ga.generations=2"))


@pytest.mark.thorough
def test_runs_of_it_are_shown_replayed_and_rerun_without_the_file(copy):
    (copy / "my_neurons.py").unlink()
    assert "16-5-2 (Ring)" in done("show", "evolved").stdout
    assert "network.wiring=Ring, network.hidden=5" in " ".join(done("show", "evaluated").stdout.split())
    done("replay", "evaluated")
    assert '"wiring":"Ring"' in (copy / "evaluated" / "replay.html").read_text()
    assert "evolved has network.wiring=Ring; only network.wiring=mlp" in refused(
        "export", "evolved", "--webots", "-o", "c"
    )
    for run in ("evaluated", "evolved"):
        assert "bit-identical" in done("rerun", run).stdout


@pytest.mark.thorough
def test_the_champion_holds_its_synapses_and_its_neurons_and_a_run_their_activations(runs):
    genome = load_genome(str(runs / "evolved"), "obstacles")
    assert (genome.wiring, genome.network.layers) == ("Ring", (16, 5, 2))
    assert genome.plan.text() == f"{5 * 16 + 10 + 10} weights, 7 neuron.tau, 7 neuron.bias"
    assert np.load(runs / "evaluated" / "traces.npz")["activations"].shape[2] == 7
    (file,) = pd.read_json(runs / "evaluated" / "provenance.json", typ="series").own_code
    assert file.endswith("my_neurons.py")


@pytest.mark.thorough
@pytest.mark.usefixtures("copy")
def test_a_champion_of_another_wiring_is_refused_with_both_names():
    for words, theirs, asked in (
        (["genome=evolved"], "Ring", "mlp"),
        (["genome=evolved", "network.wiring=elman"], "Ring", "elman"),
        (["genome=elman", OWN], "elman", "Ring"),
        (["genome=reference", OWN], "mlp", "Ring"),
    ):
        said = refused("evaluate", *words, *SHORT)
        assert f"is for network.wiring={theirs}, and the settings have network.wiring={asked}" in said
        assert f"give network.wiring={'FILE.py:Ring' if theirs == 'Ring' else theirs}, " in said
    said = refused("evaluate", "genome=evolved", OWN, *SHORT)
    assert "16-5-2 (Ring) of 100 synapses; the settings below network make 16-8-2 (Ring) of 160" in said


@pytest.mark.thorough
@pytest.mark.usefixtures("copy")
def test_a_champion_brings_a_wiring_of_the_program_to_every_job_of_a_sweep():
    words = ["genome=elman", *SHORT, "lifetime.record_every=0"]
    done("evaluate", "-m", "seed=1,2", *words, "hydra.sweep.dir=out", "hydra/launcher=basic")
    for job in (0, 1):
        changed = set(pd.read_csv(f"out/{job}/metrics.csv").changed)
        assert changed == {"lifetime.duration_s=2, network.wiring=elman"}


def test_a_lifetime_in_pieces_is_the_same_and_reset_leaves_the_state_of_neurons():
    wiring = plugins.class_named(f"{EXAMPLE}:Ring", Wiring, "network.wiring")(hidden=5)
    network = Network((16, *wiring.sizes), wiring=wiring)
    genes = np.random.default_rng(3).uniform(-1, 1, plan_of(network).genes)
    individual = Individual(genes=genes, side="left", key=np.uint64(2), network=network)
    whole, pieces = (Session(individual, Scenario(), Lifetime(duration_s=4, gain_rad_s=4)) for _ in range(2))
    whole.step(1000)
    while pieces.step(7):
        pass
    np.testing.assert_array_equal(whole.outcome(), pieces.outcome())
    assert whole.life.neurons.state.tobytes() == pieces.life.neurons.state.tobytes() != bytes(56)


BAD = """\
from dataclasses import dataclass
from typing import ClassVar
import random
from epuckhebb import Evolved, Wiring

class Base(Wiring):
    sizes: ClassVar = (3, 2)
    neuron = staticmethod(lambda drive: drive)
    def synapses(self, inputs):
        return [(pre, post) for pre in range(inputs) for post in range(inputs + 1, inputs + 6)]
class Nothing(Wiring): pass
class Curious(Base):
    neuron = staticmethod(lambda drive, weather: drive)
class Forgetful(Base):
    state: ClassVar = {"y": 0.0}
    @staticmethod
    def neuron(drive, state):
        return state.x
class Lucky(Base):
    neuron = staticmethod(lambda drive: random.random())
class Bare(Base):
    hidden: int = 4
class Layered(Base):
    evolved: ClassVar = {"tau": Evolved(per="layer")}
class Clash(Base):
    evolved: ClassVar = {"drive": Evolved(per="neuron")}
class Sizeless(Wiring):
    neuron = staticmethod(lambda drive: drive)
class One(Base):
    sizes: ClassVar = (3, 1)
class Odd(Base):
    sizes: ClassVar = (3, "two")
class Far(Base):
    synapses = lambda self, inputs: [(0, 99)]
class Inwards(Base):
    synapses = lambda self, inputs: [(0, 3)]
class Single(Base):
    synapses = lambda self, inputs: [(0,)]
class Alone(Base):
    synapses = lambda self, inputs: []
class Failing(Base):
    synapses = lambda self, inputs: [][1]
class Endless(Base):
    def synapses(self, inputs):
        while True:
            yield 0, inputs + 1
class Shapeless(Base):
    evolved: ClassVar = {"tau": Evolved(per="neuron", value=lambda gene: gene[:2])}
class Undefined(Base):
    evolved: ClassVar = {"tau": Evolved(per="neuron", value=lambda gene: gene * float("nan"))}
class Muddled(Base):
    neuron = staticmethod(lambda drive: drive.times(2))
class Infinite(Base):
    neuron = staticmethod(lambda drive: drive + 1.0 / 0.0)
@dataclass(frozen=True, kw_only=True)
class Fine(Base):
    hidden: int = 4
"""


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize(
    ("words", "texts"),
    [
        (["ctrn"], ["network.wiring must be one of ctrnn, elman, mlp, a wiring of your own, FILE.py:NAME, got 'ctrn'"]),
        (["bad.py:Fin"], ["has no wiring Fin", "Did you mean Fine?"]),
        (["bad.py:Nothing"], ["wiring Nothing has no static method `neuron`"]),
        (["bad.py:Curious"], ["unknown arguments weather", "drive, before, number, state, step_s, by"]),
        (["bad.py:Forgetful"], ["`state` has no x; it has y"]),
        (["bad.py:Lucky"], ["draws from random"]),
        (["bad.py:Bare"], ["hidden is not a setting; write @dataclass"]),
        (["bad.py:Layered"], ["tau must be Evolved(per=...), one of network, neuron"]),
        (["bad.py:Clash"], ["cannot be called drive"]),
        (["bad.py:Sizeless"], ["wiring Sizeless: TypeError: a wiring needs `sizes`"]),
        (["bad.py:One"], ["wiring One: `sizes` must be positive whole numbers, the last of them 2 or more"]),
        (["bad.py:Odd"], ["wiring Odd: `sizes` must be positive whole numbers"]),
        (["bad.py:Far"], ["synapse (0, 99) joins a neuron that is not there", "a postsynaptic one 17 to 21"]),
        (["bad.py:Inwards"], ["synapse (0, 3) joins a neuron that is not there"]),
        (["bad.py:Single"], ["a synapse must be two whole numbers, (pre, post), got (0,)"]),
        (["bad.py:Alone"], ["wiring Alone: `synapses` gives none"]),
        (["bad.py:Failing"], ["wiring Failing: IndexError"]),
        (["bad.py:Endless"], ["100001 weights or more; at most 100000"]),
        (["bad.py:Shapeless"], ["wiring Shapeless: `value` of tau must give 5 finite numbers"]),
        (["bad.py:Undefined"], ["wiring Undefined: `value` of tau must give 5 finite numbers"]),
        pytest.param(
            ["bad.py:Muddled"],
            ["wiring Muddled of", "does not compile", "times"],
            marks=pytest.mark.thorough,  # it takes as long as a kernel; test_own_fitness.py has such a class, too
        ),
        pytest.param(
            ["bad.py:Infinite"],
            ["wiring Infinite: `neuron` gave infinite or nan activations"],
            marks=pytest.mark.thorough,
        ),
        (["bad.py:Fine", "network.hiden=1"], ["network.hiden is no key of", "Did you mean hidden?"]),
        (["bad.py:Fine", "network.hidden=few"], ["network.hidden must be a whole number"]),
        (["ctrnn", "network.hidden=-1"], ["network.hidden must be 0 or more, got -1"]),
        (["ctrnn", "network.layers=[16,2]"], ["network.layers is no key of wiring ctrnn; it has hidden"]),
        (["mlp", "network.hidden=3"], ["network.hidden is no key of wiring mlp; it has layers"]),
        (
            ["ctrnn", "hebbian=modulated"],
            ["rule modulated has a modulatory neuron", "ctrnn has no layers"],
        ),
        (["elman", "hebbian=abcd_shared"], ["rule abcd_shared has A for each layer", "network.wiring=elman"]),
        (["elman", "hebbian=discrete"], ["rule discrete keeps the lengths of incoming weights"]),
    ],
)
def test_what_cannot_be_a_wiring_is_refused_before_anything_runs(words, texts):
    Path("bad.py").write_text(BAD)
    words = [f"network.wiring={words[0]}", *words[1:], *SMALL_GA]
    refused_before("out", ["evolve", *words, "hydra.run.dir=out"], texts)


@pytest.mark.thorough
@pytest.mark.usefixtures("copy")
def test_homeostasis_is_refused_by_name():
    said = refused("evaluate", "genome=elman", "adaptation=homeostasis", *SHORT)
    assert "adaptation=homeostasis scales the weights" in said
    assert "network.wiring=elman has no layers" in said
