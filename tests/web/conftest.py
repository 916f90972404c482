"""A real browser for the tests of pages; Playwright drives it but does not bring it along."""

import os
import shutil

import pytest
from playwright.sync_api import sync_playwright

CHROMIUM = os.environ.get("EPUCKHEBB_CHROMIUM") or next(
    filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None
)
FLAGS = [
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]


@pytest.fixture(scope="session")
def browser():
    """All of it runs on one core, so that what is said of its speed is said of one."""
    if CHROMIUM is None:
        pytest.skip("no Chromium: `apt-get install chromium`, or set EPUCKHEBB_CHROMIUM to where it is")
    cores = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {max(cores)})
    with sync_playwright() as playwright:
        launched = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        os.sched_setaffinity(0, cores)
        yield launched
        launched.close()


@pytest.fixture
def visit(browser):
    """Opens a page of a folder; afterwards, nothing may have been complained of and nothing asked of anyone."""
    contexts, complaints, requests = [], [], []

    def opened(folder, moment="#t=0", name="replay.html", **options):
        context = browser.new_context(**{"viewport": {"width": 1280, "height": 900}, **options})
        context.set_offline(True)
        contexts.append(context)
        page = context.new_page()
        page.on("console", lambda message: complaints.append(message.text))
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.on("request", lambda request: requests.append(request.url))
        page.goto(f"{(folder / name).as_uri()}{moment}")
        return page

    yield opened
    for context in contexts:
        context.close()
    assert complaints == []
    assert [url for url in requests if not url.startswith(("file://", "data:"))] == []
