"""The memory that an evaluation needs: from the champion's file, or by living in the training world again."""

from collections.abc import Callable, Sequence

import numpy as np
from omegaconf import OmegaConf

from epuckhebb.app.data import data_folder
from epuckhebb.app.errors import ConfigError
from epuckhebb.app.genomes import Genome
from epuckhebb.sim.memory import REPEATS, Memory, remember
from epuckhebb.sim.plasticity import Hebbian
from epuckhebb.sim.scenario import TRAINED, Scenario
from epuckhebb.sim.surprise import Surprise


def memory_for(
    genome: Genome,
    plasticities: Sequence[Hebbian],
    experiment: str,
    gain_rad_s: float,
    threads: int,
    say: Callable[[str], None],
) -> Memory | None:
    """What this genome remembers of its training world at this pace; nothing if no plasticity asks.

    A champion that remembers never to have arrived is never late. say: is told if it had to live there again.

    Raises:
        ConfigError: the memory is of another experiment, or living there again gave nothing to be late against.
    """
    asking = {hebbian.surprise for hebbian in plasticities} - {Surprise.none}
    if not asking:
        return None
    memory = genome.memory
    if memory is not None and memory.experiment != experiment:
        raise ConfigError(
            f"genome={genome.name} remembers {memory.scenario}, a world of the {memory.experiment} experiment; it "
            f"cannot tell what is new in a scenario of the {experiment} experiment. Give a champion of that "
            "experiment, or a plasticity without surprise, such as hebbian=paper"
        )
    if memory is None or memory.gain_rad_s != gain_rad_s:
        why = "has no memory" if memory is None else f"remembers a pace of {memory.gain_rad_s:g} rad/s"
        say(
            f"genome={genome.name} {why}: it lives {REPEATS} lifetimes a side in {TRAINED[experiment]} first, "
            f"at {gain_rad_s:g} rad/s."
        )
        memory = remember(genome.genes, training_world(experiment), gain_rad_s, threads)
        if Surprise.lateness in asking and np.isnan(memory.time_to_goal_s).all():
            raise ConfigError(
                f"hebbian.surprise=lateness needs a time to the goal to remember, and genome={genome.name} reached "
                f"neither goal in {memory.scenario}; give a champion that does, or surprise=novelty or shortfall"
            )
    return memory


def training_world(experiment: str) -> Scenario:
    """The world in which controllers of an experiment are evolved."""
    file = data_folder("conf") / "scenario" / f"{TRAINED[experiment]}.yaml"
    world = OmegaConf.to_object(OmegaConf.merge(OmegaConf.structured(Scenario), OmegaConf.load(file)))
    assert isinstance(world, Scenario)
    return world
