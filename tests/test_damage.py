"""Files that a disk, an editor or somebody else has changed: told in one message, and never taken for whole."""

import io
import json
import re
import shutil
import zipfile

import numpy as np
import pytest
import yaml
from cases import call, done, refused

from epuckhebb.adaptation.controller import Controller
from epuckhebb.cli.output import json_text
from epuckhebb.controller.plasticity.rule import Rule
from epuckhebb.runtime.errors import ConfigError
from epuckhebb.runtime.resources import data_folder
from epuckhebb.store import records
from epuckhebb.store.columns import NUMBER, Column
from epuckhebb.store.genome import load_genome
from epuckhebb.tmaze.session import LostRobotError

SHORT = ["lifetime.duration_s=2", "threads=1", "-q"]
TINY = ["ga.population=4", "ga.elites=1", "ga.loops=1", "ga.generations=1", "scenario.paper_duration_s=10"]


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A run of each verb, not to be written to."""
    folder = tmp_path_factory.mktemp("made")
    evaluation = ["evaluate", "repeats=1", f"hydra.run.dir={folder}/evaluate", *SHORT]
    evolution = ["evolve", *TINY, f"hydra.run.dir={folder}/evolve", *SHORT]
    for words in (evaluation, evolution):
        done(*words)
    return folder


@pytest.fixture
def evaluated(made, tmp_path):
    return shutil.copytree(made / "evaluate", tmp_path / "run")


@pytest.fixture
def evolved(made, tmp_path):
    return shutil.copytree(made / "evolve", tmp_path / "run")


def forget_checksums(run):
    """As if the run had been killed when all was written."""
    status = json.loads((run / "status.json").read_text())
    (run / "status.json").write_text(json.dumps({**status, "sha256": {}}))


@pytest.mark.parametrize("json_too", [[], ["--json"]])
def test_a_table_that_was_touched_is_not_shown(evaluated, json_too):
    table = evaluated / "metrics.csv"
    table.write_text(table.read_text().replace("0.5", "0.6", 1))
    assert "metrics.csv is not what this run wrote (its SHA-256 differs)" in refused("show", evaluated, *json_too)
    table.unlink()
    assert "metrics.csv cannot be read" in refused("show", evaluated, *json_too)


def test_a_file_that_is_gone_is_named(evaluated):
    assert "Lost" not in call("show", evaluated).stdout
    (evaluated / ".hydra" / "config.yaml").unlink()
    assert re.search(r"^Lost +\.hydra/config\.yaml *$", call("show", evaluated).stdout, re.MULTILINE)


@pytest.mark.parametrize("name", ["provenance.json", "status.json", ".hydra/config.yaml", "metrics.csv", "traces.npz"])
def test_any_damage_is_one_message(evaluated, tmp_path, name):
    forget_checksums(evaluated)
    whole = (evaluated / name).read_bytes()
    for content in (b"", b"[]", b"null", b"5", b"\xff\xfe\x00", b"[" * 3000, whole[: len(whole) // 3]):
        (evaluated / name).write_bytes(content)
        words = ["replay", evaluated, "-o", tmp_path / "page.html"] if name == "traces.npz" else ["show", evaluated]
        result = call(*words)
        assert isinstance(result.exception, SystemExit | None), content
        assert result.exit_code == 2 or name == ".hydra/config.yaml", content  # YAML that was cut may be YAML again


def test_times_that_go_back_are_refused(evaluated, tmp_path):
    forget_checksums(evaluated)
    with np.load(evaluated / "traces.npz") as held:
        arrays = dict(held)
    for times in (arrays["time"] - 1.0, arrays["time"][:, ::-1]):
        np.savez(evaluated / "traces.npz", **{**arrays, "time": times})
        assert "time must begin at 0" in refused("replay", evaluated, "-o", tmp_path / "page.html")


@pytest.mark.parametrize(
    ("change", "place"),
    [
        ({"state": "done"}, "`$.state`"),
        ({"started": 5}, "`$.started`"),
        ({"sha256": {"metrics.csv": None}}, "`$.sha256[...]`"),
        ({"sha256": []}, "`$.sha256`"),
    ],
)
def test_a_field_of_another_type_is_named(evaluated, change, place):
    file = evaluated / "status.json"
    file.write_text(json.dumps({**json.loads(file.read_text()), **change}))
    told = refused("show", evaluated)
    assert "status.json cannot be used" in told
    assert place in told


@pytest.mark.parametrize("group", ["compare", "hebbian", "robot"])
def test_settings_that_lost_a_group_are_one_message(evaluated, group):
    forget_checksums(evaluated)
    file = evaluated / ".hydra" / "config.yaml"
    settings = yaml.safe_load(file.read_text())
    del settings[group]
    file.write_text(yaml.safe_dump(settings))
    assert isinstance(call("replay", evaluated, "-o", evaluated / "page.html").exception, SystemExit | None)


def test_a_field_that_is_missing_is_named(evaluated):
    forget_checksums(evaluated)
    file = evaluated / "provenance.json"
    told = json.loads(file.read_text())
    del told["code"]["version"]
    file.write_text(json.dumps(told))
    assert "missing required field `version` - at `$.code`" in refused("show", evaluated)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("n\n1\n", "has no column success"),
        ("n,success\n", "has no rows"),
        ("n,success\n1,2,3\n4,5,6\n", "cannot be read as a table: Length of header"),
        ("n,success\n1,0.5\n2,half\n", "row 2: success must be a number, got 'half'"),
        ("n,success\n1,\n", "row 1: success must be a number, got nothing"),
        ("n,success\n1,True\n", "row 1: success must be a number"),
        (f"n,success\n{'9' * 400},1\nx,1\n", "row 2: n must be a number"),
        ("", "cannot be read as a table"),
    ],
)
def test_tables_are_checked(tmp_path, text, told):
    columns = dict.fromkeys(("n", "success"), Column(NUMBER))
    with pytest.raises(ConfigError, match=r"mine\.csv") as error:
        records.checked_table(text.encode(), tmp_path / "mine.csv", columns)
    assert told in str(error.value)


def test_json_is_json_whatever_the_numbers():
    told = json.loads(
        json_text({"a": [float("nan"), float("inf"), 1.5], "b": -float("inf")}), parse_constant=pytest.fail
    )
    assert told == {"a": [None, None, 1.5], "b": None}


def champion(**changes):
    """The content of the bundled champion's file, some arrays changed."""
    with np.load(data_folder("runs/reference") / "champion_light.npz") as held:
        arrays = {**held, **changes}
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **arrays)
    return bytearray(buffer.getvalue())


def bad_genome(tmp_path, content):
    (tmp_path / "bad.npz").write_bytes(content)
    with pytest.raises(ConfigError, match=r"bad\.npz") as error:
        load_genome(str(tmp_path / "bad.npz"), "light")
    return str(error.value)


@pytest.mark.parametrize(
    ("name", "value", "told"),
    [
        ("success", [0.5, np.nan], "success must lie between 0 and 1"),
        ("success", [0.5, 1.5], "success must lie between 0 and 1"),
        ("time_to_goal_s", [-1.0, np.nan], "time_to_goal_s must lie"),
        ("time_to_goal_s", [np.inf, 1.0], "time_to_goal_s must lie"),
        ("away_s", [np.nan, 1.0], "away_s must lie"),
        ("fitness", np.full((2, 9), 2.0), "fitness must lie"),
        ("fitness", np.zeros((2, 0)), "fitness is of no second"),
        ("reading_spread", np.full((2, 16), -0.1), "reading_spread must lie"),
        ("reading_mean", np.zeros((2, 15)), "memory_reading_mean must be numbers of shape (2, 16)"),
        ("gain_rad_s", 0.0, "gain_rad_s must be more than 0"),
        ("experiment", "none", "experiment must be one of light, obstacles"),
    ],
)
def test_a_memory_that_nobody_can_have_is_refused(tmp_path, name, value, told):
    assert told in bad_genome(tmp_path, champion(**{f"memory_{name}": np.array(value)}))


def test_a_champion_that_never_arrived_is_no_damage(tmp_path):
    (tmp_path / "never.npz").write_bytes(champion(memory_time_to_goal_s=np.array([np.nan, np.nan])))
    assert np.isnan(load_genome(str(tmp_path / "never.npz"), "light").nominal.time_to_goal_s).all()


def header(shape):
    """An array of one number whose header says another shape."""
    written = io.BytesIO()
    np.lib.format.write_array_header_1_0(written, {"descr": "<f8", "fortran_order": False, "shape": shape})
    return written.getvalue() + bytes(8)


def zipped(content, **how):
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", **how) as held:
        held.writestr("genome.npy", content)
    return bytearray(buffer.getvalue())


def test_what_a_file_says_of_itself_is_not_believed(tmp_path):
    encrypted, flipped = zipped(header((1,))), champion()
    encrypted[encrypted.find(b"PK\x01\x02") + 8] |= 1
    flipped[len(flipped) // 2] ^= 8
    bomb = zipped(header((2**24,))[:-8] + bytes(2**27), compression=zipfile.ZIP_DEFLATED)
    assert len(bomb) < 2**18
    assert "at most" in bad_genome(tmp_path, bomb)
    objects = io.BytesIO()
    np.savez(objects, genome=np.array([{"an": "object"}], dtype=object))
    damaged = (encrypted, flipped, zipped(b"no array"), header((10**25,)), zipped(header((10**25,))), b"PK", b"")
    for content in (*damaged, objects.getvalue()):
        bad_genome(tmp_path, content)


def test_an_evolution_does_not_go_on_as_a_hybrid(evolved):
    file = evolved / ".hydra" / "config.yaml"
    whole = file.read_text()
    assert "mutation_rate: 0.05" in whole
    file.write_text(whole.replace("mutation_rate: 0.05", "mutation_rate: 0.5"))
    before = {path: path.read_bytes() for path in evolved.rglob("*") if path.is_file()}
    told = refused("evolve", f"resume={evolved}", "ga.generations=2", "-q")
    assert "config.yaml is not what this evolution began with" in told
    assert {path: path.read_bytes() for path in evolved.rglob("*") if path.is_file()} == before
    file.write_text(whole.replace("generations: 1", "generations: 2").replace("threads: 1", "threads: 2"))
    done("evolve", f"resume={evolved}", "-q")


def test_weights_that_say_nothing_are_refused():
    with pytest.raises(ValueError, match=r"w_max must lie in"):
        Rule(w_max=1e7)


def test_a_life_whose_sums_are_not_finite_has_not_finished(run_lifetime, genomes, monkeypatch):
    monkeypatch.setattr("epuckhebb.controller.plasticity.rule._LARGEST_WEIGHT", 1e308)
    from epuckhebb.controller.plasticity.rules.paper import Paper

    controller = Controller(name="huge", rule=Paper(N=1e307, w_max=1e307))
    with pytest.raises(LostRobotError, match="made weights, their change, or what synapses keep"):
        run_lifetime(genomes[0], controller=controller, seconds=4.0, record_every=0)
