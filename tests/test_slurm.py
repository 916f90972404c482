"""SLURM's queue as a program that answers `squeue` has it: what waits, and what is lost."""

import logging
import os
import pickle
import signal
from contextlib import suppress
from types import SimpleNamespace

import pytest

from epuckhebb.runs import slurm
from epuckhebb.runtime import ConfigError, refusing


@pytest.fixture
def queue(tmp_path, monkeypatch):
    """A queue of three jobs; `squeue` prints the file `queue`, and nothing is waited for."""
    monkeypatch.delenv("EPUCKHEBB_QUIET", raising=False)
    monkeypatch.setattr(slurm, "_PATIENCE_S", -1.0)
    monkeypatch.setattr(slurm, "_ASK", ["cat", str(tmp_path / "queue")])
    found = slurm.Queue(tmp_path / ".submitit")
    for job in ("7_0", "7_1", "7_2"):
        (tmp_path / ".submitit" / job).mkdir(parents=True)
        (tmp_path / ".submitit" / job / f"{job}_submitted.pkl").touch()
    return found


def answer(queue, *lines):
    (queue.folder.parent / "queue").write_text("".join(f"{line}\n" for line in lines))
    queue.look()


def end(queue, job):
    (queue.folder / job / f"{job}_0_result.pkl").write_bytes(b"")


def test_what_waits_is_said_with_its_reason_once(queue, capsys):
    waits = "PENDING|PartitionTimeLimit"
    for _ in range(2):
        answer(queue, "7_0|RUNNING|None", f"7_1|{waits}", f"7_2|{waits}", "9|RUNNING|None")
    assert capsys.readouterr().err.count("2 pending, 1 running (PartitionTimeLimit)") == 1


@pytest.mark.parametrize("line", ["7_1|CANCELLED|None", "7_1|NODE_FAIL|None", "9|RUNNING|None"])
def test_a_lost_job_is_waited_for_until_the_others_are_through(queue, line):
    end(queue, "7_0")
    answer(queue, line, "7_2|RUNNING|None")
    assert not queue.lost
    end(queue, "7_2")
    answer(queue, line)
    assert list(queue.lost) == [1]
    kind, _ = pickle.loads((queue.folder / "7_1" / "7_1_0_result.pkl").read_bytes())
    assert kind == "error"


def test_a_job_that_waits_again_is_not_lost(queue):
    for job in ("7_0", "7_2"):
        end(queue, job)
    answer(queue, "7_1|REQUEUED|None")
    answer(queue, "7_1|PENDING|BeginTime")
    assert not queue.lost


def test_a_controller_that_does_not_answer_loses_nothing(queue):
    queue.look()
    assert not queue.lost


def test_what_an_earlier_call_left_waiting_is_taken_back(queue, tmp_path, monkeypatch):
    lines = [f"{job}|{folder}/.submission_file.sh\n" for job, folder in (("7", queue.folder), ("8", tmp_path))]
    (tmp_path / "waiting").write_text("".join([*lines, lines[0]]))
    (tmp_path / "scancel").write_text(f'#!/bin/sh\necho "$@" > {tmp_path}/cancelled\n')
    (tmp_path / "scancel").chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path), prepend=os.pathsep)
    monkeypatch.setattr(slurm, "_WAITING", ["cat", str(tmp_path / "waiting")])
    slurm._take_back(queue.folder)
    assert (tmp_path / "cancelled").read_text() == "--state=PENDING 7\n"


@pytest.mark.usefixtures("queue")
def test_a_job_that_is_lost_alone_is_the_first(tmp_path, monkeypatch):
    alone = slurm.Queue(tmp_path / "alone")
    (alone.folder / "9").mkdir(parents=True)
    (alone.folder / "9" / "9_submitted.pkl").touch()
    monkeypatch.setattr(slurm, "_ASK", ["echo", "9|CANCELLED|None"])
    alone.look()
    assert list(alone.lost) == [0]


def test_a_machine_that_is_of_no_cluster_is_refused(tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(ConfigError, match="srun"), slurm.watching(None, 1):
        pass


@pytest.mark.parametrize(("minutes", "threads", "key"), [(10, 1, "timeout_min"), (11, 4, "cpus_per_task"), (11, 1, "")])
@pytest.mark.usefixtures("queue")
def test_a_short_limit_and_too_few_cores_are_said(tmp_path, monkeypatch, capsys, minutes, threads, key):
    """Submitit takes any signal in the last ten minutes of a job for the end of its time."""
    environment = pytest.importorskip("submitit.core.job_environment")
    handler = environment.SignalHandler(None, None, SimpleNamespace(_timeout_min=minutes))
    handler._logger = logging.getLogger()
    assert handler.has_timed_out() == (key == "timeout_min")
    monkeypatch.setattr(slurm, "which", str)
    monkeypatch.setattr(slurm, "_WAITING", ["true"])
    limits = {"timeout_min": minutes, "signal_delay_s": 120, "max_num_timeout": 0, "cpus_per_task": None}
    with slurm.watching(SimpleNamespace(submitit_folder=f"{tmp_path}/%j", **limits), threads):
        pass
    said = capsys.readouterr().err.splitlines()
    assert len(said) == bool(key)
    assert all(f"hydra.launcher.{key}=" in line for line in said)


@pytest.mark.parametrize("ended", [["7_0"], ["7_0", "7_1", "7_2"]])
def test_what_goes_on_after_an_interruption_is_said_with_how_to_end_it(queue, tmp_path, monkeypatch, capsys, ended):
    pytest.importorskip("submitit")
    monkeypatch.setattr(slurm, "which", str)
    monkeypatch.setattr(slurm, "_WAITING", ["true"])
    jobs = {job.name: job.rename(tmp_path / job.name) for job in queue.folder.iterdir()}
    launcher = SimpleNamespace(submitit_folder=f"{queue.folder}/%j", timeout_min=60, cpus_per_task=1)
    with suppress(KeyboardInterrupt), slurm.watching(launcher, 1) as watched:
        for name, job in jobs.items():  # submitted now
            job.rename(queue.folder / name)
        for job in ended:
            end(watched, job)
        raise KeyboardInterrupt
    assert ("scancel 7" in capsys.readouterr().err) == (len(ended) < 3)


def test_a_signal_that_comes_while_something_is_read_is_its_own_reason():
    """As submitit does where a job has run out of time; what is read is not at fault."""

    def end(*_):
        raise RuntimeError("timed out too many times")

    before = signal.signal(signal.SIGUSR2, end)
    try:
        with pytest.raises(RuntimeError), refusing(lambda _: "the file cannot be read", Exception):
            signal.raise_signal(signal.SIGUSR2)
    finally:
        signal.signal(signal.SIGUSR2, before)
