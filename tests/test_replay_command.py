"""`epuckhebb replay`: where it writes its page and its films, and what it says when there is nothing to replay."""

import contextlib
import json
import re
import webbrowser

import numpy as np
import pytest
from cases import call, done, refused
from PIL import Image

from epuckhebb.export import gallery
from epuckhebb.store.folder import RunFolder


def evaluated(folder, *overrides):
    """The folder of a fresh run."""
    with contextlib.chdir(folder):
        result = call("evaluate", "--json", "repeats=1", *overrides)
    assert result.exit_code == 0, result.output
    return folder / json.loads(result.stdout)["runs"][0]["run"]


@pytest.fixture(scope="module")
def short_run(tmp_path_factory):
    return evaluated(tmp_path_factory.mktemp("short"), "lifetime.duration_s=4")


def test_a_run_without_plasticity_has_one_robot(tmp_path):
    run = evaluated(tmp_path, "hebbian=none", "lifetime.duration_s=2")
    done("replay", run)
    page = (run / "replay.html").read_text(encoding="utf-8")
    data = json.loads(re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.DOTALL)[1])
    assert data["controllers"] == ["GA alone"]


def test_page_is_written_into_the_run_and_its_path_is_printed(short_run):
    result = done("replay", short_run)
    assert result.stdout.strip() == str(short_run / "replay.html")
    assert not list(short_run.glob(".*.tmp"))


def test_output_leaves_the_run_alone(short_run, tmp_path):
    before = sorted(short_run.iterdir())
    done("replay", short_run, "--output", tmp_path / "page.html")
    assert (tmp_path / "page.html").is_file()
    assert sorted(short_run.iterdir()) == before


def test_gif_shows_the_lifetime(short_run, tmp_path):
    done("replay", short_run, "--gif", tmp_path / "film.gif")
    with Image.open(tmp_path / "film.gif") as film:
        assert film.n_frames == 4  # 4 s, sixteen times as fast, at 10 frames a second, and the verdict
        assert film.width == 720
        film.seek(0)
        first = np.asarray(film.convert("RGB"))
        film.seek(film.n_frames - 1)
        last = np.asarray(film.convert("RGB"))
    assert tuple(first[-1, -1]) == (255, 255, 255)
    assert (first != last).any()


def test_a_run_that_recorded_nothing_says_how_to_record(tmp_path):
    run = evaluated(tmp_path, "scenario=2obstacles", "lifetime.duration_s=2", "lifetime.record_every=0")
    result = call("replay", run)
    assert result.exit_code == 2
    assert "lifetime.record_every=8" in result.output


def test_a_run_of_evolve_points_to_evaluate(tmp_path):
    run = RunFolder.new(tmp_path / "run", "evolve", "seed: 1\n", [], {})
    with run:
        pass
    assert f"evaluate genome={run.path}" in refused("replay", run.path)


def test_a_place_that_cannot_be_written(short_run, tmp_path):
    (tmp_path / "no").write_text("a file where a folder would have to be")
    assert str(tmp_path / "no") in refused("replay", short_run, "--output", tmp_path / "no" / "page.html")


@pytest.fixture
def opened(monkeypatch):
    addresses = []
    monkeypatch.setattr(webbrowser, "open", lambda address: addresses.append(address) or True)
    return addresses


def test_replay_open(short_run, opened):
    done("replay", short_run, "--open")
    assert opened == [(short_run / "replay.html").resolve().as_uri()]


def test_a_gallery_leaves_out_what_cannot_run_here_and_replaces_nothing(here, monkeypatch):
    short = {**gallery.EXHIBITS[0], "words": "evaluate lifetime.duration_s=2 repeats=1"}
    none = {**short, "file": "none.html", "words": "evaluate physics=none"}
    monkeypatch.setattr(gallery, "EXHIBITS", [short, none])
    result = done("export", "gallery", "--output", "site")
    assert "physics" in result.stderr
    assert sorted(path.name for path in (here / "site").iterdir()) == ["index.html", short["file"]]
    index = (here / "site" / "index.html").read_text(encoding="utf-8")
    assert "showcase.html" in index
    assert "none.html" not in index
    assert "--output" in refused("export", "gallery", "--output", "site")
    assert "gallery" in refused("export", "reference")
