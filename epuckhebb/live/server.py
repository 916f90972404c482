"""Serves a live world: runs it in real time or faster, makes the changes that pages ask for, and streams what is new.

It listens on this machine alone. Everything but the page needs a secret in a header of its own, which is behind the `#`
of the address: browsers send that nowhere. The host must be ours, so no name can be bound to us anew.
"""

import hmac
import json
import os
import re
import secrets
import sys
import threading
import time
from collections.abc import Sequence
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any, Self

from epuckhebb.live import flock, page
from epuckhebb.live.flock import LiveFlock
from epuckhebb.live.page import SPEEDS
from epuckhebb.live.world import LiveWorld
from epuckhebb.tmaze.robot import STEP_S

PORT = 8470
_FRAME_S = 1 / 30
_AT_MOST = 1000  # steps between two frames, as fast as it goes
_LENGTH = re.compile(r"\d{1,6}")  # of a wish, in bytes: less than a megabyte
_BEHIND_S = 0.25  # a machine that was busy or asleep catches up with no more than that
# What a link may set: names and numbers of the program, and no file.
_LINKED = re.compile(r"(scenario|change|hebbian|adaptation|genome|seed|physics|maze|lifetime)(\.\w+)*=[\w.,\[\]-]*")


class Play:
    """A live world that is served; a context manager that ends it.

    words: settings, as on the command line; after the word flock, those of a flock. port: any that is free if this is
    taken. world: the one that runs now, as long as it is playing and somebody watches. life: its number. version:
    changes with whatever pages show besides samples. news: notified when there is something to show; whoever reads or
    changes anything holds it. watchers: how many pages watch.
    """

    def __init__(self, words: Sequence[str], side: str, config_dir: str | None = None, port: int = PORT) -> None:
        self.words, self._config_dir = list(words), config_dir
        self.world = self._new(words, side)
        self.news = threading.Condition()
        self.life, self.version, self.watchers = 0, 0, 0
        self.speed, self.is_playing, self.has_ended = 8.0, False, False
        self.prepares, self.trouble = "", ""  # a new life, while it is compiled; why the world stopped
        self._due, self._begins = time.perf_counter(), threading.Lock()  # one new life after the other
        self.secret = secrets.token_urlsafe(24)
        try:
            self._server = _Server(("127.0.0.1", port), _Handler)
        except OSError:
            self._server = _Server(("127.0.0.1", 0), _Handler)
        self._server.play, self.port = self, int(self._server.server_address[1])
        self.address = f"http://127.0.0.1:{self.port}/#{self.secret}"

    def __enter__(self) -> Self:
        """Begin to run and to serve."""
        for target in (self._run, self._server.serve_forever):
            threading.Thread(target=target, daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        """End the world, and tell all pages."""
        self.end()
        self._server.shutdown()
        self._server.server_close()

    def end(self) -> None:
        """End, and let those who watch end."""
        self._set(has_ended=True)

    def wait(self) -> None:
        """Wait until it has ended."""
        while not self.has_ended:
            time.sleep(0.5)

    def _run(self) -> None:
        """Run the world until it ends: advance it, tell the pages, and wait for the next frame."""
        while not self.has_ended:
            with self.news:
                if self._advance():
                    self.news.notify_all()
                self.news.wait(_FRAME_S if self._runs else None)

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
        return steps > 0 and self._step(steps)

    def _new(self, words: Sequence[str], side: str, changes: Sequence[dict[str, Any]] = ()) -> LiveWorld | LiveFlock:
        """A new world of these settings: robots in a maze, or a flock."""
        if words[:1] == [flock.WORD]:
            return LiveFlock(words, self._config_dir)
        return LiveWorld(words, side, self._config_dir, changes)

    def _step(self, steps: int) -> bool:
        """Run steps, and count a new version if pages must be told more than samples; returns whether any was run."""
        shown = self.world.shown
        try:
            done = self.world.run(steps)
        except Exception as error:  # a robot is lost, or its rule cannot be run; pages go on, and may begin anew
            self.trouble, done = str(error) or type(error).__name__, 1
        self.version += self.world.shown is not shown or self.world.is_over or bool(self.trouble)
        return done > 0

    def do(self, wish: dict[str, Any]) -> dict[str, Any]:
        """Do what a page wishes, in the thread that serves it; returns the answer, or raises a ValueError."""
        match wish:
            case {"do": "change", "values": values}:
                with self.news:
                    self.world.wish(values)
                    self._set()
                    return {"step": self.world.steps}
            case {"do": "play", "value": value}:
                self._set(is_playing=bool(value))
            case {"do": "speed", "value": value} if value in SPEEDS:
                self._set(speed=float(value))
            case {"do": "step"}:
                with self.news:
                    self._step(1)
                    self._set(is_playing=False)
            case {"do": "new", "words": [*words]}:
                with self._begins:
                    self._begin_anew(words, wish.get("side", self.world.side), wish.get("changes", ()))
            case {"do": "link"} if isinstance(self.world, LiveWorld):
                with self.news:
                    return {"words": self.world.words, "side": self.world.side, "changes": self.world.changes}
            case {"do": "save"} if isinstance(self.world, LiveWorld):
                with self.news:
                    return self.world.save()
            case _:
                raise ValueError(f"there is no such wish: {str(wish)[:200]}")
        return {}

    def _set(self, **values: Any) -> None:
        """Set attributes, and show them in all pages."""
        with self.news:
            vars(self).update(values)
            self._due = time.perf_counter() if values else self._due
            self.version += 1
            self.news.notify_all()

    def _begin_anew(self, words: list[str], side: str, changes: Sequence[dict[str, Any]]) -> None:
        """Begin a new life, which pages start; what it needs is compiled aside, while the old one goes on."""
        allowed = {*self.words, *self.world.words}
        for word in words:
            if word not in allowed and not _LINKED.fullmatch(word):
                raise ValueError(f"{word} is not for a page to set; type it after `epuckhebb play`")
        self._set(prepares=" ".join(word for word in words if word not in allowed) or "a new life")
        try:
            world = self._new(words, side, changes)
            self._set(world=world, is_playing=False, trouble="", life=self.life + 1, prepares="")
        finally:
            self._set(prepares="")

    def watch(self, by: int) -> None:
        """Count a page that begins (1) or ends (-1) to watch; without any, the life pauses."""
        with self.news:
            self._set(watchers=self.watchers + by)


class _Server(ThreadingHTTPServer):
    allow_reuse_address = os.name != "nt"  # there it would let two programs share a port
    play: Play

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Say nothing of a page that has gone; everything else is a mistake of ours."""
        if not isinstance(sys.exception(), ConnectionError | TimeoutError):
            super().handle_error(request, client_address)


class _Handler(BaseHTTPRequestHandler):
    """Answers one connection."""

    protocol_version = "HTTP/1.1"
    disable_nagle_algorithm = True
    timeout = 20.0  # s, with a page that neither reads nor writes
    server: _Server

    def log_message(self, *_: object) -> None:
        """Log nothing."""

    def do_GET(self) -> None:
        """Send the page, or the stream of what is new until the page has gone or the world has ended."""
        play = self.server.play
        if self.path == "/" and self._names_us():
            text, policy = page.page(play.world.PAGE)
            self._begin("text/html; charset=utf-8", {"Content-Length": len(text), "Content-Security-Policy": policy})
            self.wfile.write(text)
        elif self.path == "/stream" and self._is_from_page():
            self.close_connection = True
            play.watch(1)
            try:
                self._begin("application/octet-stream", {"Connection": "close"})
                for news in page.stream(play):
                    self.wfile.write(news)
            finally:
                play.watch(-1)
        else:
            self.send_error(HTTPStatus.FORBIDDEN)

    def do_POST(self) -> None:
        """Do what a page wishes."""
        if self.path != "/do" or not self._is_from_page():
            self.send_error(HTTPStatus.FORBIDDEN)
            return
        length = self.headers.get("Content-Length", "")
        if not _LENGTH.fullmatch(length):
            self.send_error(HTTPStatus.REQUEST_ENTITY_TOO_LARGE)
            return
        try:
            answer = self.server.play.do(json.loads(self.rfile.read(int(length))))
        except (ValueError, TypeError, ArithmeticError, OSError, RuntimeError) as error:  # a ConfigError, too
            answer = {"error": str(error)}
        content = json.dumps(answer).encode()
        self._begin("application/json", {"Content-Length": len(content)})
        self.wfile.write(content)

    def _names_us(self) -> bool:
        return self.headers.get("Host") in [f"{name}:{self.server.play.port}" for name in ("127.0.0.1", "localhost")]

    def _is_from_page(self) -> bool:
        secret = self.headers.get("X-Epuckhebb", "").encode("utf-8", "replace")
        return self._names_us() and hmac.compare_digest(secret, self.server.play.secret.encode())

    def _begin(self, kind: str, more: dict[str, Any]) -> None:
        """Send the head of an answer."""
        self.send_response(HTTPStatus.OK)
        for name, value in {"Content-Type": kind, "Cache-Control": "no-store", **more}.items():
            self.send_header(name, str(value))
        self.end_headers()
