"""Ends over many champions: at which goal robots are at the last step, and whether the lamp has to do with it.

A robot that drives to the end of an arm is at its goal by chance in about half of the trials. So the right ends of a
plasticity rule say little without its wrong ones: those at the goal of the other side.

All begin with `trials`, of the rows of `epuckhebb.analysis.lifetimes.gather`; `genome` is the champion. `settings` are
the columns that name a condition. A trial is one champion on one side, and has the end of most of its repeats.
Champions are the independent unit of intervals and p values.
"""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np
import pandas as pd

from epuckhebb.analysis import findings
from epuckhebb.analysis.findings import BROKEN, INTACT, UNSOLVED
from epuckhebb.analysis.lifetimes import is_of_plasticity, numeric
from epuckhebb.analysis.rescue import label
from epuckhebb.analysis.statistics import bootstrap, bounds, mean, sign_flip
from epuckhebb.analysis.tables import Table, cell, interval_text, plain
from epuckhebb.tmaze.individual import HEBBIAN
from epuckhebb.tmaze.maze import SIDES
from epuckhebb.tmaze.outcome import End

OTHER = "another champion"
ALL = "all"
MEANING = (
    "A trial ends *right* within 5 cm of its goal at the last step, *wrong* within 5 cm of the goal of the other side, "
    "*elsewhere* if it does neither; it has the end of more than half of its repeats, and *elsewhere* without such. It "
    "*arrived* if more than half of them reached the goal at any time. *Right less wrong* is a mean over champions: 0 "
    "if the end is chance."
)
_CELL = ("experiment", "scenario", "controller", "N")
_OF_SCENARIO = ("light", "obstacles")  # with `scenario.*`, keys of the world that a scenario names
_PERCENTILES = {"": (2.5, 97.5), "_90": (5.0, 95.0)}
_DRAW = r"_\d$"  # how the names of draws of one control end
_COUNTED = [End.right.value, End.wrong.value, End.elsewhere.value, "arrived"]


def trials(rows: pd.DataFrame, settings: Sequence[str] = ()) -> pd.DataFrame:
    """One row for each condition, champion and side: `end`, `arrived` and `fate`.

    `fate` is that of `findings.find_fates`, where the rows hold the training world with the same settings; it is empty
    where keys of a scenario vary one by one.
    """
    conditions = [key for key in settings if key not in ("genome", "N")]
    world = [key for key in conditions if not is_of_plasticity(key) and key != "scenario"]
    each = findings.find_fates(findings.trials(numeric(rows), conditions), world)
    if any(key in _OF_SCENARIO or key.startswith("scenario.") for key in world):
        each["fate"] = ""
    more = [key for key in conditions if key not in _CELL]
    return each[[*more, *_CELL, *findings.TRIAL, "end", "arrived", "fate"]]


def champion_ends(each: pd.DataFrame) -> pd.DataFrame:
    """One row for each condition and champion: how many of its trials end where, and the end and fate of each side.

    each: the trials.
    """
    by = [*each.columns[: each.columns.get_loc("side")]]
    counts = _counted(each).groupby(by, sort=False)[_COUNTED].sum()
    sides = each.set_index([*by, "side"])[["end", "arrived", "fate"]].unstack("side").reindex(counts.index)
    sides.columns = pd.Index([f"{column}_{side}" for column, side in sides])
    return counts.join(sides).reset_index()


def _counted(each: pd.DataFrame) -> pd.DataFrame:
    """Trials with a column for each end: whether the trial has it."""
    return each.assign(**{end.value: each.end == end for end in End})


def draws(compared: Iterable[Mapping[str, Any]]) -> dict[str, str]:
    """The names `NAME_0`, `NAME_1` and so on of controls that differ in `sign_draw` alone, each with its `NAME`.

    compared: `compare` of each run, the settings of controllers by name.
    """
    rules: dict[str, list[Any]] = {}
    for controllers in compared:
        for name, settings in controllers.items():
            rule = {key: value for key, value in settings.items() if key != "sign_draw"}
            if rule not in rules.setdefault(name, []):
                rules[name].append(rule)
    controls = {name: re.sub(_DRAW, "", name) for name in rules}
    alike = {control: [rules[name] for name in rules if controls[name] == control] for control in controls.values()}
    return {name: control for name, control in controls.items() if all(rules[name] == rule for rule in alike[control])}


def _merge_draws(each: pd.DataFrame, controls: Mapping[str, str]) -> pd.DataFrame:
    """Trials in which the draws of a control are one; the column `draw` has the old name. controls: as from `draws`."""
    taken = set(each.controller) - controls.keys()  # a control must not get the name of another controller
    control = each.controller.map(lambda name: name if controls.get(name) in taken else controls.get(name, name))
    has_several = each.groupby(control).controller.transform("nunique") > 1
    return each.assign(draw=each.controller, controller=each.controller.where(~has_several, control))


def ends(each: pd.DataFrame, controls: Mapping[str, str] = MappingProxyType({})) -> pd.DataFrame:
    """One row for each condition and `among`: how many trials end right, wrong and elsewhere, and how many arrived.

    A trial that ends right has arrived and stayed. `among`: `all` trials, or those of a fate. `right_less_wrong`: right
    less wrong ends of a champion, as a mean over the `champions` that have such trials: 0 if the end is chance, -2 to 2
    for two sides. It has 95 % and 90 % bootstrap intervals; `sign_flip_p` is its exact two-sided p value. Controls that
    are `draws` of one have its name, and all its numbers are means over them. Among trials of a fate there is one
    control more, `OTHER`: the paper's rule with the genome of another champion.

    each: the trials. controls: the control whose draw a controller is, as from `draws`.
    """
    return pd.DataFrame(
        list(_ends(_merge_draws(_counted(pd.concat([each, _exchange_genomes(each)], ignore_index=True)), controls)))
    )


def _exchange_genomes(each: pd.DataFrame) -> pd.DataFrame:
    """The trials of the paper's rule with the genome of the next champion of the experiment in each one's place.

    A lifetime depends on its genome, world, side, repeat and seed alone, so these lifetimes have been run. The fate is
    that of the trial of the champion whose place it is.
    """
    plastic = each[(each.controller == HEBBIAN) & (each.groupby("experiment").genome.transform("nunique") > 1)]
    trial, exchanged = [*plastic.columns[: plastic.columns.get_loc("end")]], plastic.drop(columns="fate")
    for _, rows in plastic.groupby("experiment", sort=False):
        first, *names = rows.genome.unique()
        exchanged.loc[rows.index, "genome"] = rows.genome.map(dict(zip([*names, first], [first, *names], strict=True)))
    return exchanged.merge(plastic[[*trial, "fate"]], on=trial).assign(controller=OTHER)


def _ends(each: pd.DataFrame) -> Iterator[dict[str, Any]]:
    """The rows of `ends.csv`. each: trials with their draws, and a column for each end."""
    by = [*each.columns[: each.columns.get_loc("genome")]]
    for condition, group in each.groupby(by, sort=False):
        draws = group.draw.nunique()
        for among in (ALL, BROKEN, INTACT, UNSOLVED):
            rows = group if among == ALL else group[group.fate == among]
            if rows.empty or (among == ALL and OTHER in condition):  # over all trials it is the rule itself
                continue
            of_champion = rows.groupby("genome", sort=False)[_COUNTED].sum()
            less = of_champion[End.right] - of_champion[End.wrong]
            row = dict(zip(by, condition, strict=True)) | {"among": among, "draws": draws, "trials": len(rows) // draws}
            row |= (of_champion.sum() / draws).to_dict()
            row |= {"champions": len(less), "right_less_wrong": less.mean() / draws}
            for name, percentiles in _PERCENTILES.items():
                interval = bootstrap(mean, less.to_numpy() / draws, percentiles=percentiles)
                row |= bounds(f"right_less_wrong{name}_", interval)
            yield row | {"sign_flip_p": sign_flip(less.to_numpy(np.int64))}


def discrimination(each: pd.DataFrame) -> pd.DataFrame:
    """One row for each condition: champions that end right on both sides, wrong on both, and how many by chance.

    A robot that can tell the sides ends right on both. `right_left`, `right_right`, `right_both`: champions that end
    right on the left side, on the right, on both; `right_expected`: on both, if the sides of a champion were
    independent, which is the product of the sides' shares times the champions. `wrong_...` counts wrong ends likewise.

    each: the trials; champions with one side alone do not count.
    """
    by = [*each.columns[: each.columns.get_loc("genome")]]
    in_order = pd.MultiIndex.from_frame(each[[*by, "genome"]].drop_duplicates())
    sides = each.set_index([*by, *findings.TRIAL]).end.unstack("side").reindex(in_order).dropna()
    rows = []
    for condition, group in sides.groupby(by, sort=False):
        row: dict[str, Any] = dict(zip(by, condition, strict=True)) | {"champions": len(group)}
        for end in (End.right, End.wrong):
            left, right = (group[side] == end for side in SIDES)
            row |= {f"{end}_left": left.sum(), f"{end}_right": right.sum(), f"{end}_both": (left & right).sum()}
            row[f"{end}_expected"] = left.sum() * right.sum() / len(group)
        rows.append(row)
    return pd.DataFrame(rows)


def tables(
    rows: pd.DataFrame, settings: Sequence[str] = (), controls: Mapping[str, str] = MappingProxyType({})
) -> dict[str, pd.DataFrame]:
    """All tables of ends by their names, of rows and settings as for `trials`, and draws as for `ends`."""
    each = trials(rows, settings)
    counts = {"ends": ends(each, controls), "ends_by_champion": champion_ends(each)}
    return {**counts, "discrimination": discrimination(each)}


def markdown(table: pd.DataFrame) -> str:
    """A section of a page: what ends are, and a table for each experiment. table: `ends.csv`."""
    parts = [f"{part.title}:\n\n{part.markdown()}" for part in readable(table)]
    return "\n".join(["## Ends\n", f"{MEANING}\n", *parts])


def readable(table: pd.DataFrame) -> list[Table]:
    """A table to read for each experiment, of all trials: a row for each world and controller. table: `ends.csv`."""
    return [
        _experiment_table(str(name), rows) for name, rows in table[table.among == ALL].groupby("experiment", sort=False)
    ]


def _experiment_table(experiment: str, table: pd.DataFrame) -> Table:
    """The ends of all trials of an experiment to read: a row for each world and controller."""
    settings = table.columns[: table.columns.get_loc("among")].difference(_CELL, sort=False)
    shown = [name for name in settings if table[name].nunique() > 1]
    head = [*map(plain, shown), "scenario", "controller", "trials", "right end", "wrong end", "elsewhere", "arrived"]
    rows = [
        [
            *(cell(value) for value in values),
            plain(row.scenario),
            plain(label(row.controller, row.N)) + (f", {row.draws} draws" if row.draws > 1 else ""),
            *(f"{getattr(row, name):g}" for name in ("trials", *_COUNTED)),
            interval_text(row, "right_less_wrong", "+.2f"),
        ]
        for values, row in zip(table[shown].itertuples(index=False), table.itertuples(), strict=True)
    ]
    title = f"Ends of the {experiment} experiment (right less wrong: of a champion, 95 % interval over champions)"
    return Table([*head, "right less wrong"], rows, title, text=len(shown) + 2)
