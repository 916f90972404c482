"""How a call ends before its time: with an error that is told in one message, or by Ctrl-C."""

import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

JOB_FAILED, USAGE, INTERRUPTED = 1, 2, 130  # exit codes
_PATIENCE_S = 1.5

at_work: list[Callable[[], str]] = []  # for each folder at work: closes it, and returns what an interruption leaves


class ConfigError(ValueError):
    """A value, a file or a folder cannot be used; the message names it, what was given and what is allowed."""


class JobFailedError(RuntimeError):
    """A run began and could not be finished; the message says which and why."""


@contextmanager
def interruptible() -> Iterator[None]:
    """Make Ctrl-C end the program within two seconds, whatever its threads are busy with.

    Where tidying up takes long (a block of long lifetimes, a compiler), the process ends without it. That is as safe
    as being killed, which is safe at any moment: every file of a run is whole or not there.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    timer = threading.Timer(_PATIENCE_S, _leave)
    timer.daemon = True

    def stop(number: int, frame: FrameType | None) -> None:
        if timer.ident is None:
            timer.start()
        signal.default_int_handler(number, frame)

    before = signal.signal(signal.SIGINT, stop)
    try:
        yield
    finally:
        timer.cancel()
        signal.signal(signal.SIGINT, before)


def interrupted(told: str) -> str:
    """The message of an interruption."""
    return f"interrupted: {told}" if told else "interrupted"


def _leave() -> None:
    try:
        told = [close() for close in list(at_work)]
        show_cursor = "\x1b[?25h" if sys.stderr.isatty() else ""  # a live progress bar hides it
        sys.stderr.write(f"{show_cursor}\nError: {interrupted(next(filter(None, told), ''))}\n")
        sys.stderr.flush()
    finally:
        os._exit(INTERRUPTED)
