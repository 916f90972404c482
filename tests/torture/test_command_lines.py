"""500 command lines, good, bad and hostile: each ends with an exit code of ours, in words, and writes where it may."""

import os
import random
import shutil
from pathlib import Path

import numpy as np
import pytest
import yaml
from cases import call, contents, done
from omegaconf import OmegaConf

import epuckhebb
from epuckhebb.config.compose import composed
from epuckhebb.runtime.conf import command_file, flat, groups
from epuckhebb.runtime.errors import INTERRUPTED, JOB_FAILED, USAGE
from epuckhebb.store.run import Run

LINES = 500
SHORT = ["lifetime.duration_s=0.064", "lifetime.record_every=0"]
BRIEF = {  # what makes a command line cheap, if nothing in it says otherwise
    "evaluate": [*SHORT, "repeats=1"],
    "evolve": ["lifetime.duration_s=0.064", "ga.population=2", "ga.elites=1", "ga.generations=1", "ga.loops=1"],
    "sweep": [*SHORT, "repeats=1", "scenario=base", "hydra/launcher=basic"],
    "reproduce": ["champions=1", "repeats=1", "rates=[0.002]", "genome=nowhere.npz"],
}
FLAGS = {
    "evaluate": ["-m", "--multirun", "--json", "-q", "--cfg=job", "--config-dir=own", "--config-dir=nowhere"],
    "evolve": ["-m", "--json", "-q", "--cfg=hydra", "--config-dir=own"],
    "sweep": ["--dry-run", "--json", "-q", "--config-dir=own"],
    "reproduce": ["--quick", "--json", "-q"],
    "replay": ["--output=page.html", "--gif=a.gif", "--output=nowhere/b.html"],
    "show": ["--json"],
    "rerun": ["--json", "-q"],
}
NAMES = ["[/x]", "$\\foo$", "<script>alert(1)</script>", "a|b", "`x`", "'; rm -rf .", "é漢\u202e", "a\nb", "x" * 300]
HUGE = ["1000000000", "9" * 30]
ENDLESS = ["ga.generations", "lifetime.duration_s"]  # what may last for ever, because somebody may want it to
NUMBERS = [*HUGE, "0", "-1", "1e-5", "1e300", "-inf", "nan", "inf", "0.1", "3", "1_0", "0x10"]
HOSTILE = [
    *("", "null", "true", "''", '""', "[]", "{}", "[1,2", "{a: 1", "${seed}", "${x}", "${oc.env:HOME}", "@", "a@b"),
    *("~", "~nosuchuser/x", "~/x", "..", "/", "/dev/null", "/proc/self/mem", "own", "own/text.npz", "own/\x01x", "???"),
    *("a,b", "1,2", "range(1,3)", "range(1,1000000000)", "choice(1,2)", "glob(*)", "interval(0,1)", "sort(3,1)", "a=b"),
    *("_target_", "{_target_: os.system}", "[[[[1]]]]", "\\", "'\\'", "\udcff", "\x1b[2J", "!!python/x"),
]
STRUCTURES = {
    "scenario.changes": ["[{at_s: 0.03, light: 1}]", "[{at_s: 0.03}]", "[1]", "[{at_s: x, light: y}]", "{a: b}"],
    "scenario.goals": ["{left: [0, 0]}", "{left: [nan, 0]}", "{up: [0, 0]}", "[0, 0]"],
    "scenario.lamp": ["{x_m: 1}", "5"],
    "network.layers": ["[16,2]", "[16,100000,2]", "[16,7,5,8,4,2]", "[0,2]", "[-1]", "[16,a,2]"],
    "compare": ["{a: {N: 0.002}}", "{GA: {N: 1}}", "{a: 5}", "{a: {adaptation: late}}", "{'[/x]': {sign: anti}}"],
    "genome": ["reference", "reference_7", "reference_99999", "evolved", "own/zeros.npy", "own/short.npy"],
    "hebbian.rule": ["paper", "oja", "bcm", "own/rule.py:Rule", "own/text.npz:X", "~nosuchuser/r.py:X", ":"],
    "maze.arena_m": ["10", "1e9", "0.5"],
    "maze.walls": ["{}", "{a: {x: 0, y: 0, width: 1, height: 1}}"],
    "rates": ["[]", "[0]", "[nan]", "[1e300]", "[a]"],
    "resume": ["evolved", "evaluated", "nowhere", ""],
    "experiment": ["light", "n_sweep", "nope"],
    "hydra.run.dir": ["out", "", "own", "../outside", "evaluated", "'a b'", "out/${seed}"],
    "hydra.sweep.dir": ["out", "", "own", "evaluated"],
    "hydra/launcher": ["basic", "nope", "submitit"],
}
UNKNOWN = ["hebian.N", "light", "scenario.ligth", "hydra.job.name", "job", "x", "scenario@maze", "_target_", "a.b.c.d"]


def command_line(rng):
    """A command line: words that a user may type, and many that only a slip or malice would."""
    command = rng.choices([*FLAGS, "nope", ""], [*(6 if command in BRIEF else 2 for command in FLAGS), 1, 1])[0]
    good = rng.random() < 0.4
    words = [flag for flag in FLAGS.get(command, ["--help"]) if rng.random() < (0.04 if good else 0.12)]
    if command in ("show", "replay", "rerun"):
        places = ["evaluated", "evolved"] if good else ["evaluated", "evolved", "own", "nowhere", *HOSTILE]
        words += rng.choices(places, k=1 if good else rng.choice([1, 1, 1, 2]))
    elif command in BRIEF:
        some = good_setting if good else setting
        words += [some(command, rng) for _ in range(rng.choice([1, 1, 1, 2, 3]))]
        if command == "sweep":
            words.insert(0, rng.choice(["obstacles", "light", "n_sweep", *([] if good else ["nope", "../light", ""])]))
        elif command == "reproduce" and rng.random() < 0.5:
            words.insert(0, rng.choice(["light", "obstacles", "all", "nope", ""]))
        given = {word.lstrip("+~").partition("=")[0] for word in words}
        brief = [word for word in BRIEF[command] if word.partition("=")[0] not in given]
        words += [] if "resume" in given else brief
    return [command, *words]


def keys_with_defaults(command):
    """The keys of a command and their defaults."""
    if command == "reproduce":
        return dict(flat(yaml.safe_load(command_file(command).read_text(encoding="utf-8"))))
    return dict(flat(OmegaConf.to_container(composed("evaluate" if command == "sweep" else command, []))))


def good_setting(command, rng):
    """A choice of a group of a verb, or a key as it is anyway."""
    choices = {group: names for group, names in groups(command).items() if names}
    key = rng.choice([*choices, *choices, *keys_with_defaults(command)])
    return f"{key}={rng.choice(choices[key]) if key in choices else keys_with_defaults(command)[key]}"


def setting(command, rng):
    """An override of a key or a group of a verb, with a value that may be anything."""
    choices = groups(command)
    values = keys_with_defaults(command)
    key = rng.choice([*choices, *values, *values, *STRUCTURES, *UNKNOWN])
    kinds = [NUMBERS, HOSTILE, NAMES, STRUCTURES.get(key, NUMBERS)]
    if key in choices:
        kinds += [choices[key]] * 3
    elif key in values:
        kinds += [[str(values[key])]]
    value = rng.choice(rng.choice(kinds))
    if (key in ENDLESS and value in HUGE) or (command, key) == ("reproduce", "genome"):
        value = "3"
    if rng.random() < 0.25:
        value = rng.choice(["'{}'", '"{}"', "[{}]", "{},{}", "{}\\", "\\{}"]).replace("{}", value)
    prefix = rng.choices(["", "+", "++", "~"], [20, 3, 2, 1])[0]
    return rng.choices([f"{prefix}{key}={value}", f"{prefix}{key}", f"{key} = {value}", value], [40, 2, 1, 1])[0]


@pytest.fixture(scope="module")
def prepared(tmp_path_factory):
    """A folder with runs of ours and files of someone else."""
    folder = tmp_path_factory.mktemp("prepared")
    (folder / "own").mkdir()
    np.save(folder / "own" / "zeros.npy", np.zeros(234))
    np.save(folder / "own" / "short.npy", np.zeros(7))
    (folder / "own" / "text.npz").write_text("dear", encoding="utf-8")
    (folder / "own" / "rule.py").write_text(
        "import epuckhebb\nclass Rule(epuckhebb.Rule):\n    pass\n", encoding="utf-8"
    )
    (folder / "own" / "own.yaml").write_text("a: [", encoding="utf-8")
    before = Path.cwd()
    os.chdir(folder)
    try:
        words = ["lifetime.duration_s=0.064", "-q"]
        done("evaluate", "repeats=1", *words, "hydra.run.dir=evaluated")
        ga = [word for word in BRIEF["evolve"] if word.startswith("ga.")]
        done("evolve", *ga, *words, "hydra.run.dir=evolved")
    finally:
        os.chdir(before)
    return folder


def half_written(folder):
    """Runs that were begun and neither finished nor closed, and files beside their places."""
    states = [Run(status.parent).recorded_status.get("state") for status in folder.rglob("status.json")]
    return [state for state in states if state not in ("finished", "failed")], list(folder.rglob(".*.tmp"))


@pytest.mark.torture
def test_whatever_is_typed_ends_in_words(request, prepared, tmp_path, monkeypatch):
    """Every line is told before it runs (`pytest -s`), so that one that hangs is known."""
    rng = random.Random(request.config.getoption("--torture-seed"))
    monkeypatch.setattr("webbrowser.open", bool)
    epuckhebb.load()
    kept = contents(prepared)
    codes = {}
    for number in range(LINES):
        words = command_line(rng)
        around = tmp_path / str(number)
        folder = around / "here"
        shutil.copytree(prepared, folder)
        monkeypatch.chdir(folder)
        print(number, words, flush=True)
        result = call(*words)
        told = f"--torture-seed: line {number}: {words}\n{result.output}"
        codes[result.exit_code] = codes.get(result.exit_code, 0) + 1
        if result.exit_code not in (0, USAGE):
            print(f"exit code {result.exit_code}: {result.stderr}", flush=True)
        assert isinstance(result.exception, SystemExit | None), f"{told}\n{result.exc_info}"
        assert result.exit_code in (0, JOB_FAILED, USAGE, INTERRUPTED), told
        assert "Traceback" not in result.output, told
        assert result.exit_code == 0 or result.stderr.strip(), told
        assert [path.name for path in around.iterdir() if "../outside" not in " ".join(words)] in ([], ["here"]), told
        after = contents(folder)
        assert all(after.get(name) == content for name, content in kept.items() if name.startswith("own/")), told
        if result.exit_code == USAGE and "-m" not in words and "--multirun" not in words:
            assert half_written(folder) == ([], []), told
            assert after.keys() <= kept.keys(), told
        monkeypatch.chdir(tmp_path)
        shutil.rmtree(around)
    print(codes)
    assert codes[0] > LINES // 10
    assert codes[USAGE] > LINES // 10
