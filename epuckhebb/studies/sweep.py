"""`epuckhebb sweep NAME`: plans the jobs that `conf/experiment/NAME.yaml` describes, and writes tables over all.

A job is named by a digest of its resolved configuration, its genome and the version of the science. A whole run in the
folder of that name is its result. The folder of a sweep is named by its jobs, so the same command finds it again.
"""

import csv
import functools
import io
import itertools
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import pandas as pd

from epuckhebb.analysis import ends, environments, evolutions, rescue, summary
from epuckhebb.analysis.lifetimes import Evaluated, Gathered, gather
from epuckhebb.analysis.statistics import interval_title
from epuckhebb.analysis.tables import Table
from epuckhebb.config import (
    OwnFile,
    Plain,
    alternatives,
    check_words,
    configurations,
    find_schema,
    hydra_arguments,
    make_config,
    readable,
    swept_values,
    user_sources,
)
from epuckhebb.controller.ranges import check_values
from epuckhebb.runs import evaluate_into, evolved, hydra, inherit_choices, prepare_evaluation
from epuckhebb.runtime import ConfigError, conf, say, yaml_file
from epuckhebb.store import (
    Content,
    Genome,
    Run,
    RunFolder,
    as_bytes,
    digest,
    fingerprint,
    load_genome,
    multirun_runs,
    write_atomic,
)
from epuckhebb.studies.jobs import Job, Outcome, split
from epuckhebb.studies.study import Planned, Study, prepare

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_HISTORY = "history.csv"  # what an evolution has, and an evaluation has not
_FILE = re.compile(r"[^\s,=\[{'\"]*\.py:(?=\w)")  # of FILE.py:NAME
_APART = ("seed", "repeats", "threads", "genome")  # keys that are checked by themselves


class Sweep(Study):
    """A named sweep, whose jobs are evaluations."""

    reference: ClassVar[str] = "sweep"
    reports_failures: ClassVar[bool] = True
    result: ClassVar[str] = "summary.csv"
    config_text = None

    def __init__(self, name: str, jobs: list[Job]) -> None:
        self.name, self.jobs = name, jobs

    @classmethod
    def run_name(cls, job: Plain) -> str:
        """The name of the run of a job, which follows from all that its results depend on."""
        return Identities().name(job)

    @classmethod
    def work(cls, path: Path, job: Plain, facts: dict[str, Any]) -> None:
        """Evaluate in the folder that the job is given."""
        config = make_config(job["config"], find_schema("evaluate", job["config"]), f"job {path}")
        evaluate_into(path, config, job["overrides"], facts, threads=hydra.threads_of_job(config.threads), is_many=True)

    @classmethod
    def stored(cls, run: Run) -> "Sweep":  # noqa: ARG003  # others need it
        """The sweep of a folder, without its jobs."""
        return cls("", [])

    @property
    def user_files(self) -> Mapping[Path, OwnFile]:
        """No file of the user's: each job has its own."""
        return {}

    def stages(self) -> list[tuple[str, list[Job]]]:
        """The evaluations of the sweep, in one stage."""
        return [(f"sweep {self.name}", self.jobs)]

    def folder(self, jobs: Sequence[Job]) -> Path:
        """The folder of the sweep, named by its jobs."""
        settings = digest([digest(conf.without(job.config, conf.NO_EFFECT)) for job in jobs])
        return Path("runs") / "sweep" / f"{self.name}_{settings[:8]}"

    def report(self, folder: RunFolder, planned: Planned, outcome: Outcome) -> None:
        """Write `sweep.csv`, `failed.csv` and the tables over all; the same jobs give bit-identical files."""
        failed = [{**_labels(job), **job.settings, "error": error} for job, error in outcome.failures]
        folder.write("failed.csv", pd.DataFrame(failed, columns=list(failed[0]) if failed else ["job", "run", "error"]))
        gathered = gather(
            [_evaluated(folder.path / job.run, job.settings, job.config, _labels(job)) for job in outcome.done]
        )
        folder.write("sweep.csv", gathered.rows)
        _write_tables(folder.path, folder.write, gathered, [job.config for job in outcome.done])
        folder.failure = planned.failure(outcome)

    def figures(self, run: Run) -> dict[str, "Figure"]:
        """Figures of the tables that it has, by name."""
        return figures(run)

    @classmethod
    def shown(cls, run: Run) -> list[Table]:
        """The summary of the sweep, as the terminal shows it."""
        files = {name: f"{name}.csv" for name in ("summary", "over_champions", "rescue_over_all", "ends")}
        if "return" in (table := run.table("summary.csv")):
            effects = [environments.readable_effects(run.table("effects.csv"))] if run.has("effects.csv") else []
            is_over_champions = (table.champions > 1).any()
            what, counts = ("champions", table.champions) if is_over_champions else ("lifetimes", table.lifetimes)
            return [environments.readable(table, f"Means, {interval_title(what, counts.tolist())}"), *effects]
        if "best_fitness" in table:
            return [evolutions.readable(table)]
        return summary.readable({name: run.table(file) for name, file in files.items() if run.has(file)})


def plan(name: str, arguments: list[str], config_dir: str | None = None) -> Planned:
    """List the jobs of a sweep, each composed and checked; two that would do the same are one."""
    named, (words, of_hydra) = [f"experiment={name}"], split("sweep", arguments)
    no_launcher = [word for word in of_hydra if not word.startswith("hydra.launcher.")]  # it is chosen for the jobs
    params = swept_values([*named, *no_launcher], config_dir)
    if not params:
        raise ConfigError(f"experiment={name} has no hydra.sweeper.params: it is one job, for `epuckhebb evaluate`")
    if "genome" not in params or any(word.startswith("genome=") for word in words):  # else champions are the sweep's
        arguments = inherit_choices(arguments, config_dir)
        words, _ = split("sweep", arguments)
    command, (_, *words) = hydra_arguments("evaluate", [*named, *words])
    words = readable([*(f"{key}={values}" for key, values in params.items()), *words])
    check_words(command, words, several=True)
    choices = alternatives(words)
    listed: dict[str, Job] = {}
    identities = Identities()
    for overrides, config in configurations(command, named, itertools.product(*choices.values()), config_dir):
        run = identities.name(config)
        listed.setdefault(run, Job(number=len(listed), overrides=[*named, *overrides], run=run, config=config))
    typed = [name, *arguments, *(["--config-dir", config_dir] if config_dir else [])]
    return prepare(Sweep(name, list(listed.values())), of_hydra, typed)


class Identities:
    """Names the runs of configurations, and checks these; what many share is checked once."""

    def __init__(self) -> None:
        self._shared: dict[str, Any] = {}
        self._genomes: dict[tuple[str, str], Genome] = {}
        self._load_genome = functools.cache(load_genome)

    def name(self, config: Plain) -> str:
        """The name of the run of a configuration, from all that its results depend on at this moment."""
        schema = find_schema("evaluate", config)
        try:
            check_values(schema, config)
        except ValueError as error:
            raise ConfigError(str(error)) from error
        shared = digest(conf.without(config, _APART))
        if shared not in self._shared:
            self._shared[shared] = make_config(config, schema, "a job")
        key = shared, config["genome"]
        if key not in self._genomes:
            job = self._shared[shared]
            genome = self._load_genome(config["genome"], job.world.experiment, job.shape)
            self._genomes[key] = prepare_evaluation(job, genome).genome
        return f"job_{fingerprint(conf.without(config, conf.NO_EFFECT), self._genomes[key], user_sources(config))}"


def summarise_multirun(folder: Path) -> None:
    """Write the tables and figures over all finished runs of a multirun of `evaluate`, or of `evolve`, into its folder.

    What is left out is said.
    """
    runs = multirun_runs(folder)
    for path in runs:
        if reason := Run(path).unfinished:
            say(f"Not counted: {reason}")
    finished = _finished(runs)
    if not finished:
        return

    def write(name: str, content: Content) -> None:
        write_atomic(folder / name, as_bytes(content))

    configs = [yaml_file.load(Run(path).config_file) for path in finished]
    if Run(finished[0]).has(_HISTORY):
        ways = _ways(finished)
        if copies := len(finished) - sum(len(histories) for _, histories in ways):
            say(f"{copies} of {len(finished)} evolutions are copies of others; each evolution counts once.")
        write("summary.csv", evolutions.summary(ways))
        _draw(folder, write, configs)
    else:
        pairs = zip(finished, configs, strict=True)
        gathered = gather([_evaluated(path, _settings(path), config, {}) for path, config in pairs])
        _write_tables(folder, write, gathered, configs)


def _settings(path: Path) -> dict[str, str]:
    """The settings of a run of a multirun, by key."""
    return Job(number=0, overrides=Run(path).provenance["overrides"], run="", config={}).settings


def _finished(runs: Sequence[Path]) -> list[Path]:
    return [path for path in runs if Run(path).is_whole]


def _ways(runs: Sequence[Path]) -> list[tuple[Mapping[str, Any], list[pd.DataFrame]]]:
    """The settings that finished evolutions differ in, but for the seed, and the histories of each, without copies.

    Those that went on for other times differ in their `generations`.
    """
    every, finished = list(map(_settings, runs)), [evolved(path) for path in runs]
    lengths = [str(len(history)) for _, history in finished]
    typed = [{key: value for key, value in settings.items() if key != "seed"} for settings in every]
    if any(len({n for n, settings in zip(lengths, typed, strict=True) if settings == same}) > 1 for same in typed):
        every = [{**settings, "generations": length} for settings, length in zip(every, lengths, strict=True)]
    keys = dict.fromkeys(key for settings in every for key in settings if key != "seed")
    differ = [key for key in keys if len({settings.get(key) for settings in every}) > 1]
    ways: dict[tuple[str, ...], list[Any]] = {}
    for evolution, settings in zip(finished, every, strict=True):
        ways.setdefault(tuple(settings.get(key, "") for key in differ), []).append(evolution)
    return [(dict(zip(differ, way, strict=True)), evolutions.distinct(group)) for way, group in ways.items()]


def shortened(names: Sequence[str]) -> list[str]:
    """Names in which each FILE.py:NAME is NAME, if they still differ."""
    short = [_FILE.sub("", name) for name in names]
    return short if len(set(short)) == len(names) else list(names)


def figures(run: Run) -> dict[str, "Figure"]:
    """The figures of the tables over all runs in a folder of a sweep or a multirun."""
    from epuckhebb.analysis import charts, end_charts  # matplotlib takes a while to load

    if (runs := _finished(multirun_runs(run.path))) and Run(runs[0]).has(_HISTORY):
        ways = _ways(runs)
        names = shortened([", ".join(way.values()) for way, _ in ways])
        named = dict(zip(names, (histories for _, histories in ways), strict=True))
        return {"learning": charts.learning_curves(named, ", ".join(ways[0][0]))}
    drawn = {
        "dose_response": ("doses.csv", charts.dose_response),
        "rescue_and_harm": (
            "rescue_over_all.csv",
            lambda rows: charts.rescue_and_harm(rows, run.table("rescue_and_harm.csv")),
        ),
        "ends": ("ends.csv", end_charts.ends),
        "returns": ("effects.csv", lambda _: charts.returns(run.table("summary.csv"))),
    }
    return {name: draw(run.table(file)) for name, (file, draw) in drawn.items() if run.has(file)}


def _write_tables(
    folder: Path, write: Callable[[str, Content], None], gathered: Gathered, configs: Sequence[Plain]
) -> None:
    """Write the tables, the page and the figures over all lifetimes. configs: all settings of each run."""
    rows, settings = gathered.rows, gathered.settings
    if "environment" in rows:
        tables = environments.tables(rows, settings)
    else:
        tables = {"summary": summary.summary(rows, settings)}
        if rows.empty:
            write("summary.csv", tables["summary"])
            return
        if summary.has_champions(rows):
            tables["over_champions"] = summary.champion_means(rows, settings)
            if not summary.has_trials(rows):
                tables |= ends.tables(rows, settings, ends.draws(config.get("compare") or {} for config in configs))
        if (doses := summary.dose_response(rows, settings)) is not None:
            tables["doses"] = doses
        if (harm := summary.rescue_and_harm(rows)) is not None:
            tables |= harm[0]
            picture = rescue.picture(_figure_kind(configs))
            write("report.md", "\n".join([harm[1], *picture, ends.markdown(tables["ends"])]))
    for name, table in tables.items():
        write(f"{name}.csv", table)
    _draw(folder, write, configs)


def _draw(folder: Path, write: Callable[[str, Content], None], configs: Sequence[Plain]) -> None:
    """Write the figures of the tables in a folder, unless no run has any."""
    if (kind := _figure_kind(configs)) != "none" and (drawn := figures(Run(folder))):
        from epuckhebb.analysis.image import image  # matplotlib takes a while to load

        for name, figure in drawn.items():
            write(f"figures/{name}.{kind}", image(figure, kind))


def _figure_kind(configs: Sequence[Plain]) -> str:
    """What figures over all runs are written to: as those of the first run that has any."""
    return next((str(config["figures"]) for config in configs if config["figures"] != "none"), "none")


def _evaluated(path: Path, settings: Mapping[str, str], config: Plain, labels: Mapping[str, str]) -> Evaluated:
    """A run and its lifetimes, whose numbers stay as text."""
    run = Run(path)
    facts = run.provenance
    rows = csv.DictReader(io.StringIO(run.content("metrics.csv").decode(), newline=""))
    return Evaluated(
        settings=settings,
        sha256=facts["genome_sha256"],
        ids=facts["lifetimes"],
        rows=pd.DataFrame(list(rows), dtype=str),
        labels=labels,
        config=dict(conf.flat(config)),
    )


def _labels(job: Job) -> dict[str, str]:
    """The first columns: which job, and which run folder."""
    return {"job": str(job.number), "run": job.run}
