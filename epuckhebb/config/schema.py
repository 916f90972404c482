"""The typed configuration: what keys there are, of which type, and what they may be. Values stand in `conf/`.

Parts that are dataclasses of the science (`GA`, `Lifetime`, `Lamp`, `Adaptation`) are the schema themselves; those
that a user can bring (a rule, a maze, a robot) are open here, and checked when they are made
(`epuckhebb.config.build`).
"""

import functools
import re
from collections.abc import Sequence
from dataclasses import MISSING, Field, dataclass, field, fields, make_dataclass
from enum import Enum
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar, cast, get_type_hints

from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from epuckhebb.adaptation.adaptation import Adaptation
from epuckhebb.config import build
from epuckhebb.config.errors import explain
from epuckhebb.config.parts import Layers, make_part
from epuckhebb.controller.network import Network
from epuckhebb.controller.plasticity.control import Control
from epuckhebb.controller.plasticity.rule import InitialWeights, NoRule, Rule
from epuckhebb.controller.ranges import check, within
from epuckhebb.controller.wiring import LAYERS, Wiring
from epuckhebb.evolution.evolve import evolved_plan
from epuckhebb.evolution.optimizer import Algorithm
from epuckhebb.evolution.optimizers.ga import GA
from epuckhebb.evolution.training import Training
from epuckhebb.runtime import refusing
from epuckhebb.tmaze.individual import GA_ALONE, Controller
from epuckhebb.tmaze.life import Lifetime
from epuckhebb.tmaze.own_fitness import IN_MAZE, PAPER_FITNESS
from epuckhebb.tmaze.physics.pymunk import PYMUNK
from epuckhebb.tmaze.scenario import Scenario
from epuckhebb.tmaze.tasks.trial import ONE_TRIAL

MOST_THREADS = 1024  # more than cores of any machine there is; a system may refuse to start more


Plain = dict[str, Any]  # a configuration of plain values
Config = TypeVar("Config", bound="Checked")


class Checked:
    """What all configurations have in common: the values that Hydra composed, from which they are made.

    controllers: those whose lifetimes run, besides the network alone.
    """

    command: ClassVar[str]
    composed: DictConfig
    seed: int
    hebbian: dict[str, Any]
    rule: Rule
    network_made: Network
    controllers: list[Controller]

    def use(self, rule: Rule, called: str | None = None) -> None:
        """Let controllers learn by a rule. called: its name in tables; that of its class unless given."""
        raise NotImplementedError

    def take(self, rule: Rule) -> None:
        """Let controllers learn by a rule that was made in Python."""
        self.use(rule)

    @functools.cached_property
    def values(self) -> Plain:
        """All settings as plain values, every reference resolved."""
        return plain(self.composed)


def plain(cfg: DictConfig) -> Plain:
    """A composed configuration as plain values, every reference resolved; a ConfigError if one leads nowhere."""
    with refusing(explain, OmegaConfBaseException):
        values = OmegaConf.to_container(cfg, resolve=True, enum_to_str=True)
    assert isinstance(values, dict)
    return {str(key): value for key, value in values.items()}


def dump(config: Checked) -> str:
    """The YAML that a run folder keeps of a configuration: all of its settings, every reference resolved."""
    return OmegaConf.to_yaml(config.composed, resolve=True)


# A scenario has the keys of `Scenario`, but for other groups, and for what only changes during a lifetime set.
_NO_KEYS = ("maze", "robot", "task", "fitness", "physics", "lamp_on", "placed", "rate", "put", "reset")
_LOOSE = {  # what may be given in several forms, which `make_scenario` checks: type and default
    "name": (str, ""),
    "goals": (Any, None),
    "second_lamp": (Any, None),
    "dead_sensors": (Any, list),
    "changes": (list[Any], list),
    "hand": (str | None, None),
}


def _make_key(known: Field[Any]) -> tuple[str, Any, Any]:
    usual = known.type, known.default_factory if known.default is MISSING else known.default
    kind, default = _LOOSE.get(known.name, usual)
    return known.name, kind, field(default_factory=default) if callable(default) else field(default=default)


if TYPE_CHECKING:
    ScenarioConfig = Any
else:
    keys = [_make_key(known) for known in fields(Scenario) if known.name not in _NO_KEYS]
    keys.append(("start", Any, field(default=None)))  # of the maze, as this scenario has it
    ScenarioConfig = make_dataclass("ScenarioConfig", keys, kw_only=True, namespace={"__module__": __name__})


class Figures(Enum):
    """The files to which a run writes its figures."""

    png = "png"
    svg = "svg"
    pdf = "pdf"
    none = "none"


@dataclass(kw_only=True)
class WorldConfig(Checked):
    """The keys that `evaluate` and `evolve` have in common, and the world that comes of them.

    change: the changes of the world by name, each with the maze and the physics that it brings. world: the scenario,
    with its maze and robot. shape: of the network; None if it was left open. wiring: the network's, if it has one.
    rule: of plasticity.
    """

    parallel: ClassVar[str] = "threads"  # the key that says how much runs at a time
    seed: int = within(0, default=1)
    threads: int = within(0, MOST_THREADS, default=0)
    figures: Figures = Figures.png
    scenario: ScenarioConfig = field(default_factory=ScenarioConfig)
    change: dict[str, Any] = field(default_factory=dict)
    maze: dict[str, Any] = field(default_factory=dict)
    robot: dict[str, Any] = field(default_factory=dict)
    network: dict[str, Any] = field(default_factory=lambda: {"wiring": LAYERS})
    hebbian: dict[str, Any] = field(default_factory=dict)
    lifetime: Lifetime = field(default_factory=Lifetime)
    task: dict[str, Any] = field(default_factory=lambda: {"kind": ONE_TRIAL.name})
    fitness: dict[str, Any] = field(default_factory=lambda: {"function": PAPER_FITNESS.name})
    physics: dict[str, Any] = field(default_factory=lambda: {"kind": PYMUNK.name})
    changed: str | None = None

    def __post_init__(self) -> None:
        """Validate the settings."""
        check(self)
        self.world = build.make_scenario(self.scenario, self.maze, self.robot, self.task, self.fitness, self.physics)
        self.world.fitness.check_world(IN_MAZE)
        made = make_part("wiring", self.network, "network")
        self.shape = made.layers if isinstance(made, Layers) else made
        self.wiring = self.shape if isinstance(self.shape, Wiring) else None
        self.network_made = build.make_network(self.world, self.shape)
        self.world.check_lifetime(self.lifetime)
        self.rule = build.make_rule(self.hebbian, "hebbian")


@dataclass(kw_only=True)
class Evaluates(Checked):
    """The keys of `evaluate` in every world."""

    genome: str = "reference"
    repeats: int = within(1, default=10)
    compare: dict[str, Any] = field(default_factory=dict)  # name -> what differs from the rule of `hebbian`

    def compared(self, main: Controller, others: Sequence[Controller], rate: float) -> list[Controller]:
        """Some controllers and those of `compare`, but for the main one. rate: N of a rule that says none."""
        given = [build.compared(name, settings, self.hebbian, rate) for name, settings in self.compare.items()]
        controllers = [*others, *(controller for controller in given if controller != main)]
        names = [GA_ALONE.name, *(controller.name for controller in controllers)]
        if twice := next((name for name in names if names.count(name) > 1), None):
            raise ValueError(f"controllers need different names, got {', '.join(names)}; give {twice} another one")
        return controllers


@dataclass(kw_only=True)
class Evolves(Checked):
    """The keys of `evolve` in every world.

    genome: whose weights all individuals are given, so that only the rule is evolved; None for weights that evolve.
    start: the champion at whose genes evolution begins; None for random ones. algorithm: the optimizer, of `optimizer`
    and `ga`. schedule: how long it goes on. plan: what is evolved.
    """

    genome: str | None = None
    start: str | None = None
    ga: GA | None = field(default_factory=GA)  # None if the optimizer is another
    optimizer: dict[str, Any] = field(default_factory=lambda: {"algorithm": GA.key})

    def plan_search(self, training: Training, lifetime: Lifetime) -> None:
        """Make the optimizer, and what it evolves."""
        if self.rule.control is not Control.none or self.rule.sign_draw:
            given = f"hebbian.control={self.rule.control.name} and hebbian.sign_draw={self.rule.sign_draw}"
            raise ValueError(f"{given} are for evaluate; in evolution there are none and 0: the seed draws the signs")
        self.algorithm = build.make_optimizer(self.optimizer, self.ga)
        self.schedule = self.algorithm.schedule(training, lifetime)
        self.plan = evolved_plan(self.network_made, self.rule, has_network=self.genome is not None)
        self.algorithm.check(self.plan)


@dataclass(kw_only=True)
class EvaluateConfig(Evaluates, WorldConfig):
    """All keys of `epuckhebb evaluate` in the maze.

    controllers: what comes of them, `hebbian` with `adaptation` (unless both are none), the same with its reward
    inverted if it receives one, and those of `compare`.
    """

    command: ClassVar[str] = "evaluate"
    adaptation: Adaptation = field(default_factory=Adaptation)

    def __post_init__(self) -> None:
        """Validate the settings."""
        super().__post_init__()
        self.adaptation = build.resolve_signal(self.adaptation)
        self.use(self.rule, self.hebbian.get("name"))

    def use(self, rule: Rule, called: str | None = None) -> None:
        """Let controllers learn by a rule. called: its name in tables; that of its class unless given."""
        self.rule, main = rule, build.make_controller(rule, self.adaptation, called)
        self.controllers = self.compared(main, build.add_controls(main, self.world.task), self.scenario.paper_N)
        for controller in self.controllers:
            controller.check(self.world, self.lifetime.duration_s, self.wiring)


@dataclass(kw_only=True)
class EvolveConfig(Evolves, WorldConfig):
    """All keys of `epuckhebb evolve` in the maze.

    controller: what drives the robots besides their genes. controllers: the same, and the GA if the rule is to be
    switched off.
    """

    command: ClassVar[str] = "evolve"
    training: Training = field(default_factory=Training)

    def __post_init__(self) -> None:
        """Validate the settings."""
        super().__post_init__()
        if self.scenario.hand is not None:
            raise ValueError(f"scenario.hand={self.scenario.hand} is for `epuckhebb evaluate`; evolve takes changes")
        self.use(self.rule, self.hebbian.get("name"))

    def use(self, rule: Rule, called: str | None = None) -> None:
        """Let controllers learn by a rule. called: its name in tables; that of its class unless given."""
        self.rule, self.controller = rule, build.make_controller(rule, Adaptation(), called)
        self.controller.check(self.world, self.lifetime.duration_s, self.wiring)
        self.controllers = [self.controller, *[GA_ALONE] * self.training.rule_off]
        if self.rule.carries_history:
            raise ValueError("hebbian.carries_history=true is for evaluate: in evolution no lifetime follows another")
        self.plan_search(self.training, self.lifetime)
        self.training.check(self.world, self.lifetime, self.schedule.loops)
        inherits = type(self.algorithm).inherit is not Algorithm.inherit
        evolves = self.rule.initial_weights is InitialWeights.evolved and self.genome is None
        for name, fits in (("lamarckian", evolves and inherits), ("rule_off", evolves)):
            if getattr(self.training, name) and (isinstance(self.rule, NoRule) or not fits):
                needs = (
                    "a rule whose initial weights evolve (hebbian=baldwin), no genome, and, if lamarckian, optimizer=ga"
                )
                raise ValueError(f"training.{name}=true needs {needs}; got hebbian.rule={self.hebbian.get('rule')}")


SCHEMAS: dict[str, Any] = {schema.command: schema for schema in (EvaluateConfig, EvolveConfig)}


def find_schema(command: str, values: Plain) -> Any:
    """The schema of the plain values of a run of `evolve` or `evaluate`: in the maze, or in an environment."""
    return SCHEMAS[f"{command}_environment" if "environment" in values else command]


def register(schema: type[Config]) -> type[Config]:
    """Take the schema of a command that is declared above this package: that of a study."""
    SCHEMAS[schema.command] = schema
    return schema


# Below these, the schema does not know the keys.
_GROUPS = ("hebbian", "compare", "change", "maze", "robot", "network", "optimizer", "task", "fitness", "physics")
_OWN = ("flock.own", "environment.options")  # what the user's classes get
OPEN = (*_GROUPS, "scenario.goals", *_OWN)


def structured(command: str) -> DictConfig:
    """The schema of a command, into which Hydra merges the files. Making one takes longer than composing."""
    node: DictConfig = OmegaConf.structured(SCHEMAS[command])
    for key in (*_GROUPS, *_OWN):
        if isinstance(part := OmegaConf.select(node, key), DictConfig):
            OmegaConf.set_struct(part, False)  # Hydra takes any key below them, without a +
    if command.startswith(EvolveConfig.command):
        node.ga = None  # until group ga is chosen, which other optimizers than the GA undo
    return node


def typed(cfg: DictConfig, schema: type[Config]) -> Config:
    """The composed configuration as plain dataclasses, checked."""
    with refusing(explain, (ValueError, OmegaConfBaseException)):
        config: Any = OmegaConf.to_object(cfg)
    assert isinstance(config, schema)
    config.composed = cfg
    return config


def make_config(values: Plain, schema: type[Config], source: str) -> Config:
    """The configuration of plain values, all names among them. source: where they come from, for messages."""
    with refusing(lambda error: f"{source} cannot be used: {explain(error)}", Exception):  # damaged ones may raise any
        cfg = OmegaConf.merge(_keys_of(cast(Any, schema)), literal(values) if "${" in str(values) else values)
        assert isinstance(cfg, DictConfig)
    return typed(cfg, schema)


def literal(value: Any) -> Any:
    """Plain values in which OmegaConf takes a `${` to the letter: nothing in them is left to be resolved."""
    if isinstance(value, str):
        return re.sub(r"(\\*)\$\{", lambda found: 2 * found[1] + "\\${", value)
    if isinstance(value, dict):
        return {key: literal(inner) for key, inner in value.items()}
    return [literal(inner) for inner in value] if isinstance(value, list) else value


def value_as_declared(key: str, value: Any, command: str) -> Any:
    """A value of a key of a command, of the type that the schema declares."""
    with refusing(explain, OmegaConfBaseException):
        one: Any = OmegaConf.merge(_key_alone(SCHEMAS[command], key), {key: value})
    return one[key]


_keys_of = functools.cache(OmegaConf.structured)  # the keys of a schema with their types; each job of a sweep has them


@functools.cache
def _key_alone(schema: type[Config], key: str) -> Any:
    """A key of a schema with its type, without the others, which a merge would copy for each job of a sweep."""
    alone: Any = make_dataclass("Alone", [(key, get_type_hints(schema)[key])])
    return OmegaConf.structured(alone)
