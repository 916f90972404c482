"""`python -m epuckhebb` is `epuckhebb`. Nothing heavy is imported before the program knows how to be interrupted."""

import atexit
import gc
import os
import sys
from io import TextIOWrapper

from epuckhebb.runtime import end_on_signals, open_missing_streams


def main() -> None:
    """The entry point of `epuckhebb`."""
    gc.set_threshold(50_000, 20, 20)  # a start makes next to no garbage, and searching for it takes a sixth of the time
    atexit.register(gc.freeze)  # a search at the end takes as much again
    os.environ["MPLBACKEND"] = "agg"  # a notebook has its own there, which need not be installed here
    open_missing_streams()
    end_on_signals()
    if isinstance(sys.stdout, TextIOWrapper):
        sys.stdout.reconfigure(errors="replace")  # `?` for a sign that its encoding does not have
    from epuckhebb.cli.commands import app

    app()


if __name__ == "__main__":
    main()
