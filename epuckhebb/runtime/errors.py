"""Defines errors, exit codes and signals: how a call ends before its time."""

import difflib
import os
import signal
import sys
import threading
import time
import traceback
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

JOB_FAILED, USAGE, INTERRUPTED = 1, 2, 130  # exit codes
_PATIENCE_S = 1.5
_LOOK_S = 0.5  # between two looks at whether the parent is there

open_folders: list[Callable[[], str]] = []  # a function for each: closes it, and returns what an interruption leaves
_asked = threading.Event()  # a signal has asked this program to end


class ConfigError(ValueError):
    """A value, a file or a folder cannot be used; the message names it, what was given and what is allowed."""


class JobFailedError(RuntimeError):
    """A run began and could not be finished; the message says which and why."""


@contextmanager
def refusing(
    message: Callable[[Any], str] = str, kinds: type[Exception] | tuple[type[Exception], ...] = ValueError
) -> Iterator[None]:
    """Turn an error of these kinds into a `ConfigError`, whose message is made of it."""
    try:
        yield
    except ConfigError:
        raise
    except kinds as error:
        if is_of_handler(error):  # SLURM's signal came meanwhile
            raise
        raise ConfigError(message(error)) from error


def did_you_mean(name: str, choices: Iterable[str]) -> str:
    """A question to put behind a message about an unknown name; nothing if no known name is like it."""
    as_written = {choice.lower(): choice for choice in choices}
    begun = [choice for choice in as_written if choice.startswith(name.lower())]
    near = begun or difflib.get_close_matches(name.lower(), as_written, n=1)
    return f". Did you mean {as_written[near[0]]}?" if near else ""


@contextmanager
def interruptible() -> Iterator[None]:
    """Make Ctrl-C, and a wish that the program end, end it within two seconds, whatever its threads are busy with.

    Where tidying up takes long (a block of long lifetimes, a compiler), the process ends without it. That is as safe
    as being killed, which is safe at any moment: every file of a run is whole or not there. A signal that is ignored,
    as `nohup` has it, stays so; so does one that comes while the program is ending. What a library makes of an
    interruption in its middle, an error of its own, is an interruption.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    timer = threading.Timer(_PATIENCE_S, _leave)
    timer.daemon = True

    def stop(number: int, frame: FrameType | None) -> None:
        if not _asked.is_set():
            _asked.set()
            timer.start()
            signal.default_int_handler(number, frame)

    handlers = {number: signal.signal(number, stop) for number in _asking()}
    try:
        yield
    except Exception as error:
        if not _asked.is_set():
            raise
        raise KeyboardInterrupt from error
    finally:
        timer.cancel()
        for number, handler in handlers.items():
            signal.signal(number, handler)
        _asked.clear()  # only now: a signal on the way out must not start the timer again


@contextmanager
def leaving(text: str) -> Iterator[None]:
    """Work of which an interruption leaves what this text says."""

    def left() -> str:
        return text

    open_folders.insert(0, left)
    try:
        yield
    except KeyboardInterrupt:
        raise KeyboardInterrupt(text) from None
    finally:
        open_folders.remove(left)


def is_interruption(error: BaseException) -> bool:
    """Whether an error comes of a signal that asked this program to end."""
    return isinstance(error, KeyboardInterrupt) or (_asked.is_set() and isinstance(error, Exception))


def reason_of_failure(error: BaseException) -> str:
    """Why work failed, for a user: a message of the program's, or that of another error behind its kind."""
    return str(error) if isinstance(error, ConfigError | JobFailedError) else f"{type(error).__name__}: {error}"


def is_of_handler(error: BaseException) -> bool:
    """Whether an error was raised by the handler of a signal, as that with which SLURM's jobs are put back in line."""
    handlers = {getattr(signal.getsignal(number), "__code__", None) for number in signal.valid_signals()}
    return any(frame.f_code in handlers for frame, _ in traceback.walk_tb(error.__traceback__))


def end_on_signals() -> None:
    """End the program at once when a signal asks for it, as long as nothing has begun and after all has ended."""
    for number in _asking():
        signal.signal(number, _leave)


def _leave(*_: object) -> None:
    """Close the folders that are open, and end the process at once."""
    try:
        left_behind = [close() for close in list(open_folders)]
        sys.stderr.write(f"\nError: {interrupted(next(filter(None, left_behind), ''))}\n")
        sys.stderr.flush()
    finally:
        os._exit(INTERRUPTED)


def _asking() -> list[int]:
    """The signals that ask this program to end: not those that it ignores, as under `nohup`."""
    numbers = (getattr(signal, name, None) for name in ("SIGINT", "SIGTERM", "SIGHUP"))  # Windows has no SIGHUP
    return [number for number in numbers if number is not None and signal.getsignal(number) is not signal.SIG_IGN]


def exit_with_parent(parent: int) -> None:
    """Let this process end when its parent does, however that ends: a worker must not outlive its parent.

    parent: the process that started this one; where the system has given this one another parent, it has ended.
    """

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(_LOOK_S)
        os._exit(INTERRUPTED)

    if "watch" not in (thread.name for thread in threading.enumerate()):
        threading.Thread(target=watch, name="watch", daemon=True).start()


def begin_worker(parent: int, folder: str) -> None:
    """Begin a worker in the folder of its parent, with which it ends: one that waits would hold the terminal."""
    os.chdir(folder)
    sys.stdout = sys.stderr  # what a user's own part prints, as in the parent
    exit_with_parent(parent)


def interrupted(left_behind: str) -> str:
    """The message of an interruption."""
    return f"interrupted: {left_behind}" if left_behind else "interrupted"
