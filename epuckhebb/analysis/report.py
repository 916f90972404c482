"""A page of a study as one HTML file, made from its Markdown."""

import base64
import re
from collections.abc import Callable, Sequence
from html import escape

from markdown_it import MarkdownIt
from markdown_it.token import Token

from epuckhebb.analysis import page
from epuckhebb.analysis.tables import NEW_LINE

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
_NUMBER = re.compile(r"\**([+−-]?[\d.]+[*%]*([ \[(,]|$)|–|$)")  # how a cell with a number begins: 2, not 2obstacles
_UNBROKEN = re.compile(r"\[[+-]?\d[^]<]*\]|\d+ of \d+|\b[np] = [\d.e-]+")  # an interval, a count, an n or a p


def html(text: str, picture: Callable[[str], bytes], title: str = "epuckhebb") -> str:
    """A report as one HTML page that loads nothing; `picture` gives a figure's PNG by its file name."""
    parser = MarkdownIt("commonmark", {"html": False}).enable("table")
    tokens = parser.parse(text)
    _align(tokens)
    body = parser.renderer.render(tokens, parser.options, {})
    body = body.replace(escape(NEW_LINE), "<br>")
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
