"""How much of `epuckhebb evolve` is spent inside steps, in per cent of the process and of its generations; CPU time."""

import sys
import time

from epuckhebb.cli import commands
from epuckhebb.evolution.evolve import evolve
from epuckhebb.runs import evolve as command
from epuckhebb.sim import batch, simulator

inside, generations = [], []


def timed_kernel_of(*parts, **more):
    live = kernel_of(*parts, **more)

    def timed_live(*arguments):
        began = time.thread_time()
        try:
            return live(*arguments)
        finally:
            inside.append(time.thread_time() - began)

    return timed_live


def timed_evolve(*arguments, **named):
    began = time.process_time()
    for generation in evolve(*arguments, **named):
        generations.append(time.process_time() - began)
        yield generation
        began = time.process_time()


batch.load_kernel()
kernel_of, simulator.kernel_of, command.evolve = simulator.kernel_of, timed_kernel_of, timed_evolve
commands.app(["evolve", "--quiet", *sys.argv[1:]], standalone_mode=False)
print(*(f"{100 * sum(inside) / whole:.0f}" for whole in (time.process_time(), sum(generations))))
