"""Parts that no other file has to know, imports without circles, little private of others; see import-linter, too."""

import ast
import graphlib
import re
from pathlib import Path

import pytest

import epuckhebb
from epuckhebb.config.parts import KINDS
from epuckhebb.runtime.resources import data_folder

PACKAGE = Path(epuckhebb.__file__).parent
MODULES = {
    ".".join(file.relative_to(PACKAGE.parent).with_suffix("").parts).removesuffix(".__init__"): file
    for file in PACKAGE.rglob("*.py")
}
FOLDERS = {"rule": "rules", "wiring": "wirings", "coupling": "couplings", "optimizer": "optimizers"}
DEFAULTS = {"paper", "mlp", "ga", "frozen", "oracle", "live_fitness", "transfer_entropy"}  # others name these


def nodes(tree):
    """All nodes that run, those inside functions too; not what only a type checker sees."""
    for node in ast.iter_child_nodes(tree):
        if not (isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test)):
            yield node
            yield from nodes(node)


def imported(module):
    """The modules of this package that a module imports; the version in its root is a fact, not code."""
    for node in nodes(ast.parse(MODULES[module].read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module != "epuckhebb":
            inner = {f"{node.module}.{name.name}" for name in node.names} & MODULES.keys()
            yield from inner or {node.module}


GRAPH = {module: set(imported(module)) & MODULES.keys() - {module} for module in MODULES}


def test_no_imports_run_in_a_circle():
    try:
        graphlib.TopologicalSorter(GRAPH).prepare()
    except graphlib.CycleError as error:
        pytest.fail(" → ".join(error.args[1]))


@pytest.mark.parametrize("kind", FOLDERS)
def test_a_part_is_one_file_that_no_other_has_to_know(kind):
    ends = tuple(f".{FOLDERS[kind]}.{name}" for name in set(KINDS[kind].names) - DEFAULTS)
    assert ends
    assert [(module, name) for module, names in GRAPH.items() for name in names if name.endswith(ends)] == []


def test_little_is_imported_of_the_private_inside_of_libraries():
    sources = [file.read_text(encoding="utf-8") for file in MODULES.values()]
    assert not any("hydra._internal" in source for source in sources)
    private = re.compile(r"^\s*(from|import) (?!epuckhebb)[\w.]*\b_[a-z]", re.MULTILINE)
    assert sum(bool(private.search(source)) for source in sources) <= 6


def test_a_docstring_can_be_read_alone():
    sources = {module: file.read_text(encoding="utf-8") for module, file in MODULES.items()}
    assert [module for module, source in sources.items() if re.search(r'"""(See `|The same\b)', source)] == []


def test_settings_are_few_files():
    assert len(list(data_folder("conf").rglob("*.yaml"))) <= 60
