"""Words of the user's, in names, folders and encodings: shown to the letter everywhere, and never taken for code."""

import io
import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from cases import call, done, first_of

import epuckhebb
from epuckhebb.analysis.figures import plain as in_figures
from epuckhebb.analysis.page import study_page
from epuckhebb.analysis.tables import Table, code, plain
from epuckhebb.cli.console import report_errors
from epuckhebb.config import overrides
from epuckhebb.runtime.errors import USAGE, ConfigError
from epuckhebb.runtime.resources import data_folder

PACKAGE = Path(epuckhebb.__file__).parent
SHORT = ["repeats=1", "lifetime.duration_s=0.064"]
QUICK = [*SHORT, "lifetime.record_every=0"]
ODD = ["a b", 'a"b', "it's", "a\\", 'a\\"', "a\nb", "é漢", "a,b=c", "$", "~x"]


@pytest.mark.parametrize("text", ODD)
def test_a_quoted_text_means_itself(text):
    assert overrides.override_value(f"key={overrides.quoted(text)}") == text


@pytest.mark.thorough
@pytest.mark.usefixtures("here")
def test_all_verbs_work_in_an_odd_folder(tmp_path, monkeypatch):
    folder = tmp_path / 'it\'s "a" ${x} é\n\\'
    (folder / "conf").mkdir(parents=True)
    monkeypatch.chdir(folder)
    champion = data_folder("runs/reference") / "champion_obstacles.npz"
    (folder / "${seed}.npz").write_bytes(champion.read_bytes())
    genome = f"genome={overrides.quoted('${seed}.npz')}"
    for words in (
        ["evaluate", *SHORT, "lifetime.record_every=1", genome, "hydra.run.dir=one"],
        ["show", "one"],
        ["replay", "one"],
        ["rerun", "one"],
        ["evaluate", *QUICK, "-m", "seed=1,2", "--config-dir", str(folder / "conf")],
        ["sweep", "obstacles", *QUICK, "scenario=base", "hydra/launcher=basic"],
    ):
        done(*words)
    told = json.loads(call("evaluate", *QUICK, "-m", "seed=1,2", "--json").stdout)
    assert len(told["runs"]) == 2


@pytest.mark.parametrize("name", first_of(["[/x]", "$\\foo$", "a|b", "<script>alert(1)</script>", "漢"]))
@pytest.mark.usefixtures("here")
def test_a_name_is_shown_to_the_letter(name):
    words = [f"scenario.name='{name}'", "hebbian.name='[/y]'", "lifetime.record_every=1", "hydra.run.dir=one"]
    result = done("evaluate", *SHORT, *words)
    assert name in " ".join(result.stdout.split())
    done("show", "one")
    done("replay", "one")
    assert "<script>alert" not in Path("one/replay.html").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    "name", ["a|b", "`x`", "<img src=x onerror=alert(1)>", "[a](http://b)", "*a*_", "a\nb", "&lt;"]
)
def test_a_report_has_names_to_the_letter_and_a_policy(name):
    text = f"Genome {code(name)}.\n\n{Table([plain(name), 'b'], [[code(name), '1']]).markdown()}"
    page = study_page(text, str.encode)
    assert "<img" not in page
    assert "<a " not in page
    assert "<em>" not in page
    assert re.findall("<(t[hd])[ >]", page) == ["th", "th", "td", "td"]
    assert (
        "http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; img-src data:; style-src 'sha256-" in page
    )
    shown = name.replace("\n", " ").replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")
    assert page.count(shown) == 3


def test_a_figure_has_what_its_font_has():
    assert in_figures("$a$ 漢\né") == "\\$a\\$ ?\né"


@pytest.mark.usefixtures("here")
def test_a_run_is_told_in_ascii():
    done("evaluate", *QUICK, "-q", "hydra.run.dir=one")
    plain_ascii = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0", "PYTHONIOENCODING": "ascii"}
    command = [sys.executable, "-X", "warn_default_encoding", "-m", "epuckhebb", "show", "one"]
    shown = subprocess.run(command, env=os.environ | plain_ascii, capture_output=True, check=False)
    assert shown.returncode == 0, shown.stderr
    assert b"Success" in shown.stdout
    assert str(PACKAGE).encode() not in shown.stderr, shown.stderr  # a file of ours that opens text without an encoding


class Closed(io.StringIO):
    """A pipe that nobody reads."""

    def write(self, text):
        raise BrokenPipeError(32, "Broken pipe")


def test_who_stops_reading_does_not_stop_the_work(monkeypatch):
    monkeypatch.setattr(sys, "stdout", Closed())
    with report_errors():
        print(json.dumps({}))


@pytest.mark.thorough
@pytest.mark.usefixtures("here")
def test_a_closed_pipe_ends_quietly():
    done("evaluate", *QUICK, "-q", "hydra.run.dir=one")
    reader, writer = os.pipe()
    os.close(reader)
    with os.fdopen(writer, "wb") as closed:
        command = [sys.executable, "-m", "epuckhebb", "show", "one", "--json"]
        shown = subprocess.run(command, stdout=closed, stderr=subprocess.PIPE, check=False)
    assert (shown.returncode, shown.stderr) == (0, b"")


@pytest.mark.usefixtures("here")
def test_a_folder_with_runs_in_it_where_one_run_is_wanted():
    done("evaluate", "-m", *QUICK, "seed=1", "hydra.sweep.dir=many")
    result = call("rerun", "many")
    assert result.exit_code == USAGE
    assert "many" in result.stderr
    Path("empty").mkdir()
    assert "Errno" not in call("show", "empty").stderr


@pytest.mark.parametrize(
    ("command", "word", "suggested"),
    [
        ("evaluate", "hebian.N=0.1", ["hebbian.N"]),
        ("evaluate_environment", "fitness.function=return", []),
        ("evaluate_environment", "lifetime.record_every=1", []),
        ("evaluate_environment", "figures.function=none", ["figures"]),
    ],
)
def test_a_key_that_is_suggested_is_one(command, word, suggested):
    with pytest.raises(ConfigError) as told:
        overrides.check_words(command, [word])
    assert re.findall(r"Did you mean ([\w.]+)\?", str(told.value)) == suggested
    overrides.check_words(command, [f"{key}={word.partition('=')[2]}" for key in suggested])
