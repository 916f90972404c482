"""`epuckhebb export gallery`: a folder of replays that any web host can serve, with a page that shows them all."""

import html
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

from epuckhebb.config import load_any
from epuckhebb.export.replay import replay
from epuckhebb.runs import evaluate_into
from epuckhebb.runtime import ConfigError, say
from epuckhebb.store import write_atomic
from epuckhebb.studies import flock

_FLOCK = "flock"


class Exhibit(NamedTuple):
    """A page, or a GIF, of the gallery. file: its name. words: the command that made what it shows."""

    file: str
    title: str
    text: str
    words: str


GALLERY = [
    Exhibit(
        "showcase.html",
        "The paper's pattern",
        "In dim light this champion fails without plasticity, and succeeds with it on both sides. 2 of 20 do so.",
        "evaluate scenario=lowlight repeats=1",
    ),
    Exhibit(
        "typical.html",
        "A typical champion",
        "In the same world this one fails on both sides, with and without plasticity. 9 of 20 do so.",
        "evaluate scenario=lowlight genome=reference_1 repeats=1",
    ),
    Exhibit(
        "three_d.html",
        "The same showcase in three dimensions",
        "Another physics, with wheels, friction and weight: here the left robot succeeds without plasticity, too.",
        "evaluate scenario=lowlight physics=ode repeats=1",
    ),
    Exhibit(
        "flock.html",
        "Ten robots that listen to each other",
        "One that knows the way breaks after 20 minutes. Each flock has another rule for whom its robots listen to.",
        _FLOCK,
    ),
]


def gallery(folder: Path) -> list[Path]:
    """Write all exhibits, and the page that shows them; returns the files, that page first.

    What this computer cannot run, as three dimensions without their library, is left out with a word.
    """
    if folder.exists() and any(folder.iterdir()):
        raise ConfigError(f"--output={folder} holds files already; give another folder")
    made = []
    with TemporaryDirectory() as temporary:
        for exhibit in GALLERY:
            say(f"{exhibit.file}: epuckhebb {exhibit.words}")
            try:
                _make(exhibit, Path(temporary) / exhibit.file, folder / exhibit.file)
            except ConfigError as error:
                say(f"{exhibit.file} is left out: {error}")
            else:
                made.append(exhibit)
    text = Path(__file__).with_suffix(".html").read_text(encoding="utf-8")
    cards = "".join(map(_card, made))
    write_atomic(folder / "index.html", text.replace("{{cards}}", cards).encode())
    return [folder / "index.html", *(folder / exhibit.file for exhibit in made)]


def _make(exhibit: Exhibit, run: Path, target: Path) -> None:
    """Write an exhibit. run: the folder of its run."""
    if exhibit.words == _FLOCK:
        write_atomic(target, flock.first_page().encode())
        return
    _, *words = exhibit.words.split()
    evaluate_into(run, load_any("evaluate", [*words, "figures=none"], None), words, {}, threads=1)
    is_film = target.suffix == ".gif"
    replay(run, None if is_film else target, target if is_film else None)


def _card(exhibit: Exhibit) -> str:
    file, title, text, words = map(html.escape, exhibit)
    picture = f'<iframe src="{file}#preview" title="{title}" loading="lazy"></iframe>'
    if file.endswith(".gif"):
        picture = f'<img src="{file}" alt="{title}">'
    head, command = f'<h2><a href="{file}">{title}</a></h2>', f"<p><code>epuckhebb {words}</code></p>"
    return f"<article>{head}<p>{text}</p>{picture}{command}</article>\n"
