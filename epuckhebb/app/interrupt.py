"""Ctrl-C ends the program within two seconds, whatever its threads are busy with."""

import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

EXIT_CODE = 130
_PATIENCE_S = 1.5


@contextmanager
def soon() -> Iterator[None]:
    """Where tidying up after Ctrl-C takes long (a block of long lifetimes, a compiler), end the process without it.

    That is as safe as being killed, which is safe at any moment: every file of a run is whole or not there.
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


def _leave() -> None:
    from epuckhebb.app import runs

    for run in list(runs.open_runs):
        run.close_interrupted("")
    show_cursor = "\x1b[?25h" if sys.stderr.isatty() else ""  # a live progress bar hides it
    sys.stderr.write(f"{show_cursor}\nError: interrupted\n")
    sys.stderr.flush()
    os._exit(EXIT_CODE)
