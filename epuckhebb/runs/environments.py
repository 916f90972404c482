"""Evolutions and evaluations in environments of Gymnasium, with the same run folders as in the maze.

Environments hold the lock of Python, so lifetimes run in processes. What each is depends on its seed alone: results
are bit-identical with any number of processes.
"""

import functools
import io
import itertools
import json
import math
import time
import zlib
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from epuckhebb.analysis.tables import Rows, plain
from epuckhebb.config import (
    EnvironmentConfig,
    EvaluateEnvironment,
    EvolveEnvironment,
    from_values,
    schema_of,
)
from epuckhebb.controller import random
from epuckhebb.controller.compiling.sources import own_code
from epuckhebb.controller.controller import Controller
from epuckhebb.controller.genome import plan_of
from epuckhebb.controller.plasticity.control import Sign, signs, signs_of_draw
from epuckhebb.controller.plasticity.rule import NoRule
from epuckhebb.controller.random import Stream
from epuckhebb.evolution.evolve import Generation, search_generations
from epuckhebb.evolution.search import check_start
from epuckhebb.runs import hydra
from epuckhebb.runs.evaluate import Figures, check_rules, compiling, prepare_evaluation
from epuckhebb.runs.evolve import PreparedEvolution, prepare_evolution
from epuckhebb.runtime import ConfigError, refusing
from epuckhebb.store import Genome, RunFolder, digest, load_genome
from epuckhebb.worlds.environment import Lived

Floats = NDArray[np.float64]
_CHUNKS = 4  # of the work of each process, whose parts take different times
_WORTH_S = 20.0  # of work, from which on processes are worth their start
_MOST_SEED = 2**31 - 1
_FRAMES, _FRAME_MS, _CHANGED = 200, 40, "#D55E00"  # of a film; around what is after a change


class Work(NamedTuple):
    """Lifetimes of one genome. number: of the controller, in the settings. signs: None for those of the rule."""

    number: int
    genes: Floats
    seeds: tuple[int, ...]
    signs: Floats | None = None
    record: bool = False


def seed_of(seed: int, stream: Stream, *place: int) -> int:
    """The seed of an environment at a place in a study."""
    return int(random.key(seed, stream, *place)) & _MOST_SEED


def run_lifetimes(
    config: EnvironmentConfig, works: Sequence[Work], processes: int, times: int = 1
) -> list[list[Lived]]:
    """Run lifetimes in so many processes; for each work a list, in the order of its seeds.

    The first work is run here, and so are all others if processes would take longer to start. times: how often as much
    work comes.
    """
    is_fresh, began = config.world.findings.needs_fresh, time.perf_counter()
    first, works = _live(config, works[0], is_fresh), works[1:]
    if processes < 2 or not works or (time.perf_counter() - began) * len(works) * times < _WORTH_S:
        return [first, *(_live(config, work, is_fresh) for work in works)]
    import joblib

    values = config.command.partition("_")[0], json.dumps(config.values)
    count = min(len(works), processes * _CHUNKS)
    chunks = [works[k * len(works) // count : (k + 1) * len(works) // count] for k in range(count)]
    with hydra.joblib_workers():
        jobs = [joblib.delayed(_live_chunk)(*values, is_fresh, chunk) for chunk in chunks]
        found = joblib.Parallel(n_jobs=processes)(jobs)
    return [first, *(lives for chunk in found for lives in chunk)]


@functools.lru_cache(maxsize=2)
def _config(command: str, values: str) -> Any:
    """The configuration of a worker, which makes the environment once."""
    settings = json.loads(values)
    return from_values(settings, schema_of(command, settings), command)


def _live_chunk(command: str, values: str, is_fresh: bool, works: Sequence[Work]) -> list[list[Lived]]:
    config = _config(command, values)
    return [_live(config, work, is_fresh) for work in works]


def _controller(config: EnvironmentConfig, work: Work) -> Controller:
    tested, step_s = config.controllers[work.number], config.environment.step_s
    return Controller(work.genes, config.network_made, tested.rule, signs=work.signs, step_s=step_s)


def _live(config: EnvironmentConfig, work: Work, is_fresh: bool) -> list[Lived]:
    controller, frozen = _controller(config, work), config.controllers[work.number].frozen
    return [
        config.world.live(controller, seed, frozen=frozen, record=work.record, is_fresh=is_fresh) for seed in work.seeds
    ]


def _findings(config: EnvironmentConfig) -> tuple[str, ...]:
    with refusing():
        return config.world.findings.notes


def _compile(config: EnvironmentConfig) -> None:
    """Load or compile the step of the controllers, before processes do."""
    genes = np.zeros(plan_of(config.network_made, type(config.rule)).genes)
    with compiling():
        _controller(config, Work(0, genes, ())).act(np.zeros(config.network_made.inputs))


@dataclass(frozen=True, kw_only=True)
class _Evaluator:
    """Runs the lifetimes of a population; see `evolution.evolve.Evaluator`."""

    config: EvolveEnvironment
    processes: int

    @property
    def lifetimes(self) -> int:
        return self.config.schedule.loops

    def evaluate(
        self,
        population: Floats,
        generation: int,
        measures: Sequence[str] = (),  # noqa: ARG002  # the maze has some
    ) -> tuple[Floats, Floats, dict[str, Floats], int]:
        seed, loops = self.config.seed, range(self.lifetimes)
        seeds = tuple(seed_of(seed, Stream.training_noise, generation, loop) for loop in loops)
        works = [Work(0, genes, seeds) for genes in population]
        found = run_lifetimes(self.config, works, self.processes, self.config.schedule.generations)
        fitness = np.array([np.mean([lived.rewards.sum() for lived in lives]) for lives in found])
        steps = sum(len(lived.rewards) for lives in found for lived in lives)
        return fitness, np.full(len(fitness), np.nan), {}, steps

    def again(self, genes: Floats, generation: int) -> None:
        """Not measured in an environment."""


@dataclass(frozen=True, kw_only=True)
class PreparedEnvironmentEvolution(PreparedEvolution):
    """An evolution in an environment, which begins at random genes, and remembers nothing of it."""

    config: EvolveEnvironment

    @property
    def notes(self) -> tuple[str, ...]:
        """What random actions show of the environment."""
        return _findings(self.config)

    def compile(self) -> None:
        """Load or compile what the lifetimes need."""
        _compile(self.config)

    def evolve(self, threads: int, after: Generation | None) -> Iterator[Generation]:
        """The generations of the evolution."""
        config, evaluator = self.config, _Evaluator(config=self.config, processes=threads)
        count = config.schedule.generations
        return search_generations(
            config.algorithm, evaluator, count, config.seed, after, network=self.network, rule=config.rule
        )

    def nominal(self, last: Generation, threads: int) -> None:
        """There are no nominal statistics of an environment."""

    @property
    def evolved_for(self) -> dict[str, Any]:
        """What the champion's file says of the world."""
        return {"robot": self.config.world.name, "lights": 0, "environment": self.config.world.name}


@prepare_evolution.register
def _(config: EvolveEnvironment, *, has_genome: bool = True) -> PreparedEnvironmentEvolution:  # noqa: ARG001
    network = config.network_made
    with refusing():
        search = check_start(config.algorithm, config.plan, config.seed)
    if search.measures:
        raise ConfigError(f"optimizer {config.algorithm.name}: `tell` gets fitness alone in an environment")
    return PreparedEnvironmentEvolution(config=config, network=network, plan=plan_of(network, type(config.rule)))


@dataclass(frozen=True, kw_only=True)
class PreparedEnvironmentEvaluation:
    """An evaluation in an environment; see `runs.evaluate.PreparedEvaluation`."""

    config: EvaluateEnvironment
    genome: Genome

    @property
    def notes(self) -> list[str]:
        """What a reader must know beside the table."""
        trained, rule = self.genome.environment, self.genome.rule
        notes = [] if trained in ("", self.config.world.name) else [f"This champion was evolved in {trained}."]
        is_off = rule and isinstance(self.config.rule, NoRule)
        notes += [f"This champion was evolved with the rule {rule}, which is off here."] if is_off else []
        return [*notes, *_findings(self.config)]

    @property
    def lifetime_ids(self) -> dict[str, str]:
        """For each controller a digest of what its lifetimes depend on, besides repeat and seed."""
        environment = {key: value for key, value in asdict(self.config.environment).items() if key != "processes"}
        everywhere = [self.genome.sha256, repr(self.genome.network), environment]
        return {one.name: digest([everywhere, repr(one), own_code(one.rule)]) for one in self.config.controllers}

    def compile(self) -> None:
        """Load or compile what the lifetimes need."""
        _compile(self.config)

    def remember(self, threads: int) -> None:
        """A champion of an environment remembers nothing of it."""

    def works(self, repeats: Iterable[int]) -> list[Work]:
        """The lifetimes of each controller, one by one; all have the same seeds."""
        config, genes = self.config, self.genome.genes
        drawn = signs_of_draw(config.rule.sign_draw, zlib.crc32(genes.tobytes()))
        control = signs(Sign.shuffled, config.network_made.synapses, drawn)
        return [
            Work(
                number,
                self.genome.plan.pick(genes, plan_of(config.network_made, type(tested.rule))),
                (seed_of(config.seed, Stream.evaluation_noise, repeat),),
                control if tested.rule.sign is Sign.shuffled and config.rule.sign is not Sign.shuffled else None,
                record=True,
            )
            for number, tested in enumerate(config.controllers)
            for repeat in repeats
        ]

    def run(self, threads: int) -> tuple[Rows, list[Lived]]:
        """Run the lifetimes, and a row of each."""
        config, works = self.config, self.works(range(self.config.repeats))
        lives = [lived for (lived,) in run_lifetimes(config, works, threads)]
        names = [config.controllers[work.number] for work in works]
        rows = [
            {
                "genome": self.genome.name,
                "environment": config.world.name,
                "change": config.change_text,
                "controller": tested.name,
                "N": float(tested.rule.N),
                "signal": str(tested.rule.signal) if tested.rule.N else "",
                "repeat": number % config.repeats,
                "seed": config.seed,
                **config.world.metrics(lived),
            }
            for number, (tested, lived) in enumerate(zip(names, lives, strict=True))
        ]
        return rows, lives

    def write(self, run: RunFolder, nominal: None, threads: int) -> Figures:  # noqa: ARG002  # others have one
        """Run the lifetimes, and write their tables. Returns what its figure needs."""
        import pandas as pd  # takes a while to load

        from epuckhebb.analysis import environments as analysis

        rows, lives = self.run(threads)
        names = [row["controller"] for row in rows]
        course = analysis.over_lifetime(names, lives, self.config.environment.horizon)
        metrics = pd.DataFrame(rows)
        table = analysis.table(metrics)
        run.write("metrics.csv", rows)
        run.write("lifetime.csv", course)
        run.write("table.csv", table)
        below = [*self.notes, *(analysis.unreached(table) if self.config.environment.changes else ())]
        run.write("table.md", "\n".join([analysis.readable(table).markdown(), *(f"{plain(note)}\n" for note in below)]))
        return {"lifetime": (pd.DataFrame(course),)}


@prepare_evaluation.register
def _(config: EvaluateEnvironment, genome: Genome | None = None) -> PreparedEnvironmentEvaluation:
    network = config.network_made
    if genome is None:
        genome = load_genome(config.genome, config.environment.name, network.wiring)
    if genome.network != replace(network, rewarded=genome.network.rewarded):
        evolved = f"a network {genome.network}{f' of {genome.robot}' if genome.robot else ''}"
        raise ConfigError(f"genome={genome.name} is for {evolved}, environment={config.world.name} has {network}")
    check_rules(genome, network, [(tested.name, tested.rule) for tested in config.controllers])
    return PreparedEnvironmentEvaluation(config=config, genome=genome)


def film(config: EvaluateEnvironment) -> bytes:
    """A GIF of the first lifetime of the rule of an evaluation, or of the network alone, drawn by the environment.

    It shows a frame a step: as many before the change as after it, or the first ones.
    """
    from PIL import Image, ImageOps

    prepared = prepare_evaluation(config)
    works = prepared.works(range(1))
    work, frames, step = works[min(1, len(works) - 1)], list[Any](), itertools.count()
    lived, change = _live(config, work, True)[0], config.world.split if config.environment.changes else math.inf
    begin = max(0, min(change, len(lived.rewards)) - _FRAMES // 2) if config.environment.changes else 0

    def watch(env: Any) -> None:
        if begin <= (now := next(step)) < begin + _FRAMES:
            frame = Image.fromarray(env.render()).reduce(2)
            frames.append(ImageOps.expand(frame, 4, "white" if now < change else _CHANGED))

    what = f"environment={config.world.name} cannot be drawn here"
    hint = "it needs a `render` that gives pictures; MuJoCo without a screen needs MUJOCO_GL=osmesa or egl"
    with refusing(lambda error: f"{what}: {error}; {hint}", Exception):  # a library may raise anything
        config.world.live(_controller(config, work), work.seeds[0], watch=watch)
    buffer = io.BytesIO()
    frames[0].save(buffer, "GIF", save_all=True, append_images=frames[1:], duration=_FRAME_MS, loop=0)
    return buffer.getvalue()
