"""Hydra composes the same, though it parses a text once and lists choices only where they are needed."""

from hydra._internal import config_repository, defaults_list
from omegaconf import OmegaConf

from epuckhebb.config import hydra_cache
from epuckhebb.config.compose import _composed, composed

ASKED = [
    ("evaluate", []),
    ("evaluate", ["scenario=4obstacles", "scenario.light=0.07", "lifetime.duration_s=3", "hebbian.N=0.1"]),
    ("evaluate", ["hydra/launcher=joblib", "hydra.launcher.n_jobs=7", "hydra.job_logging.root=4"]),
    ("evaluate", ["adaptation=best", "maze=double_t", "robot=epuck_lidar", "task=reversal", "task.trials=12"]),
    ("evaluate", ["adaptation=late", "adaptation.threshold=0.7", "hebbian=oja", "task=reversal"]),
    ("evaluate", ["experiment=adaptive", "~hebbian.sign", "+hebbian.mine=3"]),
    ("evolve", ["optimizer=open_es", "optimizer.population=8", "training=varied"]),
]


def all_composed(asked=ASKED):
    parts = (part for words in asked for part in _composed(*words, None)[:2])  # the configuration, and Hydra's own
    return [OmegaConf.to_container(part, resolve=False) for part in parts]


def test_as_hydra_does_it_alone(monkeypatch):
    """Also in another order, and after others: what is kept of a file is never changed."""
    with monkeypatch.context() as patch:
        for owner, name in [
            (config_repository.ConfigRepository, "load_config"),
            (defaults_list, "_create_interpolation_map"),
        ]:
            ours = getattr(owner, name, None)
            if ours is None:  # in Hydra 1.4 there is no such list
                continue
            (alone,) = (cell.cell_contents for cell in ours.__closure__ if callable(cell.cell_contents))
            patch.setattr(owner, name, alone)
        by_hydra = all_composed()
    assert all_composed() == by_hydra
    assert sorted(all_composed(ASKED[::-1]), key=str) == sorted(by_hydra, key=str)


def test_a_text_is_parsed_once(monkeypatch):
    composed("evaluate", [])
    parsed = []
    load = OmegaConf.load
    monkeypatch.setattr(OmegaConf, "load", lambda file: parsed.append(file) or load(file))
    composed("evaluate", [])
    assert not parsed


def test_a_file_that_was_changed_is_read_again(tmp_path):
    mine = tmp_path / "scenario" / "mine.yaml"
    mine.parent.mkdir()
    for light in (0.1, 0.2, 0.1):
        mine.write_text(f"defaults: [base, _self_]\nlight: {light}\n")
        assert composed("evaluate", ["scenario=mine"], str(tmp_path)).scenario.light == light


def test_an_interpolation_in_a_list_of_defaults_is_resolved(tmp_path):
    for name, text in [("experiment/mine", "defaults: [{/extra: '${experiment}'}]"), ("extra/mine", "repeats: 3")]:
        file = tmp_path / f"{name}.yaml"
        file.parent.mkdir()
        file.write_text(f"# @package _global_\n{text}\n")
    assert composed("evaluate", ["experiment=mine"], str(tmp_path)).repeats == 3


def test_another_hydra_is_left_as_it_is(monkeypatch):
    monkeypatch.setattr(config_repository, "ConfigRepository", type("Other", (), {}))
    monkeypatch.delattr(defaults_list, "_create_interpolation_map", raising=False)
    hydra_cache.parse_once()
    assert not hasattr(defaults_list, "_create_interpolation_map")
    assert not hasattr(config_repository.ConfigRepository, "load_config")
