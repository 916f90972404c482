"""The page of a live world, and the frames of numbers that keep it up to date."""

import json
import re
import struct
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from epuckhebb.analysis.page import filled, policy
from epuckhebb.analysis.replay import fixed_facts, world_facts
from epuckhebb.config import NONE, PAPER, part_class
from epuckhebb.live.flock import LiveFlock
from epuckhebb.live.world import LiveWorld
from epuckhebb.runs import check_rules
from epuckhebb.runtime import REFERENCE, conf, data_folder
from epuckhebb.tmaze.changes import MOST_BLOCKS
from epuckhebb.tmaze.robot import STEP_S

if TYPE_CHECKING:
    from epuckhebb.live.server import Play

WORLD, SAMPLES = range(2)  # kinds of frames
SPEEDS = (0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 0.0)  # times real time; 0: as fast as it goes
WEIGHTS_EVERY = 8  # steps; sensors, motors and poses are sent of every step
_SENT = ("pose", "sensors", "activations", "motors", "fitness", "change_signal", "rate", "weight_change")
_MOST = 2048  # steps in a frame; who is behind gets more frames
_FRAMES = "http://localhost:* http://127.0.0.1:*"  # where the page may be in a frame: a notebook of this machine


def page(name: str) -> tuple[bytes, str]:
    """A page, and the policy that goes with it: it runs nothing but its own script, and asks nobody but us."""
    text, style, script = filled(Path(__file__).with_name(name))
    return text.encode(), f"{policy(style=style, script=script)}; connect-src 'self'; frame-ancestors {_FRAMES}"


def facts(play: "Play") -> dict[str, Any]:
    """What stays as it is in a lifetime."""
    world = play.world
    return {
        **(world.facts() if isinstance(world, LiveFlock) else _maze_facts(world)),
        "life": play.life,
        "interval": STEP_S,
        "speeds": list(SPEEDS),
        "words": world.words,
        "typed": play.words,
    }


def _maze_facts(world: LiveWorld) -> dict[str, Any]:
    """What stays as it is in a lifetime in a maze."""
    scenario, network = world.config.world, world.genome.network
    champions = sorted((data_folder("runs/reference") / "champions").glob(f"{scenario.experiment}_seed*.npz"))
    return {
        **fixed_facts(scenario, network, world.lifetime.gain_rad_s, [entry.name for entry in world.controllers]),
        "isLive": True,
        "sides": [world.side],
        "most": world.lifetime.steps,
        "steps": 1,
        "weightsEvery": WEIGHTS_EVERY,
        "initial": [round(weight, 7) for weight in world.robots[-1].life.genotype.weights.tolist()],
        "N": float(world.controllers[-1].rule.N),
        "arena": scenario.maze.arena_m,
        "mostBlocks": MOST_BLOCKS,
        "title": f"{world.config.world.name} · genome {world.genome.name} · seed {world.config.seed}",
        "seed": world.config.seed,
        "hasSignal": any(controller.adaptation.is_gated for controller in world.controllers),
        "genome": world.genome.sha256,
        "champions": [re.sub(".*_seed0*", f"{REFERENCE}_", file.stem) for file in champions],
        "choices": {"hebbian": _rules(world), "adaptation": conf.rows("adaptation")},
        "verdict": None if scenario.task.has_trials else min(scenario.paper_duration_s, world.lifetime.duration_s),
    }


def _rules(world: LiveWorld) -> dict[str, str]:
    """The rules that the champion can run, and what each of them is."""
    texts, genome, runnable = conf.rows("hebbian"), world.genome, [NONE]
    for name, row in conf.table("hebbian").items():
        if (rule := row.get("rule", PAPER)) != NONE:
            with suppress(ValueError):  # of a genome without its genes, or of a network without layers
                check_rules(genome, genome.network, [(name, part_class("rule", rule, "hebbian")())])
                runnable.append(name)
    return {name: texts[name] for name in runnable}


def state(play: "Play") -> dict[str, Any]:
    """What can change in a lifetime, and how it is shown."""
    world = play.world
    return {
        **(world.state() if isinstance(world, LiveFlock) else _maze_state(world)),
        "playing": play.is_playing,
        "speed": play.speed,
        "over": world.is_over,
        "prepares": play.prepares,
        "trouble": play.trouble,
    }


def _maze_state(world: LiveWorld) -> dict[str, Any]:
    """What can change in a lifetime in a maze."""
    now, last = world.scenario, world.changes[-1] if world.changes else {}
    return {
        "world": {
            **world_facts(now),
            "placed": [list(box) for box in now.placed],
            "left": now.left_wheel,
            "right": now.right_wheel,
            "rate": now.rate,
            "lit": (world.side == "right") if now.lamp_on is None else now.lamp_on,
        },
        "pending": bool(world.wishes),
        "byHand": len(world.changes),
        "last": {"at": last.get("at_s"), "keys": [key for key in last if key != "at_s"]},
        "keys": sorted({key for change in world.changes for key in change}),
        "put": list(now.put) if world.wishes and now.put is not None else None,
    }


def samples(world: LiveWorld, since: int) -> tuple[bytes, int]:
    """What was recorded of all robots from a step on; and up to which step.

    Three whole numbers come first: the first step, how many, and how many samples of weights. Then, for each robot,
    the rows of 32-bit numbers (`_SENT`) and the rows of the weights, as their change since the start of the lifetime.
    """
    until = min(world.steps, since + _MOST)
    first = -(-since // WEIGHTS_EVERY) * WEIGHTS_EVERY
    steps = np.arange(since, until)
    parts = [struct.pack("<III", since, until - since, len(range(first, until, WEIGHTS_EVERY)))]
    for robot in world.robots:
        some = np.minimum(steps, robot.steps - 1)
        columns = [np.nan_to_num(getattr(robot.samples, name)[some]).reshape(len(some), -1) for name in _SENT]
        parts.append(np.concatenate(columns, axis=1, dtype="<f4", casting="same_kind").tobytes())
        initial = robot.life.genotype.weights.astype(np.float32)
        change = robot.samples.weights[some[first - since :: WEIGHTS_EVERY]] - initial
        parts.append(change.astype("<f4", copy=False).tobytes())
    return b"".join(parts), until


def stream(play: "Play") -> Iterator[bytes]:
    """What is new for one page, until the world ends: frames of a length, a kind and that many bytes."""
    life, version, sent = -1, -1, 0

    def is_news() -> bool:
        return play.has_ended or (play.life, play.version, play.world.steps) != (life, version, sent)

    while True:
        with play.news:
            play.news.wait_for(is_news)
            if play.has_ended:
                return
            frames = []
            if (play.life, play.version) != (life, version):
                news = {**(facts(play) if play.life != life else {}), **state(play)}
                frames.append((WORLD, json.dumps(news, allow_nan=False).encode()))
                sent = sent if play.life == life else 0
                life, version = play.life, play.version
            if isinstance(play.world, LiveFlock):
                sent = play.world.steps  # they are in its state
            elif sent < play.world.steps:
                content, sent = samples(play.world, sent)
                frames.append((SAMPLES, content))
        yield b"".join(struct.pack("<II", len(payload), kind) + payload for kind, payload in frames)
