"""HTML pages: templates with their style and script, the content security policy, and the page of a study."""

import base64
import hashlib
import re
from collections.abc import Callable
from html import escape
from pathlib import Path

from markdown_it import MarkdownIt

from epuckhebb.analysis.tables import NEW_LINE

_HERE = Path(__file__).parent
_PART = re.compile(r"(?:/\*|<!--)\{\{([\w.]+)\}\}(?:\*/|-->)\n?")  # where a file that pages share belongs

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


def filled(template: Path) -> tuple[str, str, str]:
    """The text of a template with the files that pages share in their places; its style and its script."""

    def part(mark: re.Match[str]) -> str:
        folders = (folder for folder in (template.parent, _HERE) if (folder / mark[1]).is_file())
        return (next(folders) / mark[1]).read_text(encoding="utf-8")

    text = _PART.sub(part, template.read_text(encoding="utf-8"))
    style, script = (re.findall(f"<{tag}>(.*?)</{tag}>", text, re.DOTALL)[0] for tag in ("style", "script"))
    return text, style, script


def policy(*, style: str, script: str | None = None) -> str:
    """The policy of a page: it may load nothing, and only this style and this script act."""
    acts = f"script-src '{_hash(script)}'; " if script is not None else ""
    return f"default-src 'none'; img-src data:; style-src '{_hash(style)}'; {acts}base-uri 'none'; form-action 'none'"


def _hash(text: str) -> str:
    return f"sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}"


def study_page(text: str, picture: Callable[[str], bytes], title: str = "epuckhebb") -> str:
    """The page of a study as one HTML file that loads nothing. text: Markdown. picture: gives the PNG of a file."""
    parser = MarkdownIt("commonmark", {"html": False}).enable("table")
    body = parser.render(text).replace(escape(NEW_LINE), "<br>")
    body = body.replace(' style="text-align:right"', ' class="number"')  # the policy forbids styles of cells
    body = body.replace("<table>", '<div class="wide"><table>').replace("</table>", "</table></div>")
    for name in dict.fromkeys(part.split('"')[0] for part in body.split('src="figures/')[1:]):
        data = base64.b64encode(picture(name)).decode()
        body = body.replace(f'src="figures/{name}"', f'src="data:image/png;base64,{data}"')
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{policy(style=_STYLE)}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>{_STYLE}</style>\n</head>\n"
        f"<body>\n{body}</body>\n</html>\n"
    )
