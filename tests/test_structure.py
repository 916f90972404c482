"""The shape of the package: imports run downward, and pymunk stays in one file."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import epuckhebb

PACKAGE = Path(epuckhebb.__file__).parent
LAYERS = ["sim", "evolution", "study", "app"]
INSIDE_SIM = {
    "world": {"epuck", "maze", "compiled"},
    "controller": {"compiled"},
    "noise": {"compiled"},
    "streams": set(),
    "maze": {"compiled", "streams"},
    "light": {"compiled"},
    "epuck": {"light", "compiled"},
    "surprise": {"epuck", "controller", "compiled"},
}


def imported(file):
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.ImportFrom) and node.module:
            yield from [node.module, *(f"{node.module}.{name.name}" for name in node.names)]
        elif isinstance(node, ast.Import):
            yield from (name.name for name in node.names)


@pytest.mark.parametrize("layer", LAYERS)
def test_imports_run_downward(layer):
    above = {f"epuckhebb.{other}" for other in LAYERS[LAYERS.index(layer) + 1 :]}
    for file in (PACKAGE / layer).rglob("*.py"):
        for name in imported(file):
            assert not any(name == other or name.startswith(f"{other}.") for other in above), f"{file.name}: {name}"


@pytest.mark.parametrize("module", sorted(INSIDE_SIM))
def test_imports_inside_sim(module):
    names = {name.split(".")[2] for name in imported(PACKAGE / "sim" / f"{module}.py") if "epuckhebb.sim." in name}
    assert names <= INSIDE_SIM[module]


@pytest.mark.parametrize("package", ["pymunk", "llvmlite"])
def test_physics_is_in_world_alone(package):
    users = {file.name for file in PACKAGE.rglob("*.py") if package in {n.split(".")[0] for n in imported(file)}}
    assert users == {"world.py"}


def test_what_an_evaluation_tells_needs_no_statistics():
    """scipy.stats takes most of a second to import."""
    code = "import sys; import epuckhebb.app.evaluate, epuckhebb.app.show; sys.exit('scipy.stats' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_science_knows_no_files_and_no_configuration():
    for layer in LAYERS[:-1]:
        for file in (PACKAGE / layer).rglob("*.py"):
            names = {name.split(".")[0] for name in imported(file)}
            assert not names & {"hydra", "omegaconf", "typer", "rich"}, file
