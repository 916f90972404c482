"""What torture tests share."""

import random

import pytest


@pytest.fixture
def chance(request):
    """Random numbers of this test and the seed."""
    return random.Random(f"{request.config.getoption('--torture-seed')} {request.node.name}")
