"""The group `change`: several at once in any scenario, the user's own too, and the names of worlds made of them."""

import csv
import json
from dataclasses import asdict, fields
from pathlib import Path

import pytest
from cases import contents, done, first_of, refused, world_named

import epuckhebb
from epuckhebb.config.compose import composed
from epuckhebb.config.schema import EvolveConfig, plain, typed
from epuckhebb.runtime.conf import groups, rows
from epuckhebb.studies import leaderboard, sweep

WORLDS = Path(__file__).parent / "golden" / "worlds.jsonl"
LINES = {line["name"]: line for line in map(json.loads, WORLDS.read_text().splitlines())}
NAMES = list(LINES)
BRIEF = ["repeats=1", "lifetime.duration_s=0.064", "lifetime.record_every=0"]
OWN = {
    "change/dusk.yaml": "# Dusk.\nlight: 0.05\n",
    "change/misspelt.yaml": "ligth: 0.05\n",
    "change/in_words.yaml": "light: dim\n",
    "change/slip.yaml": "left_slip: 0.1\n",
    "experiment/few.yaml": "# @package _global_\n# Two worlds, three changes.\nhydra:\n  sweeper:\n    params:\n"
    "      scenario: base,4obstacles\n      change: '[],[slip_left],[dusk,heavy]'\n",
}


def world(*words, config_dir=None):
    """The name of a world, what differs from it, and its settings."""
    cfg = plain(composed("evaluate", list(words), config_dir))
    settings = cfg["scenario"]
    return settings.pop("name"), cfg["changed"], {**settings, "maze": cfg["maze"]["name"]}


@pytest.fixture
def own(tmp_path, monkeypatch):
    """A folder with changes of the user's, as an option of the command line; the tests run beside it."""
    monkeypatch.chdir(tmp_path)
    for name, text in OWN.items():
        file = tmp_path / "conf" / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)
    return "--config-dir=conf"


# The worlds of the committed tables


def settings_of(name):
    made = world_named(name)
    values = {field.name: getattr(made, field.name) for field in fields(made)}
    del values["robot"], values["task"]
    return {**values, "name": name, "maze": made.maze.name, "lamp": asdict(made.lamp)}


def test_worlds_are_those_of_the_committed_tables(golden):
    """A line for each: what differs from `base`, to the bit."""
    base = settings_of("base")
    lines = []
    for name in NAMES:
        own = settings_of(name)
        known = LINES["base"] if name == "base" else {"name"}  # a field that came later is the same in all of them
        lines.append(json.dumps({key: value for key, value in own.items() if key in known or value != base[key]}))
    golden(WORLDS.name, "\n".join(lines) + "\n")


def test_no_training_of_the_program_can_draw_a_test_world():
    """Light and weak wheels are drawn from ranges; a single dead sensor or a layout of obstacles could be a test's."""
    training = typed(composed("evolve", ["training=varied"]), EvolveConfig).training
    assert training.light[0] < training.light[1]
    assert training.wheel[0] < training.wheel[1]
    tested = {name for sweep in ("rescue", "rescue_new_kinds") for name in leaderboard._swept(sweep, None)}
    for name in tested:
        made = world_named(name.replace("+", "_"))
        assert not training.layouts[0] <= made.layout <= training.layouts[1]
        assert len(made.dead_sensors) != 1 or 0 in made.dead_sensors  # training spares the first


# Composing


@pytest.mark.parametrize(
    ("words", "name"),
    [
        (["change=slip_left"], "base_slip_left"),
        (["change=[slip_left]"], "base_slip_left"),
        (["change=[]"], "base"),
        (["change=[ir_low,slip]"], "base_ir_low_slip"),
        (["scenario=highlight", "change=[narrow,slip_left]"], "highlight_narrow_slip_left"),
        (["scenario=4obstacles", "change=[wide,lamp_ahead,heavy]"], "4obstacles_wide_lamp_ahead_heavy"),
    ],
)
def test_a_world_has_the_names_of_its_scenario_and_its_changes(words, name):
    assert world(*words)[:2] == (name, "")


def test_what_is_given_beside_a_change_wins_and_is_reported():
    name, changed, settings = world("change=[slip_left,narrow]", "scenario.left_slip=0.1", "maze=double_t")
    assert (name, changed) == ("base_slip_left_narrow", "maze=double_t, left_slip=0.1")
    assert (settings["left_slip"], settings["maze"]) == (0.1, "double_t")


@pytest.mark.parametrize(("light", "other"), [(0.1, 1.0), (0.3, 1.0), (1.0, 0.1)])
def test_light_that_changes_becomes_the_other_light(light, other):
    _, _, settings = world("change=[light_flickers]", f"scenario.light={light}")
    assert [change["light"] for change in settings["changes"]] == [other, light, other, light, other, light, other]


@pytest.mark.usefixtures("own")
def test_a_change_of_ones_own():
    assert world("change=[dusk]", config_dir="conf")[:2] == ("base_dusk", "")
    assert world("change=[dusk,slip_left]", "scenario=highlight", config_dir="conf")[0] == "highlight_dusk_slip_left"
    assert world("change=slip", config_dir="conf")[2]["left_slip"] == 0.1


@pytest.mark.parametrize("word", ["change=30", "change=[30]", "change=['30']"])
def test_a_name_may_look_like_a_number(word):
    assert world(word, "scenario=4obstacles")[:2] == ("4obstacles_30", "")


@pytest.mark.usefixtures("own")
@pytest.mark.parametrize("name", ["7", "010", "1e5", "nan", "True", "null"])
def test_a_choice_of_ones_own_may_look_like_no_text(name):
    Path("conf", "scenario").mkdir()
    Path("conf", "scenario", f"{name}.yaml").write_text("defaults: [base, _self_]\nlight: 0.7\n")
    Path("conf", "scenario", "mine.yaml").write_text(f"defaults: [{name if name != 'null' else repr(name)}, _self_]\n")
    for word in (f"scenario={name}", "scenario=mine"):
        assert world(word, config_dir="conf")[2]["light"] == 0.7


# What is refused


@pytest.mark.parametrize(
    ("words", "told"),
    first_of(
        [
            (["change=[slip,slip_left]"], ["slip and slip_left both change left_slip"]),
            (["change=[narrow,wide]"], ["narrow and wide both change maze"]),
            (["change=[slp_left]"], ["change/slp_left"]),
            (["scenario=base_slip_left"], ["scenario=base_slip_left"]),
            (["change=3"], ["change=", "30"]),
            (["change={light: 0.3}"], ["change.light", "0.3"]),
            (["change.dusk={ligth: 0.3}"], ["change.dusk", "ligth"]),
            (["change=[misspelt]", "--config-dir=conf"], ["change/misspelt", "ligth"]),
            (["change=[in_words]", "--config-dir=conf"], ["change/in_words", "dim"]),
            (["-m", "change=[slip],[slip,slip_left]"], ["slip and slip_left both"]),
        ],
        5,
    ),
)
@pytest.mark.usefixtures("own")
def test_what_cannot_be_is_refused(words, told):
    before = contents()
    message = refused("evaluate", *words)
    assert [part for part in told if part not in message] == []
    assert contents() == before


# Who else has to know


def test_a_run_has_the_name_and_can_be_done_again(own):
    done("evaluate", "change=[dusk,ir_low]", *BRIEF, own, "hydra.run.dir=run")
    header, *lines = Path("run/metrics.csv").read_text().splitlines()
    columns = header.split(",")
    for line in lines:
        row = dict(zip(columns, line.split(","), strict=True))
        assert (row["scenario"], row["changed"]) == ("base_dusk_ir_low", "lifetime.duration_s=0.064")
    Path("conf/change/dusk.yaml").unlink()  # its values are in the folder of the run
    done("rerun", "run")


@pytest.mark.usefixtures("own")
def test_a_multirun_and_a_sweep_have_a_job_for_each_change():
    done("evaluate", "-m", "change=[],[slip_left]", *BRIEF, "hydra.sweep.dir=many", "hydra/launcher=basic")
    with Path("many/summary.csv").open() as file:
        assert [row["scenario"] for row in csv.DictReader(file)] == ["base"] * 4 + ["base_slip_left"] * 4
    jobs = sweep.plan("few", [], "conf").jobs
    ends = ("", "_slip_left", "_dusk_heavy")
    names = [f"{scenario}{end}" for scenario in ("base", "4obstacles") for end in ends]
    assert [job.config["scenario"]["name"] for job in jobs] == names
    tests = leaderboard.experiment_worlds(["few"], "conf")["obstacles"]
    assert [world.name for world in tests.values()] == names[1:]
    dusk = tests["base+dusk+heavy"]
    assert (dusk.light, dusk.mass_ratio) == (0.05, 2.0)


def test_python_has_changes():
    rows = epuckhebb.evaluate("reference", *BRIEF, scenario="base", change=["slip_left"], progress=False).metrics
    assert set(rows.scenario) == {"base_slip_left"}
    over = {"change": [["ir_low", "slip"], []]}
    rows = epuckhebb.sweep("reference", *BRIEF, over=over, progress=False)
    assert list(dict.fromkeys(rows.scenario)) == ["base_ir_low_slip", "base"]


def test_the_keys_have_changes():
    assert groups("evaluate")["change"] == groups("evolve")["change"] == sorted(rows("change"))
    assert "a worn tyre" in done("keys", "change").stdout
