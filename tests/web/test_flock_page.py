"""The replay page of flocks in a browser: it moves, follows its robots, and fits wide and narrow screens."""

import pytest

from epuckhebb.flock.couplings.frozen import Frozen
from epuckhebb.flock.couplings.transfer_entropy import TransferEntropy
from epuckhebb.flock.plane import Flock, run
from epuckhebb.flock.replay import page as page_of


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    flock, there = Flock(duration_s=240.0, at_s=120.0, breaks="knower"), tmp_path_factory.mktemp("flock")
    records = {"frozen": run(flock, Frozen(), 1), "transfer_entropy": run(flock, TransferEntropy(), 1)}
    (there / "replay.html").write_text(page_of(flock, records, "a test"), encoding="utf-8")
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
