"""`epuckhebb figure`, and the key `figures`."""

import os
import subprocess
import sys

import pytest
from cases import done, first_of, refused
from matplotlib.figure import Figure

from epuckhebb.analysis import charts

SHORT = ["scenario=4obstacles", "lifetime.duration_s=8", "repeats=1", "-q"]
GA = ["ga.population=6", "ga.generations=2", "ga.elites=2", "ga.loops=1", "lifetime.duration_s=3", "-q"]


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """A folder with an evaluation whose figures are SVGs, one of many rates without figures, and an evolution."""
    folder = tmp_path_factory.mktemp("runs")
    done("evaluate", *SHORT, "figures=svg", f"hydra.run.dir={folder}/evaluated")
    done("evolve", *GA, "scenario.paper_duration_s=10", "figures=none", f"hydra.run.dir={folder}/evolved")
    return folder


def test_a_run_has_its_figures_in_the_format_of_its_settings(runs):
    (figure,) = (runs / "evaluated" / "figures").iterdir()
    assert figure.name == "trajectories.svg"
    assert b"<svg" in figure.read_bytes()
    assert not (runs / "evolved" / "figures").exists()


@pytest.mark.parametrize(
    ("run", "name"),
    first_of(
        [
            ("evaluated", "trajectories"),
            ("evolved", "learning"),
            *(("evaluated", name) for name in ("maze", "weights")),
        ],
        ordinary=2,
    ),
)
def test_a_figure_is_drawn_again(runs, name, run):
    written = done("figure", runs / run, name, "--format", "pdf", "--width", "180").stdout.strip()
    assert written == str(runs / run / "figures" / f"{name}.pdf")
    assert (runs / run / "figures" / f"{name}.pdf").read_bytes().startswith(b"%PDF")


def test_weights_are_those_of_the_controller_that_learns(runs, here, monkeypatch):
    drawn = []
    monkeypatch.setattr(charts, "weights", lambda *shown: drawn.append(shown) or Figure())
    done("figure", runs / "evaluated", "weights", "-o", here / "weights.png")
    assert [title.partition(" in ")[0] for *_, title in drawn] == ["Hebbian"]


def test_settings_of_matplotlib_change_nothing(runs, here):
    """Those of a notebook that calls the program, and of a file beside it."""
    (here / "matplotlibrc").write_text("text.usetex: True\nfont.size: 30\n")
    environment = {**os.environ, "MPLBACKEND": "module://nowhere"}
    words = ["figure", str(runs / "evaluated"), "trajectories", "-f", "svg", "-o", "again.svg"]
    subprocess.run([sys.executable, "-m", "epuckhebb", *words], env=environment, check=True)
    assert (here / "again.svg").read_bytes() == (runs / "evaluated" / "figures" / "trajectories.svg").read_bytes()


def test_without_a_name_the_names_are_listed(runs):
    assert done("figure", runs / "evaluated").stdout.split() == ["trajectories", "maze", "weights"]


def test_what_cannot_be_drawn_is_refused(runs, tmp_path):
    output = tmp_path / "x.png"
    known = "has the figures trajectories, maze, weights; got learning"
    assert known in refused("figure", runs / "evaluated", "learning", "-o", output)
    assert "--width" in refused("figure", runs / "evaluated", "trajectories", "--width", "0", "-o", output)
    assert "one of png, svg, pdf, got bmp" in refused("figure", runs / "evaluated", "maze", "-f", "bmp", "-o", output)
    assert not output.exists()


def test_a_width_without_room_for_the_figure_is_refused(runs, tmp_path):
    words = ["figure", runs / "evaluated", "trajectories", "-o", tmp_path / "narrow.png", "--width"]
    assert "--width" in refused(*words, "60")
    assert not (tmp_path / "narrow.png").exists()
    done(*words, "180")


def test_a_figure_of_a_multirun_is_drawn_again(here):
    words = ["hebbian.N=0.0002,0.002", "scenario=highlight", "repeats=1", "lifetime.duration_s=1", "-q"]
    done("evaluate", "-m", *words, "lifetime.record_every=0", "hydra.sweep.dir=many")
    assert done("figure", "many").stdout.split() == ["dose_response"]
    done("figure", "many", "dose_response", "-o", here / "again.png")
    assert (here / "again.png").read_bytes() == (here / "many" / "figures" / "dose_response.png").read_bytes()


@pytest.mark.thorough
def test_figures_of_a_study_are_drawn_again(here):
    words = ["hebbian.N=0.0002,0.002", "scenario=highlight,lowlight", "genome=reference_1,reference_2"]
    done("sweep", "n_sweep", *words, "repeats=1", "lifetime.duration_s=4", "-q", "hydra/launcher=basic")
    (study,) = (here / "runs" / "sweep").iterdir()
    for name in ("dose_response", "rescue_and_harm"):
        drawn = (study / "figures" / f"{name}.png").read_bytes()
        done("figure", study, name, "-o", here / f"{name}.png")
        assert (here / f"{name}.png").read_bytes() == drawn
