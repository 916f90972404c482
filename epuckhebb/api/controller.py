"""A controller for any loop, of numbers or of a run."""

from pathlib import Path

from numpy.typing import ArrayLike

from epuckhebb.config import find_schema, make_config, settings
from epuckhebb.controller import controller
from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.network import PAPER_NETWORK, Network
from epuckhebb.controller.plasticity.rule import NO_RULE, Rule
from epuckhebb.runtime import ConfigError
from epuckhebb.store import CONFIG, load_genome, resolve_run
from epuckhebb.tmaze.robot import STEP_S


class Controller(controller.Controller):
    """A genome with its network and rule, as an object: `act(readings)` gives the outputs, and learns.

    genes: (genes,) of all parts of the genome, weights first; or where an evolution is, a run folder or `latest`: then
    network, rule, signs and length of a step are those of the run, unless they are given. rate: N of the rule, which
    may be set at any time; 0 freezes the weights. weights: (synapses,), the present ones. weight_change: the present
    sum of |W - W_gene|.

    signs: (synapses,) of the updates; by default those of the rule, shuffled ones the same for all genes. step_s:
    length of a step [s], for rules and neurons that have time constants; .032, that of the maze, by default.

    Raises:
        ValueError: there is no evolution, or genes, network and rule do not fit, or the rule has a yoked control.
    """

    def __init__(
        self,
        genes: ArrayLike | str | Path,
        network: Network | None = None,
        rule: Rule | None = None,
        *,
        signs: Floats | None = None,
        step_s: float | None = None,
    ) -> None:
        if isinstance(genes, str | Path):
            path = resolve_run(genes, "evolve")
            if not (path / CONFIG).is_file():
                raise ConfigError(f"Controller({str(genes)!r}): there is no run folder of an evolution")
            values = settings(path / CONFIG)
            config, genome = make_config(values, find_schema("evolve", values), str(path)), load_genome(str(path), "")
            genes, network, rule = genome.genes, network or genome.network, rule or config.rule
            signs = genome.signs if signs is None else signs
            if step_s is None and "environment" in values:
                step_s = config.environment.step_s
        super().__init__(
            genes, network or PAPER_NETWORK, rule or NO_RULE, signs=signs, step_s=STEP_S if step_s is None else step_s
        )
