"""Turns errors into one message and an exit code, and writes JSON."""

import json
import sys
import traceback
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
        if place := _own_place(error):
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


def _own_place(error: BaseException) -> str:
    """The file of a user's and its line in which an error arose; "" if it arose elsewhere."""
    from epuckhebb.controller.compiling.sources import OWN_PACKAGE  # numba takes a while to load

    places = list(traceback.walk_tb(error.__traceback__))
    own = [place for place in places if str(place[0].f_globals.get("__name__")).startswith(OWN_PACKAGE)]
    return f"{own[-1][0].f_code.co_filename}, line {own[-1][1]}" if own else ""


def json_text(values: Any) -> str:
    """The text of JSON values; numbers that JSON does not have, nan and infinite ones, are null."""
    return json.dumps(json.loads(json.dumps(values), parse_constant=lambda _: None), allow_nan=False)
