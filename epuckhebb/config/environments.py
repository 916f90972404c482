"""Configurations of `evolve` and `evaluate` in an environment of Gymnasium: their schemas, and what completes them.

They have files of their own in `conf/`, so that keys of the maze are none of theirs, nor theirs of the maze.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from inspect import isfunction
from pathlib import Path
from typing import Any, ClassVar, Self

from omegaconf import DictConfig

from epuckhebb.config.overrides import ANY, OF_ENVIRONMENT, parsed, value_text
from epuckhebb.config.parts import NONE, Layers, make_part
from epuckhebb.config.plugins import class_named, is_own, object_named, place_files
from epuckhebb.config.schema import Evaluates, Evolves, Figures, Learns, register
from epuckhebb.config.values import NO_KEY
from epuckhebb.controller.network import Network
from epuckhebb.controller.plasticity.control import Control, Sign
from epuckhebb.controller.plasticity.rule import Acts, NoRule, Rule
from epuckhebb.controller.ranges import check, within
from epuckhebb.controller.wiring import LAYERS, Wiring
from epuckhebb.evolution.training import UNVARIED
from epuckhebb.runtime import ConfigError, conf, did_you_mean, yaml_file
from epuckhebb.tmaze.individual import Controller
from epuckhebb.tmaze.life import Lifetime
from epuckhebb.tmaze.own_fitness import IN_ENVIRONMENT, Fitness
from epuckhebb.worlds.changes import AT, FUNCTION
from epuckhebb.worlds.environment import Environment, World
from epuckhebb.worlds.making import Maker, gymnasium

SIGNAL = "reward"  # the live fitness in environments
RETURN = "return"  # the fitness unless there is another one
WITHOUT, FROZEN = "without plasticity", "frozen at the change"
_OF_EVOLUTION = ("population", "generations", "loops")  # keys of an environment that no lifetime has
_RATE = 0.002  # N of a rule whose row has that of the maze
_USUAL = {"floor": 1.0, "N_gain_rad_s": 0.0}  # of all rules
_AS_PAPERS: dict[str, Any] = {
    "N": 0.05,
    "normalise": "largest",
}  # of ABCD and its kin, as their programs do outside Bullet


@dataclass(frozen=True, kw_only=True)
class EnvironmentConfig(Learns):
    """The keys that both commands have in common, and the world and the network that come of them.

    judge: what evolution maximises; None for the return.
    """

    parallel: ClassVar[str] = "environment.processes"
    judge: ClassVar[Fitness | None] = None
    seed: int = within(0, default=1)
    figures: Figures = "png"
    environment: Environment = field(default_factory=Environment)
    network: dict[str, Any] = field(default_factory=dict)
    hebbian: dict[str, Any] = field(default_factory=dict)
    learns: Rule | None = field(default=None, metadata=NO_KEY)

    def __post_init__(self) -> None:
        """Validate the settings."""
        check(self)
        self.world.check()
        _ = self.network_made  # made now, so that what cannot be is refused
        self.check_rule(self.rule)

    @cached_property
    def world(self) -> World:
        """The environment, which makes one when it is used first."""
        return make_world(self.environment)

    @cached_property
    def network_made(self) -> Network:
        """The network between the readings and the outputs."""
        return _network(self.world, make_part("wiring", self.network, "network"))

    @property
    def shape(self) -> Wiring | None:
        """The wiring of the network, if it has one."""
        return self.network_made.wiring

    @property
    def main(self) -> Controller:
        """The controller that learns by the rule."""
        is_none = isinstance(self.rule, NoRule)
        return Controller(name=WITHOUT if is_none else self.rule_name or self.rule.name.lower(), rule=self.rule)

    @property
    def controllers(self) -> list[Controller]:
        """The controller whose lifetimes run."""
        return [self.main]

    def take(self, rule: Rule) -> Self:
        """A copy of this configuration whose controllers learn by a rule that was made in Python, as it is.

        Only its signal is the reward, unless it has one: that of its class is of the maze.
        """
        is_left = rule.signal == type(rule).signal
        return super().take(replace(rule, signal=SIGNAL) if is_left else rule)

    def check_rule(self, rule: Rule) -> None:
        """Refuse a rule with what only the maze has."""
        if not isinstance(rule, NoRule) and rule.signal != SIGNAL:
            raise ValueError(f"hebbian.signal must be {SIGNAL} in an environment, got {rule.signal}")
        if rule.acts is not Acts.always:
            raise ValueError(f"hebbian.acts must be always in an environment, got {rule.acts.name}")
        rule.check_wiring(self.shape)
        if rule.control is not Control.none:
            raise ValueError(f"hebbian.control={rule.control.name} is for the maze; in an environment it is none")

    @property
    def threads(self) -> int:
        """How many processes may run; as a key, that of the environment."""
        return self.environment.processes

    @property
    def change_text(self) -> str:
        """The changes as tables have them: their name, or what is set when."""
        if self.environment.change:
            return self.environment.change

        def text(key: str, value: Any) -> str:
            return str(value).rpartition(":")[2] if key == FUNCTION else f"{key}={value_text(value, key)}"

        return ", ".join(
            f"{' '.join(text(*item) for item in one.items() if item[0] != AT)} at {one[AT]}"
            for one in self.environment.changes
        )


@register
@dataclass(frozen=True, kw_only=True)
class EvolveEnvironment(Evolves, EnvironmentConfig):
    """All keys of `epuckhebb evolve environment=NAME`."""

    command: ClassVar[str] = f"evolve{OF_ENVIRONMENT}"
    training, lifetime = UNVARIED, Lifetime()  # of the maze: its optimizers count robot-steps in them
    fitness: dict[str, Any] = field(default_factory=lambda: {"function": RETURN})

    def __post_init__(self) -> None:
        """Validate the settings."""
        super().__post_init__()
        self.check_search()
        if self.judge is not None:
            self.judge.check_world(IN_ENVIRONMENT)

    @cached_property
    def judge(self) -> Fitness | None:  # type: ignore[override]  # an evaluation has none
        """What evolution maximises; None for the return."""
        return None if self.fitness == {"function": RETURN} else make_part("fitness", self.fitness, "fitness")


@register
@dataclass(frozen=True, kw_only=True)
class EvaluateEnvironment(Evaluates, EnvironmentConfig):
    """All keys of `epuckhebb evaluate environment=NAME`."""

    command: ClassVar[str] = f"evaluate{OF_ENVIRONMENT}"

    def __post_init__(self) -> None:
        """Validate the settings."""
        super().__post_init__()
        for controller in self.controllers[len(self._controls) :]:
            rule = controller.rule
            self.check_rule(rule)
            if rule.sign is not Sign.shuffled and rule.sign_draw not in (0, self.rule.sign_draw):
                got = f"got {rule.sign.name}"
                raise ValueError(f"compare.{controller.name}.sign_draw={rule.sign_draw} needs sign: shuffled, {got}")

    @cached_property
    def controllers(self) -> list[Controller]:
        """The rule and its controls, and those of `compare`."""
        return self.compared(self.main, self._controls, _RATE)

    @property
    def _controls(self) -> list[Controller]:
        """The rule without plasticity, itself, with other signs, and frozen from the change on."""
        rules = {} if isinstance(self.rule, NoRule) else {WITHOUT: replace(self.rule, N=0.0)}
        rules[""] = self.rule
        if len(rules) > 1:
            rules |= {sign.name: replace(self.rule, sign=sign) for sign in Sign if sign is not self.rule.sign}
            rules |= {FROZEN: replace(self.rule, acts=Acts.before_change)} if self.environment.changes else {}
        name = self.main.name
        return [Controller(name=f"{name} ({kind})" if kind else name, rule=rule) for kind, rule in rules.items()]


def make_world(settings: Environment) -> World:
    """The world of settings; it is checked where it is used first."""
    functions = {change[FUNCTION]: _function(change[FUNCTION]) for change in settings.changes if FUNCTION in change}
    return World(
        settings=replace(settings, name=shown_name(settings)),
        make=Maker(settings, _entry(settings.id)),
        functions=functions,
    )


def shown_name(settings: Any) -> str:
    """What tables and folders call an environment: its row, or else its class, or its id without the package."""
    return str(settings.id).rpartition(":")[2] if settings.name == ANY else str(settings.name)


def _entry(text: str) -> Callable[..., Any] | None:
    """The class or function of the user's that makes an environment; None for an id of Gymnasium."""
    if not is_own(text):
        return None
    made: Callable[..., Any] = object_named(text, "environment.id")
    return made if isfunction(made) else class_named(text, gymnasium().Env, "environment.id")


def _function(text: Any) -> Callable[[Any], None]:
    """A change that is a function of the user's, of an environment."""
    key = f"environment.changes: {FUNCTION}"
    function: Callable[[Any], None] | None = object_named(str(text), key)
    if not callable(function):
        raise ConfigError(f"{key} must be FILE.py:NAME, a function of an environment, got {text}")
    return function


def _network(world: World, made: Layers | Wiring) -> Network:
    """The network between the readings and the outputs of a world."""
    if isinstance(made, Wiring):
        wiring = replace(made, outputs=world.outputs)
        return Network((world.inputs, *wiring.sizes), world.settings.reads_reward, wiring)
    layers = made.layers or (world.inputs, *world.settings.hidden, world.outputs)
    if (layers[0], layers[-1]) != (world.inputs, world.outputs):
        ends = f"{world.inputs} and end with {world.outputs}, the readings and outputs of environment {world.name}"
        raise ValueError(f"network.layers must begin with {ends}, got {list(layers)}")
    return Network(tuple(layers), world.settings.reads_reward)


def environment_of_run(genome: str) -> dict[str, Any]:
    """The settings of the evolution whose champion a genome is; nothing if it was in the maze, or is not known."""
    path = Path(genome)
    file = (path if path.is_dir() else path.parent) / ".hydra" / "config.yaml"
    values = yaml_file.load(file) if file.is_file() else {}
    return dict(values) if "environment" in values else {}


def complete(cfg: DictConfig, choices: Mapping[str, str], overrides: Sequence[str]) -> None:
    """Complete a configuration as Hydra composed it: what its champion's evolution had, names, defaults of rules."""
    words = [str(word.key_or_group) for word in parsed(overrides)]

    def is_typed(key: str) -> bool:
        return any(word == key or word.startswith(f"{key}.") for word in words)

    environment, before = cfg.environment, environment_of_run(str(cfg.genome)) if "repeats" in cfg else {}
    environment.name = environment.name or choices["environment"]
    if "repeats" in cfg and not before and not is_typed("environment"):
        raise ConfigError(f"genome={cfg.genome} is of no evolution in an environment; give environment=NAME")
    if "repeats" in cfg and (idle := [key for key in _OF_EVOLUTION if is_typed(f"environment.{key}")]):
        raise ConfigError(f"environment.{idle[0]} is for evolve: an evaluation has no such key")
    place_files({"environment": environment})
    is_same = bool(before) and before["environment"]["name"] == environment.name
    if is_same and is_typed("environment.id"):
        is_same = before["environment"]["id"] == environment.id
    for group in before.keys() & ({"network", "hebbian"} - set(words) | ({"environment"} if is_same else set())):
        for key, value in before[group].items():
            if not is_typed(f"{group}.{key}") and key not in ("change", "changes", "processes"):
                cfg[group][key] = value
    if "repeats" in cfg and not is_typed("environment.horizon"):
        environment.horizon *= 2
    if not environment.id:
        of_none = f"genome={cfg.genome} is of no evolution in an environment, and " if "repeats" in cfg else ""
        raise ConfigError(f"{of_none}environment={ANY} needs environment.id, an id of Gymnasium or FILE.py:NAME")
    if environment.change is not None:
        if environment.change not in environment.named or environment.changes:
            names, where = ", ".join(environment.named) or "none", f"in environment={environment.name}"
            got = f"{environment.change}{did_you_mean(str(environment.change), environment.named)}"
            raise ConfigError(f"change must be one of {names} {where}, without environment.changes, got {got}")
        environment.changes = environment.named[environment.change]
    if (not before or "hebbian" in words) and cfg.hebbian.get("rule") not in (None, NONE):
        choice, rule = choices["hebbian"], cfg.hebbian
        fit_rule(rule, choice, cfg.network, lambda key: is_typed(f"hebbian.{key}"))
        is_row = choice != NONE and ":" not in choice
        rule.name = rule.get("name") or (choice if is_row else str(rule.rule).rpartition(":")[2].lower())
        if cfg.network.get("wiring") == "ctrnn" and not is_typed("network.tau_gain_rad_s"):
            cfg.network.tau_gain_rad_s = 0.0
    if "optimizer" in cfg:
        if ":" in str(cfg.optimizer.algorithm):  # one of one's own has no settings of the default one
            typed = [key for key in cfg.optimizer if is_typed(f"optimizer.{key}")]
            cfg.ga, cfg.optimizer = None, {key: cfg.optimizer[key] for key in typed}
        group = "optimizer" if cfg.ga is None else "ga"
        for key in _OF_EVOLUTION:
            if not is_typed(f"{group}.{key}"):
                cfg[group][key] = environment[key]


def fit_rule(rule: DictConfig, choice: str, network: DictConfig, is_typed: Callable[[str], bool]) -> None:
    """Give a rule what it has in environments: no wheel gain, the reward as live fitness, and rates of the papers."""
    defaults = {**_USUAL, "signal": SIGNAL}
    if choice.startswith("abcd"):
        defaults |= _AS_PAPERS if network.wiring == LAYERS else {"N": _AS_PAPERS["N"]}
    if "scenario" in str(conf.table("hebbian").get(choice, {}).get("N", "")) or "N" not in rule:
        defaults |= {"N": _RATE}
    for key, value in defaults.items():
        if not is_typed(key):
            rule[key] = value
