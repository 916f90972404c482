"""What the whole study of the paper costs: `reproduce all`, with kernels that are there."""

import tempfile
from pathlib import Path

import commands


def measure() -> list[tuple[str, str]]:
    """Seconds of `reproduce all`."""
    with tempfile.TemporaryDirectory() as folder:
        here = Path(folder)
        commands.spent(here, "reproduce", "all", "--quick")  # compiles
        return [("reproduce all", commands.told(commands.spent(here, "reproduce", "all")))]
