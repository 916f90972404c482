"""Many jobs of one call: which are done, at work, stopped, failed or not begun, and what is said of each.

One of Hydra's launchers does the jobs. This module chooses which it gets, and reads from their folders how they go.
"""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path

from epuckhebb.runtime import ConfigError, JobFailedError, counting, say
from epuckhebb.store import STATUS, Run, is_locked

AT_ONCE = 1000  # starts that a launcher gets at a time: as many as SLURM takes in one array (its MaxArraySize is 1001)
_NAMED = 3  # jobs that a message names


class State(StrEnum):
    """How far a job is."""

    done = "done"
    at_work = "at work"
    stopped = "stopped"
    failed = "failed"
    waiting = "not begun"


class LauncherError(JobFailedError):
    """A launcher stopped; which of its jobs go on is not known."""


@dataclass(kw_only=True, eq=False)
class Task:
    """One of many jobs, for a launcher.

    name: what it differs in from the others, for a reader. overrides: what Hydra is given. path: the folder in which it
    works. result: the folder of its whole run, the same one unless it is renamed. error: why it failed in this call.
    """

    name: str
    overrides: Sequence[str]
    path: Path
    result: Path
    error: Exception | None = None
    before: object = field(init=False, default=None)

    def __post_init__(self) -> None:
        """Keep what is there already: only what changes is of this call."""
        self.before = self.mark

    @property
    def mark(self) -> object:
        """A value that changes when the job begins, and when its state does."""
        try:
            status = (self.path / STATUS).stat()
        except OSError:
            return self.path.is_dir()
        return status.st_mtime_ns, status.st_ino

    @property
    def state(self) -> State:
        """How far it is."""
        if Run(self.result).is_whole:
            return State.done
        if is_locked(self.path):
            return State.at_work
        recorded = Run(self.path).recorded_status.get("state")
        if self.error is not None or recorded == "failed":
            return State.failed
        return State.stopped if recorded else State.waiting

    @property
    def ended(self) -> State | None:
        """Whether it has ended in this call, without a look at its results."""
        if self.result != self.path and self.result.exists():
            return State.done
        recorded = Run(self.path).recorded_status.get("state") if self.mark != self.before else ""
        return {"finished": State.done, "failed": State.failed}.get(str(recorded))

    def reason(self, trouble: str) -> str:
        """Why it is not done. trouble: of the launcher, if that stopped."""
        state, recorded = self.state, Run(self.path).recorded_status
        if state is State.failed:
            return str(self.error or recorded.get("error"))
        if state is State.waiting:
            unseen = f": there is no run in {self.path}; do all machines of the launcher see this folder?"
            return f"it has not begun{trouble or unseen}"
        if state is State.at_work or (trouble and recorded.get("state") == "running"):
            return f"it may be at work{trouble}"
        return "it was interrupted" if recorded.get("state") == "interrupted" else "it ended unexpectedly"


Do = Callable[[list[Task]], Sequence[Exception | None]]
Plan = Callable[[Sequence[Sequence[str]], Callable[[int], str]], list[Task]]
Join = Callable[[Sequence[Task]], Sequence[str]]


def _alone(tasks: Sequence[Task]) -> Sequence[str]:
    """The overrides of a start that does one job."""
    (task,) = tasks
    return task.overrides


class Jobs:
    """All jobs of a call."""

    def __init__(self, plan: Plan, *, batch: int = 1, join: Join = _alone, says_counts: bool = True) -> None:
        """Know no job yet.

        plan: gives the tasks of jobs that Hydra's sweeper lists by their overrides. batch: how many jobs a start of the
        launcher does, one after the other. join: gives the overrides of such a start. says_counts: say how many are
        done.
        """
        self.plan, self.batch, self.join, self.says_counts = plan, batch, join, says_counts
        self.tasks, self._trouble = list[Task](), ""

    def launch(self, do: Do, listed: Sequence[Sequence[str]], subdir: Callable[[int], str]) -> None:
        """Do the jobs that are listed, but for those that are done or at work.

        do: does some on a launcher, and returns the error of each. subdir: the folder that the settings give a job.

        Raises:
            ConfigError: A job was refused, and none has begun.
        """
        tasks = self.plan(listed, subdir)
        states = [task.state for task in tasks]
        missing = [task for task, state in zip(tasks, states, strict=True) if state not in (State.done, State.at_work)]
        self.tasks += tasks
        if self.says_counts:
            working = f"{states.count(State.at_work)} at work, " if State.at_work in states else ""
            done = states.count(State.done)
            say(f"{len(tasks)} jobs, {done} done before, {working}{len(missing)} to do.")
        with counting(len(missing), _ends(missing)):
            for some in batches(missing, AT_ONCE * self.batch):
                self._launch(do, some)
        refused = [task.error for task in missing if isinstance(task.error, ConfigError)]
        if refused and not any(task.mark != task.before for task in missing):
            raise refused[0]

    def _launch(self, do: Do, tasks: list[Task]) -> None:
        """Do jobs. A killed worker ends the pool of its launcher: what had begun there is done last, one at a time."""
        alone: list[Task] = []
        while tasks and not self._is_through(do, tasks):
            begun = [task for task in tasks if task.mark != task.before]
            killed = [task for task in begun if not task.ended]
            if not begun:
                self._trouble = "; the launcher stopped: a worker was killed before its job began"
                return
            alone += killed
            say(f"A worker was killed (too little memory?). Again, after the others, one at a time: {_names(killed)}")
            tasks = [task for task in tasks if task not in begun]
        for task in alone:
            if not self._is_through(do, [task]):
                task.error = JobFailedError("its worker was killed, alone, too (too little memory?)")

    def _is_through(self, do: Do, tasks: list[Task]) -> bool:
        """Do jobs; whether no worker was killed."""
        try:
            for task, error in zip(tasks, do(tasks), strict=True):
                task.error = error
        except BrokenProcessPool:
            return False
        except LauncherError as error:
            self._trouble = f"; {error}"
        return True

    @property
    def failures(self) -> list[tuple[Task, str]]:
        """The jobs that are not done, and why."""
        return [(task, task.reason(self._trouble)) for task in self.tasks if task.state is not State.done]


def batches(tasks: list[Task], size: int) -> list[list[Task]]:
    """The tasks in their order, in lists of a size; the last may be shorter."""
    return [tasks[first : first + size] for first in range(0, len(tasks), size)]


def failure_text(failures: Sequence[tuple[str, str]], total: int) -> str:
    """What of so many jobs is not done, a line for each reason; "" if all is. failures: names and reasons."""
    names: dict[str, list[str]] = {}
    for name, reason in failures:
        names.setdefault(reason, []).append(name)
    lines = [f"{_join_names(who)}: {reason}" for reason, who in names.items()]
    return "\n".join([f"{len(failures)} of {total} jobs", *lines]) if lines else ""


def names_of_overrides(jobs: Sequence[Sequence[str]]) -> list[str]:
    """A name for each job: the overrides that not all have, or all of one that is alone."""
    shared = set.intersection(*(set(job) for job in jobs)) if len(jobs) > 1 else set()
    return [" ".join(word for word in job if word not in shared).replace("\\:", ":") for job in jobs]


def _names(tasks: Sequence[Task]) -> str:
    return _join_names([task.name for task in tasks])


def _join_names(names: Sequence[str]) -> str:
    more = f" and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
    return f"{', '.join(names[:_NAMED])}{more}"


def _ends(tasks: Sequence[Task]) -> Callable[[], Iterator[tuple[str, str]]]:
    """A function that gives the names and states of the jobs that have ended since it was called last."""
    going = dict.fromkeys(tasks)

    def ends() -> Iterator[tuple[str, str]]:
        for task in list(going):
            if state := task.ended:
                del going[task]
                yield task.name, str(state)

    return ends
