"""The paper's task: a lifetime is one trial. Lamp on, go right; lamp off, go left."""

from dataclasses import dataclass

from epuckhebb.tmaze.task import Task


@dataclass(frozen=True, kw_only=True)
class OneTrial(Task):
    """The paper's task, which has no settings."""


ONE_TRIAL = OneTrial()
