"""One bar over all jobs of a sweep, whatever launcher runs them: a thread that looks at their folders."""

import json
import threading
from pathlib import Path
from types import TracebackType

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

_EVERY_S = 0.5


class JobsProgress:
    """Shows on standard error, if that is a terminal, how many of the awaited runs are there; a context manager."""

    def __init__(self, folder: Path, awaited: set[str], attempts: str, *, quiet: bool) -> None:
        """Prepare to watch.

        folder: of the sweep. awaited: names of the runs that will appear in it. attempts: pattern of the folders of
        jobs that are at work or have failed. quiet: show nothing.
        """
        self._folder, self._awaited, self._attempts = folder, awaited, attempts
        console = Console(stderr=True, highlight=False)
        self._shown = console.is_terminal and not quiet
        self._bar = Progress(
            TextColumn("job"),
            MofNCompleteColumn(),
            BarColumn(bar_width=20),
            TextColumn("{task.fields[failed]}"),
            TimeRemainingColumn(compact=True),
            console=console,
        )
        self._task = self._bar.add_task("sweep", total=len(awaited), failed="")
        self._ended = threading.Event()
        self._watcher = threading.Thread(target=self._watch, daemon=True)

    def __enter__(self) -> "JobsProgress":
        """Start to watch."""
        if self._shown:
            self._bar.start()
            self._watcher.start()
        return self

    def count(self) -> tuple[int, int]:
        """How many jobs are done, and how many have failed."""
        done = len(self._awaited & {path.name for path in self._folder.iterdir()})
        return done, sum(_has_failed(attempt) for attempt in self._folder.glob(self._attempts))

    def _watch(self) -> None:
        while not self._ended.wait(_EVERY_S):
            self._show()

    def _show(self) -> None:
        done, failed = self.count()
        self._bar.update(self._task, completed=done + failed, failed=f"{failed} failed" if failed else "")

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Stop watching."""
        if self._shown:
            self._ended.set()
            self._watcher.join()
            self._show()
            self._bar.stop()


def _has_failed(attempt: Path) -> bool:
    try:
        return bool(json.loads((attempt / "status.json").read_text())["state"] == "failed")
    except (OSError, ValueError):
        return False
