"""Prints results, in words or as JSON, and turns errors into one message and an exit code."""

import gc
import json
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import typer
from rich.console import Console

from epuckhebb.cli.console import Terminal, is_of_output
from epuckhebb.runtime import (
    INTERRUPTED,
    JOB_FAILED,
    USAGE,
    ConfigError,
    JobFailedError,
    be_quiet,
    discard_output,
    interrupted,
    interruptible,
    unusable_here,
)


def print_error(message: str) -> None:
    """Print an error message on standard error."""
    console = Terminal(stderr=True)
    console.print("Error: ", style="bold red", end="")
    console.print(message, markup=False, soft_wrap=True)


@contextmanager
def report_errors() -> Iterator[None]:
    """Turn errors into one message and an exit code."""
    unusable = unusable_here()
    if unusable:
        print_error(unusable)
        raise typer.Exit(USAGE)
    try:
        with interruptible():
            yield
    except ConfigError as error:
        print_error(str(error))
        raise typer.Exit(USAGE) from None
    except KeyboardInterrupt as interruption:
        print_error(interrupted(str(interruption)))
        raise typer.Exit(INTERRUPTED) from None
    except BrokenPipeError:  # nobody reads what we say, and what we do is done
        discard_output(sys.stdout)
    except OSError as error:
        if is_of_output(error):
            raise typer.Exit(unwritable(error)) from None
        print_error(f"{error.filename}: {error.strerror}" if error.filename else str(error))
        raise typer.Exit(USAGE) from None
    except JobFailedError as error:
        print_error(f"a job failed: {error}")
        raise typer.Exit(JOB_FAILED) from None


def unwritable(error: OSError) -> int:
    """Say that nothing more can be printed; returns the exit code."""
    discard_output(sys.stdout)
    print_error(f"the output cannot be written: {error.strerror}")
    return JOB_FAILED


def print_result(as_json: bool, quiet: bool, values: Callable[[], Any], print_text: Callable[[Console], None]) -> None:
    """Print a result: as JSON, as text, or not at all."""
    if as_json:
        typer.echo(json_text(values()))
    elif not quiet:
        print_text(Terminal())


def json_text(values: Any) -> str:
    """The text of JSON values; numbers that JSON does not have, nan and infinite ones, are null."""
    return json.dumps(json.loads(json.dumps(values), parse_constant=lambda _: None), allow_nan=False)


def begin(quiet: bool) -> None:
    """What a command does first, when all that it needs is imported: see `main`."""
    gc.freeze()
    gc.set_threshold(20_000, 10, 10)  # of objects; what matplotlib loads and a study composes is next to no garbage
    gc.enable()
    be_quiet(quiet)


def open_in_browser(page: Path) -> None:
    """Open a page in the browser."""
    import webbrowser

    if not webbrowser.open(page.resolve().as_uri()):
        print_error(f"no browser could be started; open {page} yourself")
        raise typer.Exit(JOB_FAILED)
