"""What random actions show of an environment: whether lifetimes can be repeated, whether changes act, what is read."""

import hashlib
import itertools
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.random import Stream, rng
from epuckhebb.worlds.changes import AT
from epuckhebb.worlds.spaces import RUNNING, Reader, text_places, unbounded

if TYPE_CHECKING:
    from epuckhebb.worlds.environment import World

STEPS = 200  # of a trial
_APART = 1000  # between the seeds of the episodes of a trial
_AT_END, _STILL = 0.999, 0.01  # size of a reading at its end, and the range of one that never moves
_LISTED = 8  # readings in a note
_TYPED = 40  # readings whose scales somebody may type


class Findings(NamedTuple):
    """needs_fresh: whether each lifetime needs an environment made for it. notes: what a reader must know."""

    needs_fresh: bool
    notes: tuple[str, ...]


class _Seen(NamedTuple):
    """What a trial showed: a digest of all readings and rewards, and the ends of each reading and observation."""

    digest: bytes
    low: Floats
    high: Floats
    largest: Floats


def _seen(world: "World", env: Any, seed: int, changes: Sequence[Mapping[str, Any]] = ()) -> _Seen:
    """Take `STEPS` random steps, of as many episodes as they last, each with these changes at its start."""
    outputs = rng(seed, Stream.environment_check).uniform(-1.0, 1.0, (STEPS, world.outputs))
    digest, done = hashlib.sha256(), 0
    low, high, largest = np.full(world.inputs, np.inf), np.full(world.inputs, -np.inf), np.zeros(world.inputs)

    def act(step: int, readings: Floats, _reward: float, observation: Any) -> Floats:
        digest.update(readings.tobytes())
        np.minimum(low, readings, out=low)
        np.maximum(high, readings, out=high)
        values = world.read.values(observation)
        np.maximum(largest[: len(values)], np.abs(values), out=largest[: len(values)])
        return np.asarray(outputs[done + step])

    for episode in itertools.count():
        rewards = world.episode(env, act, seed + _APART * episode, STEPS - done, changes)
        digest.update(rewards.tobytes())
        done += len(rewards)
        if done >= STEPS:
            break
    return _Seen(digest.digest(), low, high, largest)


@contextmanager
def _made(world: "World") -> Iterator[Any]:
    env = world.make()
    try:
        yield env
    finally:
        env.close()


def _fresh(world: "World", seed: int, changes: Sequence[Mapping[str, Any]] = ()) -> _Seen:
    with _made(world) as env:
        return _seen(world, env, seed, changes)


def try_world(world: "World") -> Findings:
    """Try a world with random actions.

    The same seed must give the same before and after another lifetime, and in an environment made anew. Each change
    must make a difference to what came before it.

    Raises:
        PartError: the environment, or a function of the user's, failed.
    """
    with _made(world) as env:
        first, second, again = (_seen(world, env, seed) for seed in (0, 1, 0))
    needs_fresh = first.digest != again.digest or second.digest != _fresh(world, 1).digest
    can_repeat = not needs_fresh or first.digest == _fresh(world, 0).digest
    notes = [*_texts(world), *_actions(world)]
    notes += _readings(world.read, first, second) if world.settings.scale != RUNNING else []
    if not can_repeat:
        notes.append("The same seed gives another lifetime each time: results cannot be repeated or compared in pairs.")
    elif needs_fresh:
        began = time.perf_counter()
        with _made(world):
            cost = time.perf_counter() - began
        notes.append(f"Resets leave traces of the lifetime before: each gets a new environment, made in {cost:.2g} s.")
    notes += _changes(world, first) if can_repeat else []
    if world.changes and not can_repeat:
        notes.append("Whether changes act cannot be tested: two environments without them differ.")
    return Findings(needs_fresh, tuple(f"environment {world.name}: {note}" for note in notes))


def _changes(world: "World", last: _Seen) -> list[str]:
    """A note for each change that makes no difference to those before it."""
    notes, done = list[str](), list[dict[str, Any]]()
    for change in world.changes:
        for name, value in change.items():
            if name == AT:
                continue
            done.append({AT: 0, name: value})
            seen = _fresh(world, 0, done)
            if seen.digest == last.digest:
                notes.append(f"{name}={value} at {change[AT]} changes nothing in {STEPS} random steps.")
            last = seen
    return notes


def _texts(world: "World") -> list[str]:
    """A note on texts, which no controller reads."""
    places = text_places(world.observations)
    return [f"Texts of observations are left out: {', '.join(places)}."] if places else []


def _listed(names: Sequence[str], places: NDArray[np.intp], largest: Floats) -> str:
    each = [f"{names[number]} (largest {largest[number]:.3g})" for number in places[:_LISTED]]
    return ", ".join(each) + (f" and {len(places) - _LISTED} more" if len(places) > _LISTED else "")


def _readings(read: Reader, *seen: _Seen) -> list[str]:
    """A note on readings of a Box that tell a controller nothing."""
    low = np.min([trial.low for trial in seen], axis=0)
    high = np.max([trial.high for trial in seen], axis=0)
    largest = np.max([trial.largest for trial in seen], axis=0)
    is_at_end = read.is_measured & ((low >= _AT_END) | (high <= -_AT_END))
    is_still = read.is_measured & ~is_at_end & (high - low < _STILL)
    groups = {"are 1 or -1": is_at_end, "never move": is_still}
    places = {
        what: _listed(read.names, np.flatnonzero(those), largest) for what, those in groups.items() if those.any()
    }
    texts = [f"readings {those} {what}" for what, those in places.items()]
    is_told, hint = is_at_end | (is_still & (high > low)), ""  # no scale moves a reading that is always the same
    scale = ",".join(f"{value:.3g}" for value in np.where(is_told, largest, read.scale))
    if is_told.any():
        hint = f"; try environment.scale={RUNNING}"
        hint += f", or [{scale}]" if len(low) <= _TYPED else ""
    return [f"With random actions, {' and '.join(texts)}{hint}."] if texts else []


def _actions(world: "World") -> list[str]:
    """A note on actions without bounds."""
    places = unbounded(world.actions)
    return [f"Actions {', '.join(map(str, places))} have no bounds, and get outputs from -1 to 1."] if places else []
