"""Describes every column of every table and every array of a run; `docs/files.md` is made of it."""

from collections.abc import Mapping
from functools import partial
from typing import NamedTuple

from epuckhebb.controller.plasticity.weight_change import SATURATED
from epuckhebb.tmaze.maze import SIDES

NUMBER, NUMBER_OR_EMPTY, TEXT, TEXT_OR_EMPTY = "a number", "a number or empty", "text", "text or empty"


class Column(NamedTuple):
    """A column of a table. kind: one of the above, or the texts that there may be. meaning: in words."""

    kind: str | tuple[str, ...]
    meaning: str = ""


class Array(NamedTuple):
    """An array of a `.npz` file. shape: its axes. unit: "" where it has none. meaning: in words."""

    shape: tuple[str | int, ...]
    unit: str
    meaning: str


Columns = Mapping[str, Column]
number, number_or_empty = partial(Column, NUMBER), partial(Column, NUMBER_OR_EMPTY)
text, text_or_empty = partial(Column, TEXT), partial(Column, TEXT_OR_EMPTY)


def _interval(name: str = "", method: str = "", kind: str = NUMBER_OR_EMPTY) -> Columns:
    """The two columns of an interval; method: how it was found."""
    lower = Column(kind, f"lower end of its 95 % interval{method}")
    return {f"{name}low": lower, f"{name}high": Column(kind, "upper end of it")}


def _mean(name: str, meaning: str, method: str = "", kind: str | tuple[str, ...] = NUMBER_OR_EMPTY) -> Columns:
    """The three columns of a mean; method: how its interval was found."""
    return {name: Column(kind, meaning), **_interval(f"{name}_", method)}


def _some(known: Columns, *names: str) -> Columns:
    """Some of the columns of a table."""
    return {name: known[name] for name in names}


_CONDITION: Columns = {
    "experiment": text("`light` or `obstacles`"),
    "scenario": text("the name of the world"),
    "controller": text("`GA` (the genes alone), `Hebbian` (the paper's rule), or another rule or adaptation"),
    "N": number("base rate of the plasticity rule; 0 without plasticity"),
}
METRICS: Columns = {
    "genome": text("the name of the genome: `reference`, a run folder, or a file without its ending"),
    "experiment": text("`light` or `obstacles`: to which of the paper's experiments the world belongs"),
    "scenario": text("the name of the world: of its scenario and its changes; `changed` says what else differs"),
    "light": number("level of the sun at the start: 1 bright, 0.1 dim"),
    "obstacles": number("how many obstacles stand in the maze at the start"),
    "controller": _CONDITION["controller"],
    "N": _CONDITION["N"],
    "signal": text_or_empty("the live fitness F that scales the rate; empty for `GA`"),
    "side": Column(SIDES, "where the goal is: `left` (lamp off) or `right` (lamp on)"),
    "repeat": number("number of the repeat, from 0; all controllers of a repeat have the same random numbers"),
    "seed": number("seed of the random numbers"),
    "success": number("1 if the robot is within 5 cm of its goal at the last step, else 0"),
    "time_to_goal_s": number_or_empty("s until it was first within 5 cm of its goal; empty: never. It may leave again"),
    "path_length_m": number("m that it travelled: the sum of all steps"),
    "average_speed_m_s": number("m/s: the path over the whole lifetime, which includes the time at the goal"),
    "final_position_error_m": number("m from its goal at the last step"),
    "weight_change_mean": number("sum of abs(W - W_gene) over all weights: its mean over the steps"),
    "weight_change_final": number("the same sum at the last step"),
    "fitness": number("as in `evolve`: half of the mean combined fitness over the steps and the reward for the goal"),
    "contact_fraction": number("share of the steps in which a distance sensor read above 0.8: next to touching"),
    "changed": text_or_empty("what differs from the named scenario, its lifetimes, and the paper's maze and robot"),
    "saturated_fraction": number(f"share of weights that end with abs(W) above {SATURATED:g} of `hebbian.w_max`"),
}
REWARDED: Columns = {
    "rewarded_share": number("share of the trials of the lifetime that were rewarded"),
    "switch_trial": number_or_empty("first trial, from 1, that rewards the end opposite to `side`; empty: none"),
}
REVERSAL_TRIALS: Columns = {
    **_some(METRICS, "genome", "controller"),
    "side": Column(SIDES, "the end that is rewarded first"),
    **_some(METRICS, "repeat", "seed"),
    "trial": number("its number, from 1"),
    "rewarded_side": Column(SIDES, "the end that is rewarded"),
    "reached_side": text_or_empty("the end that the robot reached; empty: none"),
    "rewarded": number("1 if they are the same, else 0"),
    "time_s": number_or_empty("s until it reached an end, or until its time was over; empty: the trial did not run"),
}
REVERSAL: Columns = {
    "controller": text("as in `metrics.csv`; `chance` and `optimum` are no robots"),
    "lifetimes": number_or_empty("how many"),
    "rewarded_share": number("share of the trials that were rewarded"),
    **_interval(method=", from a bootstrap over the repeats"),
    "end_share": number_or_empty("share of the trials in which the robot reached an end"),
}
HISTORY: Columns = {
    "generation": number("its number, from 0"),
    "best_fitness": number("fitness of the fittest individual, as the mean over its lifetimes"),
    "mean_fitness": number("mean over all individuals"),
    "worst_fitness": number("fitness of the least fit"),
    "best_success": number("share of its lifetimes that the fittest ended at its goal"),
    "mean_success": number("the same share over all individuals"),
    "robot_steps": number("control steps of 32 ms of all their lifetimes"),
}
_JOB: Columns = {
    "job": number("number of the job, from 0"),
    "run": text("its run folder in the folder of the sweep"),
    "KEY": text_or_empty(
        "a column for each key that was set and has none below (of `fitness`: `fitness_function`); `any`: the row is "
        "of `GA`"
    ),
}
SUMMARY: Columns = {
    "n": number("lifetimes of this condition, champion, controller and side: seeds times repeats"),
    "success": number("share of them that ended at the goal"),
    **_interval("success_noise_", " (Wilson's): about the noise alone, for this champion", NUMBER),
}
_OF_CHAMPIONS = "mean over the champions, each of them the mean of its lifetimes"
OVER_CHAMPIONS: Columns = {
    "champions": number("champions with this condition, controller and side"),
    "lifetimes": number("their lifetimes"),
    **_mean("success", _OF_CHAMPIONS, ", from a bootstrap over champions"),
    **_mean("weight_change_mean", _OF_CHAMPIONS, ", from a bootstrap over champions"),
}
_OUTCOMES = [*list(METRICS)[list(METRICS).index("success") + 1 : -2], "saturated_fraction"]
SUMMARY_MEANS: Columns = {
    "n_reached": number("lifetimes that reached the goal; `time_to_goal_s` is their mean"),
    **{name: number_or_empty("mean of that column of `metrics.csv`") for name in _OUTCOMES},
    "rewarded_share": number_or_empty("the same; only with `task=reversal`"),
}
CLAIMS: Columns = {
    "experiment": _CONDITION["experiment"],
    "claim": text("what the paper says"),
    "counted": text("which trials could show it, and what counts as true"),
    "true": number("in how many trials it is true"),
    "n": number("of how many"),
    "champions": number("how many champions have such a trial"),
    "share": number_or_empty("`true` over `n`"),
    **_interval(),
    "verdict": text(
        "`holds`, `does not hold`, `mixed`, `inconclusive`, `no trial to judge by`; or `check passed`, `check failed`"
    ),
}
_COUNTS: Columns = {
    "broken": number("solved in training without plasticity; fail in the changed world without it"),
    "rescued": number("of the broken trials: succeed with plasticity"),
    "intact": number("solved in training without plasticity; succeed in the changed world without it"),
    "harmed": number("of the intact trials: fail with plasticity"),
    "rescued_share": number_or_empty("`rescued` over `broken`"),
    **_interval("rescued_"),
    "harmed_share": number_or_empty("`harmed` over `intact`"),
    **_interval("harmed_"),
}
RESCUE: Columns = {
    "experiment": _CONDITION["experiment"],
    "controller": text("which plasticity"),
    "N": _CONDITION["N"],
    **_COUNTS,
    "training_harmed": number("trials solved in the training world without plasticity that fail there with it"),
    "training_solved": number("of how many"),
}
_RESCUE_BY_CHAMPION: Columns = {
    **_some(RESCUE, "experiment", "controller", "N"),
    "genome": METRICS["genome"],
    **_some(RESCUE, "broken", "rescued", "intact", "harmed"),
}
_RESCUE_AND_HARM: Columns = {
    **_CONDITION,
    "solved": number("trials that the genes alone solve in the training world"),
    **_COUNTS,
    **_mean("difference", "success with plasticity minus success without, over all trials", kind=NUMBER),
    "sign_flip_p": number_or_empty("exact p value of the difference, signs flipped by champion"),
}
_RETENTION: Columns = {
    **_some(_CONDITION, "experiment", "controller", "N"),
    "solves": Column(("any", "both"), "`any`: all solved in training; `both`: only of champions that solve both sides"),
    "champions": number_or_empty("how many champions have such trials"),
    "trials": number("these trials in all changed worlds"),
    "retained": number("of them: succeed there"),
    "share": number_or_empty("`retained` over `trials`"),
    **_interval(),
}
_TRIALS: Columns = {
    **_CONDITION,
    "genome": text("the champion"),
    "side": METRICS["side"],
    **{
        name: number_or_empty("mean over the repeats")
        for name in ("success", "time_to_goal_s", "path_length_m", "final_position_error_m", "weight_change_mean")
    },
    "succeeds": Column(("True", "False"), "whether more than half of the repeats succeed"),
}
_SUCCESS: Columns = {
    **_CONDITION,
    "side": Column(("left", "right", "both"), "`both`: the champion succeeds on the left and on the right"),
    "successes": number("champions that succeed"),
    "n": number("of how many"),
    "share": number("`successes` over `n`"),
    **_interval(),
    "gained": number("those of `successes` that fail without plasticity"),
}
_DOSE_RESPONSE: Columns = {
    **_CONDITION,
    **_mean("success", "mean over the champions"),
    **_mean("time_to_goal_s", "mean over the champions"),
    **_mean("weight_change_mean", "mean over the champions"),
}
_COMPARISON: Columns = {
    "table": text("which table of the paper"),
    **_some(_CONDITION, "experiment", "scenario", "controller"),
    "side": METRICS["side"],
    "metric": text("which column of `metrics.csv`"),
    "published": number_or_empty("the number in the paper"),
    "ours": number_or_empty("that of the champion which is put beside the paper"),
    "relative_deviation": number_or_empty("`ours` over `published`, less 1"),
    "median": number_or_empty("of all champions"),
    "q25": number_or_empty("their lower quartile"),
    "q75": number_or_empty("their upper quartile"),
    "n": number("champions that have this number"),
}
_REPEATS: Columns = {
    **{name: column for name, column in _COMPARISON.items() if name not in ("median", "q25", "q75")},
    "n": number("repeats that have this number"),
    "low": number_or_empty("2.5 % of the repeats lie below this"),
    "high": number_or_empty("97.5 % of the repeats lie below this"),
    "percentile": number_or_empty("share of the repeats below the paper's number, %"),
}
_METHOD: Columns = {
    "experiment": _CONDITION["experiment"],
    "method": text("a name of `conf/methods.yaml`, or of a rule of the user's own"),
}
LEADERBOARD: Columns = {
    **_METHOD,
    "kind": Column(("plain", "evolved", "post_hoc"), "no plasticity, plasticity in evolution, added afterwards"),
    "knowledge_class": text("the class by which methods are ordered: what they know decides what they can do"),
    "knowledge": text("what it uses: its senses, what it is given, what was written by hand"),
    "matched_control": text_or_empty("the method that it is compared with: the same without plasticity, if it has any"),
    "champions": number("how many there are"),
    "solved": number("how many of them solve both sides in training; in `reversal`, how many learn"),
    **_interval("solved_"),
    "trials": number("champions times sides times test worlds; in `reversal`, trials of all lifetimes"),
    "successes": number("in how many of them more than half of the repeats succeed; in `reversal`, rewarded ones"),
    "success": number("`successes` over `trials`"),
    **_interval("success_", ", from a bootstrap over champions", NUMBER),
    "best": number("`success` of the champion that does best"),
    **_mean("retention", "`success` of those champions alone that are `solved`"),
    **_mean("difference", "`success` less that of the matched control", ", from a bootstrap over pairs of a seed"),
    "sign_flip_p": number_or_empty("exact p value of the difference, signs flipped by champion"),
    "success_off": number_or_empty("`success` of the same champions with the rule and the adaptation off"),
    "success_inverted": number_or_empty("the same with the reward inverted, for rules that receive one"),
    "evolved_parameters": number("how many parameters are evolved for a champion"),
    "robot_steps": number("control steps of 32 ms in the evolution of a champion: mean over champions"),
}
_CHAMPIONS: Columns = {
    **_METHOD,
    "seed": number("seed of its evolution"),
    "champion": text("run folder in which it, or the rule for it, was evolved"),
    "test": text("run folder of its lifetimes in the training world and all test worlds"),
    "solves": number("1 if it solves both sides in training, in `reversal` if it learns; else 0"),
    "trials": number("sides times test worlds; in `reversal`, trials of all lifetimes"),
    "successes": number("of them: more than half of the repeats succeed; in `reversal`, rewarded ones"),
    "successes_off": number_or_empty("the same with the rule off; empty for plain methods"),
    "successes_inverted": number_or_empty("the same with the reward inverted, for rules that receive one"),
    "robot_steps": number("control steps of its evolution, and of the champion that it was added to"),
}
_WORLDS: Columns = {
    **_METHOD,
    "tests": text_or_empty("the sweep that it belongs to; empty in `reversal`"),
    "scenario": text("a test world"),
    "trials": number("champions times sides"),
    "successes": number("of them: more than half of the repeats succeed"),
}
_COSTS: Columns = {
    **_METHOD,
    "evolve_cpu_s": number("CPU seconds of the evolution of a champion: mean over champions"),
    "test_cpu_s": number("CPU seconds of its lifetimes in the training world and all test worlds"),
}
_FLOCK: Columns = {
    "loudness": number("noise of the broken robot, times that of others"),
    "knowers": number("robots that know the way to the goal"),
    "range_m": number("m within which robots perceive one another"),
    "breaks": Column(("stranger", "knower", "none"), "which robot breaks: `stranger` (to the way), `knower`, or none"),
    "coupling": text("its name; `(shuffled)`: it is given the numbers of other robots"),
}
_OF_FLOCK: Columns = {
    "before": number("mean cosine of heading to the goal, of intact robots, in the second half before the break"),
    "just_after": number("the same in the first tenth of the time after the break"),
    "long_after": number("the same in the second half of the time after the break"),
    "weight_to_broken": number_or_empty("in that half: mean weight to the broken robot; 1 in a frozen flock"),
    "effective_leaders": number("in that half: e to the entropy of whom a robot listens to, mean over robots"),
    "polarisation": number("in that half: length of the mean heading, 1 if all drive one way"),
    "spread_m": number("in that half: mean distance from the middle of the flock, m"),
}
_SEEDS = "mean over seeds: "
_RUNS: Columns = {
    **_FLOCK,
    "seed": number("seed of the flock"),
    **_OF_FLOCK,
    "least_gap_m": number("least distance between the rims of two robots in the run, m; below 0 in a collision"),
}
_OVER_RUNS: Columns = {
    **_FLOCK,
    "runs": number("how many there are, one from each seed"),
    "good": number("share of runs with `long_after` above 0.9"),
    **_interval("good_"),
    **{end: one for name, (kind, of) in _OF_FLOCK.items() for end, one in _mean(name, _SEEDS + of, kind=kind).items()},
    "least_gap_m": number("the least of all runs"),
    **_mean("difference", "`long_after` less that of the frozen flock", ", from a bootstrap over seeds", NUMBER),
}
_CURVES: Columns = {
    "breaks": _FLOCK["breaks"],
    "coupling": _FLOCK["coupling"],
    "minute": number("middle of the minute, since the start"),
    **_mean("cosine", "mean cosine of heading to the goal, of intact robots", ", from a bootstrap over seeds", NUMBER),
}
_ESTIMATOR: Columns = {
    "case": text("series with a known transfer entropy, or a wiring with known links"),
    "estimate": number("what the estimator gives, nats; of a wiring the area under the curve"),
    "expected": number_or_empty("what theory gives"),
}

TABLES: Mapping[str, tuple[str, Columns]] = {
    "metrics.csv": ("Of `evaluate`, `reproduce` and tests of `leaderboard`: a row a lifetime.", METRICS),
    "metrics.csv with task=reversal": ("Columns that then follow.", REWARDED),
    "reversal_trials.csv": ("Of `evaluate task=reversal`: a row for each trial of each lifetime.", REVERSAL_TRIALS),
    "reversal.csv": ("Of `evaluate task=reversal`: a row for each controller, for chance, the optimum.", REVERSAL),
    "history.csv": ("Of `evolve`: a row a generation.", HISTORY),
    "sweep.csv": ("Of `sweep`: the rows of all `metrics.csv`, with these columns before them.", _JOB),
    "summary.csv": (
        "Of `sweep` and `evaluate -m`: a row for each condition, champion, controller and side, which earlier columns "
        "name. `GA` has one row for all keys of `hebbian`, `adaptation` and `compare`.",
        {**SUMMARY, **SUMMARY_MEANS},
    ),
    "over_champions.csv": (
        "Of the same, over several champions: a row for each condition, controller and side. With `task=reversal` "
        "there are `rewarded_share`, `rewarded_share_low` and `rewarded_share_high`, too.",
        OVER_CHAMPIONS,
    ),
    "failed.csv": (
        "Of `sweep`: a row for each job without a result; empty if all jobs have one.",
        {**_JOB, "KEY": text_or_empty("a column for each key that was set"), "error": text("why")},
    ),
    "rescue_over_all.csv": (
        "Of sweeps and `evaluate -m` over champions, in training and changed worlds: a row for each plasticity.",
        RESCUE,
    ),
    "rescue_by_champion.csv": ("Of the same: the counts of each champion.", _RESCUE_BY_CHAMPION),
    "rescue_and_harm.csv": (
        "Of `reproduce` and such sweeps: the same for each world. A trial is one champion on one side.",
        _RESCUE_AND_HARM,
    ),
    "retention.csv": ("Of both: how many of the trials solved in training succeed in the changed worlds.", _RETENTION),
    "claims.csv": ("Of `reproduce`: a row for each claim of the paper.", CLAIMS),
    "trials.csv": ("Of `reproduce`: a row for each champion, side and condition.", _TRIALS),
    "success.csv": ("Of `reproduce`: a row for each condition and side, over the champions.", _SUCCESS),
    "dose_response.csv": ("Of `reproduce`: a row for each rate; N = 0 is the genes alone.", _DOSE_RESPONSE),
    "leaderboard.csv": ("Of `leaderboard`: a row for each method and experiment, best first.", LEADERBOARD),
    "champions.csv": ("Of `leaderboard`: a row for each champion. `leaderboard.csv` is computed from it.", _CHAMPIONS),
    "worlds.csv": ("Of `leaderboard`: a row for each method and test world.", _WORLDS),
    "cost.csv": ("Of `leaderboard`: times, which differ between repetitions of the same command.", _COSTS),
    "runs.csv": ("Of `flock` and of its conditions: a row for each run.", _RUNS),
    "flock.csv": ("Of `flock`: a row for each condition and coupling, over the runs.", _OVER_RUNS),
    "curves.csv": ("Of `flock`: a row for each minute, in the usual condition.", _CURVES),
    "minutes.csv": (
        "Of each condition of `flock`: the same for each run.",
        {**_some(_CURVES, "breaks", "coupling"), **_some(_RUNS, "seed"), **_some(_CURVES, "minute", "cosine")},
    ),
    "estimator.csv": ("Of `flock`: a row for each known case.", _ESTIMATOR),
    "comparison.csv": ("Of `reproduce`: a row for each number of the paper's tables.", _COMPARISON),
    "repeats.csv": ("Of `reproduce genome=FILE`: a row for each number of the paper's tables.", _REPEATS),
}


_JOINED = Array((2, "synapses"), "", "beside `wiring`: the presynaptic and postsynaptic neuron of each synapse")


def _sample(unit: str, meaning: str, axes: tuple[str | int, ...] = ()) -> Array:
    return Array(("lifetimes", "samples", *axes), unit, meaning)


TRACES: Mapping[str, Array] = {
    "controller": Array(("lifetimes",), "", "the name of the controller, as in `metrics.csv`"),
    "side": Array(("lifetimes",), "", "`left` or `right`"),
    "genome": Array(("synapses",), "", "the initial weights"),
    "layers": Array(("layers",), "", "how many neurons each layer has, sensors first, wheels last"),
    "wiring": Array((), "", "the name of the wiring, unless the network is layers"),
    "joined": _JOINED,
    "time": _sample("s", "since the start of the lifetime"),
    "pose": _sample("m, m, rad", "x (to the right), y (ahead at the start), heading, anticlockwise from x", (3,)),
    "sensors": _sample("0 to 1", "network inputs, light first (1 is dark), then distance (1 is touching)", ("inputs",)),
    "motors": _sample("-1 to 1", "outputs, left and right wheel; times `lifetime.gain_rad_s`: rad/s", (2,)),
    "fitness": _sample("", "live fitness F"),
    "change_signal": _sample("", "the signal that opens the gate of an adaptation; nan where there is none"),
    "rate": _sample("per step", "effective rate N_e"),
    "weight_change": _sample("", "sum of abs(W - W_gene) over all weights"),
    "tilt": _sample("rad, rad, m", "roll, pitch and height above the floor, with `physics=ode` alone", (3,)),
    "weights": _sample("", "all weights, layer by layer, a row for each presynaptic neuron", ("synapses",)),
    "activations": _sample("", "beside `wiring`: activations of its neurons, those behind the bias", ("neurons",)),
}

CHAMPION: Mapping[str, Array] = {
    "genome": Array(("genes",), "", "all genes: the weights, layer by layer, then parameters of neurons and of a rule"),
    "layers": Array(("layers",), "", "how many neurons each layer has"),
    "wiring": Array((), "", "the name of the wiring, unless the network is layers"),
    "joined": _JOINED,
    "wiring_settings": Array((), "", "beside `wiring`: its settings as JSON"),
    "parts": Array(("parts",), "", "the names of the parts of the genome"),
    "part_sizes": Array(("parts",), "", "how many genes each has"),
    "fitness": Array((), "", "what it was chosen by"),
    "experiment": Array((), "", "`light` or `obstacles`"),
    "seed": Array((), "", "of its evolution"),
    "generation": Array((), "", "the last one of its evolution, from 0"),
    "robot": Array((), "", "the name of the robot that it is for"),
    "lights": Array((), "", "how many of the sensor readings are of light"),
    "optimizer": Array((), "", "what it was evolved by"),
    "training": Array((), "", "in which worlds"),
    "rule": Array((), "", "the plasticity rule that it evolved with, if any"),
    "task": Array((), "", "the task that it evolved for, unless it is the paper's"),
    "rewarded": Array((), "", "beside `task`: 1 if the last input of the network is the reward, else 0"),
    "fitness_function": Array((), "", "the fitness that its evolution maximised, unless it is the paper's"),
    "sensors": Array((), "", "the readings of the user's own sensors, with `, ` between, if it has any"),
    "physics": Array((), "", "the physics in which it evolved, unless it is `pymunk`"),
    "memory_*": Array((), "", "nominal statistics of its training world, for adaptations"),
}
