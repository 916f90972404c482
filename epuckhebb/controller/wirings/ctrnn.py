"""A continuous-time recurrent network (Beer 1995): each neuron receives all inputs and all neurons.

    tau y' = -y + sum w x      y: state of a neuron, tau: its time constant [s], w: weights, x: inputs and activations
    x = tanh(y + bias)         Beer's logistic function becomes tanh, because outputs turn wheels both ways

Euler's method takes the controller's steps, but no step is longer than tau: then y becomes the drive at once.

Beer, R. D. (1995). On the dynamics of small continuous-time recurrent neural networks. Adaptive Behavior 3, 469-509.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import product
from typing import Any, ClassVar

from epuckhebb.controller.evolved import Evolved
from epuckhebb.controller.network import tanh
from epuckhebb.controller.ranges import within
from epuckhebb.controller.wiring import Wiring


@dataclass(frozen=True, kw_only=True)
class CTRNN(Wiring):
    """A continuous-time recurrent network.

    hidden: neurons besides the outputs. tau_gain_rad_s: wheel gain at which time constants hold. At a lower
    gain the robot is slower, and its neurons, too, so that they remember the same way; 0 if they hold at any gain.
    """

    state: ClassVar = {"y": 0.0}
    evolved: ClassVar = {
        "tau": Evolved(per="neuron", value=lambda gene: 0.1 * 10 ** (gene / 2)),  # 32 to 316 ms
        "bias": Evolved(per="neuron"),
    }

    hidden: int = within(0, default=6)
    tau_gain_rad_s: float = within(0, default=4.0)

    @property
    def sizes(self) -> tuple[int, ...]:
        """One group: all neurons respond at once."""
        return (self.hidden + self.outputs,)

    def synapses(self, inputs: int) -> Iterable[tuple[int, int]]:
        """From each input and each neuron to each neuron."""
        neurons = range(inputs + 1, inputs + 1 + self.hidden + self.outputs)
        return product([*range(inputs), *neurons], neurons)

    def step_s(self, gain_rad_s: float, step_s: float) -> float:
        """How long a control step is to the neurons [s]: longer at a higher wheel gain, if tau holds at one gain."""
        return step_s * gain_rad_s / self.tau_gain_rad_s if self.tau_gain_rad_s else step_s

    @staticmethod
    def neuron(drive: float, state: Any, tau: float, bias: float, step_s: float) -> float:
        """The activation of a neuron."""
        state.y += min(1.0, step_s / tau) * (drive - state.y)
        return tanh(state.y + bias)
