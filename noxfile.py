"""All commands of the project.

`nox` runs what must pass before a change is merged, `nox -j 2` two sessions at a time; `nox --list` has the others.
"""

import os
import shutil
import subprocess
from pathlib import Path

import nox

nox.needs_version = ">=2026.8.10"  # the first that runs sessions in parallel
nox.options.sessions = ["tests", "lint", "types", "docs", "web", "notebooks", "newest"]
nox.options.default_venv_backend = "uv|venv"  # uv, where it is installed, makes an environment in seconds
CHROMIUM = ("chromium", "chromium-browser", "google-chrome")
BUILDERS = ("docker", "podman")
STABLE = "hydra-core==1.3.*"  # some plug-ins ask for a Hydra in a way that lets pip take a pre-release
TWO_CORES = ["-n", "2", "--dist", "loadfile"]  # a file stays with one of them: what its tests share is made once
PROJECT = nox.project.load_toml("pyproject.toml")
WORLDS = nox.project.load_toml("benchmarks/worlds.toml")


def answers(builder: str) -> bool:
    """Whether this machine has a builder of images, and its service runs."""
    return (
        bool(shutil.which(builder))
        and not subprocess.run([builder, "info"], capture_output=True, check=False).returncode
    )


def is_here(version: str) -> bool:
    """Whether this machine has a Python of that version which starts; pyenv has names for more than do."""
    try:
        return subprocess.run([f"python{version}", "-c", ""], capture_output=True, check=False).returncode == 0
    except OSError:
        return False


NEWEST = next(filter(is_here, ("3.15", "3.14", "3.13", "3.12")), None)  # numba supports them up to 3.15
ON_NEWEST = [f"tests/test_{name}.py" for name in ("digest", "compiled", "own_fitness", "cli")]  # bits, kernels, parts


def group(name: str) -> list[str]:
    """The packages of a dependency group."""
    return nox.project.dependency_groups(PROJECT, name)


@nox.session(allow_parallel=True)
def lint(session: nox.Session) -> None:
    """Check style, formatting and which package imports which."""
    session.install(*group("lint"))
    session.run("ruff", "check", ".")
    session.run("ruff", "format", "--check", ".")
    session.run("lint-imports", "--no-cache")


@nox.session(allow_parallel=True)
def types(session: nox.Session) -> None:
    """Check types, strictly."""
    session.install(".", *group("types"))
    session.run("mypy")


@nox.session(allow_parallel=True)
def tests(session: nox.Session) -> None:
    """Run the ordinary test suite against the installed package, on two cores."""
    session.install(".", *group("tests"), STABLE)
    session.run("pytest", *TWO_CORES, *session.posargs)


@nox.session(tags=["heavy"])
def thorough(session: nox.Session) -> None:
    """Run the ordinary suite, and the tests that try once more, on other input, what that suite has run."""
    session.install(".", *group("tests"), STABLE)
    thorough = ["-m", "not (slow or torture or slurm or ray or brian)", "--hypothesis-profile=thorough"]
    session.run("pytest", *TWO_CORES, *thorough, *session.posargs)


@nox.session(tags=["heavy"])
def coverage(session: nox.Session) -> None:
    """Say which lines and branches the ordinary suite runs, those of subprocesses and of compiled code among them."""
    session.install("-e", ".", *group("tests"), *group("coverage"), STABLE)
    cache = str(Path(session.create_tmp()).resolve())  # a test is in a folder of its own
    env = {"NUMBA_JIT_COVERAGE": "1", "XDG_CACHE_HOME": cache}  # what is compiled counts as run
    session.run("coverage", "run", "-m", "pytest", *TWO_CORES, *session.posargs, env=env)
    session.run("coverage", "combine", "--quiet")
    session.run("coverage", "report")


@nox.session(python=NEWEST, allow_parallel=True)
def newest(session: nox.Session) -> None:
    """Run the tests of what another Python can change on the newest of this machine that numba supports."""
    if NEWEST is None:
        session.skip("no Python 3.12 to 3.15 here; the session `tests` has run on the one of nox")
    session.install(".", *group("tests"), STABLE)
    session.run("pytest", *(session.posargs or ON_NEWEST))


@nox.session(python=NEWEST, tags=["heavy"])
def newest_whole(session: nox.Session) -> None:
    """Run the whole ordinary suite on that Python."""
    if NEWEST is None:
        session.skip("no Python 3.12 to 3.15 here")
    session.install(".", *group("tests"), STABLE)
    session.run("pytest", *TWO_CORES, *session.posargs)


@nox.session(tags=["heavy"])
def slow(session: nox.Session) -> None:
    """Run the tests that take minutes: kills at random moments, 64 processes at once, the wheel and the sdist."""
    session.install(".", *group("tests"), *group("package"), STABLE)
    session.run("pytest", "-m", "slow", *session.posargs)


@nox.session(tags=["heavy"])
def mistakes(session: nox.Session) -> None:
    """Make 60 mistakes, one at a time, in a copy of the package: which do no tests notice? `-- SEED COUNT`; hours."""
    session.install(*group("tests"), "cosmic-ray", STABLE)
    seed, count, *_ = [*session.posargs, *("1", "60")[len(session.posargs) :]]
    folder = Path(session.create_tmp())
    shutil.rmtree(folder / "copy", ignore_errors=True)  # of an earlier call
    copy, work = folder / "copy", folder / "mistakes.sqlite"
    session.run("git", "clone", "--quiet", ".", str(copy), external=True)
    session.install("-e", str(copy))
    with session.chdir(copy):
        session.run("cosmic-ray", "init", "--force", "tests/mistakes/cosmic-ray.toml", str(work))
        session.run("python", "tests/mistakes", "draw", str(work), seed, count)
        session.run("cosmic-ray", "exec", "tests/mistakes/cosmic-ray.toml", str(work))
        session.run("python", "tests/mistakes", "report", str(work), success_codes=[0, 1])


@nox.session(tags=["heavy"])
def torture(session: nox.Session) -> None:
    """Bad files, parts and words, kills, full disks; another time: `nox -s torture -- --torture-seed 2`."""
    session.install(".", *group("tests"), STABLE)
    session.run("pytest", "-m", "torture", "tests/torture", *session.posargs)


@nox.session(tags=["heavy"])
def slurm(session: nox.Session) -> None:
    """Run jobs, and lose them, on a SLURM of one node, which is installed (Debian, as root) if it is not there.

    Other losses: `nox -s slurm -- --torture-seed 2`.
    """
    if not shutil.which("slurmctld"):
        session.run("apt-get", "update", "--quiet=2", external=True)
        quietly = {"DEBIAN_FRONTEND": "noninteractive"}
        session.run("apt-get", "install", "--quiet=2", "--yes", "slurm-wlm", external=True, env=quietly)
    session.install(".[slurm]", *group("tests"), STABLE)
    tests = ["tests/test_launchers.py", "tests/torture/test_lost_jobs.py"]
    session.run("python", "tests/slurm_cluster.py", "pytest", "-m", "slurm", *tests, *session.posargs)


@nox.session(tags=["heavy"])
def ray(session: nox.Session) -> None:
    """Run a sweep on Ray, started on this machine."""
    session.install(".[ray]", *group("tests"), STABLE)
    session.run("pytest", "-m", "ray", "tests/test_launchers.py")


@nox.session(tags=["heavy"])
def digits(session: nox.Session) -> None:
    """Say what an evolution has otherwise on a machine whose C library gives exp, tanh, sin and cos other digits."""
    session.install(".", STABLE)
    session.run("python", "tests/other_digits.py")


@nox.session(tags=["heavy"])
def brian(session: nox.Session) -> None:
    """Compare spike trains and spike-timing-dependent plasticity with those of Brian2."""
    session.install(".", *group("tests"), "brian2>=2.9", "numpy<2.4")  # newer ones need Python 3.12
    session.run("pytest", "-m", "brian", "tests/test_brian.py")


@nox.session(allow_parallel=True)
def web(session: nox.Session) -> None:
    """Drive the pages of replay and play in a real, headless Chromium."""
    if not (os.environ.get("EPUCKHEBB_CHROMIUM") or any(map(shutil.which, CHROMIUM))):
        session.skip("no Chromium: `apt-get install chromium`, or set EPUCKHEBB_CHROMIUM to where it is")
    session.install(".", *group("web"))
    session.run("pytest", "tests/web", *session.posargs)


@nox.session(allow_parallel=True)
def notebooks(session: nox.Session) -> None:
    """Run the notebooks of the examples from beginning to end."""
    session.install(".", *group("notebooks"), STABLE)
    session.run("pytest", "--nbmake", "examples", "--override-ini", "addopts=", *session.posargs)


@nox.session(allow_parallel=True)
def docs(session: nox.Session) -> None:
    """Make the site of the pages in `site/`; a link that leads nowhere ends it."""
    session.install(".", *group("docs"))
    session.run("mkdocs", "build", "--strict", env={"NO_MKDOCS_2_WARNING": "1"})


@nox.session(tags=["heavy"], venv_backend="none")
def image(session: nox.Session) -> None:
    """Build the image of the Dockerfile, which runs the first line of README.md, and run it."""
    builder = next(filter(answers, BUILDERS), None)
    if builder is None:
        session.skip(f"none of {', '.join(BUILDERS)} answers on this machine")
    session.run(builder, "build", "--tag", "epuckhebb", ".", external=True)
    session.run(builder, "run", "--rm", "epuckhebb", external=True)


@nox.session(tags=["heavy"])
def bench(session: nox.Session) -> None:
    """Measure steps, commands and studies; `nox -s bench -- COMMIT` an earlier version too; writes results.md."""
    session.install(".")
    before = []
    if session.posargs:
        folder = session.create_tmp()
        tree, python = f"{folder}/tree", f"{folder}/venv/bin/python"
        shutil.rmtree(tree, ignore_errors=True)
        session.run("git", "clone", "--quiet", ".", tree, external=True)
        session.run("git", "-C", tree, "checkout", "--quiet", session.posargs[0], external=True)
        session.run("python", "-m", "venv", "--clear", f"{folder}/venv")
        session.run(python, "-m", "pip", "install", "--quiet", tree, external=True)
        before = [session.posargs[0], python, f"{tree}/benchmarks"]
    session.run("python", "benchmarks/run.py", *before)


@nox.session(tags=["heavy"])
def peers(session: nox.Session) -> None:
    """Time a step of Kheperax, of the plain loop and of ours in turn; writes benchmarks/peers.md."""
    session.install(".", "kheperax==0.2.*")
    session.run("python", "-W", "ignore", "benchmarks/peers.py")


@nox.session(tags=["heavy"])
@nox.parametrize("package", list(WORLDS), ids=list(WORLDS))
def worlds(session: nox.Session, package: str) -> None:
    """Try environments of a package at its newest version; writes rows of benchmarks/worlds.csv; `-- ID` for one."""
    try:
        session.install(".", *WORLDS[package]["install"])
        words = session.posargs
    except nox.command.CommandFailed:
        words = ["none"]
    session.run("python", "benchmarks/worlds.py", package, *words, env={"PYTHONDONTWRITEBYTECODE": None})
