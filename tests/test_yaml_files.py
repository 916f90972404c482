"""YAML files of the user's: they win over the program's, and what is no plain setting in them is refused by line."""

import time
from pathlib import Path

import numpy as np
import pytest
import yaml
from cases import done, first_of, refused
from omegaconf import OmegaConf

import epuckhebb
from epuckhebb.config.compose import composed
from epuckhebb.config.schema import plain
from epuckhebb.runtime import conf, yaml_file
from epuckhebb.runtime.errors import ConfigError
from epuckhebb.runtime.resources import data_folder

QUICK = ["repeats=1", "lifetime.duration_s=0.064", "lifetime.record_every=0", "--config-dir", "conf"]
REFUSED = {
    "light: 0.2\nobstacles: 0\nlight: 0.3\n": "mine.yaml, line 3: while constructing a mapping, found dupl",
    "lamp: {x_m: 0, x_m: 1}\n": "mine.yaml, line 1: while constructing a mapping, found duplicate key x_m",
    "light: [0.2\nobstacles: 3\n": "mine.yaml, line 2: while parsing a flow sequence, ",
    "light: !!python/object/apply:os.getcwd []\n": "mine.yaml, line 1: could not determine a constructor for the tag",
    "changes: &a [*a]\n": "mine.yaml: it stands for more than",
    "? [1, 2]\n: 3\n": "mine.yaml, line 1: while constructing a mapping, found unhashable key",
    "# @package a b\nlight: 0.2\n": "Too many components in",
    "light: ${\n": "scenario/mine.yaml",
    "- light\n": "scenario/mine",
    "defaults: 5\n": "scenario/mine",
    "defaults: [{1: base}]\n": "scenario=mine",
    "defaults: [{a: {b: c}}]\n": "scenario=mine",
    "defaults: [_self_, base]\nlight: 0.05\n": "mine.yaml: base comes after _self_",
    "defaults: [mine, _self_]\n": "defaults lead back to itself",
    "defaults: [{/scenario: other}]\n": "defaults lead back to itself",
}


@pytest.fixture
def mine(here):
    """Write a file of the user's; the current folder is the one above `conf`."""

    def write(text, name="scenario/mine.yaml"):
        file = here / "conf" / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text, encoding="utf-8")

    return write


@pytest.mark.parametrize("text", first_of(REFUSED, 6), ids=range(len(REFUSED)))
def test_what_is_no_plain_setting_is_refused_with_file_and_line(mine, tmp_path, text):
    mine(text)
    mine("defaults: [mine]\n", "scenario/other.yaml")
    told = refused("evaluate", "scenario=mine", *QUICK)
    assert REFUSED[text] in told
    assert [path.name for path in tmp_path.iterdir()] == ["conf"]


SEVERAL_READINGS = [("light", text) for text in ("010", "1:30", "0x10", "1_0", "-07", "0b1", "1:30:20.5")]
SEVERAL_READINGS += [("dead_sensors", "[1, 010]"), ("lamp", "{intensity: 1_000.5}")]


@pytest.mark.parametrize(("key", "text"), SEVERAL_READINGS)
def test_a_number_with_several_readings_is_refused_in_files_and_words_alike(mine, key, text):
    mine(f"defaults: [base, _self_]\n{key}: {text}\n")
    for words in ([f"scenario.{key}={text}"], ["scenario=mine"]):
        with pytest.raises(ConfigError, match=rf"({key}=|mine\.yaml, line 2).*has several readings"):
            composed("evaluate", words, "conf")
    mine(f"{key}: {text}\n", "change/mine.yaml")
    with pytest.raises(ConfigError, match=r"change/mine\.yaml, line 1.*has several readings"):
        composed("evaluate", ["change=mine"], "conf")


@pytest.mark.parametrize("name", ["scenario/mine", "change/mine"])
def test_a_file_whose_aliases_stand_for_too_many_values_is_refused_before_any_is_made(mine, monkeypatch, name):
    mine("a: &a [1, 2, 3]\nchanges: [*a, *a, *a]\n", f"{name}.yaml")
    monkeypatch.setattr(yaml_file, "MOST_VALUES", 11)
    with pytest.raises(ConfigError, match=r"mine\.yaml: .* 11 values"):
        composed("evaluate", [f"{name.partition('/')[0]}=mine"], "conf")
    monkeypatch.setattr(yaml_file, "MOST_VALUES", 12)
    assert yaml_file.load(Path("conf", f"{name}.yaml"))["changes"] == [[1, 2, 3]] * 3


def test_plain_numbers_and_texts_are_no_numbers_with_several_readings(mine):
    mine("defaults: [base, _self_]\nlight: 0.5\nname: '010'\nlamp: {x_m: -0.01, intensity: 1e-1}\n")
    words = [
        "scenario=mine",
        "scenario.sun_turn_deg=0",
        "scenario.wall_friction=0.5",
        "genome=runs/2026_010/champion.npz",
    ]
    read = composed("evaluate", [*words, "scenario.dead_sensors=[0,1]"], "conf")
    assert (read.scenario.light, read.scenario.name, read.scenario.lamp.intensity) == (0.5, "010", 0.1)
    assert read.genome == "runs/2026_010/champion.npz"


def test_the_folder_of_the_user_is_not_walked():
    began = time.process_time()
    assert composed("evaluate", [], "/").changed == ""
    assert time.process_time() - began < 5


def test_what_does_not_mean_what_it_says_is_refused_where_it_is_used(mine):
    mine("defaults: [_self_, base]\nlight: 0.05\n", "scenario/inner.yaml")
    mine("defaults: [inner]\n")
    assert "inner.yaml: base comes after _self_" in refused("evaluate", "scenario=mine", *QUICK)
    mine("defaults: [_self_, base]\n")  # there is no value to replace
    assert composed("evaluate", ["scenario=mine"], "conf").scenario.light == 0.1
    main = (data_folder("conf") / "evaluate.yaml").read_text().replace("  - _self_\n", "")
    early = main.replace("  - maze:", "  - _self_\n  - maze:", 1)
    mine(f"{early}scenario: {{light: 0.2}}\n", "evaluate.yaml")
    assert "scenario comes after _self_" in refused("evaluate", *QUICK)


def test_a_file_that_only_a_comparison_names_is_checked_too(mine):
    mine("# @package _global_\nadaptation: {threshold: 1, threshold: 2}\n", "adaptation/mine.yaml")
    told = refused("evaluate", "compare=[mine]", *QUICK)
    assert "adaptation/mine.yaml, line 2: while constructing a mapping, found duplicate key threshold" in told


def test_a_damaged_file_that_nobody_asks_for_is_no_obstacle(mine):
    mine("light: [")
    assert composed("evaluate", [], "conf").scenario.light == 0.1


@pytest.mark.parametrize("word", ["scenario.name=${oc.env:HOME}", "hydra.run.dir=x${oc.env:HOME}"])
def test_the_environment_is_not_read_whoever_asks(mine, word):
    mine(f"name: '{word.partition('=')[2]}'\n")
    for words in ([word], ["scenario=mine"]):
        told = refused("evaluate", *words, *QUICK)
        assert f"{'scenario.name' if words != [word] else word.partition('=')[0]}: environment variables" in told


def test_what_a_run_wrote_down_is_read_with_the_same_care(tmp_path):
    file = tmp_path / "config.yaml"
    file.write_text("a: [\n")
    with pytest.raises(ConfigError, match=r"config\.yaml, line 2"):
        yaml_file.load(file)
    file.write_text("rate: 1e-5\n")
    assert yaml_file.load(file) == {"rate": 1e-5}


def test_a_file_of_the_users_wins_over_the_programs_and_the_run_says_so(mine, tmp_path):
    base = yaml.safe_dump({**conf.table("scenario")["base"], "light": 0.7})
    mine(base, "scenario/base.yaml")
    done("evaluate", "scenario=base", *QUICK, "hydra.run.dir=out")
    header, row = (tmp_path / "out" / "metrics.csv").read_text().splitlines()[:2]
    assert row.split(",")[header.split(",").index("light")] == "0.7"
    assert '"light=0.7, lifetime.duration_s=0.064"' in row  # it is not the scenario of that name
    done("rerun", "out")


def test_what_differs_is_told_of_the_scenario_that_was_chosen(mine):
    mine("defaults: [base, _self_]\nlight: 0.7\n")
    assert composed("evaluate", ["scenario=mine"], "conf").changed == ""
    assert composed("evaluate", ["scenario=mine", "scenario.light=0.6"], "conf").changed == "light=0.6"
    mine("defaults: [base, _self_]\nobstacles: 2\n", "scenario/2obstacles.yaml")
    assert composed("evaluate", ["scenario=2obstacles"], "conf").changed == ""


@pytest.mark.parametrize("scheme", ["", "file://"])
def test_a_search_path_of_hydras_has_files_and_rows_too(mine, tmp_path, scheme):
    mine("light: 0.7\n", "change/dusk.yaml")
    mine("mine: {defaults: [base, _self_], obstacles: 2}\n", "scenarios.yaml")
    path = f"hydra.searchpath=['{scheme}{tmp_path / 'conf'}']"
    read = composed("evaluate", [path, "scenario=mine", "change=dusk", "scenario.layout=1"])
    assert (read.scenario.light, read.scenario.obstacles, read.changed) == (0.7, 2, "layout=1")


def test_a_maze_of_the_users_with_the_name_of_the_programs(mine):
    maze = (data_folder("conf") / "maze" / "t_maze.yaml").read_text()
    mine(maze.replace("arena_m: 0", "arena_m: 1"), "maze/t_maze.yaml")
    ours, theirs = (plain(composed("evaluate", [], folder).maze)["arena_m"] for folder in (None, "conf"))
    assert ours != theirs
    assert composed("evaluate", [], "conf").changed == f"maze.arena_m={theirs:g}"


@pytest.mark.parametrize("name", ["scenario/mine", "other/scenario/mine"])
def test_a_file_is_read_each_time_wherever_it_is(mine, name):
    for light in (0.2, 0.3):
        mine(f"defaults: [base, _self_]\nlight: {light}\n", f"{name}.yaml")
        word = "scenario=mine" if name.startswith("scenario") else "scenario=../other/scenario/mine"
        assert composed("evaluate", [word], "conf").scenario.light == light


@pytest.mark.parametrize("value", [True, np.bool_(True)])
def test_a_time_of_a_change_is_a_number(value):
    with pytest.raises(ValueError, match="at_s must be more than 0"):
        epuckhebb.evaluate(scenario={"changes": [{"at_s": value, "light": 1.0}]}, progress=False)


@pytest.mark.parametrize(
    "text", ["1e5", "010", "0x10", "1:30", "on", "y", "nan", "null", "~", "2026-01-01", "a: b", ""]
)
def test_a_text_that_is_written_is_read_as_this_text(text, tmp_path):
    """By the program, and by OmegaConf, with which it may be given again."""
    file = tmp_path / "settings.yaml"
    file.write_text(yaml_file.dump({"key": text, "list": [text, 1, 0.5, None, True]}))
    for values in (yaml_file.load(file), OmegaConf.to_container(OmegaConf.load(file))):
        assert values == {"key": text, "list": [text, 1, 0.5, None, True]}
