"""How the science is compiled: a kernel's name says what it is made of, and kernels do not get in each other's way."""

import json
import os
import shutil
import subprocess
import sys
import tempfile
import types
from enum import IntEnum

import numba
import numpy as np
import pytest

from epuckhebb.sim import lifetime
from epuckhebb.sim.compiled import compiled, digest, kernel
from epuckhebb.sim.lifetime import kernel_of
from epuckhebb.sim.network import PAPER_NETWORK, Network
from epuckhebb.sim.plasticity import update
from epuckhebb.sim.plasticity.oja import Oja
from epuckhebb.sim.plasticity.paper import Paper
from epuckhebb.sim.robot import EPUCK

FACTOR = 2.0


def times(number, docstring=""):
    def part(x):
        return number * x * FACTOR

    part.__doc__ = docstring
    return compiled(part)


def calls(a, b, c):
    def whole(x):
        return a(x) + b(x) + c(x)

    return whole


def test_the_same_code_with_the_same_parts_has_the_same_name():
    assert digest(times(3.0)) == digest(times(3.0)) != digest(times(4.0))
    assert digest(times(3.0)) != digest(times(3))  # whole numbers are compiled to other code
    assert digest(times(np.ones(2))) != digest(times(np.ones(3))) != digest(times(np.arange(3.0)))


def test_another_global_is_another_name(monkeypatch):
    before = digest(times(3.0))
    monkeypatch.setattr(sys.modules[__name__], "FACTOR", 2.5)
    assert digest(times(3.0)) != before


def test_a_docstring_says_nothing():
    codes = ['def f(x):\n    """One."""\n    return x', 'def f(x):\n    """Other."""\n    return x']
    functions = []
    for code in codes:
        names = {}
        exec(code, names)
        functions.append(names["f"])
    assert digest(functions[0]) == digest(functions[1])


def test_it_matters_which_function_is_called_where():
    one, two = times(1.0), times(2.0)
    names = {digest(calls(*parts)) for parts in ((one, two, one), (one, two, two), (two, one, one), (one, one, two))}
    assert len(names) == 4


def test_names_of_what_synapses_keep_matter():
    assert digest(lambda kept: kept["slow"]) != digest(lambda kept: kept["fast"])


class One(IntEnum):
    chosen = 1


class Two(IntEnum):
    chosen = 2


def test_options_enumerations_and_modules_matter():
    def plain(x):
        return x + 1.0

    exact, fast = numba.njit(plain), numba.njit(fastmath=True)(plain)
    assert digest(calls(exact, exact, exact)) != digest(calls(fast, fast, fast))

    def choose(kind):
        return digest(lambda: kind.chosen)

    Two.__qualname__ = One.__qualname__
    assert choose(One) != choose(Two)

    def of_module(number):
        helpers = types.ModuleType("helpers")
        helpers.decay = times(number)
        return digest(lambda x: helpers.decay(x) + 1.0)

    assert of_module(1.0) == of_module(1.0) != of_module(2.0)


def name_of(rule, network=PAPER_NETWORK):
    return kernel_of(rule, "none", network, EPUCK).py_func.__qualname__


def test_a_script_that_changes_an_equation_gets_a_kernel_of_its_own(monkeypatch):
    before = name_of(Paper)
    monkeypatch.setattr(lifetime, "_kernels", {})
    assert name_of(Paper) == before

    def soft(weight, rate, direction, w_max):
        return w_max * np.tanh((weight + rate * direction) / w_max)

    monkeypatch.setattr(lifetime, "_kernels", {})
    monkeypatch.setattr(update, "next_weight", compiled(soft))
    assert name_of(Paper) != before


def test_parts_have_names_of_their_own():
    names = [name_of(Paper), name_of(Oja), name_of(Paper, Network((16, 3, 2))), name_of(Oja, Network((16, 2)))]
    assert len(set(names)) == 4


def in_processes(code, arguments, cache):
    """Run `code` in a process for each of `arguments`; what it printed, as JSON."""
    said, script = [], cache / "script.py"  # numba caches nothing of a program that is not in a file
    script.write_text(code)
    for number, argument in enumerate(arguments):
        environment = {**os.environ, "NUMBA_CACHE_DIR": str(cache), "PYTHONHASHSEED": str(number)}
        ended = subprocess.run(
            [sys.executable, script, *argument.split()], env=environment, capture_output=True, text=True, check=True
        )
        said.append(json.loads(ended.stdout))
    return said


NAMES = """
import json
from epuckhebb.sim.lifetime import kernel_of
from epuckhebb.sim.network import PAPER_NETWORK
from epuckhebb.sim.plasticity.paper import Paper
from epuckhebb.sim.robot import EPUCK
made = [kernel_of(Paper, s, PAPER_NETWORK, EPUCK).py_func.__qualname__ for s in ("none", "lateness", "novelty")]
print(json.dumps(made))
"""


def test_names_are_the_same_in_every_process(tmp_path):
    one, other = in_processes(NAMES, ["", ""], tmp_path)
    assert one == other
    assert one[0] == name_of(Paper)


TOYS = """
import json, sys
import numpy as np
from epuckhebb.sim.compiled import compiled, kernel

def part(factor):
    @compiled
    def inner(x):
        for k in range(x.shape[0]):
            x[k] = x[k] * factor + k
    return inner

def twice(first, second):
    @compiled
    def inner(x):
        first(x)
        second(x)
    return inner

work = None

def toy(x):
    work(x)
    work(x)

told = {}
for factor in map(float, sys.argv[1:]):
    made = kernel(toy, work=twice(part(factor), part(factor + 1)))
    x = np.arange(5.0)
    made(x)
    told[factor] = [x.tolist(), sum(made.stats.cache_hits.values())]
print(json.dumps(told))
"""


@pytest.mark.thorough
def test_a_kernel_that_is_there_is_loaded_without_the_compiler(tmp_path):
    look = "print('numba.np.linalg' in sys.modules)"
    script = f"import sys; from epuckhebb.sim.block import load_kernel; load_kernel(); {look}"
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    told = [
        subprocess.run([sys.executable, "-c", script], env=environment, capture_output=True, text=True, check=True)
        for _ in range(2)
    ]
    assert [process.stdout.strip() for process in told] == ["True", "False"]


@pytest.mark.thorough
def test_kernels_that_two_processes_compiled_live_side_by_side_in_a_third(tmp_path):
    one, two, both, backwards = in_processes(TOYS, ["2", "3", "2 3", "3 2"], tmp_path)
    alone = {**one, **two}
    for told in (both, backwards):
        assert {factor: result for factor, (result, _) in told.items()} == {f: r for f, (r, _) in alone.items()}
        assert all(hits == 1 for _, hits in told.values())
    assert alone["2.0"][0] != alone["3.0"][0]


LIVES = """
import json, sys
import numpy as np
from epuckhebb.sim import lifetime
from epuckhebb.sim.block import Individual, live_block
from epuckhebb.sim.controller import Controller
from epuckhebb.sim.plasticity.oja import Oja
from epuckhebb.sim.plasticity.paper import Paper
from epuckhebb.sim.scenario import Scenario

genes, told = np.random.default_rng(1).uniform(-1, 1, 234), {}
for name in sys.argv[1:]:
    controller = Controller(name=name, rule={"paper": Paper, "oja": Oja}[name](N=0.01))
    who = Individual(genes=genes, side="left", key=np.uint64(2), controller=controller)
    outcome = live_block([who], Scenario(obstacles=4), lifetime.Lifetime(duration_s=30, gain_rad_s=4))[0][0]
    told[name] = [float(x).hex() for x in outcome]
hits = sum(sum(made.stats.cache_hits.values()) for made in lifetime._kernels.values())
print(json.dumps([told, hits]))
"""


@pytest.mark.slow
def test_lives_whose_kernels_two_processes_compiled_have_the_same_bits_in_a_third(tmp_path):
    (one, _), (two, _), (both, hits), (other, _) = in_processes(
        LIVES, ["paper", "oja", "oja paper", "paper oja"], tmp_path
    )
    assert both == other == {**one, **two}
    assert hits == 2


def double(x):
    return 2.0 * x


def doubled():
    """Whether 2 * 4 came out of machine code that was on disk."""
    made = kernel(double)
    assert made(4.0) == 8.0
    return sum(made.stats.cache_hits.values()) == 1


@pytest.mark.parametrize("kind", ["nbi", "nbc"])
def test_damaged_machine_code_is_not_run_and_is_made_anew(monkeypatch, tmp_path, kind):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    assert [doubled(), doubled()] == [False, True]
    (file,) = tmp_path.rglob(f"*.{kind}")
    whole = file.read_bytes()
    flipped = bytes([*whole[:-100], whole[-100] ^ 4, *whole[-99:]])
    for damaged in (flipped, whole[: len(whole) // 2], b"", b"null"):
        file.write_bytes(damaged)
        assert [doubled(), doubled()] == [False, True]


def test_machine_code_of_a_module_that_is_gone_is_as_if_it_were_not_there(monkeypatch, tmp_path):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    made = kernel(double)

    def gone(*_):
        raise ModuleNotFoundError("No module named 'gone'")

    monkeypatch.setattr(made._cache._impl, "rebuild", gone)
    assert not doubled()
    assert made(4.0) == 8.0


def test_without_a_place_for_the_cache_a_kernel_is_compiled_in_memory(monkeypatch, tmp_path):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "file" / "cache"))
    assert [doubled(), doubled()] == [False, False]


def test_a_full_disk_below_the_cache_does_no_harm(monkeypatch, tmp_path, small_files):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    with small_files() as limit:
        limit(2000)
        assert [doubled(), doubled()] == [False, False]
    assert not list(tmp_path.rglob("*.tmp.*"))
    assert [doubled(), doubled()] == [False, True]


def test_a_cache_that_vanishes_does_no_harm(monkeypatch, tmp_path):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "cache"))
    made = kernel(double)
    shutil.rmtree(tmp_path / "cache")
    (tmp_path / "cache").write_text("a file by now")
    assert made(4.0) == 8.0


def test_a_cache_that_may_only_be_read_by_now_is_not_used(monkeypatch, tmp_path):
    def read_only(*_, **__):
        raise PermissionError("Read-only file system")

    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(tempfile, "TemporaryFile", read_only)
    assert not doubled()
    assert not list(tmp_path.rglob("*.nb?"))
