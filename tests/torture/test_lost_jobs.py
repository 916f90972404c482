"""Forty evolutions on a real SLURM that loses jobs at random moments: the same command ends with the same bytes."""

import os
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path

import pytest
from cases import done

pytestmark = [pytest.mark.slurm, pytest.mark.filterwarnings("default")]

LOSSES, DEADLINE_S = 25, 1500
# A queue that is looked at often, and a job that is lost sooner than on a busy cluster.
PROGRAM = (
    "from epuckhebb.runs import slurm; slurm._LOOK_S, slurm._PATIENCE_S = 1.0, 5.0; "
    "from epuckhebb.__main__ import main; main()"
)
SMALL = ["ga.population=10", "ga.elites=2", "ga.loops=1", "ga.generations=20", "lifetime.duration_s=10"]
EVOLVE = ["evolve", "-m", "seed=range(1,41)", *SMALL, "figures=none"]
ON_SLURM = [*EVOLVE, "hydra/launcher=slurm", "hydra.launcher.mem_gb=1", "hydra.sweep.dir=out"]


def ask(*words):
    """What a program of SLURM's prints; nothing where what it names has just ended."""
    return subprocess.run(words, capture_output=True, text=True, check=False).stdout.split()


def queued(state):
    """The ids of the jobs in a state."""
    return ask("squeue", "--me", "--array", "--noheader", "--format=%i", f"--states={state}")


def processes(job):
    """The Python processes of a job."""
    found = []
    alone = ask("squeue", "--noheader", "--format=%A", f"--jobs={job}")  # its id that is not of an array
    for pid in ask("scontrol", "listpids", *alone)[5::5]:  # below a line of the names of five columns
        if Path(f"/proc/{pid}/cmdline").exists():
            words = Path(f"/proc/{pid}/cmdline").read_bytes().split(b"\0")
            found += [int(pid)] if words[0] == sys.executable.encode() else []
    return found


class Losses:
    """What happens to jobs on a cluster, drawn by chance."""

    def __init__(self, chance):
        self.chance, self.count = chance, Counter()
        self.node = ask("sinfo", "--noheader", "--format=%n")[0]

    def happen(self, command):
        """Let one of them happen. command: the process that waits for the jobs."""
        name = self.chance.choice(["kill", "cancel", "requeue", "drain", "lose_node", "command"])
        happened = command.kill() if name == "command" else getattr(self, name)()
        self.count[name] += happened is not False

    def _one(self, *states):
        jobs = [job for state in states for job in queued(state)]
        return self.chance.choice(jobs) if jobs else None

    def kill(self):
        """A process of a job is killed, as by too little memory."""
        job = self._one("RUNNING")
        killed = processes(job) if job else []
        for pid in killed:
            os.kill(pid, signal.SIGKILL)
        return bool(killed)

    def cancel(self):
        """Someone cancels a job, at work or not."""
        job = self._one("RUNNING", "PENDING")
        return bool(job) and not subprocess.run(["scancel", job], check=False).returncode

    def requeue(self):
        """A job gives way to another one."""
        job = self._one("RUNNING")
        return bool(job) and not subprocess.run(["scontrol", "requeue", job], check=False).returncode

    def drain(self):
        """The node takes no new job for a while."""
        self._node("drain")
        time.sleep(self.chance.uniform(1, 5))
        self._node("resume")

    def lose_node(self):
        """The node is lost, with the jobs on it, and comes back."""
        self._node("down")
        time.sleep(self.chance.uniform(0, 2))
        self._node("resume")

    def _node(self, state):
        change = ["scontrol", "update", f"nodename={self.node}", f"state={state}", "reason=torture"]
        subprocess.run(change, check=state != "resume")  # a node that is well refuses to resume


def results(folder):
    """The bytes of the tables, champions and checkpoints that a multirun left."""
    found = [file for pattern in ("*.csv", "*.npz") for file in folder.rglob(pattern)]
    return {str(file.relative_to(folder)): file.read_bytes() for file in found}


def start():
    return subprocess.Popen([sys.executable, "-c", PROGRAM, *ON_SLURM], start_new_session=True)


@pytest.mark.usefixtures("here")
def test_forty_evolutions_on_a_cluster_that_loses_jobs_end_with_the_same_bytes(chance):
    losses, began, calls = Losses(chance), time.monotonic(), 1
    command = start()
    try:
        while command.poll() != 0:
            assert time.monotonic() - began < DEADLINE_S, losses.count
            if command.poll() is not None:
                assert command.returncode in (1, -signal.SIGKILL)
                command, calls = start(), calls + 1
            time.sleep(chance.uniform(2, 8))
            if losses.count.total() >= LOSSES:
                continue
            losses.happen(command)
    finally:
        command.kill()
        command.wait()
        subprocess.run(["scancel", "--me"], check=False)
    print(f"{calls} calls, {time.monotonic() - began:.0f} s, {dict(losses.count)}")
    done(*EVOLVE, "hydra/launcher=joblib", "hydra.sweep.dir=alone")
    print(f"{time.monotonic() - began:.0f} s with the undisturbed run")
    found, expected = results(Path("out")), results(Path("alone"))
    assert sum(name.endswith("champion.npz") for name in expected) == 40
    assert found == expected
    shutil.rmtree("out")
