"""Recognition against the truth: heading, lamp, walls and place, over a hundred lifetimes; and what it is made of."""

import math
from dataclasses import replace

import numpy as np
import pytest

from epuckhebb.adaptation.nominal import measure_nominal
from epuckhebb.adaptation.recognise.compass import LIT
from epuckhebb.adaptation.self_check.calibration import calibrate
from epuckhebb.config.compose import composed
from epuckhebb.config.schema import EvaluateConfig, typed
from epuckhebb.controller.random import Stream, key
from epuckhebb.runs.nominal import remembered_for
from epuckhebb.runtime.errors import ConfigError
from epuckhebb.store.genome import load_genome
from epuckhebb.tmaze.light import SUN_IRRADIANCE, SUN_X, SUN_Y
from epuckhebb.tmaze.maze import SIDES, Pose
from epuckhebb.tmaze.scenario import TRAINED
from epuckhebb.tmaze.session import Individual, Session

EVERY = 31  # steps from one look at what it believes to the next


def config(world):
    return typed(composed("evaluate", [f"scenario={world}", "adaptation=recognise_and_halt"]), EvaluateConfig)


@pytest.mark.parametrize(("experiment", "seed"), [("obstacles", 3), ("light", 4)])
def test_the_facts_of_the_training_world_are_those_of_the_world(experiment, seed):
    """Measured from readings alone, they are the numbers with which the world was made."""
    genome, world = load_genome(f"reference_{seed}", experiment), config(TRAINED[experiment]).world
    nominal = measure_nominal(genome.weights, world)
    bearing, level, lamp_side = nominal.sun
    assert math.degrees(bearing) == pytest.approx(math.degrees(math.atan2(SUN_Y, SUN_X)) - 90, abs=1)
    assert level == pytest.approx(SUN_IRRADIANCE * world.light * math.hypot(SUN_X, SUN_Y), rel=0.02)
    assert lamp_side == -1
    echo = world.robot.distance.echo()
    expected = [echo(away)[0] / world.robot.distance.full_scale - 0.0336 for away in nominal.echo[1]]
    far = nominal.echo[1] > 0.01
    np.testing.assert_allclose(nominal.echo[0][far], np.array(expected)[far], atol=0.02)


def true_walls(world, x, y):
    """The distances [m] from a point to the next wall on the left, ahead, right and behind, as seen at the start."""
    left, right, bottom, top = world.boxes.T
    across, along = (bottom < y) & (y < top), (left < x) & (x < right)
    return [
        (x - right[across & (right <= x)]).min(initial=np.inf),
        (bottom[along & (bottom >= y)] - y).min(initial=np.inf),
        (left[across & (left >= x)] - x).min(initial=np.inf),
        (y - top[along & (top <= y)]).min(initial=np.inf),
    ]


def beliefs(experiment, seeds):
    """Of each look: errors of heading [rad] and walls [m], whether the lamp is right, recognised, and at the goal."""
    settings = config(TRAINED[experiment])
    for seed in seeds:
        genome = load_genome(f"reference_{seed}", experiment)
        nominal = measure_nominal(genome.weights, settings.world)
        for number, side in enumerate(SIDES):
            individual = Individual(
                genes=genome.genes,
                side=side,
                key=key(7, Stream.evaluation_noise, seed, number),
                controller=settings.controllers[0],
                nominal=nominal.of(side),
            )
            session = Session(individual, settings.world, replace(settings.lifetime, record_every=0))
            goal, place = settings.world.goals_now[side], session.life.adaptation.place
            while not session.is_over:
                session.step(EVERY)
                x, y, heading = session.pose
                now = place.now[0]
                off = math.remainder(now["heading"] + math.pi / 2 - heading, 2 * math.pi)
                walls = np.where(place.seen < 5, place.wall - true_walls(settings.world, x, y), np.nan)
                lamp = (now["lamp"] >= LIT) == (side == "right")
                yield side, off, walls, lamp, now["here"] > 0, math.dist((x, y), goal) < 0.05, session.is_over


@pytest.mark.thorough
@pytest.mark.parametrize("experiment", list(TRAINED))
def test_what_it_believes_is_near_the_truth_in_fifty_lifetimes(experiment):
    seeds = [*range(1, 21), *range(101, 106)]
    _, heading, walls, lamp, recognised, at_goal, end = zip(*beliefs(experiment, seeds), strict=True)
    heading, walls, end = np.abs(np.degrees(heading)), np.abs(np.array(walls)), np.array(end)
    recognised, at_goal, lamp = np.array(recognised), np.array(at_goal), np.array(lamp)
    figures = {
        "heading, median": np.median(heading),
        "heading, 95 %": np.percentile(heading, 95),
        "walls, median": 1000 * np.nanmedian(walls),
        "walls, 95 %": 1000 * np.nanpercentile(walls, 95),
        "lamp, right at the end": lamp[end].mean(),
        "recognised away from the goal": (recognised & ~at_goal).mean(),
        "at the goal in the end, recognised": recognised[end & at_goal].mean(),
    }
    for name, most in MOST.items():
        assert figures[name] <= most, name
    for name, least in LEAST.items():
        assert figures[name] >= least, name


MOST = {
    "heading, median": 1.5,  # degrees
    "heading, 95 %": 3.0,
    "walls, median": 1.0,  # mm
    "walls, 95 %": 8.0,
    "recognised away from the goal": 0.002,
}
LEAST = {"lamp, right at the end": 0.98, "at the goal in the end, recognised": 0.98}


@pytest.mark.thorough
def test_recognition_begins_after_a_calibration_that_counts():
    settings, genome = config(TRAINED["light"]), load_genome("reference_4", "light")
    main = settings.controllers[0]
    both = replace(main.adaptation, self_check=True, calibration_counts=True)
    calibration = calibrate(settings.world, "left", np.uint64(5))
    nominal = measure_nominal(genome.weights, settings.world).of("left")
    individual = Individual(
        genes=genome.genes,
        side="left",
        key=np.uint64(5),
        controller=replace(main, adaptation=both),
        nominal=nominal,
        calibration=calibration,
        start=Pose(*calibration.poses[-1].tolist()),
    )
    session = Session(individual, settings.world, replace(settings.lifetime, record_every=0))
    session.step(200)
    believed = session.life.adaptation.place.now[0]
    assert believed["level"] == pytest.approx(nominal.sun_level, rel=0.3)
    assert believed["heading"] + math.pi / 2 == pytest.approx(session.pose.heading, abs=0.1)


def test_a_champion_that_came_near_no_wall_recognises_nothing():
    settings, genome = config(TRAINED["light"]), load_genome("reference_4", "light")
    nominal = replace(genome.nominal, gain_rad_s=settings.lifetime.gain_rad_s, sun=np.ones(3), echo=np.zeros((2, 0)))
    with pytest.raises(ConfigError, match="needs echoes of walls to remember"):
        remembered_for(replace(genome, nominal=nominal), settings, 1, print)
