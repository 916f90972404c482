"""`epuckhebb play` without its page: what can be wished, who may wish it, and that a saved life is the one seen."""

import http.client
import json
import math
import os
import random
import signal
import socket
import struct
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from cases import refused

import epuckhebb
from epuckhebb.export.replay import recording, recording_page
from epuckhebb.flock.couplings.live_fitness import LiveFitness
from epuckhebb.flock.plane import Flock, run
from epuckhebb.live import page
from epuckhebb.live.flock import LiveFlock
from epuckhebb.live.server import Play
from epuckhebb.live.world import LiveWorld
from epuckhebb.runs import repeat
from epuckhebb.runtime.errors import ConfigError
from epuckhebb.store import Run, read_traces
from epuckhebb.tmaze.robot import STEP_S
from epuckhebb.tmaze.samples import Samples

WORDS = ["scenario=4obstacles", "hebbian.N=0.0005"]
SERIES = set(Samples._fields) - {"phase_began"}  # a world that is changed by hand has one phase


def wish(draw):
    """Something that one may want to change; some of it cannot be."""
    return draw.choice(
        [
            {"light": draw.random()},
            {"lamp_on": draw.random() < 0.5, "lamp": {"x_m": draw.uniform(-0.1, 0.1)}},
            {"placed": [[draw.uniform(-0.4, 0.4), draw.uniform(-0.4, 0.2), 0.03, 0.04]] * draw.randrange(3)},
            {"dead_sensors": draw.sample(range(8), draw.randrange(3)), "right_wheel": draw.random()},
            {"left_wheel": draw.random(), "rate": draw.choice([0.0, 1.0, 50.0, 1000.0])},
            {"put": [draw.uniform(-0.4, 0.4), draw.uniform(-0.4, 0.25), draw.uniform(-3, 3)]},
            {"put": [0.007, draw.uniform(-0.36, 0.16), draw.uniform(-3, 3)], "reset": True},
        ]
    )


def disturb(world, changes, seed=1):
    """Run a world and change it at random moments, so many times; returns how many wishes were refused."""
    draw, refused = random.Random(seed), 0
    while len(world.changes) < changes:
        for _ in range(draw.randrange(1, 3)):
            try:
                world.wish(wish(draw))
            except ValueError:
                refused += 1
        world.run(draw.choice([1, 1, 2, 3, 8, 25]))
    return refused


@pytest.mark.parametrize(
    ("words", "side"),
    [
        (WORDS, "left"),
        pytest.param(["adaptation=novelty"], "right", marks=pytest.mark.thorough),
        pytest.param(
            ["scenario.changes=[{at_s: 3.2, light: 1.0}]", "adaptation=late"], "right", marks=pytest.mark.thorough
        ),
    ],
)
def test_a_saved_life_is_the_one_that_was_seen(here, words, side):
    world = LiveWorld(words, side)
    assert disturb(world, 150) > 10
    saved = world.save()
    assert saved["same"]
    run = here / saved["run"]
    traces, *_ = read_traces(Run(run))
    lifetimes = list(zip(traces.controller, traces.side, strict=True))
    for number, controller in enumerate(world.controllers):
        (place,) = (k for k, of in enumerate(lifetimes) if of == (controller.name, side))
        seen = world.robots[number].samples
        for name in SERIES:
            values = getattr(traces.samples, name)
            lived = getattr(seen, name)[: world.steps : 8].astype(values.dtype)
            assert lived.tobytes() == values[place].tobytes(), (controller.name, name)
    again, difference = repeat(run)
    assert difference == ""
    recorded = recording(again)
    assert recording_page(recorded).count('"byHand":true') == 150
    assert "150 changes by hand" in recorded.title
    assert "scenario.hand=" in saved["command"]


def test_a_life_in_which_nothing_was_done_is_an_evaluation(here):
    world = LiveWorld(WORDS, "left")
    world.run(300)
    saved = world.save()
    assert saved["same"]
    assert "hand" not in saved["command"]
    assert not (here / "runs" / "play").exists()


@pytest.mark.thorough
@pytest.mark.usefixtures("here")
def test_a_life_of_many_trials_is_saved_when_they_are_over():
    learner = Path(__file__).parents[1] / "runs" / "reference" / "reversal" / "learner_210.npz"
    words = [f"genome={learner}", "task=reversal", "hebbian=modulated", "task.trials=3", "task.last_switch=2"]
    world = LiveWorld(words, "left")
    world.wish({"put": [0.2, 0.16, 1.0], "light": 0.5})
    world.run(200)
    with pytest.raises(ValueError, match="when all its trials are over"):
        world.save()
    world.wish({"reset": True})
    world.run(world.lifetime.steps)
    assert world.save()["same"]
    content, _ = page.samples(world, world.steps - 1)
    rows = np.frombuffer(content, "<f4", offset=12).reshape(len(world.robots), -1)
    assert len({robot.steps for robot in world.robots}) > 1
    for row, robot in zip(rows, world.robots, strict=True):
        np.testing.assert_array_equal(row[:3], robot.samples.pose[robot.steps - 1].astype(np.float32))


BAD = [
    {"light": -1},
    {"light": float("nan")},
    {"lamp": {"intensity": -1}},
    {"placed": [[0.007, -0.35, 0.03, 0.03]]},  # where the robots are
    {"put": [9, 9, 0]},
    {"put": None, "light": -1},
    {"rate": -1},
    {"dead_sensors": [99]},
    {"left_wheel": 2},
]


@pytest.fixture(scope="module")
def world():
    return LiveWorld(WORDS, "left")


def test_what_cannot_be_is_refused_and_changes_nothing(world):
    for values in BAD:
        with pytest.raises(ValueError, match=r"must|cannot|no room"):
            world.wish(values)
        assert not world.wishes


def test_wishes_before_a_step_are_joined():
    world = LiveWorld(WORDS, "left")
    world.wish({"lamp": {"x_m": 0.05}})
    world.wish({"lamp": {"y_m": -0.1}, "light": 0.5})
    world.wish({"light": 0.7})
    assert (world.scenario.lamp.x_m, world.scenario.lamp.y_m, world.scenario.light) == (0.05, -0.1, 0.7)
    assert world.robots[0].world.light == 0.1
    world.run(1)
    assert world.changes == [{"at_s": STEP_S, "lamp": {"x_m": 0.05, "y_m": -0.1}, "light": 0.7}]


def test_a_life_that_has_ended_takes_no_wishes():
    world = LiveWorld([*WORDS, "lifetime.duration_s=1"], "left")
    assert world.run(1000) == 30
    assert world.is_over
    with pytest.raises(ValueError, match="has ended"):
        world.wish({"light": 1.0})


def test_what_makes_no_world_is_refused(here):
    (here / "mine.json").write_text('[{"at_s": 1.0, "light": 1.0}]')
    for words in (["scenario=nowhere"], ["genome=none.npz"], ["scenario.hand=mine.json"]):
        with pytest.raises(ConfigError):
            LiveWorld(words, "left")


# ---- The server ----


@pytest.fixture(scope="module")
def live():
    with Play(WORDS, "left", port=0) as playing:
        yield playing


def ask(live, method="POST", path="/do", body=None, **headers):
    """Ask the server as our page does; a header is left out with None."""
    given = {"X-Epuckhebb": live.secret, **{name.replace("_", "-"): text for name, text in headers.items()}}
    connection = http.client.HTTPConnection("127.0.0.1", live.port, timeout=60)
    connection.request(method, path, body, {name: value for name, value in given.items() if value is not None})
    answer = connection.getresponse()
    content = b"" if path == "/stream" and answer.status == 200 else answer.read()
    connection.close()
    return answer, content


def do(live, **wished):
    answer, content = ask(live, body=json.dumps(wished))
    assert answer.status == 200
    return json.loads(content)


class Watcher:
    """A page that reads the stream."""

    def __init__(self, live):
        self._connection = http.client.HTTPConnection("127.0.0.1", live.port, timeout=60)
        self._connection.request("GET", "/stream", headers={"X-Epuckhebb": live.secret})
        self._answer = self._connection.getresponse()
        self.status = self._answer.status

    def frame(self):
        length, kind = struct.unpack("<II", self._answer.read(8))
        return kind, self._answer.read(length)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._answer.close()
        self._connection.close()


def wait_for(true, seconds=20):
    until = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < until
        time.sleep(0.01)


FOREIGN = [
    {"X_Epuckhebb": None},
    {"X_Epuckhebb": "wrong"},
    {"X_Epuckhebb": "ä".encode()},
    {"Host": "evil.example"},
    {"Host": "evil.example:8470"},
]


@pytest.mark.parametrize(("method", "path"), [("GET", "/stream"), ("POST", "/do")])
def test_only_our_page_is_answered(live, method, path):
    for headers in FOREIGN:
        assert ask(live, method, path, '{"do": "step"}', **headers)[0].status == 403, headers


def test_no_name_can_be_bound_to_the_server_anew(live):
    assert ask(live, "GET", "/", Host="evil.example", X_Epuckhebb=None)[0].status == 403
    assert ask(live, "GET", "/", Host=f"localhost:{live.port}", X_Epuckhebb=None)[0].status == 200


def test_it_listens_on_this_machine_alone(live):
    assert live._server.server_address[0] == "127.0.0.1"
    with socket.socket() as other, pytest.raises(ConnectionRefusedError):
        other.connect(("127.0.0.2", live.port))


def test_the_page_may_only_talk_to_its_server_and_bears_no_secret(live):
    answer, text = ask(live, "GET", "/", X_Epuckhebb=None)
    policy = answer.headers["Content-Security-Policy"]
    assert "default-src 'none'" in policy
    assert "connect-src 'self'" in policy
    assert "unsafe" not in policy
    assert live.secret.encode() not in text
    assert b"{{" not in text


@pytest.mark.parametrize("path", ["/x", "/../server.py", "/play.html", "/do"])
def test_no_file_but_the_page_is_served(live, path):
    assert ask(live, "GET", path)[0].status == 403


BAD_BODIES = [b"", b"{", b"\xff", b"[" * 30000]
BAD_BODIES += [b'{"do": "change", "values": 3}', b'{"do": "change", "values": {"at_s": -5, "light": 0.5}}', b"3", b"{}"]
BAD_BODIES += [f'{{"do": "speed", "value": {value}}}'.encode() for value in ('"x"', "NaN", "Infinity", "-1", "1e300")]
BAD_BODIES += [b'{"do": "fly"}', b'{"do": "new", "words": 3}', b'{"do": "new", "words": [], "side": "up"}']
BAD_BODIES += [b'{"do": "new", "words": [], "changes": %s}' % changes for changes in (b"3", b"[3]", b'[{"at_s": -1}]')]
NO_LIVES = [["hebbian=mine"], ["seed=[1]"], ["adaptation=none hebbian=oja"], ["seed=-1"], [3], ["hydra.verbose=true"]]
NO_LIVES += [["hebbian.rule=mine.py:Mine"], ["genome=/tmp/champion.npz"], ["lifetime.gain_rad_s=${oc.env:HOME}"]]
BAD_BODIES += [json.dumps({"do": "new", "words": words}).encode() for words in NO_LIVES]
BAD_BODIES += [b'{"do": "new", "words": [], "changes": [{"at_s": 1, "lite": 3}]}']
BAD_BODIES += [json.dumps({"do": "change", "values": values}).encode() for values in ({"lite": 3}, {"light": np.nan})]


def test_a_bad_wish_is_answered_with_a_sentence_and_the_world_goes_on(live):
    for body in BAD_BODIES:
        answer, content = ask(live, body=body)
        assert answer.status == 200
        assert json.loads(content)["error"], body
    before = live.world.steps
    assert do(live, do="step") == {}
    assert live.world.steps == before + 1


@pytest.mark.parametrize("length", ["99999999999", "-1", "1e3", ""])
def test_a_wish_of_no_length_that_can_be_is_not_read(live, length):
    assert ask(live, body="{}", Content_Length=length)[0].status == 413


def test_three_new_lives_at_once_begin_one_after_the_other(live):
    before = live.life
    with ThreadPoolExecutor(3) as pool:
        answers = list(pool.map(lambda seed: do(live, do="new", words=[*WORDS, f"seed={seed}"]), (1, 2, 3)))
    assert (answers, live.life) == ([{}] * 3, before + 3)


def test_a_life_pauses_when_nobody_watches(live):
    with Watcher(live) as one:
        one.frame()
        do(live, do="play", value=True)
        before = live.world.steps
        wait_for(lambda: live.world.steps > before)
    wait_for(lambda: live.watchers == 0)  # it has gone when it takes nothing any more
    before = live.world.steps
    time.sleep(0.2)
    assert live.world.steps == before


def rows(content):
    """The samples of the first robot in a frame, (steps, 25)."""
    _, count, _ = struct.unpack("<III", content[:12])
    return np.frombuffer(content, "<f4", offset=12)[: count * 25].reshape(count, 25)


def test_two_pages_see_the_same_and_neither_waits_for_one_that_does_not_read():
    with Play(WORDS, "left", port=0) as live, Watcher(live) as one, Watcher(live) as other, Watcher(live):
        do(live, do="speed", value=0.0)
        do(live, do="play", value=True)
        told = [[], []]
        for watcher, frames in zip((one, other), told, strict=True):
            while sum(len(content) for kind, content in frames if kind == page.SAMPLES) < 2_000_000:
                frames.append(watcher.frame())
        first, second = (np.concatenate([rows(content) for kind, content in frames if kind == 1]) for frames in told)
        np.testing.assert_array_equal(first[:500], second[:500])  # however many steps there are in a frame
        kind, content = told[0][0]
        assert kind == page.WORLD
        assert {"layers", "maze", "world", "playing"} <= set(json.loads(content))
        wait_for(lambda: live.world.steps > 20_000)


def test_a_taken_port_is_left_to_whoever_has_it():
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with Play(WORDS, "left", port=port) as live:
            assert live.port != port


def test_a_link_repeats_a_life_and_all_that_was_done_in_it(live):
    disturb(live.world, 30)
    first, life = live.world, do(live, do="link")
    assert do(live, do="new", **life) == {}
    again = live.world
    while again.steps < first.steps:
        again.run(min(7, first.steps - again.steps))
    assert again.changes == first.changes
    for one, other in zip(first.robots, again.robots, strict=True):
        assert one.samples.pose[: first.steps].tobytes() == other.samples.pose[: first.steps].tobytes()


def test_a_page_offers_the_rules_that_the_champion_can_run_and_the_champions_of_its_experiment(live):
    facts = page.facts(live)
    assert {"none", "paper", "oja"} < set(facts["choices"]["hebbian"])
    assert not {"abcd", "modulated", "baldwin_n"} & set(facts["choices"]["hebbian"])
    assert all(facts["choices"]["adaptation"].values())
    assert {"reference_1", "reference_110"} < set(facts["champions"])
    assert facts["verdict"] == 250.0


def test_a_new_life_waits_for_its_page_and_may_have_a_genome_of_the_user(here, live):
    np.save(here / "mine.npy", np.zeros(234))
    assert do(live, do="new", words=["adaptation=late", "seed=5"], side="right") == {}
    world = live.world
    assert (world.words, world.side, world.config.seed) == (["adaptation=late", "seed=5"], "right", 5)
    assert live.life > 0
    assert not live.is_playing
    live.words.append("genome=mine.npy")  # typed, so a page may keep it
    assert do(live, do="new", words=["genome=mine.npy"]) == {}


def test_a_flock_drives_as_that_of_a_study_until_somebody_moves_a_robot():
    flock = LiveFlock(["flock", "flock=live_fitness"])
    flock.wish({"coupling": "live_fitness"})
    while flock.steps < 200 / STEP_S:
        flock.run(7)
    record = run(Flock(duration_s=200.0, at_s=100.0), LiveFitness(), 1100)
    np.testing.assert_array_equal(flock._run.path[: len(record.path)], record.path)
    with pytest.raises(ValueError, match="where another is"):
        flock.wish({"put": [0, *flock.state()["poses"][1][:2]]})
    flock.wish({"put": [9, 5.0, 5.0], "broken": 9})
    assert flock.state()["poses"][9][:2] == [5.0, 5.0]
    for values in ({"broken": 8}, {"broken": 10}, {"put": [0, math.nan, 0]}, {"coupling": "loud"}, {"put": 3}):
        with pytest.raises((ValueError, TypeError)):
            flock.wish(values)
    assert (flock.state()["broken"], flock.state()["coupling"]) == (9, "live_fitness")


def test_from_python(here):
    live = epuckhebb.play("reference", "hebbian.N=0.0005", scenario="4obstacles", side="right")
    try:
        assert live.address in live._repr_html_()
        port, secret = live.address.removeprefix("http://127.0.0.1:").split("/#")
        connection = http.client.HTTPConnection("127.0.0.1", int(port), timeout=60)
        connection.request("POST", "/do", '{"do": "step"}', {"X-Epuckhebb": secret})
        assert json.loads(connection.getresponse().read()) == {}
        connection.close()
    finally:
        live.close()
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(("127.0.0.1", int(port)))
    for wrong in ({"side": "up"}, {"scenario": "nowhere"}, {"genome": "none.npz"}, {"genome": "latest"}):
        with pytest.raises(ValueError, match=r"side|nowhere|none\.npz|no run of `epuckhebb evolve`"):
            epuckhebb.play(**wrong)
    assert list(here.iterdir()) == []


# ---- The command ----


def command(*words, **more):
    env = {**os.environ, "PYTHONUNBUFFERED": "1"}
    return subprocess.Popen(
        [sys.executable, "-m", "epuckhebb", "play", *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=env,
        **more,
    )


@pytest.mark.usefixtures("here")
def test_the_command_prints_the_address_and_ends_with_ctrl_c():
    playing = command("scenario=4obstacles", "--port", "0")
    address = playing.stdout.readline().strip()
    assert address.startswith("http://127.0.0.1:")
    playing.send_signal(signal.SIGINT)
    _, err = playing.communicate(timeout=30)
    assert playing.returncode == 0, err
    assert "Traceback" not in err


@pytest.mark.parametrize(
    "words", [["--side", "up"], ["scenario=nowhere"], ["--port", "-1"], ["seeed=1"], ["flock", "flock.robots=1"]]
)
def test_the_command_refuses_what_cannot_be(here, words):
    refused("play", *words)
    assert list(here.iterdir()) == []
