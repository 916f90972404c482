"""How much of `epuckhebb evolve` is spent inside steps, in per cent of the process and of its generations; CPU time."""

import importlib
import sys
import time
from types import SimpleNamespace
from typing import Any

from epuckhebb.cli import commands
from epuckhebb.evolution.evolve import evolve
from epuckhebb.tmaze import batch, simulator

command: Any = importlib.import_module("epuckhebb.runs.evolve")
inside: list[float] = []
generations: list[float] = []
inside_generations: list[float] = []


def timed(steps):
    def timed_steps(*arguments):
        began = time.thread_time()
        try:
            return steps(*arguments)
        finally:
            inside.append(time.thread_time() - began)

    return timed_steps


class TimedKernel:
    """A kernel, timed however it is called: by numba, or, from its second call on, as the machine code itself."""

    def __init__(self, kernel):
        self._kernel, self._call = kernel, timed(kernel)

    def __call__(self, *arguments):
        """Run it; numba looks at the types."""
        return self._call(*arguments)

    @property
    def overloads(self):
        """Its machine code, by the types it is for."""
        return {
            types: SimpleNamespace(entry_point=timed(made.entry_point))
            for types, made in self._kernel.overloads.items()
        }


def timed_kernel_of(*parts, **more):
    return TimedKernel(lifetime_kernel(*parts, **more))


def timed_evolve(*arguments, **named):
    """The same, noting what each generation takes, whole and inside steps; after them the champion lives once more."""
    began, steps = time.process_time(), len(inside)
    for generation in evolve(*arguments, **named):
        generations.append(time.process_time() - began)
        inside_generations.append(sum(inside[steps:]))
        yield generation
        began, steps = time.process_time(), len(inside)


batch.load_kernel()
lifetime_kernel, simulator.lifetime_kernel, command.evolve = (
    simulator.lifetime_kernel,
    timed_kernel_of,
    timed_evolve,
)
commands.app(["evolve", "--quiet", *sys.argv[1:]], standalone_mode=False)
print(f"{100 * sum(inside) / time.process_time():.0f} {100 * sum(inside_generations) / sum(generations):.0f}")
