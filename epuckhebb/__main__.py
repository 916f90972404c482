"""`python -m epuckhebb` is `epuckhebb`."""

from epuckhebb.app.cli import main

if __name__ == "__main__":
    main()
