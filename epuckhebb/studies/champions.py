"""Jobs that evolve champions and test them in many worlds; leaderboards and reproductions are made of them.

A job is named by all that its result depends on: its settings, the job of its champion, the worlds, the user's own
rules, the science.
"""

import functools
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from epuckhebb.analysis import leaderboard as board
from epuckhebb.analysis import reproduction
from epuckhebb.analysis.tables import Rows
from epuckhebb.config import EvaluateConfig, EvolveConfig, OwnFile, Plain, dump, load, make_config, own_files
from epuckhebb.runs import (
    PreparedEvaluation,
    earlier_champions,
    evolve_into,
    hydra,
    prepare_evaluation,
    prepare_evolution,
)
from epuckhebb.runtime import JobFailedError
from epuckhebb.store import RunFolder, digest
from epuckhebb.studies.jobs import Job
from epuckhebb.studies.study import Study, job_name
from epuckhebb.tmaze.fitness import Signal


class ChampionStudy(Study):
    """A study whose jobs evolve champions, or test them."""

    @classmethod
    def run_name(cls, job: Plain) -> str:
        """The name of the run of a job, which follows from all that its results depend on."""
        worlds, config_dir = tuple(job.get("worlds", ())), job.get("config_dir")
        depends = {key: value for key, value in job.items() if key != "config_dir"}
        depends["config"] = {key: value for key, value in job["config"].items() if key != "genome"}
        depends["worlds"] = worlds_digest(worlds, config_dir)
        return job_name("test" if worlds else "champion", depends)

    @property
    def user_files(self) -> Mapping[Path, OwnFile]:
        """The user's files on which the study depends."""
        jobs = (job for _, stage in self.stages() for job in stage)
        return {file: copies for job in jobs for file, copies in own_files(job.config["config"]).items()}

    @classmethod
    def work(cls, path: Path, job: Plain, facts: dict[str, Any]) -> None:
        """Evolve a champion, or test one, in the folder that the job is given."""
        settings, folder = job["config"], path.parents[1]
        values = dict(settings["config"])
        if settings["champion"]:
            values["genome"] = str(folder / settings["champion"])
        if "worlds" in settings:
            _test(path, make_config(values, EvaluateConfig, f"job {path}"), settings, job["overrides"], facts)
            return
        config = make_config(values, EvolveConfig, f"job {path}")
        prepared = prepare_evolution(config)
        prepared.compile()
        threads = hydra.threads_of_job(config.threads)
        evolve_into(path, prepared, job["overrides"], facts, threads=threads, is_many=True)


def make_job(overrides: list[str], config: Plain, *, champion: str = "", purpose: str = "", **more: Any) -> Job:
    """A job that evolves a champion or, if it is given `worlds`, tests one.

    champion: the run of the champion that it tests, or whose weights it is given; "" for the genome of `config`. more:
    `worlds`, by name; `config_dir`, where the user's are; `name` of the champion in tables; `rates`, `signal` and
    `experiment` for the paper's rule and its controls in place of the controllers of `config`; `course`, shares of the
    evolution after which its champions are tested, too.
    """
    job = {"config": config, "champion": champion, **more}
    return Job(number=0, overrides=overrides, run=ChampionStudy.run_name(job), config=job, purpose=purpose)


@functools.cache
def world_evaluation(name: str, config_dir: str | None) -> EvaluateConfig:
    """An evaluation of genes in a world: the name of a scenario, and of changes, with + between them."""
    scenario, *changes = name.split("+")
    return scenario_evaluation(scenario, (f"change={changes}", "hebbian=none"), config_dir)


@functools.cache
def scenario_evaluation(
    scenario: str, words: tuple[str, ...] = ("hebbian=none",), config_dir: str | None = None
) -> EvaluateConfig:
    """An evaluation that records nothing, of the genes alone unless the words add plasticity."""
    return load(EvaluateConfig, [f"scenario={scenario}", "lifetime.record_every=0", *words], config_dir)


@functools.cache
def worlds_digest(worlds: tuple[str, ...], config_dir: str | None) -> str:
    """A digest of worlds: equal for equal worlds."""
    return digest({name: repr(world_evaluation(name, config_dir).world) for name in worlds})


def move_world(prepared: PreparedEvaluation, target: EvaluateConfig) -> PreparedEvaluation:
    """An evaluation in the world of another one of its experiment, for as long as lifetimes last there.

    The physics is that of the world if a change brings it, as `3d` does.
    """
    world = target.world
    if world.name == prepared.config.world.name:
        return prepared
    brought = ["scenario", "change", "maze", "robot", "task"]
    brought += ["physics"] if any("physics" in change for change in target.change.values()) else []
    lifetime = replace(prepared.config.lifetime, duration_s=world.paper_duration_s)
    settings = {name: getattr(target, name) for name in brought}
    return replace(prepared, config=replace(prepared.config, lifetime=lifetime, **settings))


def _test(path: Path, config: EvaluateConfig, job: Plain, overrides: list[str], facts: dict[str, Any]) -> None:
    """Evaluate a champion in all worlds."""
    if "rates" in job:
        controllers = reproduction.controllers(job["experiment"], job["rates"], Signal[job["signal"]])
        config = replace(config, tested=controllers)
    prepared, threads = prepare_evaluation(config), hydra.threads_of_job(config.threads)
    genome = prepared.genome
    prepared = replace(prepared, genome=replace(genome, name=job.get("name", genome.name)))
    prepared.world.compile(genome.network)
    facts = {"seed": config.seed, "genome": genome.name, "genome_sha256": genome.sha256, **facts}
    command, text, code = facts["command_line"][1], dump(config), own_files(config.values)
    with RunFolder.resume(path, command, text, overrides, facts, code, overrides=overrides) as run:

        def tested(genes: NDArray[np.float64]) -> pd.DataFrame:
            rows: Rows = []
            champion = replace(prepared, genome=replace(prepared.genome, genes=genes))
            for name in job["worlds"]:
                moved = move_world(champion, world_evaluation(name, job.get("config_dir")))
                rows += moved.run(threads)[0]
            return pd.DataFrame(rows)

        metrics = tested(genome.genes)
        if genome.sha256 != facts["genome_sha256"]:
            raise JobFailedError(f"the genes of {genome.name} changed in its lifetimes")
        run.write("metrics.csv", metrics)
        if "course" in job:
            training_world, *_ = job["worlds"]
            evolution = earlier_champions(path.parents[1] / job["champion"], job["course"])
            course = [
                {"robot_steps": n, **board.champion_counts(tested(genes), training_world)[0]} for n, genes in evolution
            ]
            run.write("course.csv", pd.DataFrame(course)[["robot_steps", "trials", "successes"]])
