"""The replay page of flocks in a browser: it moves, follows its robots, and fits wide and narrow screens."""

import pytest
from playwright.sync_api import expect

from epuckhebb.flock.couplings.frozen import Frozen
from epuckhebb.flock.couplings.transfer_entropy import TransferEntropy
from epuckhebb.flock.plane import Flock, run
from epuckhebb.flock.replay import page as recording_page
from epuckhebb.live.server import Play


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    flock, there = Flock(duration_s=240.0, at_s=120.0, breaks="knower"), tmp_path_factory.mktemp("flock")
    records = {"frozen": run(flock, Frozen(), 1), "transfer_entropy": run(flock, TransferEntropy(), 1)}
    (there / "replay.html").write_text(recording_page(flock, records, "a test"), encoding="utf-8")
    return there


@pytest.mark.parametrize("width", [1280, 390])
def test_the_page_fits_the_screen_and_shows_all_robots(folder, visit, width):
    page = visit(folder, "#t=200", viewport={"width": width, "height": 900})
    clock = page.locator("#clock")
    clock.filter(has_text="3.3 of 4.0 min").wait_for()
    assert page.evaluate("document.documentElement.scrollWidth") == width
    frozen, plastic = page.evaluate("replay.state().flocks")
    assert [len(flock["poses"]) for flock in (frozen, plastic)] == [10, 10]
    assert frozen["links"] == []
    assert plastic["links"]
    assert "the broken robot is" in page.inner_text("#flocks")
    page.evaluate("replay.seek(100)")
    clock.filter(has_text="1.7 of 4.0 min").wait_for()
    assert "broken" not in page.inner_text("#flocks")


def test_the_page_plays(folder, visit):
    page = visit(folder, "")
    page.locator("#clock").filter(has_not_text="0.0 of").wait_for()
    page.keyboard.press("Space")
    assert not page.evaluate("replay.state().playing")
    assert "10 robots; after 2 minutes" in page.inner_text("h1")


def test_a_live_flock_is_broken_moved_and_coupled_with_the_keyboard_alone(browser):
    with Play(["flock"], "left", port=0) as live:
        context = browser.new_context(viewport={"width": 390, "height": 844}, reduced_motion="reduce")
        page, complaints = context.new_page(), []
        page.on("console", lambda message: complaints.append(message.text))
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.goto(live.address)
        page.locator("#flocks canvas").focus()
        before = live.world.state()["poses"][0]
        page.keyboard.press("t")
        page.keyboard.press("ArrowLeft")
        while live.world.state()["poses"][0][0] > before[0] - 0.04:
            page.wait_for_timeout(50)
        page.keyboard.press("x")
        expect(page.locator("h1")).to_contain_text("Robot 1 is broken")
        page.locator("#coupling").focus()
        page.keyboard.press("End")
        expect(page.locator("h3")).to_have_text("oracle")
        assert live.world.steps == 0
        page.locator("#play").focus()
        page.keyboard.press("Enter")
        while live.world.steps < 1000:
            page.wait_for_timeout(50)
        page.locator("#new").focus()
        page.keyboard.press("Enter")
        expect(page.locator("h1")).to_contain_text("Break one")
        assert page.evaluate("document.documentElement.scrollWidth") == 390
        assert (live.life, complaints) == (1, [])
        context.close()
