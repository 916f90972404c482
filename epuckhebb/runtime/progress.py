"""What is shown on standard error while the program works: a live bar on a terminal, plain lines elsewhere."""

import os
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from epuckhebb.runtime.console import Terminal

_QUIET = "EPUCKHEBB_QUIET"  # environment variable, so that the workers of a launcher see it too
_said: set[str] = set()
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
def saying_if_slow(note: str, after_s: float = 2.0) -> Iterator[None]:
    """Print a note at a terminal if what is done meanwhile takes longer than usual."""
    timer = threading.Timer(after_s, say, [note])
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

    def __init__(self, what: str, total: float, *, quiet: bool = False, each: bool = True) -> None:
        console = Terminal(stderr=True)
        quiet = quiet or is_quiet()
        count = (TextColumn(what), MofNCompleteColumn()) if what else ()
        columns = *count, BarColumn(bar_width=20), TextColumn("{task.description}")
        disable = quiet or not console.is_watched
        super().__init__(*columns, TimeRemainingColumn(compact=True), console=console, disable=disable)
        self._plain = None if console.is_watched or quiet else console
        self._each, self._line = each, time.monotonic()
        self._total, self._task = total, self.add_task("", total=total)

    def put(self, done: float, text: str) -> None:
        """Show how many steps are done, and a text beside the bar."""
        self.update(self._task, completed=done, description=text)

    def say(self, line: str, *, news: bool = True) -> None:
        """Print a line where there is no terminal. news: whether a step has ended since the last."""
        now = time.monotonic()
        if self._plain is not None and ((self._each and news) or now - self._line >= _LINE_S):
            self._line = now
            self._plain.print(line)


class TaskProgress(Bar):
    """Shows which task of a study is at work, how far it is, and how long all of them will take."""

    def __init__(self, sizes: Sequence[float], *, each: bool = True) -> None:
        """Prepare to show tasks of these sizes, 0 for one that is done already."""
        super().__init__("", sum(sizes), each=each)
        self._sizes, self._number, self._name = sizes, 0, ""
        self._began = time.monotonic()

    def show(self, number: int, name: str) -> None:
        """Show the task of this number, from 0, as it begins."""
        self._number, self._name = number, name
        self.within(0.0, "")
        done = sum(self._sizes[:number])
        self.say(f"{number + 1}/{len(self._sizes)}  {name}{_left(self._began, done, self._total)}")

    def within(self, share: float, text: str) -> None:
        """Show how far the task at work is, from 0 to 1, and a text about it."""
        done = sum(self._sizes[: self._number]) + share * self._sizes[self._number]
        self.put(done, f"{self._number + 1}/{len(self._sizes)}  {self._name}  {text}")


def _left(began: float, done: float, total: float) -> str:
    """How long the rest will take; nothing before something is done, and when all is."""
    return f"  {(time.monotonic() - began) * (total - done) / done:.0f} s left" if 0 < done < total else ""


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
    bar, ended, began, seen = Bar("job", total, each=total <= _FEW), threading.Event(), time.monotonic(), 0

    def look() -> None:
        nonlocal seen
        done, failed = count()
        text = f"  {failed} failed" if failed else ""
        bar.put(done + failed, text.strip())
        news, seen = done + failed > seen, done + failed
        left = _left(began, seen, total) if news else ""  # a guess grows with a job that takes long
        bar.say(f"job {seen}/{total}{text}{left}", news=news)

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
