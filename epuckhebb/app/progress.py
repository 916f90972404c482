"""What is shown on standard error while the program works: a live bar on a terminal, plain lines elsewhere."""

import os
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from epuckhebb.app.terminal import Terminal
from epuckhebb.evolution.evolve import Generation

_QUIET = "EPUCKHEBB_QUIET"  # environment variable, so that the workers of a launcher see it too
_EVERY_S = 0.5


def be_quiet(quiet: bool) -> None:
    """Decide whether this call and its workers print anything but results and errors."""
    os.environ[_QUIET] = "1" if quiet else ""


def is_quiet() -> bool:
    """Whether this call was asked to print nothing."""
    return bool(os.environ.get(_QUIET))


def say(note: str) -> None:
    """Tell the user something on standard error, unless this call is quiet."""
    if not is_quiet():
        Terminal(stderr=True).print(note, markup=False, soft_wrap=True)


@contextmanager
def saying_if_slow(note: str, after_s: float = 2.0) -> Iterator[None]:
    """Tell somebody at a terminal if what is done meanwhile takes longer than usual."""
    timer = threading.Timer(after_s, say, [note])
    timer.daemon = True
    if Terminal(stderr=True).is_terminal:
        timer.start()
    try:
        yield
    finally:
        timer.cancel()


class _Bar(Progress):
    """A bar of so many steps on a terminal; a context manager that leaves the terminal tidy."""

    def __init__(self, what: str, total: float, *, quiet: bool = False) -> None:
        console = Terminal(stderr=True)
        quiet = quiet or is_quiet()
        count = (TextColumn(what), MofNCompleteColumn()) if what else ()
        columns = *count, BarColumn(bar_width=20), TextColumn("{task.description}")
        disable = quiet or not console.is_terminal
        super().__init__(*columns, TimeRemainingColumn(compact=True), console=console, disable=disable)
        self._plain = None if console.is_terminal or quiet else console
        self._total, self._task = total, self.add_task("", total=total)

    def put(self, completed: float, told: str) -> None:
        """Show how many steps are completed, and what is told beside the bar."""
        self.update(self._task, completed=completed, description=told)


class EvolutionProgress(_Bar):
    """Shows each generation of an evolution."""

    def __init__(self, generations: int, *, quiet: bool) -> None:
        """Prepare to show so many generations; say nothing if `quiet`."""
        super().__init__("generation", generations, quiet=quiet)
        self._steps, self._seconds, self._shown = 0, 0.0, 0
        self.put(0, "compiling …")

    def show(self, generation: Generation) -> None:
        """Show a generation that has just ended."""
        self._steps += generation.robot_steps
        self._seconds += generation.seconds
        self._shown += 1
        done = generation.number + 1
        told = (
            f"best {generation.fitness.max():.3f}  mean {generation.fitness.mean():.3f}  "
            f"{self._steps / self._seconds / 1e6:.2f} M robot-steps/s"
        )
        self.put(done, told)
        if self._plain is not None:
            left = self._seconds / self._shown * (self._total - done)
            self._plain.print(f"generation {done}/{self._total}  {told}  {left:.0f} s left")


class TaskProgress(_Bar):
    """Shows which task of a study is at work, how far it is, and how long all of them will take."""

    def __init__(self, sizes: Sequence[float], *, quiet: bool = False) -> None:
        """Prepare to show tasks of these sizes, 0 for one that is done already; say nothing if `quiet`."""
        super().__init__("", sum(sizes), quiet=quiet)
        self._sizes, self._number, self._name = sizes, 0, ""
        self._began = time.monotonic()

    def show(self, number: int, name: str) -> None:
        """Show the task of this number, from 0, as it begins."""
        self._number, self._name = number, name
        self.within(0.0, "")
        if self._plain is not None:
            done = sum(self._sizes[:number])
            left = (time.monotonic() - self._began) * (self._total - done) / done if done else 0.0
            self._plain.print(f"{number + 1}/{len(self._sizes)}  {name}" + (f"  {left:.0f} s left" if left else ""))

    def within(self, share: float, told: str) -> None:
        """Show how far the task at work is, from 0 to 1, and what is told of it."""
        done = sum(self._sizes[: self._number]) + share * self._sizes[self._number]
        self.put(done, f"{self._number + 1}/{len(self._sizes)}  {self._name}  {told}")


@contextmanager
def counting(total: int, count: Callable[[], tuple[int, int]]) -> Iterator[None]:
    """Show on a terminal how many of so many jobs are done, whatever launcher runs them; a thread counts them.

    Args:
        total: The number of jobs.
        count: A function that says how many jobs are done, and how many have failed.
    """
    bar, ended = _Bar("job", total), threading.Event()

    def look() -> None:
        done, failed = count()
        bar.put(done + failed, f"{failed} failed" if failed else "")

    def watch() -> None:
        while not ended.wait(_EVERY_S):
            look()

    if bar.disable:
        yield
        return
    watcher = threading.Thread(target=watch, daemon=True)
    with bar:
        watcher.start()
        try:
            yield
        finally:
            ended.set()
            watcher.join()
            look()
