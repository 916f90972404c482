"""The gate: how far a signal of change opens plasticity. In the paper the gate is always open, g = 1.

g = clip(slope (signal - threshold), 0, 1)      need for plasticity; 0 at the goal, and during rests
"""

from epuckhebb.sim.compiled import compiled


@compiled
def need(signal: float, threshold: float, slope: float) -> float:
    """The need g: 0 up to the threshold (and where the signal is nan), then growing with the slope up to 1."""
    if not signal > threshold:
        return 0.0
    return min(1.0, (signal - threshold) * slope)


@compiled
def resting(late_s: float, active_s: float, rest_s: float) -> bool:
    """Whether plasticity rests, after a signal that has lasted for `late_s`; during rests the genes are back."""
    return active_s > 0.0 and late_s % (active_s + rest_s) >= active_s
