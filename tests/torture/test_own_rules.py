"""Rules of a user's that import files beside them, which change, go and move between runs, under all sorts of names."""

import importlib
import random
import shutil
import sys
from pathlib import Path

import pandas as pd
import pytest
from contract import type_in

from epuckhebb.config import plugins

pytestmark = [pytest.mark.torture, pytest.mark.usefixtures("here")]

SHORT = ["lifetime.duration_s=1", "lifetime.record_every=0", "repeats=1", "threads=1", "-q"]
STANDARD = ["profile", "graphlib", "wave", "sched", "chunk", "this", "turtle", "stringprep", "sndhdr", "nntplib"]
BESIDE = "import sys\nfrom pathlib import Path\nsys.path.insert(0, str(Path(__file__).parent))\n"
RULE = """{beside}{imports}
from dataclasses import dataclass
from epuckhebb import Rule
{more}

@dataclass(frozen=True, kw_only=True)
class Mine(Rule):
    @staticmethod
    def synapse(pre, post, weight):
        return pre * post - {value} * weight
"""
COMPILED = "import numba, numba.extending\n@numba.{how}\ndef f(x):\n    return x * {{number}}\n"
HOW = {"njit": "njit", "vectorize": "vectorize(['f8(f8)'])", "cfunc": "cfunc('f8(f8)')"}
HOW["jitable"] = "extending.register_jitable"
KINDS = {  # how a helper gives its number: its own text, and how the rule says it
    "constant": ("VALUE = {number}\n", "VALUE"),
    **{kind: (COMPILED.format(how=how), "f(1.0)") for kind, how in HOW.items()},
    "data": ("from pathlib import Path\nVALUE = float(Path(__file__).with_name('number.txt').read_text())\n", "VALUE"),
}


@pytest.fixture(autouse=True)
def as_in_new_processes(monkeypatch):
    """Bytecode is told by its second and size, in which a test writes a file twice."""
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    monkeypatch.setattr(sys, "path", list(sys.path))
    yield
    forget()


def forget():
    """Forget the modules of users, as a new process would not have them."""
    for package in list(plugins._packages):
        plugins._unload(package)
    plugins._loaded.clear()
    for name, module in list(sys.modules.items()):
        if "/pytest-of-" in (getattr(module, "__file__", None) or ""):
            del sys.modules[name]
    sys.path[:] = [place for place in sys.path if "/pytest-of-" not in place]
    importlib.invalidate_caches()


def type_anew(*words):
    forget()
    return type_in(*words, seconds=120)


class User:
    """A folder with a rule, its helper, perhaps a helper of that, and perhaps data that they read."""

    def __init__(self, folder, chance, kind=None):
        self.folder, self.chance = folder, chance
        self.kind = kind or chance.choice(list(KINDS))
        free = [name for name in STANDARD if name not in sys.modules]  # else Python itself takes its own
        self.helper = chance.choice(["helper", "tools", *free])
        self.deep = chance.random() < 0.5  # whether the helper has it from a helper of its own, in a package or not
        self.inner = chance.choice(["inner", "kit.inner"])
        self.rule = chance.choice(["my.py", "my.py", "helper_of.py", "rule.py"])
        self.number = chance.choice([0.1, 0.25, 0.5])
        self.write()

    def write(self, inline=False):
        """Write all files; inline: the rule alone, to the same effect."""
        shutil.rmtree(self.folder, ignore_errors=True)
        self.folder.mkdir(parents=True)
        text, value = KINDS[self.kind]
        text, name = text.format(number=self.number), value.partition("(")[0]
        if inline:
            plain = self.kind in ("constant", "data")
            value, text = (str(self.number), "") if plain else (value, text)
            files = {self.rule: RULE.format(beside="", imports="", more=text, value=value)}
        else:
            imports = f"from {self.helper} import {name}"
            files = {self.rule: RULE.format(beside=BESIDE, imports=imports, more="", value=value)}
            where = f"{self.inner.replace('.', '/')}.py" if self.deep else f"{self.helper}.py"
            if self.deep:
                files |= {f"{self.helper}.py": f"from {self.inner} import {name}\n", "kit/__init__.py": ""}
            files |= {where: text, f"{Path(where).parent}/number.txt": str(self.number)}
        for name, content in files.items():
            (self.folder / name).parent.mkdir(exist_ok=True)
            (self.folder / name).write_text(content)

    @property
    def named(self):
        return f"{self.folder}/{self.rule}:Mine"


def lives(run):
    """The lifetimes with the rule, as numbers."""
    metrics = pd.read_csv(run / "metrics.csv")
    return metrics[metrics.controller != "GA"].drop(columns=["controller"])


@pytest.mark.parametrize("kind", KINDS)
def test_a_helper_that_has_changed_counts_and_a_run_can_be_repeated_without_it(kind, chance, tmp_path):
    user, alone = (User(tmp_path / f"user_of_rules_{name}", random.Random(chance.random()), kind) for name in "ab")
    changed = [user.number, next(number for number in (0.1, 0.25, 0.5) if number != user.number)]
    for number in changed:
        user.number = alone.number = number
        user.write()
        alone.write(inline=True)
        results = {}
        for name, own in (("helped", user), ("alone", alone)):
            run = Path(f"{name}_{number}")
            result = type_anew(
                "evaluate", f"hebbian.rule={own.named}", "hebbian.N=0.01", *SHORT, f"hydra.run.dir={run}"
            )
            if result.exit_code and own is user and kind in ("vectorize", "cfunc", "data"):
                assert f"{user.helper}" in result.stderr or user.rule in result.stderr or user.inner in result.stderr
                return  # refused in words: what cannot be hashed is not to be believed
            assert result.exit_code == 0, result.output
            results[name] = lives(run)
        pd.testing.assert_frame_equal(results["helped"], results["alone"])
    first = Path(f"helped_{changed[0]}")
    how = chance.choice(["changed", "removed", "renamed"])
    if how == "removed":
        shutil.rmtree(user.folder)
    elif how == "renamed":
        user.folder.rename(tmp_path / "elsewhere")
    if kind != "data":
        result = type_anew("rerun", first, "-q")
        assert result.exit_code == 0, f"{how}: {result.output}"
