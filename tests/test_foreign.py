"""Files of others are never touched, and files of ours that somebody has touched are not believed."""

import errno
import importlib
import os
from pathlib import Path
from types import SimpleNamespace

import pytest
from cases import call, contents, done, first_of, refused

from epuckhebb.config.compose import composed
from epuckhebb.config.schema import plain
from epuckhebb.runtime.errors import ConfigError
from epuckhebb.store import disk, genome, provenance
from epuckhebb.store.folder import RunFolder
from epuckhebb.studies import sweep

compiled = importlib.import_module("epuckhebb.controller.compiling.kernel")

SMALL = ["repeats=1", "lifetime.duration_s=1", "lifetime.record_every=0"]
SWEEP = ["sweep", "obstacles", *SMALL, "scenario=base", "hydra/launcher=basic"]


@pytest.fixture
def own(here):
    """A folder of the user's, with names like ours."""
    folder = here / "own"
    for name in ("unfinished/thesis.txt", ".notes.tmp", "sweep.csv", "metrics.csv", "champion.npz"):
        file = folder / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(name)
    return folder


@pytest.mark.parametrize(
    "words",
    [
        [*SWEEP, "hydra.sweep.dir=own"],
        ["evaluate", *SMALL, "hydra.run.dir=own"],
        ["evaluate", "-m", "seed=1,2", *SMALL, "hydra.sweep.dir=own"],
        ["evolve", "ga.population=4", "ga.elites=1", "ga.generations=1", "hydra.run.dir=own"],
    ],
)
def test_a_folder_of_someone_else_is_refused_and_left_as_it_is(own, words):
    before = contents(own)
    assert "own holds other files" in refused(*words)
    assert contents(own) == before


def test_a_run_of_another_verb_is_not_gone_on_with(here):
    done("evaluate", *SMALL, "hydra.run.dir=done")
    before = contents(here / "done")
    assert "done holds other files" in refused(*SWEEP, "hydra.sweep.dir=done")
    assert contents(here / "done") == before


def test_a_folder_that_was_only_just_begun_is_taken(tmp_path):
    (tmp_path / "begun" / ".hydra").mkdir(parents=True)
    (tmp_path / "begun" / "status.json").write_text("{}")
    (tmp_path / "begun" / ".provenance.json.7.tmp").write_text("{")
    with RunFolder.resume(tmp_path / "begun", "sweep", None, [], {}):
        pass
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "letter.txt").write_text("dear")
    with pytest.raises(ConfigError, match="holds other files"):
        RunFolder.resume(tmp_path / "other", "sweep", None, [], {})


def test_a_claim_that_does_not_fit_on_the_disk_leaves_no_file(tmp_path, monkeypatch):
    own = {Path("my.py"): SimpleNamespace(copy="own_code/1/my.py", sha256={}, copies={"own_code/1/my.py": b"pass"})}
    write = disk.write_atomic

    def full(target, content):
        if target.name == "my.py":
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(target))
        write(target, content)

    monkeypatch.setattr(disk, "write_atomic", full)
    with pytest.raises(ConfigError, match="No space left"):
        RunFolder.new(tmp_path / "run", "evaluate", "seed: 1\n", [], {}, own)
    assert contents(tmp_path) == {}
    monkeypatch.setattr(disk, "write_atomic", write)
    with RunFolder.new(tmp_path / "run", "evaluate", "seed: 1\n", [], {}, own):
        assert (tmp_path / "run" / "own_code" / "1" / "my.py").read_bytes() == b"pass"


@pytest.mark.parametrize("harm", first_of(["cut", "changed", "lost"]))
def test_a_job_whose_table_was_touched_is_done_again(here, harm):
    done(*SWEEP, "hydra.sweep.dir=mine")
    table = next((here / "mine").glob("job_*/metrics.csv"))
    whole, sweep = table.read_bytes(), (here / "mine" / "sweep.csv").read_bytes()
    (table.parent / "notes.txt").write_text("dear")
    if harm == "lost":
        table.unlink()
    else:
        table.write_bytes(whole[:-40] if harm == "cut" else whole.replace(b"reference", b"Reference"))
    again = done(*SWEEP, "hydra.sweep.dir=mine")
    assert "0 done before, 1 to do" in again.output
    assert table.read_bytes() == whole
    assert (here / "mine" / "sweep.csv").read_bytes() == sweep
    (notes,) = (here / "mine" / "set_aside").glob("*/notes.txt")
    assert notes.read_text() == "dear"
    assert str(notes.parent.name) in again.output.replace("\n", "")
    assert [job.name for job in (here / "mine").glob("job_*")] == [table.parent.name]
    assert "0 to do" in call(*SWEEP, "hydra.sweep.dir=mine").output


def test_a_job_is_known_by_all_that_its_results_depend_on(monkeypatch):
    config, names = plain(composed("evaluate", SMALL)), []
    for place, name, value in (
        (provenance, "SCIENCE", provenance.SCIENCE),
        (provenance, "SCIENCE", 0),
        (genome.Genome, "nominal_sha256", "another"),
        (provenance, "versions", lambda: {"numpy": "another"}),
    ):
        with monkeypatch.context() as patched:
            patched.setattr(place, name, value)
            names.append(sweep.Identities().name(config))
    assert len(set(names)) == 4
    assert sweep.Identities().name(config) == names[0]
