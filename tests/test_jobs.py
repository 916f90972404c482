"""Many jobs of one call: which are launched, which go on, and what is said of those that are not done."""

import json
from concurrent.futures.process import BrokenProcessPool

import pytest
from cases import refused_before
from hydra.core.plugins import Plugins
from hydra.plugins.sweeper import Sweeper

from epuckhebb.runs import jobs as many
from epuckhebb.runs.jobs import Jobs, LauncherError, Task, failure_text, names_of_overrides
from epuckhebb.runtime import ConfigError, JobFailedError, be_quiet, leaving, open_folders
from epuckhebb.store import lock


class Pool:
    """A launcher whose workers write how a job goes; two are at work at a time, and `deadly` jobs kill one."""

    def __init__(self, folder, deadly=(), failing=(), refused=()):
        self.folder, self.deadly, self.failing, self.refused, self.calls = folder, deadly, failing, refused, []
        self.jobs = Jobs(self.plan)

    def plan(self, listed, subdir):
        names = names_of_overrides(listed)
        paths = [self.folder / subdir(place) for place in range(len(listed))]
        return [Task(name=n, overrides=own, path=p, result=p) for n, own, p in zip(names, listed, paths, strict=True)]

    def write(self, name, state, **more):
        (self.folder / name).mkdir(exist_ok=True)
        (self.folder / name / "status.json").write_text(json.dumps({"state": state, **more}))

    def do(self, tasks):
        self.calls.append([task.path.name for task in tasks])
        errors = []
        for place, task in enumerate(tasks):
            name = task.path.name
            if name in self.deadly:
                for other in tasks[place : place + 2]:
                    self.write(other.path.name, "running")
                raise BrokenProcessPool
            if name in self.refused:
                errors.append(ConfigError(f"no {name}"))
                continue
            error = JobFailedError(f"lost {name}") if name in self.failing else None
            self.write(name, "failed" if error else "finished", **({"error": str(error)} if error else {}))
            errors.append(error)
        return errors

    def launch(self, count=6):
        self.jobs.launch(self.do, [[f"seed={n}", "repeats=1"] for n in range(count)], str)
        return {task.path.name: reason for task, reason in self.jobs.failures}


def test_what_is_done_is_kept_and_what_is_at_work_is_left(tmp_path):
    pool = Pool(tmp_path)
    for name, state in {"0": "finished", "1": "interrupted", "2": "failed", "3": "running", "4": "running"}.items():
        pool.write(name, state)
    held = lock.lock(tmp_path / "3")
    failures = pool.launch()
    lock.release(held)
    assert pool.calls == [["1", "2", "4", "5"]]
    assert list(failures) == ["3"]
    assert "at work" in failures["3"]


@pytest.mark.parametrize(
    ("deadly", "calls", "lost"),
    [
        ("2", [["0", "1", "2", "3", "4", "5"], ["4", "5"], ["2"], ["3"]], ["2"]),
        ("5", [["0", "1", "2", "3", "4", "5"], ["5"]], ["5"]),
        ("14", [["0", "1", "2", "3", "4", "5"], ["3", "4", "5"], ["1"], ["2"], ["4"], ["5"]], ["1", "4"]),
    ],
)
def test_a_killed_worker_costs_its_job_alone(tmp_path, deadly, calls, lost):
    pool = Pool(tmp_path, deadly=deadly)
    failures = pool.launch()
    assert pool.calls == calls
    assert list(failures) == lost
    assert all("killed" in reason for reason in failures.values())


def test_each_job_has_its_own_reason_and_a_launcher_that_stops_none_of_theirs(tmp_path, monkeypatch):
    monkeypatch.setattr(many, "AT_ONCE", 3)
    pool = Pool(tmp_path, failing="1")
    do = pool.do

    def stops(tasks):
        if tasks[0].path.name == "3":
            pool.write("3", "running")
            pool.write("4", "interrupted")
            raise LauncherError("the launcher stopped: CANCELLED")
        return do(tasks)

    pool.do = stops
    assert pool.launch() == {
        "1": "lost 1",
        "3": "it may be at work; the launcher stopped: CANCELLED",
        "4": "it was interrupted",
        "5": "it has not begun; the launcher stopped: CANCELLED",
    }


def test_jobs_that_are_refused_are_a_wrong_input_only_where_none_has_begun(tmp_path):
    with pytest.raises(ConfigError, match="no 0"):
        Pool(tmp_path, refused="012").launch(3)
    assert Pool(tmp_path, refused="1").launch(3) == {"1": "no 1"}


def test_a_job_that_ends_is_said_with_what_only_it_has(tmp_path, capsys):
    be_quiet(False)
    Pool(tmp_path, failing="1").launch(2)
    lines = [line.partition(";")[0] for line in capsys.readouterr().err.splitlines()]
    assert lines == ["2 jobs, 0 done before, 2 to do.", "job 1 of 2 done: seed=0", "job 2 of 2 failed: seed=1"]


def test_a_reason_of_many_is_said_once():
    failures = [*((str(number), "lost") for number in range(5)), ("5", "late")]
    assert failure_text(failures, 9).splitlines() == ["6 of 9 jobs", "0, 1, 2 and 2 more: lost", "5: late"]
    assert failure_text([], 9) == ""


class OtherSweeper(Sweeper):
    """A sweeper that chooses what comes next by what jobs return, as those of optuna, nevergrad and ax."""

    __module__ = "hydra_plugins.other"

    def setup(self, **how):
        Plugins.instance().instantiate_launcher(**how)

    def sweep(self, arguments):
        return None


def test_a_sweeper_that_needs_what_jobs_return_is_refused_before_any(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Plugins.instance().register(OtherSweeper)
    name = "hydra_plugins.other.OtherSweeper"
    refused_before(
        "out", ["evaluate", "-m", "seed=1,2", f"hydra.sweeper._target_={name}", "hydra.sweep.dir=out"], [name[20:]]
    )
    assert list(tmp_path.iterdir()) == []


def test_an_interruption_says_what_does_the_rest():
    with leaving("resume=mine does the rest"):
        assert [left() for left in open_folders] == ["resume=mine does the rest"]
    assert open_folders == []
    with pytest.raises(KeyboardInterrupt, match="resume=mine does the rest"), leaving("resume=mine does the rest"):
        raise KeyboardInterrupt("of one job")
