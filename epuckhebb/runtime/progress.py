"""What is shown on standard error while the program works: notes and bars."""

import os
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from datetime import timedelta
from typing import TYPE_CHECKING, Any

from epuckhebb.runtime.errors import refusing

if TYPE_CHECKING:
    from tqdm import tqdm

_QUIET = "EPUCKHEBB_QUIET"  # environment variable, so that the workers of a launcher see it too
_EVERY_S = 0.5  # between looks at how many jobs are done
_LOG_S = 30.0  # between bars where none can move
_SOON_S = 0.8  # after which a reader wants to know what takes time
_LOOK = "{desc} {n_fmt}/{total_fmt} {bar:20}{postfix}  {remaining}"  # of a bar


def be_quiet(quiet: bool) -> None:
    """Decide whether this call and its workers print anything but results and errors."""
    os.environ[_QUIET] = "1" if quiet else ""


def say(note: str) -> None:
    """Print a note on standard error, unless this call is quiet."""
    if os.environ.get(_QUIET):
        return
    with sys.modules["tqdm"].tqdm.external_write_mode(sys.stderr) if "tqdm" in sys.modules else nullcontext():
        print(note, file=sys.stderr, flush=True)  # above a bar


@contextmanager
def working(note: str) -> Iterator[None]:
    """Time in which something is done, which a note says if it is not over soon."""
    timer = threading.Timer(_SOON_S, say, [note])
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


@contextmanager
def compiling() -> Iterator[None]:
    """Time in which kernels are loaded or compiled; what cannot be is a ConfigError."""
    with working("Compiling: some ten seconds at the first start, less later."), refusing():
        yield


def bar(what: str, total: int, done: int = 0, *, quiet: bool = False) -> "tqdm[Any]":
    """A bar of so many steps on standard error, which a context manager closes; in a log, one in half a minute."""
    from tqdm import tqdm

    rarely = {} if sys.stderr.isatty() or "ipykernel" in sys.modules else {"mininterval": _LOG_S, "delay": _LOG_S}
    hidden = quiet or bool(os.environ.get(_QUIET))
    look = {"bar_format": _LOOK, "disable": hidden, **rarely}
    return tqdm(desc=what, total=total, initial=done, miniters=1, **look)


@contextmanager
def counting(total: int, ends: Callable[[], Iterator[tuple[str, str]]]) -> Iterator[None]:
    """Show how many of so many jobs have ended, and the time left, whatever launcher does them; a thread looks.

    Where a bar cannot move, each job that ends has a line. ends: gives the names and states of those that have ended
    since it was called last.
    """
    ended, began, is_terminal = threading.Event(), time.monotonic(), sys.stderr.isatty()
    count, others = 0, dict[str, int]()

    def watch() -> None:
        while not ended.wait(_EVERY_S):
            look()

    with bar("job", total, quiet=not is_terminal) as shown:

        def look() -> None:
            nonlocal count
            for name, state in ends():
                count += 1
                if state != "done":
                    others[state] = others.get(state, 0) + 1
                seconds = (time.monotonic() - began) / count * (total - count)
                if is_terminal:
                    shown.set_postfix_str(
                        ", ".join(f"{number} {word}" for word, number in others.items()), refresh=False
                    )
                    shown.update()
                else:
                    left = f"; {timedelta(seconds=round(seconds))} left" if count < total else ""
                    say(f"job {count} of {total} {state}: {name}{left}")

        watcher = threading.Thread(target=watch, daemon=True)
        watcher.start()
        try:
            yield
        finally:
            ended.set()
            watcher.join()
            look()
