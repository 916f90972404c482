"""`epuckhebb export gallery`: a folder of replays that any web host can serve, with a page that shows them all."""

from pathlib import Path
from tempfile import TemporaryDirectory

import yaml

from epuckhebb.analysis.replay import fill_page
from epuckhebb.config import load_any
from epuckhebb.export.replay import replay
from epuckhebb.runs import evaluate_into
from epuckhebb.runtime import ConfigError, say
from epuckhebb.store import write_atomic
from epuckhebb.studies import flock

_HERE = Path(__file__)
EXHIBITS: list[dict[str, str]] = yaml.safe_load(_HERE.with_suffix(".yaml").read_text(encoding="utf-8"))


def gallery(folder: Path) -> list[Path]:
    """Write all exhibits, and the page that shows them; returns the files, that page last.

    What this computer cannot run, as three dimensions without their library, is left out with a word.
    """
    if folder.exists() and any(folder.iterdir()):
        raise ConfigError(f"--output={folder} holds files already; give another folder")
    made = []
    for exhibit in EXHIBITS:
        say(f"{exhibit['file']}: epuckhebb {exhibit['words']}")
        try:
            _make(exhibit["words"].split(), folder / exhibit["file"])
        except ConfigError as error:
            say(f"{exhibit['file']} is left out: {error}")
        else:
            made.append(exhibit)
    write_atomic(folder / "index.html", fill_page(_HERE.with_suffix(".html"), "gallery", {"exhibits": made}).encode())
    return [folder / name for name in (*(exhibit["file"] for exhibit in made), "index.html")]


def _make(words: list[str], target: Path) -> None:
    """Make one exhibit: run its command in a temporary folder, and write its replay."""
    if words[0] == "flock":
        write_atomic(target, flock.first_page().encode())
        return
    with TemporaryDirectory() as temporary:
        run, is_film = Path(temporary) / "run", target.suffix == ".gif"
        evaluate_into(run, load_any("evaluate", [*words[1:], "figures=none"]), words[1:], {}, threads=1)
        replay(run, None if is_film else target, target if is_film else None)
