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
    except BrokenPipeError:  # nobody reads what we say, and what we do is done
        discard(sys.stdout)
    except OSError as error:
        message = f"{error.filename}: {error.strerror}" if error.filename else str(error)
    except MemoryError as error:
        message = f"there is not enough memory for this: {error}"
    except JobFailedError as error:
        message, code = f"a job failed: {error}", JOB_FAILED
    if message:
        print_error(message)
        raise typer.Exit(code)


def json_text(values: Any) -> str:
    """The text of JSON values; numbers that JSON does not have, nan and infinite ones, are null."""
    return json.dumps(json.loads(json.dumps(values), parse_constant=lambda _: None), allow_nan=False)
