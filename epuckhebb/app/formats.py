"""The formats of the JSON files and the tables of a run: what must stand in them, checked as they are read.

A disk, an editor or a crash may have changed them. What is wrong is told in one message that names the file, the key or
the column, what is there, and what should be.
"""

import io
import json
import types
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import (
    Any,
    Literal,
    NamedTuple,
    NotRequired,
    TypedDict,
    TypeVar,
    get_args,
    get_origin,
    get_type_hints,
    is_typeddict,
)

import pandas as pd
from pandas.api.types import is_bool_dtype, is_numeric_dtype

from epuckhebb.app.errors import ConfigError
from epuckhebb.sim.maze import SIDES


class Code(TypedDict):
    """The version of the program and of its science, and its git commit where it ran from a checkout."""

    version: str
    science: NotRequired[str]
    commit: str | None
    dirty: bool | None


class Resumed(TypedDict):
    """A call that went on with a run."""

    started: str
    command: list[str]
    generations: NotRequired[int]
    code: Code


class Provenance(TypedDict):
    """`provenance.json`: who ran what, with what, where."""

    schema: NotRequired[int]
    verb: str
    command: list[str]
    overrides: list[str]
    seed: NotRequired[int]
    code: Code
    packages: dict[str, str]
    python: str
    platform: str
    cores: int | None
    genome: NotRequired[str]
    genome_sha256: NotRequired[str]
    baseline_sha256: NotRequired[str]
    rules: NotRequired[dict[str, str]]
    resumed: NotRequired[list[Resumed]]
    rerun_of: NotRequired[str]
    sweep: NotRequired[str]


class Status(TypedDict):
    """`status.json`: how a run goes, or ended; and of each file that it wrote the SHA-256, once it has ended."""

    schema: NotRequired[int]
    state: Literal["running", "finished", "failed", "interrupted"]
    started: NotRequired[str]
    finished: NotRequired[str]
    error: NotRequired[str]
    traceback: NotRequired[str]
    sha256: NotRequired[dict[str, str]]


class ListOfJobs(TypedDict):
    """`sweep.json`: what the jobs of a sweep read, and how their folders are called."""

    schema: NotRequired[int]
    name: str
    command: list[str]
    fail_fast: bool
    jobs: list[str]


class JobAsked(TypedDict):
    """`jobs/RUN.json`: what a job of a sweep is to do."""

    overrides: list[str]
    config: dict[str, Any]


class Cost(TypedDict):
    """`cost.json` of a job of a leaderboard: CPU seconds, which are never the same twice."""

    cpu_s: float


NUMBER, NUMBER_OR_EMPTY, TEXT, TEXT_OR_EMPTY = "a number", "a number or empty", "text", "text or empty"


class Column(NamedTuple):
    """A column of a table. kind: what stands in it, one of the above or the texts that there may be. told: its meaning.

    What is told here is what `docs/files.md` shows.
    """

    kind: str | tuple[str, ...]
    told: str = ""


class Array(NamedTuple):
    """An array of a `.npz` file. shape: its axes. unit: "" where it has none. told: its meaning."""

    shape: tuple[str | int, ...]
    unit: str
    told: str


Columns = Mapping[str, Column]
_LATER = ("changed",)  # columns that tables of version 0.1 do not have

_CONDITION: Columns = {
    "experiment": Column(TEXT, "`light` or `obstacles`"),
    "scenario": Column(TEXT, "the name of the world"),
    "controller": Column(
        TEXT, "`GA` (the genes alone), `Hebbian` (the paper's rule), or the name of another rule or adaptation"
    ),
    "N": Column(NUMBER, "base rate of the plasticity rule; 0 without plasticity"),
}
METRICS: Columns = {
    "genome": Column(TEXT, "the name of the genome: `reference`, a run folder, or a file without its ending"),
    "experiment": Column(TEXT, "`light` or `obstacles`: to which of the paper's experiments the world belongs"),
    "scenario": Column(TEXT, "the name of the world; `changed` tells what differs from it"),
    "light": Column(NUMBER, "level of the sun at the start: 1 bright, 0.1 dim"),
    "obstacles": Column(NUMBER, "how many obstacles stand in the maze at the start"),
    "controller": _CONDITION["controller"],
    "N": _CONDITION["N"],
    "signal": Column(TEXT_OR_EMPTY, "the live fitness F that scales the rate; empty for `GA`"),
    "side": Column(SIDES, "where the goal is: `left` (lamp off) or `right` (lamp on)"),
    "repeat": Column(
        NUMBER, "number of the noise repeat, from 0; all controllers of a repeat have the same random numbers"
    ),
    "seed": Column(NUMBER, "seed of the random numbers"),
    "success": Column(NUMBER, "1 if the robot is within 5 cm of its goal at the last step, else 0"),
    "time_to_goal_s": Column(
        NUMBER_OR_EMPTY,
        "s until it was within 5 cm of its goal for the first time; empty if it never was. A robot that comes there "
        "and drives on has a time here and success 0",
    ),
    "path_length_m": Column(NUMBER, "m that it travelled: the sum of all steps"),
    "average_speed_m_s": Column(NUMBER, "m/s: the path over the whole lifetime, also the time it stood at the goal"),
    "final_position_error_m": Column(NUMBER, "m from its goal at the last step"),
    "weight_change_mean": Column(
        NUMBER,
        "how far plasticity has moved the weights: the sum of abs(W - W_gene) over all weights, its mean over the "
        "steps",
    ),
    "weight_change_final": Column(NUMBER, "the same sum at the last step"),
    "fitness": Column(
        NUMBER,
        "what `evolve` would give: the mean of the combined fitness over the steps and the reward for the goal, halved",
    ),
    "contact_fraction": Column(
        NUMBER, "share of the steps in which a distance sensor read above 0.8, which is next to touching"
    ),
    "changed": Column(
        TEXT_OR_EMPTY,
        "what differs from the named scenario, the paper's maze, the e-puck, and the length, pace and noise that a "
        "lifetime has there; empty: nothing",
    ),
}
FOUND: Columns = {
    "side": METRICS["side"],
    "repeat": METRICS["repeat"],
    "lamp": Column(("on", "off"), "whether the robot took the lamp to be lit"),
    "dead_sensors": Column(
        TEXT_OR_EMPTY, "numbers of the places on its rim where it found itself blind, with `; ` between them"
    ),
    "left_wheel_loss": Column(NUMBER, "share of its speed that the left wheel loses; below 0 it is too fast"),
    "left_wheel_loss_error": Column(NUMBER, "standard error of that"),
    "right_wheel_loss": Column(NUMBER, "the same of the right wheel"),
    "right_wheel_loss_error": Column(NUMBER, "standard error of that"),
    "light_ratio": Column(NUMBER, "today's light over that of the training world"),
    "light_ratio_error": Column(NUMBER, "standard error of that"),
    "distance_misfit": Column(
        NUMBER, "what is left of the distance readings that nothing found explains, in standard deviations"
    ),
    "light_misfit": Column(NUMBER, "the same of the light readings"),
    "unexplained": Column(
        TEXT_OR_EMPTY, "`distance`, `light` or both, where the misfit is too large; these findings are not used"
    ),
    "corrected": Column(TEXT_OR_EMPTY, "what is corrected all life long, with `; ` between"),
}
REWARDED: Columns = {
    "rewarded_share": Column(NUMBER, "share of the trials of its life that were rewarded"),
    "switch_trial": Column(
        NUMBER_OR_EMPTY,
        "the trial, from 1, from which on the other end is rewarded; empty: none. `side` is the first end",
    ),
}
REVERSAL_TRIALS: Columns = {
    **{name: METRICS[name] for name in ("genome", "controller")},
    "side": Column(SIDES, "the end that is rewarded first"),
    **{name: METRICS[name] for name in ("repeat", "seed")},
    "trial": Column(NUMBER, "its number, from 1"),
    "rewarded_side": Column(SIDES, "the end that is rewarded"),
    "reached_side": Column(TEXT_OR_EMPTY, "the end that the robot came to; empty: none"),
    "rewarded": Column(NUMBER, "1 if they are the same, else 0"),
    "time_s": Column(NUMBER_OR_EMPTY, "s until it came there, or until its time was over; empty: it was not lived"),
}
REVERSAL: Columns = {
    "controller": Column(TEXT, "as in `metrics.csv`; `chance` and `optimum` are no robots"),
    "lives": Column(NUMBER_OR_EMPTY, "lifetimes"),
    "rewarded_share": Column(NUMBER, "share of the trials that were rewarded"),
    "low": Column(NUMBER_OR_EMPTY, "lower end of its 95 % interval, a bootstrap over the repeats"),
    "high": Column(NUMBER_OR_EMPTY, "upper end of it"),
    "end_share": Column(NUMBER_OR_EMPTY, "share of the trials that came to an end"),
}
HISTORY: Columns = {
    "generation": Column(NUMBER, "its number, from 0"),
    "best_fitness": Column(NUMBER, "fitness of the fittest individual, as the mean over its lifetimes"),
    "mean_fitness": Column(NUMBER, "mean over all individuals"),
    "worst_fitness": Column(NUMBER, "fitness of the least fit"),
    "best_success": Column(NUMBER, "share of its lifetimes that the fittest ended at its goal"),
    "mean_success": Column(NUMBER, "the same share over all individuals"),
    "robot_steps": Column(NUMBER, "control steps of 32 ms that all of them lived"),
}
_INTERVAL: Columns = {
    "low": Column(NUMBER_OR_EMPTY, "lower end of its 95 % interval"),
    "high": Column(NUMBER_OR_EMPTY, "upper end of it"),
}
_JOB: Columns = {
    "job": Column(NUMBER, "number of the job, from 0"),
    "run": Column(TEXT, "its run folder in the folder of the sweep"),
    "KEY": Column(
        TEXT_OR_EMPTY, "a column for each key that was set; `override.KEY` where the name is one of those below"
    ),
}
SUMMARY: Columns = {
    "n": Column(NUMBER, "lifetimes of this condition, controller and side: seeds times noise repeats"),
    "success": Column(NUMBER, "share of them that ended at the goal"),
    "success_low": Column(
        NUMBER, "lower end of its 95 % interval (Wilson's), which is about the noise, for this genome"
    ),
    "success_high": Column(NUMBER, "upper end of it"),
}
_OUTCOMES = list(METRICS)[list(METRICS).index("success") + 1 : -1]
SUMMARY_MEANS: Columns = {
    "n_reached": Column(NUMBER, "lifetimes that came to the goal at all, of which `time_to_goal_s` is the mean"),
    **{name: Column(NUMBER_OR_EMPTY, "mean of that column of `metrics.csv`") for name in _OUTCOMES},
}
CLAIMS: Columns = {
    "experiment": _CONDITION["experiment"],
    "claim": Column(TEXT, "what the paper says"),
    "counted": Column(TEXT, "which trials could show it, and what counts as true"),
    "true": Column(NUMBER, "in how many trials it comes true"),
    "n": Column(NUMBER, "of how many"),
    "champions": Column(NUMBER, "how many champions have such a trial"),
    "share": Column(NUMBER_OR_EMPTY, "`true` over `n`"),
    **_INTERVAL,
    "verdict": Column(TEXT, "`holds`, `does not hold`, `mixed`, or that there is no trial to judge by"),
}
_COUNTS: Columns = {
    "broken": Column(NUMBER, "mastered at home without plasticity, and failed in the changed world without it"),
    "rescued": Column(NUMBER, "of the broken: succeed with plasticity"),
    "sound": Column(NUMBER, "mastered at home, and in the changed world too, without plasticity"),
    "harmed": Column(NUMBER, "of the sound: fail with plasticity"),
    **{
        f"{part}_{name}": Column(NUMBER_OR_EMPTY, told)
        for part, whole in (("rescued", "broken"), ("harmed", "sound"))
        for name, told in (
            ("share", f"`{part}` over `{whole}`"),
            ("low", _INTERVAL["low"].told),
            ("high", _INTERVAL["high"].told),
        )
    },
}
RESCUE: Columns = {
    "experiment": _CONDITION["experiment"],
    "controller": Column(TEXT, "which plasticity"),
    "N": _CONDITION["N"],
    **_COUNTS,
    "home_harmed": Column(NUMBER, "trials mastered in the training world without plasticity that fail there with it"),
    "home_mastered": Column(NUMBER, "of how many"),
}
_RESCUE_AND_HARM: Columns = {
    **_CONDITION,
    "mastered": Column(NUMBER, "trials that the genes alone master in the training world"),
    **_COUNTS,
    "difference": Column(NUMBER, "success with plasticity minus success without, over all trials, mastered or not"),
    "difference_low": _INTERVAL["low"],
    "difference_high": _INTERVAL["high"],
    "sign_flip_p": Column(NUMBER_OR_EMPTY, "exact p value of the difference, signs flipped by champion"),
}
_RETENTION: Columns = {
    "experiment": _CONDITION["experiment"],
    "controller": _CONDITION["controller"],
    "N": _CONDITION["N"],
    "masters": Column(
        ("any", "both"), "whose trials: those mastered at home (`any`), or those of champions that master `both` sides"
    ),
    "champions": Column(NUMBER_OR_EMPTY, "how many champions have such trials"),
    "trials": Column(NUMBER, "these trials in all changed worlds"),
    "retained": Column(NUMBER, "of them: succeed there"),
    "share": Column(NUMBER_OR_EMPTY, "`retained` over `trials`"),
    **_INTERVAL,
}
_TRIALS: Columns = {
    **_CONDITION,
    "genome": Column(TEXT, "the champion"),
    "side": METRICS["side"],
    **{
        name: Column(NUMBER_OR_EMPTY, "mean over the noise repeats")
        for name in ("success", "time_to_goal_s", "path_length_m", "final_position_error_m", "weight_change_mean")
    },
    "succeeds": Column(("True", "False"), "whether more than half of the repeats succeed"),
}
_SUCCESS: Columns = {
    **_CONDITION,
    "side": Column(("left", "right", "both"), "`both`: a champion counts that succeeds on either side"),
    "successes": Column(NUMBER, "champions that succeed"),
    "n": Column(NUMBER, "of how many"),
    "share": Column(NUMBER, "`successes` over `n`"),
    **_INTERVAL,
}
_DOSE_RESPONSE: Columns = {
    **_CONDITION,
    **{
        f"{name}{end}": Column(NUMBER_OR_EMPTY, told)
        for name in ("success", "time_to_goal_s", "weight_change_mean")
        for end, told in (
            ("", "mean over the champions"),
            ("_low", _INTERVAL["low"].told),
            ("_high", _INTERVAL["high"].told),
        )
    },
}
_COMPARISON: Columns = {
    "table": Column(TEXT, "which table of the paper"),
    "experiment": _CONDITION["experiment"],
    "scenario": _CONDITION["scenario"],
    "controller": _CONDITION["controller"],
    "side": METRICS["side"],
    "metric": Column(TEXT, "which column of `metrics.csv`"),
    "published": Column(NUMBER_OR_EMPTY, "the number in the paper"),
    "ours": Column(NUMBER_OR_EMPTY, "that of the champion which is put beside the paper"),
    "relative_deviation": Column(NUMBER_OR_EMPTY, "`ours` over `published`, less 1"),
    "median": Column(NUMBER_OR_EMPTY, "of all champions"),
    "q25": Column(NUMBER_OR_EMPTY, "their lower quartile"),
    "q75": Column(NUMBER_OR_EMPTY, "their upper quartile"),
    "n": Column(NUMBER, "champions that have this number"),
}
_METHOD: Columns = {
    "experiment": _CONDITION["experiment"],
    "method": Column(TEXT, "a name of `conf/method/`, or of a rule of the user's own"),
}
LEADERBOARD: Columns = {
    **_METHOD,
    "kind": Column(
        ("plain", "evolved", "laid over"),
        "`plain`: no plasticity; `evolved`: with plasticity; `laid over` champions of another method",
    ),
    "twin": Column(TEXT_OR_EMPTY, "the method that it is compared with, which has no plasticity; empty for plain ones"),
    "champions": Column(NUMBER, "how many there are"),
    "mastered": Column(NUMBER, "how many of them succeed on both sides at home; in `reversal`, how many learn"),
    "mastered_low": _INTERVAL["low"],
    "mastered_high": _INTERVAL["high"],
    "trials": Column(NUMBER, "champions times sides times test worlds; in `reversal`, trials of all lives"),
    "successes": Column(
        NUMBER, "in how many of them more than half of the repeats succeed; in `reversal`, rewarded ones"
    ),
    "success": Column(NUMBER, "`successes` over `trials`"),
    "success_low": Column(NUMBER, "lower end of its 95 % interval, from a bootstrap over champions"),
    "success_high": Column(NUMBER, "upper end of it"),
    "best": Column(NUMBER, "`success` of the champion that does best"),
    "retention": Column(NUMBER_OR_EMPTY, "`success` of those champions alone that are `mastered`"),
    "retention_low": _INTERVAL["low"],
    "retention_high": _INTERVAL["high"],
    "difference": Column(
        NUMBER_OR_EMPTY, "`success` less that of the twin, as the mean over pairs of champions of a seed"
    ),
    "difference_low": Column(NUMBER_OR_EMPTY, "lower end of its 95 % interval, from a bootstrap over pairs"),
    "difference_high": Column(NUMBER_OR_EMPTY, "upper end of it"),
    "sign_flip_p": Column(NUMBER_OR_EMPTY, "exact p value of the difference, signs flipped by champion"),
    "success_off": Column(NUMBER_OR_EMPTY, "`success` of the same champions with the rule, or what is laid over, off"),
    "success_inverted": Column(NUMBER_OR_EMPTY, "the same with the reward inverted, of rules that hear one"),
    "numbers": Column(NUMBER, "how many numbers are evolved for a champion"),
    "robot_steps": Column(
        NUMBER, "control steps of 32 ms in all generations of a champion's evolution, as the mean over champions"
    ),
}
_CHAMPIONS: Columns = {
    **_METHOD,
    "seed": Column(NUMBER, "seed of its evolution"),
    "champion": Column(TEXT, "run folder in which it, or the rule for it, was evolved"),
    "test": Column(TEXT, "run folder of its lifetimes at home and in all test worlds"),
    "masters": Column(NUMBER, "1 if it succeeds on both sides at home, in `reversal` if it learns; else 0"),
    "trials": Column(NUMBER, "sides times test worlds; in `reversal`, trials of all lives"),
    "successes": Column(NUMBER, "of them: more than half of the repeats succeed; in `reversal`, rewarded ones"),
    "successes_off": Column(NUMBER_OR_EMPTY, "the same with the rule off; empty for plain methods"),
    "successes_inverted": Column(NUMBER_OR_EMPTY, "the same with the reward inverted, of rules that hear one"),
    "robot_steps": Column(NUMBER, "control steps of its evolution, and of what it was laid over"),
}
_WORLDS: Columns = {
    **_METHOD,
    "scenario": Column(TEXT, "a test world"),
    "trials": Column(NUMBER, "champions times sides"),
    "successes": Column(NUMBER, "of them: more than half of the repeats succeed"),
}
_COSTS: Columns = {
    **_METHOD,
    "evolve_cpu_s": Column(NUMBER, "CPU seconds of a champion's evolution, as the mean over champions"),
    "test_cpu_s": Column(NUMBER, "CPU seconds of its lifetimes at home and in all test worlds"),
}

TABLES: Mapping[str, tuple[str, Columns]] = {
    "metrics.csv": ("Of `evaluate`, `reproduce` and tests of `leaderboard`: a row a lifetime.", METRICS),
    "findings.csv": ("Of `evaluate` with a self-check: a row for each robot that checked itself.", FOUND),
    "metrics.csv with task=reversal": ("Columns that then follow.", REWARDED),
    "reversal_trials.csv": ("Of `evaluate task=reversal`: a row for each trial of each lifetime.", REVERSAL_TRIALS),
    "reversal.csv": ("Of `evaluate task=reversal`: a row for each controller, for chance, the optimum.", REVERSAL),
    "history.csv": ("Of `evolve`: a row a generation.", HISTORY),
    "sweep.csv": ("Of `sweep`: the rows of all `metrics.csv`, with these columns before them.", _JOB),
    "summary.csv": (
        "Of `sweep` and `evaluate -m`: a row for each condition, controller and side. Before these columns are those "
        "that tell it. `GA` comes once for all keys of `hebbian`, `adaptation` and `compare`, which it does not feel.",
        {**SUMMARY, **SUMMARY_MEANS},
    ),
    "failed.csv": (
        "Of `sweep`: a row for each job without a result; empty if all is well.",
        {**_JOB, "error": Column(TEXT, "why")},
    ),
    "rescue_over_all.csv": (
        "Of sweeps over champions in changed worlds: a row for each plasticity, all changed worlds together.",
        RESCUE,
    ),
    "rescue_and_harm.csv": (
        "Of `reproduce` and such sweeps: the same for each world. A trial is one champion on one side.",
        _RESCUE_AND_HARM,
    ),
    "retention.csv": ("Of both: how much of what is mastered at home succeeds in the changed worlds.", _RETENTION),
    "claims.csv": ("Of `reproduce`: a row for each claim of the paper.", CLAIMS),
    "trials.csv": ("Of `reproduce`: a row for each champion, side and condition.", _TRIALS),
    "success.csv": ("Of `reproduce`: a row for each condition and side, over the champions.", _SUCCESS),
    "dose_response.csv": ("Of `reproduce`: a row for each rate; N = 0 is the genes alone.", _DOSE_RESPONSE),
    "leaderboard.csv": ("Of `leaderboard`: a row for each method and experiment, best first.", LEADERBOARD),
    "champions.csv": ("Of `leaderboard`: a row for each champion, of which `leaderboard.csv` is made.", _CHAMPIONS),
    "worlds.csv": ("Of `leaderboard`: a row for each method and test world.", _WORLDS),
    "cost.csv": ("Of `leaderboard`: what is never the same twice, and so in no other table.", _COSTS),
    "comparison.csv": ("Of `reproduce`: a row for each number of the paper's tables.", _COMPARISON),
}

TRACES: Mapping[str, Array] = {
    "controller": Array(("lifetimes",), "", "the name of the controller, as in `metrics.csv`"),
    "side": Array(("lifetimes",), "", "`left` or `right`"),
    "genome": Array(("synapses",), "", "the weights at birth"),
    "layers": Array(("layers",), "", "how many neurons each layer has, sensors first, wheels last"),
    "time": Array(("lifetimes", "samples"), "s", "since the start of the lifetime"),
    "pose": Array(
        ("lifetimes", "samples", 3),
        "m, m, rad",
        "x (to the right), y (ahead at the start), heading, anticlockwise from x",
    ),
    "sensors": Array(
        ("lifetimes", "samples", "inputs"),
        "0 to 1",
        "what the network reads, light first; light: 1 is dark; distance: 1 is touching",
    ),
    "motors": Array(
        ("lifetimes", "samples", 2),
        "-1 to 1",
        "the network's outputs, left and right wheel; times `lifetime.gain_rad_s` they are rad/s",
    ),
    "fitness": Array(("lifetimes", "samples"), "", "live fitness F"),
    "change_signal": Array(
        ("lifetimes", "samples"), "", "the signal that opens the gate of an adaptation; nan where there is none"
    ),
    "rate": Array(("lifetimes", "samples"), "per step", "effective rate N_e"),
    "weight_change": Array(("lifetimes", "samples"), "", "sum of abs(W - W_gene) over all weights"),
    "weights": Array(
        ("lifetimes", "samples", "synapses"),
        "",
        "all weights, layer by layer, a row for each neuron that they come from",
    ),
}

CHAMPION: Mapping[str, Array] = {
    "genome": Array(("genes",), "", "all genes: the weights, layer by layer, then what of a rule is evolved"),
    "layers": Array(("layers",), "", "how many neurons each layer has"),
    "parts": Array(("parts",), "", "the names of the parts of the genome"),
    "part_sizes": Array(("parts",), "", "how many genes each has"),
    "fitness": Array((), "", "what it was chosen by"),
    "experiment": Array((), "", "`light` or `obstacles`"),
    "seed": Array((), "", "of its evolution"),
    "generation": Array((), "", "its last one, from 0"),
    "robot": Array((), "", "the name of the robot that it is for"),
    "lights": Array((), "", "how many of the readings are of light"),
    "optimizer": Array((), "", "what it was evolved by"),
    "training": Array((), "", "in which worlds"),
    "rule": Array((), "", "the plasticity rule that it evolved with, if there was one"),
    "task": Array((), "", "the task that it evolved for, if it is another than the paper's"),
    "rewarded": Array((), "", "beside `task`: 1 if the last input of the network tells a reward, else 0"),
    "memory_*": Array((), "", "the baseline: what it remembers of its training world, for adaptations"),
    "self_*": Array((), "", "what a self-check compares with"),
}

Record = TypeVar("Record", Provenance, Status, ListOfJobs, JobAsked, Cost)


def record(content: bytes, file: Path, kind: type[Record]) -> Record:
    """What a JSON file holds; keys that this program does not know are left in it.

    Args:
        content: Its content.
        file: Where it is, for the message.
        kind: What it must be.

    Raises:
        ConfigError: It is something else.
    """
    try:
        told = json.loads(content)
        _check(told, kind, "")
    except (ValueError, RecursionError) as error:
        raise ConfigError(f"{file} cannot be used: {error}") from error
    checked: Record = told
    return checked


def _check(told: Any, kind: Any, key: str) -> None:
    """Refuse a value that is not of a kind, which may be anything that the records above are made of.

    Raises:
        ValueError: It is not; the message names its key.
    """
    if get_origin(kind) is NotRequired:
        kind = get_args(kind)[0]
    if kind is Any:
        return
    origin, inner = get_origin(kind), get_args(kind)
    if is_typeddict(kind) and isinstance(told, dict):
        for name, of_name in get_type_hints(kind).items():
            if name in told:
                _check(told[name], of_name, f"{key}.{name}" if key else name)
            elif name in kind.__required_keys__:
                raise ValueError(f"it has no {key}.{name}" if key else f"it has no {name}")
    elif origin is dict and isinstance(told, dict):
        for name, value in told.items():
            _check(value, inner[1], f"{key}.{name}")
    elif origin is list and isinstance(told, list):
        for place, value in enumerate(told):
            _check(value, inner[0], f"{key}[{place}]")
    elif origin is types.UnionType and told is None:
        pass
    elif origin is types.UnionType:
        _check(told, inner[0], key)
    elif not ((origin is Literal and isinstance(told, str) and told in inner) or type(told) is kind):
        words = {str: "text", int: "a whole number", bool: "true or false", float: "a number", list: "a list"}
        wanted = f"one of {', '.join(inner)}" if origin is Literal else words.get(origin or kind, "keys with values")
        raise ValueError(f"{key or 'it'} must be {wanted}, got {json.dumps(told)[:60]}")


def table(content: bytes, file: Path, columns: Columns, *, rows: bool = True) -> pd.DataFrame:
    """What a CSV file holds.

    Args:
        content: Its content.
        file: Where it is, for the message.
        columns: Those that it must have; there may be more.
        rows: Whether it must have rows.

    Raises:
        ConfigError: It is something else.
    """
    texts = [name for name, column in columns.items() if column.kind not in (NUMBER, NUMBER_OR_EMPTY)]
    try:
        with warnings.catch_warnings(action="error"):  # pandas warns where rows are longer than the header
            found = pd.read_csv(
                io.BytesIO(content),
                index_col=False,
                keep_default_na=False,
                na_values=[""],
                dtype=dict.fromkeys(texts, str),
                low_memory=False,
            )
    except Exception as error:  # what damaged bytes may raise has no end
        raise ConfigError(f"{file} cannot be read as a table: {error}") from error
    missing = [name for name in columns if name not in found and name not in _LATER]
    if missing:
        raise ConfigError(f"{file} has no column {missing[0]}")
    if rows and found.empty:
        raise ConfigError(f"{file} has no rows")
    for name in columns if len(found) else ():
        if name in found:
            _check_column(found[name], columns[name].kind, file)
    return found


def _check_column(values: pd.Series, kind: str | tuple[str, ...], file: Path) -> None:
    wrong = pd.Series(False, values.index) if kind in (NUMBER_OR_EMPTY, TEXT_OR_EMPTY) else values.isna()
    if isinstance(kind, tuple):
        wrong |= ~values.isin(kind)
    elif kind in (NUMBER, NUMBER_OR_EMPTY) and not (is_numeric_dtype(values) and not is_bool_dtype(values)):
        wrong |= values.notna() & ~values.map(_is_a_number)
    if wrong.any():
        line = int(wrong.to_numpy().argmax())
        got = "nothing" if pd.isna(values.iloc[line]) else repr(values.iloc[line])
        wanted = f"one of {', '.join(kind)}" if isinstance(kind, tuple) else kind
        raise ConfigError(f"{file}, row {line + 1}: {values.name} must be {wanted}, got {got[:60]}")
    if kind in (NUMBER, NUMBER_OR_EMPTY) and not is_numeric_dtype(values):
        raise ConfigError(f"{file}: {values.name} must be {kind} in each row; one is too large")


def _is_a_number(value: object) -> bool:
    try:
        float(str(value))
    except ValueError:
        return False
    return True
