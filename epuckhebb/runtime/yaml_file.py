"""Reads and writes YAML, and refuses a file in which something does not mean what it says, or which grows when read.

YAML reads a plain 010 as 8, 1:30 as 90 and 0x10 as 16, and the command line reads 010 as 10 and 1_0 as 10. A few lines
of aliases, each of ten others, stand for more values than a memory holds: values are counted before any is made.
"""

import functools
import re
from pathlib import Path
from typing import Any, NamedTuple

import yaml

from epuckhebb.runtime.errors import ConfigError, refusing
from epuckhebb.runtime.resources import data_folder

MOST_VALUES = 10_000  # of a file
_LOADER: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_DUMPER: Any = getattr(yaml, "CSafeDumper", yaml.SafeDumper)
_NUMBER = r"[-+]?(0[\d_]+(\.[\d_]*)?|0[xob][\da-fA-F_]+|\d+_[\d_]*(\.[\d_]*)?|[\d_]+(:[\d_]+)+(\.[\d_]*)?)"
_MANY_READINGS = re.compile(rf"{_NUMBER}(e[-+]?\d+)?", re.IGNORECASE)
_FLOAT = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)(e[-+]?\d+)$|\.\d+$", re.IGNORECASE)  # which YAML 1.1 reads as text
_TEXT, _NULL, _TIME, _MERGE = (f"tag:yaml.org,2002:{kind}" for kind in ("str", "null", "timestamp", "merge"))
_QUOTED = re.compile(r"""("(\\.|[^"\\])*"|'(\\.|[^'\\])*')""")
_BETWEEN = re.compile(r"[\[\]{}(),\s]+|(?<![\d_]):|:(?!\d)")  # the plain values in an override
_KEYS = re.compile(r"([\[({])|([\])}])|(?<=[{,])\s*([^\s\[\]{}(),:]+)\s*:")  # a bracket, or a key behind { or ,
_PACKAGE = re.compile(r"\s*#\s*@package\s+(\S+)[ \t]*(\S*)")
DEFAULTS, SELF = "defaults", "_self_"


class _Loader(_LOADER):  # type: ignore[misc]
    """Refuses a key that comes twice; reads 1e-5 as a number, and a date as a text, as the command line does."""

    def construct_mapping(self, node: Any, deep: bool = False) -> Any:
        """The settings of a node."""
        keys = set[str]()
        for key, _ in node.value:
            if isinstance(key, yaml.ScalarNode) and key.tag != _MERGE:
                if key.value in keys:
                    problem = f"found duplicate key {key.value}"
                    details = "while constructing a mapping", node.start_mark, problem, key.start_mark
                    raise yaml.constructor.ConstructorError(*details)
                keys.add(key.value)
        return super().construct_mapping(node, deep)


_Loader.yaml_implicit_resolvers = {
    first: [(tag, pattern) for tag, pattern in resolvers if tag != _TIME]
    for first, resolvers in _LOADER.yaml_implicit_resolvers.items()
}
_Loader.add_implicit_resolver("tag:yaml.org,2002:float", _FLOAT, list("-+.0123456789"))


class _Dumper(_DUMPER):  # type: ignore[misc]
    """Quotes a text that any reader of YAML may take for a number or a switch."""

    def represent_text(self, text: str) -> Any:
        """A text, in quotes where it needs them."""
        try:
            float(text)
        except ValueError:
            style = "'" if text.lower() in ("y", "n") else None
        else:
            style = "'"
        return self.represent_scalar(_TEXT, text, style)


_Dumper.add_representer(str, _Dumper.represent_text)


def dump(values: Any) -> str:
    """Plain values as the text of a YAML file, in their order."""
    return str(yaml.dump(values, Dumper=_Dumper, sort_keys=False, allow_unicode=True))


def check_number(text: str, where: str) -> None:
    """Refuse a plain value that YAML and the command line read as different numbers. where: it stands, for messages."""
    if _MANY_READINGS.fullmatch(text):
        raise ConfigError(f"{where}: {text} has several readings; write a number in plain digits, or a text in quotes")


def check_numbers(override: str) -> None:
    """Refuse an override with a plain value that YAML and the command line read as different numbers."""
    for text in _BETWEEN.split(_QUOTED.sub("", override.partition("=")[2])):
        check_number(text, override)


def check_keys(override: str) -> None:
    """Refuse an override with a mapping that has a key twice, of which the command line would take the last."""
    around = list[tuple[str, set[str]]]()  # the brackets that are open, and the keys so far
    for begin, end, key in _KEYS.findall(_QUOTED.sub("''", override.partition("=")[2])):
        if begin:
            around.append((begin, set()))
        elif end:
            around = around[:-1]
        elif around and around[-1][0] == "{":
            if key in around[-1][1]:
                raise ConfigError(f"{override}: the key {key} comes twice; give it once")
            around[-1][1].add(key)


class File(NamedTuple):
    """The settings in a file, or its rows by their names, not to be changed.

    package: where its first line, `# @package _global_`, says that they belong; None: in the file's group.
    """

    settings: dict[str, Any]
    package: str | None


def load(path: Path) -> dict[str, Any]:
    """The settings in a file, as they stand there; not to be changed."""
    return read(path).settings


def read(path: Path, *, is_table: bool = False) -> File:
    """What is in a file. A file of the program's is read once."""
    if path.is_relative_to(data_folder("conf")):
        return _read_once(path, is_table)
    return _read(path, is_table)


def _read(path: Path, is_table: bool) -> File:
    with refusing(lambda error: f"{path} cannot be read: {error}", (OSError, UnicodeError)):
        text = path.read_text(encoding="utf-8")
    package = _PACKAGE.match(text)
    if package and package[2]:
        raise ConfigError(f"{path}: Too many components in {package[0].strip()}; write # @package _global_")
    try:
        loader = _Loader(text)
        try:
            node = loader.get_single_node()
            _quote_names(node, is_table=is_table)
            if _count(node, path, {}) > MOST_VALUES:
                raise ConfigError(f"{path}: it stands for more than {MOST_VALUES} values, with its aliases")
            values = {} if node is None else loader.construct_document(node)
        finally:
            loader.dispose()
    except yaml.MarkedYAMLError as error:
        raise ConfigError(f"{path}{error_text(error)}") from error
    except (yaml.YAMLError, RecursionError) as error:
        raise ConfigError(f"{path}: {error}") from error
    if not isinstance(values, dict):
        raise ConfigError(f"{path}: settings must be keys with values, got {values}")
    values = {str(key): value for key, value in values.items()}
    if not is_table:
        _check_order(values, path)
    return File(values, package[1] if package else None)


_read_once = functools.cache(_read)


def error_text(error: yaml.MarkedYAMLError) -> str:
    """The line of what is wrong in a YAML file, and what it is."""
    mark = error.problem_mark or error.context_mark
    reason = ", ".join(filter(None, (error.context, error.problem)))
    return f", line {mark.line + 1}: {reason}" if mark else f": {reason}"


def _count(node: Any, path: Path, counted: dict[int, float]) -> float:
    """How many values a node stands for, each alias with all that it stands for; plain ones are checked, too."""
    if node is None or id(node) in counted:
        return counted.get(id(node), 0)
    counted[id(node)] = MOST_VALUES + 1  # of a node within itself
    if isinstance(node, yaml.ScalarNode):
        if not node.style:  # which the two loaders give as None and ""
            check_number(node.value, f"{path}, line {node.start_mark.line + 1}")
        counted[id(node)] = 1
    else:
        pairs = node.value if isinstance(node, yaml.MappingNode) else [(child,) for child in node.value]
        counted[id(node)] = sum(_count(child, path, counted) for pair in pairs for child in pair[-1:])
        for key, *_ in pairs if isinstance(node, yaml.MappingNode) else ():
            _count(key, path, counted)
    return counted[id(node)]


def _quote_names(node: Any, *, is_table: bool) -> None:
    """Let the names of rows, and of choices in lists of defaults, be texts, whatever they look like; null is none."""
    for key, value in node.value if isinstance(node, yaml.MappingNode) else ():
        if is_table:
            key.tag, key.style = _TEXT, "'"
            _quote_names(value, is_table=False)
        elif key.value == DEFAULTS and isinstance(value, yaml.SequenceNode):
            for entry in value.value:
                pairs = entry.value if isinstance(entry, yaml.MappingNode) else [(None, entry)]
                for _, choice in pairs:
                    for name in choice.value if isinstance(choice, yaml.SequenceNode) else [choice]:
                        if isinstance(name, yaml.ScalarNode) and name.tag != _NULL:
                            name.tag, name.style = _TEXT, "'"


def _check_order(values: dict[str, Any], path: Path) -> None:
    """Refuse settings in which defaults come after `_self_`, and so replace them."""
    defaults = values.get(DEFAULTS)
    is_before = False
    for entry in defaults if isinstance(defaults, list) else ():
        name = entry if isinstance(entry, str) else str(next(iter(entry), "")) if isinstance(entry, dict) else ""
        is_replaced = isinstance(entry, str) or re.split(r"[ /.@]", name)[-1] in values
        if is_before and is_replaced and not name.startswith("override ") and values.keys() - {DEFAULTS}:
            raise ConfigError(f"{path}: {name} comes after _self_, and replaces values of this file; put _self_ last")
        is_before = is_before or entry == SELF
