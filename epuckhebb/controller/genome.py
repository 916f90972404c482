"""A genome in named parts: the weights of the network, the parameters of its neurons, those of a plasticity rule."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.network import Network
from epuckhebb.controller.plasticity.rule import NoRule, Rule, evolvable_parameters, evolved_sizes

WEIGHTS = "weights"
NEURON = "neuron."  # before the names of the parameters of neurons, in a wiring


@dataclass(frozen=True)
class Part:
    """Genes of one meaning.

    name: `weights`, or that of a parameter of the neurons or of a rule. size: number of genes. start: in the first
    generation they are uniform in +-start. limit: they are clipped to +-limit; None for the optimizer's
    (`ga.gene_limit`).
    """

    name: str
    size: int
    start: float = 1.0
    limit: float | None = None


@dataclass(frozen=True)
class GenomePlan:
    """The parts of a genome, in the order of its genes."""

    parts: tuple[Part, ...]

    @cached_property
    def genes(self) -> int:
        """The number of genes; 234 in the paper."""
        return sum(part.size for part in self.parts)

    def split(self, genes: Floats) -> dict[str, Floats]:
        """The genes of each part, by name; (..., size) of (..., genes)."""
        if genes.shape[-1] != self.genes:
            raise ValueError(f"a genome of {self.text()} has {self.genes} genes, got {genes.shape[-1]}")
        parts, first = {}, 0
        for part in self.parts:
            parts[part.name] = genes[..., first : first + part.size]
            first += part.size
        return parts

    def pick(self, genes: Floats, target: "GenomePlan") -> Floats:
        """The genes of another plan's parts, in its order."""
        parts = self.split(genes)
        for part in target.parts:
            if part.name not in parts or parts[part.name].shape[-1] != part.size:
                raise ValueError(f"the genome has {self.text()}; needed are {target.text()}")
        return np.concatenate([parts[part.name] for part in target.parts], axis=-1)

    @property
    def rule_parts(self) -> "GenomePlan":
        """The parts that are parameters of a rule: all but those of the network."""
        return GenomePlan(tuple(part for part in self.parts if part not in self.network_parts.parts))

    @property
    def network_parts(self) -> "GenomePlan":
        """The parts that are the network: its weights, and the parameters of its neurons."""
        parts = (part for part in self.parts if part.name == WEIGHTS or part.name.startswith(NEURON))
        return GenomePlan(tuple(parts))

    def text(self) -> str:
        """The parts in words, for example "234 weights"."""
        return ", ".join(f"{part.size} {part.name}" for part in self.parts)


def make_plan(network: Network, rule: type[Rule] = NoRule) -> GenomePlan:
    """The genome of a network, and of a rule whose parameters are evolved."""
    parts, evolved = [Part(WEIGHTS, network.synapses)], evolvable_parameters(rule, network)
    if network.wiring is not None:
        for name, size in network.wiring.parameter_sizes().items():
            parameter = network.wiring.evolved[name]
            parts.append(Part(NEURON + name, size, parameter.start, parameter.limit))
    for name, size in evolved_sizes(rule, network).items():
        parts.append(Part(name, size, evolved[name].start, evolved[name].limit))
    return GenomePlan(tuple(parts))
