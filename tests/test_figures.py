"""Drawn mazes, trajectories and networks: they show what the scenario and the network say."""

import io
import math
from dataclasses import replace
from pathlib import Path

import matplotlib.figure
import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Rectangle
from PIL import Image

from epuckhebb.analysis import charts, figures, leaderboard_charts, movie
from epuckhebb.analysis.evaluate import Traces, evaluate
from epuckhebb.analysis.image import KINDS, image
from epuckhebb.controller.network import Network
from epuckhebb.controller.plasticity.rules.paper import Paper
from epuckhebb.controller.wirings.elman import Elman
from epuckhebb.flock import figure as flock
from epuckhebb.tmaze.individual import HEBBIAN, Controller
from epuckhebb.tmaze.life import Lifetime
from epuckhebb.tmaze.light import Lamp
from epuckhebb.tmaze.maze import Box, Maze, Place, Pose, Region, boxes
from epuckhebb.tmaze.samples import Samples, empty_samples
from epuckhebb.tmaze.scenario import Scenario

REFERENCE = Path(__file__).parents[1] / "runs" / "reference"
BOARD = ("leaderboard", "champions")
ROOM = Maze(  # a room of 0.6 m by 0.4 m, off the middle, with a wall far away that nobody can get to
    name="room",
    walls={
        "left": Box(0.18, 0.3, 0.04, 0.48),
        "right": Box(0.82, 0.3, 0.04, 0.48),
        "near": Box(0.5, 0.08, 0.68, 0.04),
        "far": Box(0.5, 0.52, 0.68, 0.04),
        "elsewhere": Box(-0.8, -0.8, 0.1, 0.1),
    },
    obstacles={"block": Box(0.5, 0.2, 0.1, 0.1)},
    obstacle_counts=(0, 1),
    start=Pose(0.3, 0.2, 0.0),
    goals={"left": Place(0.3, 0.42), "right": Place(0.7, 0.42)},
    goal_radius_m=0.07,
    arms={"left": Region(right=0.5), "right": Region(left=0.5)},
    arena_m=1.0,
)
IN_ROOM = Scenario(maze=ROOM, lamp=Lamp(x_m=0.5, y_m=0.1, towards_x=0.0, towards_y=1.0))


@pytest.fixture
def drawn(monkeypatch):
    """The figures that were made."""
    made = []

    def figure(*args, **more):
        made.append(Figure(*args, **more))
        return made[-1]

    for module in (charts, figures):
        monkeypatch.setattr(module, "Figure", figure)
    return made


def at_rest(place, seconds=100, controllers=("GA",)):
    """Traces of robots that stand still at a place on both trials, a sample a second."""
    samples = empty_samples(seconds, Network())
    samples.time[:] = np.arange(seconds)
    samples.pose[:, :2] = place
    both = [name for name in controllers for _ in range(2)]
    return Traces(
        controller=both,
        side=["left", "right"] * len(controllers),
        samples=Samples(*(np.stack([array] * len(both)) for array in samples)),
    )


def texts(figure):
    return [text.get_text() for text in figure.findobj(matplotlib.text.Text)]


def rectangles(axes):
    return [
        (box.get_x(), box.get_x() + box.get_width(), box.get_y(), box.get_y() + box.get_height())
        for box in axes.patches
        if isinstance(box, Rectangle)
    ]


def circles(axes):
    return [(*patch.center, patch.radius, patch.get_linestyle()) for patch in axes.patches if isinstance(patch, Circle)]


def test_view_is_where_a_robot_can_get_to_with_walls():
    np.testing.assert_allclose(figures.view(Scenario().maze), (-0.452842, 0.461, -0.452599, 0.272401), atol=0.01)
    np.testing.assert_allclose(figures.view(ROOM), (0.14, 0.84, 0.04, 0.54), atol=0.01)
    far = replace(ROOM, walls={**ROOM.walls, "elsewhere": Box(1e300, 0.0, 0.1, 0.1)})
    np.testing.assert_allclose(figures.view(far), (0.16, 0.86, 0.04, 0.54), atol=0.01)


def test_maze_shows_its_walls_goals_and_robot(drawn):
    figures.maze(IN_ROOM)
    (axes,) = drawn[0].axes
    np.testing.assert_allclose(rectangles(axes), boxes(ROOM))
    assert (0.3, 0.42, 0.07, ":") in circles(axes)
    assert (0.7, 0.42, 0.07, ":") in circles(axes)
    assert (0.3, 0.2, IN_ROOM.robot.radius_m, "solid") in circles(axes)
    nose = axes.lines[-1].get_xydata()
    np.testing.assert_allclose(nose, [(0.3, 0.2), (0.337, 0.2)])  # it looks along X
    assert axes.lines[0].get_xydata().tolist() == [[0.5, 0.1]]  # the lamp


def test_changes_are_marked_on_the_path(drawn):
    changes = [{"at_s": 30.0, "light": 1.0}, {"at_s": 60.0, "left_wheel": 0.5}, {"at_s": 200.0, "light": 0.1}]
    traces = at_rest((0.007, -0.35))
    began = np.array([[0.0, 30.0, 60.0, np.nan]] * 2)
    traces = replace(traces, samples=traces.samples._replace(phase_began=began))
    figures.trajectories(traces, Scenario(changes=changes), "")
    marks = [line for line in drawn[0].axes[0].lines if line.get_marker() == "D"]
    assert len(marks) == 4  # two on each side; the third is after the end
    assert marks[0].get_xydata().tolist() == [[0.007, -0.35]]
    assert texts(drawn[0]).count("2") == 2
    assert any("◆3 200 s: light=0.1" in text for text in texts(drawn[0]))


@pytest.mark.parametrize(
    ("end", "drives_on", "label"),
    [
        ((-0.36, 0.155), False, "left: at the goal"),
        ((-0.36, 0.155), True, "left: was at the goal, drove on"),
        ((0.0, 0.16), False, "left: did not arrive"),
        ((-0.36, 0.155), False, "right: at the wrong goal"),
        ((0.36, 0.155), False, "left: at the wrong goal"),
    ],
)
def test_legend_says_how_it_ended(drawn, end, drives_on, label):
    traces = at_rest(end)
    if drives_on:
        traces.samples.pose[:, 50:, 0] = 0.0
    figures.trajectories(traces, Scenario(), "")
    assert label in texts(drawn[0])


@pytest.mark.parametrize(("layers", "wiring"), [((16, 7, 5, 8, 4, 2), None), ((4, 3, 2), Elman(hidden=3))])
def test_weights_before_and_after_with_their_bound(drawn, layers, wiring):
    network = Network(layers, wiring=wiring)
    genes = np.full(network.synapses + 3, 0.5)  # three more, of a rule
    samples = empty_samples(2, network)
    samples.weights[-1] = 0.5
    samples.weights[-1, 0], samples.weights[-1, -1] = 2.0, -1.0
    charts.weights(genes, {"left": samples}, 2.0, "title")
    (axes,) = drawn[0].axes
    higher, lower = (found.get_offsets().tolist() for found in axes.collections)
    assert (higher, lower) == ([[0.5, 2.0]], [[0.5, -1.0]])
    assert axes.get_title() == f"left: {1 / network.synapses:.0%} of {network.synapses} weights at the bound"


def reference(name):
    return pd.read_csv(REFERENCE / f"{name}.csv")


def test_pages_have_the_colours_of_figures():
    page = (Path(charts.__file__).parent / "drawing.css").read_text()
    names = {"left": charts.SIDE["left"], "right": charts.SIDE["right"], "lamp": figures.LAMP}
    for name, colour in {**names, "rose": charts.WEIGHT["higher"], "fell": charts.WEIGHT["lower"]}.items():
        assert f"--{name}: light-dark({colour}," in page


def rescue_figure(folder):
    return charts.rescue_and_harm(*(reference(f"{folder}/{name}") for name in ("rescue_over_all", "rescue_and_harm")))


def test_rescue_and_harm_have_a_row_for_each_method_and_no_row_of_few_champions():
    rows = reference("adaptive/rescue_over_all")
    above, below = rescue_figure("adaptive").axes
    assert (above.get_title("left"), below.get_title("left")) == (
        "obstacles, 8 changed worlds",
        "light, 8 changed worlds",
    )
    light = rows[rows.experiment == "light"]
    assert [text.get_text() for text in below.get_yticklabels()] == list(light.controller)
    counts = {f"{row.rescued}/{row.broken}" for row in light.itertuples()}
    assert counts < {text.get_text() for text in below.texts}
    few = reference("rescue_over_all").query("experiment == 'obstacles'")
    assert "Fewer than 6 champions" in texts(charts.rescue_and_harm(few, reference("rescue_and_harm")))[0]


def test_two_changed_worlds_have_a_panel_each():
    rows = reference("many_obstacles/rescue_and_harm").set_index(["scenario", "controller"])
    for axes, world in zip(rescue_figure("many_obstacles").axes, ("2obstacles", "4obstacles"), strict=True):
        assert axes.get_title("left") == f"obstacles: {world}"
        rescued, harmed = axes.containers
        assert rescued.lines[0].get_xdata().tolist() == rows.rescued_share[world].tolist()
        assert harmed.lines[0].get_xdata().tolist() == rows.harmed_share[world].tolist()


def test_a_leaderboard_has_a_head_for_each_class_and_the_number_of_champions():
    board, champions = (reference(f"leaderboard/{name}").query("experiment == 'light'") for name in BOARD)
    left, right = leaderboard_charts.success(board, champions, {}).axes
    assert [text.get_text() for text in left.texts] == ["senses", "live fitness", "goal signal"]
    shares = [text for row in board.itertuples() for text in (f"{row.success:.2f}", "12")]
    assert [text.get_text() for text in right.texts] == [*shares, "share", "n"]
    assert len(left.get_yticks()) == len(board)


def test_each_coupling_of_a_flock_has_its_panels():
    panels = flock.curves(reference("flock/curves"), 1200.0, 20).axes
    assert [axes.get_title() for axes in panels[:4]] == [
        "transfer entropy", "live fitness", "transfer entropy × fitness", "oracle"
    ]  # fmt: skip
    assert len(panels) == 2 * 4


def test_film_shows_the_world_of_the_moment():
    brown = np.array([0xB0, 0x7D, 0x62])

    def obstacle_pixels(frame):
        return int((np.abs(frame.astype(int) - brown).max(axis=2) < 12).sum())

    world = Scenario(changes=[{"at_s": 4.0, "obstacles": 4}, {"at_s": 8.0, "obstacles": 0}])
    traces = at_rest((0.007, -0.35), seconds=12)
    traces.samples.pose[:, :, 1] += np.linspace(0, 0.3, 12)  # it never rests
    with Image.open(io.BytesIO(movie.gif(traces, world, ""))) as film:
        counts = []
        for second in (2, 6, 10):
            film.seek(round(second / 16 * 10))
            counts.append(obstacle_pixels(np.asarray(film.convert("RGB"))))
    assert max(counts[0], counts[2]) < 30  # edges of text are as brown
    assert counts[1] > 300


def test_same_trajectories_give_the_same_bytes():
    genes = np.random.default_rng(1).uniform(-1, 1, 234)
    world = Scenario(maze=ROOM, lamp=IN_ROOM.lamp, obstacles=1, changes=[{"at_s": 3.0, "obstacles": 0}])
    hebbian = Controller(name=HEBBIAN, rule=Paper(N=1e-3))
    _, traces = evaluate(genes, world, [hebbian], Lifetime(duration_s=6.0, record_every=8), repeats=1, seed=1)
    for kind in KINDS:
        first = image(figures.trajectories(traces, world, "title"), kind)
        assert first == image(figures.trajectories(traces, world, "title"), kind)
    with Image.open(io.BytesIO(image(figures.trajectories(traces, world, "title")))) as picture:
        assert math.isclose(picture.width, 2 * 4.2 * 120, abs_tol=1)


def test_a_figure_for_a_paper_has_its_width_and_letters_that_can_be_read():
    figure = figures.trajectories(at_rest((0.0, 0.0), controllers=("GA", "Hebbian")), Scenario(), "title")
    with Image.open(io.BytesIO(image(figure, width_mm=180.0))) as picture:
        assert math.isclose(picture.width / picture.info["dpi"][0], 180 / 25.4, abs_tol=0.01)
    assert min(text.get_fontsize() for text in figure.findobj(matplotlib.text.Text) if text.get_text()) >= 6
