"""`epuckhebb evolve`: an evolution in its folder, from the beginning or, with `resume=RUN`, on from where it stopped.

The checkpoint alone says how far an evolution has come. `history.csv` and `champion.npz` can be written anew from it,
so it does not matter between which two files a run was killed: it goes on to the same bytes.
"""

import hashlib
import io
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import yaml
from numpy.typing import NDArray
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from epuckhebb.config import plugins
from epuckhebb.config.build import network_for
from epuckhebb.config.explain import explain
from epuckhebb.config.schema import EvolveConfig, say_unusual, typed
from epuckhebb.config.stored import read_config, settings
from epuckhebb.evolution.evolve import Generation, evolve, memory_to_evolve
from epuckhebb.runs import evaluate, hydra
from epuckhebb.runs.evaluate import compile_for
from epuckhebb.runs.nominal import remember_training_world
from epuckhebb.runtime.errors import ConfigError
from epuckhebb.runtime.progress import Bar, say
from epuckhebb.runtime.resources import Need, path_of, require, thread_count
from epuckhebb.sim.adaptation.nominal import Nominal, memory_to_measure_nominal
from epuckhebb.sim.adaptation.self_check.memory import SelfMemory
from epuckhebb.sim.genome import WEIGHTS, plan_of
from epuckhebb.sim.network import Network
from epuckhebb.sim.plasticity.rule import NoRule, name_of
from epuckhebb.sim.tasks.trial import ONE_TRIAL
from epuckhebb.store import disk, provenance
from epuckhebb.store.checkpoint import Checkpoint
from epuckhebb.store.disk import CHAMPION, CHECKPOINT
from epuckhebb.store.folder import RunFolder
from epuckhebb.store.genome import Genome, champion_file, load_genome
from epuckhebb.store.records import OwnCode
from epuckhebb.store.run import read

RESUME = "resume="
_HISTORY = "history.csv"


def evolve_job(cfg: DictConfig) -> None:
    """Do one job of Hydra's: evolve into its folder."""
    with hydra.job_folder() as path:
        cfg = hydra.named(cfg)
        config = prepare(cfg)
        facts = {"command_line": hydra.job_command("evolve")}
        run = new_run(path, cfg, hydra.job_overrides(), facts)
    evolve_into(run, config, None, threads=hydra.threads_of_job(cfg.threads), quiet=hydra.in_multirun())


def prepare(cfg: DictConfig) -> EvolveConfig:
    """What a configuration asks for, checked."""
    config = typed(cfg, EvolveConfig)
    given_weights(config)
    check_memory(config)
    compile_for([config.controller], network_of(config), config.world)
    return config


def check_memory(config: EvolveConfig) -> None:
    """Refuse an evolution that takes more memory than there is."""
    network, key, individuals = network_of(config), config.algorithm.key, config.algorithm.individuals
    genes = plan_of(network, type(config.controller.rule)).genes
    room = memory_to_evolve(individuals, config.schedule.loops, genes)
    nominal = memory_to_measure_nominal(config.world.paper_duration_s, 1.0, network)
    require(
        [
            Need(room, f"{individuals} individuals", f"lower {key}.population or {key}.loops"),
            Need(nominal, "what the champion remembers", "lower scenario.paper_duration_s"),
        ]
    )


def network_of(config: EvolveConfig) -> Network:
    """The network that is evolved."""
    return network_for(config.world, config.layers)


def given_weights(config: EvolveConfig) -> NDArray[np.float64] | None:
    """The weights that all individuals are given, (synapses,); None if weights evolve."""
    if config.genome is None:
        return None
    robot, network = config.world.robot, network_of(config)
    genome = load_genome(config.genome, config.world.experiment, config.layers)
    if genome.robot != robot.name or genome.network != network:
        raise ConfigError(
            f"genome={config.genome} is for robot {genome.robot} and a network of layers {genome.network}; evolved is "
            f"for robot {robot.name} and layers {network}. Give another genome, robot or network.layers"
        )
    return genome.weights


def new_run(path: Path, cfg: DictConfig, overrides: list[str], facts: dict[str, Any]) -> RunFolder:
    """Claim the folder of an evolution; copies of the user's own files are kept in it."""
    own = plugins.own_files(cfg)
    run = RunFolder.new(path, "evolve", cfg, overrides, {**evaluate.own_code(own), **facts})
    for place, content in plugins.copies(own).items():
        run.write(place, content)
    return run


def evolve_into(
    run: RunFolder, config: EvolveConfig, after: Checkpoint | None, *, threads: int, quiet: bool = False
) -> None:
    """Evolve, from the beginning or after a checkpoint, and close the run; show no progress if `quiet`."""

    def left_behind() -> str:
        last = run.path / CHECKPOINT
        if not last.is_file():
            return "before the first generation"
        return f"the last whole generation is in {last}; go on with: epuckhebb evolve {RESUME}{run.path}"

    say_unusual(config)
    run.left_behind = left_behind
    with run, EvolutionProgress(config.schedule.generations, quiet=quiet) as progress:
        digest = _digest(run.path, _changeable(config))
        if after is not None:  # a run may have been killed before these files were
            _write_generation(run, after, config)
        network = network_of(config)
        for generation in generations_of(config, threads, after.generation if after else None):
            after = Checkpoint.following(after, generation)
            run.write(CHECKPOINT, after.as_bytes(digest))
            _write_generation(run, after, config)
            progress.show(generation)
        assert after is not None  # there is at least one generation
        weights = plan_of(network, type(config.controller.rule)).split(after.generation.champion)[WEIGHTS]
        # A task without one goal has nothing that an adaptation could compare with.
        remembered = (
            () if config.world.task.has_trials else remember_training_world(weights, config.world, threads, network)
        )
        run.write(CHAMPION, champion_of(after.generation, config, config.seed, *remembered))
        from epuckhebb.analysis import charts  # matplotlib takes a while to load, and nothing else here needs it

        history = pd.read_csv(io.StringIO(after.history))
        title = f"{config.world.name}, seed {config.seed}, {config.algorithm.name}"
        run.write("figures/learning.png", charts.learning_curves({title: [history]}))


def generations_of(config: EvolveConfig, threads: int, after: Generation | None = None) -> Iterator[Generation]:
    """The generations of an evolution, from the first one or after one that has ended."""
    return evolve(
        config.algorithm,
        config.world,
        config.lifetime,
        config.seed,
        threads,
        after=after,
        training=config.training,
        network=network_of(config),
        controller=config.controller,
        weights=given_weights(config),
    )


def champion_of(
    last: Generation,
    config: EvolveConfig,
    seed: int,
    nominal: Nominal | None = None,
    self_memory: SelfMemory | None = None,
) -> bytes:
    """The `champion.npz` of a generation of an evolution."""
    network, rule = network_of(config), config.controller.rule
    genome = Genome(
        genes=last.champion,
        name=CHAMPION,
        network=network,
        robot=config.world.robot.name,
        lights=config.world.robot.light.count,
        plan=plan_of(network, type(rule)),
        optimizer=config.algorithm.name,
        training=config.training.name,
        rule="" if isinstance(rule, NoRule) else name_of(type(rule)),
        task="" if config.world.task == ONE_TRIAL else config.world.task.name,
        nominal=nominal,
        self_memory=self_memory,
    )
    return champion_file(genome, last.champion_fitness, config.world.experiment, seed, last.number)


def _write_generation(run: RunFolder, state: Checkpoint, config: EvolveConfig) -> None:
    """Bring the other files of an evolution to the state of its checkpoint."""
    run.write(_HISTORY, state.history)
    run.write(CHAMPION, champion_of(state.generation, config, config.seed))


def resume(arguments: list[str]) -> Path:
    """Go on with the evolution that `resume=RUN` names; returns its folder."""
    named = [argument.removeprefix(RESUME) for argument in arguments if argument.startswith(RESUME)]
    changes = [argument for argument in arguments if not argument.startswith(RESUME)]
    if len(named) != 1 or not named[0]:
        raise ConfigError("resume=RUN names one run folder of `epuckhebb evolve`")
    path = path_of(named[0], "resume")
    told = read(path)
    if told["command"] != "evolve":
        raise ConfigError(f"resume={path} is a run of `epuckhebb {told['command']}`; only evolutions can be resumed")
    cfg = read_config(path / disk.CONFIG, "evolve")  # the checkpoint knows whether it may go on with it
    changeable = _changeable(typed(cfg, EvolveConfig))
    own = plugins.own_files(cfg)
    _check_own_files(path, own, told.get("own_code", {}))
    _change(cfg, path, changes, changeable)
    config = prepare(cfg)
    network, rule, generations = network_of(config), config.controller.rule, config.schedule.generations
    after = Checkpoint.read(
        path,
        plan_of(network, type(rule)).genes,
        lambda state: config.algorithm.search(config.plan, config.seed, state),
        _digest(path, changeable),
    )
    given = given_weights(config)
    if after and given is not None and not np.array_equal(after.generation.champion[: network.synapses], given):
        raise ConfigError(f"genome={config.genome} is not whose weights {path} began with")
    done = after.generation.number + 1 if after else 0
    key = changeable[0]
    if generations < done:
        raise ConfigError(f"{key} must be {done} or more, the generations that {path} has, got {generations}")
    if generations == done and told["status"]["state"] == "finished":
        say(f"{path} has all of its {done} generations; {key}={2 * done} would add {done}.")
        return path
    if told["code"].get("science") != provenance.science_version():
        say("The program has changed since this evolution began; it may end otherwise than one that never stopped.")
    run = RunFolder.resume(path, "evolve", cfg, arguments, {"generations": done})
    for place, content in plugins.copies(own).items():
        run.write(place, content)
    say(f"Going on after {done} of {generations} generations.")
    evolve_into(run, config, after, threads=thread_count(config.threads))
    return path


def _check_own_files(path: Path, own: Mapping[Path, plugins.OwnFile], before: Mapping[str, OwnCode]) -> None:
    """Refuse to go on with other files of the user's than an evolution began with."""
    for file, now in own.items():
        if str(file) not in before or now.copy != before[str(file)]["copy"]:
            raise ConfigError(
                f"{file}, or a file that it imports, is not what {path} began with; put it back as it was (a copy is "
                f"in {path / plugins.FOLDER}), or begin another evolution"
            )


def _changeable(config: EvolveConfig) -> tuple[str, str]:
    """The keys that may be changed when an evolution goes on; the others would make it another one."""
    return f"{config.algorithm.key}.generations", "threads"


def _digest(path: Path, changeable: tuple[str, ...]) -> str:
    """A digest of the settings of a run that make it this evolution."""
    kept = settings(path / disk.CONFIG)
    for dotted in changeable:
        group, _, key = dotted.rpartition(".")
        place = kept.get(group) if group else kept
        if isinstance(place, dict):
            place.pop(key, None)
    return hashlib.sha256(json.dumps(kept, sort_keys=True, default=str).encode()).hexdigest()


def _change(cfg: DictConfig, path: Path, changes: list[str], changeable: tuple[str, ...]) -> None:
    """Change what may be changed in the configuration of a run; all else would make it another evolution."""
    for change in changes:
        key, _, value = change.partition("=")
        if key not in changeable:
            raise ConfigError(
                f"{change} cannot be given with {RESUME}: the evolution goes on with the settings in "
                f"{path}/.hydra/config.yaml; only {' and '.join(changeable)} may be changed"
            )
        try:
            OmegaConf.update(cfg, key, yaml.safe_load(value))
        except (yaml.YAMLError, OmegaConfBaseException) as error:
            raise ConfigError(explain(error)) from error


class EvolutionProgress(Bar):
    """Shows each generation of an evolution."""

    def __init__(self, generations: int, *, quiet: bool, each: bool = True) -> None:
        """Prepare to show so many generations; say nothing if `quiet`."""
        super().__init__("generation", generations, quiet=quiet, each=each)
        self._steps, self._seconds, self._shown = 0, 0.0, 0
        self.put(0, "compiling …")

    def show(self, generation: Generation) -> None:
        """Show a generation that has just ended."""
        self._steps += generation.robot_steps
        self._seconds += generation.seconds
        self._shown += 1
        done = generation.number + 1
        best, mean, speed = generation.fitness.max(), generation.fitness.mean(), self._steps / self._seconds / 1e6
        text = f"best {best:.3f}  mean {mean:.3f}  {speed:.2f} M robot-steps/s"
        self.put(done, text)
        left = self._seconds / self._shown * (self._total - done)
        self.say(f"generation {done}/{self._total}  {text}  {left:.0f} s left")
