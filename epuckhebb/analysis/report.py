"""A page of a study as one HTML file, made from its Markdown."""

import base64
from collections.abc import Callable
from html import escape

from markdown_it import MarkdownIt

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


def html(text: str, picture: Callable[[str], bytes], title: str = "epuckhebb") -> str:
    """A report as one HTML page that loads nothing; `picture` gives a figure's PNG by its file name."""
    parser = MarkdownIt("commonmark", {"html": False}).enable("table")
    body = parser.render(text).replace(escape(NEW_LINE), "<br>")
    body = body.replace(' style="text-align:right"', ' class="number"')  # the policy forbids styles of cells
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
