"""An environment of Gymnasium as a world: its lifetimes, in processes, and what is written of them.

Environments hold the lock of Python, so lifetimes run in processes. What each is depends on its seed alone: results
are bit-identical with any number of processes.
"""

import functools
import inspect
import io
import itertools
import json
import math
import time
import zlib
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from epuckhebb.analysis.tables import Rows, plain
from epuckhebb.config import EnvironmentConfig, loaders
from epuckhebb.controller import random
from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.compiling.errors import PartError
from epuckhebb.controller.genome import make_plan
from epuckhebb.controller.network import Network
from epuckhebb.controller.plasticity.control import Sign, signs, signs_of_draw
from epuckhebb.controller.plasticity.rule import NoRule, Rule
from epuckhebb.controller.random import Stream
from epuckhebb.evolution.evolve import MOMENTS, Evaluator, training_signs
from epuckhebb.runs import hydra
from epuckhebb.runtime import ConfigError, compiling, refusing
from epuckhebb.store import Genome
from epuckhebb.worlds.environment import Lived
from epuckhebb.worlds.lives import Setup, Work, live_in_worker
from epuckhebb.worlds.spaces import RUNNING, merged
from epuckhebb.worlds.world import Figures, World, Write

_CHUNKS = 4  # of the work of each process, whose parts take different times
_WORTH_S = 20.0  # of work, from which on processes are worth their start
_MOST_SEED = 2**31 - 1
_KEPT = ["options", "scale", "step_s", "reads_reward", "learns_after_move"]  # settings that a champion's file keeps
_KEPT += ["reward_scale", "reward_weights", "neutral_fitness"]
_FRAMES, _FRAME_MS, _CHANGED = 200, 40, "#D55E00"  # of a film; around what is after a change


def environment_seed(seed: int, stream: Stream, *place: int) -> int:
    """The seed of an environment at a place in a study."""
    return int(random.key(seed, stream, *place)) & _MOST_SEED


def make_setup(config: EnvironmentConfig) -> Setup:
    """What the lifetimes of a run need."""
    rules = tuple(controller.rule for controller in config.controllers)
    return Setup(config.world, config.network_made, rules, judge=config.judge)


def run_lifetimes(
    config: EnvironmentConfig, works: Sequence[Work], processes: int, times: int = 1, scale: Any = None
) -> list[list[Lived]]:
    """Run lifetimes in so many processes; for each work a list, in the order of its seeds.

    Those of a compiled environment run in threads. The first work is run here, and so are all others if processes would
    take longer to start. times: how often as much work comes. scale: of training with `environment.scale=running`.
    """
    setup = make_setup(config)._replace(is_fresh=config.world.findings.needs_fresh)
    if scale is not None:
        setup = setup._replace(world=config.world.rescaled(scale, in_training=True))
    began = time.perf_counter()
    first, works = setup.live(works[0]), works[1:]
    if config.world.is_compiled(config.judge):
        with ThreadPoolExecutor(processes) as pool:
            return [first, *pool.map(setup.live, works)]
    if processes < 2 or not works or (time.perf_counter() - began) * len(works) * times < _WORTH_S:
        return [first, *map(setup.live, works)]
    import cloudpickle  # which Gymnasium brings, and which pickles classes of a notebook, too
    import joblib

    sent = cloudpickle.dumps(setup._replace(world=replace(setup.world)))  # without the environment that it keeps
    count = min(len(works), processes * _CHUNKS)
    chunks = [works[k * len(works) // count : (k + 1) * len(works) // count] for k in range(count)]
    with hydra.joblib_workers():
        jobs = [joblib.delayed(live_in_worker)(loaders(config.values), sent, chunk) for chunk in chunks]
        found = joblib.Parallel(n_jobs=processes)(jobs)
    return [first, *(lives for chunk in found for lives in chunk)]


@dataclass(frozen=True, kw_only=True)
class _Evaluator(Evaluator):
    """Runs the lifetimes of a population."""

    config: Any
    processes: int

    @property
    def lifetimes(self) -> int:
        """How many lifetimes each individual runs in a generation."""
        return int(self.config.schedule.loops)

    def evaluate(
        self,
        population: Floats,
        generation: int,
        measures: Sequence[str] = (),  # noqa: ARG002  # the maze has some
        moments: Floats | None = None,
    ) -> tuple[Floats, Floats, dict[str, Floats], int]:
        """Mean fitness of each individual, nan for success, at most `MOMENTS`, and the steps that were run."""
        world = self.config.world
        scale = RUNNING if world.settings.scale == RUNNING else None
        if moments is not None:
            scale = world.read.frozen(moments)
        seed, loops = self.config.seed, range(self.lifetimes)
        seeds = tuple(environment_seed(seed, Stream.training_noise, generation, loop) for loop in loops)
        signs = training_signs(self.config.rule, self.config.network_made, seed)
        works = [Work(0, genes, seeds, signs) for genes in population]
        found = run_lifetimes(self.config, works, self.processes, self.config.schedule.generations, scale)
        fitness = np.array([np.mean([lived.fitness for lived in lives]) for lives in found])
        steps = sum(len(lived.rewards) for lives in found for lived in lives)
        read = [lived.moments for lives in found for lived in lives if lived.moments is not None]
        told = {}
        if read:
            past = np.zeros_like(read[0]) if moments is None else moments
            told = {MOMENTS: np.array([past, functools.reduce(merged, read, past)])}
        return fitness, np.full(len(fitness), np.nan), told, steps


def _picture(env: Any) -> Any:
    """What an environment draws of itself; a PartError if it is no picture."""
    try:
        picture = env.render()
    except NotImplementedError as error:
        raise PartError(str(error) or "it has no `render`") from error
    if not isinstance(picture, np.ndarray) or picture.ndim != 3 or picture.dtype != np.uint8:
        kind = f"numbers of {picture.dtype}, {picture.shape}" if isinstance(picture, np.ndarray) else type(picture)
        raise PartError(f"its `render` gave {getattr(kind, '__name__', kind)}, and no picture")
    return picture


def _not_drawn(world: Any, error: Exception) -> str:
    """Why an environment cannot be drawn, and what a film needs of it."""
    place, entry = world.settings.id, world.make.entry
    if entry is None:
        hint = "MuJoCo without a screen needs MUJOCO_GL=osmesa or egl"
        return f"environment={world.name} cannot be drawn: {error}; {hint}"
    options = inspect.signature(entry).parameters
    takes = "render_mode" in options or any(option.kind is option.VAR_KEYWORD for option in options.values())
    why = error if takes else "it takes no render_mode"
    return (
        f"{Path(place).name} cannot be drawn: {why}; a film needs a class that takes render_mode='rgb_array', and "
        "whose `render` (of a `Compiled`, its `picture`) gives a picture: (height, width, 3), of uint8. A run has a "
        "copy of the file: mend yours, and evaluate again"
    )


@dataclass(frozen=True)
class Gymnasium(World):
    """The environment of a run of `evaluate` or `evolve`. config: its settings."""

    config: Any

    @property
    def identity(self) -> tuple[Any, ...]:
        """The settings of the environment, but for its processes."""
        return ({key: value for key, value in asdict(self.config.environment).items() if key != "processes"},)

    def facts(self, moments: Floats | None) -> Mapping[str, Any]:
        """The name of the environment, how it is read, and the name of what evolution maximised."""
        world, judge, kept = self.config.world, self.config.judge, self._kept_settings
        if moments is not None:
            kept["scale"] = world.read.frozen(moments[0])
        name, its = world.name, {"environment": world.name, "environment_settings": json.dumps(kept)}
        return {"robot": name, "lights": 0, **its, "fitness_function": judge.name if judge else ""}

    @property
    def _kept_settings(self) -> dict[str, Any]:
        """The settings on which it depends what a controller reads and is rewarded for, whatever happens later."""
        kept: dict[str, Any] = json.loads(
            json.dumps({key: getattr(self.config.environment, key) for key in _KEPT}, default=str)
        )
        return kept

    def check_genome(self, genome: Genome) -> None:
        """Refuse a genome for another network."""
        if genome.network != self.config.network_made:
            evolved = f"a network {genome.network}{f' of {genome.robot}' if genome.robot else ''}"
            here = f"environment={self.config.world.name} has {self.config.network_made}"
            raise ConfigError(f"genome={genome.name} is for {evolved}, {here}")

    def champion_settings(self, genome: Genome) -> Any:
        """The settings, with the scale that its training left to a champion where `environment.scale` is running."""
        if self.config.environment.scale != RUNNING:
            return self.config
        if not genome.environment_settings:
            needed = f"environment.scale={RUNNING} needs a champion of an environment"
            raise ConfigError(f"{needed}, got genome={genome.name}")
        scale = json.loads(genome.environment_settings)["scale"]
        return replace(self.config, environment=replace(self.config.environment, scale=scale))

    def notes(self, genome: Genome | None = None) -> list[str]:
        """What random actions show of the environment, and how the evolution of a champion differs."""
        notes, name = list[str](), self.config.world.name
        if genome is not None and genome.environment not in ("", name):
            notes.append(f"This champion was evolved in {genome.environment}.")
        elif genome is not None and genome.environment_settings:
            before, here = json.loads(genome.environment_settings), self._kept_settings
            others = [f"environment.{key}={before[key]}, not {here[key]}" for key in _KEPT if before[key] != here[key]]
            notes += [f"This champion was evolved with {other}." for other in others]
        if genome is not None and genome.rule and isinstance(self.config.rule, NoRule):
            notes.append(f"This champion was evolved with the rule {genome.rule}, which is off here.")
        with refusing():
            return [*notes, *self.config.world.findings.notes]

    def compile(self, network: Network) -> None:
        """Load or compile the step of the controllers, before processes do."""
        setup = make_setup(self.config)
        with compiling(), refusing():
            for number, controller in enumerate(self.config.controllers):
                genes = np.zeros(make_plan(network, type(controller.rule)).genes)
                setup.controller(Work(number, genes, ())).act(np.zeros(network.inputs))
                if self.config.judge:
                    setup.live(Work(number, genes, (0,)))

    def works(self, genome: Genome, repeats: Iterable[int], *, record: bool = True) -> list[Work]:
        """The lifetimes of each controller, one by one; all have the same seeds."""
        config, genes = self.config, genome.genes
        place = zlib.crc32(genes.tobytes())

        def draw_signs(rule: Rule) -> Floats:
            if rule.sign is Sign.shuffled and genome.signs is not None:
                return genome.signs
            return signs(rule.sign, config.network_made.synapses, signs_of_draw(rule.sign_draw, place))

        return [
            Work(
                number,
                genome.plan.pick(genes, make_plan(config.network_made, type(tested.rule))),
                (environment_seed(config.seed, Stream.evaluation_noise, repeat),),
                draw_signs(tested.rule),
                record=record,
            )
            for number, tested in enumerate(config.controllers)
            for repeat in repeats
        ]

    def run(
        self,
        genome: Genome,
        nominal: None,  # noqa: ARG002  # the maze has one
        threads: int,
        *,
        record: bool = True,
    ) -> tuple[Rows, list[Lived]]:
        """Run the lifetimes, and a row of each."""
        config, works = self.config, self.works(genome, range(self.config.repeats), record=record)
        lives = [lived for (lived,) in run_lifetimes(config, works, threads)]
        names = [config.controllers[work.number] for work in works]
        rows = [
            {
                "genome": genome.name,
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

    def write(self, write: Write, genome: Genome, rows: Rows, recorded: list[Lived]) -> Figures:
        """Write the table of returns, and what happened over a lifetime."""
        import pandas as pd  # takes a while to load

        from epuckhebb.analysis import environments as analysis

        names, environment = [row["controller"] for row in rows], self.config.environment
        course = analysis.lifetime_course(names, recorded, environment.horizon)
        table = analysis.table(pd.DataFrame(rows))
        write("lifetime.csv", course)
        write("table.csv", table)
        below = [*self._yardsticks(), *self.notes(genome), *(analysis.unreached(table) if environment.changes else ())]
        write("table.md", "\n".join([analysis.readable(table).markdown(), *(f"{plain(note)}\n" for note in below)]))
        return {"lifetime": (pd.DataFrame(course),)}

    def _yardsticks(self) -> list[str]:
        """What scripted controllers earn in the same lifetimes, in a line, of an environment that has some."""
        config = self.config
        seeds = [environment_seed(config.seed, Stream.evaluation_noise, repeat) for repeat in range(config.repeats)]
        means = [f"{name} {value:.1f}" for name, value in config.world.yardsticks(seeds).items()]
        return [f"Scripted, in the same lifetimes: {', '.join(means)}."] if means else []

    def table(self, rows: Rows, recorded: list[Lived]) -> Any:  # noqa: ARG002  # the maze needs it
        """A row for each controller: means, with intervals of returns."""
        import pandas as pd

        from epuckhebb.analysis import environments as analysis

        return analysis.table(pd.DataFrame(rows)).set_index("controller")

    def arrays(self, genome: Genome, recorded: list[Lived]) -> dict[str, Any]:  # noqa: ARG002  # the maze needs it
        """Each lifetime step by step, (lifetimes, horizon); nan after its end."""
        shape = len(recorded), self.config.environment.horizon
        arrays = {name: np.full(shape, np.nan) for name in ("reward", "weight_change", "weight_step")}
        for number, lived in enumerate(recorded):
            steps = (lived.rewards, lived.weight_changes, lived.weight_steps)
            for array, values in zip(arrays.values(), steps, strict=True):
                array[number, : len(values)] = values
        return arrays

    def film(self, genome: Genome) -> bytes:
        """A GIF of the first lifetime of the rule, or of the network alone, drawn by the environment.

        It shows a frame a step: as many before the change as after it, or the first ones.
        """
        from PIL import Image, ImageOps

        config = self.config
        works, setup = self.works(genome, range(1)), make_setup(config)
        work = next(work for work in works if config.controllers[work.number].rule == config.rule)
        frames, step = list[Any](), itertools.count()
        lived, change = setup.live(work)[0], config.world.split if config.environment.changes else math.inf
        begin = max(0, min(change, len(lived.rewards)) - _FRAMES // 2) if config.environment.changes else 0

        def watch(env: Any) -> None:
            if begin <= (now := next(step)) < begin + _FRAMES:
                frame = Image.fromarray(_picture(env)).reduce(2)
                frames.append(ImageOps.expand(frame, 4, "white" if now < change else _CHANGED))

        with refusing(lambda error: _not_drawn(config.world, error), Exception):  # a library may raise anything
            config.world.live(setup.controller(work), work.seeds[0], watch=watch)
        buffer = io.BytesIO()
        frames[0].save(buffer, "GIF", save_all=True, append_images=frames[1:], duration=_FRAME_MS, loop=0)
        return buffer.getvalue()

    def evaluator(self, network: Network, threads: int) -> _Evaluator:  # noqa: ARG002  # it is that of the settings
        """What runs the lifetimes of an evolution."""
        return _Evaluator(config=self.config, processes=threads)
