"""Files of others are never touched, and files of ours that somebody has touched are not believed."""

import importlib

import pytest
from cases import first_of
from typer.testing import CliRunner

from epuckhebb.app import engine, files, runs
from epuckhebb.app.cli import app
from epuckhebb.app.errors import USAGE, ConfigError
from epuckhebb.app.hydra_bridge import composed, plain
from epuckhebb.app.runs import RunFolder

compiled = importlib.import_module("epuckhebb.sim.compiled")

SMALL = ["repeats=1", "lifetime.duration_s=1", "lifetime.record_every=0"]
SWEEP = ["sweep", "obstacles", *SMALL, "scenario=base", "hydra/launcher=basic"]


@pytest.fixture
def run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return lambda *words: CliRunner().invoke(app, list(words))


def contents(folder):
    return {str(file.relative_to(folder)): file.read_bytes() for file in folder.rglob("*") if file.is_file()}


@pytest.fixture
def own(tmp_path):
    """A folder of the user's, with names like ours."""
    folder = tmp_path / "own"
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
        ["evolve", "ga.population=4", "ga.elites=1", "ga.generations=1", "hydra.run.dir=own"],
    ],
)
def test_a_folder_of_someone_else_is_refused_and_left_as_it_is(run, own, words):
    before = contents(own)
    told = run(*words)
    assert told.exit_code == USAGE, told.output
    assert "own holds files that are not of this program" in told.output
    assert contents(own) == before


@pytest.mark.parametrize("words", [[*SWEEP, "hydra.sweep.dir="], ["evaluate", *SMALL, "hydra.run.dir="]])
def test_an_empty_name_of_a_folder_is_refused(run, own, words):
    before = contents(own.parent)
    told = run(*words)
    assert told.exit_code == USAGE, told.output
    assert "must name a folder" in told.output
    assert contents(own.parent) == before


def test_a_sweep_removes_only_attempts_with_our_names(run, tmp_path):
    assert run(*SWEEP, "hydra.sweep.dir=mine").exit_code == 0
    kept = ["unfinished/thesis.txt", "unfinished/20260101-000000-abcdefgh_1/a.txt", ".notes.tmp", "jobs/.draft.tmp"]
    ours = ["unfinished/20260101-000000-0123abcd_7/half.csv", ".sweep.csv.4242.tmp", "unfinished/stop"]
    for name in kept + ours:
        file = tmp_path / "mine" / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(name)
    assert run(*SWEEP, "hydra.sweep.dir=mine").exit_code == 0
    there = contents(tmp_path / "mine")
    assert all(name in there for name in kept)
    assert not any(name in there for name in ours)


def test_a_run_of_another_verb_is_not_gone_on_with(run, tmp_path):
    assert run("evaluate", *SMALL, "hydra.run.dir=done").exit_code == 0
    before = contents(tmp_path / "done")
    told = run(*SWEEP, "hydra.sweep.dir=done")
    assert told.exit_code == USAGE
    assert "holds a run of `epuckhebb evaluate`" in told.output
    assert contents(tmp_path / "done") == before


def test_a_folder_that_was_only_just_begun_is_taken(tmp_path):
    (tmp_path / "begun" / ".hydra").mkdir(parents=True)
    (tmp_path / "begun" / "status.json").write_text("{}")
    (tmp_path / "begun" / ".provenance.json.7.tmp").write_text("{")
    with RunFolder.going_on(tmp_path / "begun", "sweep", None, [], {}):
        pass
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "letter.txt").write_text("dear")
    with pytest.raises(ConfigError, match="nothing there is touched"):
        RunFolder.going_on(tmp_path / "other", "sweep", None, [], {})


def test_without_the_compiler_nothing_runs(run, monkeypatch, tmp_path):
    """It would live without physics, and say that it had finished."""
    monkeypatch.setenv("NUMBA_DISABLE_JIT", "1")
    told = run("evaluate", *SMALL)
    assert told.exit_code == USAGE
    assert "NUMBA_DISABLE_JIT is set" in told.output
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("harm", first_of(["cut", "changed", "lost"]))
def test_a_job_whose_table_was_touched_is_done_again(run, tmp_path, harm):
    assert run(*SWEEP, "hydra.sweep.dir=mine").exit_code == 0
    table = next((tmp_path / "mine").glob("job_*/metrics.csv"))
    whole, sweep = table.read_bytes(), (tmp_path / "mine" / "sweep.csv").read_bytes()
    if harm == "lost":
        table.unlink()
    else:
        table.write_bytes(whole[:-40] if harm == "cut" else whole.replace(b"reference", b"Reference"))
    again = run(*SWEEP, "hydra.sweep.dir=mine")
    assert again.exit_code == 0, again.output
    assert "0 done before, 1 to do" in again.output
    assert table.read_bytes() == whole
    assert (tmp_path / "mine" / "sweep.csv").read_bytes() == sweep


def test_a_job_is_known_by_all_that_its_results_depend_on(monkeypatch):
    configs = [plain(composed("evaluate", words)) for words in (["adaptation=late", *SMALL], SMALL)]

    def names():
        return [engine.Identities().of(config) for config in configs]

    before = names()
    with monkeypatch.context() as patched:
        patched.setattr(files.Genome, "baseline_sha256", "another")
        assert [now == then for now, then in zip(names(), before, strict=True)] == [False, True]
    monkeypatch.setattr(runs, "versions", lambda packages: dict.fromkeys(packages, "another"))
    assert all(now != then for now, then in zip(names(), before, strict=True))
