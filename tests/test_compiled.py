"""How the science is compiled: a kernel's name says what it is made of, and kernels do not get in each other's way."""

import ctypes
import importlib.util
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

from epuckhebb.adaptation.adaptation import Parts
from epuckhebb.controller.compiling.code_digest import UnknownPartError, digest
from epuckhebb.controller.compiling.kernel import compiled, kernel
from epuckhebb.controller.network import PAPER_NETWORK, Network
from epuckhebb.controller.plasticity import update
from epuckhebb.controller.plasticity.rules.oja import Oja
from epuckhebb.controller.plasticity.rules.paper import Paper
from epuckhebb.tmaze import lifetime_kernel
from epuckhebb.tmaze.lifetime_kernel import kernel_of
from epuckhebb.tmaze.robot import EPUCK

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


def scaled(number):
    return lambda x: number * x


@pytest.mark.parametrize(
    "made",
    [
        lambda number: numba.njit(scaled(number)),
        lambda number: numba.njit("f8(f8)" if number == 2 else "f4(f4)")(scaled(1)),
        lambda number: numba.njit(locals={"x": numba.float64 if number == 2 else numba.float32})(scaled(1)),
    ],
    ids=["njit", "signature", "locals"],
)
def test_what_numba_compiles_for_an_object_matters(made):
    names = [digest(calls(helper, helper, helper)) for helper in (made(2), made(2), made(3))]
    assert names[0] == names[1] != names[2]


def uses(helpers):
    return lambda x: helpers.scale(x) + 1.0


def test_a_helper_is_read_whatever_its_module_is_called(tmp_path, monkeypatch):
    """Python has a module `profile`, too."""
    names = []
    for number in (2.0, 3.0):
        file = tmp_path / str(number) / "profile.py"
        file.parent.mkdir()
        file.write_text(f"def scale(x):\n    return {number} * x\n")
        spec = importlib.util.spec_from_file_location("profile", file)
        profile = importlib.util.module_from_spec(spec)
        monkeypatch.setitem(sys.modules, "profile", profile)
        spec.loader.exec_module(profile)
        names.append((digest(profile.scale), digest(uses(profile))))
    for one, other in zip(*names, strict=True):
        assert one != other


def whole(x):
    return part(x)  # noqa: F821  # it is put in


def test_what_cannot_be_read_is_compiled_in_memory(monkeypatch, tmp_path):
    """The address of a function of C says nothing of what it does."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    libc = ctypes.CDLL(None)
    libc.abs.argtypes, libc.abs.restype = [ctypes.c_int], ctypes.c_int
    absolute = libc.abs
    vectorized = numba.vectorize(scaled(2.0))
    costly = numba.njit(inline=lambda *_: False)(scaled(2.0))
    for part in (absolute, vectorized, costly, object(), types.ModuleType("helpers")):
        with pytest.raises(UnknownPartError):
            digest(calls(part, part, part))
    assert kernel(whole, part=absolute)(-3) == 3
    assert not list(tmp_path.iterdir())


def name_of(rule, network=PAPER_NETWORK):
    return kernel_of(rule, Parts(), network, EPUCK).py_func.__qualname__


def test_a_script_that_changes_an_equation_gets_a_kernel_of_its_own(monkeypatch):
    before = name_of(Paper)
    monkeypatch.setattr(lifetime_kernel, "_kernels", {})
    assert name_of(Paper) == before

    def soft(weight, rate, direction, w_max):
        return w_max * np.tanh((weight + rate * direction) / w_max)

    monkeypatch.setattr(lifetime_kernel, "_kernels", {})
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
from epuckhebb.adaptation.adaptation import Parts
from epuckhebb.tmaze.lifetime_kernel import kernel_of
from epuckhebb.controller.network import PAPER_NETWORK
from epuckhebb.controller.plasticity.rules.paper import Paper
from epuckhebb.tmaze.robot import EPUCK
made = [kernel_of(Paper, Parts(s), PAPER_NETWORK, EPUCK).py_func.__qualname__ for s in ("none", "late", "novelty")]
print(json.dumps(made))
"""


def test_names_are_the_same_in_every_process(tmp_path):
    one, other = in_processes(NAMES, ["", ""], tmp_path)
    assert one == other
    assert one[0] == name_of(Paper)


TOYS = """
import json, sys
import numpy as np
from epuckhebb.controller.compiling.kernel import compiled, kernel

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
    script = f"import sys; from epuckhebb.tmaze.batch import load_kernel; load_kernel(); {look}"
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
