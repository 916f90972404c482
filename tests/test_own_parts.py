"""Parts of the user's own, of every kind: all are found, checked, run, kept and refused in the same way."""

import hashlib
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import ClassVar

import numpy as np
import pandas as pd
import pytest
from cases import SHORT, SMALL_GA, check_resumed, done, first_of, refused, runs_of

import epuckhebb
from epuckhebb import Rule
from epuckhebb.config import EvaluateConfig, EvolveConfig, load, plugins
from epuckhebb.config.parts import KINDS, part_class
from epuckhebb.controller.compiling.errors import PartError
from epuckhebb.controller.compiling.sources import UnknownSourceError, kernel_key, user_code
from epuckhebb.controller.controller import Controller
from epuckhebb.controller.evolved import Evolved
from epuckhebb.controller.genome import make_plan
from epuckhebb.controller.network import Network
from epuckhebb.flock.coupling import Coupling, Moment, changed
from epuckhebb.runtime.errors import ConfigError
from epuckhebb.store.genome import load_genome
from epuckhebb.store.run import Run
from epuckhebb.studies.flock import FlockStudy
from epuckhebb.studies.sweep import Identities

EXAMPLES = Path(__file__).parents[1] / "examples"
WIRES = "sizes: ClassVar = (3, 2)\n    synapses = lambda self, inputs: [(0, inputs + 4), (0, inputs + 5)]\n    "
SEARCHES = """\
def start(self, plan, seed): self.genes = np.zeros((3, plan.genes))
    def ask(self): return self.genes
    """
# By kind: the base class, what it needs besides, its method, and that method with an unknown argument.
BODIES = {
    "rule": ("Rule", "", "synapse = staticmethod(lambda pre: pre)"),
    "fitness": ("Fitness", "", "step = staticmethod(lambda left: left)"),
    "wiring": ("Wiring", WIRES, "neuron = staticmethod(lambda drive: drive)"),
    "sensor": ("Sensor", "", "read = staticmethod(lambda x: 0.5)"),
    "task": ("Task", "", ""),
    "optimizer": ("Optimizer", SEARCHES, "def tell(self, fitness): pass"),
    "coupling": ("Coupling", "", "def drive(self, now): return now.weights"),
    "change signal": ("ChangeSignal", "", "signal = staticmethod(lambda away_s: away_s)"),
}
METHODS = [kind for kind, (*_, method) in BODIES.items() if method]
ARGUMENTS = [kind for kind in METHODS if kind != "coupling"]  # whose method may have some arguments of many
HEAD = "from dataclasses import dataclass\nfrom typing import ClassVar\nimport numpy as np\nfrom epuckhebb import "


def part(kind, name="Fine", *, method=None, more="more: float = 1.0", decorated=True):
    """A file with a class of a kind."""
    base, needs, usual = BODIES[kind]
    how = "kw_only=True" if kind == "optimizer" else "frozen=True, kw_only=True"
    body = "\n    ".join([more, needs + (usual if method is None else method), "pass"])
    return f"{HEAD}{base}\n{f'@dataclass({how})' if decorated else ''}\nclass {name}({base}):\n    {body}\n"


def words_for(kind, name="Fine", **settings):
    """What names a part, and gives it settings."""
    row, where = KINDS[kind], f"bad.py:{name}"
    if kind == "sensor":
        given = "".join(f", {key}: {value}" for key, value in settings.items())
        return [f"robot.sensors=[{{sensor: {where}{given}}}]"]
    group = "flock.own" if kind == "coupling" else row.group
    return [f"{row.base.KEY}={where}", *(f"{group}.{key}={value}" for key, value in settings.items())]


def config_with(kind, text, name="Fine", **settings):
    """The configuration with a part, whose file has this text."""
    Path("bad.py").write_text(text)
    schema = {"coupling": FlockStudy, "optimizer": EvolveConfig}.get(kind, EvaluateConfig)
    return load(schema, words_for(kind, name, **settings))


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize("kind", BODIES)
def test_one_of_each_kind_is_found_and_has_its_settings(kind):
    settings = {"more": 2.5} if kind != "change signal" else {}  # whose settings are those of its adaptation
    config = config_with(kind, part(kind), **settings)
    (own,) = plugins.own_files(config.values).values()
    assert own.copies == {own.copy: Path("bad.py").read_bytes()}
    assert not settings or "'more': 2.5" in str(config.values)
    assert str(Path("bad.py").absolute()) in str(config.values)


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize("kind", sorted(BODIES.keys() - {"change signal", "coupling"}))
def test_what_was_left_as_it_is_in_a_class_is_in_the_configuration(kind):
    assert "'more': 1.0" in str(config_with(kind, part(kind)).values)


def test_all_kinds_are_tested():
    assert {*BODIES, "physics"} == set(KINDS)


# What is refused, before anything runs


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize("kind", first_of(BODIES, 2))
def test_what_cannot_be_a_part_is_refused_with_its_key(kind):
    row = KINDS[kind]
    key = row.base.KEY if kind != "sensor" else r"robot\.sensors\[0\]\.sensor"
    for text, name, settings, message in (
        (part(kind), "Fin", {}, rf"{key}=.*bad\.py:Fin: .*Fin of {row.base.__name__}.* Did you mean Fine\?"),
        (part(kind, decorated=False), "Fine", {}, rf"{key}=.*: more is not a setting; write @dataclass"),
        (part(kind), "Fine", {"mor": 1}, r"\.mor is no key of .* Did you mean more\?"),
        (part(kind), "Fine", {"more": "far"}, r"\.more: .*far"),
        (part(kind) + "import sys\nsys.exit(0)\n", "Fine", {}, r"bad\.py.*, line \d+, cannot be imported: SystemExit"),
        (part(kind) + "import nowhere\n", "Fine", {}, "cannot be imported: ModuleNotFoundError"),
        (part(kind) + "1 = 2\n", "Fine", {}, "cannot be imported: SyntaxError"),
        (part(kind, more="def __post_init__(self): raise SystemExit"), "Fine", {}, rf"{key}="),
        (part(kind, more="def __post_init__(self): {}['gone']"), "Fine", {}, rf"{key}=.*gone"),
    ):
        if kind != "change signal" or not (settings or "__post_init__" in text):  # it is never made, and has none
            with pytest.raises(ConfigError, match=message):
                config_with(kind, text, name, **settings)
    with pytest.raises(ConfigError, match=r"there is no Python file, FILE\.py, at "):
        load(EvaluateConfig, ["hebbian.rule=nowhere.py:Fine"])


def test_a_rule_has_the_defaults_of_its_class_and_what_is_typed_stays(tmp_path):
    """Also where the row that a run begins with, that of the paper's rule, says the same as what is typed."""
    text = "N: float = 0.5\n    floor: float = 0.7\n    trace_decay: float = 0.4\n"
    write(
        tmp_path,
        {
            "my": f"from epuckhebb.controller.plasticity.rules.paper import Paper\nfrom dataclasses import "
            f"dataclass\n@dataclass(frozen=True, kw_only=True)\nclass Mine(Paper):\n    {text}"
        },
    )
    words = [f"hebbian.rule={tmp_path}/my.py:Mine"]
    rule = load(EvaluateConfig, words).rule
    assert (rule.N, rule.floor, rule.trace_decay, rule.w_max) == (0.5, 0.7, 0.4, 2.0)
    typed = load(EvaluateConfig, [*words, "hebbian.N=0.000015", "hebbian.floor=0.2", "hebbian.trace_decay=0.95"]).rule
    assert (typed.N, typed.floor, typed.trace_decay) == (0.000015, 0.2, 0.95)


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize(("kind", "attribute"), [("rule", "evolved"), ("rule", "with_reward"), ("wiring", "evolved")])
def test_what_is_evolved_is_a_mapping_to_evolved(kind, attribute):
    for value in ("{'a': 3}", "3"):
        with pytest.raises(ConfigError, match=f"{KINDS[kind].base.KEY}=.*: {attribute} must"):
            config_with(kind, part(kind, more=f"{attribute}: ClassVar = {value}"))


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize("kind", METHODS)
def test_a_part_without_its_method_is_refused(kind):
    with pytest.raises(ConfigError, match=f"{KINDS[kind].base.METHODS[0]}"):
        config_with(kind, part(kind, method=""))


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize("kind", ARGUMENTS)
def test_an_unknown_argument_is_refused(kind):
    method = "def tell(self, weather): pass"
    if kind != "optimizer":
        method = f"{KINDS[kind].base.METHODS[0]} = staticmethod(lambda weather: 0.0)"
    with pytest.raises(ConfigError, match="takes weather; known are"):
        config_with(kind, part(kind, method=method))


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize(
    ("words", "texts"),
    [
        (["fitness.function=explorer"], ["fitness.function", "paper", "FILE.py:NAME"]),
        (["network.wiring=ctrn"], ["network.wiring", "ctrnn", "elman", "mlp"]),
        (["hebbian.rule=ojaa"], ["hebbian.rule", "oja"]),
        (["task.kind=mine"], ["task.kind", "reversal"]),
        (["robot.sensors=far"], ["robot.sensors", "far"]),
        (["robot.sensors=[far]"], ["robot.sensors[0]", "FILE.py:NAME"]),
        (["robot.sensors=[{noise: 1}]"], ["robot.sensors[0]", "FILE.py:NAME"]),
        (["fitness.goal=1"], ["fitness.goal", "fitness paper"]),
        (["hebbian.signal=fitness"], ["hebbian.signal=fitness", "`step`"]),
        (["hebbian.normalise=most"], ["hebbian.normalise", "none, largest, length", "'most'"]),
        (["hebbian.average=0"], ["hebbian.average must lie in [1, 10000], got 0"]),
        (["hebbian.every=0"], ["hebbian.every must be 1 or more, got 0"]),
        (["hebbian.every=1.5"], ["hebbian.every", "1.5"]),
        (["network.wiring=elman", "hebbian.normalise=largest"], ["hebbian.normalise=largest", "elman"]),
        (["network.wiring=ctrnn", "network.hidden=-1"], ["network.hidden must be 0 or more, got -1"]),
        (["network.wiring=ctrnn", "network.layers=[16,2]"], ["network.layers is no key of wiring ctrnn"]),
        (["network.hidden=3"], ["network.hidden is no key of wiring mlp"]),
        (["network.wiring=elman", "adaptation=homeostasis"], ["adaptation=homeostasis", "elman"]),
    ],
)
def test_a_name_or_a_setting_that_no_part_has_is_refused(words, texts):
    with pytest.raises(ConfigError) as error:
        load(EvaluateConfig, words)
    assert [text for text in texts if text not in str(error.value)] == []


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize(
    ("words", "texts"),
    [
        (["network.wiring=ctrnn", "hebbian=modulated"], ["rule modulated has a modulatory neuron", "ctrnn"]),
        (["network.wiring=elman", "hebbian=abcd_shared"], ["rule abcd_shared has A for each layer", "elman"]),
        (["network.wiring=elman", "hebbian=discrete"], ["hebbian.normalise=length", "elman"]),
    ],
)
def test_a_rule_of_layers_is_refused_where_there_are_none(words, texts):
    with pytest.raises(ConfigError) as error:
        load(EvolveConfig, words)
    assert [text for text in texts if text not in str(error.value)] == []


LIFE = "life = staticmethod(lambda success: {})"
BAD = {  # a name, and the words with which its part is evaluated or evolved
    "counts": (part("fitness", method="count: ClassVar = [0]\n    @staticmethod\n    def life(success):\n"
                    "        Fine.count[0] += 1\n        return Fine.count[0]"), "fitness", "run again"),
    "draws": (part("fitness", method=LIFE.format("np.random.random()")), "fitness", "run again"),
    "leaves": (part("fitness", method=LIFE.format("exit()")), "fitness", "`life` failed in line 8: SystemExit"),
    "fails": (part("fitness", method=LIFE.format("[][1]")), "fitness", "`life` failed in line 8: IndexError"),
    "words": (part("fitness", method=LIFE.format("'good'")), "fitness", "'good'"),
    "nan": (part("fitness", method=LIFE.format("np.nan")), "fitness", "nan"),
    "negative": (part("sensor", method="read = staticmethod(lambda x: -0.5)"), "sensor", "-0.5"),
    "raises": (part("task", method="def hooks(self, first): raise ValueError('no')"), "task",
               "task.kind (task Fine) failed: ValueError: no"),
    "breaks off": (part("task", method="def check(self, light, time): raise BrokenPipeError"), "task",
                   "bad.py, line 8: BrokenPipeError"),
    "several": (part("sensor", method="read = staticmethod(lambda x: (0.1, 0.2))"), "sensor", "must give a number"),
    "leaving": (part("sensor", method="read = staticmethod(lambda x: exit())"), "sensor", "robot.sensors.sensor="),
    "far": (part("wiring").replace("inputs + 4", "99"), "wiring", "synapse (0, 99) must join one of 0 to 21"),
    "endless": (part("wiring").replace("[(0, inputs + 4), (0, inputs + 5)]", "iter(lambda: (0, inputs + 1), 0)"),
                "wiring", "100001 weights or more"),
    "alone": (part("wiring").replace("[(0, inputs + 4), (0, inputs + 5)]", "[]"), "wiring", "gives none"),
    "failing": (part("wiring").replace("[(0, inputs + 4), (0, inputs + 5)]", "[][1]"), "wiring", "IndexError"),
    **{f"can write by {what}": (part("fitness", method=f"@staticmethod\n    def step(readings):\n        {store}\n"
                                     "        return 0.5"), "fitness", f"`step` uses {what}")
       for what, store in (("flat", "readings.flat[3] = 0.0"),
                           ("nditer", "for one in np.nditer(readings): one[()] = 0.0"),
                           ("ascontiguousarray", "np.ascontiguousarray(readings)[3] = 0.0"))},
    "one wheel": (part("wiring").replace("(3, 2)", "(3, 1)"), "wiring", "`sizes`"),
}  # fmt: skip


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize("case", BAD)
def test_what_a_part_does_wrong_is_refused_before_there_is_a_folder(case):
    text, kind, message = BAD[case]
    Path("bad.py").write_text(text)
    words = ["evaluate", *SHORT] if kind == "fitness" else ["evolve", "lifetime.duration_s=2"]
    assert message in refused(*words, *words_for(kind))
    assert not Path("runs").exists()


COMPILED = {  # it takes a kernel to find these; the first is among the ordinary tests
    "draws in a helper": (part("fitness", method="step = staticmethod(lambda left: left + helper())") +
                          "from numba.extending import overload\ndef helper(): pass\n@overload(helper)\n"
                          "def _helper(): return lambda: np.random.random()\n", "fitness", "run again"),
    **{f"gives {what}": (part(kind, method=f"{method} = staticmethod(lambda {argument}: {given})"), kind,
                         f"`{method}` must give a number, it gives {what}")
       for kind, method, argument, given, what in (
           ("rule", "synapse", "pre", "None", "nothing"), ("fitness", "step", "left", "(left, left)", "UniTuple"),
           ("fitness", "step", "left", "'good'", "unicode_type"), ("wiring", "neuron", "drive", "1j", "complex"),
           ("sensor", "read", "x", "x if x > 0 else None", "nothing, at least sometimes"))},
    "makes no sense": (part("rule", method="synapse = staticmethod(lambda pre: pre.times(2))"), "rule", "times"),
    "draws": (part("sensor", method="read = staticmethod(lambda x: np.random.random())"), "sensor", "run again"),
    "draws numbers": (part("wiring", method="neuron = staticmethod(lambda drive: np.random.random())"), "wiring",
                      "run again"),
    "is infinite": (part("fitness", method="step = staticmethod(lambda left: left / 0.0 if left < 2 else left)"),
                    "fitness", "infinite or nan"),
    "fires for ever": (part("wiring", method="neuron = staticmethod(lambda drive: drive + 1.0 / 0.0)"), "wiring",
                       "infinite or nan"),
    "has no such state": (part("fitness", method="step = staticmethod(lambda state: state.mor)"), "fitness",
                          "have no 'mor'"),
    **{f"writes into {what}": (part(kind, method=f"@staticmethod\n    def {method}({what}):\n        {store} = 0.0\n"
                                    "        return 0.5"), kind, "an array that it is handed")
       for kind, method, what, store in (
           ("fitness", "step", "readings", "readings[3]"), ("change signal", "signal", "readings", "readings[0]"),
           ("change signal", "signal", "nominal", "nominal.reading_mean[0, 0]"),
           ("sensor", "read", "walls", "walls[1:][0, 0]"))},
    "raises": (part("fitness", method="@staticmethod\n    def step(left):\n        if left < 2:\n"
                    "            raise ValueError('too far')\n        return left"), "fitness",
               "bad.py:Fine failed in line 11: ValueError: too far"),
    **{f"reads beyond {what}": (text, kind, "Fine failed: IndexError")
       for what, kind, text in (
           ("a table", "fitness", part("fitness", method="step = staticmethod(lambda left: TABLE[100000])")
            + "TABLE = np.arange(9.0)\n"),
           ("the readings", "fitness",
            part("fitness", method="step = staticmethod(lambda readings: readings[16])")),
           ("the readings of a signal", "change signal",
            part("change signal", method="signal = staticmethod(lambda readings: readings[16])")),
           ("a table in a helper", "fitness",
            part("fitness", method="step = staticmethod(lambda left: helper(100000))")
            + "import numba\nTABLE = np.arange(9.0)\n@numba.njit\ndef helper(k): return TABLE[k]\n"))},
    "is no number": (part("change signal", method="signal = staticmethod(lambda time_s: np.sqrt(0.1 - time_s))"),
                     "change signal", "gave nan on a left trial of scenario base at step 5 of 250"),
    "has no such setting": (part("rule", method="synapse = staticmethod(lambda pre, by: pre * by.mor)"), "rule", "mor"),
}  # fmt: skip


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize("case", [next(iter(COMPILED)), *(
    pytest.param(case, marks=pytest.mark.thorough) for case in list(COMPILED)[1:]
)])  # fmt: skip
def test_what_compiled_code_does_wrong_is_refused_before_there_is_a_folder(case):
    text, kind, message = COMPILED[case]
    Path("bad.py").write_text(text)
    words = ["evolve", "lifetime.duration_s=2"] if kind in ("wiring", "sensor") else ["evaluate", *SHORT]
    assert message in refused(*words, *words_for(kind), *(["hebbian.N=0.001"] if kind == "rule" else []))
    assert not Path("runs").exists()


def test_what_plain_python_is_handed_cannot_be_written():
    network = Network((1, 2, 1))
    now = Moment(np.ones((2, 2)), np.zeros((2, 2)), np.zeros(2), -1, 0.0)

    def store(array):
        array[0] = 1.0
        return array

    class Writes(Coupling):
        def weights(self, now):
            return store(now.weights)

    class Evolves(Rule):
        evolved: ClassVar = {"A": Evolved("network", value=store)}
        synapse = staticmethod(lambda A: A)

    with pytest.raises(PartError, match="read-only"):
        changed(Writes(), now)
    with pytest.raises(ValueError, match="read-only"):
        Controller(np.zeros(make_plan(network, Evolves).genes), network, Evolves())
    assert (now.weights == 1.0).all()


@pytest.mark.usefixtures("here")
def test_what_a_part_prints_is_on_standard_error():
    """Compiled code prints, too, and goes on."""
    method = (
        "def step(left):\n        print('stepping')\n        return left > 0.5\n    step = staticmethod(step)\n    "
    )
    Path("bad.py").write_text(part("fitness", method=method + LIFE.format("print('living') or 0.5")))
    result = done("evaluate", *SHORT, *words_for("fitness"), "--json")
    assert json.loads(result.stdout)["command"] == "evaluate"
    assert {"stepping", "living"} <= set(result.stderr.split())


# An edited file counts at once, also for machine code


def fitness_of(words):
    done("evaluate", *words, *SHORT, "lifetime.record_every=0")
    (run,) = Path("runs/evaluate").iterdir()
    fitness = pd.read_csv(run / "metrics.csv").fitness
    shutil.rmtree("runs")
    return float(fitness[0])


EDITED = {
    "an Enum": ("from enum import Enum\nclass Mode(Enum):\n    LOW = 1.0\n    HIGH = 5.0\n    USED = {}\n",
                "Mode.USED.value"),
    "an overload": ("from numba.extending import overload\ndef used(): pass\n@overload(used)\n"
                    "def _used(): return lambda: {}\n", "used()"),
}  # fmt: skip


@pytest.mark.thorough
@pytest.mark.usefixtures("here")
@pytest.mark.parametrize("what", [next(iter(EDITED)), pytest.param("an overload", marks=pytest.mark.thorough)])
def test_an_edit_is_compiled_anew(what):
    text, value = EDITED[what]
    method = f"step = staticmethod(lambda x: x - x + {value})"
    for number in (1.0, 5.0):
        Path("bad.py").write_text(text.format(number) + part("fitness", method=method))
        assert fitness_of(words_for("fitness")) == pytest.approx(number, rel=1e-12)


# A file, and what it imports from its folder

RULE = '''\
"""Oja's rule, whose decay is that of a file beside it."""

from dataclasses import dataclass

from epuckhebb import Rule
from .helper import DECAY


@dataclass(frozen=True, kw_only=True)
class oja(Rule):
    decay: float = DECAY

    @staticmethod
    def synapse(correlation, post, weight, by):
        return correlation - by.decay * post * post * weight
'''
SIGNAL = """
from epuckhebb import ChangeSignal


class Away(ChangeSignal):
    @staticmethod
    def signal(away_s, nominal):
        return away_s / nominal.novelty
"""
OJA = ["hebbian.rule=my.py:oja", "hebbian.N=0.0001"]
BRIEF = ["lifetime.duration_s=2", "lifetime.record_every=0", "repeats=1"]


def write(folder, texts):
    """Files in a folder, by their names without .py."""
    for name, text in texts.items():
        file = Path(folder, f"{name}.py")
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)


def loaded(file):
    return plugins.load(Path(file), str(file))


def own_file(file):
    return plugins.own_files({"part": f"{file}:Any"})[Path(file)]


def test_helpers_of_one_name_are_kept_apart(tmp_path):
    write(tmp_path, {"a/my": RULE, "a/helper": "DECAY = 1.0\n", "b/my": RULE, "b/helper": "DECAY = 2.0\n"})
    decays = [plugins.class_named(f"{tmp_path}/{one}/my.py:oja", Rule, "hebbian.rule").decay for one in ("a", "b", "a")]
    assert decays == [1.0, 2.0, 1.0]
    assert "helper" not in sys.modules


@pytest.mark.parametrize("on_path", [False, True])
def test_a_helper_that_is_imported_without_a_dot_is_refused_with_what_to_write(tmp_path, monkeypatch, on_path):
    """Also where Python would find it, as `python -m` does in the folder: the run would have no copy of it."""
    if on_path:
        monkeypatch.syspath_prepend(tmp_path)
    name = f"helper_{on_path}"
    write(tmp_path, {"my": RULE.replace(".helper", name), name: "DECAY = 1.0\n"})
    with pytest.raises(ConfigError, match=rf"my=.*my\.py.* cannot be imported: .*from \. import {name}"):
        plugins.load(tmp_path / "my.py", "my=my.py")
    monkeypatch.delitem(sys.modules, name, raising=False)
    write(tmp_path, {"my": RULE.replace(".helper", f".{name}")})
    assert loaded(tmp_path / "my.py").DECAY == 1.0


def test_a_module_that_a_library_makes_has_no_file(here):
    """PyTorch's `torch.ops` names `_ops.py`, which is nowhere, and least of all in the current folder."""
    text = "import sys, types\nmade = sys.modules['made'] = types.ModuleType('made')\nmade.__file__ = '_made.py'\n"
    write(here, {"my": text})
    assert loaded("my.py").made.__name__ == "made"
    assert list(own_file("my.py").sha256) == [str(here / "my.py")]
    del sys.modules["made"]


MANY = """\
import numpy as np
from . import profile
from .pkg import inner
VALUES = profile.ONE, inner.THREE, np.__name__
def late():
    from . import helper
    return helper.FOUR
"""


def test_the_name_of_a_file_may_have_dots_and_hyphens(tmp_path):
    write(tmp_path, {"my-rule.v2": RULE, "helper": "DECAY = 1.0\n"})
    assert plugins.class_named(f"{tmp_path}/my-rule.v2.py:oja", Rule, "hebbian.rule").decay == 1.0


def test_copies_of_all_files_of_the_folder_will_do(tmp_path):
    """Also of one with the name of a module of Python's, and of one that is imported late."""
    write(tmp_path / "here", {"my": MANY, "profile": "ONE = 1\n", "helper": "FOUR = 4\n"})
    write(tmp_path / "here", {"pkg/inner": "from . import deeper\nTHREE = deeper.THREE\n", "pkg/deeper": "THREE = 3\n"})
    module = loaded(tmp_path / "here" / "my.py")
    assert (module.VALUES, module.late()) == ((1, 3, "numpy"), 4)
    own = own_file(tmp_path / "here" / "my.py")
    assert sorted(own.sources) == ["helper.py", "my.py", "pkg/deeper.py", "pkg/inner.py", "profile.py"]
    for place, content in own.copies.items():
        (tmp_path / place).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / place).write_bytes(content)
    before, copy = own.digest, own.copy
    shutil.rmtree(tmp_path / "here")
    module = loaded(tmp_path / copy)
    assert (module.VALUES, module.late()) == ((1, 3, "numpy"), 4)
    again = own_file(tmp_path / copy)
    assert (again.digest, again.copy) == (before, copy)


def test_an_identity_changes_with_a_file_that_a_rule_imports(tmp_path):
    write(tmp_path, {"my": RULE, "helper": "DECAY = 1.0\n"})
    config = load(EvaluateConfig, [f"hebbian.rule={tmp_path}/my.py:oja", "hebbian.decay=1"]).values
    before, files = Identities().name(config), plugins.user_sources(config)
    assert sorted(files) == [f"{tmp_path}/helper.py", f"{tmp_path}/my.py"]
    assert Identities().name(config) == before
    write(tmp_path, {"helper": "DECAY = 3.0\n"})  # as long as before, and within the same second
    assert Identities().name(config) != before
    assert plugins.class_named(f"{tmp_path}/my.py:oja", Rule, "hebbian.rule").decay == 3.0


@pytest.mark.parametrize("helper", ["DECAY = = 1\n", "import nowhere\n"])
def test_a_mistake_in_a_helper_is_reported_with_its_place(tmp_path, helper):
    write(tmp_path, {"my": RULE, "helper": f"# a helper\n{helper}"})
    with pytest.raises(ConfigError, match=r"helper\.py, line 2, cannot be imported: (Syntax|ModuleNotFound)Error"):
        loaded(tmp_path / "my.py")
    write(tmp_path, {"helper": "DECAY = 1.0\n"})
    assert loaded(tmp_path / "my.py").DECAY == 1.0


@pytest.mark.thorough
@pytest.mark.usefixtures("here")
def test_a_run_keeps_two_rules_of_one_file_name_and_needs_the_files_no_more():
    """Rules that would now do harm: what reads a run does not run them, and `rerun` takes the copies."""
    write("", {"a/my": RULE, "a/helper": "DECAY = 1.0\n", "b/my": RULE, "b/helper": "DECAY = 2.0\n"})
    own = [f"compare.{one}={{rule: {one}/my.py:oja, N: 0.0001}}" for one in ("a", "b")]
    done("evaluate", "hebbian.N=0.002", *own, "lifetime.duration_s=2", "repeats=1", "hydra.run.dir=run")
    done("replay", "run", "-o", "before.html")
    assert len(list(Path("run").glob("own_code/*/my.py"))) == 2
    write("", {"a/my": "open('done', 'w').close()\n"})
    shutil.rmtree("b")
    done("replay", "run", "-o", "after.html")
    assert Path("after.html").read_bytes() == Path("before.html").read_bytes()
    done("export", "run", "--webots", "-o", "c")
    assert "bit-identical" in done("rerun", "run").stdout
    assert not Path("done").exists()


@pytest.mark.thorough
def test_a_kernel_with_a_helper_comes_from_disk_in_another_process(tmp_path):
    """numba names the modules of functions that are not inlined; nothing of them is needed."""
    rule = RULE.replace("import DECAY", "import DECAY, grow").replace("return corr", "return grow(corr") + ")\n"
    write(tmp_path, {"my": rule.replace("weight\n)", "weight)")})
    write(tmp_path, {"helper": "import numba\nDECAY = 1.0\n@numba.njit\ndef grow(x):\n    return 1.5 * x\n"})
    for name in ("one", "two"):
        words = [*OJA, *BRIEF, f"hydra.run.dir={name}"]
        environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache")}
        subprocess.run(
            [sys.executable, "-m", "epuckhebb", "evaluate", *words], cwd=tmp_path, env=environment, check=True
        )
    one, two = ((tmp_path / name / "metrics.csv").read_bytes() for name in ("one", "two"))
    assert one == two


# From the first command to the last, with parts of all kinds at once

PARTS = [
    "network.wiring=my_neurons.py:Ring",
    "network.hidden=5",
    "fitness.function=my_fitness.py:Explorer",
    "fitness.goal=2",
    "robot.sensors=[{sensor: my_sensors.py:GoalDistance},{sensor: my_sensors.py:FloorPatch, at_y: 0.1}]",
]
SEARCH = ["optimizer.algorithm=my_optimizer.py:CmaMe", "optimizer.population=6", "optimizer.emitters=2"]
SEARCH += ["optimizer.cells=5", "optimizer.confirm=2", "lifetime.duration_s=2", "scenario.paper_duration_s=10", "-q"]
RESULTS = ("history.csv", "champion.npz", "archive.csv")


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("parts")
    for name in ("own_controller", "own_fitness", "own_optimizer", "own_sensor"):
        shutil.copytree(EXAMPLES / name, folder / "examples", dirs_exist_ok=True)
    write(folder / "examples", {"my": RULE, "helper": "DECAY = 1.0\n", "my_signal": SIGNAL})
    adapted = ["hebbian.signal=fitness", "adaptation.change_signal=my_signal.py:Away", "adaptation.threshold=0.5"]
    return runs_of(
        folder / "runs",
        folder / "examples",
        ["evolve", *PARTS, *SEARCH, "optimizer.generations=2", "hydra.run.dir=evolved"],
        [
            "evaluate",
            "genome=evolved",
            *PARTS,
            *OJA,
            *adapted,
            "hebbian.signal=fitness",
            *SHORT,
            "hydra.run.dir=evaluated",
        ],
    )


def test_an_evolution_with_them_is_resumed_to_the_same_bytes(copy):
    check_resumed([*PARTS, *SEARCH], ("optimizer.generations=1", "optimizer.generations=2"), RESULTS)
    with (copy / "my_optimizer.py").open("a") as file:
        file.write("\n# another\n")
    said = refused("evolve", "resume=again", "optimizer.generations=3")
    assert "my_optimizer.py, or a file that it imports, has changed" in said


def test_runs_with_them_are_shown_replayed_and_rerun_without_the_files(copy):
    for file in copy.glob("*.py"):
        file.write_text("open('done', 'w').close()\n")
    shown = " ".join(done("show", "evolved").stdout.split())
    for text in ("Evolved: optimizer CmaMe", "fitness_function Explorer", "-5-2 (Ring)"):
        assert text in shown
    done("replay", "evaluated")
    page = (copy / "evaluated" / "replay.html").read_text()
    assert all(name in page for name in ('"wiring":"Ring"', "GoalDistance", "FloorPatch"))
    for run in ("evaluated", "evolved"):
        assert "to Webots" in refused("export", run, "--webots", "-o", "c")
    assert not (copy / "done").exists()
    for run in ("evaluated", "evolved"):
        assert "bit-identical" in done("rerun", run).stdout
    (again,) = (copy / "runs" / "evaluate").iterdir()
    assert "bit-identical" in done("rerun", str(again)).stdout


def test_the_champion_and_the_run_hold_what_they_are_of(runs):
    genome = load_genome(str(runs / "evolved"), "obstacles")
    assert (genome.fitness_function, genome.sensors) == ("Explorer", "GoalDistance, FloorPatch")
    assert (genome.wiring, genome.network.layers) == ("Ring", (18, 5, 2))
    assert genome.plan.text() == f"{5 * 18 + 10 + 10} weights, 7 neuron.tau, 7 neuron.bias"
    assert np.load(runs / "evaluated" / "traces.npz")["activations"].shape[2] == 7
    rows = Run(runs / "evaluated").table("metrics.csv")
    (changed,) = set(rows.changed)
    for text in ("fitness.function=Explorer", "fitness.goal=2", "network.wiring=Ring", "network.hidden=5"):
        assert text in changed
    plastic = rows[rows.controller == "away"]
    assert set(plastic.N) == {0.0001}
    assert (plastic.weight_change_mean > 0).all()
    files = Run(runs / "evaluated").provenance["own_code"]
    assert sorted(map(os.path.basename, files)) == [
        "my.py",
        "my_fitness.py",
        "my_neurons.py",
        "my_sensors.py",
        "my_signal.py",
    ]
    sha256 = hashlib.sha256((runs / "helper.py").read_bytes()).hexdigest()
    assert sha256 in next(own for file, own in files.items() if file.endswith("my.py"))["sha256"].values()
    assert "trace_decay" not in (runs / "evaluated" / ".hydra" / "config.yaml").read_text()  # is the paper's rule's


@pytest.mark.thorough
@pytest.mark.usefixtures("copy")
def test_a_champion_of_other_parts_is_refused_or_the_difference_said():
    wiring, fitness, sensors = PARTS[:2], PARTS[2:4], PARTS[4:]
    assert "own sensors GoalDistance, FloorPatch" in refused("evaluate", "genome=evolved", *wiring, *SHORT)
    said = refused("evaluate", "genome=evolved", *sensors, *SHORT)
    assert "is for network.wiring=Ring, got network.wiring=mlp" in said
    said = refused("evaluate", "genome=reference", *wiring, *SHORT)
    assert "is for 16-7-5-8-4-2" in said
    assert "network.wiring=Ring" in said
    assert "the settings make 18-8-2" in refused("evaluate", "genome=evolved", *wiring[:1], *sensors, *SHORT)
    for words, text in (([], "fitness Explorer (here paper)"), (fitness, "")):
        more = [*wiring, *sensors, *words, "hebbian=none", "lifetime.record_every=0"]
        said = " ".join(done("evaluate", "genome=evolved", *more, *SHORT).stdout.split())
        assert text in said
        assert ("for another world" in said) == bool(text)


@pytest.mark.parametrize("copied", ["# changed\n", None])
def test_a_copy_that_was_changed_or_lost_is_refused(copy, copied):
    (file,) = copy.glob("evaluated/own_code/*/helper.py")
    if copied:
        file.write_text(file.read_text() + copied)
    else:
        file.unlink()
    for words in (["rerun", "evaluated"], ["replay", "evaluated"], ["export", "evaluated", "--webots"]):
        assert "helper.py" in refused(*words)
    assert not (copy / "runs").exists()


@pytest.fixture
def own(here):
    """A folder with a rule of one's own."""
    write(here, {"my": RULE, "helper": "DECAY = 1.0\n"})
    return here


def metrics(run):
    return pd.read_csv(Path(run) / "metrics.csv", keep_default_na=False, na_values=[""])


@pytest.mark.thorough
@pytest.mark.usefixtures("own")
def test_ours_is_the_programs_oja_wherever_it_is_given():
    """As a key, in a file of one's own, below compare; the file's name is the controller's."""
    Path("conf/hebbian").mkdir(parents=True)
    Path("conf/hebbian/mine.yaml").write_text("rule: my.py:oja\nN: 0.0001\n")
    compare = ["hebbian=none", "compare.mine={rule: my.py:oja, N: 0.0001}"]
    for name, words in {
        "key": OJA, "file": ["hebbian=mine", "--config-dir", "conf"], "below": compare,
        "ours": ["hebbian=oja", "hebbian.N=0.0001"],
    }.items():  # fmt: skip
        done("evaluate", *words, *BRIEF, f"hydra.run.dir={name}")
    ours = metrics("ours").drop(columns="controller")
    for name, controller in {"key": "oja", "file": "mine", "below": "mine"}.items():
        rows = metrics(name)
        assert list(rows.controller.unique()) == ["GA", controller]
        pd.testing.assert_frame_equal(rows.drop(columns="controller"), ours)


@pytest.mark.thorough
@pytest.mark.usefixtures("own")
def test_in_a_sweep_an_edited_one_makes_new_jobs():
    Path("conf/experiment").mkdir(parents=True)
    Path("conf/experiment/rates.yaml").write_text(
        "# @package _global_\nhydra: {sweeper: {params: {hebbian.N: '0.0001,0.0002'}}}\n"
    )
    words = ["sweep", "rates", *OJA[:1], *BRIEF, "hydra/launcher=basic", "hydra.sweep.dir=out", "--config-dir", "conf"]
    assert "0 done before, 2 to do" in done(*words).stderr
    assert "2 done before, 0 to do" in done(*words).stderr
    assert set(pd.read_csv("out/sweep.csv").controller) == {"GA", "oja"}
    write("", {"helper": "DECAY = 1.0  # only a remark\n"})
    assert "0 done before, 2 to do" in done(*words).stderr
    assert len(list(Path("out").glob("job_*"))) == 4


@pytest.mark.thorough
@pytest.mark.usefixtures("here")
def test_a_champion_brings_a_wiring_of_the_program_to_every_job_of_a_sweep():
    done("evolve", "network.wiring=elman", *SMALL_GA, "ga.generations=1", "hydra.run.dir=elman")
    words = ["genome=elman", *SHORT, "lifetime.record_every=0"]
    done("evaluate", "-m", "seed=1,2", *words, "hydra.sweep.dir=out", "hydra/launcher=basic")
    for job in (0, 1):
        assert metrics(f"out/{job}").changed.str.contains("network.wiring=elman").all()


@pytest.mark.thorough
@pytest.mark.usefixtures("own")
def test_an_object_from_python():
    rule = part_class("rule", "my.py:oja", "hebbian")
    rows = epuckhebb.evaluate(epuckhebb.load(), "scenario=base", *BRIEF, hebbian=rule(N=0.0001, decay=2.0)).metrics
    assert list(rows.controller.unique()) == ["GA", "oja"]
    named = epuckhebb.evaluate(epuckhebb.load(), "scenario=base", *BRIEF, *OJA, "hebbian.decay=2").metrics
    pd.testing.assert_frame_equal(rows, named)
    write("", {"bad": part("fitness")})
    fitness = part_class("fitness", "bad.py:Fine", "fitness")
    with pytest.raises(ValueError, match=r"fitness must be .* FILE\.py:NAME"):
        epuckhebb.evaluate(fitness=fitness())


@pytest.mark.thorough
@pytest.mark.usefixtures("here")
def test_what_a_rule_evolves_goes_with_the_champion():
    """In a file and in Python; a champion that lacks it is refused."""
    rule = [f"hebbian.rule={EXAMPLES}/own_rule/evolved_rule.py:Layered", "hebbian.N=0.0001"]
    done("evolve", *rule, *SMALL_GA, "ga.generations=1", "hydra.run.dir=evolved")
    genome = load_genome("evolved", "obstacles")
    assert genome.plan.text() == "234 weights, 5 grow, 5 leak"
    assert "234 weights, 5 grow, 5 leak" in done("show", "evolved").stdout
    done("evaluate", "genome=evolved", *rule, *BRIEF, "hydra.run.dir=out")
    rows, written = epuckhebb.evaluate(genome.genes, *rule, *BRIEF).metrics, metrics("out")
    measured = ["controller", "weight_change_mean", "path_length_m", "fitness"]
    pd.testing.assert_frame_equal(rows[measured], written[measured])
    assert (rows.weight_change_mean[rows.controller == "layered"] > 0).all()
    assert "has rule Layered, and genome=reference" in refused("evaluate", *rule, *BRIEF)


@pytest.mark.usefixtures("here")
def test_a_refusal_is_one_message_and_leaves_nothing():
    write("", {"bad": part("rule", method="")})
    assert "hebbian.rule" in refused("evaluate", *words_for("rule"))
    assert not Path("runs").exists()


def test_rows_and_own_rules_are_choices_of_one_list(here):
    shutil.copy(Path(__file__).parents[1] / "examples" / "own_rule" / "my_rules.py", here)
    done("evaluate", "-m", "hebbian=none,my_rules.py:Gated", "hydra.sweep.dir=out", *BRIEF)
    rows = pd.read_csv("out/summary.csv")
    assert set(rows.controller) == {"GA", "gated"}
    done("evaluate", "hebbian=my_rules.py:Gated", "hydra.run.dir=alone", *BRIEF)
    assert Path("alone/metrics.csv").read_bytes() == Path("out/1/metrics.csv").read_bytes()


@pytest.mark.usefixtures("here")
def test_classes_that_a_function_makes_are_others():
    head = "def made(c):\n    class Made(Rule):\n        synapse = staticmethod(lambda pre: c * pre)\n    return Made\n"
    Path("my.py").write_text(f"from epuckhebb import Rule\n{head}Plus, Minus = made(1.0), made(-1.0)\n")
    plus, minus = (plugins.class_named(f"my.py:{name}", Rule, "hebbian.rule") for name in ("Plus", "Minus"))
    assert user_code((plus,)) != user_code((minus,))
    with pytest.raises(UnknownSourceError):  # no file tells what a function's variables hold
        kernel_key((plus,))
