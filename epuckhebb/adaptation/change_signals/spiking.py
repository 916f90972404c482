"""Spiking: a neuron that fires while the sensor readings are unlike those of its training world. It uses the senses.

    tau v' = -v + novelty    spike and v = 0, if v >= threshold: up to that novelty the neuron is silent
    rate'  = running mean of the spikes per second, which is the signal

The paper wishes for a detector of change that depends on spikes. This is the least of its kind: one leaky
integrate-and-fire neuron, as in `epuckhebb.controller.wirings.lif`, on the distance that the signal `novelty` is.
"""

from dataclasses import dataclass
from typing import Any, ClassVar

from epuckhebb.adaptation.change_signal import RECENT_S, ChangeSignal, NominalOfSide
from epuckhebb.adaptation.change_signals.novelty import distance
from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.network import decayed
from epuckhebb.tmaze.robot import STEP_S

TAU_S = 0.5
THRESHOLD = 2.0  # spreads; as in adaptation=novelty


@dataclass(frozen=True, kw_only=True)
class Spiking(ChangeSignal):
    """Spikes per second of a neuron that is driven by novelty."""

    state: ClassVar = {"v": 0.0, "rate": 0.0}

    @staticmethod
    def signal(readings: Floats, nominal: NominalOfSide, state: Any) -> float:
        """Move the potential and the rate."""
        drive = distance(readings, nominal)
        state.v = drive + decayed(state.v - drive, STEP_S, TAU_S)
        spikes = 0.0
        if state.v >= THRESHOLD:
            state.v, spikes = 0.0, 1.0
        state.rate = decayed(state.rate, STEP_S, RECENT_S) + spikes / RECENT_S
        return float(state.rate)
