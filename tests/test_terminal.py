"""Tables in a terminal: whatever its width, no cell is cut."""

import io
import itertools
from collections import Counter

import pytest
from rich.console import Console
from rich.text import Text

from epuckhebb.cli.console import Terminal, print_table, print_text

HEADINGS = ("controller", "side", "success", "time to goal (s)", "difference to the matched control")
ROWS = [
    ("GA", "left", "0.50 [0.24, 0.76]", "101.25", "+0.02 [-0.11, +0.15]"),
    ("late_steady_shuffled (reward inverted)", "right", "1.00 [0.72, 1.00]", "99.5", "–"),
]


def printed(width, rows=ROWS, headings=HEADINGS, text=2):
    stream = io.StringIO()
    print_table(Console(file=stream, width=width), "What came out", headings, rows, text=text)
    return stream.getvalue()


@pytest.mark.parametrize("width", [200, 100, 80, 60, 40])
def test_nothing_is_cut_at_any_width_and_no_line_is_wider(width):
    told = printed(width)
    assert "…" not in told
    assert max(map(len, told.splitlines())) <= width
    signs = "".join(itertools.chain(HEADINGS, *ROWS, ["What came out"]))
    assert Counter(told) - Counter("─") >= Counter(signs) - Counter(" ")


def test_in_80_columns_figures_stay_whole_and_end_at_the_right():
    lines = printed(80).splitlines()
    first, second = (next(line for line in lines if figure in line) for figure in ("101.25", "99.5"))
    assert first.startswith("GA  ")
    assert first.endswith("0.50 [0.24, 0.76]    101.25  +0.02 [-0.11, +0.15]")
    assert second.index("99.5") + 4 == first.index("101.25") + 6


def test_a_broken_heading_takes_no_room_from_an_interval():
    headings = ("controller", "return", "before", "after", "recovery (steps)", "weight change")
    row = ("without plasticity", "202 [199, 205]", "103 [99, 107]", "99.0 [95.0, 103.2]", "–", "0")
    assert "99.0 [95.0, 103.2]" in printed(80, [row], headings, text=1)


def test_a_long_text_breaks_between_words_and_its_figures_do_not():
    rows = [(n, "to do", f"scenario=highlight_{'x' * 20} " * 4) for n in range(3)]
    lines = printed(80, rows, ("job", "", "what"), text=3).splitlines()
    assert sum(line.count(f"scenario=highlight_{'x' * 20}") for line in lines) == 12


def test_signs_of_markup_are_shown_as_they_are():
    assert "[bold]x[/bold]" in printed(80, [("[bold]x[/bold]", "a", "b", "c", "d")])


def test_headings_are_whole_where_there_is_room():
    assert "  ".join(HEADINGS[3:]) in printed(200)
    assert "  ".join(HEADINGS[3:]) not in printed(80)


@pytest.mark.parametrize(("columns", "width"), [("0", 80), ("1", 10_000), ("39", 10_000), ("40", 40)])
def test_a_width_that_is_none_is_unknown_and_a_small_one_breaks_nothing(monkeypatch, columns, width):
    monkeypatch.setenv("COLUMNS", columns)
    assert Terminal().width == width


def test_a_long_path_stays_whole():
    stream, path = io.StringIO(), f"/{'x' * 90}/champion.npz"
    print_text(Console(file=stream, width=80), Text(f"{'word ' * 20}{path} more"))
    assert path in stream.getvalue().splitlines()[-1]
