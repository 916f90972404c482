"""Rows of a table as CSV, and back: the bytes and the values of pandas, without pandas."""

import math
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from epuckhebb.store.rows import TEXTS, as_csv, parse_csv

COMMITTED = sorted(Path(__file__).parents[1].glob("runs/reference/**/*.csv"))


@pytest.mark.parametrize("file", COMMITTED, ids=lambda file: "-".join(file.parts[-2:]))
def test_committed_tables_are_read_as_pandas_reads_them(file):
    table = pd.read_csv(file, keep_default_na=False, na_values=[""], dtype=dict.fromkeys(TEXTS, str), low_memory=False)
    table = table.astype(object)
    expected = table.where(table.notna(), None).to_dict("records")
    rows = parse_csv(file.read_text())
    assert rows == expected
    assert [list(map(type, row.values())) for row in rows] == [list(map(type, row.values())) for row in expected]


def test_cells_are_written_as_pandas_writes_them():
    rows = [
        {"name": 'a, "b"', "whole": 3, "few": None, "share": 0.1, "text": "", "is": True, "numpy": np.int64(2)},
        {"name": "x\ny", "whole": -1, "few": 2, "share": 1e-7, "text": "nan", "is": False, "numpy": np.int64(3)},
        {"name": "z", "whole": 0, "few": 5, "share": math.nan, "text": "01", "is": True, "numpy": np.int64(4)},
    ]
    assert as_csv(rows) == pd.DataFrame(rows).to_csv(index=False, lineterminator="\n")
    assert parse_csv("name,scenario\n,007\n") == [{"name": None, "scenario": "007"}]


@given(st.lists(st.floats(), min_size=2))
def test_numbers_come_back_to_the_last_bit(numbers):
    back = [row["value"] for row in parse_csv(as_csv([{"row": "x", "value": number} for number in numbers]))]
    np.testing.assert_array_equal(np.array(back, float), np.array(numbers))
