"""Many lifetimes in the same world, on any number of threads; results do not depend on that number."""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from epuckhebb.controller.compiling.errors import PartError
from epuckhebb.controller.genome import make_plan
from epuckhebb.controller.network import HIDDEN, Network
from epuckhebb.controller.own_class import user_classes
from epuckhebb.controller.plasticity.control import Control, yoking
from epuckhebb.controller.plasticity.rule import NoRule
from epuckhebb.controller.plasticity.rules.paper import Paper
from epuckhebb.tmaze.block import LostRobotError, user_parts
from epuckhebb.tmaze.individual import GA_ALONE, Controller, Individual
from epuckhebb.tmaze.life import Lifetime
from epuckhebb.tmaze.outcome import Outcome
from epuckhebb.tmaze.robot import OUTPUTS, STEP_S
from epuckhebb.tmaze.samples import Samples
from epuckhebb.tmaze.scenario import Scenario
from epuckhebb.tmaze.session import Session
from epuckhebb.tmaze.simulator import Simulator

_TRIED_S = 8.0  # of a lifetime that is run twice
_LIFETIMES_PER_STAGE = 100  # that run one after the other
_SYNAPSES_PER_STAGE = 100_000  # of them all


def run_lifetimes(
    individuals: Sequence[Individual],
    scenario: Scenario,
    lifetime: Lifetime,
    threads: int = 1,
    *,
    weight_path: bool = False,
) -> list[tuple[Outcome, Samples]]:
    """Run many lifetimes in the same scenario; outcomes come in the order of `individuals`, whatever `threads`.

    weight_path: whether the total change of the weights is measured; it always is beside a yoked control. Samples have
    length 0 where a lifetime is not recorded.

    Raises:
        NotCompiledError: a rule does not compile.
        LostRobotError: a pose or a weight stopped being finite; the message says whose and when.
    """
    rules = [individual.controller.rule for individual in individuals if not individual.controller.adaptation.acts]
    fallback_rule = next((rule for rule in rules if not isinstance(rule, NoRule) and not rule.evolved), Paper())

    kept = int(weight_path or any(individual.controller.rule.control is not Control.none for individual in individuals))

    simulators = [Simulator(scenario, lifetime, fallback_rule, kept)]  # those that no thread uses
    sensors, can_place = user_classes(scenario.robot.sensors), scenario.physics.placer() is not None
    can_share = can_place and len(simulators[0].phases) == 1 and scenario.put is None and not sensors
    alike: dict[object, list[int]] = {}
    for number, individual in enumerate(individuals):
        is_recorded = individual.record and lifetime.record_every
        is_alone = not can_share or is_recorded or individual.previous or individual.master
        shared = individual.controller, individual.network, individual.signs, individual.nominal
        kind = *map(id, shared), individual.side, individual.start if scenario.task.has_trials else None
        alike.setdefault(number if is_alone else kind, []).append(number)
    synapses = max((individual.network.synapses for individual in individuals), default=1)
    size = max(1, min(_LIFETIMES_PER_STAGE, _SYNAPSES_PER_STAGE // synapses, -(-len(individuals) // threads)))
    blocks = [numbers[first : first + size] for numbers in alike.values() for first in range(0, len(numbers), size)]

    def run_block(block: list[int]) -> tuple[list[Outcome], Samples]:
        try:
            simulator = simulators.pop()
        except IndexError:
            simulator = Simulator(scenario, lifetime, fallback_rule, kept)
        first, *rest = (individuals[number] for number in block)
        session = Session(first, scenario, lifetime, simulator=simulator, others=rest)
        session.step(lifetime.steps)
        simulators.append(simulator)
        return session.block.outcomes(), session.samples

    done: dict[int, tuple[Outcome, Samples]] = {}
    # A pool even for one thread: Ctrl-C while numba builds a result would crash the process.
    with ThreadPoolExecutor(threads) as pool:
        for block, (outcomes, samples) in zip(blocks, pool.map(run_block, blocks), strict=True):
            done.update(zip(block, ((outcome, samples) for outcome in outcomes), strict=True))
    return [done[number] for number in range(len(individuals))]


def load_kernel(
    controller: Controller = GA_ALONE,
    network: Network | None = None,
    scenario: Scenario | None = None,
    *,
    weight_path: bool = False,
) -> None:
    """Load or compile the kernel of such lifetimes. A lifetime with parts of the user's own is run twice.

    weight_path: as of `run_lifetimes`.

    Raises:
        NotCompiledError: a part does not compile.
        ValueError: a part of the user's own fails, draws random numbers, or remembers earlier lifetimes.
    """
    world = scenario or Scenario()
    net = network or Network((world.inputs, *HIDDEN, OUTPUTS), world.task.gives_reward)
    genes = make_plan(net, type(controller.rule)).genes
    dummy = Individual(
        genes=np.random.default_rng(0).uniform(-1.0, 1.0, genes),
        side="left",
        controller=controller,
        network=net,
        signs=np.ones(net.synapses),
        yoking=yoking(controller.rule.control, net, 0, 0),
        key=np.uint64(0),
        record=True,
    )
    parts = user_parts(dummy, world)
    duration_s, gain = _TRIED_S if parts else STEP_S, min(1.0, world.robot.motor_limit_rad_s)
    lifetime = Lifetime(duration_s=duration_s, gain_rad_s=gain, record_every=1)
    named = " or ".join(f"{part.KEY} ({part.what()})" for part in parts)
    try:
        lifetimes = (run_lifetimes([dummy], world, lifetime, weight_path=weight_path) for _ in range(2 if parts else 1))
        first, *again = (done for (done,) in lifetimes)
    except (Exception, SystemExit) as error:  # what a user's own part may raise has no end
        if not parts or isinstance(error, PartError | LostRobotError):
            raise
        raise ValueError(f"{named} failed: {type(error).__name__}: {error}") from error
    if again and _content(first) != _content(again[0]):
        raise ValueError(f"{named} gives other results when the same lifetime is run again: no run could be repeated")


def _content(result: tuple[Outcome, Samples]) -> list[bytes]:
    """All numbers of a lifetime as bytes, to be compared with those of another one: nan is equal to nan there."""
    outcome, samples = result
    return [np.asarray(value).tobytes() for value in (*outcome, outcome.trials, *samples)]
