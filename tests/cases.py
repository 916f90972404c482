"""Cases of a test that cost too much to be tried all each time."""

import pytest


def first_of(cases, ordinary=1):
    """The cases of a `parametrize`, of which the first stand in the ordinary suite and the others in the thorough one.

    ordinary: how many of them are the first.
    """
    first, others = list(cases)[:ordinary], list(cases)[ordinary:]
    values = [case if isinstance(case, tuple) else (case,) for case in others]
    return [*first, *(pytest.param(*case, marks=pytest.mark.thorough) for case in values)]
