"""A disk that is full, or may only be read: a small one of the test's own, which needs the right to mount it."""

import shutil
import subprocess
from contextlib import contextmanager

import pytest
from cases import call, contents, done, first_of

PAGE = 4096
SHORT = ["lifetime.duration_s=3", "-q"]
EVALUATE = ["evaluate", "lifetime.record_every=0", *SHORT]
EVOLVE = ["evolve", "ga.population=6", "ga.elites=2", "ga.loops=1", "ga.generations=2", *SHORT]
SWEEP = ["sweep", "obstacles", "scenario=base", "repeats=1", "hydra/launcher=basic", "hydra.sweep.dir=one", *SHORT]
CALLS = {  # what leaves a result in the folder `one`, and what then has more to write
    "evaluate": ([*EVALUATE, "hydra.run.dir=one"], [*EVALUATE, "hydra.run.dir=two"]),
    "evolve": ([*EVOLVE, "hydra.run.dir=one"], [*EVOLVE, "hydra.run.dir=two"]),
    "resume": ([*EVOLVE, "hydra.run.dir=one"], ["evolve", "resume=one", "ga.generations=4", "-q"]),
    "sweep": ([*SWEEP, "seed=1"], [*SWEEP, "seed=1,2"]),
}


def mount(*words):
    try:
        return subprocess.run(["mount", *words], capture_output=True, check=False).returncode == 0
    except OSError:  # another operating system
        return False


@pytest.fixture
def disk(tmp_path, monkeypatch):
    folder = tmp_path / "disk"
    folder.mkdir()
    if not mount("-t", "tmpfs", "-o", "size=2m", "tmpfs", str(folder)):
        pytest.skip("mounting is refused")
    monkeypatch.chdir(folder)
    yield folder
    monkeypatch.chdir(tmp_path)
    subprocess.run(["umount", folder], check=True)


@contextmanager
def full(disk, pages):
    """All of the disk taken, but for some pages."""
    ballast = disk / "ballast"
    try:
        ballast.write_bytes(bytes(shutil.disk_usage(disk).free - pages * PAGE))
        assert shutil.disk_usage(disk).free == pages * PAGE
        yield
    finally:
        ballast.unlink()


@contextmanager
def read_only(disk):
    assert mount("-o", "remount,ro", str(disk))
    try:
        yield
    finally:
        assert mount("-o", "remount,rw", str(disk))


def fails(words, expected):
    """The exit code of a call that cannot write."""
    result = call(*words)
    assert result.exit_code in (1, 2), result.output
    assert expected in result.stderr
    assert "Traceback" not in result.output
    return result.exit_code


@pytest.mark.parametrize(("command", "pages"), first_of([("evaluate", 5), ("evolve", 0), ("resume", 2), ("sweep", 6)]))
def test_a_full_disk(disk, command, pages):
    first, more = CALLS[command]
    done(*first)
    results = "one/job_*" if command == "sweep" else "one"
    before = [contents(folder) for folder in disk.glob(results)]
    assert before
    with full(disk, pages):
        fails(more, "No space left on device")
    assert list(disk.rglob(".*.tmp")) == []
    if command == "resume":  # the checkpoint is whole, so the rest can be made of it
        done(*EVOLVE, "ga.generations=4", "hydra.run.dir=never_stopped")
        done(*more)
        assert (disk / "one" / "history.csv").read_bytes() == (disk / "never_stopped" / "history.csv").read_bytes()
    else:
        assert [contents(folder) for folder in disk.glob(results)] == before
    if command == "sweep":
        assert "1 done before, 1 to do" in call(*(word for word in more if word != "-q")).stderr


@pytest.mark.thorough
@pytest.mark.parametrize("command", CALLS)
def test_a_disk_that_may_only_be_read(disk, command):
    first, more = CALLS[command]
    done(*first)
    before = contents(disk)
    with read_only(disk):
        assert fails(more, "Read-only file system") == 2
    assert contents(disk) == before
    done(*more)
