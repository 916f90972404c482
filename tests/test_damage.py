"""Files that a disk, an editor or somebody else has changed: told in one message, and never taken for whole."""

import json
import shutil

import numpy as np
import pytest
from cases import done, refused

from epuckhebb.cli.console import json_text
from epuckhebb.controller.plasticity.rule import Rule
from epuckhebb.controller.plasticity.rules.paper import Paper
from epuckhebb.tmaze.block import LostRobotError
from epuckhebb.tmaze.individual import Controller

SHORT = ["lifetime.duration_s=2", "threads=1", "-q"]
TINY = ["ga.population=4", "ga.elites=1", "ga.loops=1", "ga.generations=1", "scenario.paper_duration_s=10"]


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A run of each verb, not to be written to."""
    folder = tmp_path_factory.mktemp("made")
    evaluation = ["evaluate", "repeats=1", f"hydra.run.dir={folder}/evaluate", *SHORT]
    evolution = ["evolve", *TINY, f"hydra.run.dir={folder}/evolve", *SHORT]
    for words in (evaluation, evolution):
        done(*words)
    return folder


@pytest.fixture
def evaluated(made, tmp_path):
    return shutil.copytree(made / "evaluate", tmp_path / "run")


@pytest.fixture
def evolved(made, tmp_path):
    return shutil.copytree(made / "evolve", tmp_path / "run")


@pytest.mark.parametrize("json_too", [[], ["--json"]])
def test_a_table_that_was_touched_is_not_shown(evaluated, json_too):
    table = evaluated / "metrics.csv"
    table.write_text(table.read_text().replace("0.5", "0.6", 1))
    assert "metrics.csv is not what this run wrote (its SHA-256 differs)" in refused("show", evaluated, *json_too)
    table.unlink()
    assert "metrics.csv cannot be read" in refused("show", evaluated, *json_too)


@pytest.mark.parametrize("name", ["provenance.json", "status.json", ".hydra/config.yaml", "metrics.csv", "traces.npz"])
def test_any_damage_is_one_message(evaluated, tmp_path, name):
    whole = (evaluated / name).read_bytes()
    for content in (b"", b"[]", b"null", b"\xff\xfe\x00", b"[" * 3000, whole[: len(whole) // 3]):
        (evaluated / name).write_bytes(content)
        assert name.rpartition("/")[2] in refused("replay", evaluated, "-o", tmp_path / "page.html"), content


def test_json_is_json_whatever_the_numbers():
    told = json.loads(
        json_text({"a": [float("nan"), float("inf"), 1.5], "b": -float("inf")}), parse_constant=pytest.fail
    )
    assert told == {"a": [None, None, 1.5], "b": None}


@pytest.mark.parametrize(
    "content",
    [np.zeros(227), np.full(234, np.nan), np.full(234, "a"), np.zeros((2, 117)), np.array([{}], dtype=object), None],
    ids=["too few", "nan", "text", "two dimensions", "objects", "no array"],
)
def test_a_genome_that_cannot_be_is_one_message(here, content):
    if content is None:
        (here / "bad.npy").write_bytes(b"PK")
    else:
        np.save("bad.npy", content, allow_pickle=True)
    assert "genome=bad.npy" in refused("evaluate", "genome=bad.npy")


def test_an_evolution_does_not_go_on_as_a_hybrid(evolved):
    file = evolved / ".hydra" / "config.yaml"
    whole = file.read_text()
    assert "mutation_rate: 0.05" in whole
    file.write_text(whole.replace("mutation_rate: 0.05", "mutation_rate: 0.5"))
    before = {path: path.read_bytes() for path in evolved.rglob("*") if path.is_file()}
    told = refused("evolve", f"resume={evolved}", "ga.generations=2", "-q")
    assert "config.yaml is not what this evolution began with" in told
    assert {path: path.read_bytes() for path in evolved.rglob("*") if path.is_file()} == before
    file.write_text(whole.replace("generations: 1", "generations: 2").replace("threads: 1", "threads: 2"))
    done("evolve", f"resume={evolved}", "-q")


def test_weights_that_say_nothing_are_refused():
    with pytest.raises(ValueError, match=r"w_max must lie in"):
        Rule(w_max=1e7)


def test_a_life_whose_sums_are_not_finite_has_not_finished(run_lifetime, genomes, monkeypatch):
    monkeypatch.setattr(Paper, "__post_init__", lambda _: None)  # which would refuse so large numbers
    controller = Controller(name="huge", rule=Paper(N=1e307, w_max=1e307))
    with pytest.raises(LostRobotError, match="made weights infinite or nan"):
        run_lifetime(genomes[0], controller=controller, seconds=4.0, record_every=0)
