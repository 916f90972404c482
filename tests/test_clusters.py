"""Every command of docs/clusters.md makes a configuration; those for plug-ins that are not installed name the extra."""

import shlex
from pathlib import Path

import pytest
from cases import call, done

PAGE = Path(__file__).parents[1] / "docs" / "clusters.md"
COMMANDS = [line.partition(" #")[0].strip() for line in PAGE.read_text().splitlines() if line.startswith("epuckhebb ")]
EVOLVE = ["ga.population=4", "ga.elites=1", "ga.generations=1", "ga.loops=1", "lifetime.duration_s=1", "threads=1"]
NO_RAY = 'pip install "epuckhebb[ray]"'


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A folder with what the page speaks of: an evolution RUN, and a sweep of one's own."""
    folder = tmp_path_factory.mktemp("clusters")
    (folder / "my_conf" / "experiment").mkdir(parents=True)
    text = "# @package _global_\nhydra: {sweeper: {params: {seed: '1,2'}}}\n"
    (folder / "my_conf" / "experiment" / "mine.yaml").write_text(text)
    words = ["evolve", *EVOLVE, f"hydra.run.dir={folder}/runs/evolve/RUN", "-q"]
    done(*words)
    return folder


@pytest.mark.thorough
@pytest.mark.parametrize("line", COMMANDS)
def test_a_command_of_the_page(place, monkeypatch, line):
    monkeypatch.chdir(place)
    words = shlex.split(line)[1:]
    if words[0] == "sweep":
        words.append("--dry-run")
    elif "-m" in words:
        words = [word for word in words if word != "-m" and not word.startswith("seed=")] + ["--cfg", "hydra"]
    else:
        assert any(word.startswith("resume=") for word in words)
    result = call(*words)
    if result.exit_code == 2 and "ray_local" in line:
        assert NO_RAY in result.stderr
    else:
        assert result.exit_code == 0, result.output
