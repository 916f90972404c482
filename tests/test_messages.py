"""What Hydra says of a mistake, in our words: of a file of one's own, of a choice, a key or a value that cannot be."""

import pytest
from typer.testing import CliRunner

from epuckhebb.app.cli import app
from epuckhebb.app.explain import explain

FILES = {
    "scenario/misspelt.yaml": "ligth: 0.03\n",
    "scenario/in_words.yaml": "light: dim\n",
    "scenario/from_none.yaml": "defaults: [2obstacle, _self_]\nlight: 0.1\n",
    "scenario/too_deep.yaml": "scenario:\n  light: 0.1\n",
    "experiment/no_package.yaml": "hydra:\n  sweeper:\n    params:\n      hebbian.N: 1e-5,1e-4\n",
}
SAID = {
    "evaluate scenario=misspelt": [
        "scenario/misspelt.yaml: there is no key scenario.ligth",
        "Did you mean: scenario.light",
    ],
    "evaluate scenario=in_words": ["scenario/in_words.yaml: scenario.light must be a number, got dim"],
    "evaluate scenario=from_none": [
        "from_none.yaml: there is no scenario=2obstacle, which its defaults name",
        "2obstacles",
    ],
    "evaluate scenario=too_deep": ["scenario/too_deep.yaml: leave out the line `scenario:`"],
    "sweep no_package": ["experiment/no_package.yaml must begin with the line `# @package _global_`"],
    "evaluate scenario=murky": ["there is no scenario=murky", "`epuckhebb keys scenario` lists all", "--config-dir"],
    "evaluate hebbian.N=0,002": ["hebbian.N=0,002 has several values", "add -m", "A number is written 0.002"],
    "evaluate hebian.N=0.002": ["there is no key hebian.N", "Did you mean: hebbian.N?"],
}


@pytest.mark.parametrize("typed", SAID)
def test_a_mistake_is_told_with_what_to_do(typed, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name, text in FILES.items():
        (tmp_path / "conf" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "conf" / name).write_text(text)
    result = CliRunner().invoke(app, [*typed.split(), "--config-dir", "conf"])
    assert result.exit_code == 2, result.output
    for words in SAID[typed]:
        assert words in result.stderr
    assert "composing config" not in result.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["conf"]


def test_a_misspelt_group_of_keys_is_told_with_the_near_one():
    result = CliRunner().invoke(app, ["keys", "hebian"])
    assert result.exit_code == 2
    assert "did you mean hebbian?" in result.stderr


def test_an_error_that_is_its_own_cause_is_told_once():
    """As OmegaConf makes them under a debugger, or with OC_CAUSE=1."""
    error, cause = ValueError("outer"), KeyError("inner")
    error.__cause__, cause.__cause__ = cause, cause
    assert explain(error) == "outer\n'inner'"
