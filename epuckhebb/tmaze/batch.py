"""Many lifetimes in the same world, on any number of threads; results do not depend on that number."""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from epuckhebb.adaptation.change_signal import no_nominal
from epuckhebb.adaptation.controller import GA_ALONE, Controller
from epuckhebb.adaptation.homeostasis import no_patterns
from epuckhebb.controller.genome import plan_of
from epuckhebb.controller.network import HIDDEN, Network
from epuckhebb.controller.plasticity.rule import NoRule, Rule
from epuckhebb.controller.plasticity.rules.paper import Paper
from epuckhebb.tmaze.life import Lifetime
from epuckhebb.tmaze.outcome import Outcome
from epuckhebb.tmaze.robot import OUTPUTS, STEP_S
from epuckhebb.tmaze.samples import Samples
from epuckhebb.tmaze.scenario import Scenario
from epuckhebb.tmaze.session import Individual, Session
from epuckhebb.tmaze.simulator import Simulator

_LIFETIMES_PER_STAGE = 50  # that run one after the other


def run_lifetimes(
    individuals: Sequence[Individual], scenario: Scenario, lifetime: Lifetime, threads: int = 1
) -> list[tuple[Outcome, Samples]]:
    """Run many lifetimes in the same scenario; outcomes come in the order of `individuals`, whatever `threads`.

    Samples have length 0 where a lifetime is not recorded.

    Raises:
        NotCompiledError: a rule does not compile.
        LostRobotError: a pose or a weight stopped being finite; the message says whose and when.
    """
    size = max(1, min(_LIFETIMES_PER_STAGE, -(-len(individuals) // threads)))
    blocks = [individuals[first : first + size] for first in range(0, len(individuals), size)]
    rules = [type(one.controller.rule) for one in individuals if not one.controller.adaptation.acts]
    fallback_rule = next((rule for rule in rules if rule is not NoRule and not rule.evolved), Paper)
    # A pool even for one thread: Ctrl-C while numba builds a result would crash the process.
    with ThreadPoolExecutor(threads) as pool:
        done = list(pool.map(lambda block: _in_turn(block, scenario, lifetime, fallback_rule), blocks))
    return [one for block in done for one in block]


def _in_turn(
    individuals: Sequence[Individual], scenario: Scenario, lifetime: Lifetime, fallback_rule: type[Rule]
) -> list[tuple[Outcome, Samples]]:
    simulator = Simulator(scenario, lifetime, fallback_rule)
    done = []
    for individual in individuals:
        session = Session(individual, scenario, lifetime, simulator=simulator)
        session.step(lifetime.steps)
        done.append((session.outcome(), session.samples))
    return done


def load_kernel(
    controller: Controller = GA_ALONE, network: Network | None = None, scenario: Scenario | None = None
) -> None:
    """Load or compile the kernel of such lifetimes, as the first of them would.

    Raises:
        NotCompiledError: the rule does not compile.
    """
    world = scenario or Scenario()
    net = network or Network((world.inputs, *HIDDEN, OUTPUTS), world.task.gives_reward)
    dummy = Individual(
        genes=np.zeros(plan_of(net, type(controller.rule)).genes),
        side="left",
        controller=controller,
        network=net,
        signs=np.ones(net.synapses),
        nominal=no_patterns(no_nominal(world.robot.inputs), world.robot.light.count),
        key=np.uint64(0),
    )
    run_lifetimes([dummy], world, Lifetime(duration_s=STEP_S, gain_rad_s=min(1.0, world.robot.motor_limit_rad_s)))
