"""Runs a live world in real time or faster, makes the changes that pages ask for, and wakes the streams."""

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any

from epuckhebb.live.world import LiveWorld, Saved
from epuckhebb.runtime import ConfigError
from epuckhebb.tmaze.maze import SIDES
from epuckhebb.tmaze.robot import STEP_S

SPEEDS = (0.25, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 0.0)  # times real time; 0: as fast as it goes
FRAME_S = 1 / 30
_AT_MOST = 1000  # steps between two frames, as fast as it goes
_BEHIND_S = 0.25  # a machine that was busy or asleep catches up with no more than that
_NEW = ("hebbian", "adaptation", "seed", "side")  # what a new life may have another of


class Engine(threading.Thread):
    """Runs a world as long as somebody watches.

    make: makes a world of what a new life is to have. world: the one that runs now. life: how many there have been.
    version: changes with whatever pages show besides samples. news: notified when there is something to show; who reads
    or changes anything holds it. watchers: how many pages watch.
    """

    def __init__(self, make: Callable[[dict[str, Any]], LiveWorld]) -> None:
        super().__init__(name="play", daemon=True)
        self._make = make
        self.world = make({})
        self.news = threading.Condition()
        self.life, self.version, self.watchers = 0, 0, 0
        self.speed, self.is_playing, self.has_ended = 1.0, True, False
        self.prepares, self.trouble = "", ""  # a new life, while it is compiled; why the world stopped
        self.unwatched_since = time.monotonic()
        self._due = time.perf_counter()

    def run(self) -> None:
        """Run the world until `end`."""
        while not self.has_ended:
            with self.news:
                if self._advance():
                    self.news.notify_all()
                pause = FRAME_S if self._runs else None
                self.news.wait(pause)

    @property
    def _runs(self) -> bool:
        return self.is_playing and self.watchers > 0 and not self.world.is_over and not self.trouble

    def _advance(self) -> bool:
        """Run the steps that are due; returns whether there were any."""
        now = time.perf_counter()
        if not self._runs:
            self._due = now
            return False
        if self.speed == 0:
            steps, self._due = _AT_MOST, now
        else:
            lasts = STEP_S / self.speed
            self._due = max(self._due, now - _BEHIND_S)
            steps = int((now - self._due) / lasts)
            self._due += steps * lasts
        return steps > 0 and self._run(steps)

    def _run(self, steps: int) -> bool:
        before = self.world.robots[0].world
        try:
            done = self.world.run(steps)
        except Exception as error:  # a robot is lost, or its rule cannot be run; pages go on, and may begin anew
            self.trouble, done = str(error) or type(error).__name__, 1
        self.version += self.world.robots[0].world is not before or self.world.is_over or bool(self.trouble)
        return done > 0

    def do(self, wish: Any) -> dict[str, Any]:
        """Do what a page wishes, in the thread that serves it; returns the answer.

        Raises:
            ValueError: it cannot be done; the world goes on as it was.
        """
        acts = {
            "change": self._change,
            "play": self._play,
            "speed": self._set_speed,
            "step": self._step,
            "new": self._new,
            "save": self._save,
        }
        if not isinstance(wish, dict):
            raise ConfigError("a wish is a JSON object")
        act = acts.get(str(wish.get("do")))
        if act is None:
            raise ValueError(f"a page may wish {', '.join(acts)}, got {wish.get('do')!r}")
        return act(wish)

    def _change(self, wish: dict[str, Any]) -> dict[str, Any]:
        values = wish.get("values")
        if not isinstance(values, dict):
            raise ConfigError("a change needs values")
        with self.news:
            self.world.wish(values)
            if self._runs:
                self._due = min(self._due, time.perf_counter() - STEP_S / (self.speed or 1.0))
                self._advance()  # at once, and not with the next frame
            else:
                self.version += 1
            self.news.notify_all()
            return {"step": self.world.steps}

    def _play(self, wish: dict[str, Any]) -> dict[str, Any]:
        return self._set("is_playing", bool(wish.get("value")))

    def _set_speed(self, wish: dict[str, Any]) -> dict[str, Any]:
        if wish.get("value") not in SPEEDS or isinstance(wish.get("value"), bool):
            raise ValueError(f"speed must be one of {', '.join(map(str, SPEEDS))}, got {wish.get('value')!r}")
        return self._set("speed", float(wish["value"]))

    def _set(self, name: str, value: Any) -> dict[str, Any]:
        with self._changing():
            setattr(self, name, value)
        return {}

    @contextmanager
    def _changing(self) -> Iterator[None]:
        """Change what pages show, and tell them."""
        with self.news:
            yield
            self._due = time.perf_counter()
            self.version += 1
            self.news.notify_all()

    def _step(self, _: dict[str, Any]) -> dict[str, Any]:
        with self._changing():
            self.is_playing = False
            self._run(1)
        return {}

    def _new(self, wish: dict[str, Any]) -> dict[str, Any]:
        """Begin a new life; what it needs is compiled aside, while the old one goes on."""
        asked = {key: wish[key] for key in _NEW if wish.get(key) not in (None, "")}
        if asked.get("side", "left") not in SIDES:
            raise ValueError(f"side must be one of {', '.join(SIDES)}, got {asked['side']!r}")
        if not all(isinstance(value, str | int) for value in asked.values()):
            raise ValueError("a new life has other words for hebbian, adaptation, seed and side")
        with self._changing():
            if self.prepares:
                raise ValueError("a new life is being prepared already")
            self.prepares = " ".join(f"{key}={value}" for key, value in asked.items()) or "a new life"
        try:
            world = self._make(asked)
            with self.news:
                self.world, self.trouble = world, ""
                self.life += 1
        finally:
            self._set("prepares", "")
        return {}

    def _save(self, _: dict[str, Any]) -> dict[str, Any]:
        with self.news:
            world, record = self.world, self.world.record()
        saved: Saved = world.save(record)
        return {"run": str(saved.run), "same": saved.same, "command": saved.command}

    def watch(self, by: int) -> None:
        """Count a page that begins (1) or ends (-1) to watch; without any, the life pauses."""
        with self._changing():
            self.watchers += by
            self.unwatched_since = time.monotonic()

    def end(self) -> None:
        """End, and let those who watch end."""
        with self.news:
            self.has_ended = True
            self.news.notify_all()
        with suppress(RuntimeError):  # it has not begun
            self.join(5)
