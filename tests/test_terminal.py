"""Tables in a terminal: whatever its width, no cell is cut."""

import io

import pytest
from rich.console import Console

from epuckhebb.app.terminal import print_table

HEADINGS = ("controller", "success, left", "time to goal (s)")
ROWS = [("GA", "0.50 (0.24–0.76)", 101.25), ("late_steady_shuffled", "1.00 (0.72–1.00)", 99.5)]


def printed(width, rows=ROWS, headings=HEADINGS):
    stream = io.StringIO()
    print_table(Console(file=stream, width=width), "What came out", headings, rows)
    return stream.getvalue()


@pytest.mark.parametrize("width", [200, 80, 60, 40, 20])
def test_no_word_is_cut_at_any_width(width):
    told = printed(width)
    for cell in (*HEADINGS, *(str(cell) for row in ROWS for cell in row)):
        assert all(word in told for word in cell.split()), cell
    assert "…" not in told


def test_a_table_that_fits_is_as_wide_as_its_cells():
    lines = printed(80).splitlines()
    assert len({len(line) for line in lines[1:]}) == 1
    assert "│ GA                   │ 0.50 (0.24–0.76) │ 101.25           │" in lines


def test_cells_wrap_between_words_before_anything_else():
    lines = printed(60).splitlines()
    assert max(map(len, lines)) <= 60
    assert any("0.50" in line and "GA" in line for line in lines)


def test_a_table_that_is_somewhat_too_wide_loses_its_lines():
    lines = printed(44).splitlines()
    assert max(map(len, lines)) <= 44
    assert not any("│" in line for line in lines)
    assert any(line.startswith("late_steady_shuffled  1.00") for line in lines)


def test_a_table_that_is_too_wide_turns_on_its_side():
    many = [(f"row{n}", *(10**8 + n for _ in range(11))) for n in range(2)]
    lines = printed(80, many, ("run", *(f"a_column_{n}" for n in range(11)))).splitlines()
    assert max(map(len, lines)) <= 80
    assert any(line.split("│")[1:-1] == [" a_column_0  ", " 100000000 ", " 100000001 "] for line in lines)


def test_what_does_not_fit_on_its_side_either_is_a_block_for_each_row():
    many = [(f"runs/evaluate/{'x' * 60}{n}", "finished " * 20) for n in range(9)]
    told = printed(40, many, ("run", "result"))
    assert f"run     runs/evaluate/{'x' * 60}3\nresult  finished finished" in told


def test_signs_of_markup_are_shown_as_they_are():
    assert "[bold]x[/bold]" in printed(80, [("[bold]x[/bold]", "a", "b")])
