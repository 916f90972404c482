"""Runs a live world in real time or faster, makes the changes that pages ask for, and wakes the streams."""

import threading
import time
from collections.abc import Callable
from typing import Any

from epuckhebb.live.world import LiveWorld
from epuckhebb.tmaze.robot import STEP_S

SPEEDS = (0.25, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 0.0)  # times real time; 0: as fast as it goes
FRAME_S = 1 / 30
_AT_MOST = 1000  # steps between two frames, as fast as it goes
_BEHIND_S = 0.25  # a machine that was busy or asleep catches up with no more than that
_NEW = ("hebbian", "adaptation", "seed", "side")  # what may differ in a new life


class Engine(threading.Thread):
    """Runs a world as long as somebody watches.

    make: makes a world of what differs in a new life. world: the one that runs now. life: its number. version: changes
    with whatever pages show besides samples. news: notified when there is something to show; whoever reads or changes
    anything holds it. watchers: how many pages watch.
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
                self.news.wait(FRAME_S if self._runs else None)

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
        """Do what a page wishes, in the thread that serves it; returns the answer, or raises a ValueError."""
        match wish:
            case {"do": "change", "values": dict(values)}:
                with self.news:
                    self.world.wish(values)
                    self.version += 1
                    self.news.notify_all()
                    return {"step": self.world.steps}
            case {"do": "play", "value": value}:
                self._set(is_playing=bool(value))
            case {"do": "speed", "value": value} if value in SPEEDS:
                self._set(speed=float(value))
            case {"do": "step"}:
                with self.news:
                    self._run(1)
                    self._set(is_playing=False)
            case {"do": "new"}:
                self._begin_anew({key: wish[key] for key in _NEW if wish.get(key) not in (None, "")})
            case {"do": "save"}:
                with self.news:
                    world, record = self.world, self.world.record()
                saved = world.save(record)
                return {**saved._asdict(), "run": str(saved.run)}
            case _:
                raise ValueError(f"a page cannot wish {wish!r}")
        return {}

    def _set(self, **values: Any) -> None:
        """Set attributes, and show them in all pages."""
        with self.news:
            vars(self).update(values)
            self._due = time.perf_counter()
            self.version += 1
            self.news.notify_all()

    def _begin_anew(self, words: dict[str, Any]) -> None:
        """Begin a new life; what it needs is compiled aside, while the old one goes on."""
        with self.news:
            if self.prepares:
                raise ValueError("a new life is being prepared already")
            self._set(prepares=" ".join(f"{key}={value}" for key, value in words.items()) or "a new life")
        try:
            world = self._make(words)
            with self.news:
                self._set(world=world, trouble="", life=self.life + 1)
        finally:
            self._set(prepares="")

    def watch(self, by: int) -> None:
        """Count a page that begins (1) or ends (-1) to watch; without any, the life pauses."""
        with self.news:
            self._set(watchers=self.watchers + by, unwatched_since=time.monotonic())

    def end(self) -> None:
        """End, and let those who watch end."""
        self._set(has_ended=True)
        self.join(5)
