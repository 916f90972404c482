"""Turns errors into one message and an exit code, and writes JSON."""

import json
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import typer

from epuckhebb.cli.console import Terminal
from epuckhebb.runtime import (
    INTERRUPTED,
    JOB_FAILED,
    USAGE,
    ConfigError,
    JobFailedError,
    discard,
    interrupted,
    interruptible,
)


def print_error(message: str) -> None:
    """Print an error message on standard error."""
    console = Terminal(stderr=True)
    console.print("Error: ", style="bold red", end="")
    console.print(message, markup=False, soft_wrap=True)


@contextmanager
def report_errors() -> Iterator[None]:
    """Turn errors into one message and an exit code."""
    message, code = "", USAGE
    try:
        with interruptible():
            yield
    except ConfigError as error:
        message = str(error)
    except KeyboardInterrupt as interruption:
        message, code = interrupted(str(interruption)), INTERRUPTED
    except JobFailedError as error:
        message, code = f"a job failed: {error}", JOB_FAILED
    except (Exception, SystemExit) as error:  # a user's own part may raise anything, and even leave Python
        from epuckhebb.config import own_place  # it takes a while to load

        if place := own_place(error):
            message = f"{place}: {type(error).__name__}: {error}"
        elif isinstance(error, BrokenPipeError):  # nobody reads what we say, and what we do is done
            discard(sys.stdout)
        elif isinstance(error, OSError):
            message = f"{error.filename}: {error.strerror}" if error.filename else str(error)
        elif isinstance(error, MemoryError):
            message = f"there is not enough memory for this: {error}"
        else:
            raise
    if message:
        print_error(message)
        raise typer.Exit(code)


def json_text(values: Any) -> str:
    """The text of JSON values; numbers that JSON does not have, nan and infinite ones, are null."""
    return json.dumps(json.loads(json.dumps(values), parse_constant=lambda _: None), allow_nan=False)
