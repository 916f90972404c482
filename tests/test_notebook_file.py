"""The notebook of the examples ships with its outputs, small and of no machine; `nox -s notebooks` runs it."""

import json
import re
from pathlib import Path

NOTEBOOK = Path(__file__).parents[1] / "examples" / "first_study.ipynb"


def shown(cell):
    """Whether a cell ends with what a notebook shows: a value that no `;` hides, or a figure."""
    last = "".join(cell["source"]).splitlines()[-1]
    return not re.match(r"(import|from) |sys\.path|\)", last) and "not-kept" not in cell["metadata"].get("tags", [])


def test_cells_have_outputs_which_are_small_and_name_no_machine():
    text = NOTEBOOK.read_text(encoding="utf-8")
    cells = [cell for cell in json.loads(text)["cells"] if cell["cell_type"] == "code"]
    assert [cell["id"] for cell in cells if shown(cell) and not cell["outputs"]] == []
    outputs = [output for cell in cells for output in cell["outputs"]]
    assert {output["output_type"] for output in outputs} <= {"execute_result", "display_data"}  # no progress, no error
    assert len(outputs) >= 5
    assert len(text) < 300_000
    told = re.sub(r'"image/png": "[^"]*"', "", json.dumps(outputs))
    assert not re.search(r"\\u001b|\\x1b|[\"' (](/|[A-Z]:\\\\)\w+", told)
