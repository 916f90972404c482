"""The page that replays a run, its films, and what the command line says when there is nothing to replay."""

import base64
import contextlib
import hashlib
import io
import json
import re
import shutil
import webbrowser
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from PIL import Image
from typer.testing import CliRunner

from epuckhebb.app.cli import app
from epuckhebb.app.replay import recording, write_page
from epuckhebb.sim.controller import weights_at_birth
from epuckhebb.sim.lifetime import Lifetime
from epuckhebb.sim.maze import boxes
from epuckhebb.sim.plasticity import Hebbian
from epuckhebb.sim.scenario import Scenario
from epuckhebb.study import movie, replay
from epuckhebb.study.evaluate import GA_ALONE, HEBBIAN, evaluate
from epuckhebb.study.replay import Arrival

COLUMNS = {"x": ("pose", 0), "y": ("pose", 1), "heading": ("pose", 2), "left": ("motors", 0), "right": ("motors", 1)}
SAME_NAME = {"sensors": "sensors", "fitness": "fitness", "rate": "rate", "weightChange": "weight_change"}


def call(*arguments):
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


ARRIVES = Path(__file__).parents[1] / "runs/reference/champions/obstacles_seed001.npz"  # at both goals, always


def evaluated(folder, *overrides):
    """The folder of a fresh run."""
    with contextlib.chdir(folder):
        result = call("evaluate", "--json", "repeats=1", *overrides)
    assert result.exit_code == 0, result.output
    return folder / json.loads(result.stdout)["runs"][0]["run"]


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return evaluated(tmp_path_factory.mktemp("run"), "scenario=4obstacles", f"genome={ARRIVES}")


@pytest.fixture(scope="module")
def short_run(tmp_path_factory):
    return evaluated(tmp_path_factory.mktemp("short"), "lifetime.duration_s=4")


@pytest.fixture(scope="module")
def page(run):
    write_page(recording(run), run / "replay.html")
    return (run / "replay.html").read_text(encoding="utf-8")


def content(page):
    return json.loads(re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.DOTALL)[1])


def unpacked(packed):
    return packed["step"] * np.frombuffer(base64.b64decode(packed["numbers"]), "<i2").astype(float)


def test_page_of_four_full_lifetimes_is_under_3_mb(page):
    assert content(page)["samples"] * content(page)["interval"] == pytest.approx(250, abs=0.3)
    assert len(page.encode()) < 3e6


def test_page_needs_nothing_else(page):
    program = re.sub(r'id="data">.*?</script>', "", page, flags=re.DOTALL)
    assert not re.search(r"https?:|@import|\bfetch\b|XMLHttpRequest|import\(|url\(", program)
    assert re.findall(r'\b(?:src|href)="([^"]*)"', program) == ["data:,"]


def test_page_allows_only_its_own_style_and_script(page):
    policy = re.search(r'Content-Security-Policy" content="([^"]*)"', page)[1]
    assert policy.startswith("default-src 'none'; ")
    for tag in ("style", "script"):
        text = re.search(f"<{tag}>(.*?)</{tag}>", page, re.DOTALL)[1]
        digest = base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
        assert f"{tag}-src 'sha256-{digest}'" in policy


def test_page_holds_the_traces_to_within_half_a_step_of_quantisation(run, page):
    traces = np.load(run / "traces.npz")
    lives = content(page)["lives"]
    for k, (controller, side) in enumerate(zip(traces["controller"], traces["side"], strict=True)):
        life = lives[side][[GA_ALONE, HEBBIAN].index(controller)]
        expected = {name: traces[array][k][:, column] for name, (array, column) in COLUMNS.items()}
        expected |= {name: traces[array][k] for name, array in SAME_NAME.items()}
        expected["change"] = traces["weights"][k] - weights_at_birth(traces["genome"]).astype(np.float32)
        for name, values in expected.items():
            if not values.any():
                assert life[name] == {"step": 0, "numbers": ""}, name
                continue
            assert life[name]["step"] <= np.abs(values).max() / 32000, name
            np.testing.assert_allclose(unpacked(life[name]), values.ravel(), atol=0.51 * life[name]["step"], rtol=0)


def test_weights_of_the_robot_that_does_not_learn_take_no_room(page):
    for side in ("left", "right"):
        assert content(page)["lives"][side][0]["change"]["numbers"] == ""


def test_long_recordings_are_thinned_out():
    lifetime = Lifetime(duration_s=80.0, record_every=1)
    genome = np.random.default_rng(1).uniform(-1, 1, 234)
    _, traces = evaluate(genome, Scenario(), [Hebbian(name="paper", N=1e-3)], lifetime, repeats=1, seed=1)
    held = content(replay.page(traces, genome, Scenario(), "title", gain_rad_s=1.0))
    assert (held["samples"], held["steps"], held["interval"]) == (834, 3, pytest.approx(0.096))
    x = held["lives"]["right"][1]["x"]
    np.testing.assert_allclose(unpacked(x), traces.samples.pose[3, ::3, 0], atol=x["step"])


def test_a_title_cannot_become_markup():
    _, traces = evaluate(np.zeros(234), Scenario(), [], Lifetime(duration_s=1.0, record_every=8), repeats=1, seed=1)
    page = replay.page(traces, np.zeros(234), Scenario(), "</title><script>alert(1)</script>{{data}}", gain_rad_s=1.0)
    assert "<script>alert" not in page
    assert "{{data}}" in page  # as text, not filled in


def test_arrival_is_the_time_to_goal_of_the_metrics(run, page):
    metrics = pd.read_csv(run / "metrics.csv").set_index(["controller", "side"])
    for side, lives in content(page)["lives"].items():
        for controller, life in zip((GA_ALONE, HEBBIAN), lives, strict=True):
            assert life["arrival"] == pytest.approx(metrics.time_to_goal_s[controller, side], abs=0.033)


def test_floor_is_clear_of_walls(page):
    for left, right, bottom, top in content(page)["maze"]["floor"]:
        for wall_left, wall_right, wall_bottom, wall_top in boxes(0):
            overlap = min(right, wall_right) - max(left, wall_left), min(top, wall_top) - max(bottom, wall_bottom)
            assert min(overlap) < 0.0015  # the ends of the near walls jut 1 mm into the stem


ARRIVED, LATE, AWAY, PASSED = Arrival(50.2, 0.03), Arrival(61.0, 0.04), Arrival(None, 0.26), Arrival(60.4, 0.23)


@pytest.mark.parametrize(
    ("arrivals", "sentence"),
    [
        (
            [ARRIVED, LATE],
            "Both robots reached the goal on the left: without plasticity after 50.2 s, with plasticity after 61.0 s.",
        ),
        (
            [AWAY, LATE],
            "Only the robot with plasticity reached the goal on the left and stayed there, after 61.0 s; "
            "without plasticity it ended 26 cm away.",
        ),
        (
            [ARRIVED, PASSED],
            "Only the robot without plasticity reached the goal on the left and stayed there, after 50.2 s; "
            "with plasticity it was there after 60.4 s but drove on and ended 23 cm away.",
        ),
        (
            [AWAY, AWAY],
            "Neither robot reached the goal on the left: without plasticity it ended 26 cm away, "
            "with plasticity it ended 26 cm away.",
        ),
        (
            [PASSED, AWAY],
            "Neither robot stayed at the goal on the left: without plasticity it was there after 60.4 s "
            "but drove on and ended 23 cm away, with plasticity it ended 26 cm away.",
        ),
        ([ARRIVED], "The robot reached the goal on the left after 50.2 s."),
        ([AWAY], "The robot never reached the goal on the left: it ended 26 cm away."),
    ],
)
def test_outcome_is_one_plain_sentence(arrivals, sentence):
    assert replay.outcome("left", [GA_ALONE, HEBBIAN][: len(arrivals)], arrivals) == sentence


def test_outcome_names_controllers_it_does_not_know():
    sentence = replay.outcome("right", [GA_ALONE, HEBBIAN, "Shuffled"], [ARRIVED, LATE, AWAY])
    assert sentence == (
        "Only the robot without plasticity and the one with plasticity reached the goal on the right and stayed "
        "there, after 50.2 s and 61.0 s; with “Shuffled” it ended 26 cm away."
    )


def test_a_run_without_plasticity_has_one_robot(tmp_path):
    run = evaluated(tmp_path, "hebbian=none", "lifetime.duration_s=2")
    assert call("replay", run).exit_code == 0
    held = content((run / "replay.html").read_text(encoding="utf-8"))
    assert [controller["title"] for controller in held["controllers"]] == ["GA alone"]


def test_page_is_written_into_the_run_and_its_path_is_printed(short_run):
    result = call("replay", short_run)
    assert result.exit_code == 0
    assert result.stdout.strip() == str(short_run / "replay.html")
    assert not list(short_run.glob(".*.tmp"))


def test_output_leaves_the_run_alone(short_run, tmp_path):
    before = sorted(short_run.iterdir())
    assert call("replay", short_run, "--output", tmp_path / "page.html").exit_code == 0
    assert (tmp_path / "page.html").is_file()
    assert sorted(short_run.iterdir()) == before


def test_gif_shows_the_lifetime(short_run, tmp_path):
    result = call("replay", short_run, "--gif", tmp_path / "film.gif")
    assert result.exit_code == 0, result.output
    with Image.open(tmp_path / "film.gif") as film:
        assert film.n_frames == 7  # 4 s, eight times as fast, at 12.5 frames a second
        assert film.size == (960, 448)
        film.seek(0)
        first = np.asarray(film.convert("RGB"))
        film.seek(film.n_frames - 1)
        last = np.asarray(film.convert("RGB"))
    assert tuple(first[-1, -1]) == (255, 255, 255)
    assert (first != last).any()


def test_gif_ends_a_while_after_the_robots_came_to_rest(run):
    recorded = recording(run)
    moments = []
    frames = movie._frames(
        recorded.traces, recorded.config.scenario, "", lambda wanted: moments.extend(wanted) or wanted, 1.0
    )
    next(frames)
    assert 70 < moments[-1] < 90  # the last of the four arrives after 62 s; the lifetime goes on to 250 s


def test_mp4(short_run, tmp_path):
    pytest.importorskip("imageio_ffmpeg")
    assert call("replay", short_run, "--mp4", tmp_path / "film.mp4").exit_code == 0
    assert (tmp_path / "film.mp4").read_bytes()[4:8] == b"ftyp"


def test_mp4_without_ffmpeg_says_what_to_install(short_run, tmp_path, monkeypatch):
    monkeypatch.setattr(movie, "can_make_mp4", lambda: False)
    result = call("replay", short_run, "--mp4", tmp_path / "film.mp4", "--output", tmp_path / "page.html")
    assert result.exit_code == 2
    assert 'pip install "epuckhebb[video]"' in result.output
    assert not list(tmp_path.iterdir())


def test_a_run_that_recorded_nothing_says_how_to_record(tmp_path):
    run = evaluated(tmp_path, "scenario=2obstacles", "lifetime.duration_s=2", "lifetime.record_every=0")
    result = call("replay", run)
    assert result.exit_code == 2
    assert "epuckhebb evaluate repeats=1 scenario=2obstacles lifetime.duration_s=2 lifetime.record_every=8" in (
        result.output
    )


def test_not_a_run_folder(tmp_path):
    for path in (tmp_path, tmp_path / "nothing"):
        result = call("replay", path)
        assert result.exit_code == 2
        assert "run folder" in result.output


def test_a_run_of_evolve_points_to_evaluate(tmp_path):
    (tmp_path / "provenance.json").write_text('{"verb": "evolve"}')
    (tmp_path / "status.json").write_text('{"state": "finished"}')
    result = call("replay", tmp_path)
    assert result.exit_code == 2
    assert f"epuckhebb evaluate genome={tmp_path}" in result.output


@pytest.mark.parametrize("harm", ["missing", "not an archive", "incomplete"])
def test_traces_that_cannot_be_read(short_run, tmp_path, harm):
    run = shutil.copytree(short_run, tmp_path / "run")
    traces = run / "traces.npz"
    if harm == "missing":
        traces.unlink()
    elif harm == "not an archive":
        traces.write_bytes(b"PK\x03\x04 no more")
    else:
        buffer = io.BytesIO()
        np.savez(buffer, time=np.zeros((4, 1)))
        traces.write_bytes(buffer.getvalue())
    result = call("replay", run)
    assert result.exit_code == 2
    assert "traces.npz cannot be read (the run is finished)" in result.output


def test_a_place_that_cannot_be_written(short_run, tmp_path):
    (tmp_path / "no").write_text("a file where a folder would have to be")
    result = call("replay", short_run, "--output", tmp_path / "no" / "page.html")
    assert result.exit_code == 2
    assert "cannot write" in result.output


@pytest.fixture
def opened(monkeypatch):
    addresses = []
    monkeypatch.setattr(webbrowser, "open", lambda address: addresses.append(address) or True)
    return addresses


def test_replay_open(short_run, opened):
    assert call("replay", short_run, "--open").exit_code == 0
    assert opened == [(short_run / "replay.html").resolve().as_uri()]


def test_evaluate_open(tmp_path, opened):
    with contextlib.chdir(tmp_path):
        result = call("evaluate", "--open", "repeats=1", "lifetime.duration_s=1")
    assert result.exit_code == 0, result.output
    (page,) = tmp_path.glob("runs/evaluate/*/replay.html")
    assert opened == [page.resolve().as_uri()]


def test_evaluate_open_is_refused_for_a_multirun(tmp_path, opened):
    with contextlib.chdir(tmp_path):
        result = call("evaluate", "--open", "-m", "scenario=base,2obstacles")
    assert result.exit_code == 2
    assert "--open shows the page of one run" in result.output
    assert not opened
    assert not list(tmp_path.iterdir())


def test_open_without_a_browser_says_so(short_run, monkeypatch):
    monkeypatch.setattr(webbrowser, "open", lambda _: False)
    result = call("replay", short_run, "--open")
    assert result.exit_code == 1
    assert "no browser could be started" in result.output
