"""`python -m epuckhebb` is `epuckhebb`. Nothing heavy is imported before the program knows how to be interrupted."""

import os
import sys
from io import TextIOWrapper

from epuckhebb.runtime import end_on_signals, open_missing_streams


def main() -> None:
    """The entry point of `epuckhebb`."""
    os.environ["MPLBACKEND"] = "agg"  # a notebook has its own there, which need not be installed here
    open_missing_streams()
    end_on_signals()
    if isinstance(sys.stdout, TextIOWrapper):
        sys.stdout.reconfigure(errors="replace")  # `?` for a sign that its encoding does not have
    from epuckhebb.cli.commands import app

    app()


if __name__ == "__main__":
    main()
