"""Every file of conf/ composes into a checked configuration."""

from pathlib import Path

import pytest
import yaml
from hydra._internal.hydra import Hydra
from test_new_worlds import NEW
from typer.testing import CliRunner

from epuckhebb.app.cli import app
from epuckhebb.app.config import EvaluateConfig, EvolveConfig, typed
from epuckhebb.app.data import data_folder, groups
from epuckhebb.app.hydra_bridge import composed

SCHEMA = {"evaluate": EvaluateConfig, "evolve": EvolveConfig}
TOGETHER = {"maze", "robot", "hebbian", "adaptation"}  # two of them at a time: test_parts.py
VERB = {group: verb for verb in reversed(SCHEMA) for group in groups(verb)}  # evaluate, for the groups that it has
ALONE = sorted(VERB.keys() - TOGETHER)
CHOICES = [(group, choice) for group in ALONE for choice in groups(VERB[group])[group] if choice not in NEW]


@pytest.mark.parametrize(("group", "choice"), CHOICES)
def test_every_choice_of_every_group_composes(group, choice):
    cfg = composed(VERB[group], [f"{group}={choice}"])
    config = typed(cfg, SCHEMA[VERB[group]])
    if group == "scenario":
        assert (config.world.name, cfg.changed) == (choice, "")


def test_defaults_are_the_papers():
    evaluate = typed(composed("evaluate", []), EvaluateConfig)
    assert (evaluate.controllers[0].rule.N, evaluate.lifetime.duration_s, evaluate.lifetime.gain_rad_s) == (
        0.000015,
        250,
        1,
    )
    light = typed(composed("evaluate", ["scenario=lowlight"]), EvaluateConfig)
    assert (light.controllers[0].rule.N, light.lifetime.duration_s, light.scenario.lamp.y_m) == (0.002, 200, -0.3)
    evolve = typed(composed("evolve", []), EvolveConfig)
    assert (evolve.ga.population, evolve.ga.generations, evolve.ga.elites, evolve.ga.loops) == (50, 30, 6, 3)
    assert (evolve.lifetime.duration_s, evolve.lifetime.gain_rad_s) == (60, 4)


def test_every_file_says_what_it_is_for():
    for file in data_folder("conf").rglob("*.yaml"):
        assert file.read_text().startswith("# "), file
        yaml.safe_load(file.read_text())


def test_conf_and_champions_are_found():
    assert isinstance(data_folder("conf"), Path)
    assert (data_folder("runs/reference") / "champion_light.npz").is_file()


def test_hydra_composes_the_configuration_of_a_run_once(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    compose_config, composed_for = Hydra.compose_config, []

    def compose(self, config_name, *more, **options):
        composed_for.append(config_name)
        return compose_config(self, config_name, *more, **options)

    monkeypatch.setattr(Hydra, "compose_config", compose)
    words = ["evaluate", "repeats=1", "lifetime.duration_s=1", "lifetime.record_every=0", "-q"]
    assert CliRunner().invoke(app, words).exit_code == 0
    assert composed_for == ["evaluate"]
