"""The engine of studies: what is missing is done, in order, by one process at a time, and its end is written down."""

import json
import re
import signal
import sys

import pytest

from epuckhebb.runtime import errors
from epuckhebb.runtime.errors import ConfigError, JobFailedError
from epuckhebb.runtime.progress import bar, be_quiet, counting, say
from epuckhebb.store import lock
from epuckhebb.store.folder import RunFolder


@pytest.fixture
def study(tmp_path):
    """A folder, and a function that works in it: it writes files, and ends with an error if one is given."""
    folder = tmp_path / "runs" / "study"

    def work(*names, error=None, words=("a",)):
        with RunFolder.resume(folder, "study", "seed: 1\n", list(words), {"seed": 1}) as run:
            for name in names:
                run.write(name, name)
            if error:
                raise error
            run.remove_stale()

    return folder, work


def status(folder):
    return json.loads((folder / "status.json").read_text())


def test_each_call_that_goes_on_is_noted_beside_the_first(study):
    folder, work = study
    work("one")
    work("two", words=("a", "b"))
    told = json.loads((folder / "provenance.json").read_text())
    assert told["command_line"] == ["epuckhebb", "study", "a"]
    assert [again["command_line"] for again in told["resumed"]] == [["epuckhebb", "study", "a", "b"]]
    assert status(folder)["state"] == "finished"


def test_tables_of_an_earlier_call_that_this_one_has_not_are_no_longer_there(study):
    folder, work = study
    work("both.csv", "stale.csv", "mine.csv")
    (folder / "mine.csv").write_text("with notes")
    (folder / "notes.txt").write_text("dear")
    with pytest.raises(KeyboardInterrupt):  # the record of what was written outlasts an interruption
        work(error=KeyboardInterrupt())
    assert (folder / "stale.csv").exists()
    work("both.csv")
    names = {str(file.relative_to(folder)) for file in folder.rglob("*") if file.is_file()}
    (aside,) = (name for name in names if name.startswith("set_aside/mine.csv"))
    assert (folder / aside).read_text() == "with notes"
    assert names == {".hydra/config.yaml", "both.csv", "notes.txt", "provenance.json", "status.json", aside}
    assert set(status(folder)["sha256"]) == {".hydra/config.yaml", "both.csv", "provenance.json"}


@pytest.mark.parametrize(
    ("error", "raised", "state"),
    [
        (ArithmeticError("lost"), JobFailedError, "failed"),
        (ConfigError("lost"), ConfigError, "failed"),
        (OSError(28, "lost", "file"), JobFailedError, "failed"),
        (KeyboardInterrupt(), KeyboardInterrupt, "interrupted"),
    ],
)
def test_how_it_ends_is_written_down_and_it_can_go_on(study, error, raised, state):
    folder, work = study
    with pytest.raises(raised) as told:
        work("one", error=error)
    assert status(folder)["state"] == state
    assert ("lost" if state == "failed" else "") in str(told.value)
    assert errors.open_folders == []
    work("one")
    assert (status(folder)["state"], "error" in status(folder)) == ("finished", False)


@pytest.mark.skipif(sys.platform == "win32", reason="no such signal")
@pytest.mark.parametrize("error", [SystemExit(-1), RuntimeError("timed out")])
@pytest.mark.parametrize("is_signal", [True, False])
def test_a_launcher_that_ends_its_job_is_let_through_and_a_part_that_ends_it_has_failed(study, is_signal, error):
    folder, _ = study

    def leave(*_):
        raise error

    before = signal.signal(signal.SIGUSR2, leave if is_signal else signal.SIG_DFL)
    try:
        raised = type(error) if is_signal else JobFailedError
        with pytest.raises(raised), RunFolder.resume(folder, "study", None, [], {}):
            signal.raise_signal(signal.SIGUSR2) if is_signal else leave()
    finally:
        signal.signal(signal.SIGUSR2, before)
    assert status(folder)["state"] == ("interrupted" if is_signal else "failed")


def test_one_process_at_a_time(study):
    folder, work = study
    with RunFolder.resume(folder, "study", None, [], {}):
        assert status(folder)["state"] == "running"
        with pytest.raises(ConfigError, match="another process is working on"):
            work("one")
        assert status(folder)["state"] == "running"
    assert not (folder / "one").exists()


def test_what_killed_calls_left_half_done_is_thrown_away_but_not_what_is_at_work(study):
    folder, work = study
    work()
    killed, working = (f"unfinished/20261122-010203-0123abcd_{number}" for number in (0, 1))
    for name in ("deep", killed, working):
        (folder / name).mkdir(parents=True)
        (folder / name / ".half.1.tmp").touch()
    held = lock.lock(folder / working)
    with RunFolder.resume(folder, "study", None, [], {}):
        left = sorted(str(file.relative_to(folder)) for file in folder.rglob(".*.tmp"))
    lock.release(held)
    assert left == [f"{working}/.half.1.tmp"]


def test_the_bar_shows_how_much_is_done(monkeypatch, capsys):
    be_quiet(False)
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    with bar("generation", 10, 4) as shown:
        say("a note")
        shown.set_postfix_str("best 0.6", refresh=False)
        shown.update()
    lines = [line.split("\r")[-1].strip() for line in capsys.readouterr().err.split("\n")]
    assert lines[0] == "a note"  # it stands above the bar, not in it
    assert re.fullmatch(r"generation 5/10 \S+ *, best 0\.6  \d\d:\d\d", lines[1])


def test_each_job_that_ends_has_a_line_in_a_log(capsys):
    ended = iter([[("seed=1", "done"), ("seed=2", "failed")]])

    def shown():
        with counting(3, lambda: next(ended, [])):
            pass
        return capsys.readouterr().err.splitlines()

    be_quiet(False)
    assert [line.partition(";")[0] for line in shown()] == ["job 1 of 3 done: seed=1", "job 2 of 3 failed: seed=2"]
    be_quiet(True)
    ended = iter([[("seed=1", "done")]])
    assert shown() == []
