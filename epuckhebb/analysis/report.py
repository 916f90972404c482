"""The report of a reproduction: claims, tables, success, rescue and harm, figures; as Markdown and as one HTML page.

Every number is from a table that is also a CSV file; nothing is computed here.
"""

import base64
import re
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from typing import Any

import numpy as np
import pandas as pd
from markdown_it import MarkdownIt
from markdown_it.token import Token

from epuckhebb.analysis import page, published, rescue
from epuckhebb.analysis.findings import PAPER_N, RULE
from epuckhebb.analysis.tables import code, markdown_table
from epuckhebb.tmaze.individual import CONTROLS, GA

_STYLE = """
:root { color-scheme: light dark; }
body { font: 16px/1.55 system-ui, sans-serif; max-width: 76rem; margin: 2rem auto; padding: 0 1rem; }
p, ul { max-width: 64rem; }
h1, h2, h3 { line-height: 1.2; } h2 { margin-top: 2.5rem; border-bottom: 1px solid #8886; padding-bottom: .3rem; }
div.wide { overflow-x: auto; }
table { border-collapse: collapse; font-size: .85rem; font-variant-numeric: tabular-nums; }
th, td { padding: .3rem .6rem; border-bottom: 1px solid #8884; text-align: left; vertical-align: top; }
th { vertical-align: bottom; } .number { text-align: right; }
img { max-width: 100%; height: auto; background: #fff; border-radius: 4px; } code { font-size: .9em; }
"""
_SHOWCASE = (
    "Among the champions that solve both sides in training (among all, if none does), it agrees with the paper in most "
    "cells. Of equals it has the lowest seed. It shows that the pattern exists, not how often."
)
_CLAIMS = f"Each claim is a question to every trial that could show it. {RULE}\n\n"
RESCUE_TEXT = (
    f"{rescue.COUNTED} The difference is success with plasticity minus success without, over all trials. Its p is from "
    "an exact sign-flip test by champion. The controls change the weights by as much, in other directions."
)
_NUMBER = re.compile(r"\**([+−-]?[\d.]+[*%]*([ \[(,]|$)|–|$)")  # how a cell with a number begins: 2, not 2obstacles
_UNBROKEN = re.compile(r"\[[+-]?\d[^]<]*\]|\d+ of \d+|\b[np] = [\d.e-]+")  # an interval, a count, an n or a p


@dataclass(frozen=True, kw_only=True)
class Findings:
    """All tables of a reproduction; each is also a CSV file of that name. See `epuckhebb.analysis.findings`.

    showcase: for each experiment the champion that is shown, in how many cells it agrees with the paper, of how many.
    champions: how many of each experiment. given: whether one given genome takes their place. repeats: of every
    condition. provenance: a line on the origin of the data.
    """

    claims: pd.DataFrame
    success: pd.DataFrame
    rescue_and_harm: pd.DataFrame
    retention: pd.DataFrame
    dose_response: pd.DataFrame
    comparison: pd.DataFrame
    showcase: Mapping[str, tuple[str, int, int]]
    champions: int
    given: bool
    repeats: int
    provenance: str


def markdown(found: Findings, figures: Mapping[str, str]) -> str:
    """The report as Markdown. figures: file name -> caption, in order; the files are in `figures/` beside it."""
    parts = [
        "# The paper's experiment, reproduced\n",
        f"{found.provenance}\n",
        f"{rescue.trial(found.repeats)} Intervals are 95 %. Intervals and p values take champions as the independent "
        "unit, not trials.\n",
    ]
    if not found.given:
        parts += ["## The paper's claims\n", claims_table(found.claims)]
    parts += ["## Tables 1 to 3: ours (the paper's)\n", _tables(found)]
    if not found.given:
        parts += [
            "## Over all champions\n",
            "### Success\n",
            success_table(found.success),
            "### Rescue and harm\n",
            f"{RESCUE_TEXT}\n",
            rescue_table(found.rescue_and_harm),
            "### Retention\n",
            f"{rescue.RETENTION}\n",
            rescue.retention_table(_at_paper_rates(found.retention), by_experiment=True),
        ]
    parts += ["## Figures\n"]
    parts += [f"![{caption}](figures/{name})\n\n*{caption}*\n" for name, caption in figures.items()]
    return "\n".join(parts)


def html(text: str, picture: Callable[[str], bytes], title: str = "epuckhebb") -> str:
    """A report as one HTML page that loads nothing; `picture` gives a figure's PNG by its file name."""
    parser = MarkdownIt("commonmark", {"html": False}).enable("table")
    tokens = parser.parse(text)
    _align(tokens)
    body = parser.renderer.render(tokens, parser.options, {})
    body = body.replace(escape(published.NEW_LINE), "<br>")
    body = _UNBROKEN.sub(lambda found: found[0].replace(" ", "&nbsp;"), body)
    body = body.replace("<table>", '<div class="wide"><table>').replace("</table>", "</table></div>")
    for name in dict.fromkeys(part.split('"')[0] for part in body.split('src="figures/')[1:]):
        data = base64.b64encode(picture(name)).decode()
        body = body.replace(f'src="figures/{name}"', f'src="data:image/png;base64,{data}"')
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{page.policy(style=_STYLE)}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>{_STYLE}</style>\n</head>\n"
        f"<body>\n{body}</body>\n</html>\n"
    )


def _align(tokens: Sequence[Token]) -> None:
    """Give the cells of columns of numbers a class; the policy forbids a style of their own."""
    columns: dict[int, list[Token]] = {}
    numbers: dict[int, bool] = {}
    for place, token in enumerate(tokens):
        if token.type == "tr_open":
            column = 0
        elif token.type in ("th_open", "td_open"):
            columns.setdefault(column, []).append(token)
            token.attrs.pop("style", None)
            if token.type == "td_open":
                numbers[column] = numbers.get(column, True) and bool(_NUMBER.match(tokens[place + 1].content))
            column += 1
        elif token.type == "table_close":
            for cell in (cell for column, cells in columns.items() if numbers.get(column) for cell in cells):
                cell.attrSet("class", "number")
            columns, numbers = {}, {}


def claims_table(claims: pd.DataFrame, *, counted: bool = True) -> str:
    """The claims with their verdicts and the rule that decides. counted: with a column on which trials count."""
    rows = [
        [row.experiment, row.claim, f"**{row.verdict}**", f"{row.true} of {row.n}", _interval(row)]
        + ([row.counted] if counted else [])
        for row in claims.itertuples()
    ]
    head = ["experiment", "claim", "verdict", "true in", "share", *(["which trials: what counts"] if counted else [])]
    return _CLAIMS + markdown_table(head, rows)


def _tables(found: Findings) -> str:
    parts = []
    for _, group in found.comparison.groupby("table", sort=False):
        experiment = group.experiment.iloc[0]
        name, agreeing, cells = found.showcase[experiment]
        parts.append(f"### {group.title.iloc[0]}\n")
        if found.given:
            parts += [f"Genome {code(name)}.\n", published.to_markdown(group, of_all=False)]
            parts += [
                "\nRelative deviation from the published value, and where that is among the repeats:\n",
                _deviations(group),
            ]
            continue
        parts += [
            f"Showcase: {code(name)}, mean of its repeats. {_SHOWCASE} It agrees in {agreeing} of the {cells} cells of "
            f"this experiment; {found.champions} champions were compared.\n",
            published.to_markdown(group, of_all=False),
            f"\nAll {found.champions} champions, median [quartiles]:\n",
            published.to_markdown(group, of_all=True),
        ]
    return "\n".join(parts)


def _deviations(group: pd.DataFrame) -> str:
    known = group[group.published.notna()]
    rows = [
        [row.scenario, f"{row.controller} {row.side}", row.metric, f"{row.published:g}", f"{row.ours:.4f}"]
        + ["–" if np.isnan(row.relative_deviation) else f"{100 * row.relative_deviation:+.1f} %"]
        + [f"[{row.low:.4f}, {row.high:.4f}]", "–" if np.isnan(row.percentile) else f"{row.percentile:.0f}", f"{row.n}"]
        for row in known.itertuples()
    ]
    head = ["scenario", "controller", "metric", "paper", "ours", "deviation", "95 % of repeats", "paper's percentile"]
    return markdown_table([*head, "repeats"], rows)


def _at_paper_rates(table: pd.DataFrame) -> pd.DataFrame:
    return table[(table.N == 0) | (table.experiment.map(PAPER_N) == table.N)]


def success_table(success: pd.DataFrame, controllers: Collection[str] = (GA, *CONTROLS.values())) -> str:
    """Success at the paper's rates, a row for each scenario and controller."""
    own = _at_paper_rates(success[success.controller.isin(controllers)])
    rows = []
    for (experiment, scenario, controller), group in own.groupby(["experiment", "scenario", "controller"], sort=False):
        sides = group.set_index("side")
        cells = [
            f"{sides.successes[side]} of {sides.n[side]}: {_interval(sides.loc[side])}"
            for side in ("left", "right", "both")
        ]
        rows.append([experiment, scenario, rescue.label(controller, group.N.iloc[0]), *cells])
    return markdown_table(["experiment", "scenario", "controller", "left", "right", "both sides"], rows)


def rescue_table(harm: pd.DataFrame) -> str:
    """Rescue and harm at the paper's rates, controls included."""
    own = _at_paper_rates(harm)
    rows = [
        [row.scenario, rescue.label(row.controller, row.N), *rescue.counts(row), rescue.difference(row)]
        + ["–" if np.isnan(row.sign_flip_p) else f"{row.sign_flip_p:.2g}"]
        for row in own.itertuples()
    ]
    return markdown_table(["scenario", "plasticity", rescue.RESCUED, rescue.HARMED, "difference", "p"], rows)


def _interval(row: Any) -> str:
    return rescue.share(row.share, row.low, row.high)
