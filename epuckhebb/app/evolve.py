"""`epuckhebb evolve`: an evolution in its folder, from the beginning or, with `resume=RUN`, on from where it stopped.

The checkpoint alone says how far an evolution has come. `history.csv` and `champion.npz` can be written anew from it,
so it does not matter between which two files a run was killed: it goes on to the same bytes.
"""

import hashlib
import io
import json
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import yaml
from numpy.typing import NDArray
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from epuckhebb.app import files, hydra_bridge, runs
from epuckhebb.app.config import EvolveConfig, read_config, settings, thread_count, typed
from epuckhebb.app.errors import ConfigError
from epuckhebb.app.evaluate import compiled_for, own_rules
from epuckhebb.app.explain import explain
from epuckhebb.app.files import CHAMPION, CHECKPOINT, Checkpoint, Genome
from epuckhebb.app.machine import Need, path_of, require
from epuckhebb.app.parts import network_for, sha256_of
from epuckhebb.app.progress import EvolutionProgress, say
from epuckhebb.app.runs import RunFolder
from epuckhebb.evolution.evolve import Generation, evolve, room_to_evolve
from epuckhebb.sim.adaptation.baseline import Baseline, baseline_of, live_at_home, room_to_remember
from epuckhebb.sim.adaptation.self_check.memory import SelfMemory, can_check_itself, remember_self
from epuckhebb.sim.genome import WEIGHTS, plan_of
from epuckhebb.sim.network import Network
from epuckhebb.sim.plasticity.rule import NoRule, name_of
from epuckhebb.sim.scenario import Scenario
from epuckhebb.sim.tasks.trial import ONE_TRIAL

RESUME = "resume="
_HISTORY = "history.csv"


def evolve_job(cfg: DictConfig) -> None:
    """Do one job of Hydra's: evolve into its folder."""
    with hydra_bridge.job_folder() as path:
        cfg = hydra_bridge.named(cfg)
        config = asked(cfg)
        facts = {"command": hydra_bridge.job_command("evolve")}
        run = new_run(path, cfg, hydra_bridge.job_overrides(), facts)
    evolve_into(run, config, None, threads=hydra_bridge.threads_of_job(cfg.threads), quiet=hydra_bridge.in_multirun())


def asked(cfg: DictConfig) -> EvolveConfig:
    """What a configuration asks for, checked.

    Raises:
        ConfigError: A value is outside its range, or a rule does not compile.
    """
    config = typed(cfg, EvolveConfig)
    given_weights(config)
    require(needs(config, network_of(config)))
    compiled_for(config.controller, network_of(config), config.world)
    return config


def needs(config: EvolveConfig, network: Network) -> list[Need]:
    """The memory that an evolution takes."""
    genes, key = plan_of(network, type(config.controller.rule)).genes, config.algorithm.key
    room = room_to_evolve(config.algorithm.individuals, config.schedule.loops, genes)
    home = room_to_remember(config.world.paper_duration_s, 1.0, network)
    return [
        Need(room, f"{config.algorithm.individuals} individuals", f"lower {key}.population or {key}.loops"),
        Need(home, "what the champion remembers", "lower scenario.paper_duration_s"),
    ]


def network_of(config: EvolveConfig) -> Network:
    """The network that is evolved."""
    return network_for(config.world, config.layers)


def given_weights(config: EvolveConfig) -> NDArray[np.float64] | None:
    """The weights that all individuals are given, (synapses,); None if weights evolve.

    Raises:
        ConfigError: There is no such genome, or it is for another robot or network.
    """
    if config.genome is None:
        return None
    robot, network = config.world.robot, network_of(config)
    genome = files.load_genome(config.genome, config.world.experiment, config.layers)
    if genome.robot != robot.name or genome.network != network:
        raise ConfigError(
            f"genome={config.genome} is for robot {genome.robot} and a network of layers {genome.network}; evolved is "
            f"for robot {robot.name} and layers {network}. Give another genome, robot or network.layers"
        )
    return genome.weights


def new_run(path: Path, cfg: DictConfig, overrides: list[str], facts: dict[str, Any]) -> RunFolder:
    """Claim the folder of an evolution; the files of a user's own rules are kept in it.

    Raises:
        ConfigError: The folder holds a run already, or cannot be written to.
    """
    rules = own_rules(cfg)
    if rules:
        facts = {"rules": {str(file): sha256_of(file) for file in rules}, **facts}
    run = RunFolder.new(path, "evolve", cfg, overrides, facts)
    for file in rules:
        run.write(f"rules/{file.name}", file.read_bytes())
    return run


def evolve_into(
    run: RunFolder, config: EvolveConfig, after: Checkpoint | None, *, threads: int, quiet: bool = False
) -> None:
    """Evolve, from the beginning or from a checkpoint on, and close the run.

    Args:
        run: The folder of the run.
        config: What to evolve.
        after: The checkpoint to go on from, if there is one.
        threads: How many threads the lifetimes may use.
        quiet: Whether to show no progress.

    Raises:
        JobFailedError: The evolution could not be finished.
    """

    def left_behind() -> str:
        if not (run.path / CHECKPOINT).is_file():
            return "before the first generation"
        return (
            f"the last whole generation is in {run.path / CHECKPOINT}; go on with: epuckhebb evolve {RESUME}{run.path}"
        )

    run.left_behind = left_behind
    with run, EvolutionProgress(config.schedule.generations, quiet=quiet) as progress:
        digest = _digest(run.path, _changeable(config))
        if after is not None and not _is_written(run, after):
            _write_generation(run, after, config)
        last = after.generation if after else None
        network = network_of(config)
        for generation in evolve(
            config.algorithm,
            config.world,
            config.lifetime,
            config.seed,
            threads,
            after=last,
            training=config.training,
            network=network,
            controller=config.controller,
            weights=given_weights(config),
        ):
            after = Checkpoint.following(after, generation)
            run.write(CHECKPOINT, after.as_bytes(digest))
            _write_generation(run, after, config)
            progress.show(generation)
        assert after is not None  # there is at least one generation
        weights = plan_of(network, type(config.controller.rule)).split(after.generation.champion)[WEIGHTS]
        # A task without one goal has nothing that an adaptation could compare with.
        remembered = () if config.world.task.has_trials else home(weights, config.world, threads, network)
        run.write(CHAMPION, champion_of(after.generation, config, config.seed, *remembered))
        from epuckhebb.study import charts  # matplotlib takes a while to load, and nothing else here needs it

        history = pd.read_csv(io.StringIO(after.history))
        title = f"{config.world.name}, seed {config.seed}, {config.algorithm.name}"
        run.write("figures/learning.png", charts.learning_curves({title: [history]}))


def home(
    weights: NDArray[np.float64], world: Scenario, threads: int, network: Network
) -> tuple[Baseline, SelfMemory | None]:
    """What a champion remembers of its training world; nothing for a self-check that its robot cannot do there."""
    sides = live_at_home(weights, world, threads=threads, network=network)
    readings = [samples.sensors for side in sides for _, samples in side]
    self_memory = remember_self(world, readings) if can_check_itself(world) else None
    return baseline_of(sides, world, 1.0), self_memory


def champion_of(
    last: Generation,
    config: EvolveConfig,
    seed: int,
    baseline: Baseline | None = None,
    self_memory: SelfMemory | None = None,
) -> bytes:
    """The `champion.npz` of a generation of an evolution."""
    network, rule = network_of(config), config.controller.rule
    genome = Genome(
        genes=last.champion,
        name=CHAMPION,
        network=network,
        robot=config.world.robot.name,
        lights=config.world.robot.lights,
        plan=plan_of(network, type(rule)),
        optimizer=config.algorithm.name,
        training=config.training.name,
        rule="" if isinstance(rule, NoRule) else name_of(type(rule)),
        task="" if config.world.task == ONE_TRIAL else config.world.task.name,
        baseline=baseline,
        self_memory=self_memory,
    )
    return files.champion_file(genome, last.champion_fitness, config.world.experiment, seed, last.number)


def _write_generation(run: RunFolder, state: Checkpoint, config: EvolveConfig) -> None:
    """Bring the other files of an evolution to the state of its checkpoint."""
    run.write(_HISTORY, state.history)
    run.write(CHAMPION, champion_of(state.generation, config, config.seed))


def _is_written(run: RunFolder, state: Checkpoint) -> bool:
    """Whether the other files are at the state of the checkpoint; a champion that remembers is kept as it is."""
    try:
        history = (run.path / _HISTORY).read_text(encoding="utf-8")
        champion = files.load_genome(str(run.path), "")
    except (OSError, ConfigError):
        return False
    return history == state.history and np.array_equal(champion.genes, state.generation.champion)


def resume(arguments: list[str]) -> Path:
    """Go on with the evolution that `resume=RUN` names; returns its folder.

    Raises:
        ConfigError: It is no evolution of this program, it is at work, or other settings were given.
        JobFailedError: It could not be finished.
    """
    named = [argument.removeprefix(RESUME) for argument in arguments if argument.startswith(RESUME)]
    changes = [argument for argument in arguments if not argument.startswith(RESUME)]
    if len(named) != 1 or not named[0]:
        raise ConfigError("resume=RUN names one run folder of `epuckhebb evolve`")
    path = path_of(named[0], "resume")
    told = runs.read(path)
    if told["verb"] != "evolve":
        raise ConfigError(f"resume={path} is a run of `epuckhebb {told['verb']}`; only evolutions can be resumed")
    cfg = read_config(path / runs.CONFIG, "evolve")  # the checkpoint knows whether it may go on with it
    changeable = _changeable(typed(cfg, EvolveConfig))
    _change(cfg, path, changes, changeable)
    config = asked(cfg)
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
    if told["code"].get("science") != runs.science_version():
        say("The program has changed since this evolution began; it may end otherwise than one that never stopped.")
    run = RunFolder.going_on(path, "evolve", cfg, arguments, {"generations": done})
    say(f"Going on after {done} of {generations} generations.")
    evolve_into(run, config, after, threads=thread_count(config.threads))
    return path


def _changeable(config: EvolveConfig) -> tuple[str, str]:
    """The keys that may be changed when an evolution goes on; the others would make it another one."""
    return f"{config.algorithm.key}.generations", "threads"


def _digest(path: Path, changeable: tuple[str, ...]) -> str:
    """A digest of the settings of a run that make it this evolution."""
    told = settings(path / runs.CONFIG)
    for dotted in changeable:
        group, _, key = dotted.rpartition(".")
        place = told.get(group) if group else told
        if isinstance(place, dict):
            place.pop(key, None)
    return hashlib.sha256(json.dumps(told, sort_keys=True, default=str).encode()).hexdigest()


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
