"""`epuckhebb export gallery`: a folder of replays that any web host can serve, with a page that shows them all."""

import html
from pathlib import Path
from tempfile import TemporaryDirectory

import yaml

from epuckhebb.config import load_any
from epuckhebb.export.replay import replay
from epuckhebb.runs import evaluate_into
from epuckhebb.runtime import ConfigError, say
from epuckhebb.store import write_atomic
from epuckhebb.studies import flock

EXHIBITS: list[dict[str, str]] = yaml.safe_load(Path(__file__).with_suffix(".yaml").read_text(encoding="utf-8"))


def gallery(folder: Path) -> list[Path]:
    """Write all exhibits, and the page that shows them; returns the files, that page first.

    What this computer cannot run, as three dimensions without their library, is left out with a word.
    """
    if folder.exists() and any(folder.iterdir()):
        raise ConfigError(f"--output={folder} holds files already; give another folder")
    made, cards = [folder / "index.html"], ""
    with TemporaryDirectory() as temporary:
        for exhibit in EXHIBITS:
            say(f"{exhibit['file']}: epuckhebb {exhibit['words']}")
            try:
                _make(exhibit["words"].split(), Path(temporary) / exhibit["file"], folder / exhibit["file"])
            except ConfigError as error:
                say(f"{exhibit['file']} is left out: {error}")
            else:
                made.append(folder / exhibit["file"])
                cards += _card(**{key: html.escape(value) for key, value in exhibit.items()})
    page = Path(__file__).with_suffix(".html").read_text(encoding="utf-8")
    write_atomic(made[0], page.replace("{{cards}}", cards).encode())
    return made


def _make(words: list[str], run: Path, target: Path) -> None:
    """Write an exhibit. run: the folder of its run."""
    if words[0] == "flock":
        write_atomic(target, flock.first_page().encode())
        return
    evaluate_into(run, load_any("evaluate", [*words[1:], "figures=none"]), words[1:], {}, threads=1)
    is_film = target.suffix == ".gif"
    replay(run, None if is_film else target, target if is_film else None)


def _card(file: str, title: str, text: str, words: str) -> str:
    head, command = f'<h2><a href="{file}">{title}</a></h2>', f"<p><code>epuckhebb {words}</code></p>"
    picture = f'<iframe src="{file}#preview" title="{title}" loading="lazy"></iframe>'
    if file.endswith(".gif"):
        picture = f'<img src="{file}" alt="{title}">'
    return f"<article>{head}<p>{text}</p>{picture}{command}</article>\n"
