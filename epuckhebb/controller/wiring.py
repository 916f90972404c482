"""A wiring: which neurons synapses join, what a neuron stores, what of it evolves, and how it responds.

Layers of tanh neurons, the paper's network, have no wiring (`network`). `forward_pass` makes machine code of one.
"""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.compiling.errors import PartError
from epuckhebb.controller.compiling.readonly import readonly
from epuckhebb.controller.evolved import Evolved
from epuckhebb.controller.own_class import OwnClass, stored
from epuckhebb.controller.ranges import within

MOST_SYNAPSES = 100_000  # more is surely a typing error
LAYERS = "mlp"  # what a network without a wiring is called
OF_NEURON = {  # the arguments that `neuron` may have besides its evolved parameters, and how the kernel has them
    "drive": "drive[j]",
    "before": "activation[j]",
    "number": "j - first",
    "state": "neurons.state[j - first]",
    "step_s": "neurons.step_s",
    "by": "by",
}
_PER = ("network", "neuron")


class Neurons(NamedTuple):
    """What the neurons of a wiring have. state: (neurons,) records, what each stores, which changes in a lifetime.

    parameters: (names, neurons), the evolved ones. numbers: the settings. step_s: how long a substep is for them [s].
    """

    state: NDArray[np.void]
    parameters: Floats
    numbers: tuple[float, ...] = ()
    step_s: float = 0.0


NO_NEURONS = Neurons(np.zeros(0, [("nothing", np.float64)]), np.zeros((0, 0)))  # of layers


@dataclass(frozen=True, kw_only=True)
class Wiring(OwnClass):
    """Neurons and the synapses that join them; subclasses add settings as fields, and a static method `neuron`.

    outputs: how many outputs the network has; by default two, the wheels. substeps: how many times it runs in a control
    step, with the same inputs; rules have an update for each substep. sizes: how many neurons each group has. In a
    substep, all neurons of a group receive their drives, and then respond. The groups take turns. The last neurons of
    the last group are the network's outputs.
    `synapses` joins neurons. `neuron`, compiled by numba, gives the activation of a neuron; outputs are clipped to -1
    and 1. Its arguments are any of these names, in any order:

        drive        the sum over its synapses of weight times presynaptic activation
        before       its activation in the substep before; 0 at first
        number       of this neuron, from 0
        state        the numbers named in the class attribute `state`, to be read and set
        step_s       how long a substep is for the neurons, s
        by           the settings
        (a name in `evolved`: that parameter of this neuron)

    state: name -> initial value, of what each neuron stores during a lifetime. evolved: name -> `Evolved`, one for the
    `network` or one for each `neuron`. spikes: whether all neurons but the outputs give 1 for a spike and else 0.
    """

    PART: ClassVar[str] = "wiring"
    KEY: ClassVar[str] = "network.wiring"
    METHODS: ClassVar[tuple[str, ...]] = ("neuron",)
    state: ClassVar[Mapping[str, float]] = {}
    evolved: ClassVar[Mapping[str, Evolved]] = {}
    neuron: ClassVar[Callable[..., float] | None] = None

    spikes: ClassVar[bool] = False

    outputs: int = within(1, default=2)
    substeps: int = within(1, 1000, default=1)

    @property
    def sizes(self) -> tuple[int, ...]:
        """How many neurons each group has; a subclass defines it."""
        raise TypeError("a wiring needs `sizes`")

    def synapses(self, inputs: int) -> Iterable[tuple[int, int]]:  # noqa: ARG002  # others need it
        """The presynaptic and the postsynaptic neuron of each synapse, in the order of the genes.

        Inputs are numbered from 0. The constant 1 is number `inputs`, and the neurons follow.
        """
        raise TypeError("a wiring needs a method `synapses`")

    def step_s(self, gain_rad_s: float, step_s: float) -> float:  # noqa: ARG002  # others need it
        """How long a control step of `step_s` [s] is for the neurons [s] at a wheel gain [rad/s]."""
        return step_s

    @classmethod
    def allowed_arguments(cls, method: str) -> Collection[str]:  # noqa: ARG003  # it has one
        """The names of the arguments that a method may have; none where they are fixed."""
        return [*OF_NEURON, *cls.evolved]

    @classmethod
    def check_class(cls) -> None:
        """Check its method `neuron`, and what it evolves; else a ValueError."""
        super().check_class()
        what = cls.what()
        for name, evolved in cls.evolved.items():
            if evolved.per not in _PER:
                raise ValueError(f"{what}: {name} must be Evolved(per=...), one of {', '.join(_PER)}, got {evolved}")
            if name in OF_NEURON:
                raise ValueError(f"{what}: an evolved parameter cannot be called {name}, which means something else")

    def parameter_sizes(self) -> dict[str, int]:
        """How many genes each evolved parameter takes."""
        per = dict(zip(_PER, (1, sum(self.sizes)), strict=True))
        return {name: per[str(evolved.per)] for name, evolved in self.evolved.items()}

    def initial(self, genes: Mapping[str, Floats], gain_rad_s: float, step_s: float) -> Neurons:
        """The neurons before the first step. genes: of each evolved parameter, by name."""
        count = sum(self.sizes)
        parameters = np.empty((len(self.evolved), count))
        for row, (name, evolved) in zip(parameters, self.evolved.items(), strict=True):
            value = genes[name] if evolved.value is None else np.asarray(evolved.value(readonly(genes[name])))
            if value.shape not in (genes[name].shape, ()) or not np.isfinite(value).all():
                needed = f"`value` of {name} must give {genes[name].size} finite numbers"
                raise PartError(f"wiring {self.name}: {needed}, got {value}")
            row[:] = value
        substep_s = float(self.step_s(gain_rad_s, step_s)) / self.substeps
        return Neurons(stored(self.state, count), parameters, self.numbers(), substep_s)

    def joined(self, inputs: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """The presynaptic and the postsynaptic neuron of each synapse, (synapses,) each."""
        end = inputs + 1 + sum(self.sizes)
        pairs = [tuple(pair) for pair in islice(self.synapses(inputs), MOST_SYNAPSES + 1)]
        for pair in pairs:
            if len(pair) != 2 or not all(isinstance(number, int | np.integer) for number in pair):
                raise ValueError(f"wiring {self.name}: a synapse must be two whole numbers, (pre, post), got {pair}")
            if not (0 <= pair[0] < end and inputs < pair[1] < end):
                ends = f"one of 0 to {end - 1} with one of {inputs + 1} to {end - 1}"
                raise ValueError(f"wiring {self.name}: synapse {pair} must join {ends}")
        if not pairs:
            raise ValueError(f"wiring {self.name}: `synapses` gives none")
        pre, post = np.array(pairs, np.int64).T
        return np.ascontiguousarray(pre), np.ascontiguousarray(post)


def find_blocks(pre: NDArray[np.int64], post: NDArray[np.int64], begins: Sequence[int]) -> list[tuple[int, ...]]:
    """The blocks of a list of synapses, in its order, where all of one row of neurons meet all of another.

    Each is its first presynaptic and postsynaptic neuron, first synapse, and how many rows and columns it has. begins:
    the first neuron of each group; no block lies in two.
    """
    blocks: list[tuple[int, ...]] = []
    first, count = 0, len(pre)
    while first < count:
        wide = 1
        while (
            first + wide < count
            and pre[first + wide] == pre[first]
            and post[first + wide] == post[first] + wide
            and post[first + wide] not in begins
        ):
            wide += 1
        row, high = np.arange(wide) + post[first], 1
        while True:
            part = slice(first + high * wide, first + (high + 1) * wide)
            if not (np.array_equal(post[part], row) and (pre[part] == pre[first] + high).all()):
                break
            high += 1
        blocks.append((int(pre[first]), int(post[first]), first, high, wide))
        first += high * wide
    return blocks


def recorded_wiring(name: str, sizes: Sequence[int], pairs: Iterable[Sequence[int]]) -> Wiring:
    """What stands for a wiring where a champion or a recorded run is read: its name and synapses; it cannot run."""
    joined = [(int(pre), int(post)) for pre, post in pairs]
    kind: Any = type(name, (Wiring,), {"sizes": tuple(sizes), "synapses": lambda _, __: joined})
    wiring: Wiring = kind()
    return wiring
