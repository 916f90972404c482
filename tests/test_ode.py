"""Physics in three dimensions, beside an independent program in C++, a golden file, and the physics of the plane."""

import io
import math
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from cases import done

from epuckhebb.config import training_world
from epuckhebb.config.compose import load
from epuckhebb.config.schema import EvaluateConfig
from epuckhebb.export.replay import recording, recording_page
from epuckhebb.gym import TMaze
from epuckhebb.live.world import LiveWorld
from epuckhebb.runs import prepare_evaluation, repeat
from epuckhebb.runs.notes import evaluation_notes
from epuckhebb.runtime.errors import ConfigError
from epuckhebb.store import Run
from epuckhebb.store.genome import load_genome
from epuckhebb.studies import leaderboard
from epuckhebb.studies.champions import move_world, world_evaluation
from epuckhebb.tmaze import libode
from epuckhebb.tmaze.batch import run_lifetimes
from epuckhebb.tmaze.block import LostRobotError
from epuckhebb.tmaze.individual import Individual
from epuckhebb.tmaze.life import Lifetime
from epuckhebb.tmaze.session import Session

ROOT = Path(__file__).parents[1]
REFERENCE = ROOT / "runs" / "reference"
try:
    libode.library()
    MISSING = ""
except ValueError as error:
    MISSING = str(error)
needs_ode = pytest.mark.skipif(bool(MISSING), reason=MISSING)

# Of a program in C++ with the same library and its own maze, sensors and network: time to the goal [s], path [m], final
# distance [m], mean weight change, without noise, for genomes of data/genomes.npz. Its path has the third dimension.
IN_CPP = {
    (0, "base", "left", False): (79.84, 0.8783, 0.0295, 0.0),
    (0, "4obstacles", "right", True): (math.nan, 0.6439, 0.2258, 3.0336),
    (1, "base", "left", True): (math.nan, 0.5298, 0.3671, 3.0824),
    (1, "4obstacles", "left", True): (187.136, 0.9095, 0.0294, 3.1090),
    (3, "2obstacles", "right", True): (50.08, 0.9031, 0.0327, 2.0899),
    (4, "highlight", "right", False): (88.832, 0.8837, 0.0327, 0.0),
    (4, "lowlight", "left", True): (62.496, 0.8810, 0.0295, 296.4620),
    (5, "lowlight", "right", False): (math.nan, 0.3168, 0.6360, 0.0),
}


def config(*overrides):
    return load(EvaluateConfig, ["physics=ode", *overrides])


def individual(genes, side="left", key=1, controllers=(), record=True):
    own = {"controller": controllers[0]} if controllers else {}
    return Individual(genes=genes, side=side, key=np.uint64(key), record=record, **own)


@needs_ode
@pytest.mark.parametrize("case", IN_CPP, ids=str)
def test_a_lifetime_is_that_of_an_independent_program(case, genomes):
    number, scenario, side, plastic = case
    signal = "lifetime_mean" if number < 4 else "light_code"
    asked = config(f"scenario={scenario}", f"hebbian.signal={signal}")
    who = individual(genomes[number], side, controllers=asked.controllers if plastic else (), record=False)
    session = Session(who, asked.world, Lifetime(duration_s=asked.lifetime.duration_s, noise=0.0))
    session.step(session.lifetime.steps)
    found, expected = session.outcome(), IN_CPP[case]
    measured = found.time_to_goal, found.path_length, found.final_distance, found.weight_change_mean
    assert measured == pytest.approx(expected, rel=0.008, abs=1e-3, nan_ok=True)


@needs_ode
def test_a_lifetime_of_a_bundled_champion_is_as_ever(golden):
    asked, genome = config("scenario=2obstacles", "hebbian.N=0.002"), load_genome("reference", "obstacles")
    lifetime = Lifetime(duration_s=60, gain_rad_s=4, record_every=125)
    both = [individual(genome.genes, side, controllers=asked.controllers) for side in ("left", "right")]
    rows = []
    for side, (outcome, samples) in zip(("left", "right"), run_lifetimes(both, asked.world, lifetime), strict=True):
        for time, pose, tilt in zip(samples.time, samples.pose, samples.tilt, strict=True):
            rows.append([side, *(round(number, 6) for number in (time, *pose, *tilt)), math.nan])
        rows.append([side, 60.0, *[math.nan] * 6, round(outcome.fitness, 6)])
    text = io.StringIO()
    columns = ["side", "time", "x", "y", "heading", "roll", "pitch", "height", "fitness"]
    pd.DataFrame(rows, columns=columns).to_csv(text, index=False)
    golden("ode.csv", text.getvalue())


@needs_ode
def test_it_is_bit_identical_on_any_number_of_threads_and_in_pieces(genomes):
    asked, lifetime = config("scenario=4obstacles"), Lifetime(duration_s=20, gain_rad_s=4, record_every=5)
    robots = [individual(genomes[key % 4], key=key, controllers=asked.controllers) for key in range(8)]
    alone = run_lifetimes(robots, asked.world, lifetime)
    for (outcome, samples), (other, others) in zip(
        alone, run_lifetimes(robots, asked.world, lifetime, threads=4), strict=True
    ):
        assert np.array_equal(outcome, other, equal_nan=True)
        assert np.array_equal(samples.pose, others.pose)
        assert np.array_equal(samples.tilt, others.tilt)
    session = Session(robots[5], asked.world, lifetime)
    while not session.is_over:
        session.step(7)
    assert np.array_equal(session.outcome(), alone[5][0], equal_nan=True)


@needs_ode
def test_a_world_may_change_meanwhile(genomes):
    changes = "scenario.changes=[{at_s: 4, obstacles: 4, light: 1.0}]"
    asked, lifetime = config("scenario=base", changes), Lifetime(duration_s=8, gain_rad_s=4, record_every=1)
    before = run_lifetimes([individual(genomes[3])], config("scenario=base").world, lifetime)[0][1]
    after = run_lifetimes([individual(genomes[3])], asked.world, lifetime)[0][1]
    assert np.array_equal(before.pose[:125], after.pose[:125])
    assert np.abs(np.diff(after.pose[:, :2], axis=0)).max() < 0.004  # it goes on from where it is
    assert not np.array_equal(before.sensors[125:], after.sensors[125:])


@pytest.mark.thorough
@needs_ode
def test_a_robot_that_falls_over_ends_its_lifetime_with_a_reason(genomes):
    asked = config("physics.put_down=[1,0,0,1.2]")
    with pytest.raises(LostRobotError, match="left the arena"):
        run_lifetimes([individual(genomes[0])], asked.world, Lifetime(duration_s=2))


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (["robot.solid=null"], "robot.solid"),
        (["robot.solid.mass_kg=0"], "robot.solid"),
        (["robot.solid.hull_m=[0.04,0.01]"], "robot.solid"),
        (["maze.wall_height_m=null"], "maze.wall_height_m"),
        (["maze.wall_height_m=0"], "maze.wall_height_m"),
        (["scenario.wall_friction=0.1"], "scenario.wall_friction"),
        (["task=reversal"], "task=reversal"),
        (["physics.friction=-1"], "physics.friction"),
        (["physics.put_down=[0,0,0,1]"], "physics.put_down"),
        (["physics.sun=3"], "physics.sun"),
    ],
    ids=str,
)
def test_what_three_dimensions_lack_is_refused(words, named):
    with pytest.raises(ConfigError, match=named):
        config(*words)


def test_without_the_library_one_message_names_the_package(monkeypatch):
    monkeypatch.setattr(libode, "_NAMES", ("libode_of_nobody.so",))
    libode.library.cache_clear()
    try:
        world = config().world
        with pytest.raises(ValueError, match="apt-get install libode8"):
            world.physics.mover(world.robot)
    finally:
        libode.library.cache_clear()


@pytest.mark.thorough
@needs_ode
def test_a_pinned_robot_turns_in_the_plane_and_stays_in_three_dimensions():
    turned = {}
    for physics in ("pymunk", "ode"):
        env = TMaze("base", overrides=[f"physics={physics}", "lifetime.noise=0"])
        env.reset(options={"side": "left", "key": 1})
        for step in range(900):  # ahead to the far wall, then obliquely against it
            env.step(np.array([1.0, 1.0] if step < 250 else [0.9, 0.6]))
        turned[physics] = abs(math.degrees(env.session.pose.heading) - 90)
    assert turned["pymunk"] > 540
    assert turned["ode"] < 1


@needs_ode
def test_a_life_changed_by_hand_is_kept_with_roll_and_pitch_and_repeats(here):
    world = LiveWorld(["physics=ode", "scenario=4obstacles", "hebbian.N=0.0005"], "left")
    for wish in (
        {"light": 1.0},
        {"placed": [[0.0, 0.0, 0.03, 0.04]]},
        {"put": [0.007, -0.1, 1.0]},
        {"right_wheel": 0.5},
    ):
        world.wish(wish)
        world.run(40)
    saved = world.save()
    assert saved["same"]
    run = Run(here / saved["run"])
    with np.load(io.BytesIO(run.content("traces.npz"))) as arrays:
        assert arrays["tilt"].shape == (*arrays["pose"].shape[:2], 3)
        assert np.abs(arrays["tilt"]).max() > 0
    again, difference = repeat(run.path)
    assert difference == ""
    assert recording_page(recording(again))


@needs_ode
def test_a_test_world_of_a_study_has_its_own_physics_or_that_of_the_study(tmp_path):
    of_plane, of_ode = [], ["physics=ode"]
    (tmp_path / "change").mkdir()
    (tmp_path / "change" / "mine.yaml").write_text("physics: ode\nlight: 0.5\n")
    for words, name, physics in (
        (of_plane, "base+3d", "ode"),
        (of_plane, "4obstacles", "pymunk"),
        (of_ode, "4obstacles", "ode"),
        (of_ode, "base+plane", "pymunk"),
        (of_plane, "base+mine", "ode"),
    ):
        other = world_evaluation(name, str(tmp_path))
        there = move_world(prepare_evaluation(load(EvaluateConfig, words)), other).config
        scenario, *changes = name.split("+")
        alone = load(EvaluateConfig, [f"scenario={scenario}", f"change={changes}", *words], str(tmp_path))
        assert there.world.physics.name == alone.world.physics.name
        assert there.world.physics.name == physics


@needs_ode
@pytest.mark.usefixtures("here")
def test_a_champion_knows_its_physics_and_compares_with_a_life_in_it():
    small = ["ga.population=4", "ga.elites=1", "ga.loops=1", "ga.generations=1", "scenario.paper_duration_s=10"]
    done("evolve", "physics=ode", *small, "lifetime.duration_s=1", "hydra.run.dir=deep", "-q")
    assert "physics ode" in done("show", "deep").stdout
    asked = load(EvaluateConfig, ["genome=deep", "scenario=base", "hebbian=none"])
    genome = load_genome("deep", "obstacles")
    assert genome.physics == "ode"
    assert training_world(asked, genome.physics).physics.name == "ode"
    (note,) = evaluation_notes(genome, asked)
    assert "physics ode (here pymunk)" in note
    assert evaluation_notes(genome, load(EvaluateConfig, ["genome=deep", "physics=ode"])) == []
    assert evaluation_notes(load_genome("reference_7", "obstacles"), asked) == []


@needs_ode
@pytest.mark.thorough
def test_a_method_that_evolves_in_three_dimensions_is_tested_there(tmp_path):
    (tmp_path / "method").mkdir()
    (tmp_path / "method" / "deep.yaml").write_text("evolve: {physics: ode, optimizer: ga}\n", encoding="utf-8")
    planned = leaderboard.plan("obstacles", ["methods=deep", "champions=1"], config_dir=str(tmp_path))
    assert [job.config["config"]["physics"]["kind"] for job in planned.jobs] == ["ode", "ode"]


@pytest.mark.thorough
@needs_ode
def test_an_adaptation_is_added_in_three_dimensions_to_what_a_champion_knows_of_the_plane():
    asked = load(
        EvaluateConfig, ["scenario=base", "change=[3d]", "adaptation=wall_following", "hebbian=none", "repeats=1"]
    )
    assert asked.world.name == "base_3d"
    assert training_world(asked).physics.name == "pymunk"
    prepared = prepare_evaluation(asked)
    rows, _ = prepared.run(1)
    assert {row["controller"] for row in rows} == {"GA", "wall_following"}
