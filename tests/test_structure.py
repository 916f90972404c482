"""The shape of `sim/` and of parts, and what the start imports; import-linter checks the layers, see pyproject.toml."""

import ast
import graphlib
import subprocess
import sys
from pathlib import Path

import pytest

import epuckhebb
from epuckhebb.config.parts import part_names

PACKAGE = Path(epuckhebb.__file__).parent
INSIDE_SIM = {  # module -> the modules and folders beside it that it may know
    "compiling": set(),
    "random": {"compiling"},
    "light": {"compiling"},
    "maze": {"random"},
    "reachable": {"maze"},
    "changes": {"goal_signal", "light", "maze", "reachable", "robot"},
    "sensors": {"compiling", "light"},
    "own_sensor": {"compiling", "light", "own_class", "sensors"},
    "robot": {"sensors"},
    "physics_engine": {"compiling", "maze", "robot", "sensors"},
    "senses": {"compiling", "light", "physics_engine", "robot", "sensors"},
    "evolved": set(),
    "wiring": {"evolved", "own_class", "robot"},
    "forward_pass": {"compiling", "network", "own_class", "wiring"},
    "wirings": {"evolved", "network", "ranges", "robot", "wiring"},
    "network": {"compiling", "wiring"},
    "fitness": {"compiling", "robot"},
    "libode": set(),
    "physics": {"compiling", "libode", "light", "maze", "physics_engine", "robot", "sensors"},
    "task": {"compiling", "fitness", "maze", "sensors"},
    "tasks": {"compiling", "fitness", "maze", "physics", "random", "robot", "sensors", "task"},
    "goal_signal": {"compiling", "random", "robot"},
    "scenario": {"changes", "faults", "goal_signal", "light", "maze", "own_fitness"}
    | {"physics", "physics_engine", "reachable", "robot", "sensors", "task", "tasks"},
    "genome": {"network", "plasticity"},
    "controller": {"adaptation", "plasticity"},
    "samples": {"network", "physics", "physics_engine"},
    "own_class": {"compiling"},
    "own_fitness": {"compiling", "maze", "own_class", "robot"},
    "plasticity": {
        "compiling",
        "evolved",
        "fitness",
        "forward_pass",
        "network",
        "own_class",
        "random",
        "robot",
        "wiring",
    },
    "adaptation/change_signals": {"compiling"},
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


@pytest.mark.parametrize("part", sorted(INSIDE_SIM))
def test_imports_inside_sim(part):
    place = PACKAGE / "sim" / part
    for file in place.glob("*.py") if place.is_dir() else [place.with_suffix(".py")]:
        names = {name.split(".")[2] for name in imported(file) if "epuckhebb.sim." in name}
        assert names <= INSIDE_SIM[part] | {part.partition("/")[0], "arrays", "ranges"}, file


def rules():
    return [f"epuckhebb.sim.plasticity.rules.{name}" for name in part_names("rule")]


def test_a_rule_is_one_file_that_no_other_has_to_know():
    """But for the paper's, which is the usual one."""
    assert len(rules()) >= 4
    for rule in rules():
        parts = ("evolved", "plasticity.rule", "plasticity.rules.paper", "plasticity.four_terms", "random", "robot")
        allowed = {f"epuckhebb.sim.{name}" for name in (*parts, "arrays", "ranges")}
        assert GRAPH[rule] <= allowed, rule
        users = sorted(module for module, needs in GRAPH.items() if rule in needs)
        assert users == [] or rule.endswith(".paper"), users
    assert not any(".change_signals." in name for needs in GRAPH.values() for name in needs)


def test_a_wiring_is_one_file_that_no_other_has_to_know():
    for name in part_names("wiring"):
        assert [module for module, needs in GRAPH.items() if f"epuckhebb.sim.wirings.{name}" in needs] == [], name


def test_a_task_is_one_file_that_few_others_have_to_know():
    """But for the paper's, which is the usual one; of another, only what tells its results knows."""
    for name in part_names("task"):
        users = {module.split(".")[1] for module, needs in GRAPH.items() if f"epuckhebb.sim.tasks.{name}" in needs}
        assert "sim" not in users or name == "trial", name
        assert "evolution" not in users, name


def test_an_optimizer_is_one_file_that_no_other_has_to_know():
    """But for the genetic algorithm, whose settings are a group of the configuration."""
    optimizers = [f"epuckhebb.evolution.optimizers.{name}" for name in part_names("optimizer")]
    for optimizer in optimizers:
        assert not GRAPH[optimizer] & {*optimizers, "epuckhebb.evolution.evolve"}, optimizer
        users = sorted(module for module, needs in GRAPH.items() if optimizer in needs)
        assert users == (["epuckhebb.config.schema"] if optimizer.endswith(".ga") else []), optimizer


def test_the_start_needs_neither_statistics_nor_figures():
    """Each takes most of a second to import: of an evaluation, and of a sweep before its first job."""
    commands = "epuckhebb.runs.evaluate, epuckhebb.cli.show, epuckhebb.studies.sweep"
    code = f"import sys, {commands}; print(*{{'scipy.stats', 'matplotlib'}} & sys.modules.keys())"
    assert subprocess.run([sys.executable, "-c", code], check=True, capture_output=True).stdout.split() == []
