"""The worlds of docs/changes.md: each differs from its base as the page says, lets a robot run, and is sensed by it."""

import re
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from omegaconf import OmegaConf

from epuckhebb.adaptation.controller import GA_ALONE
from epuckhebb.config.compose import composed
from epuckhebb.config.names import training_world, world_of
from epuckhebb.runtime.resources import data_folder
from epuckhebb.tmaze.maze import SIDES
from epuckhebb.tmaze.physics.pymunk import PYMUNK

CONF = [data_folder("conf")]
OTHER_LIGHT = {"base": 1, "highlight": 0.1}
LAMP_Y = {"base": -0.2, "highlight": -0.3}
SINGLE = {  # name -> what differs from the base
    "lamp_ahead": "lamp.y_m={ahead:g}",
    "lamp_back": "lamp.y_m={back:g}",
    "lamp_dim": "lamp.intensity=0.2",
    "lamp_faint": "lamp.intensity=0.02",
    "lamp_gone": "lamp.intensity=0",
    "ir_low": "distance_gain=0.77",
    "ir_high": "distance_gain=1.3",
    "ir_zeroed": "distance_offset=-0.0336",
    "ir_raised": "distance_offset=0.05",
    "two_dead_ahead": "dead_sensors=[0,7]",
    "two_dead_sides": "dead_sensors=[2,5]",
    "slip": "left_slip=0.2, right_slip=0.2",
    "slip_left": "left_slip=0.4",
    "heavy": "mass_ratio=2",
    "friction_10": "wall_friction=0.1",
    "friction_30": "wall_friction=0.3",
    "wide": "maze=t_maze_110",
    "narrow": "maze=t_maze_90",
    "goals_nearer": "goals=left:-0.323,0.155/right:0.323,0.155",
    "goals_midway": "goals=left:-0.24,0.155/right:0.24,0.155",
    "light_changes": "light={other:g} at 40 s",
    "light_flickers": ", ".join(f"light={{{('other', 'own')[k % 2]}:g}} at {25 * (k + 1)} s" for k in range(7)),
    "dead_later": "dead_sensors=[0,7] at 40 s",
}
FLICKERS = ", ".join(
    f"lamp={{{{intensity:{(0, 2)[k % 2]}}}}} at {at} s"
    for k, at in enumerate(at + later for at in range(5, 46, 8) for later in (0, 3))
)
THIRD = {  # written down before any method of `find` and `stay` ran in them
    "sun_30": "sun_turn_deg=30",
    "sun_90": "sun_turn_deg=90",
    "sun_180": "sun_turn_deg=180",
    "dark": "light=0",
    "sun_moves": ", ".join(f"sun_turn_deg={15 * k} at {20 * k} s" for k in range(1, 7)),
    "start_turned": "start=0.007/-0.35/135",
    "start_displaced": "start=-0.003/-0.25/80",
    "motors_late": "wheel_delay_steps=3",
    "readings_late": "sensor_delay_steps=3",
    "coarse": "sensor_levels=16",
    "crosstalk": "crosstalk=0.1",
    "ir_one_side": "left_distance_gain=0.59",
    "lamp_flickers": FLICKERS,
    "second_lamp": "second_lamp=[-0.3,0.55,0.2]",
    "mirrored": "maze=t_maze_mirrored",
    "long_stem": "maze=t_maze_long",
    "bends": "maze=t_maze_bends",
}
OF_THE_SIGNAL = {  # what only an adaptation that is given the goal signal senses
    "signal_false": "goal_signal.false_share=0.05",
    "signal_late": "goal_signal.delay_s=1",
    "signal_rare": "goal_signal.every_s=1",
    "signal_wide": "goal_signal.radius_ratio=2",
    "signal_by_chance": "goal_signal.chance_s=200",
}
PAIRS = {
    "ir_low_slip": ("ir_low", "slip"),
    "lamp_dim_two_dead_sides": ("two_dead_sides", "lamp_dim"),
    "narrow_slip_left": ("narrow", "slip_left"),
    "wide_lamp_ahead": ("wide", "lamp_ahead"),
    "heavy_friction_30": ("heavy", "friction_30"),
    "two_dead_ahead_light_changes": ("two_dead_ahead", "light_changes"),
}
THIRD_PAIRS = {
    "sun_90_motors_late": ("sun_90", "motors_late"),
    "long_stem_coarse": ("long_stem", "coarse"),
    "bends_ir_one_side": ("bends", "ir_one_side"),
}
NAMES = [*SINGLE, *PAIRS, *THIRD, *THIRD_PAIRS, *OF_THE_SIGNAL]
DIFFERENCE = {**SINGLE, **THIRD, **OF_THE_SIGNAL}
TWO = {**PAIRS, **THIRD_PAIRS}
ON_THE_RIGHT_ALONE = {name for name in DIFFERENCE if name.startswith("lamp")}  # where the lamp is lit
BASES = pytest.mark.parametrize("base", list(OTHER_LIGHT))


def part(group, name):
    return OmegaConf.to_container(OmegaConf.load(CONF[0] / group / f"{name}.yaml"))


@cache
def world(name):
    return world_of(name, part("robot", "epuck"), CONF)


def expected(base, name):
    if name in TWO:
        return ", ".join(expected(base, part) for part in TWO[name])
    own, lamp = world(base).light, LAMP_Y[base]
    return DIFFERENCE[name].format(own=own, other=OTHER_LIGHT[base], ahead=lamp + 0.05, back=lamp - 0.05)


@BASES
@pytest.mark.parametrize("name", NAMES)
def test_differs_from_its_base_as_the_page_says(base, name):
    assert world(f"{base}_{name}").changed_from(world(base)) == expected(base, name)


def test_all_worlds_are_in_the_docs_and_the_third_set_has_fifteen_or_more():
    rows = re.findall(r"^\| (`.*?) \|", (Path(__file__).parents[1] / "docs" / "changes.md").read_text(), re.MULTILINE)
    assert re.findall(r"`(\w+)`", " ".join(rows)) == NAMES
    assert len(THIRD) + len(THIRD_PAIRS) >= 15


def test_another_maze_takes_precedence_over_that_of_a_scenario():
    cfg = composed("evaluate", ["scenario=base_narrow", "maze=double_t"])
    assert (cfg.maze.name, cfg.changed) == ("double_t", "maze=double_t")
    for name, maze, base in (
        ("base_narrow", "t_maze_90", "t_maze"),
        ("base_narrow", "t_maze_wide", "t_maze_wide"),
        ("base", "t_maze_90", "t_maze_90"),
    ):
        assert training_world("light", name, part("maze", maze), part("robot", "epuck"), PYMUNK).maze.name == base


@BASES
@pytest.mark.parametrize("side", SIDES)
def test_a_robot_senses_every_change(run_lifetime, constant, base, side):
    """One that turns on the spot as it goes, so that it looks everywhere, meets walls, and knows nothing of worlds."""
    settings = {"side": side, "seconds": 64, "gain_rad_s": 4.0, "controller": GA_ALONE, "noise": 0}
    same = {}
    for name in ("", *NAMES):
        there = world(f"{base}_{name}" if name else base)
        outcome, samples = run_lifetime(constant(0.9, 0.6), scenario=there, **settings)
        assert np.isfinite(samples.pose).all()
        same[name] = samples.sensors.tobytes(), samples.pose.tobytes(), outcome.final_distance
    unfelt = {name for name in NAMES if same[name] == same[""]}
    assert unfelt == {*OF_THE_SIGNAL, *(ON_THE_RIGHT_ALONE if side == "left" else ())}
