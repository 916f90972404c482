"""The shape of parts, and what the start imports; import-linter checks the layers, see pyproject.toml."""

import ast
import graphlib
import subprocess
import sys
from pathlib import Path

import pytest

import epuckhebb
from epuckhebb.config.parts import part_names

PACKAGE = Path(epuckhebb.__file__).parent


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


def rules():
    return [f"epuckhebb.controller.plasticity.rules.{name}" for name in part_names("rule")]


def test_a_rule_is_one_file_that_no_other_has_to_know():
    """But for the paper's, which is the usual one."""
    assert len(rules()) >= 4
    for rule in rules():
        parts = ("evolved", "plasticity.rule", "plasticity.rules.paper", "plasticity.four_terms", "random")
        allowed = {f"epuckhebb.controller.{name}" for name in (*parts, "arrays", "ranges")}
        allowed.add("epuckhebb.tmaze.robot")
        assert GRAPH[rule] <= allowed, rule
        users = sorted(module for module, needs in GRAPH.items() if rule in needs)
        assert users == [] or rule.endswith(".paper"), users
    assert not any(".change_signals." in name for needs in GRAPH.values() for name in needs)


def test_a_wiring_is_one_file_that_no_other_has_to_know():
    for name in part_names("wiring"):
        wiring = f"epuckhebb.controller.wirings.{name}"
        assert [module for module, needs in GRAPH.items() if wiring in needs] == [], name


def test_a_task_is_one_file_that_few_others_have_to_know():
    """But for the paper's, which is the usual one; of another, only what tells its results knows."""
    for name in part_names("task"):
        users = {module.split(".")[1] for module, needs in GRAPH.items() if f"epuckhebb.tmaze.tasks.{name}" in needs}
        assert "tmaze" not in users or name == "trial", name
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
