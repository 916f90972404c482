"""Plans a leaderboard: its methods, experiments and folder, each checked before anything is run."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from epuckhebb.config import (
    ALL,
    REVERSAL_TASK,
    LeaderboardConfig,
    Method,
    OwnFile,
    check_config_dir,
    load,
    methods_named,
    own_files,
    quoted,
)
from epuckhebb.runtime import ConfigError
from epuckhebb.store import fingerprint
from epuckhebb.studies.champions import search_folders, worlds_digest
from epuckhebb.studies.jobs import Job, folder_and_launcher, split
from epuckhebb.studies.leaderboard_jobs import REVERSAL, Entry, Planner, sweep_of, tests_of
from epuckhebb.tmaze.scenario import TRAINED, Scenario

EXPERIMENTS = (*TRAINED, REVERSAL)
QUICK = ("champions=2", "tests=[rescue]", "methods=[ga,sep_cma_es_varied,abcd_shared]")
_METHODS = "methods="
_PLAIN = "ga"  # what all rules are compared with in reversal learning
_REVERSAL_GA = {"ga": "reversal"}


@dataclass(frozen=True, kw_only=True)
class Leaderboard:
    """What belongs to a leaderboard."""

    config: LeaderboardConfig
    tests: dict[str, dict[str, Scenario]]  # of each experiment, by name; reversal learning has none but its own world
    sweep_of: dict[str, str]  # the sweep of each test world
    entries: list[Entry]
    folder: Path
    launcher: list[str]  # the arguments for Hydra's launcher
    own_files: dict[Path, OwnFile]
    arguments: list[str]  # of the command

    @property
    def jobs(self) -> list[Job]:
        """All jobs, in the order in which they need each other."""
        return [job for _, jobs in self.stages for job in jobs]

    @property
    def purposes(self) -> dict[str, str]:
        """What each run is for."""
        purposes: dict[str, str] = {}
        for entry in self.entries:
            for command, jobs in (("evolve", entry.champions), ("test", entry.tests)):
                for seed, job in jobs.items():
                    purposes.setdefault(job.run, f"{command} {entry.method.name}, {entry.row.experiment}, seed {seed}")
        return purposes

    @property
    def stages(self) -> list[tuple[str, list[Job]]]:
        """What is done in order: champions, rules for champions, tests."""
        first = {job.run: job for entry in self.entries if not entry.before for job in entry.champions.values()}
        then = {job.run: job for entry in self.entries if entry.before for job in entry.champions.values()}
        tests = {job.run: job for entry in self.entries for job in entry.tests.values()}
        named = (("evolve champions", first), ("evolve rules for champions", then), ("test champions", tests))
        return [(what, list(jobs.values())) for what, jobs in named if jobs]


def _experiments_named(text: str) -> list[str]:
    """The experiments of an argument, in their usual order."""
    named = {name.strip() for name in text.split(",")}
    if unknown := named - {*EXPERIMENTS, ALL}:
        raise ConfigError(
            f"leaderboard {text}: {', '.join(sorted(unknown)) or 'nothing'} is no experiment; it must be one of "
            f"{', '.join(EXPERIMENTS)}, several of them with commas between, or {ALL}"
        )
    return [one for one in EXPERIMENTS if one in named or ALL in named]


def plan(experiment: str, arguments: list[str], *, quick: bool = False, config_dir: str | None = None) -> Leaderboard:
    """List what belongs to a leaderboard, each part composed and checked; nothing is written.

    experiment: its name, several of them with commas between, or all. arguments: overrides, of the study and of Hydra.

    Raises:
        ConfigError: The experiment, a method, a key or a value cannot be used.
    """
    experiments = _experiments_named(experiment)
    check_config_dir(config_dir)
    typed_words = [experiment, *(["--quick"] if quick else []), *arguments]
    if config_dir is not None:
        typed_words += ["--config-dir", config_dir]
        config_dir = str(Path(config_dir).absolute())
    own, of_hydra = split("leaderboard", arguments)
    config = load(LeaderboardConfig, [*(QUICK if quick else ()), *map(_as_list, own)], config_dir)
    folders = search_folders(config_dir)
    all_tests = tests_of(config.tests, config_dir)
    tests = {one: all_tests.get(one, {}) for one in experiments}
    for one, worlds in tests.items():
        if not worlds and one != REVERSAL:
            raise ConfigError(f"tests={','.join(config.tests)}: none of their scenarios is of the {one} experiment")
    methods = methods_named(config.methods, folders)
    entries: list[Entry] = []
    for one, worlds in tests.items():
        planned = Planner(config, config_dir, one, worlds)
        here = in_reversal(methods, folders) if one == REVERSAL else methods
        entries += [planned.entry(method) for method in here]
    jobs = [job for entry in entries for job in entry.tests.values()]
    tested = [name for worlds in all_tests.values() for name in worlds]
    depends = [worlds_digest(tuple(tested), config_dir), config.first_seed, config.seed, config.repeats]
    depends += [config.reversal_repeats]
    usual = Path("runs") / "leaderboard" / f"seed{config.first_seed}_{fingerprint(depends)[:8]}"
    folder, launcher = folder_and_launcher(of_hydra, usual, 2 * len(jobs))
    return Leaderboard(
        config=config,
        tests=tests,
        sweep_of=sweep_of(config.tests, config_dir),
        entries=entries,
        folder=folder,
        launcher=launcher,
        own_files={file: own for job in jobs for file, own in own_files(job.config["config"]).items()},
        arguments=typed_words,
    )


def _as_list(argument: str) -> str:
    """`methods=a,b` as Hydra writes a list."""
    if argument.lstrip("+~").startswith("method="):
        raise ConfigError(f"{argument}: a leaderboard has many methods; give methods={argument.partition('=')[2]}")
    if not argument.startswith(_METHODS) or argument.startswith(f"{_METHODS}["):
        return argument
    names = argument.removeprefix(_METHODS).split(",")
    return f"{_METHODS}[{','.join(quoted(name) for name in names if name)}]"


def in_reversal(methods: Sequence[Method], folders: Sequence[Path]) -> list[Method]:
    """These methods in reversal learning: their rules, evolved by the GA in its one world.

    Methods that differ in training or optimizer alone are one here. All without plasticity are the GA. Methods with an
    adaptation are left out.
    """
    (plain,) = methods_named([_PLAIN], folders)
    found = [replace(plain, evolve={**REVERSAL_TASK, **_REVERSAL_GA})]
    for method in methods:
        if not method.is_rule_alone:
            continue
        made = replace(
            method,
            evolve={**REVERSAL_TASK, **_REVERSAL_GA, **method.rule} if method.evolve else {},
            evaluate={**REVERSAL_TASK, **method.rule} if method.evaluate else {},
            champions_of=_PLAIN if method.champions_of else "",
            matched_control="" if method.champions_of else _PLAIN,
        )
        if method.rule and not any(replace(made, name=one.name, description=one.description) == one for one in found):
            found.append(made)
    names = [method.name for method in methods]
    if not found[1:] and names != [_PLAIN]:
        raise ConfigError(
            f"methods={','.join(names)}: none has a place in reversal learning, which compares plasticity rules; give "
            "one that has hebbian and no adaptation, for example modulated"
        )
    return found
