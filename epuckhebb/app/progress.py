"""How an evolution is shown while it runs: one live line on a terminal, one plain line a generation elsewhere."""

from collections.abc import Callable
from types import TracebackType

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from epuckhebb.evolution.evolve import Generation


class EvolutionProgress:
    """Shows each generation on standard error; a context manager that leaves the terminal tidy."""

    def __init__(self, generations: int, *, quiet: bool) -> None:
        """Prepare to show so many generations; say nothing if `quiet`."""
        console = Console(stderr=True, highlight=False)
        self._plain = None if console.is_terminal or quiet else console
        self._generations = generations
        self._steps, self._seconds, self._shown = 0, 0.0, 0
        self._bar = Progress(
            TextColumn("generation"),
            MofNCompleteColumn(),
            BarColumn(bar_width=20),
            TextColumn("{task.fields[told]}"),
            TimeRemainingColumn(compact=True),
            console=console,
            disable=quiet or not console.is_terminal,
        )
        self._task = self._bar.add_task("evolve", total=generations, told="compiling …")

    def __enter__(self) -> "EvolutionProgress":
        """Start to show."""
        self._bar.start()
        return self

    def show(self, generation: Generation) -> None:
        """Show a generation that has just ended."""
        self._steps += generation.robot_steps
        self._seconds += generation.seconds
        self._shown += 1
        told = (
            f"best {generation.fitness.max():.3f}  mean {generation.fitness.mean():.3f}  "
            f"{self._steps / self._seconds / 1e6:.2f} M robot-steps/s"
        )
        self._bar.update(self._task, completed=generation.number + 1, told=told)
        if self._plain is not None:
            left = self._seconds / self._shown * (self._generations - generation.number - 1)
            self._plain.print(f"generation {generation.number + 1}/{self._generations}  {told}  {left:.0f} s left")

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Stop showing."""
        self._bar.stop()


class StepProgress:
    """Shows the steps of a long job on standard error: a bar on a terminal, a line a step elsewhere."""

    def __init__(self, *, quiet: bool) -> None:
        """Prepare to show; say nothing if `quiet`."""
        self._console = Console(stderr=True, highlight=False)
        self._quiet = quiet
        self._bar = Progress(
            MofNCompleteColumn(),
            BarColumn(bar_width=20),
            TextColumn("{task.description}"),
            TimeRemainingColumn(compact=True),
            console=self._console,
            disable=quiet or not self._console.is_terminal,
        )

    def __enter__(self) -> "StepProgress":
        """Start to show."""
        self._bar.start()
        return self

    def begin(self, total: int) -> Callable[[str], None]:
        """Announce so many steps; call what is returned with the name of each as it begins."""
        task = self._bar.add_task("", total=total)
        begun = 0

        def step(name: str) -> None:
            nonlocal begun
            self._bar.update(task, completed=begun, description=name)
            begun += 1
            if not self._quiet and not self._console.is_terminal:
                self._console.print(f"{begun}/{total}  {name}")

        return step

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Stop showing."""
        self._bar.stop()
