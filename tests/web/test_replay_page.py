"""The page as a reader meets it: in a real browser, from a file, without any network.

See `conftest.py` for the browser, which runs on one core.
"""

import io
import itertools
import os
import re
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import expect

from epuckhebb.analysis import replay
from epuckhebb.analysis.evaluate import evaluate
from epuckhebb.controller.network import PAPER_NETWORK, Network
from epuckhebb.controller.plasticity.rules.paper import Paper
from epuckhebb.controller.wirings.lif import LIF
from epuckhebb.tmaze.individual import GA, HEBBIAN, Controller
from epuckhebb.tmaze.life import Lifetime
from epuckhebb.tmaze.maze import SIDES
from epuckhebb.tmaze.scenario import Scenario

SCREENSHOTS = os.environ.get("EPUCKHEBB_SCREENSHOTS")  # a folder to look at them in

ARRIVES = Path(__file__).parents[2] / "runs/reference/champions/obstacles_seed001.npz"  # at both goals, always


HEBBIAN_PLASTICITY = Controller(name=HEBBIAN, rule=Paper(N=1.5e-5))


def replayed(
    folder, scenario, genes=None, controllers=(HEBBIAN_PLASTICITY,), seconds=250.0, network=PAPER_NETWORK, nominal=None
):
    """A folder with the page of fresh lifetimes; and their traces."""
    own = np.load(ARRIVES)["genome"] if genes is None else genes
    lifetime = Lifetime(duration_s=seconds, record_every=8)
    _, traces = evaluate(own, scenario, controllers, lifetime, nominal, repeats=1, seed=1, network=network)
    page = replay.page(traces, own, scenario, "a test", gain_rad_s=1.0, network=network)
    (folder / "replay.html").write_text(page, encoding="utf-8")
    arrays = {"controller": traces.controller, "side": traces.side, "genome": own, **traces.samples._asdict()}
    return folder, arrays


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    return replayed(tmp_path_factory.mktemp("run"), Scenario(obstacles=4))


@pytest.fixture(scope="module")
def run(recorded):
    return recorded[0]


@pytest.fixture(scope="module")
def traces(recorded):
    return recorded[1]


MOVED = {"left": (-0.25, 0.155), "right": (0.25, 0.155)}
CHANGES = [
    {"at_s": 3.0, "light": 1.0, "left_wheel": 0.9},
    {"at_s": 6.0, "obstacles": 4, "dead_sensors": [2]},
    {"at_s": 40.0, "goals": MOVED},
    {"at_s": 400.0, "light": 0.1},
]


@pytest.fixture(scope="module")
def changing(tmp_path_factory):
    """A world that changes three times while the robots live, and once after that."""
    return replayed(tmp_path_factory.mktemp("changing"), Scenario(changes=CHANGES), seconds=60.0)[0]


def state(page):
    return page.evaluate("replay.state()")


def wait_until(page, true):
    """Wait until something is true of the page's state; from here, since the page lets no text be run in it."""
    for _ in range(300):
        if true(state(page)):
            return
        page.wait_for_timeout(50)
    raise AssertionError(f"it never came about; the page is at {state(page)}")


def lifetime(traces, controller, side):
    return next(
        k for k in range(len(traces["side"])) if (traces["controller"][k], traces["side"][k]) == (controller, side)
    )


def compare_poses(page, traces):
    now = state(page)
    assert [robot["controller"] for robot in now["robots"]] == ["GA alone", "GA with Hebbian plasticity"]
    for controller, robot in zip((GA, HEBBIAN), now["robots"], strict=True):
        k = lifetime(traces, controller, now["side"])
        for column, name in enumerate(("x", "y", "heading")):
            expected = np.interp(now["t"], traces["time"][k], traces["pose"][k, :, column])
            assert robot[name] == pytest.approx(expected, abs=2e-4)
    return now


def test_robots_stand_where_they_stood(visit, run, traces):
    page = visit(run)
    for side, t in itertools.product(SIDES, (0, 12.345, 61.44, 249.0)):
        page.evaluate("([side, t]) => { replay.show(side); replay.seek(t); }", [side, t])
        now = compare_poses(page, traces)
        assert (now["side"], now["t"]) == (side, t)


def test_plays_at_the_chosen_speed_and_pauses(visit, run, traces):
    page = visit(run)
    page.get_by_label("Speed").select_option("16")
    page.get_by_role("button", name="Play", exact=True).click()
    wait_until(page, lambda now: now["t"] > 8)
    page.get_by_role("button", name="Pause").click()
    paused = compare_poses(page, traces)["t"]
    page.wait_for_timeout(100)
    assert state(page)["t"] == paused
    assert page.url.endswith(f"#t={round(paused, 3):g}&side=left")
    expect(page.locator("#clock")).to_have_text(f"{paused:.1f} of 249.9 s")


def test_starts_by_itself_unless_motion_is_unwelcome(visit, run):
    wait_until(visit(run, moment=""), lambda now: now["t"] > 0.5)
    calm = visit(run, moment="", reduced_motion="reduce")
    calm.wait_for_timeout(200)
    assert state(calm)["t"] == 0


def test_stops_at_the_end_and_starts_over(visit, run):
    page = visit(run, moment="#t=249")
    page.keyboard.press("Space")
    wait_until(page, lambda now: not now["playing"])
    assert state(page)["t"] == pytest.approx(976 * 0.256)
    page.keyboard.press("Space")
    assert state(page)["t"] < 100
    assert state(page)["playing"]


def test_a_link_leads_to_its_moment(visit, run, traces):
    page = visit(run, moment="#t=40.5&side=right")
    now = compare_poses(page, traces)
    assert (now["t"], now["side"], now["playing"]) == (40.5, "right", False)
    page.evaluate("location.hash = '#t=7&side=left'")
    wait_until(page, lambda now: (now["side"], now["t"]) == ("left", 7))
    page.evaluate("location.hash = '#t=never&side=up'")
    page.wait_for_timeout(50)
    assert (state(page)["t"], state(page)["side"]) == (7, "left")


def test_trials_are_switched(visit, run):
    page = visit(run)
    page.get_by_label("lamp on, goal right").check()
    assert state(page)["side"] == "right"


def test_keyboard(visit, run):
    page = visit(run)
    for key, t in {
        "ArrowRight": 0.256,
        "Shift+ArrowRight": 40 * 0.256,
        "ArrowLeft": 39 * 0.256,
        "End": 976 * 0.256,
        "Home": 0.0,
    }.items():
        page.keyboard.press(key)
        assert state(page)["t"] == pytest.approx(t), key
    page.keyboard.press("+")
    assert state(page)["speed"] == 16
    page.keyboard.press("-")
    page.keyboard.press("-")
    assert state(page)["speed"] == 4
    page.keyboard.press("s")
    assert state(page)["side"] == "right"


def test_slider_and_charts_seek(visit, run):
    page = visit(run)
    page.get_by_role("slider", name="Time in the lifetime").fill("100")
    assert state(page)["t"] == 100
    chart = page.get_by_label("Weight change over time")
    chart.scroll_into_view_if_needed()
    box = chart.bounding_box()
    page.mouse.click(box["x"] + 64 + 0.5 * (box["width"] - 64), box["y"] + 40)
    assert state(page)["t"] == pytest.approx(488 * 0.256, abs=0.5)


def compare_wheels(page, traces, side, samples, neurons):
    """The network of the page turns the wheels of both robots as they were recorded."""
    page.evaluate("side => replay.show(side)", side)
    for (c, name), sample in itertools.product(enumerate((GA, HEBBIAN)), samples):
        activations = page.evaluate("([c, k]) => replay.activations(c, k)", [c, sample])
        assert len(activations) == neurons
        expected = traces["motors"][lifetime(traces, name, side), sample]
        np.testing.assert_allclose(activations[-2:], expected, atol=1e-3)


def test_network_of_the_page_computes_the_recorded_wheels(visit, run, traces):
    page = visit(run)
    for side in SIDES:
        compare_wheels(page, traces, side, (0, 1, 100, 500, 976), PAPER_NETWORK.neurons)


def test_a_connection_tells_its_gene_weight_and_change(visit, run, traces):
    page = visit(run, moment="#t=128&side=left")
    network = page.get_by_label("GA with Hebbian plasticity: its network")
    network.focus()
    page.keyboard.press("ArrowDown")
    page.keyboard.press("ArrowDown")
    k, sample = lifetime(traces, HEBBIAN, "left"), 500
    weight = traces["weights"][k, sample, 1]
    change = weight - np.float32(traces["genome"][1])

    def signed(value):
        return f"{value:+.4f}".replace("-", "−")

    text = f"Gene 1: from light 0 to hidden 1.2. Weight {signed(weight)}, changed by {signed(change)} from"
    expect(page.locator(".network").nth(1)).to_contain_text(text)
    expect(page.locator("#said")).to_contain_text("Gene 1:")
    network.scroll_into_view_if_needed()
    box = network.bounding_box()
    page.mouse.move(box["x"] + box["width"] - 80, box["y"] + box["height"] / 2)
    expect(page.locator(".network").nth(1)).to_contain_text(re.compile(r"Gene 2\d\d: from hidden 4\.\d to \w+ wheel"))


def test_everything_to_press_or_look_at_has_a_name(visit, run):
    page = visit(run)
    for role, count in {"button": 4, "radio": 2, "slider": 1, "combobox": 1, "img": 9}.items():
        named = page.get_by_role(role, name=re.compile(r"\w"))
        expect(named).to_have_count(count)
        expect(page.get_by_role(role)).to_have_count(count)
    page.keyboard.press("ArrowRight")
    expect(page.get_by_role("status")).to_contain_text("0.3 seconds. GA alone: ")


def test_a_run_without_plasticity_has_one_panel(visit, tmp_path):
    page = visit(replayed(tmp_path, Scenario(), controllers=(), seconds=20.0)[0], moment="#t=10")
    expect(page.locator("figure")).to_have_count(2)
    expect(page.get_by_label("Live fitness")).to_have_count(1)
    expect(page.get_by_label("Weight change")).to_have_count(0)
    expect(page.get_by_text("position of the other robot")).to_be_hidden()
    expect(page.locator("#changes")).to_be_hidden()


def test_changes_are_listed_and_lead_to_their_moments(visit, changing):
    page = visit(changing, moment="#t=4")
    changes = page.locator("#changes span")
    expect(changes).to_have_text(
        [
            "◆1 at 3 s: light=1.0, left_wheel=0.9",
            "◆2 at 6 s: obstacles=4, dead_sensors=[2]",
            f"◆3 at 40 s: goals={MOVED}",
        ]
    )
    expect(page.locator("#changes .past")).to_have_count(1)
    tick = page.get_by_role("button", name="Change 2 at 6 s: obstacles=4, dead_sensors=[2]")
    expect(tick).to_have_attribute("title", "6 s: obstacles=4, dead_sensors=[2]")
    tick.click()
    assert state(page)["t"] == 6
    expect(page.locator("#changes .past")).to_have_count(2)
    expect(page.locator(".tick")).to_have_count(3)


def test_the_world_is_that_of_the_moment(visit, changing):
    page = visit(changing)
    for t, number, said in (
        (1, 0, r"cm from the goal; light 0\.1$"),
        (4, 1, r"; light 1; left_wheel=0.9$"),
        (30, 2, r"; light 1; dead_sensors=\[2\], left_wheel=0.9$"),
        (55, 3, r"; light 1; dead_sensors=\[2\], left_wheel=0.9$"),
        (1, 0, r"cm from the goal; light 0\.1$"),
    ):
        page.evaluate("(t) => replay.seek(t)", t)
        assert state(page)["robots"][0]["world"] == number
        expect(page.locator("#mazes .now").first).to_have_text(re.compile(said))


def test_obstacles_are_drawn_when_they_are_there(visit, changing):
    page = visit(changing, moment="#t=1", color_scheme="light")
    assert brown(page) == 0
    page.evaluate("replay.seek(30)")
    page.wait_for_timeout(100)
    assert brown(page) > 1000
    page.evaluate("replay.seek(1)")
    page.wait_for_timeout(100)
    assert brown(page) == 0


def brown(page):
    """How many pixels of the first maze have the colour of obstacles."""
    with Image.open(io.BytesIO(page.locator("#mazes figure").first.screenshot())) as picture:
        return int((np.asarray(picture.convert("RGB")) == (0xB0, 0x7D, 0x62)).all(axis=2).sum())


def test_a_change_that_waits_is_shown(visit, tmp_path):
    world = Scenario(changes=[{"at_s": 2.0, "obstacles": 4}])
    still = replayed(tmp_path, world, np.zeros(234), controllers=(), seconds=6.0)[0]
    page = visit(still, moment="#t=5")
    assert state(page)["robots"][0]["world"] == 1
    text = (still / "replay.html").read_text(encoding="utf-8")
    waiting = re.sub(r'"begins":\[0\.0,[^]]*\]', '"begins":[0.0,null]', text)
    (still / "replay.html").write_text(waiting, encoding="utf-8")
    page = visit(still, moment="#t=5")
    assert state(page)["robots"][0]["world"] == 0
    expect(page.locator("#mazes .now").first).to_have_text(
        re.compile("; change 1 waits until the robot has moved away")
    )


@pytest.mark.parametrize(("scheme", "width"), [("light", 390), ("dark", 1280)])
def test_both_schemes_on_desk_and_phone(visit, run, scheme, width):
    page = visit(run, moment="#t=40&side=right", viewport={"width": width, "height": 844}, color_scheme=scheme)
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    if SCREENSHOTS:
        page.screenshot(path=Path(SCREENSHOTS) / f"replay_{scheme}_{width}.png", full_page=True)
    one, other = (page.locator("#mazes figure").nth(number).bounding_box() for number in (0, 1))
    assert one["y"] == other["y"]  # side by side, on the phone too
    assert page.get_by_text("speed over the floor, in cm/s").count() == 2
    assert brightness(page) == pytest.approx(245 if scheme == "light" else 23, abs=5)
    page.get_by_role("button", name="Switch between light and dark").click()
    assert brightness(page) == pytest.approx(23 if scheme == "light" else 245, abs=5)


def brightness(page):
    colour = page.evaluate("getComputedStyle(document.body).backgroundColor")
    return np.mean([int(level) for level in re.findall(r"\d+", colour)])


@pytest.mark.parametrize("width", [1280, 320])
def test_a_preview_shows_robots_and_time_alone(run, visit, width):
    page = visit(run, "#preview", viewport={"width": width, "height": 480})
    assert page.evaluate("document.documentElement.scrollWidth") == width
    expect(page.locator("#mazes figure")).to_have_count(2)
    expect(page.locator("#play")).to_be_visible()
    for hidden in ("h1", "#networks", "#charts"):
        expect(page.locator(hidden)).to_be_hidden()


def test_a_spiking_network_shows_its_spikes_until_now(tmp_path, visit):
    network = Network((16, *LIF().sizes), wiring=LIF())
    genes = np.random.default_rng(5).uniform(-0.4, 1, network.synapses)
    folder, _ = replayed(tmp_path, Scenario(), genes, seconds=20.0, network=network)
    count = (
        "canvas.getContext('2d').getImageData(0, 0, canvas.width, 70).data.filter((v, i) => i % 4 === 3 && v).length"
    )
    marked = {}
    for moment in (5, 15):
        raster = visit(folder, f"#t={moment}").locator(".network canvas").nth(2)
        raster.scroll_into_view_if_needed()  # only then is it drawn
        raster.page.wait_for_timeout(1500)  # pictures are read once: Chromium complains of more
        marked[moment] = raster.evaluate(f"canvas => {count}")
    assert marked[5] < 0.5 * marked[15]
