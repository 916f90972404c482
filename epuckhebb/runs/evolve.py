"""`epuckhebb evolve`: an evolution in its folder, from the beginning or resumed with `resume=RUN`.

The checkpoint alone says how far an evolution is. `history.csv` and `champion.npz` are written anew from it. A run may
be killed between any two files: resumed, it ends bit-identical.
"""

import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from epuckhebb.config import (
    EvolveConfig,
    dump,
    find_schema,
    make_config,
    own_files,
    settings,
    values_of,
)
from epuckhebb.controller.genome import GenomePlan, make_plan
from epuckhebb.controller.network import Network
from epuckhebb.controller.own_class import class_name
from epuckhebb.controller.plasticity.control import Sign
from epuckhebb.controller.plasticity.rule import NoRule
from epuckhebb.evolution.evolve import Generation, complete_genomes, confirmation, evolve, training_signs
from epuckhebb.evolution.optimizer import limits
from epuckhebb.evolution.search import Results, Search, check_start
from epuckhebb.runs import hydra
from epuckhebb.runs.begin import begin, check_user_files
from epuckhebb.runs.evaluate import draw
from epuckhebb.runs.hydra import Report, unreported
from epuckhebb.runs.world import make_world
from epuckhebb.runtime import ConfigError, bar, conf, refusing, say, thread_count, user_path
from epuckhebb.store import (
    CHAMPION,
    CHECKPOINT,
    CONFIG,
    SCIENCE,
    Checkpoint,
    Genome,
    Run,
    RunFolder,
    champion_file,
    digest,
    load_genome,
)
from epuckhebb.worlds.world import World

RESUME = "resume="  # before the folder of an evolution


def evolve_job(job: hydra.Job) -> None:
    """Evolve into the folder of a job."""
    prepared = prepare_evolution(job.config)
    notes = prepared.world.notes()
    prepared.compile()
    for note in (*notes, *prepared.added) if not job.in_multirun else ():
        say(note)
    facts = {**({"notes": notes} if notes else {}), **job.facts}
    evolve_into(
        job.path, prepared, job.overrides, facts, threads=job.threads, is_many=job.in_multirun, report=job.report
    )


@dataclass(frozen=True, kw_only=True)
class PreparedEvolution:
    """An evolution whose settings, memory and given weights are checked.

    config: of its world. plan: the parts of a champion's genes. given: the genes of the network that all individuals
    are given; None if these evolve. start: the champion with which evolution begins, and its evolved genes; None for
    random ones.
    """

    config: Any
    network: Network
    plan: GenomePlan
    given: NDArray[np.float64] | None = None
    start: tuple[Genome, NDArray[np.float64]] | None = None

    @property
    def world(self) -> World:
        """The world in which individuals are judged."""
        return make_world(self.config)

    @property
    def start_text(self) -> str:
        """What the champion's file says of its start."""
        return f"{self.start[0].name} (SHA-256 {self.start[0].sha256})" if self.start else ""

    @property
    def added(self) -> list[str]:
        """What is run beside generations of a population, in a line; none where these are chosen to fit a budget."""
        algorithm, first = self.config.algorithm, self.config.algorithm.first_generation
        if algorithm.generations is None:
            return []
        parts = []
        if first != algorithm.population and self.start is None:
            parts.append(f"{first} individuals in the first generation, {algorithm.population} in the others")
        if more := confirmation(algorithm, self.config.rule, self.world.evaluator(self.network, 1).lifetimes):
            parts.append(f"at the end {more} fresh lifetimes of each candidate for the champion")
        return [f"Budget: {'; '.join(parts)}."] if parts else []

    def search(self, log: Sequence[Results] = ()) -> Search:
        """The search of the optimizer, after the generations that are logged."""
        config = self.config
        return Search(config.algorithm, config.plan, config.seed, log, self.start[1] if self.start else None)

    def compile(self) -> None:
        """Load or compile what the lifetimes need."""
        self.world.compile(self.network)

    def generations(
        self, threads: int, after: Generation | None = None, *, quiet: bool = False
    ) -> Iterator[Generation]:
        """The generations of the evolution, from the first one or after one that has ended, beside a bar."""
        config, count = self.config, self.config.schedule.generations
        search = evolve(
            config.algorithm,
            self.world.evaluator(self.network, threads),
            count,
            config.seed,
            after,
            network=self.network,
            rule=config.rule,
            network_genes=self.given,
            start=self.start[1] if self.start else None,
        )
        with bar("generation", count, after.number + 1 if after else 0, quiet=quiet) as shown:
            for generation in search:
                best, mean = generation.fitness.max(), generation.fitness.mean()
                shown.set_postfix_str(f"best {best:.3f}  mean {mean:.3f}", refresh=False)
                shown.update()
                yield generation

    def fittest(self, log: Sequence[Results], number: int) -> NDArray[np.float64]:
        """The fittest genome of a generation that has ended: the optimizer asks for it again, without a lifetime."""
        fittest = self.search(log[:number]).ask()[[np.argmax(log[number].fitness)]]
        fittest = complete_genomes(fittest, self.network, self.config.rule, self.given)
        return np.ravel(fittest)

    def network_genes(self, champion: NDArray[np.float64]) -> NDArray[np.float64]:
        """The genes of a champion that are its network, without those of a rule."""
        return self.plan.pick(champion, self.plan.network_parts)

    def nominal(self, last: Generation, threads: int) -> Any:
        """What a champion remembers of its training world; None if there is nothing."""
        return self.world.nominal_of_training(self.network_genes(last.champion), self.network, threads)

    def champion(self, last: Generation, nominal: Any = None) -> bytes:
        """The `champion.npz` of a generation."""
        return champion_file(self.genome(last, nominal), last.champion_fitness, self.config.seed, last.number)

    def genome(self, last: Generation, nominal: Any = None) -> Genome:
        """The champion of a generation, with all that it was evolved for and by."""
        config, rule = self.config, self.config.rule
        return Genome(
            genes=last.champion,
            name=Path(CHAMPION).stem,
            network=self.network,
            plan=self.plan,
            optimizer=config.algorithm.name,
            rule="" if isinstance(rule, NoRule) else class_name(type(rule)),
            start=self.start_text,
            signs=training_signs(rule, self.network, config.seed) if rule.sign is Sign.shuffled else None,
            nominal=nominal,
            **self.world.facts(last.moments),
        )


def prepare_evolution(config: Any, *, has_genome: bool = True) -> PreparedEvolution:
    """Check that the given weights fit, that the optimizer starts, and that the world knows what it asks for.

    has_genome: whether the genome that the settings name exists yet; else nothing is read.
    """
    world, network = make_world(config), config.network_made
    plan = make_plan(network, type(config.rule))
    given = _named("genome", config).network_genes if has_genome and config.genome is not None else None
    start = None
    if has_genome and config.start is not None:
        first = _named("start", config)
        start = first, _start_genes(first, config)
    with refusing():
        search = check_start(config.algorithm, config.plan, config.seed, start[1] if start else None)
    if unknown := [name for name in search.measures if name not in world.measures]:
        knows = ", ".join(("fitness", *world.measures))
        raise ConfigError(f"optimizer {config.algorithm.name}: `tell` gets {knows} here, not {', '.join(unknown)}")
    world.evaluator(network, threads=1)  # it refuses what cannot be
    return PreparedEvolution(config=config, network=network, plan=plan, given=given, start=start)


def _named(key: str, config: Any) -> Genome:
    """The champion that a key names, which must fit the world and the network."""
    where = getattr(config, key)
    try:
        genome = load_genome(where, config.world.experiment, config.shape)
        make_world(config).check_genome(genome)
    except ConfigError as error:
        raise ConfigError(str(error).replace("genome=", f"{key}=", 1)) from error
    if genome.network != config.network_made:
        here = f"this evolution for {config.network_made}"
        raise ConfigError(f"{key}={where} is for network.layers {genome.network}, {here}")
    return genome


def _start_genes(first: Genome, config: Any) -> NDArray[np.float64]:
    """The genes at which evolution begins; what the champion has not, or of another rule, begins at 0."""
    plan, algorithm = config.plan, config.algorithm
    own = first.plan if first.rule == class_name(type(config.rule)) else first.plan.network_parts
    genes = own.split(first.plan.pick(first.genes, own))
    start = np.concatenate([genes.get(part.name, np.zeros(part.size)) for part in plan.parts])
    limit = getattr(algorithm, "gene_limit", np.inf)
    if (np.abs(start) > limits(plan, limit)).any():
        most = f"{np.abs(start).max():g} or more, the largest gene of start={config.start}"
        raise ConfigError(f"{algorithm.key}.gene_limit must be {most}, got {limit:g}")
    return start


def evolve_into(
    path: Path,
    prepared: PreparedEvolution,
    overrides: list[str],
    facts: dict[str, Any],
    *,
    threads: int,
    is_many: bool = False,
    report: Report = unreported,
) -> None:
    """Evolve into a folder. overrides, facts: as of `RunFolder`. report: as of a `Job`.

    is_many: whether it is one of many: then it shows no progress, and goes on where it was stopped in this folder.
    """
    config, after = prepared.config, None
    if is_many and Run(path).is_whole:
        return
    run = begin(path, "evolve", config, overrides, {"seed": config.seed, **facts}, goes_on=is_many)
    if is_many and (path / CHECKPOINT).is_file():
        after = _checkpoint(path, prepared, config)
    continue_evolution(run, prepared, after, threads=threads, quiet=is_many, report=report)


def continue_evolution(
    run: RunFolder,
    prepared: PreparedEvolution,
    after: Checkpoint | None,
    *,
    threads: int,
    quiet: bool = False,
    report: Report = unreported,
) -> None:
    """Evolve, from the beginning or after a checkpoint, and close the run.

    quiet: show no progress. report: as of a `Job`.
    """
    config = prepared.config

    def left_behind() -> str:
        last = run.path / CHECKPOINT
        if not last.is_file():
            return "before the first generation"
        return f"the last whole generation is in {last}; resume with: epuckhebb evolve {RESUME}{run.path}"

    run.left_behind = left_behind
    with run:
        settings_digest = _digest(run.path, config)
        history = run.path / "history.csv"
        if after is not None and not (history.is_file() and history.read_bytes() == after.history.encode()):
            _write_generation(run, after, prepared)  # the run was killed before these files were written
        if not quiet and not sys.stderr.isatty():  # no bar moves there
            say(f"Evolving {config.schedule.generations} generations.")
        for generation in prepared.generations(threads, after.generation if after else None, quiet=quiet):
            after = Checkpoint.following(after, generation)
            run.write(CHECKPOINT, after.as_bytes(settings_digest))
            _write_generation(run, after, prepared)
        assert after is not None  # there is at least one generation
        last = after.generation
        run.write(CHAMPION, prepared.champion(last, prepared.nominal(last, threads)))
        for name, table in last.tables.items():
            run.write(f"{name}.csv", table)
        report(run.path)
        draw(run, config, config.algorithm.name, {"learning": (Run(run.path).table("history.csv"),)})


def _write_generation(run: RunFolder, state: Checkpoint, prepared: PreparedEvolution) -> None:
    """Bring the other files of an evolution to the state of its checkpoint; the history last, which says so."""
    run.write(CHAMPION, prepared.champion(state.generation))
    run.write("history.csv", state.history)


def evolved(path: Path) -> tuple[NDArray[np.float64], Any]:
    """The champion's genes of a finished evolution, and its history, a row a generation."""
    run = Run(path)
    if run.unfinished:
        raise ConfigError(run.unfinished)
    return load_genome(str(path), "").genes, run.table("history.csv")


def settings_of(path: Path) -> dict[str, Any]:
    """The settings of a run on which its results depend, without the seed."""
    return settings_but_seed(settings(path / CONFIG))


def settings_but_seed(values: Mapping[str, Any]) -> dict[str, Any]:
    """The settings of an evolution on which its results depend, without the seed."""
    return conf.without(values, ("seed", *conf.NO_EFFECT))


def earlier_champions(path: Path, shares: Sequence[float]) -> Iterator[tuple[int, NDArray[np.float64]]]:
    """The champions of a whole evolution after shares of its generations, each with the robot-steps until then."""
    config = make_config(settings(path / CONFIG), EvolveConfig, str(path / CONFIG))
    prepared, run = prepare_evolution(config), Run(path)
    last = _checkpoint(path, prepared, config)
    assert last is not None  # it is whole
    steps = run.table("history.csv").robot_steps.cumsum()
    for share in shares:
        number = max(1, round(share * len(steps))) - 1
        yield int(steps[number]), prepared.fittest(last.generation.log, number)


def resume(arguments: list[str], report: Report = unreported) -> Path:
    """Resume the evolution that `resume=RUN` names; returns its folder. report: as of a `Job`."""
    named = [argument.removeprefix(RESUME) for argument in arguments if argument.startswith(RESUME)]
    changes = [argument for argument in arguments if not argument.startswith(RESUME)]
    if len(named) != 1 or not named[0]:
        raise ConfigError("resume=RUN names one run folder of `epuckhebb evolve`")
    path = user_path(named[0], "resume")
    run = Run(path)
    facts = run.provenance
    if facts["command"] != "evolve":
        how = "only evolutions can be resumed; a study goes on with the same command"
        raise ConfigError(f"resume={path} is a run of `epuckhebb {facts['command']}`; {how}")
    values = settings(path / CONFIG)  # the checkpoint knows whether it fits
    schema = find_schema("evolve", values)
    before = make_config(values, schema, str(path / CONFIG))
    own = own_files(values)
    check_user_files(path, own, facts)
    changeable = _changeable(before)
    for key, value in values_of(changes).items():
        if key not in changeable:
            raise ConfigError(f"{key}={value} cannot be given with {RESUME}; only {', '.join(changeable)} can")
        group, _, last = key.rpartition(".")
        (values[group] if group else values)[last] = value
    config = make_config(values, schema, f"resume={path}")
    prepared = prepare_evolution(config)
    prepared.compile()
    after = _checkpoint(path, prepared, before)
    generations, done, key = config.schedule.generations, 0, changeable[0]
    if after is not None:
        done = after.generation.number + 1
    if generations < done:
        raise ConfigError(f"{key} must be {done} or more, the generations that {path} has, got {generations}")
    if generations == done and run.status["state"] == "finished":
        say(f"{path} has all of its {done} generations; {key}={2 * done} would add {done}.")
        return path
    if facts["code"].get("science") != SCIENCE:
        say("The program has changed since this evolution began; it may end otherwise than one that never stopped.")
    folder = RunFolder.resume(path, "evolve", dump(config), arguments, {"generations": done}, own)
    say(f"Resuming after {done} of {generations} generations.")
    continue_evolution(folder, prepared, after, threads=thread_count(config.threads), report=report)
    return path


def _checkpoint(path: Path, prepared: PreparedEvolution, before: EvolveConfig) -> Checkpoint | None:
    """The checkpoint of an evolution that goes on; a ConfigError if a champion that it was given is another by now.

    before: its settings, as it began.
    """
    if prepared.start and (path / CHAMPION).is_file():
        began = prepared.start[0].sha256
        with suppress(ConfigError):  # a damaged one is written anew from the checkpoint
            began = load_genome(str(path), "").start
        if prepared.start[0].sha256 not in began:
            raise ConfigError(f"start={before.start} is not the champion at which {path} began")
    after = Checkpoint.read(path, prepared.search, _digest(path, before))
    given = prepared.given
    if after and given is not None and not np.array_equal(prepared.network_genes(after.generation.champion), given):
        raise ConfigError(f"genome={before.genome} does not hold the weights with which {path} began")
    return after


def _changeable(config: EvolveConfig) -> tuple[str, ...]:
    """The keys that may be changed when an evolution is resumed; others would make it another evolution."""
    return f"{config.algorithm.key}.generations", config.parallel, "figures"


def _digest(path: Path, config: EvolveConfig) -> str:
    """A digest of the settings that make a run this evolution."""
    return digest(conf.without(settings(path / CONFIG), _changeable(config)))
