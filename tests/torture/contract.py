"""What holds whatever is typed: an exit code of ours, one message, in time, and no file of the user's is touched."""

import re
import signal
import traceback
from contextlib import contextmanager

import pytest
from cases import call

from epuckhebb.runtime.errors import JOB_FAILED, USAGE
from epuckhebb.store.run import Run

BOUND_S = 60  # of one command line; the slowest compiles a kernel, perhaps on a busy machine


@contextmanager
def bounded(what, seconds=BOUND_S):
    """Fail if what is done meanwhile takes longer."""

    def fail(_, frame):
        where = "".join(traceback.format_stack(frame)[-3:])
        pytest.fail(f"longer than {seconds} s: {what}\n{where}", pytrace=False)

    before = signal.signal(signal.SIGALRM, fail)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def half_written(folder):
    """Runs that were begun and neither finished nor closed, and files beside their places."""
    states = [Run(status.parent).state for status in folder.rglob("status.json")]
    return [state for state in states if state not in ("finished", "failed")], list(folder.rglob(".*.tmp"))


def type_in(*words, seconds=BOUND_S):
    """Call the program in this process; returns click's result, of which all that must hold has been checked."""
    with bounded(words, seconds):
        result = call(*words)
    told = f"{words}\n{result.output}"
    if not isinstance(result.exception, SystemExit | None):
        told += "".join(traceback.format_exception(result.exception)[-6:])
        pytest.fail(f"a traceback: {told}", pytrace=False)
    assert result.exit_code in (0, JOB_FAILED, USAGE), told
    assert "Traceback" not in result.output, told
    assert len(re.findall("^Error: ", result.stderr, re.MULTILINE)) == (result.exit_code != 0), told
    return result
