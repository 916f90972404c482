"""Couplings that never change: all robots count alike."""

from dataclasses import dataclass

from epuckhebb.flock.coupling import Coupling


@dataclass(frozen=True, kw_only=True)
class Frozen(Coupling):
    """Every weight stays 1."""
