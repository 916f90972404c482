"""The maze as a world: which lifetimes run there, which champions can, what is written of them."""

from collections.abc import Collection, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

from epuckhebb.adaptation.nominal import Nominal, measure_nominal
from epuckhebb.analysis.evaluate import Traces, evaluate
from epuckhebb.analysis.paper_table import PaperTable, saturation
from epuckhebb.analysis.tables import Rows, plain
from epuckhebb.config import EvaluateConfig, EvolveConfig, hand, training_world
from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.network import Network
from epuckhebb.controller.plasticity.control import MOST_KEPT, Control
from epuckhebb.controller.wiring import LAYERS, Wiring
from epuckhebb.evolution.evolve import MazeEvaluator
from epuckhebb.runs.notes import evaluation_notes, unusual_values
from epuckhebb.runtime import ConfigError, compiling
from epuckhebb.store import Genome, as_npz, traces_arrays
from epuckhebb.tmaze.batch import load_kernel
from epuckhebb.tmaze.block import LostRobotError
from epuckhebb.tmaze.individual import GA_ALONE, Controller, has_control
from epuckhebb.tmaze.own_fitness import OF_OUTCOME
from epuckhebb.tmaze.own_sensor import reading_names
from epuckhebb.tmaze.physics.pymunk import PYMUNK
from epuckhebb.tmaze.robot import STEP_S
from epuckhebb.tmaze.scenario import Scenario
from epuckhebb.tmaze.tasks.trial import ONE_TRIAL
from epuckhebb.worlds.world import Figures, World, Write

if TYPE_CHECKING:

    class _Settings(EvaluateConfig, EvolveConfig):
        """The settings of both commands, of which a run has those of one."""


@dataclass(frozen=True)
class Maze(World):
    """The maze of a run of `evaluate` or `evolve`. config: its settings."""

    measures: ClassVar[Collection[str]] = OF_OUTCOME
    config: "_Settings"

    @property
    def identity(self) -> tuple[Any, ...]:
        """The scenario, and the lifetime but for what is recorded."""
        return self.config.world, replace(self.config.lifetime, record_every=0)

    def facts(self, moments: Any) -> Mapping[str, Any]:  # noqa: ARG002  # environments have some
        """Robot, sensors, task, fitness, physics, and how the worlds of training varied."""
        config, world = self.config, self.config.world
        return {
            "robot": world.robot.name,
            "lights": world.robot.light.count,
            "experiment": world.experiment,
            "training": config.training.name,
            "task": "" if world.task == ONE_TRIAL else world.task.name,
            "fitness_function": world.fitness.name if world.fitness.is_custom else "",
            "sensors": reading_names(world.robot.sensors),
            "physics": "" if world.physics.name == PYMUNK.name else world.physics.name,
        }

    def champion_settings(self, genome: Genome) -> Any:  # noqa: ARG002  # environments need it
        """The settings, which leave nothing to a champion."""
        return self.config

    def check_genome(self, genome: Genome) -> None:
        """Refuse a champion of an environment, another task, wiring or robot, or of a robot with other sensors.

        So are yoked controls whose masters would fill the memory.
        """
        config, world, shape = self.config, self.config.world, self.config.shape
        if genome.environment:
            raise ConfigError(
                f"genome={genome.name} was evolved in environment={genome.environment}, and this is the maze"
            )
        task, robot, sensors = world.task, world.robot, reading_names(world.robot.sensors)
        if genome.network.rewarded != task.gives_reward:
            evolved = f"was evolved with task={genome.task or ONE_TRIAL.name}"
            raise ConfigError(f"genome={genome.name} {evolved}, got task={task.name}, with another reward as input")
        has_others = bool(genome.optimizer) and genome.sensors != sensors
        asked = shape.name if isinstance(shape, Wiring) else LAYERS
        if genome.wiring != asked:
            raise ConfigError(f"genome={genome.name} is for network.wiring={genome.wiring}, got network.wiring={asked}")
        lights = robot.light.count
        is_of_another = genome.robot not in ("", robot.name) or (genome.robot and genome.lights != lights)
        if is_of_another or genome.network.inputs != world.inputs or has_others:
            own = genome.sensors or "none"
            evolved = (
                f"robot={genome.robot or 'any'}, {genome.lights} lights, own sensors {own} and layers {genome.network}"
            )
            given = f"robot={robot.name}, {lights} lights, own sensors {sensors or 'none'} and {robot.inputs} readings"
            raise ConfigError(f"genome={genome.name} is for {evolved}, got {given}")
        most = MOST_KEPT // genome.network.synapses
        for controller in config.controllers:
            rule = controller.rule
            if rule.control is not Control.none and config.lifetime.steps > most:
                needs = f"keeps all weights, and needs lifetime.duration_s of at most {most * STEP_S:g}"
                given = f"got {config.lifetime.duration_s:g}"
                raise ConfigError(f"hebbian.control={rule.control.name} of {controller.name} {needs}; {given}")

    def notes(self, genome: Genome | None = None) -> list[str]:
        """What a champion shows as a showcase, and how the world of its evolution differs."""
        return unusual_values(self.config) if genome is None else evaluation_notes(genome, self.config)

    def compile(self, network: Network) -> None:
        """Load or compile the kernels of the controllers."""
        compile_kernels(self.config.controllers, network, self.config.world)

    def nominal(self, genome: Genome, threads: int) -> Nominal | None:
        """Nominal statistics from the champion's file, or measured; None where no adaptation needs them."""
        config = self.config
        adaptations = [controller.adaptation for controller in config.controllers]
        if not any(one.acts for one in adaptations):
            return None
        experiment, known = config.world.experiment, genome.nominal
        if known is not None and known.experiment != experiment:
            memory = f"remembers {known.scenario}, of the {known.experiment} experiment"
            raise ConfigError(f"genome={genome.name} {memory}; give a champion of {experiment}, or adaptation=none")
        gain = config.lifetime.gain_rad_s
        if known is not None and (known.gain_rad_s == gain or not any(one.is_gated for one in adaptations)):
            return known
        world = training_world(config, genome.physics)
        return measure_nominal(genome.network_genes, world, gain, threads, genome.network)

    def nominal_of_training(self, weights: Floats, network: Network, threads: int) -> Nominal | None:
        """Nominal statistics; None of many trials, which have not one goal."""
        world = self.config.world
        return None if world.task.has_trials else measure_nominal(weights, world, threads=threads, network=network)

    def run(self, genome: Genome, nominal: Nominal | None, threads: int, *, record: bool = True) -> tuple[Rows, Traces]:
        """Run the lifetimes: a row each, and the traces of those that were recorded."""
        config = self.config
        return evaluate(
            genome.genes,
            config.world,
            config.controllers,
            config.lifetime if record else replace(config.lifetime, record_every=0),
            nominal,
            repeats=config.repeats,
            seed=config.seed,
            threads=threads,
            name=genome.name,
            changed=config.changed or "",
            network=genome.network,
            plan=genome.plan,
            evolved_signs=genome.signs,
        )

    def write(self, write: Write, genome: Genome, rows: Rows, recorded: Traces) -> Figures:
        """Write the changes by hand, the traces, and the paper's table, or that of a task of many trials."""
        config, figures = self.config, Figures()
        if config.scenario.hand is not None:
            write(hand.NAME, hand.content(config.scenario.hand))
        if config.lifetime.record_every:
            write("traces.npz", as_npz(traces_arrays(recorded, genome.weights, genome.network)))
            figures["trajectories"] = (recorded,)
        if config.world.task.has_trials:
            import pandas as pd  # takes a while to load

            from epuckhebb.analysis import reversal

            trials = pd.DataFrame(recorded.trials)
            shares = reversal.table(pd.DataFrame(rows), trials, config.world.task, config.seed)
            write("reversal_trials.csv", trials)
            write("reversal.csv", shares)
            write("reversal.md", reversal.readable(shares).markdown())
            return {**figures, "reversal": (shares, trials)}
        table, below = PaperTable.from_rows(rows), [*map(plain, self.notes(genome)), saturation(rows)]
        write("table.csv", table.rows)
        write("table.md", "\n".join([table.markdown(), *(f"{note}\n" for note in below if note)]))
        return figures

    def check_recorded(self) -> None:
        """Refuse to show what was not recorded; a ConfigError."""
        if not self.config.lifetime.record_every:
            raise ConfigError("nothing was recorded with lifetime.record_every=0; give lifetime={'record_every': 8}")

    def table(self, rows: Rows, recorded: Traces) -> Any:
        """The paper's table: a row for each metric, a column for each controller and side; means over the repeats.

        Of reversal learning, a row for each controller.
        """
        import pandas as pd

        task = self.config.world.task
        if task.has_trials:
            from epuckhebb.analysis import reversal

            trials = pd.DataFrame(recorded.trials)
            return reversal.table(pd.DataFrame(rows), trials, task, self.config.seed).set_index("controller")
        means = pd.DataFrame(PaperTable.from_rows(rows).means)
        return means.rename_axis("metric").rename_axis(["controller", "side"], axis=1)

    def arrays(self, genome: Genome, recorded: Traces) -> dict[str, Any]:
        """The arrays of `traces.npz`: those of the first repeat."""
        return traces_arrays(recorded, genome.weights, genome.network)

    @cached_property
    def origin(self) -> Scenario | None:
        """The training world of the experiment, if training comes back to it; a ConfigError if it is this world."""
        config, world = self.config, self.config.world
        if not config.training.returns:
            return None
        origin = replace(training_world(config, world.physics.name), task=world.task, fitness=world.fitness)
        if replace(origin, name=world.name) == world:
            needed = "another world than that of training, as scenario=lowlight or change=[slip_left]"
            raise ConfigError(f"training.season and training.rehearsal need {needed}, got scenario={world.name}")
        return origin

    def evaluator(self, network: Network, threads: int) -> MazeEvaluator:
        """What runs the lifetimes of an evolution, on both sides."""
        config = self.config
        return MazeEvaluator(
            config.algorithm,
            config.world,
            config.lifetime,
            config.training,
            config.seed,
            network,
            config.controller,
            threads,
            self.origin,
        )


def compile_kernels(controllers: Sequence[Controller], network: Network, world: Scenario) -> None:
    """Load or compile what lifetimes with these controllers need."""
    with compiling():
        for controller in controllers or [GA_ALONE]:
            with suppress(LostRobotError):  # one step of a network of zeros says nothing about a genome
                load_kernel(controller, network, world, weight_path=has_control(controllers))
