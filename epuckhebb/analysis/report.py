"""One page to read: claims, tables, how often, dose-response, figures, method; as Markdown and as self-contained HTML.

Every number comes from a table that is also written as CSV; nothing is computed here.
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
from epuckhebb.sim.controller import CONTROLS, GA, HEBBIAN

_STYLE = """
:root { color-scheme: light dark; }
body { font: 16px/1.55 system-ui, sans-serif; max-width: 64rem; margin: 2rem auto; padding: 0 1rem; }
h1, h2, h3 { line-height: 1.2; } h2 { margin-top: 2.5rem; border-bottom: 1px solid #8886; padding-bottom: .3rem; }
div.wide { overflow-x: auto; }
table { border-collapse: collapse; font-size: .85rem; font-variant-numeric: tabular-nums; }
th, td { padding: .3rem .6rem; border-bottom: 1px solid #8884; text-align: left; vertical-align: top; }
th { vertical-align: bottom; } .number { text-align: right; }
img { max-width: 100%; height: auto; background: #fff; border-radius: 4px; } code { font-size: .9em; }
"""
_SHOWCASE = (
    "It is the champion whose successes and failures agree with the paper's in most cells, among those that reach both "
    "goals in their training world (of all, if none does); of equals the one with the lowest seed. Chosen for its "
    "likeness, it shows that the pattern exists, not how often."
)
_NUMBER = re.compile(r"\**([+−-]?[\d.]+[*%]*([ \[(,]|$)|–|$)")  # how a cell with a number begins: 2, not 2obstacles


@dataclass(frozen=True, kw_only=True)
class Findings:
    """All tables of a reproduction; each is also a CSV file of that name. See `epuckhebb.analysis.findings`.

    showcase: for each experiment the champion shown, in how many cells it agrees with the paper, of how many.
    champions: how many there are of each experiment. given: one given genome takes their place. repeats: of every
    condition, with other noise. provenance: a line on who made this and how.
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
    """The report as Markdown. figures: file name -> caption, in order; the files lie in `figures/` beside it."""
    parts = [
        "# The paper's experiment, reproduced\n",
        f"{found.provenance}\n",
        "A *trial* is one champion on one side. It succeeds if the robot ends within 5 cm of its goal in more than "
        f"half of its {found.repeats} noise repeats. Intervals are 95 %. They and the p values take champions for "
        "the independent unit: the two sides of a champion count as two trials only as far as they differ.\n",
    ]
    if not found.given:
        parts += ["## The paper's claims\n", _claims(found.claims)]
    parts += ["## Tables 1 to 3, ours and (the paper's)\n", _tables(found)]
    if not found.given:
        parts += [
            "## How often\n",
            "### Success\n",
            success_table(found.success),
            "### Rescue and harm\n",
            "Of the trials that the GA masters in its training world, *broken* ones fail in the changed world without "
            "plasticity; plasticity *rescues* some of them. Of the *sound* ones it *harms* some. Difference: success "
            "with plasticity minus without, over all trials; p: exact sign-flip test of it, by champion. The controls "
            "change the weights as much, but not as Hebb said.\n",
            rescue_table(found.rescue_and_harm),
            "### Retention\n",
            f"{rescue.RETENTION}\n",
            rescue.retention_table(_at_paper_rates(found.retention), by_experiment=True),
        ]
    parts += ["## Figures\n"]
    parts += [f"![{caption}](figures/{name})\n\n*{caption}*\n" for name, caption in figures.items()]
    return "\n".join(parts)


def summary(claims: pd.DataFrame, success: pd.DataFrame, harm: pd.DataFrame, provenance: str) -> str:
    """The tables of `docs/results.md`: claims, success, rescue and harm."""
    return "\n".join(
        [
            f"{provenance} A *trial* is one champion on one side; it succeeds if most of its noise repeats do. "
            "Intervals and p values take champions, not trials, for the independent unit.\n",
            _claims(claims, of_what=False),
            "Success, with 95 % intervals:\n",
            success_table(success, (GA, HEBBIAN)),
            "Of the trials solved in the training world, what the change breaks and plasticity rescues, and what it "
            "harms of the rest; the controls make changes of equal size that are not Hebb's. p is from an exact "
            "sign-flip test by champion:\n",
            rescue_table(harm),
        ]
    )


def answer(harm: pd.DataFrame, over_all: pd.DataFrame) -> str:
    """Whether plasticity helps, in five rows: the paper's rule in three worlds, and what was found since.

    harm: of `findings.rescue_and_harm`, with the paper's rule. over_all: of `findings.rescue_over_all`, with the
    adaptations `homeostasis` and `best`.
    """
    worlds = {"highlight": "nothing", "lowlight": "light dimmed to a tenth", "4obstacles": "four obstacles"}
    paper = harm[harm.controller == HEBBIAN].set_index("scenario")
    own = [row for row in paper.loc[list(worlds)].itertuples() if PAPER_N[row.experiment] == row.N]
    rows = [[worlds[row.Index], f"the paper's, N = {row.N:g}", *_rescued_and_harmed(row)] for row in own]
    for experiment, controller, told in (
        ("light", "homeostasis", "`adaptation=homeostasis`: light synapses are scaled"),
        ("obstacles", "best", "none; `adaptation=best`: it checks itself, and follows walls while late"),
    ):
        row = next(over_all[(over_all.experiment == experiment) & (over_all.controller == controller)].itertuples())
        rows.append([f"eight changes of the {experiment} experiment", told, *_rescued_and_harmed(row)])
    return markdown_table(["what changed", "plasticity", "rescued of broken", "harmed of sound"], rows)


def _rescued_and_harmed(row: Any) -> list[str]:
    return [rescue.count(row, "rescued", "broken"), rescue.count(row, "harmed", "intact")]


def html(
    text: str, picture: Callable[[str], bytes], title: str = "epuckhebb: the paper's experiment, reproduced"
) -> str:
    """A report as one HTML page without links to anything; `picture` gives a figure's PNG by its file name."""
    parser = MarkdownIt("commonmark", {"html": False}).enable("table")
    tokens = parser.parse(text)
    _align(tokens)
    body = parser.renderer.render(tokens, parser.options, {})
    body = body.replace(escape(published.NEW_LINE), "<br>")
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
    """Give the cells of columns of numbers a class, in place of a style of their own, which the policy forbids."""
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


def _claims(claims: pd.DataFrame, *, of_what: bool = True) -> str:
    rows = [
        [row.experiment, row.claim, f"**{row.verdict}**", f"{row.true} of {row.n}", _interval(row)]
        + ([row.counted] if of_what else [])
        for row in claims.itertuples()
    ]
    rule = f"A claim is put to every trial that could show it. {RULE}\n\n"
    head = ["experiment", "claim", "verdict", "true in", "share", *(["of what"] if of_what else [])]
    return rule + markdown_table(head, rows)


def _tables(found: Findings) -> str:
    parts = []
    for _, group in found.comparison.groupby("table", sort=False):
        experiment = group.experiment.iloc[0]
        name, agreeing, cells = found.showcase[experiment]
        parts.append(f"### {group.title.iloc[0]}\n")
        if found.given:
            parts += [f"Genome {code(name)}.\n", published.to_markdown(group, of_all=False)]
            parts += ["\nRelative deviation from the published value:\n", _deviations(group)]
            continue
        parts += [
            f"Showcase: {code(name)}, mean of its repeats. {_SHOWCASE} It agrees in {agreeing} of the {cells} "
            f"cells of this experiment's tables; {found.champions} champions were searched.\n",
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
        for row in known.itertuples()
    ]
    return markdown_table(["scenario", "controller", "metric", "paper", "ours", "deviation"], rows)


def _at_paper_rates(table: pd.DataFrame) -> pd.DataFrame:
    """The rows of the GA and of the paper's rates."""
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
        rows.append([experiment, scenario, f"{controller}{_rate(group.N.iloc[0])}", *cells])
    return markdown_table(["experiment", "scenario", "controller", "left", "right", "both sides"], rows)


def rescue_table(harm: pd.DataFrame) -> str:
    """Rescue and harm at the paper's rates, controls included."""
    own = _at_paper_rates(harm)
    rows = [
        [row.scenario, f"{row.controller}{_rate(row.N)}"]
        + _rescued_and_harmed(row)
        + [rescue.difference(row)]
        + ["–" if np.isnan(row.sign_flip_p) else f"{row.sign_flip_p:.2g}"]
        for row in own.itertuples()
    ]
    return markdown_table(["scenario", "plasticity", "rescued of broken", "harmed of sound", "difference", "p"], rows)


def _rate(rate: float) -> str:
    return f", N = {rate:g}" if rate else ""


def _interval(row: Any) -> str:
    return rescue.share(row.share, row.low, row.high)
