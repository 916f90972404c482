"""All commands of the project: `nox` runs lint, types, tests and web; `nox -s bench` measures."""

import os
import shutil

import nox

nox.options.sessions = ["lint", "types", "tests", "web"]
nox.options.default_venv_backend = "venv"
CHROMIUM = ("chromium", "chromium-browser", "google-chrome")
PROJECT = nox.project.load_toml("pyproject.toml")


def group(name: str) -> list[str]:
    """The packages of a dependency group."""
    return nox.project.dependency_groups(PROJECT, name)


@nox.session
def lint(session: nox.Session) -> None:
    """Check style and formatting."""
    session.install(*group("lint"))
    session.run("ruff", "check", ".")
    session.run("ruff", "format", "--check", ".")


@nox.session
def types(session: nox.Session) -> None:
    """Check types, strictly."""
    session.install(".", *group("types"))
    session.run("mypy", "epuckhebb")


@nox.session
def tests(session: nox.Session) -> None:
    """Run the test suite against the installed package."""
    session.install(".", *group("tests"))
    session.run("pytest", *session.posargs)


@nox.session
def web(session: nox.Session) -> None:
    """Drive the replay page in a real, headless Chromium."""
    if not (os.environ.get("EPUCKHEBB_CHROMIUM") or any(map(shutil.which, CHROMIUM))):
        session.skip("no Chromium: `apt-get install chromium`, or set EPUCKHEBB_CHROMIUM to where it is")
    session.install(".", *group("web"))
    session.run("pytest", "tests/web", *session.posargs)


@nox.session
def bench(session: nox.Session) -> None:
    """Measure a step, its parts, scale and whole commands; writes benchmarks/results.md."""
    session.install(".")
    session.run("python", "benchmarks/run.py")
