"""`python -m epuckhebb` is `epuckhebb`. Nothing heavy is imported before the program knows how to be interrupted."""

from epuckhebb.runtime import end_on_signals


def main() -> None:
    """The entry point of `epuckhebb`."""
    end_on_signals()
    from epuckhebb.cli.commands import main as command_line

    command_line()


if __name__ == "__main__":
    main()
