"""What all pages that we write have in common: they ask nothing of any network, and do only what we wrote."""

import base64
import hashlib


def policy(*, style: str, script: str | None = None) -> str:
    """The content security policy of a page with this style and this script, whatever a title or a name in it says.

    Nothing may be fetched, and only this very style and script may act; the pictures are in the page.
    """
    acts = f"script-src '{_hash(script)}'; " if script is not None else ""
    return f"default-src 'none'; img-src data:; style-src '{_hash(style)}'; {acts}base-uri 'none'; form-action 'none'"


def _hash(text: str) -> str:
    return f"sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}"
