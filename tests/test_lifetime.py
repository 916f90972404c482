"""A lifetime against its oracle, against an independent prototype, and against itself."""

import csv
import math
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import reference
from hypothesis import given, settings
from hypothesis import strategies as st

from epuckhebb.sim.fitness import Signal
from epuckhebb.sim.lifetime import Life, Lifetime, LostRobotError, live_block
from epuckhebb.sim.light import Lamp
from epuckhebb.sim.maze import SIDES, Pose
from epuckhebb.sim.plasticity import Hebbian
from epuckhebb.sim.scenario import Scenario

DATA = Path(__file__).parent / "data"
LAMPS = {"wide": Lamp(), "narrow": Lamp(y_m=-0.3, beam_rad=0.8)}


@pytest.mark.parametrize("signal", list(Signal))
@pytest.mark.parametrize("side", SIDES)
def test_agrees_with_the_oracle_step_by_step(genomes, side, signal):
    scenario, hebbian = Scenario(obstacles=4), Hebbian(N=0.002, signal=signal)
    life = Life(genome=genomes[1], side=side, hebbian=hebbian, key=np.uint64(9), record=True)
    lifetime = Lifetime(duration_s=30, gain_rad_s=4, record_every=1)
    outcome, samples = live_block([life], scenario, lifetime)[0]

    robot = reference.Robot(genomes[1], scenario, side, hebbian, gain=4, key=np.uint64(9))
    expected, steps = reference.live(robot, lifetime.steps)

    np.testing.assert_allclose(samples.pose, [s[:3] for s in steps], rtol=0, atol=1e-8)
    np.testing.assert_allclose(samples.sensors, [s[3] for s in steps], rtol=0, atol=1e-6)
    np.testing.assert_allclose(samples.motors, [s[4:6] for s in steps], rtol=0, atol=1e-6)
    np.testing.assert_allclose(samples.fitness, [s[7] for s in steps], rtol=0, atol=1e-6)
    np.testing.assert_allclose(samples.rate, [s[8] for s in steps], rtol=1e-5, atol=0)
    np.testing.assert_allclose(samples.weight_change, [s[9] for s in steps], rtol=1e-5, atol=1e-12)
    np.testing.assert_allclose(outcome, expected, rtol=1e-6, atol=1e-8)


@pytest.mark.parametrize("side", SIDES)
def test_agrees_with_the_prototype_step_by_step(genomes, lived, side):
    with (DATA / "trace.csv").open() as file:
        rows = [row for row in csv.DictReader(file) if row["side"] == side]
    _, samples = lived(genomes[0], side, N=0.002, seconds=20, noise=0)
    for row in rows:
        k = int(row["step"])
        mine = [*samples.pose[k], *samples.sensors[k], *samples.motors[k], samples.fitness[k], samples.weight_change[k]]
        assert mine == pytest.approx([float(value) for value in list(row.values())[2:]], abs=1e-6)


def test_agrees_with_the_prototype_over_whole_lifetimes(genomes):
    expected = pd.read_csv(DATA / "expected.csv", keep_default_na=False)
    differences = []
    for (name, duration), group in expected.groupby(["scenario", "duration_s"]):
        first = group.iloc[0]
        scenario = Scenario(name=name, light=float(first.light), obstacles=int(first.obstacles), lamp=LAMPS[first.lamp])
        lives = [
            Life(
                genome=genomes[row.genome],
                side=row.side,
                hebbian=Hebbian(N=row.N, signal=Signal[row.signal or "behaviour"]),
                key=np.uint64(0),
            )
            for row in group.itertuples()
        ]
        outcomes = live_block(lives, scenario, Lifetime(duration_s=float(duration), noise=0), threads=2)
        differences += [
            (
                outcome.success != bool(row.success),
                abs(outcome.path_length - row.path_length_m),
                abs(outcome.final_distance - row.final_position_error_m),
                abs(outcome.weight_change_mean - row.weight_change_mean) / max(row.weight_change_mean, 1.0),
                abs(outcome.fitness - row.fitness),
            )
            for row, (outcome, _) in zip(group.itertuples(), outcomes, strict=True)
        ]
    differences = np.array(differences, float)
    assert len(differences) == 180
    assert (np.median(differences, axis=0) < 1e-5).all()
    within = (differences < [0.5, 1e-3, 1e-3, 0.03, 1e-3]).mean(axis=0)
    assert (within > 0.88).all(), within


def test_alone_in_a_block_and_on_any_threads_the_bits_are_the_same(genomes):
    lives = [
        Life(genome=genome, side=side, hebbian=Hebbian(N=N), key=np.uint64(k))
        for k, genome in enumerate(genomes)
        for side in SIDES
        for N in (0.0, 1.5e-5, 0.002)
    ]
    scenario, lifetime = Scenario(obstacles=4), Lifetime(duration_s=40, gain_rad_s=4)
    together = [outcome for outcome, _ in live_block(lives, scenario, lifetime)]
    for threads in (2, 3, 16):
        assert _bits([o for o, _ in live_block(lives, scenario, lifetime, threads)]) == _bits(together)
    alone = [live_block([life], scenario, lifetime)[0][0] for life in lives]
    assert _bits(alone) == _bits(together)
    backwards = [outcome for outcome, _ in live_block(lives[::-1], scenario, lifetime)][::-1]
    assert _bits(backwards) == _bits(together)


def _bits(outcomes):
    return np.array(outcomes).tobytes()


@settings(deadline=None, max_examples=25)
@given(seed=st.integers(0, 2**32 - 1), side=st.sampled_from(SIDES), N=st.sampled_from([0.0, 1e-5, 0.002, 1.0, 1e6]))
def test_weights_stay_in_bounds_and_the_genome_survives(lived, seed, side, N):
    genome = np.random.default_rng(seed).uniform(-1, 1, 234)
    before = genome.copy()
    outcome, samples = lived(genome, side, N=N, seconds=3)
    assert (genome == before).all()
    assert np.abs(samples.weights).max() <= 2
    assert np.isfinite(samples.pose).all()
    if N == 0:
        assert (samples.weights == before.astype(np.float32)).all()
        assert outcome.weight_change_mean == outcome.weight_change_final == 0
    else:
        assert outcome.weight_change_final > 0


def test_a_robot_that_does_not_move_has_known_metrics(lived):
    outcome, samples = lived(np.zeros(234), seconds=8, noise=0)
    assert outcome.path_length == 0
    assert math.isnan(outcome.time_to_goal)
    assert not outcome.success
    assert outcome.final_distance == pytest.approx(math.hypot(0.367, 0.505))
    nearest = samples.sensors[0, 8:].max()
    assert outcome.behaviour == pytest.approx((0 + 2 * (1 - nearest**3) + 1 + 0) / 5)
    assert outcome.fitness == pytest.approx(outcome.behaviour / 2)  # no reward farther than 0.59 m from the goal


def test_what_is_learnt_is_forgotten(genomes, lived):
    first, again = (lived(genomes[0], N=0.002)[0] for _ in range(2))
    assert _bits(first) == _bits(again)


def test_noise_matters_and_depends_on_the_key(genomes, lived):
    quiet = lived(genomes[0], noise=0)[0]
    assert lived(genomes[0], noise=0, key=2)[0] == pytest.approx(quiet, nan_ok=True)
    assert lived(genomes[0], key=1)[0].path_length != lived(genomes[0], key=2)[0].path_length


def test_samples_are_every_so_many_steps(genomes, lived):
    _, every = lived(genomes[0], N=0.002)
    _, third = lived(genomes[0], N=0.002, record_every=3)
    for name in every._fields:
        np.testing.assert_array_equal(getattr(third, name), getattr(every, name)[::3])


def test_a_robot_that_is_lost_fails_loudly(genomes):
    for start in (Pose(math.nan, 0.0, 0.0), Pose(0.0, 0.0, math.inf), Pose(0.6, 0.0, 0.0)):
        life = Life(genome=genomes[0], side="left", hebbian=Hebbian(), key=np.uint64(0), start=start)
        with pytest.raises(LostRobotError, match=r"left trial of scenario base .* at step 0 of 250"):
            live_block([life], Scenario(), Lifetime(duration_s=8))


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("duration_s", 0.0),
        ("duration_s", math.inf),
        ("gain_rad_s", 0.0),
        ("gain_rad_s", 6.3),
        ("gain_rad_s", math.nan),
        ("noise", -1.0),
        ("record_every", -1),
    ],
)
def test_impossible_lifetimes_are_refused_by_name(key, value):
    with pytest.raises(ValueError, match=rf"lifetime\.{key} must"):
        Lifetime(**{key: value})


@pytest.mark.parametrize(
    ("key", "value", "allowed"),
    [("obstacles", 3, "0, 2, 4"), ("light", math.nan, "0 or more"), ("experiment", "x", "light, obstacles")],
)
def test_impossible_scenarios_are_refused_by_name(key, value, allowed):
    with pytest.raises(ValueError, match=rf"scenario\.{key} must .*{allowed}"):
        Scenario(**{key: value})
