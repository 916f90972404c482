"""Each verb as a user calls it, and each mistake a user can make."""

import gc
import json
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from cases import first_of
from typer.testing import CliRunner

from epuckhebb.app import progress
from epuckhebb.app.cli import app
from epuckhebb.study.evaluate import COLUMNS

FAST = ["lifetime.duration_s=8", "lifetime.record_every=0", "repeats=2"]
TINY = ["ga.population=6", "ga.generations=3", "ga.elites=2", "ga.loops=1", "lifetime.duration_s=3"]


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def call(*words):
    return CliRunner().invoke(app, list(words))


def only_run(folder):
    runs = list(folder.iterdir())
    assert len(runs) == 1
    return runs[0]


def test_evaluate_leaves_a_whole_run(here):
    result = call("evaluate", "scenario=4obstacles", *FAST, "lifetime.record_every=8")
    assert result.exit_code == 0, result.output
    assert "Time-to-Goal" in result.stdout
    run = only_run(here / "runs" / "evaluate")
    assert run.name.endswith("_4obstacles+lifetime.duration_s-8_seed1")
    files = {str(file.relative_to(run)) for file in run.rglob("*") if file.is_file()}
    assert files == {
        ".hydra/config.yaml",
        ".hydra/overrides.yaml",
        "provenance.json",
        "status.json",
        "metrics.csv",
        "table.csv",
        "table.md",
        "traces.npz",
        "figures/trajectories.png",
    }
    assert tuple(pd.read_csv(run / "metrics.csv").columns) == COLUMNS
    assert json.loads((run / "status.json").read_text())["state"] == "finished"


def test_the_same_command_twice_and_on_other_threads_gives_the_same_bytes(here):
    for threads in (1, 1, 2):
        assert call("evaluate", *FAST, f"threads={threads}", "-q").stdout == ""
    written = {run.joinpath("metrics.csv").read_bytes() for run in (here / "runs" / "evaluate").iterdir()}
    assert len(list((here / "runs" / "evaluate").iterdir())) == 3
    assert len(written) == 1


def test_evolve_then_evaluate_its_champion(here):
    assert call("evolve", *TINY, "seed=7").exit_code == 0
    run = only_run(here / "runs" / "evolve")
    assert len(pd.read_csv(run / "history.csv")) == 3
    result = call("evaluate", f"genome={run}", "scenario=2obstacles", *FAST, "--json")
    told = json.loads(result.stdout)["runs"][0]
    assert told["genome"] == run.name
    assert len(told["metrics"]) == 8


def test_show_tells_of_both_kinds(here):
    call("evolve", *TINY)
    call("evaluate", *FAST)
    for verb, word in (("evolve", "3 generations"), ("evaluate", "Weight Change Mean")):
        result = call("show", str(only_run(here / "runs" / verb)))
        assert result.exit_code == 0
        assert word in result.stdout
        assert "finished" in result.stdout


@pytest.mark.parametrize("launcher", first_of(["basic", "joblib"]))
def test_multirun_sweeps(here, launcher):
    words = ["-m", "hebbian.N=0,0.002", "scenario=base,4obstacles", f"hydra/launcher={launcher}", "seed=3"]
    result = call("evaluate", *words, *FAST)
    assert result.exit_code == 0, result.output
    runs = sorted(only_run(here / "runs" / "evaluate").glob("*/metrics.csv"))
    assert len(runs) == 4
    rows = pd.concat([pd.read_csv(run) for run in runs])
    assert set(rows[rows.controller == "Hebbian"].groupby(["N", "scenario"]).size()) == {4}
    ga = rows[rows.controller == "GA"].drop_duplicates()
    assert len(ga) == 8  # the control is the same whatever N is


@pytest.mark.parametrize("word", ["adaptation=late", "repeats=5", "compare=[late]"])
def test_a_key_of_another_verb_is_told_with_what_to_type(word):
    result = CliRunner().invoke(app, ["evolve", word])
    assert result.exit_code == 2
    key = word.partition("=")[0]
    assert f"give it there: epuckhebb evaluate genome=latest {key}=" in " ".join(result.stderr.split()) or (
        key == "repeats" and "`epuckhebb evaluate` and `epuckhebb reproduce`" in result.stderr
    )
    assert "To append" not in result.stderr


def test_without_plasticity_there_is_the_ga_alone(here):
    call("evaluate", "hebbian=none", *FAST)
    rows = pd.read_csv(only_run(here / "runs" / "evaluate") / "metrics.csv")
    assert set(rows.controller) == {"GA"}


def test_cfg_shows_and_runs_nothing(here):
    result = call("evaluate", "--cfg", "job", "scenario=lowlight")
    assert result.exit_code == 0
    assert "light: 0.1" in result.stdout
    assert list(here.iterdir()) == []


BAD = {
    "unknown key": (["scenrio=base"], ["scenrio", "Did you mean: scenario"]),
    "unknown choice": (
        ["scenario=5obstacles"],
        ["5obstacles", "for example 2obstacles, 4o", "mean: 4obstacles, 2obstacles"],
    ),
    "wrong type": (["hebbian.N=fast"], ["hebbian.N", "fast"]),
    "negative rate": (["hebbian.N=-1"], ["hebbian.N must be 0 or more", "-1"]),
    "three obstacles": (["scenario.obstacles=3"], ["scenario.obstacles must be one of 0, 2, 4", "3"]),
    "light nan": (["scenario.light=nan"], ["scenario.light must", "nan"]),
    "no repeats": (["repeats=0"], ["repeats must be 1 or more", "0"]),
    "negative seed": (["seed=-1"], ["seed must be 0 or more"]),
    "no seed": (["seed=null"], ["seed must have a value, got null"]),
    "a word for a number": (["scenario.light=bright"], ["scenario.light must be a number, got bright"]),
    "half an obstacle": (["scenario.obstacles=2.5"], ["scenario.obstacles must be a whole number, got 2.5"]),
    "a key that is none": (["scenaro=lowlight"], ["there is no key scenaro", "Did you mean: scenario"]),
    "a scenario that is none": (["scenario=lowligth"], ["there is no scenario=lowligth\nDid you mean: lowlight?\n"]),
    "unknown signal": (["hebbian.signal=joy"], ["joy", "behaviour", "light_code"]),
    "missing genome": (["genome=nowhere.npz"], ["genome=nowhere.npz does not exist", "reference"]),
    "227 genes": (["genome=short.npy"], ["234", "227"]),
    "nan gene": (["genome=nan.npy"], ["finite", "1 "]),
    "not an array": (["genome=text.npz"], ["text.npz", "cannot be read"]),
    "fewer numbers than its layers say": (["genome=layers.npz"], ["layers.npz must hold 152 numbers", "(234,)"]),
    "other layers": (["genome=reference", "network.layers=[16,4,2]"], ["[16, 7, 5, 8, 4, 2]", "[16, 4, 2]"]),
    "folder without champion": (["genome=empty"], ["genome=empty", "champion.npz"]),
    "sweep without -m": (["hebbian.N=0,0.002", "scenario=base,4obstacles"], ["--multirun"]),
    "grammar": (["hebbian.N"], ["hebbian.N", "KEY=VALUE"]),
    "bad value in a sweep": (["-m", "hebbian.N=0,-1"], ["hebbian.N must be 0 or more", "-1"]),
    "bad choice in a sweep": (["-m", "scenario=base,nope"], ["nope", "4obstacles"]),
    "missing launcher": (["-m", "hydra/launcher=ray", "seed=1,2"], ["epuckhebb[ray]"]),
    "a sweep as one job": (["experiment=n_sweep"], ["epuckhebb sweep n_sweep", "--multirun"]),
    "many jobs to show": (["-m", "--cfg", "job", "seed=1,2"], ["--cfg", "--multirun"]),
    "missing plug-in of ours": (["-m", "hydra/launcher=ray_local", "seed=1,2"], ["epuckhebb[ray]"]),
    "unknown option": (["--bogus"], ["--bogus"]),
    "unknown part of the configuration": (["--cfg", "everything"], ["everything", "job"]),
}


@pytest.mark.parametrize("mistake", BAD)
def test_a_mistake_gets_one_message_and_leaves_nothing(here, mistake):
    words, expected = BAD[mistake]
    np.save("short.npy", np.zeros(227))
    np.save("nan.npy", np.where(np.arange(234) == 5, np.nan, 0.0))
    Path("text.npz").write_text("not a genome")
    np.savez("layers.npz", genome=np.zeros(234), layers=[16, 8, 2])
    Path("empty").mkdir()
    before = sorted(here.rglob("*"))
    result = call("evaluate", *words)
    assert result.exit_code == 2, result.output
    for text in expected:
        assert text in result.stderr
    assert "Traceback" not in result.output
    assert result.stdout == ""
    assert sorted(here.rglob("*")) == before


def test_show_of_something_else(here):
    (here / "folder").mkdir()
    for what in ("folder", "nothing"):
        result = call("show", what)
        assert result.exit_code == 2
        assert what in result.stderr


@pytest.mark.usefixtures("here")
def test_a_run_is_never_overwritten():
    assert call("evaluate", *FAST, "hydra.run.dir=mine").exit_code == 0
    before = {file: file.read_bytes() for file in Path("mine").rglob("*") if file.is_file()}
    result = call("evaluate", *FAST, "hydra.run.dir=mine", "seed=2")
    assert result.exit_code == 2
    assert "never overwritten" in result.stderr
    assert {file: file.read_bytes() for file in Path("mine").rglob("*") if file.is_file()} == before


def test_an_output_folder_that_cannot_be_made(here):
    (here / "runs").write_text("a file where the folder should be")
    result = call("evaluate", *FAST)
    assert result.exit_code == 2
    assert "runs" in result.stderr


@pytest.mark.skipif(os.geteuid() == 0, reason="root writes everywhere")
def test_a_read_only_output_folder(here):
    here.chmod(0o500)
    result = call("evaluate", *FAST)
    here.chmod(0o700)
    assert result.exit_code == 2
    assert list(here.iterdir()) == []


def test_interrupting_evolve_leaves_a_whole_checkpoint(here, monkeypatch):
    show = progress.EvolutionProgress.show

    def stop(self, generation):
        show(self, generation)
        if generation.number == 1:
            raise KeyboardInterrupt

    monkeypatch.setattr(progress.EvolutionProgress, "show", stop)
    done = call("evolve", *TINY)
    run = only_run(here / "runs" / "evolve")
    assert done.exit_code == 130, done.stderr
    assert f"{run.relative_to(here)}/checkpoint.npz" in done.stderr
    assert json.loads((run / "status.json").read_text())["state"] == "interrupted"
    with np.load(run / "checkpoint.npz") as checkpoint:
        assert checkpoint["generation"] == 1
        assert checkpoint["population"].shape == (6, 234)


def test_help_lists_the_groups():
    for verb, word in (("evaluate", "4obstacles"), ("evolve", "as_coded")):
        result = call(verb, "--help")
        assert result.exit_code == 0
        assert word in result.stdout


def test_help_is_told_in_full(monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    result = call("--help")
    assert "with and without plasticity." in result.stdout
    assert "..." not in result.stdout.partition("Commands:")[2]


def test_help_imports_nothing_heavy():
    code = "import sys, epuckhebb.app.cli; print(sorted({'numba', 'pandas', 'hydra', 'pymunk'} & set(sys.modules)))"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "[]\n"


def test_python_m_is_the_program():
    told = subprocess.run(
        [sys.executable, "-m", "epuckhebb", "--help"], capture_output=True, text=True, check=True
    ).stdout
    assert all(verb in told for verb in ("evolve", "evaluate", "sweep", "reproduce", "replay", "show", "rerun"))
    done = subprocess.run([sys.executable, "-m", "epuckhebb", "show", "nowhere"], capture_output=True, check=False)
    assert done.returncode == 2


def ended_by(script, number, times=1):
    """What a Python script says and returns that gets a signal so many times as soon as it says that it is ready."""
    with subprocess.Popen([sys.executable, "-c", script], stdout=-1, stderr=-1, text=True) as started:
        assert started.stdout.readline() == "ready\n"
        for _ in range(times):
            started.send_signal(number)
            time.sleep(0.01)
        return started.communicate(timeout=60)[1], started.returncode


READY = "import time; print('ready', flush=True); time.sleep(60)"


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_before_anything_has_begun(number):
    script = f"from epuckhebb.app.errors import leave_when_asked; leave_when_asked(); {READY}"
    assert ended_by(script, number) == ("\nError: interrupted\n", 130)


def test_ctrl_c_five_times_while_all_is_tidied_up():
    script = (
        "import sys, time\n"
        "from epuckhebb.app.errors import interruptible\n"
        "with interruptible():\n"
        "    try:\n"
        f"        {READY}\n"
        "    finally:\n"
        "        time.sleep(0.2)\n"
        "        sys.stderr.write('tidy')\n"
    )
    told, _ = ended_by(script, signal.SIGINT, times=5)
    assert "tidy" in told
    assert told.count("KeyboardInterrupt") == 1


def test_an_error_that_a_library_makes_of_an_interruption_is_one(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def spoilt(*_):
        try:
            signal.raise_signal(signal.SIGINT)
        finally:
            raise AttributeError("'NoneType' object has no attribute '_invalidate_flags_cache'")

    monkeypatch.setattr("epuckhebb.app.evaluate.lives", spoilt)
    result = call("evaluate", "hydra.run.dir=run", "lifetime.record_every=0")
    assert result.exit_code == 130, result.output
    assert "interrupted" in result.stderr
    assert json.loads(Path("run/status.json").read_text())["state"] == "interrupted"


def test_what_is_told_to_ignore_a_signal_ignores_it():
    script = (
        "import signal\n"
        "from epuckhebb.app.errors import interruptible, leave_when_asked\n"
        "signal.signal(signal.SIGHUP, signal.SIG_IGN)\n"  # as nohup does
        "leave_when_asked()\n"
        "with interruptible():\n"
        "    signal.raise_signal(signal.SIGHUP)\n"
        "    print('ready', flush=True)\n"
        "    signal.pause()\n"
    )
    assert ended_by(script, signal.SIGTERM)[1] != 0
    assert "Hangup" not in ended_by(script, signal.SIGTERM)[0]


@pytest.mark.thorough
def test_garbage_is_collected_while_jobs_run(tmp_path, monkeypatch):
    from epuckhebb.app import evaluate

    monkeypatch.chdir(tmp_path)
    seen = []
    monkeypatch.setattr(evaluate, "evaluate_into", lambda *_, **__: seen.append(gc.isenabled()))
    gc.disable()  # as `main` does
    try:
        CliRunner().invoke(app, ["evaluate", "-m", "seed=1,2"])
    finally:
        gc.enable()
    assert seen == [True, True]


@pytest.mark.parametrize("words", [["evaluate"], ["evaluate", "-m", "seed=1,2"], ["evolve"], ["sweep", "obstacles"]])
def test_a_folder_of_configurations_must_be_there(here, words):
    result = CliRunner().invoke(app, [*words, "--config-dir=nowhere"])
    assert result.exit_code == 2
    assert result.stderr.startswith("Error: --config-dir=nowhere is no folder")
    assert list(here.iterdir()) == []


def test_what_is_slow_is_told_and_what_is_quick_is_not(monkeypatch):
    said, heard = [], threading.Event()
    monkeypatch.setenv("FORCE_COLOR", "1")  # stands for a terminal
    monkeypatch.setattr(progress, "say", lambda note: (said.append(note), heard.set()))
    with progress.saying_if_slow("compiling", after_s=0.0):
        assert heard.wait(60)
    with progress.saying_if_slow("not told", after_s=3600.0):
        pass
    assert said == ["compiling"]
