"""Slips in Python calls are told in our own words, with the near keyword."""

import copy
import pickle
from dataclasses import dataclass, replace

import pytest

import epuckhebb
from epuckhebb import GA, Adaptation, Evolved, Hebbian, Lifetime, Rule


@dataclass(frozen=True, kw_only=True)
class Mine(Rule):
    decay: float = 1.0


@pytest.mark.parametrize(
    ("slip", "told"),
    [
        (lambda: Hebbian(n=3), r"^Hebbian\(n=...\): n is not a setting of it; did you mean N\?"),
        (lambda: Hebbian(rate=3), "rate is not a setting of it; it has N, N_gain_rad_s, floor"),
        (lambda: Hebbian(0.1), r"^Hebbian\(0.1\): settings are given by their names, as Hebbian\(N=...\)"),
        (lambda: Hebbian(N="0.1"), "N must be a number, got '0.1'"),
        (lambda: GA(populaton=3), "did you mean population"),
        (lambda: Lifetime(duration=3), "did you mean duration_s"),
        (lambda: Adaptation(tresh=2), "did you mean threshold"),
        (lambda: Evolved(pre="layer"), "did you mean per"),
        (lambda: Mine(dekay=2), r"^Mine\(dekay=...\).* did you mean decay"),
        (lambda: epuckhebb.evaluate(repeat=3), "repeats"),
        (lambda: epuckhebb.evaluate(hebbian={"n": 3}), "did you mean N"),
        (lambda: epuckhebb.evaluate(progres=False), "there is no keyword progres; did you mean progress"),
        (lambda: epuckhebb.sweep(ovr={"seed": [1]}), "there is no keyword ovr; did you mean over"),
        (lambda: epuckhebb.sweep(seed=1), "over must be keys with their values"),
    ],
)
def test_a_slip_is_a_value_error_in_our_words(slip, told):
    with pytest.raises(ValueError, match=told):
        slip()


def test_objects_are_what_they_were():
    for made in (Hebbian(N=0.1), GA(population=10), Lifetime(noise=0.5), Mine(decay=2), Evolved("layer", start=2)):
        assert pickle.loads(pickle.dumps(made)) == copy.deepcopy(made) == made
    assert replace(Hebbian(N=0.1), floor=0.5) == Hebbian(N=0.1, floor=0.5)
    assert (Mine(decay=2).decay, Evolved("layer", start=2).per) == (2, "layer")
