"""Earlier runs can be watched and repeated; see `epuckhebb.app.earlier`."""

import json
import math

import pandas as pd
import pytest
from omegaconf import OmegaConf
from typer.testing import CliRunner

from epuckhebb.app.cli import app
from epuckhebb.app.config import EvaluateConfig, EvolveConfig, read_config, typed
from epuckhebb.app.hydra_bridge import composed
from epuckhebb.sim.plasticity.control import Sign

SCENARIO = {
    "name": "4obstacles",
    "experiment": "obstacles",
    "light": 0.1,
    "obstacles": 4,
    "layout": 0,
    "dead_sensor": None,
    "left_wheel": 1.0,
    "right_wheel": 1.0,
    "paper_N": 1.5e-05,
    "paper_duration_s": 250.0,
    "lamp": {"x_m": 0.1, "y_m": -0.2, "beam_rad": 1.5, "intensity": 2.0},
}
RULE = {"trace_decay": 0.95, "trace_update": 0.05, "w_max": 2.0, "floor": 0.2, "signal": "behaviour", "sign": "hebbian"}
GATE = {"surprise": "lateness", "tolerance": 1.2, "ramp": 0.5, "spell_s": 10.0, "rest_s": 40.0, "motor_noise": 2.0}
ALWAYS = {"surprise": "none", "tolerance": 0.0, "ramp": 0.0, "spell_s": 0.0, "rest_s": 0.0, "motor_noise": 0.0}
LIFETIME = {"duration_s": 2.0, "gain_rad_s": 1.0, "noise": 1.0, "record_every": 8}
EVALUATE = {
    "seed": 1,
    "genome": "reference",
    "repeats": 1,
    "threads": 0,
    "scenario": SCENARIO,
    "lifetime": LIFETIME,
    "hebbian": {"name": "paper", "N": 1.5e-05, **RULE, **ALWAYS},
    "compare": {"wrong": {"N": 0.01, "sign": "anti"}, "late": {"N": 0.0005, **GATE}},
}


@pytest.fixture
def stored(tmp_path):
    def write(content, verb, schema):
        file = tmp_path / "config.yaml"
        file.write_text(OmegaConf.to_yaml(OmegaConf.create(content)))
        return typed(read_config(file, verb), schema)

    return write


def test_an_evaluation(stored):
    config = stored(EVALUATE, "evaluate", EvaluateConfig)
    assert (config.world.name, config.world.obstacles, config.world.maze.name) == ("4obstacles", 4, "t_maze")
    paper, wrong, late = config.controllers
    assert (paper.name, paper.rule.N, paper.adaptation.needs_baseline) == ("Hebbian", 1.5e-05, False)
    assert (wrong.name, wrong.rule.N, wrong.rule.sign) == ("wrong", 0.01, Sign.anti)
    assert (late.name, late.rule.N, late.adaptation.change_signal) == ("late", 0.0005, "lateness")
    over = late.adaptation
    assert (over.threshold, over.slope, over.active_s, over.rest_s, over.motor_noise) == (1.2, 2.0, 10, 40, 2)


@pytest.mark.parametrize("gate", [{}, {"ramp": 0.0}])
def test_a_run_with_a_signal_of_change_keeps_its_name(stored, gate):
    hebbian = {"name": "adaptive", "N": 0.0005, **RULE, **GATE, **gate}
    config = stored({**EVALUATE, "hebbian": hebbian, "compare": {}}, "evaluate", EvaluateConfig)
    assert [controller.name for controller in config.controllers] == ["adaptive"]
    assert config.controllers[0].adaptation.slope == (math.inf if gate else 2.0)


def test_no_plasticity_and_an_evolution(stored):
    none = {"name": "none", "N": 0.0, **RULE, **ALWAYS}
    assert stored({**EVALUATE, "hebbian": none, "compare": {}}, "evaluate", EvaluateConfig).controllers == []
    evolution = {
        "seed": 1,
        "threads": 0,
        "scenario": SCENARIO,
        "lifetime": LIFETIME,
        "ga": {"population": 4, "elites": 1},
    }
    assert stored(evolution, "evolve", EvolveConfig).controller.is_ga_alone


def test_one_dead_sensor_is_a_list_of_one(stored):
    blind = {**SCENARIO, "dead_sensor": 3, "changes": [{"at_s": 1.0, "dead_sensor": None, "light": 1.0}]}
    world = stored({**EVALUATE, "scenario": blind}, "evaluate", EvaluateConfig).world
    assert [phase.dead_sensors for _, phase in world.phases] == [(3,), ()]
    later = OmegaConf.to_container(composed("evaluate", ["scenario.light=1"]), resolve=True)
    later["scenario"].update(dead_sensor=None, changes=[{"at_s": 1.0, "dead_sensor": 3}])
    del later["scenario"]["dead_sensors"]
    config = stored(later, "evaluate", EvaluateConfig)
    assert [phase.dead_sensors for _, phase in config.world.phases] == [(), (3,)]
    assert config.changed == "light=1"


def test_a_run_is_repeated_to_the_same_bytes(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    words = ["scenario=4obstacles", "compare.wrong={N: 0.01, sign: anti}", "repeats=1", "lifetime.duration_s=2"]
    assert CliRunner().invoke(app, ["evaluate", *words, "hydra.run.dir=old"]).exit_code == 0
    old = tmp_path / "old"
    earlier = {**EVALUATE, "compare": {"wrong": {"N": 0.01, "sign": "anti"}}}
    (old / ".hydra" / "config.yaml").write_text(OmegaConf.to_yaml(OmegaConf.create(earlier)))
    metrics = pd.read_csv(old / "metrics.csv", dtype=str, keep_default_na=False).drop(columns="changed")
    (old / "metrics.csv").write_text(metrics.to_csv(index=False))
    told = json.loads((old / "provenance.json").read_text())
    for key in ("baseline_sha256", "rules"):
        told.pop(key, None)
    (old / "provenance.json").write_text(json.dumps(told))
    (old / "status.json").write_text('{"schema": 1, "state": "finished"}')
    again = CliRunner().invoke(app, ["rerun", "old"])
    assert again.exit_code == 0, again.output
    assert "same bytes" in again.output
    metrics.loc[0, "path_length_m"] = "1.0"
    (old / "metrics.csv").write_text(metrics.to_csv(index=False))
    assert "metrics.csv differs first in line 2" in CliRunner().invoke(app, ["rerun", "old"]).output
