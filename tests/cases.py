"""What many tests do alike: call the program, look at what it left, and leave dear cases to the thorough suite."""

import re
import shutil
from contextlib import chdir
from functools import cache
from pathlib import Path

import pytest
import yaml
from typer.testing import CliRunner

from epuckhebb.cli.commands import app
from epuckhebb.config import EvaluateConfig, load
from epuckhebb.controller.network import PAPER_NETWORK
from epuckhebb.evolution.evolve import MazeEvaluator, evolve
from epuckhebb.evolution.training import UNVARIED
from epuckhebb.runtime import conf
from epuckhebb.runtime.errors import USAGE
from epuckhebb.tmaze.individual import GA_ALONE

COLUMNS = Path(__file__).parents[1] / "epuckhebb" / "store" / "columns.yaml"
SHORT = ["lifetime.duration_s=2", "repeats=1"]
SMALL_GA = ["ga.population=4", "ga.loops=1", "ga.elites=1", "lifetime.duration_s=2", "scenario.paper_duration_s=10"]


def described_columns(file, folder=COLUMNS.parent):
    """The names of the columns of a table, or of the arrays of a file, that `columns.yaml` describes, in its order."""
    return list(yaml.safe_load((folder / COLUMNS.name).read_text())[file]["columns"])


def call(*words):
    """Call the program in this process; click's result."""
    return CliRunner().invoke(app, [str(word) for word in words])


def done(*words):
    """Call the program, which must succeed."""
    result = call(*words)
    assert result.exit_code == 0, (words, result.output)
    return result


def evolve_in_maze(optimizer, scenario, lifetime, seed, threads=1, after=None, **more):
    """The generations of an evolution in the maze. more: training, network, controller, origin, start."""
    training, network = more.pop("training", UNVARIED), more.pop("network", PAPER_NETWORK)
    controller, origin = more.pop("controller", GA_ALONE), more.pop("origin", None)
    maze = MazeEvaluator(optimizer, scenario, lifetime, training, seed, network, controller, threads, origin)
    generations, _ = optimizer.schedule(training, lifetime)
    return evolve(optimizer, maze, generations, seed, after, network=network, rule=controller.rule, **more)


def refused(*words):
    """Call the program, which must refuse: exit code 2 and one message, which is returned."""
    result = call(*words)
    assert result.exit_code == USAGE, (words, result.output)
    assert isinstance(result.exception, SystemExit)
    assert len(re.findall("^Error: ", result.stderr, re.MULTILINE)) == 1, result.output
    return result.stderr


def refused_before(out, words, texts):
    """Call the program, which must refuse with all of these texts, before there is a folder of this name."""
    said = refused(*words)
    assert [text for text in texts if text not in said] == [], said
    assert not Path(out).exists()


def runs_of(folder, example, *commands, place="."):
    """A folder outside the package with an example at a place in it, and with what these commands leave."""
    shutil.copytree(example, folder / place, dirs_exist_ok=True)
    with chdir(folder):
        for words in commands:
            done(*words)
    return folder


def check_resumed(words, generations, names=("history.csv", "champion.npz")):
    """An evolution by these words that is stopped, and goes on, leaves the same bytes as the one in `evolved`."""

    def same():
        return all(Path("again", name).read_bytes() == Path("evolved", name).read_bytes() for name in names)

    some, all_of_them = generations
    done("evolve", *words, some, "hydra.run.dir=again")
    assert not same()
    done("evolve", "resume=again", all_of_them, "-q")
    assert same()


def contents(folder="."):
    """The bytes of all files of a folder, by their names; not what Python compiled."""
    files = [file for file in Path(folder).rglob("*") if file.is_file() and "__pycache__" not in file.parts]
    return {str(file.relative_to(folder)): file.read_bytes() for file in files}


def first_of(cases, ordinary=1):
    """The cases of a `parametrize`, of which the first stand in the ordinary suite and the others in the thorough one.

    ordinary: how many of them are the first.
    """
    first, others = list(cases)[:ordinary], list(cases)[ordinary:]
    values = [case if isinstance(case, tuple) else (case,) for case in others]
    return [*first, *(pytest.param(*case, marks=pytest.mark.thorough) for case in values)]


@cache
def world_named(name):
    """A world by the name that tables have: of its scenario, and of its changes."""

    def changes_in(rest, names=()):
        if not rest:
            return names
        starts = (change for change in conf.table("change") if f"{rest}_".startswith(f"_{change}_"))
        found = (changes_in(rest[len(change) + 1 :], (*names, change)) for change in sorted(starts, key=len))
        return next((one for one in found if one is not None), None)

    for scenario in conf.table("scenario"):
        changes = changes_in(name.removeprefix(scenario)) if f"{name}_".startswith(f"{scenario}_") else None
        if changes is not None:
            return load(EvaluateConfig, [f"scenario={scenario}", f"change={list(changes)}", "hebbian=none"]).world
    raise ValueError(name)
