"""The content security policy of all HTML pages that are written."""

import base64
import hashlib


def policy(*, style: str, script: str | None = None) -> str:
    """The policy of a page with this style and this script, whatever a title or a name in it says.

    The page may load nothing; only this style and this script act; pictures are in the page.
    """
    acts = f"script-src '{_hash(script)}'; " if script is not None else ""
    return f"default-src 'none'; img-src data:; style-src '{_hash(style)}'; {acts}base-uri 'none'; form-action 'none'"


def _hash(text: str) -> str:
    return f"sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}"
