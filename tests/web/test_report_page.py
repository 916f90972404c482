"""The page of a report in a real browser: its own policy lets its style be, and columns of numbers end at the right."""

from pathlib import Path

from epuckhebb.analysis.page import study_page

REFERENCE = Path(__file__).parents[2] / "runs" / "reference"


def test_nothing_is_blocked_and_numbers_end_at_the_right(visit, tmp_path):
    page = study_page((REFERENCE / "report.md").read_text(), lambda name: (REFERENCE / "figures" / name).read_bytes())
    (tmp_path / "report.html").write_text(page, encoding="utf-8")
    shown = visit(tmp_path, moment="", name="report.html")
    aligned = "cell => getComputedStyle(cell).textAlign"
    assert shown.locator("td.number").count() > 100
    assert shown.locator("td.number").first.evaluate(aligned) == "right"
    assert shown.locator("td:not(.number)").first.evaluate(aligned) == "left"
