"""Spiking: a neuron that fires while the sensor readings are unlike those of its training world; its spikes a second.

    tau v' = -v + novelty    v = 0 and a spike, if v >= threshold: up to that novelty the neuron is silent

The paper wishes for a detector of change that depends on spikes. This is the least of its kind.
"""

from dataclasses import dataclass
from typing import Any, ClassVar

from epuckhebb.adaptation.change_signal import RECENT_S, ChangeSignal, NominalOfSide
from epuckhebb.adaptation.change_signals.novelty import Novelty
from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.compiling.kernel import compiled
from epuckhebb.controller.network import decayed
from epuckhebb.tmaze.robot import STEP_S

TAU_S, THRESHOLD = 0.5, 2.0  # s, spreads; the threshold is that of adaptation=novelty
_novelty = compiled(Novelty.signal)


@dataclass(frozen=True, kw_only=True)
class Spiking(ChangeSignal):
    """Spikes per second of a neuron that is driven by novelty."""

    state: ClassVar = {"v": 0.0, "rate": 0.0}

    @staticmethod
    def signal(readings: Floats, nominal: NominalOfSide, state: Any) -> float:
        """Move the potential and the running mean of the rate."""
        drive = _novelty(readings, nominal)
        state.v = drive + decayed(state.v - drive, STEP_S, TAU_S)
        state.rate = decayed(state.rate, STEP_S, RECENT_S) + (state.v >= THRESHOLD) / RECENT_S
        state.v *= state.v < THRESHOLD
        return float(state.rate)
