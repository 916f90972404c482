"""The shape of the package: imports run downward, nowhere in a circle, and pymunk stays in one file."""

import ast
import graphlib
import subprocess
import sys
from pathlib import Path

import pytest

import epuckhebb
from epuckhebb.app.parts import optimizer_names, rule_names, task_names

PACKAGE = Path(epuckhebb.__file__).parent
LAYERS = ["sim", "evolution", "study", "app"]
INSIDE_SIM = {  # module -> the modules and folders beside it that it may know
    "inlined": set(),
    "compiled": {"inlined"},
    "mapping": set(),
    "random": {"compiled"},
    "light": {"compiled"},
    "maze": {"mapping", "random"},
    "robot": {"compiled", "light", "mapping"},
    "network": {"compiled"},
    "fitness": {"compiled", "robot"},
    "physics": {"compiled", "maze", "robot"},
    "task": {"compiled", "fitness", "maze"},
    "tasks": {"compiled", "fitness", "maze", "physics", "random", "robot", "task"},
    "scenario": {"light", "maze", "robot", "task", "tasks"},
    "genome": {"network", "plasticity"},
    "controller": {"adaptation", "plasticity"},
    "plasticity": {"compiled", "fitness", "network", "random", "robot"},
    "adaptation/change_signals": {"compiled"},
}


def module_of(file):
    parts = ("epuckhebb", *file.relative_to(PACKAGE).with_suffix("").parts)
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {module_of(file): file for file in sorted(PACKAGE.rglob("*.py"))}


def nodes(tree):
    """All nodes that run, those inside functions too; not what only a type checker sees."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
            continue
        yield node
        yield from nodes(node)


def needed(module):
    """The modules of this package that a module imports; the version in its root is a fact, not code."""
    for node in nodes(ast.parse(MODULES[module].read_text())):
        if isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{module}: a relative import"
            if node.module == "epuckhebb" and [name.name for name in node.names] == ["__version__"]:
                continue
            for name in node.names:
                inner = f"{node.module}.{name.name}"
                yield inner if inner in MODULES else node.module
        elif isinstance(node, ast.Import):
            yield from (name.name for name in node.names)


GRAPH = {module: {name for name in needed(module) if name in MODULES} - {module} for module in MODULES}


def floor(module):
    """The layer of a module, from below; the root of the package, which is what Python users see, is on top."""
    parts = module.split(".")
    return LAYERS.index(parts[1]) if len(parts) > 1 and parts[1] in LAYERS else len(LAYERS)


def test_every_module_is_in_a_layer_or_on_top():
    on_top = {module for module in MODULES if floor(module) == len(LAYERS)}
    assert on_top == {"epuckhebb", "epuckhebb.__main__"}
    assert len(MODULES) > 40


@pytest.mark.parametrize("module", MODULES)
def test_a_module_imports_nothing_from_above(module):
    assert [name for name in sorted(GRAPH[module]) if floor(name) > floor(module)] == []


def test_no_imports_run_in_a_circle():
    try:
        list(graphlib.TopologicalSorter(GRAPH).static_order())
    except graphlib.CycleError as error:
        pytest.fail(" → ".join(error.args[1]))


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


@pytest.mark.parametrize("part", sorted(INSIDE_SIM))
def test_imports_inside_sim(part):
    place = PACKAGE / "sim" / part
    for file in place.glob("*.py") if place.is_dir() else [place.with_suffix(".py")]:
        names = {name.split(".")[2] for name in imported(file) if "epuckhebb.sim." in name}
        assert names <= INSIDE_SIM[part] | {part.partition("/")[0]}, file


def rules():
    return [f"epuckhebb.sim.plasticity.{name}" for name in rule_names()]


def test_a_rule_is_one_file_that_no_other_has_to_know():
    """But for the paper's, from which the others are told apart."""
    assert len(rules()) >= 4
    for rule in rules():
        allowed = {f"epuckhebb.sim.{name}" for name in ("plasticity.rule", "plasticity.four_terms", "random", "robot")}
        assert GRAPH[rule] <= allowed, rule
        users = sorted(module for module, needs in GRAPH.items() if rule in needs)
        assert users == [] or rule.endswith(".paper"), users
    assert not any(".change_signals." in name for needs in GRAPH.values() for name in needs)


def test_a_task_is_one_file_that_few_others_have_to_know():
    """But for the paper's, which is the usual one; of another, only what tells its results knows."""
    for name in task_names():
        users = {module.split(".")[1] for module, needs in GRAPH.items() if f"epuckhebb.sim.tasks.{name}" in needs}
        assert "sim" not in users or name == "trial", name
        assert "evolution" not in users, name


def test_an_optimizer_is_one_file_that_no_other_has_to_know():
    """But for the genetic algorithm, whose settings are a group of the configuration."""
    optimizers = [f"epuckhebb.evolution.optimizers.{name}" for name in optimizer_names()]
    for optimizer in optimizers:
        assert not GRAPH[optimizer] & {*optimizers, "epuckhebb.evolution.evolve"}, optimizer
        users = sorted(module for module, needs in GRAPH.items() if optimizer in needs)
        assert users == (["epuckhebb.app.config"] if optimizer.endswith(".ga") else []), optimizer


@pytest.mark.parametrize("package", ["pymunk", "llvmlite"])
def test_physics_is_in_one_file(package):
    users = {file.name for file in PACKAGE.rglob("*.py") if package in {n.split(".")[0] for n in imported(file)}}
    assert users == {"physics.py"}


def test_the_start_needs_neither_statistics_nor_figures():
    """Each takes most of a second to import: of an evaluation, and of a sweep before its first job."""
    verbs = ", ".join(f"epuckhebb.app.{verb}" for verb in ("evaluate", "show", "sweep"))
    code = f"import sys, {verbs}; print(*{{'scipy.stats', 'matplotlib'}} & sys.modules.keys())"
    assert subprocess.run([sys.executable, "-c", code], check=True, capture_output=True).stdout.split() == []


def test_science_knows_no_files_and_no_configuration():
    for layer in LAYERS[:-1]:
        for file in (PACKAGE / layer).rglob("*.py"):
            names = {name.split(".")[0] for name in imported(file)}
            assert not names & {"hydra", "omegaconf", "typer", "rich"}, file
