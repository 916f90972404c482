"""Hydra composes the same, though it keeps what it has composed: what is kept is of just these words and files."""

import shutil
import sys

import hydra
import pytest
from hydra._internal.config_loader_impl import ConfigLoaderImpl
from omegaconf import OmegaConf

from epuckhebb.config import choices, compose, hydra_cache
from epuckhebb.config.compose import _composed, composed
from epuckhebb.runtime.resources import data_folder

ASKED = [
    ("evaluate", []),
    ("evaluate", ["scenario=4obstacles", "scenario.light=0.07", "lifetime.duration_s=3", "hebbian.N=0.1"]),
    ("evaluate", ["hebbian.N=0.1", "hebbian.N='${scenario.paper_N}'", "compare={a: {N: 1}}", "genome=x", "seed=2"]),
    ("evaluate", ["hydra/launcher=joblib", "hydra.launcher.n_jobs=7", "hydra.job_logging.root=4", "hydra.run.dir=a"]),
    ("evaluate", ["adaptation=late", "maze=double_t", "robot=epuck_lidar", "task=reversal", "task.trials=12"]),
    ("evaluate", ["experiment=adaptive", "~hebbian.sign", "+hebbian.mine=3"]),
    ("evaluate", ["scenario=highlight", "scenario=base", "change.a={light: 0.3}", "change={a: {light: 0.4}}"]),
    ("evaluate", ["scenario=base", "scenario=highlight", "change={a: {light: 0.4}}", "change.a={light: 0.3}"]),
    ("evaluate", ["seed=3", "hydra.run.dir='${hydra.job.override_dirname}'"]),
    ("evaluate", ["change=[slip_left]", "change.mine={light: 0.3}", "scenario.light=0.5"]),
    ("evolve", ["optimizer=open_es", "optimizer.population=8", "training=varied"]),
    ("leaderboard", ["methods=[ga]", "repeats=3"]),
]


@pytest.fixture
def kept(tmp_path, monkeypatch):
    """The folder of what is kept, empty at first."""
    if compose.IS_HYDRA_1_4:
        pytest.skip("with Hydra 1.4 each composition is made anew")
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "caches"))
    return tmp_path / "caches" / "epuckhebb" / "composed"


@pytest.fixture
def made(monkeypatch):
    """How often Hydra composed."""
    compose, asked = ConfigLoaderImpl._load_configuration_impl, []
    monkeypatch.setattr(
        ConfigLoaderImpl, "_load_configuration_impl", lambda *one, **more: asked.append(1) or compose(*one, **more)
    )
    return asked


def whole(command, words):
    """A configuration and Hydra's own part, unresolved."""
    return [OmegaConf.to_container(part, resolve=False) for part in _composed(command, words, None)[:2]]


@pytest.mark.usefixtures("kept")
def test_as_hydra_does_it_alone(monkeypatch):
    alone = ConfigLoaderImpl.load_configuration.__wrapped__
    with monkeypatch.context() as patch:
        patch.setattr(ConfigLoaderImpl, "load_configuration", alone)
        by_hydra = [whole(*words) for words in ASKED]
    for _ in range(2):  # made, and kept
        for words, known in zip(ASKED, by_hydra, strict=True):
            assert whole(*words) == known, words


@pytest.mark.usefixtures("kept")
def test_words_that_differ_in_values_share_what_is_kept(made):
    for words in (["seed=1"], ["scenario.light=0.3"], ["repeats=2", "hydra.run.dir=there"]):
        composed("evaluate", words)
    assert len(made) == 1
    for words in (["scenario=lowlight"], ["hydra/launcher=joblib"], ["+hebbian.mine=1"]):
        composed("evaluate", words)
    assert len(made) == 4


@pytest.mark.usefixtures("kept")
def test_each_file_on_the_search_path_is_part_of_the_key(tmp_path, monkeypatch, made):
    """Files of the user's, which are not asked for too; the program's, and their names."""
    mine, ours = tmp_path / "mine" / "scenario", tmp_path / "conf"
    mine.mkdir(parents=True)
    for light in (0.1, 0.2, 0.1):
        (mine / "mine.yaml").write_text(f"defaults: [base, _self_]\nlight: {light}\n")
        assert composed("evaluate", ["scenario=mine"], str(mine.parent)).scenario.light == light
    assert len(made) == 2
    (mine / "base.yaml").write_text("light: 0.4\n")  # wins over the program's from now on
    assert composed("evaluate", [], str(mine.parent)).scenario.light == 0.4
    assert composed("evaluate", []).scenario.light == 0.1
    shutil.copytree(choices.OURS[0], ours)
    monkeypatch.setattr(compose, "data_folder", lambda _: ours)
    for light in ("0.1", "0.3"):
        base = (choices.OURS[0] / "scenario" / "base.yaml").read_text()
        (ours / "scenario" / "base.yaml").write_text(base.replace("light: 0.1", f"light: {light}"))
        assert composed("evaluate", []).scenario.light == float(light)


@pytest.mark.usefixtures("kept")
def test_a_folder_elsewhere_is_followed(tmp_path):
    """As where a group of the user's is a link to another folder of theirs."""
    (tmp_path / "shared").mkdir()
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "scenario").symlink_to(tmp_path / "shared")
    for light in (0.1, 0.2):
        (tmp_path / "shared" / "mine.yaml").write_text(f"defaults: [base, _self_]\nlight: {light}\n")
        assert composed("evaluate", ["scenario=mine"], str(tmp_path / "mine")).scenario.light == light


@pytest.mark.usefixtures("kept")
@pytest.mark.parametrize("part", ["program", "Python", "Hydra"])
def test_versions_and_the_program_are_part_of_the_key(tmp_path, monkeypatch, made, part):
    composed("evaluate", [])
    monkeypatch.setattr(hydra_cache, "_versions", hydra_cache._versions.__wrapped__)
    if part == "program":
        monkeypatch.setattr(hydra_cache, "__file__", str(tmp_path / "config" / "hydra_cache.py"))
    elif part == "Python":
        monkeypatch.setattr(sys, "version", "another")
    else:
        monkeypatch.setattr(hydra_cache.hydra, "__file__", str(tmp_path / "elsewhere" / "hydra" / "__init__.py"))
    _composed("evaluate", [], None)
    assert len(made) == 2


def test_what_is_damaged_or_cannot_be_kept_is_made(kept, made):
    composed("evaluate", [])
    (file,) = kept.iterdir()
    for content in (b"", file.read_bytes()[:-1], file.read_bytes().replace(b"obstacles", b"obstacle5")):
        file.write_bytes(content)
        assert composed("evaluate", []).scenario.experiment == "obstacles"
    assert len(made) == 4
    file.unlink()
    kept.rmdir()
    kept.write_text("no folder")
    composed("evaluate", [])
    assert len(made) == 5


def test_a_plug_in_that_hydra_has_loaded_twice_is_no_obstacle(kept, monkeypatch):
    """As in a worker of joblib: its classes are not those that their names stand for, so nothing of them is kept."""
    words = ["hydra/launcher=joblib"]
    known = composed("evaluate", words)
    (file,) = kept.iterdir()
    file.unlink()
    plug_in = sys.modules["hydra_plugins.hydra_joblib_launcher.config"]
    monkeypatch.setattr(plug_in, "JobLibLauncherConf", type("JobLibLauncherConf", (), {}))
    monkeypatch.setattr(hydra_cache, "_versions", hydra_cache._versions.__wrapped__)
    assert composed("evaluate", words) == known
    assert list(kept.iterdir()) == []


def test_an_interpolation_in_a_list_of_defaults_is_resolved(tmp_path):
    for name, text in [("experiment/mine", "defaults: [{/extra: '${experiment}'}]"), ("extra/mine", "repeats: 3")]:
        file = tmp_path / f"{name}.yaml"
        file.parent.mkdir()
        file.write_text(f"# @package _global_\n{text}\n")
    assert composed("evaluate", ["experiment=mine"], str(tmp_path)).repeats == 3


@pytest.mark.usefixtures("kept")
def test_files_of_a_search_path_in_a_file_are_read_each_time(tmp_path):
    usual, more = (data_folder("conf") / "evaluate.yaml").read_text(encoding="utf-8"), tmp_path / "more"
    assert "\nhydra:\n" in usual
    whole = usual.replace("\nhydra:\n", f"\nhydra:\n  searchpath: ['file://{more}']\n")
    (tmp_path / "evaluate.yaml").write_text(whole, encoding="utf-8")
    (more / "scenario").mkdir(parents=True)
    for light in (0.4, 0.3):
        (more / "scenario" / "mine.yaml").write_text(f"defaults: [base, _self_]\nlight: {light}\n", encoding="utf-8")
        assert composed("evaluate", ["scenario=mine"], str(tmp_path)).scenario.light == light


def test_a_file_that_has_changed_is_parsed_again_and_what_is_kept_of_it_stays_as_it_was(tmp_path):
    for value in (1, 1, 2):
        (tmp_path / "one.yaml").write_text(f"value: {value}\n", encoding="utf-8")
        with hydra_cache.users_first(None), hydra.initialize_config_dir(str(tmp_path), **compose.VERSION_BASE):
            cfg = hydra.compose("one")
        assert cfg.value == value
        cfg.value = 3
