"""The typed configuration: what keys there are, of which type, and what they may be. Values stand in `conf/`.

Parts that are dataclasses of the science (`GA`, `Lifetime`, `Lamp`, `Adaptation`) are the schema themselves; those
that a user can bring (a rule, a maze, a robot) are open here, and checked when they are made
(`epuckhebb.config.build`).
"""

import functools
from collections.abc import Sequence
from dataclasses import MISSING, Field, dataclass, field, fields, make_dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Self, TypeVar, cast

from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from epuckhebb.adaptation.adaptation import Adaptation
from epuckhebb.config import build
from epuckhebb.config.errors import explain
from epuckhebb.config.parts import Layers, make_part
from epuckhebb.config.values import NO_KEY, Plain, declared, default_values, make, plain_value
from epuckhebb.controller.genome import GenomePlan
from epuckhebb.controller.network import Network
from epuckhebb.controller.plasticity.control import Control
from epuckhebb.controller.plasticity.rule import InitialWeights, NoRule, Rule
from epuckhebb.controller.ranges import check, within
from epuckhebb.controller.wiring import LAYERS, Wiring
from epuckhebb.evolution.evolve import evolved_plan
from epuckhebb.evolution.optimizer import Algorithm, Schedule
from epuckhebb.evolution.optimizers.ga import GA
from epuckhebb.evolution.training import Training
from epuckhebb.runtime import ConfigError, refusing, yaml_file
from epuckhebb.tmaze.individual import GA_ALONE, Controller
from epuckhebb.tmaze.life import Lifetime
from epuckhebb.tmaze.own_fitness import IN_MAZE, PAPER_FITNESS
from epuckhebb.tmaze.physics.pymunk import PYMUNK
from epuckhebb.tmaze.scenario import Scenario
from epuckhebb.tmaze.tasks.trial import ONE_TRIAL

MOST_THREADS = 1024  # more than cores of any machine there is; a system may refuse to start more

Config = TypeVar("Config", bound="Checked")


class Checked:
    """What all configurations have in common."""

    command: ClassVar[str]
    seed: int

    @functools.cached_property
    def values(self) -> Plain:
        """All settings as plain values, not to be changed."""
        values: Plain = plain_value(self)
        return values


class Learns(Checked):
    """The plasticity rule of `evolve` and `evaluate`, and what else both have in every world.

    learns: a rule that was made in Python, in place of the one that `hebbian` describes.
    """

    hebbian: dict[str, Any]
    learns: Rule | None

    def take(self, rule: Rule) -> Self:
        """A copy of this configuration whose controllers learn by a rule that was made in Python."""
        changed: Self = replace(cast(Any, self), learns=rule)
        return changed

    @functools.cached_property
    def rule(self) -> Rule:
        """The rule of plasticity."""
        return build.make_rule(self.hebbian, "hebbian") if self.learns is None else self.learns

    @property
    def rule_name(self) -> str | None:
        """What tables call the rule; None for the name of its class."""
        return self.hebbian.get("name") if self.learns is None else None


def plain(cfg: DictConfig) -> Plain:
    """A composed configuration as plain values, every reference resolved; a ConfigError if one leads nowhere."""
    with refusing(explain, OmegaConfBaseException):
        return cast(Plain, OmegaConf.to_container(cfg, resolve=True))


def dump(config: Checked) -> str:
    """The YAML that a run folder keeps of a configuration: all of its settings, every reference resolved."""
    return yaml_file.dump(config.values)


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


Figures = Literal["png", "svg", "pdf", "none"]  # the files to which a run writes its figures


@dataclass(frozen=True, kw_only=True)
class WorldConfig(Learns):
    """The keys that `evaluate` and `evolve` have in common, and the world that comes of them.

    change: the changes of the world by name, each with the maze and the physics that it brings.
    """

    parallel: ClassVar[str] = "threads"  # the key that says how much runs at a time
    seed: int = within(0, default=1)
    threads: int = within(0, MOST_THREADS, default=0)
    figures: Figures = "png"
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
    learns: Rule | None = field(default=None, metadata=NO_KEY)

    def __post_init__(self) -> None:
        """Validate the settings."""
        check(self)
        self.world.fitness.check_world(IN_MAZE)
        _ = self.network_made, self.rule  # made now, so that what cannot be is refused
        self.world.check_lifetime(self.lifetime)

    @functools.cached_property
    def world(self) -> Scenario:
        """The scenario, with its maze and robot."""
        return build.make_scenario(self.scenario, self.maze, self.robot, self.task, self.fitness, self.physics)

    @functools.cached_property
    def shape(self) -> build.Shape:
        """The shape of the network; None if it was left open."""
        made = make_part("wiring", self.network, "network")
        return made.layers if isinstance(made, Layers) else cast(Wiring, made)

    @functools.cached_property
    def network_made(self) -> Network:
        """The network between the sensors and the wheels."""
        return build.make_network(self.world, self.shape)


@dataclass(frozen=True, kw_only=True)
class Evaluates(Learns):
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


@dataclass(frozen=True, kw_only=True)
class Evolves(Learns):
    """The keys of `evolve` in every world.

    genome: whose weights all individuals are given, so that only the rule is evolved; None for weights that evolve.
    start: the champion at whose genes evolution begins; None for random ones.
    """

    genome: str | None = None
    start: str | None = None
    ga: GA | None = field(default_factory=GA)  # None if the optimizer is another
    optimizer: dict[str, Any] = field(default_factory=lambda: {"algorithm": GA.key})

    @functools.cached_property
    def algorithm(self) -> Algorithm:
        """The optimizer, of `optimizer` and `ga`."""
        return build.make_optimizer(self.optimizer, self.ga)

    @functools.cached_property
    def schedule(self) -> Schedule:
        """How many generations there are, and how many lifetimes."""
        return self.algorithm.schedule(cast(Any, self).training, cast(Any, self).lifetime)

    @functools.cached_property
    def plan(self) -> GenomePlan:
        """What is evolved."""
        return evolved_plan(cast(Any, self).network_made, self.rule, has_network=self.genome is not None)

    def check_search(self) -> None:
        """Refuse an optimizer that cannot evolve the plan, and a rule that only an evaluation can have."""
        if self.rule.control is not Control.none or self.rule.sign_draw:
            given = f"hebbian.control={self.rule.control.name} and hebbian.sign_draw={self.rule.sign_draw}"
            raise ValueError(f"{given} are for evaluate; in evolution there are none and 0: the seed draws the signs")
        self.algorithm.check(self.plan)


@dataclass(frozen=True, kw_only=True)
class EvaluateConfig(Evaluates, WorldConfig):
    """All keys of `epuckhebb evaluate` in the maze.

    tested: controllers that were made in Python, in place of those of `hebbian`, `adaptation` and `compare`.
    """

    command: ClassVar[str] = "evaluate"
    adaptation: Adaptation = field(default_factory=Adaptation)
    tested: list[Controller] | None = field(default=None, metadata=NO_KEY)

    def __post_init__(self) -> None:
        """Validate the settings."""
        super().__post_init__()
        for controller in self.controllers:
            controller.check(self.world, self.lifetime.duration_s, self.network_made.wiring)

    @functools.cached_property
    def controllers(self) -> list[Controller]:
        """Those whose lifetimes run, besides the network alone.

        They are `hebbian` with `adaptation` (unless both are none), the same with its reward inverted if it receives
        one, and those of `compare`.
        """
        if self.tested is not None:
            return self.tested
        main = build.make_controller(self.rule, build.resolve_signal(self.adaptation), self.rule_name)
        return self.compared(main, build.add_controls(main, self.world.task), self.scenario.paper_N)


@dataclass(frozen=True, kw_only=True)
class EvolveConfig(Evolves, WorldConfig):
    """All keys of `epuckhebb evolve` in the maze."""

    command: ClassVar[str] = "evolve"
    training: Training = field(default_factory=Training)

    def __post_init__(self) -> None:
        """Validate the settings."""
        super().__post_init__()
        if self.scenario.hand is not None:
            raise ValueError(f"scenario.hand={self.scenario.hand} is for `epuckhebb evaluate`; evolve takes changes")
        self.controller.check(self.world, self.lifetime.duration_s, self.network_made.wiring)
        if self.rule.carries_history:
            raise ValueError("hebbian.carries_history=true is for evaluate: in evolution no lifetime follows another")
        self.check_search()
        self.training.check(self.world, self.lifetime, self.schedule.loops)
        inherits = type(self.algorithm).inherit is not Algorithm.inherit
        evolves = self.rule.initial_weights is InitialWeights.evolved and self.genome is None
        for name, fits in (("lamarckian", evolves and inherits), ("rule_off", evolves)):
            if getattr(self.training, name) and (isinstance(self.rule, NoRule) or not fits):
                needs = (
                    "a rule whose initial weights evolve (hebbian=baldwin), no genome, and, if lamarckian, optimizer=ga"
                )
                raise ValueError(f"training.{name}=true needs {needs}; got hebbian.rule={self.hebbian.get('rule')}")

    @functools.cached_property
    def controller(self) -> Controller:
        """What drives the robots besides their genes."""
        return build.make_controller(self.rule, Adaptation(), self.rule_name)

    @property
    def controllers(self) -> list[Controller]:
        """The controllers of an evolution: also the GA, if the rule is to be switched off."""
        return [self.controller, *[GA_ALONE] * self.training.rule_off]


SCHEMAS: dict[str, Any] = {schema.command: schema for schema in (EvaluateConfig, EvolveConfig)}


def find_schema(command: str, values: Plain) -> Any:
    """The schema of the plain values of a run of `evolve` or `evaluate`: in the maze, or in an environment."""
    return SCHEMAS[f"{command}_environment" if "environment" in values else command]


def register(schema: type[Config]) -> type[Config]:
    """Take the schema of a command that is declared above this package: that of a study."""
    SCHEMAS[schema.command] = schema
    return schema


def structured(command: str) -> DictConfig:
    """The defaults of a command, into which Hydra merges the files. It takes any key below them, without a +."""
    node = OmegaConf.create(default_values(SCHEMAS[command]))
    for part in node.values():
        if isinstance(part, DictConfig):
            OmegaConf.set_struct(part, False)
    if command.startswith(EvolveConfig.command):
        node.ga = None  # until group ga is chosen, which other optimizers than the GA undo
    return node


def typed(cfg: DictConfig, schema: type[Config]) -> Config:
    """The configuration that Hydra composed, checked."""
    return make_config(plain(cfg), schema)


def make_config(values: Plain, schema: type[Config], source: str = "") -> Config:
    """The configuration of plain values, all names among them. source: where they come from, for messages."""
    try:
        values = declared(schema, values)
    except ConfigError as error:
        raise ConfigError(f"{source} cannot be used: {error}" if source else str(error)) from error
    with refusing():
        config: Config = make(schema, values)
    return config
