"""What is shown on standard error while the program works: a live bar on a terminal, plain lines elsewhere."""

import os
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from epuckhebb.runtime.console import Terminal

_QUIET = "EPUCKHEBB_QUIET"  # environment variable, so that the workers of a launcher see it too
_said: set[str] = set()
_SLOW_S = 2.0  # after which something takes longer than usual
_EVERY_S = 0.5  # between looks at how many jobs are done
_LINE_S = 30.0  # between lines, where there is not one for each step
_FEW = 20  # jobs, of which each gets a line


def be_quiet(quiet: bool) -> None:
    """Decide whether this call and its workers print anything but results and errors."""
    os.environ[_QUIET] = "1" if quiet else ""


def is_quiet() -> bool:
    """Whether this call was asked to print nothing."""
    return bool(os.environ.get(_QUIET))


def say(note: str) -> None:
    """Print a note on standard error, unless this call is quiet."""
    if not is_quiet():
        Terminal(stderr=True).print(note, markup=False, soft_wrap=True)


def say_once(note: str) -> None:
    """Print a note once for all jobs of this process."""
    if note not in _said and not is_quiet():
        _said.add(note)
        say(note)


@contextmanager
def saying_if_slow(note: str) -> Iterator[None]:
    """Print a note at a terminal if what is done meanwhile takes longer than usual."""
    timer = threading.Timer(_SLOW_S, say, [note])
    timer.daemon = True
    if Terminal(stderr=True).is_watched:
        timer.start()
    try:
        yield
    finally:
        timer.cancel()


class Bar(Progress):
    """A bar of so many steps on a terminal, which a context manager leaves tidy; plain lines elsewhere.

    Of lines there is one for each step; if not `each`, at most one in half a minute, so that a notebook keeps short.
    """

    def __init__(self, what: str, total: int, *, quiet: bool = False, each: bool = True) -> None:
        console = Terminal(stderr=True)
        quiet = quiet or is_quiet()
        columns = TextColumn(what), MofNCompleteColumn(), BarColumn(bar_width=20), TextColumn("{task.description}")
        disable = quiet or not console.is_watched
        super().__init__(*columns, TimeRemainingColumn(compact=True), console=console, disable=disable)
        self._plain = None if console.is_watched or quiet else console
        self._what, self._each, self._line = what, each, time.monotonic()
        self._first: tuple[float, int] | None = None  # when the first step was shown, and which
        self._total, self._task = total, self.add_task("", total=total)

    def show(self, done: int, text: str, *, news: bool = True) -> None:
        """Show how many steps are done, and a text beside the bar. news: whether one has ended since the last call."""
        self.update(self._task, completed=done, description=text)
        now = time.monotonic()
        began, before = self._first = self._first or (now, done)
        if self._plain is not None and ((self._each and news) or now - self._line >= _LINE_S):
            self._line = now
            seconds, steps = now - began, done - before
            left = f"{seconds / steps * (self._total - done):.0f} s left" if steps and news else ""
            self._plain.print("  ".join(filter(None, (f"{self._what} {done}/{self._total}", text, left))))


@contextmanager
def counting(total: int, count: Callable[[], tuple[int, int]]) -> Iterator[None]:
    """Show how many of so many jobs are done, whatever launcher runs them; a thread counts them.

    Args:
        total: The number of jobs.
        count: A function that says how many jobs are done, and how many have failed.
    """
    if is_quiet():
        yield
        return
    bar, ended, seen = Bar("job", total, each=total <= _FEW), threading.Event(), 0

    def look() -> None:
        nonlocal seen
        done, failed = count()
        news, seen = done + failed > seen, done + failed
        bar.show(seen, f"{failed} failed" if failed else "", news=news)

    def watch() -> None:
        while not ended.wait(_EVERY_S):
            look()

    watcher = threading.Thread(target=watch, daemon=True)
    with bar:
        watcher.start()
        try:
            yield
        finally:
            ended.set()
            watcher.join()
            look()
