"""The methods of the leaderboard: rows of `conf/methods.yaml`, files of the user's, or plasticity rules of theirs."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import msgspec

from epuckhebb.config import part_class
from epuckhebb.config import settings as settings_in
from epuckhebb.controller.plasticity.rule import InitialWeights
from epuckhebb.runtime import ConfigError, conf, did_you_mean, user_path

ALL = "all"
REVERSAL_TASK, REVERSAL_GA = {"task": "reversal"}, {"ga": "reversal"}  # of a lifetime; of its evolution
_MEMORY = ("hebbian", "network")  # groups of settings: what can remember from trial to trial
_PLAIN = "ga"  # its champions get rules that evolve nothing; in reversal learning all methods are compared with it
_KINDS = (
    "it needs either evolve, how its champions are evolved, and with plasticity a matched_control; or champions_of, "
    "the method whose champions it takes, and either evaluate, what is added to them, or evolve, of a rule for them"
)


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
    def comparison(self) -> str:
        """The method that it is compared with; empty if there is none."""
        return self.champions_of or self.matched_control


_KEYS = [key.name for key in fields(Method) if key.name not in ("name", "description")]


def find_methods(names: Sequence[str], config_dir: str | None = None) -> list[Method]:
    """The methods of these names, each after the one that it is compared with.

    names: of methods, `FILE.py:NAME` for a rule, or `all`. config_dir: the user's folder, with methods in `method/`.
    """
    files = {file.stem: file for file in Path(config_dir, "method").glob("*.yaml")} if config_dir else {}
    choices = sorted({*conf.rows("method"), *files})
    chosen: dict[str, Method] = {}

    def choose(name: str, waiting: tuple[str, ...] = ()) -> None:
        if name in waiting:
            raise ConfigError(f"method {name}: {' is compared with '.join((*waiting, name))}; that leads nowhere")
        if ".py:" in name:
            method = _rule_method(name)
        elif name in files:
            method = _method(name, settings_in(files[name]), conf.first_comment(files[name]), str(files[name]))
        elif name in choices:
            method = _method(name, conf.table("method")[name], conf.rows("method")[name], f"method {name}")
        else:
            hint = did_you_mean(name, choices)
            raise ConfigError(f"methods={name}: it must be one of {', '.join(choices)}, or FILE.py:NAME{hint}")
        if method.comparison:
            choose(method.comparison, (*waiting, name))
        if chosen.setdefault(method.name, method) != method:
            raise ConfigError(f"methods={name}: another one has the name {method.name}, too; give your rule another")

    if not names:
        raise ConfigError(f"methods must name one method or more: {', '.join([ALL, *choices])}, or FILE.py:NAME")
    for name in names:
        for choice in choices if name == ALL else [str(name)]:
            choose(choice)
    return list(chosen.values())


def reversal_methods(methods: Sequence[Method]) -> list[Method]:
    """These methods in reversal learning: their rule or network, evolved by the GA in its one world, or a rule added.

    Methods with the same are one here. Those with neither, and those with an adaptation, are left out.
    """
    (plain,) = find_methods([_PLAIN])
    chosen = [replace(plain, evolve={**REVERSAL_TASK, **REVERSAL_GA})]
    parts: list[tuple[object, ...]] = []
    for method in methods:
        settings = method.evolve or method.evaluate
        memory = {key: value for key, value in settings.items() if key.partition(".")[0] in _MEMORY}
        part = bool(method.evolve), bool(method.champions_of), memory
        rest = {key.partition(".")[0] for key in settings} - {*_MEMORY, "optimizer", "ga", "training"}
        if memory and not rest and part not in parts:
            parts.append(part)
            whose = method.champions_of if method.champions_of in [method.name for method in chosen] else _PLAIN
            compared = {"champions_of": whose} if method.champions_of else {"matched_control": _PLAIN}
            evolve = {**REVERSAL_TASK, **REVERSAL_GA, **memory} if method.evolve else {}
            evaluate = {} if method.evolve else {**REVERSAL_TASK, **memory}
            named = {"name": method.name, "description": method.description}
            chosen.append(Method(evolve=evolve, evaluate=evaluate, **compared, **named))
    return chosen


def _method(name: str, values: Mapping[str, Any], description: str, where: str) -> Method:
    """The method with these settings. where: they come from, for messages."""
    for key in values.keys() - _KEYS:
        raise ConfigError(f"{where}: {key} is not a key of a method, which has {', '.join(_KEYS)}")
    try:
        method = msgspec.convert({**values, "name": name, "description": description}, Method)
    except msgspec.ValidationError as error:
        raise ConfigError(f"{where}: {error}") from error
    over, needless = method.champions_of, method.matched_control if method.champions_of else method.evaluate
    if needless or bool(method.evolve) == bool(over and method.evaluate):
        raise ConfigError(f"{where}: {_KINDS}")
    return method


def _rule_method(reference: str) -> Method:
    """A rule of the user's: evolved with the weights if it has something to evolve, added to champions if not."""
    file, _, name = reference.rpartition(":")
    path = user_path(file, "methods").absolute()
    kind = part_class("rule", f"{path}:{name}", "hebbian")
    rule, description = {"hebbian.rule": f"{path}:{name}"}, f"a rule of {path.name}"
    initial_weights = kind.__dataclass_fields__["initial_weights"].default
    if kind.evolved or initial_weights is InitialWeights.random:
        evolve = {**rule, "optimizer": "sep_cma_es", "training": "varied"}
        return Method(name=name, evolve=evolve, matched_control="sep_cma_es_varied", description=description)
    return Method(name=name, evaluate=rule, champions_of=_PLAIN, description=description)
