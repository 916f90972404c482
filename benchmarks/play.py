"""A live world: from a change by hand to the page, steps a second of two robots, and what real time costs."""

import http.client
import json
import os
import struct
import time
from collections.abc import Iterator
from statistics import median

from epuckhebb.live.server import Play
from epuckhebb.live.world import LiveWorld

REPEATS = 3
WORDS = ["scenario=4obstacles", "hebbian.N=0.0005"]
CHANGES = 60
PLAIN_STEPS = 50_000
SECONDS = 3.0


def frames(live: Play) -> Iterator[tuple[int, bytes]]:
    """What a page is sent: the kind and the content of each frame."""
    connection = http.client.HTTPConnection("127.0.0.1", live.port, timeout=60)
    connection.request("GET", "/stream", headers={"X-Epuckhebb": live.secret})
    answer = connection.getresponse()
    while head := answer.read(8):
        length, kind = struct.unpack("<II", head)
        yield kind, answer.read(length)


def ask(connection: http.client.HTTPConnection, live: Play, **wish: object) -> None:
    """Wish something, as the page does."""
    connection.request("POST", "/do", json.dumps(wish), {"X-Epuckhebb": live.secret})
    answer = json.loads(connection.getresponse().read())
    assert "error" not in answer, answer


def latency(live: Play) -> float:
    """Milliseconds from a change by hand to the frame in which the page has it."""
    assert isinstance(live.world, LiveWorld)
    told, connection = frames(live), http.client.HTTPConnection("127.0.0.1", live.port, timeout=60)
    ask(connection, live, do="play", value=True)
    taken = []
    for number in range(CHANGES):
        before = len(live.world.changes)
        began = time.perf_counter()
        ask(connection, live, do="change", values={"light": number / CHANGES})
        for kind, content in told:
            if kind == 0 and json.loads(content).get("byHand", 0) > before:
                break
        taken.append(1000 * (time.perf_counter() - began))
    return median(taken)


def cost_of_real_time(live: Play) -> float:
    """Share of a core that a world and its page take while it runs at real time, in percent."""
    told = frames(live)
    next(told)
    began, used = time.perf_counter(), time.process_time()
    while time.perf_counter() - began < SECONDS:
        next(told)
    return 100 * (time.process_time() - used) / (time.perf_counter() - began)


def steps_a_second() -> float:
    """Steps a second of two robots, recorded at every step."""
    world = LiveWorld(WORDS, "left")
    began = time.process_time()
    return world.run(PLAIN_STEPS) / (time.process_time() - began)


def measure() -> list[tuple[str, str]]:
    """Names and figures."""
    os.environ["EPUCKHEBB_QUIET"] = "1"
    with Play(WORDS, "left", port=0) as live:
        taken = median(latency(live) for _ in range(REPEATS))
        share = median(cost_of_real_time(live) for _ in range(REPEATS))
    speed = median(steps_a_second() for _ in range(REPEATS))
    return [
        ("From a change by hand to the page", f"{taken:.1f} ms"),
        ("Two robots, recorded at every step", f"{speed:,.0f} steps/s"),
        ("At real time, with a page", f"{share:.1f} % of a core"),
    ]


if __name__ == "__main__":
    for name, figure in measure():
        print(f"{name}: {figure}")
