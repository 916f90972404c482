"""Values that are allowed, and so far from usual that their unit may be wrong, have a note."""

import pytest

from epuckhebb.config.compose import load_any
from epuckhebb.runs.notes import unusual_values


@pytest.mark.parametrize(
    "word",
    ["scenario.light=50", "scenario.lamp.intensity=2000", "lifetime.duration_s=250000", "hebbian.N=15"],
)
@pytest.mark.parametrize("command", ["evaluate", "evolve"])
def test_a_value_far_from_usual_has_a_note_with_its_key(command, word):
    (note,) = unusual_values(load_any(command, [word, *(["hebbian=paper"] if "hebbian" in word else [])]))
    assert note.startswith(f"{word} ")


@pytest.mark.parametrize("command", ["evaluate", "evolve"])
def test_usual_values_are_not(command):
    assert unusual_values(load_any(command, ["scenario=highlight"])) == []


def test_a_rule_with_a_rate_of_its_own_has_the_note_too():
    (note,) = unusual_values(load_any("evaluate", ["hebbian=online", "hebbian.N=15"]))
    assert note.startswith("hebbian.N=15 ")
