"""A study: many jobs, then tables, figures and a page over their runs. Each is one file with a subclass of `Study`."""

import copy
import importlib
import inspect
import json
import re
import shutil
from collections.abc import Mapping, Sequence
from contextlib import chdir
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Self

import pandas as pd

from epuckhebb.analysis.tables import Table, pictures
from epuckhebb.config import (
    SWEEP_DIR,
    Checked,
    OwnFile,
    Plain,
    class_named,
    dump,
    format_overrides,
    make_config,
    override_value,
    own_files,
    settings,
    user_references,
    values_of,
)
from epuckhebb.runs import hydra
from epuckhebb.runs.jobs import failure_text
from epuckhebb.runtime import (
    ConfigError,
    JobFailedError,
    conf,
    is_interruption,
    is_of_handler,
    reason_of_failure,
    refusing,
    say,
    user_path,
    yaml_file,
)
from epuckhebb.store import STATUS, Run, RunFolder, as_json, digest, fingerprint, write_atomic
from epuckhebb.studies.jobs import JOBS, LIST, Job, Outcome, launch, split, todo

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_SHOWN = 30  # rows of a table of a user's study that its page and the terminal show


@dataclass(kw_only=True)
class Study(Checked):
    """Base of all studies. The fields of a subclass are its settings, with which its command is called.

    A study of your own has `plan` and `do`, and as you like `tables`, `figures` and `page`. Its command is
    `epuckhebb sweep FILE.py:NAME KEY=VALUE ...`; the same command resumes it. The other methods serve the studies of
    the program, whose jobs depend on each other.

    Attributes:
        command: Its command.
        reference: What a worker finds its class by: its command, or FILE.py:NAME.
        reports_failures: Whether it writes its tables although jobs failed.
        result: A file that is there when the tables are.
    """

    command: ClassVar[str] = "sweep"
    reference: ClassVar[str] = ""
    reports_failures: ClassVar[bool] = False
    result: ClassVar[str] = "report.md"

    def plan(self) -> Sequence[Plain]:
        """The jobs: for each a mapping with all that `do` needs, of values that JSON has."""
        raise NotImplementedError

    @classmethod
    def do(cls, job: Plain) -> Mapping[str, pd.DataFrame]:
        """Do a job; returns its tables by name. The result must depend on `job` and your files alone."""
        raise NotImplementedError

    def tables(self, runs: Sequence[Run]) -> Mapping[str, pd.DataFrame]:
        """Tables over all jobs, by name. runs: their folders in the order of `plan`; `run.table("NAME.csv")` reads."""
        names = [file.name for file in sorted(runs[0].path.glob("*.csv"))]
        return {name.removesuffix(".csv"): pd.concat([run.table(name) for run in runs]) for name in names}

    def figures(self, run: Run) -> Mapping[str, "Figure"]:  # noqa: ARG002  # others need it
        """Figures by name, of the tables in the folder of the study. The label of a figure is its caption."""
        return {}

    def page(self, run: Run, captions: Mapping[str, str]) -> str:
        """The page of the study in Markdown. captions: of the figures, by name."""
        parts = [f"# {type(self).__name__}\n", f"{inspect.cleandoc(self.__doc__ or '')}\n", *pictures(captions)]
        return "\n".join([*parts, *(f"## {table.title}\n\n{table.markdown()}" for table in self.shown(run))])

    @classmethod
    def shown(cls, run: Run) -> list[Table]:
        """The tables that the terminal shows of a finished study."""
        frames = {file.stem: run.table(file.name) for file in sorted(run.path.glob("*.csv"))}
        return [
            Table(list(frame), frame.head(_SHOWN).map(_cell).to_numpy().tolist(), name)
            for name, frame in frames.items()
        ]

    # What follows is for studies of the program.

    @classmethod
    def stored(cls, run: Run) -> Self:
        """The study of a folder, with the settings that it was called with."""
        return make_config(settings(run.config_file), cls, str(run.path))

    @property
    def user_files(self) -> Mapping[Path, OwnFile]:
        """The user's files on which the study depends."""
        return own_files({**self.values, "study": self.reference})

    def stages(self) -> list[tuple[str, list[Job]]]:
        """What is done, one after the other, each with its jobs."""
        with refusing(lambda error: f"{self.label}: the plan must be mappings of JSON values: {error}", TypeError):
            plan = json.loads(json.dumps(list(self.plan())))
        if not plan:
            raise ConfigError(f"{self.label}: the plan has no job")
        jobs = [
            Job(number=number, overrides=format_overrides(job), run=self.run_name(job), config=job)
            for number, job in enumerate(plan)
        ]
        return [("run", jobs)]

    @classmethod
    def run_name(cls, job: Plain) -> str:
        """The name of the run of a job, which follows from all that its results depend on."""
        return job_name("job", {"config": job, "study": cls.reference})

    @classmethod
    def work(cls, path: Path, job: Plain, facts: dict[str, Any]) -> None:
        """Do a job in the folder that it is given."""
        config = job["config"]
        code = own_files({"study": cls.reference, **config})
        text = yaml_file.dump(config)
        words = job["overrides"]
        with RunFolder.resume(path, cls.command, text, words, facts, code, overrides=words) as run:
            for name, table in cls.do(config).items():
                run.write(f"{_checked(name)}.csv", table)

    def folder(self, jobs: Sequence[Job]) -> Path:
        """The folder of the study unless the user names one, by all that it depends on."""
        return Path("runs") / self.command / f"{self.label}_{digest([job.run for job in jobs])[:8]}"

    @property
    def label(self) -> str:
        """The first part of the name of the study's folder."""
        return type(self).__name__

    @property
    def config_text(self) -> str | None:
        """The settings of the study as YAML; None if each job has its own."""
        return dump(self)

    def report(self, folder: RunFolder, planned: "Planned", outcome: Outcome) -> None:  # noqa: ARG002  # others need it
        """Write the tables, the figures and the page over all runs."""
        for name, table in self.tables([Run(folder.path / job.run) for job in planned.jobs]).items():
            folder.write(f"{_checked(name)}.csv", table)
        from epuckhebb.analysis.image import image, small  # matplotlib takes a while to load
        from epuckhebb.analysis.page import study_page

        run = Run(folder.path)
        figures = {f"{_checked(name)}.png": figure for name, figure in self.figures(run).items()}
        captions = {name: str(figure.get_label()) or name for name, figure in figures.items()}
        pictures = {name: small(image(figure)) for name, figure in figures.items()}
        for name, picture in pictures.items():
            folder.write(f"figures/{name}", picture)
        text = self.page(run, captions)
        folder.write("report.md", text)
        title = text.partition("\n")[0].removeprefix("# ")
        folder.write("report.html", study_page(text, pictures.__getitem__, f"epuckhebb: {title}"))


@dataclass(frozen=True, kw_only=True)
class Planned:
    """A study, its jobs and its folder; the arguments of Hydra's launcher, and what followed the command."""

    study: Study
    stages: list[tuple[str, list[Job]]]
    folder: Path
    launcher: list[str]
    arguments: list[str]

    @property
    def jobs(self) -> list[Job]:
        """All jobs, in the order in which they need each other."""
        return [job for _, jobs in self.stages for job in jobs]

    def failure(self, outcome: Outcome) -> str:
        """What failed, in short; "" if nothing did."""
        names = [(job.run, why) for job, why in outcome.failures]
        return failure_text(names, len(self.jobs))


def prepare(study: Study, of_hydra: Sequence[str], arguments: list[str]) -> Planned:
    """List the jobs of a study; nothing is written. of_hydra: Hydra's overrides. arguments: after the command."""
    stages = study.stages()
    jobs = [job for _, of_stage in stages for job in of_stage]
    folders = [override_value(argument) for argument in of_hydra if argument.startswith(SWEEP_DIR)]
    launcher = [argument for argument in of_hydra if not argument.startswith(SWEEP_DIR)]
    if not any(argument.startswith("hydra/launcher=") for argument in launcher):  # one job alone takes all cores
        launcher.insert(0, f"hydra/launcher={'joblib' if len(jobs) > 1 else 'basic'}")
    folder = Path(folders[-1]) if folders else study.folder(jobs)
    return Planned(study=study, stages=stages, folder=folder, launcher=launcher, arguments=arguments)


def plan_user_study(reference: str, arguments: list[str]) -> Planned:
    """Plan a study of the user's. reference: FILE.py:NAME. arguments: overrides, of the study and of Hydra."""
    overrides, of_hydra = split("sweep", arguments)
    study = make_config(values_of(overrides), _user_study(reference), f"sweep {reference}")
    try:
        return prepare(study, of_hydra, [reference, *arguments])
    except ConfigError:
        raise
    except Exception as error:  # what a user's plan may raise has no end
        raise ConfigError(f"sweep {reference}: {type(error).__name__}: {error}") from error


def conduct(planned: Planned, batch: int = 1) -> Outcome:
    """Do the jobs that are missing, one stage after the other, then write tables, figures and page.

    batch: how many jobs a start of the launcher does, one after the other.

    Raises:
        JobFailedError: A job failed, and the study writes nothing of the others.
    """
    study, jobs = planned.study, planned.jobs
    facts = {"seed": study.seed} if hasattr(study, "seed") else {}
    code, arguments = study.user_files, planned.arguments
    with RunFolder.resume(planned.folder, study.command, study.config_text, arguments, facts, code) as folder:
        folder.left_behind = lambda: (
            f"{len(jobs) - len(todo(folder.path, jobs))} of {len(jobs)} jobs are done; the same command does the rest"
        )
        for what, stage in planned.stages:
            missing = len(todo(folder.path, stage))
            say(f"{what}: {len(stage)} jobs, {len(stage) - missing} done before, {missing} to do.")
            outcome = launch(folder, study.reference, stage, planned.launcher, study_job, batch)
            if outcome.failures and not study.reports_failures:
                raise JobFailedError(f"{what}: {planned.failure(outcome)}")
        study.report(folder, planned, outcome)
        folder.remove_stale()  # an earlier call with other jobs may have used the folder
    return outcome


def study_job(cfg: Any) -> None:
    """Do jobs of a study one after the other, in the process that the launcher gives them.

    cfg: what Hydra knows of them: their names. The study's `run_name` must still give this name. Its `work` gets a
    folder, which is renamed afterwards, and facts for `provenance.json`. A job that fails leaves its reason there, and
    the next one is done.
    """
    first, runs = hydra.output_folder(), [str(run) for run in cfg.job]
    stamp = first.name.removesuffix(runs[0])
    for run in runs:
        attempt = first.with_name(f"{stamp}{run}")
        attempt.mkdir(parents=True, exist_ok=True)
        try:
            with chdir(Path.cwd()):  # a part of the user's may go elsewhere
                _do_job(attempt, run)
        except Exception as error:
            if is_interruption(error) or is_of_handler(error):
                raise
            if not Run(attempt).recorded_status:
                write_atomic(attempt / STATUS, as_json({"state": "failed", "error": reason_of_failure(error)}))


def _do_job(attempt: Path, run: str) -> None:
    """Do a job in the folder of an attempt, and rename this into its place among the results."""
    folder = attempt.parents[1]
    if Run(folder / run).is_whole:  # the start has begun again, on a cluster
        attempt.rmdir()
        return
    listed = Run(folder).json(LIST)
    study, job = find_study(listed["name"]), Run(folder).json(f"{JOBS}/{run}.json")
    if study.run_name(job["config"]) != run:
        raise JobFailedError(f"{run}: the genome or the program has changed since the study began")
    study.work(attempt, job, {"command_line": listed["command_line"], "sweep": listed["name"]})
    try:
        attempt.rename(folder / run)
    except OSError:
        if not Run(folder / run).is_whole:  # else a worker of a killed call has just done the same
            raise
        shutil.rmtree(attempt)


def find_study(reference: str) -> type[Study]:
    """The class of a study by its command, or by FILE.py:NAME."""
    if ":" in reference:
        return _user_study(reference)
    module = importlib.import_module(f"epuckhebb.studies.{reference}")
    kinds = (kind for kind in vars(module).values() if isinstance(kind, type) and issubclass(kind, Study))
    return next(kind for kind in kinds if kind.__module__ == module.__name__ and kind.reference == reference)


def job_name(kind: str, depends: Plain) -> str:
    """The name of the run of a job: by what it depends on, the user's files, wherever they are, and the program."""
    code = own_files(depends)
    depends = copy.deepcopy(conf.without(depends, conf.NO_EFFECT))
    if "config" in depends:
        depends["config"] = conf.without(depends["config"], conf.NO_EFFECT)
    for part, key, _, name in list(user_references(depends)):
        part[key] = name
    return f"{kind}_{fingerprint(depends, user_code=[file.digest for file in code.values()])}"


def _user_study(reference: str) -> type[Study]:
    """The class of a user's study, FILE.py:NAME; it must have `plan` and `do`."""
    file, _, name = reference.rpartition(":")
    path = user_path(file, "sweep").absolute()
    kind = class_named(f"{path}:{name}", Study, "sweep")
    for method in ("plan", "do"):
        if inspect.getattr_static(kind, method) is inspect.getattr_static(Study, method):
            raise ConfigError(f"sweep {reference}: the study has no method `{method}`")
    kind.reference = f"{path}:{name}"
    return kind


def _checked(name: str) -> str:
    """Refuse a name of a table or a figure that is no name of a file, for example one with a slash; returns it."""
    if not re.fullmatch(r"\w[\w.-]*", name):
        raise ConfigError(
            f"a table or a figure of a study is called {name!r}; give a name of letters, digits, . - and _"
        )
    return name


def _cell(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)
