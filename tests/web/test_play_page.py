"""The live page as someone plays with it: in a real browser, with mouse, touch and keyboard.

See `conftest.py` for the browser, which runs on one core.
"""

import math
import os
import threading
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Error, expect

from epuckhebb.live.server import Play
from epuckhebb.runs import repeat

SCREENSHOTS = os.environ.get("EPUCKHEBB_SCREENSHOTS")  # a folder to look at them in
WORDS = ["scenario=4obstacles", "hebbian.N=0.0005"]
MAZE = "#mazes [role=application]"


@pytest.fixture
def live(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with Play(WORDS, "left", port=0) as playing:
        yield playing


@pytest.fixture
def play(browser, live):
    """Opens the page; afterwards, nothing may have been complained of, and nothing asked of anyone but the server."""
    contexts, complaints, requests = [], [], []

    def opened(*, started=True, **options):
        context = browser.new_context(**{"viewport": {"width": 1280, "height": 800}, **options})
        contexts.append(context)
        page = context.new_page()
        page.on("console", lambda message: complaints.append(message.text))
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.on("request", lambda request: requests.append(request.url))
        page.goto(live.address)
        wait_until(page, lambda now: now["samples"] > 3 * started)
        return page

    yield opened
    for context in contexts:
        context.close()
    assert complaints == []
    assert [url for url in requests if not url.startswith((f"http://127.0.0.1:{live.port}/", "data:"))] == []


def state(page):
    try:
        return page.evaluate("window.live?.state() ?? { samples: 0 }")
    except Error:  # it is being loaded anew
        return {"samples": 0}


def wait_until(page, true):
    for _ in range(400):
        if true(state(page)):
            return
        page.wait_for_timeout(50)
    raise AssertionError(f"it never came about; the page is at {state(page)}")


def canvas_of(page, number=1):
    return page.locator(MAZE).nth(number)


def on_page(page, x, y, number=1):
    """Where on the page a place of a maze is [m]."""
    box = canvas_of(page, number).bounding_box()
    left, right, bottom, top = page.evaluate("live.maze.view")
    scale = min(box["width"] / (right - left), box["height"] / (top - bottom))
    margin = (box["width"] - scale * (right - left)) / 2
    return box["x"] + margin + (x - left) * scale, box["y"] + (top - y) * scale


def drag(page, start, *ways):
    page.mouse.move(*on_page(page, *start))
    page.mouse.down()
    for way in ways:
        page.mouse.move(*on_page(page, *way), steps=4)
        page.wait_for_timeout(60)
    page.mouse.up()


def robots(live):
    return [robot.pose for robot in live.world.robots]


def pause(page):
    page.locator("#play").click()
    wait_until(page, lambda now: not now["now"]["playing"])


def test_two_robots_run_and_a_pause_stops_them(play, live):
    page = play()
    assert len(state(page)["robots"]) == 2
    assert live.speed == 8
    pause(page)
    before = live.world.steps
    page.wait_for_timeout(200)
    assert live.world.steps == before
    page.locator("#step").click()
    wait_until(page, lambda now: now["samples"] == before + 1)
    for shown, robot in zip(state(page)["robots"], live.world.robots, strict=True):
        seen = [shown["x"], shown["y"], shown["heading"]]
        np.testing.assert_allclose(seen, robot.samples.pose[before], rtol=0, atol=1e-6)
    page.locator("#play").click()
    wait_until(page, lambda now: now["samples"] > before + 5)


def test_a_robot_is_dragged(play, live):
    page = play()
    pause(page)
    x, y, _ = robots(live)[1]
    page.mouse.move(*on_page(page, x, y))
    page.mouse.down()
    wait_until(page, lambda _: live.speed == 1)
    page.mouse.up()
    wait_until(page, lambda _: live.speed == 8)
    drag(page, (x, y), (0.007, -0.1), (0.007, 0.0), (0.03, 0.16), (0.2, 0.17), (0.2, 0.3))
    wait_until(page, lambda now: now["now"]["pending"])
    page.locator("#step").click()
    wait_until(page, lambda now: not now["now"]["pending"])
    place = live.world.changes[-1]["put"]
    for pose in robots(live):
        assert math.dist(pose[:2], place[:2]) < 0.005
    assert math.dist(place[:2], (0.2, 0.17)) < 0.05  # not in the wall that lies behind


def test_blocks_are_set_down_moved_and_taken_away(play, live):
    page = play()
    pause(page)
    page.locator("#add").click()
    wait_until(page, lambda now: len(now["world"]["placed"]) == 1)
    (block,) = state(page)["world"]["placed"]
    drag(page, block[:2], (0.0, -0.05), (0.0, 0.17))
    wait_until(page, lambda now: now["now"]["world"]["placed"] and now["now"]["world"]["placed"][0][1] > 0.1)
    page.locator("#step").click()
    wait_until(page, lambda now: now["now"]["byHand"] == 1)
    (placed,) = live.world.scenario.placed
    assert math.dist(placed[:2], (0.0, 0.17)) < 0.02
    page.locator("#drop").click()
    wait_until(page, lambda now: now["now"]["world"]["placed"] == [])


def test_a_new_block_stands_where_robots_can_get_to(play, live):
    page = play()
    pause(page)
    x, y = live.world.scenario.goals_now["left"]
    page.evaluate(f"live.change({{ put: [{x}, {y}, {math.pi}] }})")
    page.locator("#step").click()
    wait_until(page, lambda now: now["now"]["byHand"] == 1)
    page.locator("#add").click()
    wait_until(page, lambda now: len(now["now"]["world"]["placed"]) == 1)
    ((at_x, at_y, *_),) = state(page)["now"]["world"]["placed"]
    assert -0.42 < at_x < 0.42  # inside of the outer walls
    assert 0.1 < at_y < 0.22  # in the arms


def test_what_is_pressed_while_a_life_is_prepared_comes_with_it(play, live, monkeypatch):
    page = play()
    pause(page)
    make, goes_on = live._new, threading.Event()

    def slowly(*words):
        goes_on.wait(30)
        return make(*words)

    monkeypatch.setattr(live, "_new", slowly)
    page.locator("#new").click()
    wait_until(page, lambda now: now["now"]["prepares"])
    page.locator("#light").fill("0.5")
    page.locator("#add").click()
    expect(page.locator("#trouble")).not_to_have_text("")
    goes_on.set()
    wait_until(
        page, lambda now: now["samples"] and now["now"]["world"]["placed"] and now["now"]["world"]["light"] == 0.5
    )


def test_mazes_stay_where_they_are_whatever_is_said_above_them(play):
    page = play(viewport={"width": 1100, "height": 800})
    pause(page)
    tops = [canvas_of(page, number).bounding_box()["y"] for number in (0, 1)]
    flags = page.locator(".flag")
    flags.nth(1).evaluate("flag => { flag.textContent = '⚑ at goal since 126 s'; }")
    assert [canvas_of(page, number).bounding_box()["y"] for number in (0, 1)] == tops == [tops[0]] * 2


def test_a_block_on_a_robot_is_refused_with_a_word(play, live):
    page = play()
    pause(page)
    x, y, _ = robots(live)[1]
    page.evaluate(f"live.change({{ placed: [[{x}, {y}, 0.03, 0.03]] }})")
    expect(page.locator("#trouble")).to_contain_text("where a robot is")
    assert state(page)["world"]["placed"] == []
    page.locator("#light").fill("0.5")
    expect(page.locator("#trouble")).to_have_text("")
    page.locator("summary").click()
    page.locator("#seed").fill("-1")
    page.locator("#new").click()
    expect(page.locator("#new + #trouble")).to_contain_text("seed")


SLIDERS = [
    ("light", "0.7", "light", 0.7),
    ("rate", "5", "rate", 10),
    ("left_wheel", "0.4", "left_wheel", 0.4),
    ("right_wheel", "0.25", "right_wheel", 0.25),
]


def test_every_control_changes_what_it_says(play, live):
    page = play()
    for slider, value, key, changed in SLIDERS:
        page.locator(f"#{slider}").fill(value)
        wait_until(page, lambda _, key=key, changed=changed: getattr(live.world.scenario, key) == changed)
    page.locator("#intensity").fill("3.5")
    wait_until(page, lambda _: live.world.scenario.lamp.intensity == 3.5)
    page.locator("#lit").click()
    wait_until(page, lambda _: live.world.scenario.lamp_on is True)
    expect(page.locator("#lit")).to_have_attribute("aria-pressed", "true")
    for number in (3, 0):
        page.locator("#sensors button").nth(number).click()
    wait_until(page, lambda _: list(live.world.scenario.dead_sensors) == [0, 3])
    page.locator("#sensors button").nth(3).click()
    wait_until(page, lambda _: list(live.world.scenario.dead_sensors) == [0])
    page.locator("#reset").click()
    wait_until(page, lambda _: any(change.get("reset") for change in live.world.changes))
    for speed in ("32", "0", "0.25"):
        page.locator("#speed").select_option(speed)
        wait_until(page, lambda _, speed=speed: live.speed == float(speed))
    assert page.locator("#log span").count() > 3
    assert "dead_sensors=[0]" in page.locator("#mazes .now").nth(1).text_content()


def test_with_the_keyboard_alone(play):
    page = play()
    page.keyboard.press("Space")
    wait_until(page, lambda now: not now["now"]["playing"])
    for _ in range(60):
        page.keyboard.press("Tab")
        if page.evaluate("document.activeElement.getAttribute('role')") == "application":
            break
    assert page.evaluate("getComputedStyle(document.activeElement).outlineStyle") == "solid"
    page.keyboard.press("t")
    assert state(page)["selected"] == "robot"
    expect(page.locator("#said")).to_have_text("robot chosen")
    page.keyboard.press("b")
    wait_until(page, lambda now: len(now["now"]["world"]["placed"]) == 1)
    page.keyboard.press("Shift+ArrowRight")
    page.keyboard.press("Delete")
    wait_until(page, lambda now: len(now["now"]["world"]["placed"]) == 0)
    page.keyboard.press("l")
    wait_until(page, lambda now: now["now"]["world"]["lit"])
    page.keyboard.press("Escape")
    page.evaluate("document.activeElement.blur()")
    page.keyboard.press("ArrowRight")
    wait_until(page, lambda now: now["now"]["byHand"] == 1)
    page.keyboard.press("+")
    wait_until(page, lambda now: now["speed"] == 16)


def test_one_looks_back_while_life_goes_on(play):
    page = play()
    wait_until(page, lambda now: now["END"] > 10)
    page.locator("#time").fill("3")
    before = state(page)
    assert before["t"] == pytest.approx(3)
    expect(page.locator("#now")).to_be_visible()
    wait_until(page, lambda now: now["END"] > before["END"] + 1)
    assert state(page)["t"] == pytest.approx(3)
    page.locator("#now").click()
    wait_until(page, lambda now: now["t"] > 10)


def test_a_new_life_begins_with_another_side_and_rule(play, live):
    page = play()
    page.locator("summary").click()
    page.locator("#side").select_option("right")
    page.locator("#hebbian").select_option("none")
    expect(page.locator("#meaning")).to_have_text("No plasticity: the GA alone.")
    page.locator("#new").click()
    wait_until(page, lambda now: now.get("side") == "right")
    assert live.world.side == "right"
    assert len(state(page)["robots"]) == 1


def press(page, selector, key="Enter"):
    """Use a control with the keyboard alone."""
    page.locator(selector).focus()
    page.keyboard.press(key)


def solve(page, name):
    """Take up a challenge and meet it, with keys."""
    press(page, f"#challenges [data-name={name}]")
    page.locator(f"#challenges [data-name={name}][aria-pressed=true]").wait_for(timeout=60_000)
    for selector, keys in SOLUTIONS[name]:
        page.locator(selector).last.focus()
        for key in keys:
            page.keyboard.press(key)
            page.wait_for_timeout(40)
    page.locator("#speed").select_option("0")
    press(page, "#play")
    page.locator("#mazes .flag[data-kind=won], #mazes .flag[data-kind=lost]").first.wait_for(timeout=60_000)


SOLUTIONS = {
    "sun": [("#light", ["ArrowLeft"] * 50)],
    "block": [("#add", ["Enter"]), (MAZE, [*["ArrowLeft"] * 4, *["ArrowUp"] * 30])],
    "harm": [("#rate", ["End"])],
    "blind": [("#sensors button >> nth=0", ["Enter"]), ("#sensors button >> nth=3", ["Enter"])],
    "arm": [(MAZE, ["t", *["ArrowUp"] * 52, *["ArrowLeft"] * 30, *["q"] * 7])],
}


@pytest.mark.parametrize("name", SOLUTIONS)
def test_a_challenge_is_met_with_the_keyboard_alone(play, live, name):
    page = play(reduced_motion="reduce", started=False)  # so that all is done before the second step
    solve(page, name)
    expect(page.locator("#task")).to_contain_text("Solved!")
    expect(page.locator(f"#challenges [data-name={name}]")).to_contain_text("✓")
    expect(page.locator("#score")).to_contain_text("Score: 1 life")
    assert not live.is_playing
    saved = live.world.save()  # what the page says of the end of life is what `evaluate` says
    assert saved["same"]


def test_other_robots_are_drawn_and_the_score_counts_them(play, live):
    page = play()
    press(page, "#challenges [data-name=rare]")
    for number in (1, 2):
        wait_until(page, lambda now, number=number: live.life == number and now["samples"] > 3)
        page.locator("#speed").select_option("0")
        page.locator("#score caption", has_text=f"{number} robot").wait_for(timeout=60_000)
        if number == 1:
            press(page, "#another")
    assert live.world.genome.name.startswith("reference_")
    expect(page.locator("#score caption")).to_have_text("Score: 2 lives, 2 robots")


def test_a_link_begins_the_same_life_in_another_tab(play, live):
    page = play()
    page.evaluate("live.change({ light: 0.7 })")
    wait_until(page, lambda now: now["now"]["byHand"] == 1)
    page.context.grant_permissions(["clipboard-read", "clipboard-write"])
    page.locator("#share").click()
    expect(page.locator("#saved")).to_contain_text("on the clipboard")
    link = page.evaluate("navigator.clipboard.readText()")
    assert live.secret not in link
    changes = live.world.changes
    other = page.context.new_page()
    other.goto(link)
    wait_until(other, lambda now: live.life == 1 and now["samples"] > 3 and live.world.changes == changes)


def test_whoever_wants_no_motion_starts_it_themselves(play, live):
    page = play(reduced_motion="reduce", started=False)
    page.wait_for_timeout(300)
    assert live.world.steps == 1
    press(page, "#play")
    wait_until(page, lambda now: now["samples"] > 3)


def test_a_played_life_is_saved_and_repeats(play):
    page = play()
    for number in range(20):
        page.evaluate(f"live.change({{ light: {number / 20}, rate: 100, put: [0.007, {-0.3 + number / 50}, 1.5] }})")
        page.wait_for_timeout(40)
    page.locator("#save").click()
    expect(page.locator("#saved")).to_contain_text("the same to the last bit", timeout=60_000)
    run = Path(page.locator("#saved").text_content().partition(":")[0])
    assert repeat(run)[1] == ""
    page.context.grant_permissions(["clipboard-read", "clipboard-write"])
    page.locator("#copy").click()
    expect(page.locator("#saved")).to_contain_text("Copied: epuckhebb evaluate scenario=4obstacles")


def test_an_address_without_its_secret_says_so(browser, live):
    page = browser.new_context().new_page()
    page.goto(live.address.partition("#")[0])
    expect(page.locator("#outcome")).to_contain_text("not the whole address")


def test_the_end_of_the_program_is_told(play, live):
    page = play()
    live.end()
    expect(page.locator("#outcome")).to_contain_text("The program has ended")


@pytest.mark.parametrize(("width", "scheme"), [(390, "light"), (1920, "dark")])
def test_it_fits(play, width, scheme):
    page = play(viewport={"width": width, "height": 844}, color_scheme=scheme)
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    for box in page.locator("button:visible, select:visible, input:visible").all():
        there = box.bounding_box()
        assert there["x"] >= 0
        assert there["x"] + there["width"] <= width
    if SCREENSHOTS:
        page.screenshot(path=f"{SCREENSHOTS}/play_{width}_{scheme}.png")


def test_a_finger_drags_the_robot(play, live):
    page = play(viewport={"width": 390, "height": 844}, has_touch=True, is_mobile=True)
    pause(page)
    x, y = on_page(page, *robots(live)[1][:2])
    there = on_page(page, 0.007, -0.1)
    session = page.context.new_cdp_session(page)
    for kind, at in (("touchStart", (x, y)), ("touchMove", there), ("touchEnd", None)):
        points = [{"x": at[0], "y": at[1]}] if at else []
        session.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})
        page.wait_for_timeout(50)
    wait_until(page, lambda now: now["now"]["put"] is not None)
    assert state(page)["now"]["put"][1] == pytest.approx(-0.1, abs=0.02)


PICTURES = """async pictures => {
  const work = () => {  // what the machine does in the time of a picture, whatever else it does
    const began = performance.now();
    for (let k = 0, sum = 0; k < 200000; k++) sum += Math.sin(k);
    return performance.now() - began;
  };
  const works = [], costs = [], seen = new Set();
  while (costs.length < pictures) {
    await new Promise(requestAnimationFrame);
    works.push(work());
    costs.push(live.costs.at(-1));
    seen.add(live.state().t);
  }
  return { works, costs, seen: seen.size };
}"""


def test_every_frame_is_drawn_in_little_time_with_all_figures_in_sight(play):
    """At 8 times real time. A picture is compared with work of a known size, since the browser's core may do others."""
    page = play(viewport={"width": 1280, "height": 2000})
    wait_until(page, lambda now: now["END"] > 20)
    figures = page.locator("#mazes figure, #networks figure, #charts .chart").all()
    assert len(figures) >= 7
    for figure in figures:
        expect(figure).to_be_in_viewport(ratio=1)
    told = page.evaluate(PICTURES, 60)
    cost, work = (np.median(told[name]) for name in ("costs", "works"))
    print(f"a picture: {cost:.1f} ms, 200,000 sines: {work:.1f} ms, {told['seen']} moments in 60 frames")
    assert told["seen"] > 50  # each frame shows another moment
    assert cost < 4 * work
