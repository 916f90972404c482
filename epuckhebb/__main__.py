"""`python -m epuckhebb` is `epuckhebb`. Nothing heavy is imported before the program knows how to be interrupted."""

from epuckhebb.runtime.errors import leave_when_asked


def main() -> None:
    """The entry point of `epuckhebb`."""
    leave_when_asked()
    from epuckhebb.cli.verbs import main as command_line

    command_line()


if __name__ == "__main__":
    main()
