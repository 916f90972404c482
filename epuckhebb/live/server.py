"""The server of `epuckhebb play`: one page, a stream of what is new, and one address for all that a page wishes.

It listens on this machine alone. Everything but the page needs a secret in a header of its own, which is behind the `#`
of the address: browsers send that nowhere. The host must be ours, so no name can be bound to us anew.
"""

import errno
import hmac
import json
import os
import secrets
import sys
import threading
import time
import webbrowser
from collections.abc import Sequence
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

from epuckhebb.config import quoted
from epuckhebb.live import page
from epuckhebb.live.engine import Engine
from epuckhebb.live.world import LiveWorld
from epuckhebb.runtime import ConfigError
from epuckhebb.tmaze.maze import SIDES, Side

PORT = 8470
_PORTS = 50  # that are tried, one after the other
_LARGEST = 2**16  # bytes of a wish
_PATIENCE_S = 20.0  # with a page that neither reads nor writes
_QUIET_S = 5.0  # after which a page receives a sign that the server is still there
_UNWATCHED_S = 3600.0  # after which a world without a page ends
_HEADERS = {
    "Cache-Control": "no-store",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
}


class Server(ThreadingHTTPServer):
    """Serves the page of one engine to whoever knows its secret; an OSError if the port is taken."""

    allow_reuse_address = os.name != "nt"  # there it would let two programs share a port

    def __init__(self, engine: Engine, port: int) -> None:
        self.engine, self.secret = engine, secrets.token_urlsafe(24)
        super().__init__(("127.0.0.1", port), _Handler)
        self.port = int(self.server_address[1])  # the one that was free, if `port` is 0

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Say nothing of a page that has gone; everything else is a mistake of ours."""
        if not isinstance(sys.exception(), ConnectionError | TimeoutError):
            super().handle_error(request, client_address)


class _Handler(BaseHTTPRequestHandler):
    """Answers one connection."""

    protocol_version, server_version, sys_version = "HTTP/1.1", "epuckhebb", ""
    disable_nagle_algorithm = True
    timeout = _PATIENCE_S
    server: Server

    def log_message(self, *_: object) -> None:
        """Log nothing."""

    def do_GET(self) -> None:
        """Send the page, or the stream of what is new."""
        if self.path == "/":
            if self._is_allowed(from_page=False):
                text, policy = page.page()
                self._send(text, "text/html; charset=utf-8", policy)
        elif self.path == "/stream":
            if self._is_allowed():
                self._stream()
        else:
            self.send_error(HTTPStatus.NOT_FOUND)

    def do_POST(self) -> None:
        """Do what a page wishes."""
        length = self.headers.get("Content-Length", "")
        if self.path != "/do":
            self.send_error(HTTPStatus.NOT_FOUND)
        elif not length.isdecimal() or len(length) > len(str(_LARGEST)) or int(length) > _LARGEST:
            self.send_error(HTTPStatus.REQUEST_ENTITY_TOO_LARGE)
        elif self._is_allowed():
            content = self.rfile.read(int(length))
            try:
                answer = self.server.engine.do(json.loads(content))
            except (ValueError, TypeError, ArithmeticError, OSError, RuntimeError) as error:  # a ConfigError, too
                answer = {"error": str(error)}
            self._send(json.dumps(answer).encode(), "application/json")

    def _is_allowed(self, *, from_page: bool = True) -> bool:
        """Whether the request names this server, and knows the secret if it must come from the page; else refuse it."""
        secret = self.headers.get("X-Epuckhebb", "").encode("utf-8", "replace")
        is_allowed = self.headers.get("Host") in [f"{name}:{self.server.port}" for name in ("127.0.0.1", "localhost")]
        if from_page:
            is_allowed = is_allowed and hmac.compare_digest(secret, self.server.secret.encode())
        if not is_allowed:
            self.send_error(HTTPStatus.FORBIDDEN)
        return is_allowed

    def _send(self, content: bytes, kind: str, policy: str = "default-src 'none'") -> None:
        self._begin(kind, {"Content-Length": str(len(content)), "Content-Security-Policy": policy})
        self.wfile.write(content)

    def _begin(self, kind: str, more: dict[str, str]) -> None:
        self.send_response(HTTPStatus.OK)
        for name, value in {"Content-Type": kind, **_HEADERS, **more}.items():
            self.send_header(name, value)
        self.end_headers()

    def _stream(self) -> None:
        """Send what is new until the page has gone or the world has ended."""
        engine = self.server.engine
        self.close_connection = True
        engine.watch(1)
        try:
            self._begin("application/octet-stream", {"Connection": "close"})
            for news in page.stream(engine, _QUIET_S):
                self.wfile.write(news)
        finally:
            engine.watch(-1)


class Play:
    """A live world that is served; a context manager that ends it. words: settings. port: the first that is tried."""

    def __init__(self, words: Sequence[str], side: str, config_dir: str | None = None, port: int = PORT) -> None:
        def make(changed: dict[str, Any]) -> LiveWorld:
            goal: Side = "right" if changed.pop("side", side) == "right" else "left"
            kept = [word for word in words if word.partition("=")[0].partition(".")[0] not in changed]
            new = [f"{key}={quoted(str(value))}" for key, value in changed.items()]
            return LiveWorld([*kept, *new], goal, config_dir)

        if side not in SIDES:
            raise ConfigError(f"side must be {' or '.join(SIDES)}, got {side!r}")
        if not 0 <= port <= 65535 - _PORTS:
            raise ConfigError(f"--port must lie between 0 (any that is free) and {65535 - _PORTS}, got {port}")
        self.engine = Engine(make)
        for number in range(port, port + _PORTS):
            try:
                self.server = Server(self.engine, number)
                break
            except OSError as error:
                if error.errno not in (errno.EADDRINUSE, errno.EACCES):
                    raise
        else:
            raise ConfigError(f"--port={port}: this port and the {_PORTS - 1} after it are taken; give another")
        self.address = f"http://127.0.0.1:{self.server.port}/#{self.server.secret}"

    def __enter__(self) -> "Play":
        """Begin to serve."""
        self.engine.start()
        threading.Thread(target=self.server.serve_forever, name="play-server", daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        """End the world, and tell all pages."""
        self.engine.end()
        self.server.shutdown()
        self.server.server_close()

    def wait(self) -> None:
        """Wait until nobody has watched for an hour."""
        engine = self.engine
        while engine.watchers or time.monotonic() - engine.unwatched_since < _UNWATCHED_S:
            time.sleep(0.5)


def open_page(address: str) -> bool:
    """Open the page in a browser of this computer's desktop, if the user sits there; returns whether one was started.

    A browser in the user's terminal would take that from the program.
    """
    has_display = not sys.platform.startswith("linux") or "DISPLAY" in os.environ or "WAYLAND_DISPLAY" in os.environ
    return has_display and "SSH_CONNECTION" not in os.environ and webbrowser.open(address)
