"""What all HTML pages share: templates with their style and script, and the content security policy."""

import base64
import hashlib
import re
from pathlib import Path

_HERE = Path(__file__).parent
_PART = re.compile(r"(?:/\*|<!--)\{\{([\w.]+)\}\}(?:\*/|-->)\n?")  # where a file that pages share belongs


def filled(template: Path) -> tuple[str, str, str]:
    """The text of a template with the files that pages share in their places; its style and its script."""

    def part(place: re.Match[str]) -> str:
        folders = (folder for folder in (template.parent, _HERE) if (folder / place[1]).is_file())
        return (next(folders) / place[1]).read_text(encoding="utf-8")

    text = _PART.sub(part, template.read_text(encoding="utf-8"))
    style, script = (re.findall(f"<{tag}>(.*?)</{tag}>", text, re.DOTALL)[0] for tag in ("style", "script"))
    return text, style, script


def policy(*, style: str, script: str | None = None) -> str:
    """The policy of a page: it may load nothing, and only this style and this script act."""
    acts = f"script-src '{_hash(script)}'; " if script is not None else ""
    return f"default-src 'none'; img-src data:; style-src '{_hash(style)}'; {acts}base-uri 'none'; form-action 'none'"


def _hash(text: str) -> str:
    return f"sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}"
