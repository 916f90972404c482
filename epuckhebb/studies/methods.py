"""The methods of the leaderboard: rows of `conf/methods.yaml`, files of the user's, or plasticity rules of theirs."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

import msgspec

from epuckhebb.config import part_class, settings, typed_as
from epuckhebb.controller.plasticity.rule import InitialWeights
from epuckhebb.runtime import ConfigError, conf, did_you_mean, path_of

ALL = "all"
_OWN_PLAIN, _OWN_OVER = "sep_cma_es_varied", "ga"  # what a user's rule is compared with, and whose champions it takes
_OF_RULES, _OF_TRAINING = ("hebbian",), ("optimizer", "ga", "training")  # groups of settings
REVERSAL_TASK = {"task": "reversal"}  # settings of any life in reversal learning


@dataclass(frozen=True, kw_only=True)
class Method:
    """A row of the leaderboard: how controllers are evolved, and what plasticity their lifetimes have.

    Attributes:
        name: What the table calls it.
        champions_of: The method whose champions it takes; empty if it evolves its own.
        evolve: Settings of `epuckhebb evolve` by key: of its champions, or of the rule alone that they then get; empty
            if nothing is evolved.
        evaluate: Settings of `epuckhebb evaluate` by key: what is added to the champions of `champions_of`.
        matched_control: The method that is the same but has no plasticity; for a method without plasticity, the one
            that has another network, fitness, physics or optimizer. For one that takes another's champions, that other.
        description: What it is.
    """

    name: str
    champions_of: str = ""
    evolve: Mapping[str, Any] = field(default_factory=dict)
    evaluate: Mapping[str, Any] = field(default_factory=dict)
    matched_control: str = ""
    description: str = ""

    @property
    def compared_with(self) -> str:
        """The method that it is compared with; empty if there is none."""
        return self.champions_of or self.matched_control

    def overrides(self, command: str) -> list[str]:
        """Its settings of `evolve` or `evaluate`, as they would be typed."""
        return typed_as(self.evolve if command == "evolve" else self.evaluate)

    @property
    def rule(self) -> dict[str, Any]:
        """Those of its settings that choose a plasticity rule."""
        return {key: value for key, value in {**self.evolve, **self.evaluate}.items() if _is_in(_OF_RULES, key)}

    @property
    def is_rule_alone(self) -> bool:
        """Whether nothing but its rule, and how it is trained, is not as usual."""
        return all(_is_in((*_OF_RULES, *_OF_TRAINING), key) for key in {**self.evolve, **self.evaluate})


_KEYS = [key.name for key in fields(Method) if key.name not in ("name", "description")]


def methods_named(names: Sequence[str], config_dir: str | None = None) -> list[Method]:
    """The methods of these names, each after the one that it is compared with.

    names: of methods, `FILE.py:NAME` for a rule, or `all`. config_dir: the user's folder, with methods in `method/`.
    """
    files = {file.stem: file for file in Path(config_dir, "method").glob("*.yaml")} if config_dir else {}
    table = {name: conf.files("method")[0] for name in conf.rows("method")}
    known = dict(sorted({**table, **files}.items()))
    chosen: dict[str, Method] = {}

    def read(name: str, why: str, waiting: tuple[str, ...]) -> None:
        if name not in known and ".py:" not in name:
            raise ConfigError(
                f"{why}={name}: a method is one of {', '.join(known)}, or FILE.py:NAME, a rule of your own"
                f"{did_you_mean(name, known)}"
            )
        method = _own(name, known) if ".py:" in name else _read(name, known[name])
        if name in waiting:
            raise ConfigError(f"method {name}: {' is compared with '.join((*waiting, name))}; that leads nowhere")
        if method.name not in chosen:
            if method.compared_with:
                key = "champions_of" if method.champions_of else "matched_control"
                read(method.compared_with, f"method {name}: {key}", (*waiting, name))
            chosen[method.name] = method
        elif chosen[method.name] != method:
            raise ConfigError(f"{why}={name}: another rule has the name {method.name}, too; give one of them another")

    if not names:
        raise ConfigError(f"methods must name one method or more: {', '.join([ALL, *known])}, or FILE.py:NAME")
    for name in names:
        for one in known if name == ALL else [str(name)]:
            read(one, "methods", ())
    return list(chosen.values())


def _is_in(groups: Sequence[str], key: str) -> bool:
    return key.partition(".")[0] in groups


def _read(name: str, file: Path) -> Method:
    """A method of the table, or of a file of the user's."""
    is_row = file == conf.files("method")[0]
    values = settings(file)[name] if is_row else settings(file)
    where = f"{file}: {name}" if is_row else str(file)
    for key in values.keys() - _KEYS:
        raise ConfigError(
            f"{where}: {key} is not a key of a method{did_you_mean(key, _KEYS)}; it has {', '.join(_KEYS)}"
        )
    description = conf.rows("method")[name] if is_row else conf.first_comment(file)
    try:
        method = msgspec.convert({**values, "name": name, "description": description}, Method)
    except msgspec.ValidationError as error:
        raise ConfigError(f"{where}: {error}") from error
    if wrong := _mistake(method):
        raise ConfigError(f"{where}: {wrong}")
    return method


def _mistake(method: Method) -> str:
    """What does not go together; nothing if all does."""
    over, taken = method.champions_of, {"seed", "genome", "threads"} & {*method.evolve, *method.evaluate}
    if taken:
        return f"{taken.pop()} is filled in by the program; leave it out"
    if not (over or method.evolve):
        return "give evolve, how its champions are evolved, or champions_of, the method whose they are"
    if over and method.matched_control:
        return f"champions_of={over} is its matched control, too; leave out matched_control"
    if method.evaluate and (method.evolve or not over):
        return "evaluate is for what is added to champions of another method: it needs champions_of, and no evolve"
    if not (method.evolve or method.evaluate):
        return f"give evaluate, what is added to champions of {over}, or evolve"
    return ""


def _own(where: str, known: Collection[str]) -> Method:
    """A rule of the user's own: evolved with the weights if it has something to evolve, added to champions if not."""
    file, _, name = where.rpartition(":")
    path = path_of(file, "methods").absolute()
    kind = part_class("rule", f"{path}:{name}", "hebbian")
    if name in known:
        raise ConfigError(f"methods={where}: the name {name} is taken by a method; give your rule another one")
    rule, described = {"hebbian.rule": f"{path}:{name}"}, f"a rule of {path.name}"
    initial_weights = kind.__dataclass_fields__["initial_weights"].default
    if kind.evolved or initial_weights is InitialWeights.random:
        evolve = {**rule, "optimizer": "sep_cma_es", "training": "varied"}
        return Method(name=name, evolve=evolve, matched_control=_OWN_PLAIN, description=f"{described}, evolved")
    return Method(name=name, evaluate=rule, champions_of=_OWN_OVER, description=f"{described}, added")
