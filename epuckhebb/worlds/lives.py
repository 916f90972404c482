"""Lifetimes in an environment as work that a process does: it gets a world, a network and rules, and no settings."""

import functools
import pickle
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.controller import Controller
from epuckhebb.controller.network import Network
from epuckhebb.controller.plasticity.rule import Acts, Rule
from epuckhebb.worlds.environment import Lived, World


class Work(NamedTuple):
    """Lifetimes of one genome. number: of its rule. signs: None for those of the rule. record: as of `World.live`."""

    number: int
    genes: Floats
    seeds: tuple[int, ...]
    signs: Floats | None = None
    record: bool = False


class Setup(NamedTuple):
    """What lifetimes need besides their genes. is_fresh, judge: as of `World.live`."""

    world: World
    network: Network
    rules: tuple[Rule, ...]
    is_fresh: bool = True
    judge: Any = None

    def controller(self, work: Work) -> Controller:
        """The controller of a work."""
        rule = replace(self.rules[work.number], acts=Acts.always)  # `live` ends it
        return Controller(work.genes, self.network, rule, signs=work.signs, step_s=self.world.settings.step_s)

    def live(self, work: Work) -> list[Lived]:
        """Run lifetimes, in the order of their seeds."""
        controller, frozen = self.controller(work), self.rules[work.number].acts is Acts.before_change
        return [
            self.world.live(
                controller, seed, frozen=frozen, record=work.record, is_fresh=self.is_fresh, judge=self.judge
            )
            for seed in work.seeds
        ]


@functools.lru_cache(maxsize=2)
def _unpickled(setup: bytes) -> Setup:
    """A setup, so that a worker makes the environment once."""
    loaded: Setup = pickle.loads(setup)  # of the process that began this one
    return loaded


def live_in_worker(load_own: Sequence[Callable[[], object]], setup: bytes, works: Sequence[Work]) -> list[list[Lived]]:
    """Run lifetimes in a worker. load_own: load the user's files, whose classes the setup has. setup: pickled."""
    for load in load_own:
        load()
    return [_unpickled(setup).live(work) for work in works]
