"""What SLURM's queue knows of the jobs of a call: those that wait, and why, and those that are lost.

Submitit asks SLURM's accounts (`sacct`) how a job is. Where SLURM keeps none, submitit waits for ever for a job that
was cancelled, or whose node was lost; where it keeps some, submitit ends at the first of them, and leaves the others.
Every SLURM has its queue (`squeue`), which alone is asked here.
"""

import pickle
import subprocess
import threading
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from shutil import which
from typing import Any

from epuckhebb.runtime import ConfigError, JobFailedError, say

_AWAY = "it is no longer in the queue"
_LOOK_S = 15.0  # between two looks at the queue
_PATIENCE_S = 60.0  # from the end of a job to its result, which comes late on a busy file system
_ANSWER_S = 60.0  # of a busy controller
_SHORT_MIN = 10  # submitit takes a signal in the last ten minutes of a job for the end of its time
# The states of `squeue` from which no job comes back; one that is requeued or held is in none of them.
_ENDED = {"BOOT_FAIL", "CANCELLED", "COMPLETED", "DEADLINE", "FAILED", "NODE_FAIL", "OUT_OF_MEMORY", "TIMEOUT"}
_ENDED |= {"PREEMPTED", _AWAY}
_WAITING = ["squeue", "--me", "--states=PENDING", "--noheader", "--format=%F|%o"]  # with the file that was submitted
_ASK = ["squeue", "--me", "--states=all", "--array", "--noheader", "--format=%i|%T|%r"]


@dataclass
class Queue:
    """The jobs of a call in SLURM's queue. folder: in which submitit keeps its files of each, below the job's id.

    lost: the errors of jobs that ended without a result, by their places in the array.
    """

    folder: Path
    lost: dict[int, JobFailedError] = field(default_factory=dict)
    _ended: dict[str, float] = field(default_factory=dict)  # when a job without a result was first seen to have ended
    _said: str = ""
    _before: set[str] = field(default_factory=set)

    def __post_init__(self) -> None:
        """Leave out what calls before this one submitted."""
        self._before.update(self._jobs())

    def _jobs(self) -> list[str]:
        jobs = [path.parent.name for path in self.folder.glob("*/*_submitted.pkl")]
        return [job for job in jobs if job not in self._before]

    @property
    def is_refused(self) -> bool:
        """Whether SLURM has taken no job of this call."""
        return not self._jobs()

    @property
    def going(self) -> list[str]:
        """The arrays of jobs that have left no result yet."""
        return sorted({job.partition("_")[0] for job in self._jobs() if not self._result(job).exists()})

    def clean(self) -> None:
        """Remove what submitit wrote for jobs that SLURM has not taken; of the others, it has left links."""
        for file in (*self.folder.glob("*.pkl"), *self.folder.glob(".submission_file_*")):
            if not file.is_symlink():
                file.unlink()
        with suppress(OSError):  # something is in it
            self.folder.rmdir()

    def look(self) -> None:
        """Say what waits, and let submitit end when all jobs without a result are lost."""
        jobs = self._jobs()
        waited = [job for job in jobs if not self._result(job).exists()]
        try:
            asked = subprocess.run(_ASK, capture_output=True, text=True, check=True, timeout=_ANSWER_S).stdout
        except (OSError, subprocess.SubprocessError):  # the controller is away, for a while
            return
        known = {job: (state, reason) for job, state, reason in (line.split("|", 2) for line in asked.splitlines())}
        self._say(jobs, waited, known)
        now = time.monotonic()
        states = {job: known.get(job, (_AWAY,))[0] for job in waited}
        gone = [job for job, state in states.items() if state in _ENDED]
        self._ended = {job: self._ended.get(job, now) for job in gone}
        if gone and len(gone) == len(waited) and all(now - since > _PATIENCE_S for since in self._ended.values()):
            for job in gone:
                error = JobFailedError(f"SLURM ended it without a result: {states[job]}")
                self.lost[int(job.partition("_")[2] or 0)] = error  # a job alone is no array
                self._result(job).write_bytes(pickle.dumps(("error", str(error))))  # as submitit does of one that fails

    def _result(self, job: str) -> Path:
        return self.folder / job / f"{job}_0_result.pkl"

    def _say(self, jobs: list[str], waited: list[str], known: dict[str, tuple[str, str]]) -> None:
        """Say how many jobs are in which state, and why some wait, if that has changed."""
        states = Counter(known[job][0].lower() for job in waited if job in known)
        reasons = sorted({known[job][1] for job in waited if job in known and known[job][0] == "PENDING"})
        counts = ", ".join(f"{count} {state}" for state, count in sorted(states.items()))
        note = counts + (f" ({', '.join(reasons)})" if reasons else "")
        if counts and note != self._said:
            self._said = note
            say(f"SLURM job {jobs[0].partition('_')[0]}: {note}; output in {self.folder}")


def _take_back(folder: Path) -> None:
    """Cancel the jobs that a call before this one, which is gone, left waiting: this call submits them again.

    folder: in which submitit keeps the files of this call and of those before it.
    """
    asked = subprocess.run(_WAITING, capture_output=True, text=True, check=False, timeout=_ANSWER_S).stdout
    lines = [line.split("|", 1) for line in asked.splitlines()]
    if waiting := sorted({job for job, file in lines if Path(file).parent == folder.absolute()}):
        say(f"SLURM job {', '.join(waiting)} of an earlier call: what waits in the queue is cancelled, for this call")
        subprocess.run(["scancel", "--state=PENDING", *waiting], check=False, timeout=_ANSWER_S)


@contextmanager
def watching(launcher: Any, threads: int) -> Iterator[Queue]:
    """Time in which jobs that submitit submits are watched in SLURM's queue, by a thread.

    launcher: its settings. threads: of a job.

    Raises:
        ConfigError: This machine is of no cluster.
    """
    if which("srun") is None:
        raise ConfigError("hydra/launcher=slurm must be called on a SLURM cluster: there is no `srun` here")
    from unittest.mock import patch

    from submitit.slurm.slurm import SlurmInfoWatcher

    if launcher.timeout_min <= _SHORT_MIN:
        say(
            f"hydra.launcher.timeout_min={launcher.timeout_min}: a job must end {launcher.signal_delay_s} s before it "
            "(signal_delay_s); one that gives way to another counts as out of time, too, and begins again "
            f"max_num_timeout={launcher.max_num_timeout} times"
        )
    if threads > (cores := launcher.cpus_per_task or 1):
        say(f"threads={threads} share the cores of a job, hydra.launcher.cpus_per_task={cores}")
    folder = Path(launcher.submitit_folder.partition("%")[0])
    with suppress(subprocess.SubprocessError):  # the controller is away, for a while
        _take_back(folder)
    queue, is_over = Queue(folder), threading.Event()

    def watch() -> None:
        while not is_over.wait(_LOOK_S):
            queue.look()

    watcher = threading.Thread(target=watch, daemon=True)
    watcher.start()
    try:
        with patch.object(SlurmInfoWatcher, "_make_command", return_value=None):
            yield queue
    except KeyboardInterrupt:
        if going := " ".join(queue.going):
            say(f"SLURM job {going} goes on, and the same command takes over; `scancel {going}` ends it")
        raise
    finally:
        is_over.set()
        queue.clean()
