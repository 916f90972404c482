"""The worlds of docs/changes.md: each is on the page, lets a robot run, and is sensed by it."""

import re
from pathlib import Path

import numpy as np
import pytest
from cases import world_named

from epuckhebb.adaptation.controller import GA_ALONE
from epuckhebb.config import EvaluateConfig, load, training_world
from epuckhebb.config.compose import composed
from epuckhebb.tmaze.maze import SIDES
from epuckhebb.tmaze.physics.pymunk import PYMUNK

SINGLE = (
    *("lamp_ahead", "lamp_back", "lamp_dim", "lamp_faint", "lamp_gone", "ir_low", "ir_high", "ir_zeroed", "ir_raised"),
    *("two_dead_ahead", "two_dead_sides", "slip", "slip_left", "heavy", "friction_10", "friction_30", "wide", "narrow"),
    *("goals_nearer", "goals_midway", "light_changes", "light_flickers", "dead_later"),
)
PAIRS = (
    *("ir_low_slip", "lamp_dim_two_dead_sides", "narrow_slip_left", "wide_lamp_ahead", "heavy_friction_30"),
    "two_dead_ahead_light_changes",
)
THIRD = (  # written down before any method of `find` and `stay` ran in them
    *("sun_30", "sun_90", "sun_180", "dark", "sun_moves", "start_turned", "start_displaced", "motors_late"),
    *("readings_late", "coarse", "crosstalk", "ir_one_side", "lamp_flickers", "second_lamp", "mirrored", "long_stem"),
    "bends",
)
THIRD_PAIRS = ("sun_90_motors_late", "long_stem_coarse", "bends_ir_one_side")
# What only an adaptation that is given the goal signal senses.
OF_THE_SIGNAL = ("signal_false", "signal_late", "signal_rare", "signal_wide", "signal_by_chance")
NAMES = [*SINGLE, *PAIRS, *THIRD, *THIRD_PAIRS, *OF_THE_SIGNAL]
ON_THE_RIGHT_ALONE = {name for name in NAMES if name.startswith("lamp") and name not in PAIRS}  # where the lamp is lit
BASES = pytest.mark.parametrize("base", ["base", "highlight"])


def test_all_worlds_are_in_the_docs_and_the_third_set_has_fifteen_or_more():
    rows = re.findall(r"^\| (`.*?) \|", (Path(__file__).parents[1] / "docs" / "changes.md").read_text(), re.MULTILINE)
    assert re.findall(r"`(\w+)`", " ".join(rows)) == NAMES
    assert len(THIRD) + len(THIRD_PAIRS) >= 15


def test_another_maze_takes_precedence_over_that_of_a_change():
    cfg = composed("evaluate", ["change=[narrow]", "maze=double_t"])
    assert (cfg.maze.name, cfg.changed) == ("double_t", "maze=double_t")
    for words, maze in (
        (["change=[narrow]"], "t_maze"),
        (["change=[narrow]", "maze=t_maze_wide"], "t_maze_wide"),
        (["maze=t_maze_90"], "t_maze_90"),
    ):
        assert training_world(load(EvaluateConfig, words), "light", PYMUNK).maze.name == maze


@BASES
@pytest.mark.parametrize("side", SIDES)
def test_a_robot_senses_every_change(run_lifetime, constant, base, side):
    """One that turns on the spot as it goes, so that it looks everywhere, meets walls, and knows nothing of worlds."""
    settings = {"side": side, "seconds": 64, "gain_rad_s": 4.0, "controller": GA_ALONE, "noise": 0}
    same = {}
    for name in ("", *NAMES):
        there = world_named(f"{base}_{name}" if name else base)
        outcome, samples = run_lifetime(constant(0.9, 0.6), scenario=there, **settings)
        assert np.isfinite(samples.pose).all()
        same[name] = samples.sensors.tobytes(), samples.pose.tobytes(), outcome.final_distance
    unfelt = {name for name in NAMES if same[name] == same[""]}
    assert unfelt == {*OF_THE_SIGNAL, *(ON_THE_RIGHT_ALONE if side == "left" else ())}
