"""The Tab key, in a real bash, and as zsh asks."""

import shutil
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from epuckhebb.cli import completion
from epuckhebb.runtime import conf

PROGRAM = str(Path(sys.executable).parent / "epuckhebb")


def bash(*words):
    """What bash would offer for the last of the words of a line; bash itself takes `=` for a word."""
    script = (
        f"source <(_EPUCKHEBB_COMPLETE=source_bash {PROGRAM})\n"
        f'COMP_WORDS=(epuckhebb "$@"); COMP_CWORD={len(words)}\n'
        f"_epuckhebb_completion {PROGRAM}\n"
        'printf "%s\\n" "${COMPREPLY[@]}"\n'
    )
    done = subprocess.run(["bash", "-c", script, "bash", *words], capture_output=True, text=True, check=True)
    assert done.stderr == ""
    return done.stdout.split()


@pytest.mark.thorough
@pytest.mark.skipif(not shutil.which("bash") or not Path(PROGRAM).is_file(), reason="no bash, or not installed")
def test_bash():
    assert bash("swe") == ["sweep"]
    assert bash("evaluate", "scenario", "=", "lo") == ["lowlight"]
    assert set(bash("evaluate", "-m", "hebbian", "=")) >= {"none", "paper", "oja"}
    known = {"none", *conf.rows("adaptation")}
    assert set(bash("evaluate", "adaptation", "=")) == known
    assert set(bash("evaluate", "robot", "=")) == {"epuck", "epuck_lidar"}
    assert set(bash("evaluate", "scen")) >= {"scenario=base", "scenario=lowlight"}


@pytest.fixture
def _no_bash(monkeypatch):
    monkeypatch.delenv("COMP_WORDS", raising=False)
    monkeypatch.delenv("COMP_CWORD", raising=False)


@pytest.mark.usefixtures("_no_bash")
def test_choices():
    assert completion.complete_override("evaluate", "maze=t_maze_9") == ["maze=t_maze_90"]
    assert completion.complete_override("evolve", "ga=") == ["ga=as_coded", "ga=reversal", "ga=textbook"]
    assert completion.complete_override("evaluate", "nothing=") == []
    assert completion.complete_override("evaluate", "hebbian.sign=a") == ["hebbian.sign=anti"]
    assert completion.complete_override("evolve", "figures=p") == ["figures=png", "figures=pdf"]
    assert "ga.crossover=middle" in completion.complete_override("evolve", "ga.crossover=")
    assert completion.complete_sweep("n") == ["n_sweep"]
    assert completion.complete_group("ev") == ["evaluate", "evolve", "evaluate_environment", "evolve_environment"]
    assert completion.complete_override("evaluate", "genome=reference_ode_301") == ["genome=reference_ode_301"]
    assert "genome=reference_7" in completion.complete_override("evolve", "genome=")


def test_figures_of_a_run(tmp_path):
    (tmp_path / "figures").mkdir()
    (tmp_path / "figures" / "trajectories.svg").touch()
    (tmp_path / "history.csv").touch()
    context = SimpleNamespace(params={"run": tmp_path})
    assert completion.complete_figure(context, "tra") == ["trajectories"]
    assert completion.complete_figure(context, "") == ["learning", "trajectories"]
