"""A user's own Python files: which they are, that they do not get in each other's way, and that copies will do."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from cases import done, refused

from epuckhebb import Rule
from epuckhebb.config import plugins
from epuckhebb.config.compose import composed
from epuckhebb.config.schema import plain
from epuckhebb.runtime.errors import ConfigError
from epuckhebb.studies.identity import Identities

RULE = '''\
"""Oja's rule, whose decay is that of a file beside it."""

from dataclasses import dataclass

from epuckhebb import Rule
from helper import DECAY


@dataclass(frozen=True, kw_only=True)
class oja(Rule):
    decay: float = DECAY

    @staticmethod
    def synapse(correlation, post, weight, by):
        return correlation - by.decay * post * post * weight
'''


def write(folder, texts):
    """Files in a folder, by their names without .py."""
    for name, text in texts.items():
        file = Path(folder, f"{name}.py")
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)


def loaded(file):
    return plugins.load(Path(file), str(file))


def test_helpers_of_one_name_are_kept_apart(tmp_path):
    write(tmp_path, {"a/my": RULE, "a/helper": "DECAY = 1.0\n", "b/my": RULE, "b/helper": "DECAY = 2.0\n"})
    decays = [plugins.class_named(f"{tmp_path}/{one}/my.py:oja", Rule, "hebbian.rule").decay for one in ("a", "b", "a")]
    assert decays == [1.0, 2.0, 1.0]
    assert "helper" not in sys.modules


def test_the_same_file_in_two_folders_is_two_modules(tmp_path):
    """It may read what lies beside it."""
    text = "from pathlib import Path\nDECAY = float(Path(__file__).with_name('decay.txt').read_text())\n"
    write(tmp_path, {"a/my": text, "b/my": text})
    for folder, number in (("a", "1"), ("b", "2")):
        (tmp_path / folder / "decay.txt").write_text(number)
    assert [loaded(tmp_path / folder / "my.py").module.DECAY for folder in ("a", "b")] == [1.0, 2.0]


MANY = """\
import profile
import lab.deep
import numpy as np
from pkg import inner
from . import profile as again
assert again is profile
VALUES = profile.ONE, lab.deep.TWO, inner.THREE, np.__name__
def late():
    import helper
    return helper.FOUR
"""


def test_all_files_of_the_users_count_wherever_they_are_found(tmp_path, monkeypatch):
    """Beside the file, even with the name of a module of Python's, and on the path; of installed packages none."""
    write(tmp_path / "here", {"my": MANY, "profile": "ONE = 1\n", "helper": "FOUR = 4\n"})
    write(tmp_path / "here", {"pkg/inner": "from . import deeper\nTHREE = deeper.THREE\n", "pkg/deeper": "THREE = 3\n"})
    write(tmp_path / "lib", {"lab/__init__": "", "lab/deep": "import installed\nTWO = 2\n"})
    write(tmp_path / "target", {"installed": "", "other": ""})
    record = tmp_path / "target" / "installed-1.dist-info" / "RECORD"
    record.parent.mkdir()
    record.write_text("installed.py,sha256=x,0\n")
    for folder in ("lib", "target"):
        monkeypatch.syspath_prepend(tmp_path / folder)
    own = loaded(tmp_path / "here" / "my.py")
    assert own.module.VALUES == (1, 2, 3, "numpy")
    places = ["lab/__init__.py", "lab/deep.py", "my.py", "pkg/deeper.py", "pkg/inner.py", "profile.py"]
    assert sorted(own.sources) == places
    assert own.module.late() == 4
    assert sorted(own.sources) == sorted([*places, "helper.py"])
    for place, content in own.copies.items():
        (tmp_path / place).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / place).write_bytes(content)
    before, copy = own.digest, own.copy
    for folder in ("here", "lib"):
        shutil.rmtree(tmp_path / folder)
    again = loaded(tmp_path / copy)
    assert again.module.VALUES == (1, 2, 3, "numpy")
    assert again.module.late() == 4
    assert (again.digest, again.copy) == (before, copy)


def test_an_identity_changes_with_a_file_that_a_rule_imports(tmp_path):
    write(tmp_path, {"my": RULE, "helper": "DECAY = 1.0\n"})
    config = plain(composed("evaluate", [f"hebbian.rule={tmp_path}/my.py:oja", "hebbian.decay=1"]))
    before, files = Identities().of(config), plugins.own_sources(config)
    assert sorted(files) == [f"{tmp_path}/helper.py", f"{tmp_path}/my.py"]
    assert Identities().of(config) == before
    write(tmp_path, {"helper": "DECAY = 3.0\n"})  # as long as before, and within the same second
    assert Identities().of(config) != before
    assert plugins.class_named(f"{tmp_path}/my.py:oja", Rule, "hebbian.rule").decay == 3.0


@pytest.mark.parametrize("helper", ["DECAY = = 1\n", "import nowhere\n"])
def test_a_mistake_in_a_helper_is_told_with_its_place(tmp_path, helper):
    write(tmp_path, {"my": RULE, "helper": f"# a helper\n{helper}"})
    with pytest.raises(ConfigError, match=r"helper\.py, line 2, cannot be imported: (Syntax|ModuleNotFound)Error"):
        loaded(tmp_path / "my.py")
    write(tmp_path, {"helper": "DECAY = 1.0\n"})
    assert loaded(tmp_path / "my.py").module.DECAY == 1.0


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
    assert "Left out, as one controller is taken of a run: a, b" in done("export", "run", "--webots", "-o", "c").stdout
    assert "bit-identical" in done("rerun", "run").stdout
    assert not Path("done").exists()


@pytest.mark.usefixtures("here")
def test_a_rule_of_ones_own_is_not_exported():
    write("", {"my": RULE, "helper": "DECAY = 1.0\n"})
    words = ["hebbian.rule=my.py:oja", "hebbian.N=0.0001", "lifetime.duration_s=2", "lifetime.record_every=0"]
    done("evaluate", *words, "repeats=1", "hydra.run.dir=run")
    write("", {"my": "open('done', 'w').close()\n"})
    assert "controller oja cannot be taken to Webots" in refused("export", "run", "--webots", "-o", "c")
    assert not Path("done").exists()


@pytest.mark.thorough
def test_a_kernel_with_a_helper_comes_from_disk_in_another_folder(tmp_path):
    """numba names the modules of functions that are not inlined; nothing of them is needed."""
    rule = RULE.replace("import DECAY", "import DECAY, grow").replace("return corr", "return grow(corr") + ")\n"
    rule = rule.replace("weight\n)", "weight)")
    helper = "import numba\nDECAY = 1.0\n@numba.njit\ndef grow(x):\n    return 1.5 * x\n"
    write(tmp_path, {"a/my": rule, "a/helper": helper, "b/my": rule, "b/helper": helper})
    code = (
        "import sys; from pathlib import Path; from epuckhebb import Rule; from epuckhebb.config import plugins;"
        "from epuckhebb.tmaze import lifetime_kernel; from epuckhebb.tmaze.batch import load_kernel;"
        "from epuckhebb.adaptation.controller import Controller;"
        "load_kernel(Controller(rule=plugins.class_named(sys.argv[1] + ':oja', Rule, 'x')(N=1.0)));"
        "print([sum(made.stats.cache_hits.values()) for made in lifetime_kernel._kernels.values()])"
    )
    said = [
        subprocess.run(
            [sys.executable, "-c", code, str(tmp_path / folder / "my.py")],
            env={"NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PATH": ""},
            capture_output=True,
            text=True,
            check=True,
        ).stdout.strip()
        for folder in ("a", "b")
    ]
    assert said == ["[0]", "[1]"]
