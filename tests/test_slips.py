"""Slips in the keywords of Python calls are refused with the near keyword."""

import pytest

import epuckhebb


@pytest.mark.parametrize(
    ("slip", "told"),
    [
        (lambda: epuckhebb.evaluate(repeat=3), "repeats"),
        (lambda: epuckhebb.evaluate(hebbian={"n": 3}), "Did you mean N"),
        (lambda: epuckhebb.evaluate(hebbian={"N": "a lot"}), "hebbian.N must be a finite number"),
        (lambda: epuckhebb.evaluate(progres=False), "progres"),
        (lambda: epuckhebb.sweep(ovr={"seed": [1]}), "over must be keys"),
        (lambda: epuckhebb.sweep(seed=1), "over must be keys with their values"),
    ],
)
def test_a_slip_is_a_value_error_in_our_words(slip, told):
    with pytest.raises(ValueError, match=told):
        slip()
