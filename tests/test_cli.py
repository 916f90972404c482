"""Each verb as a user calls it, and each mistake a user can make."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from cases import call, done, first_of, refused
from typer.main import get_command

from epuckhebb.analysis.evaluate import COLUMNS
from epuckhebb.cli.commands import app
from epuckhebb.runs import evolve, hydra
from epuckhebb.runtime import INTERRUPTED, JOB_FAILED
from epuckhebb.store import locked

FAST = ["lifetime.duration_s=8", "lifetime.record_every=0", "repeats=2"]
TINY = ["ga.population=6", "ga.generations=3", "ga.elites=2", "ga.loops=1", "lifetime.duration_s=3"]
TINY += ["scenario.paper_duration_s=10"]  # what a champion remembers is soon known


def only_run(folder):
    runs = list(folder.iterdir())
    assert len(runs) == 1
    return runs[0]


def test_evaluate_leaves_a_whole_run(here):
    result = done("evaluate", "scenario=4obstacles", *FAST, "lifetime.record_every=8")
    assert "Success" in result.stdout
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


@pytest.mark.parametrize("launcher", first_of(["basic", "joblib"]))
def test_multirun_sweeps(here, launcher):
    words = ["-m", "hebbian.N=0,0.002", "scenario=base,4obstacles", f"hydra/launcher={launcher}", "seed=3"]
    told = done("evaluate", *words, *FAST).stderr
    assert "done: hebbian.N=0.002 scenario=4obstacles" in told
    runs = sorted(only_run(here / "runs" / "evaluate").glob("*/metrics.csv"))
    assert len(runs) == 4
    rows = pd.concat([pd.read_csv(run) for run in runs])
    assert set(rows[rows.controller == "Hebbian"].groupby(["N", "scenario"]).size()) == {4}
    ga = rows[rows.controller == "GA"].drop_duplicates()
    assert len(ga) == 8  # the control is the same whatever N is


def test_a_worker_works_in_the_folder_of_the_call(here, monkeypatch):
    elsewhere, done_in = here / "elsewhere", []
    elsewhere.mkdir()
    monkeypatch.chdir(elsewhere)
    hydra._do(lambda _: done_in.append(Path.cwd()), [], -1, here, None)
    monkeypatch.chdir(elsewhere)
    hydra._do(lambda _: done_in.append(Path.cwd()), [], os.getpid(), here, None)
    assert done_in == [here, elsewhere]
    assert "nowhere" in str(hydra._do(done_in.append, [], -1, here / "nowhere", None))
    assert len(done_in) == 2


def test_a_multirun_without_a_run_in_its_folder_is_an_error(here, monkeypatch):
    monkeypatch.setattr(hydra._Chosen, "_do", lambda _, tasks: [None] * len(tasks))
    words = ["evaluate", "-m", "seed=1,2", *FAST, "hydra.sweep.dir=here"]
    result = call(*words)
    assert result.exit_code == JOB_FAILED
    assert "here/0" in result.stderr
    Path("here/.submitit").mkdir()  # of jobs that were submitted, and none began
    assert call(*words).exit_code == JOB_FAILED
    assert f"dir: {here}/here" in Path("here/multirun.yaml").read_text()


def test_a_multirun_resumes_as_a_whole(here, monkeypatch):
    """One is done, one was stopped, one never began; another call is kept out, and other settings are refused."""
    words = ["evolve", "-m", "seed=1,2,3", *TINY, "threads=1", "figures=none", "hydra.sweep.dir=many"]
    write = evolve._write_generation

    def stop(run, state, prepared):
        write(run, state, prepared)
        if (run.path.name, state.generation.number) == ("1", 1):
            raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr(evolve, "_write_generation", stop)
        assert call(*words).exit_code == INTERRUPTED
    many = here / "many"
    assert sorted(path.name for path in many.glob("[0-9]")) == ["0", "1"]
    before = {file: file.read_bytes() for file in many.rglob("*") if file.is_file()}
    assert "seed" in refused(*words[:2], "seed=4,2,3", *words[3:])
    with locked(many):
        assert "many" in refused(*words)
    assert {file: file.read_bytes() for file in many.rglob("*") if file.is_file()} == before
    first = (many / "0" / "status.json").read_bytes()
    told = done("evolve", "resume=many")
    assert "3 jobs, 1 done before, 2 to do" in told.stderr
    assert (many / "0" / "status.json").read_bytes() == first
    (summary,) = pd.read_csv(many / "summary.csv").to_dict("records")
    assert summary["n"] == 3
    done("evolve", "seed=2", *TINY, "threads=1", "figures=none", "hydra.run.dir=never_stopped")
    for name in ("history.csv", "champion.npz", "checkpoint.npz"):
        assert (many / "1" / name).read_bytes() == (here / "never_stopped" / name).read_bytes()


def test_an_evaluation_of_many_that_was_stopped_begins_again(here):
    words = ["evaluate", "-m", "seed=1,2", *FAST, "figures=none", "hydra.sweep.dir=many"]
    done(*words)
    run = here / "many" / "1"
    metrics, status = (run / "metrics.csv").read_bytes(), json.loads((run / "status.json").read_text())
    (run / "metrics.csv").write_bytes(metrics[:50])
    (run / "status.json").write_text(json.dumps(status | {"state": "interrupted"}))
    assert "many/1" in call("figure", "many").stderr
    assert "1 done before, 1 to do" in done(*words).stderr
    assert (run / "metrics.csv").read_bytes() == metrics
    assert json.loads((run / "status.json").read_text())["state"] == "finished"


def test_cfg_shows_and_runs_nothing(here):
    result = done("evaluate", "--cfg", "job", "scenario=lowlight")
    assert "light: 0.1" in result.stdout
    assert list(here.iterdir()) == []


@pytest.mark.usefixtures("here")
def test_a_run_is_never_overwritten():
    done("evaluate", *FAST, "hydra.run.dir=mine")
    before = {file: file.read_bytes() for file in Path("mine").rglob("*") if file.is_file()}
    assert "never overwritten" in refused("evaluate", *FAST, "hydra.run.dir=mine", "seed=2")
    assert {file: file.read_bytes() for file in Path("mine").rglob("*") if file.is_file()} == before


def test_an_output_folder_that_cannot_be_made(here):
    (here / "runs").write_text("a file where the folder should be")
    assert "runs" in refused("evaluate", *FAST)
    assert "runs/sweep" in refused("sweep", "obstacles", *FAST)


@pytest.mark.skipif(os.geteuid() == 0, reason="root writes everywhere")
def test_a_read_only_output_folder(here):
    here.chmod(0o500)
    result = call("evaluate", *FAST)
    here.chmod(0o700)
    assert result.exit_code == 2
    assert list(here.iterdir()) == []


def test_interrupting_evolve_leaves_a_whole_checkpoint(here, monkeypatch):
    write = evolve._write_generation

    def stop(run, state, prepared):
        write(run, state, prepared)
        if state.generation.number == 1:
            raise KeyboardInterrupt

    monkeypatch.setattr(evolve, "_write_generation", stop)
    stopped = call("evolve", *TINY)
    run = only_run(here / "runs" / "evolve")
    assert stopped.exit_code == 130, stopped.stderr
    assert f"{run.relative_to(here)}/checkpoint.npz" in stopped.stderr
    assert json.loads((run / "status.json").read_text())["state"] == "interrupted"
    with np.load(run / "checkpoint.npz") as checkpoint:
        assert checkpoint["generation"] == 1
        assert checkpoint["results"].shape == (2 * 6,)


@pytest.mark.parametrize("command", get_command(app).commands)
def test_help_fits_one_screen_and_begins_with_examples(command, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    lines = done(command, "--help").stdout.splitlines()
    assert len(lines) <= 24
    assert max(map(len, lines)) <= 80
    examples, options = lines.index("Examples:"), lines.index("Options:")
    assert 0 < examples < options
    assert all(line.startswith(f"  epuckhebb {command}") for line in lines[examples + 1 : options] if line[2:3] == "e")


def test_help_imports_nothing_heavy():
    code = (
        "import sys, epuckhebb.cli.commands; print(sorted({'numba', 'pandas', 'hydra', 'pymunk'} & set(sys.modules)))"
    )
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "[]\n"


def test_help_names_the_commands():
    told = done("--help").stdout
    assert all(command in told for command in ("evolve", "evaluate", "sweep", "reproduce", "replay", "show", "rerun"))
    assert "..." not in told.partition("Commands:")[2]


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
    script = f"from epuckhebb.runtime.errors import end_on_signals; end_on_signals(); {READY}"
    assert ended_by(script, number) == ("\nError: interrupted\n", 130)


def test_ctrl_c_five_times_while_all_is_tidied_up():
    script = (
        "import sys, time\n"
        "from epuckhebb.runtime.errors import interruptible\n"
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


@pytest.mark.usefixtures("here")
def test_an_error_that_a_library_makes_of_an_interruption_is_one(monkeypatch):

    def spoilt(*_, **__):
        try:
            signal.raise_signal(signal.SIGINT)
        finally:
            raise AttributeError("'NoneType' object has no attribute '_invalidate_flags_cache'")

    monkeypatch.setattr("epuckhebb.runs.maze.evaluate", spoilt)
    result = call("evaluate", "hydra.run.dir=run", "lifetime.record_every=0")
    assert result.exit_code == 130, result.output
    assert "interrupted" in result.stderr
    assert json.loads(Path("run/status.json").read_text())["state"] == "interrupted"


def test_what_is_told_to_ignore_a_signal_ignores_it():
    script = (
        "import signal\n"
        "from epuckhebb.runtime.errors import interruptible, end_on_signals\n"
        "signal.signal(signal.SIGHUP, signal.SIG_IGN)\n"  # as nohup does
        "end_on_signals()\n"
        "with interruptible():\n"
        "    signal.raise_signal(signal.SIGHUP)\n"
        "    print('ready', flush=True)\n"
        "    signal.pause()\n"
    )
    assert ended_by(script, signal.SIGTERM)[1] != 0
    assert "Hangup" not in ended_by(script, signal.SIGTERM)[0]


def test_a_job_of_many_that_fails_is_one_message(here):
    text = "from epuckhebb import Fitness\nclass Mine(Fitness):\n    life = staticmethod(lambda success: 1 / 0)\n"
    (here / "mine.py").write_text(text)
    words = ["-m", "seed=1,2", "fitness.function=mine.py:Mine", *FAST]
    assert "executing" not in refused("evaluate", *words)


@pytest.mark.usefixtures("here")
def test_a_launcher_that_stops_says_so(monkeypatch):
    def stop(*_, **__):
        raise RuntimeError("no srun")

    monkeypatch.setattr("joblib.Parallel.__call__", stop)
    for words in (["evaluate", "-m", "seed=1,2", "hydra/launcher=joblib"], ["sweep", "light"]):
        told = call(*words, "lifetime.duration_s=2", "repeats=1")
        assert told.exit_code == JOB_FAILED
        assert "the launcher stopped: RuntimeError: no srun" in told.stderr


@pytest.mark.parametrize("name", ["grün", "a=b", "a(b)", "a&b#c", "[a]", "it's!", "a;b{c}"])
def test_a_path_is_taken_as_it_stands(here, name):
    np.save(here / f"x{name}.npy", np.zeros(234))
    done("evaluate", f"genome=x{name}.npy", *FAST, "-q")
    assert set(pd.read_csv(only_run(here / "runs" / "evaluate") / "metrics.csv").genome) == {f"x{name}"}


def test_a_working_folder_that_was_removed_is_said(here):
    (here / "gone").mkdir()
    os.chdir("gone")
    (here / "gone").rmdir()
    assert "working folder" in refused("evaluate")
    os.chdir(here)
