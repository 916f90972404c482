"""What is shown on standard error while the program works: a bar, or plain lines where none can be shown."""

import os
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext, suppress
from typing import IO, Self

_QUIET = "EPUCKHEBB_QUIET"  # environment variable, so that the workers of a launcher see it too
_said: set[str] = set()
_SLOW_S = 2.0  # after which something takes longer than usual
_EVERY_S = 0.5  # between looks at how many jobs are done
_LINE_S = 30.0  # between lines, where there is not one for each step
_FEW = 20  # jobs, of which each gets a line
_LOOK = "{desc} {n_fmt}/{total_fmt} {bar:20}{postfix}  {remaining}"  # of a bar


def be_quiet(quiet: bool) -> None:
    """Decide whether this call and its workers print anything but results and errors."""
    os.environ[_QUIET] = "1" if quiet else ""


def is_quiet() -> bool:
    """Whether this call was asked to print nothing."""
    return bool(os.environ.get(_QUIET))


def say(note: str) -> None:
    """Print a note on standard error, unless this call is quiet."""
    if is_quiet():
        return
    with sys.modules["tqdm"].tqdm.external_write_mode(sys.stderr) if "tqdm" in sys.modules else nullcontext():
        _print(note)  # above a bar


def _print(line: str) -> None:
    """Print a line on standard error; a reader that stops does not stop the work."""
    try:
        print(line, file=sys.stderr, flush=True)
    except BrokenPipeError:
        discard_output(sys.stderr)


def discard_output(stream: IO[str]) -> None:
    """Let nothing come of what else is written to a stream that nobody reads, at the end of the program too."""
    with suppress(OSError, ValueError):  # a stream of a test has no number
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def say_once(note: str) -> None:
    """Print a note once for all jobs of this process."""
    if note not in _said and not is_quiet():
        _said.add(note)
        say(note)


@contextmanager
def saying_if_slow(note: str) -> Iterator[None]:
    """Print a note if what is done meanwhile takes longer than usual."""
    timer = threading.Timer(_SLOW_S, say, [note])
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


class Bar:
    """A bar of so many steps on a terminal or in a notebook, which a context manager closes; plain lines elsewhere.

    Of lines there is one for each step; if not `each`, at most one in half a minute.
    """

    def __init__(self, what: str, total: int, *, quiet: bool = False, each: bool = True) -> None:
        from tqdm import tqdm

        quiet = quiet or is_quiet()
        shown = sys.stderr.isatty() or "ipykernel" in sys.modules  # in a terminal or a notebook, where a bar can move
        self.bar = tqdm(desc=what, total=total, bar_format=_LOOK, file=sys.stderr, disable=quiet or not shown)
        self._is_plain = not (shown or quiet)
        self._what, self._total, self._each, self._line = what, total, each, time.monotonic()
        self._first: tuple[float, int] | None = None  # when the first step was shown, and which

    def __enter__(self) -> Self:
        """The bar itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Leave the bar as it is, and the cursor below it."""
        self.bar.close()

    def show(self, done: int, text: str, *, news: bool = True) -> None:
        """Show how many steps are done, and a text beside the bar. news: whether one has ended since the last call."""
        now = time.monotonic()
        if self._first is None:
            self._first = now, done
            self.bar.initial = done  # the time that is left follows from the steps of this call
        self.bar.n = done
        self.bar.set_postfix_str(text)
        began, before = self._first
        if self._is_plain and ((self._each and news) or now - self._line >= _LINE_S):
            self._line = now
            seconds, steps = now - began, done - before
            left = f"{seconds / steps * (self._total - done):.0f} s left" if steps and news else ""
            _print("  ".join(filter(None, (f"{self._what} {done}/{self._total}", text, left))))


def track(what: str, moments: Sequence[float]) -> Iterator[float]:
    """The moments one after the other, beside a bar."""
    with Bar(what, len(moments), each=False) as bar:
        for number, moment in enumerate(moments):
            yield moment
            bar.show(number + 1, "")


@contextmanager
def counting(total: int, count: Callable[[], tuple[int, int]]) -> Iterator[None]:
    """Show how many of so many jobs are done, whatever launcher runs them; a thread counts done and failed ones."""
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
