"""How the science is compiled: a kernel's name says what it is made of, and kernels do not get in each other's way."""

import importlib
import json
import os
import shutil
import subprocess
import sys
import tempfile

import pytest

from epuckhebb.adaptation.adaptation import Adaptation
from epuckhebb.config import plugins
from epuckhebb.controller.compiling.kernel import compiled, kernel, move_to_module
from epuckhebb.controller.compiling.sources import OWN_PACKAGE
from epuckhebb.controller.network import PAPER_NETWORK, Network
from epuckhebb.controller.plasticity.rules.oja import Oja
from epuckhebb.controller.plasticity.rules.paper import Paper
from epuckhebb.tmaze.own_fitness import Fitness
from epuckhebb.tmaze.scenario import Scenario
from epuckhebb.tmaze.simulator import lifetime_kernel

FITNESS = """
from dataclasses import dataclass
from enum import Enum
import numpy as np
from epuckhebb import Fitness
from .helper import scale
class Mode(Enum):
    LOW, HIGH, USED = 1.0, 5.0, 1.0
TABLE = np.loadtxt("table.txt", ndmin=1)
@dataclass(frozen=True, kw_only=True)
class Mine(Fitness):
    @staticmethod
    def step(left):
        return Mode.USED.value * scale(left) + TABLE[0]
"""
HELPER = """
from numba.extending import overload
def scale(x):
    return x
@overload(scale)
def _scale(x):
    return lambda x: 2.0 * x
"""


def forget_own_modules():
    for name in [name for name in sys.modules if name.startswith(OWN_PACKAGE)]:
        del sys.modules[name]


def call(x):
    return step(x)  # noqa: F821  # a part


def test_any_edit_of_a_users_files_is_compiled_anew(monkeypatch, here):
    """What numba reads of a file is more than the code of its functions."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(here / "cache"))
    edits = [{}, {"mine.py": ("1.0\nTABLE", "5.0\nTABLE")}, {"helper.py": ("2.0", "7.0")}, {"table.txt": ("0", "100")}]
    files, values = {"mine.py": FITNESS, "helper.py": HELPER, "table.txt": "0"}, []
    for edit in edits:
        files |= {name: files[name].replace(*change) for name, change in edit.items()}
        for name, text in files.items():
            (here / name).write_text(text)
        forget_own_modules()
        mine = plugins.class_named("mine.py:Mine", Fitness, "fitness.function")
        values.append(kernel(call, (mine,), step=compiled(move_to_module(mine.step, __name__)))(3.0))
    assert values == [6.0, 30.0, 105.0, 205.0]


def test_an_edit_of_a_helper_in_another_folder_is_compiled_anew(monkeypatch, here, tmp_path_factory):
    """Machine code that is kept would be that of the helper as it was."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(here / "cache"))
    library = tmp_path_factory.mktemp("library")
    monkeypatch.syspath_prepend(library)
    (here / "table.txt").write_text("0")
    (here / "mine.py").write_text(FITNESS.replace("from .helper", "from helper_elsewhere"))
    values, digests = [], []
    for factor in ("2.0", "17.0"):
        (library / "helper_elsewhere.py").write_text(HELPER.replace("2.0", factor))
        monkeypatch.delitem(sys.modules, "helper_elsewhere", raising=False)
        forget_own_modules()
        importlib.invalidate_caches()
        mine = plugins.class_named("mine.py:Mine", Fitness, "fitness.function")
        values.append(kernel(call, (mine,), step=compiled(move_to_module(mine.step, __name__)))(3.0))
        digests.append(plugins.user_sources({"function": "mine.py:Mine"}))
    assert values == [6.0, 51.0]
    assert [len(known) for known in digests] == [2, 2]
    assert digests[0] != digests[1]


def test_a_class_that_is_from_no_file_of_the_users_is_compiled_in_memory(monkeypatch, tmp_path):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))

    class Mine(Fitness):
        pass

    assert kernel(double, (Mine,))(4.0) == 8.0
    assert not list(tmp_path.iterdir())


def name_of(rule, network=PAPER_NETWORK):
    return lifetime_kernel(rule, Adaptation(), network, Scenario()).py_func.__qualname__


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
from epuckhebb.adaptation.adaptation import Adaptation
from epuckhebb.tmaze.simulator import lifetime_kernel
from epuckhebb.controller.network import PAPER_NETWORK
from epuckhebb.controller.plasticity.rules.paper import Paper
from epuckhebb.tmaze.scenario import Scenario
kinds = [Adaptation(change_signal=s) for s in ("none", "late", "novelty")]
made = [lifetime_kernel(Paper, kind, PAPER_NETWORK, Scenario()).py_func.__qualname__ for kind in kinds]
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
    made = kernel(toy, (factor,), work=twice(part(factor), part(factor + 1)))
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
    made = kernel(double, ())
    assert made(4.0) == 8.0
    return sum(made.stats.cache_hits.values()) == 1


@pytest.mark.parametrize("kind", ["nbi", "nbc"])
def test_a_damaged_cache_is_made_anew(monkeypatch, tmp_path, kind):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    assert [doubled(), doubled()] == [False, True]
    (file,) = tmp_path.rglob(f"*.{kind}")
    for damaged in (file.read_bytes()[:-100], b"", b"null"):
        file.write_bytes(damaged)
        assert [doubled(), doubled()] == [False, True]


def test_machine_code_of_a_module_that_is_gone_is_as_if_it_were_not_there(monkeypatch, tmp_path):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    made = kernel(double, ())

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
    made = kernel(double, ())
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
