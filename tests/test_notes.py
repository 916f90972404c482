"""What a table says so as not to be misread: a showcase, and a champion in the world of the other experiment."""

from pathlib import Path

import pandas as pd
import pytest
from cases import call

import epuckhebb
from epuckhebb.analysis import findings, tables
from epuckhebb.config.compose import composed
from epuckhebb.config.schema import EvaluateConfig, typed
from epuckhebb.export.replay import replay
from epuckhebb.runs.notes import evaluation_notes
from epuckhebb.store.genome import load_genome
from epuckhebb.store.run import Run
from epuckhebb.tmaze.individual import HEBBIAN
from epuckhebb.tmaze.scenario import EXPERIMENTS

REFERENCE = Path(__file__).parents[1] / "runs" / "reference"
LOWLIGHT = ("scenario=lowlight", "repeats=1")


def notes(genome, *words):
    config = typed(composed("evaluate", list(words)), EvaluateConfig)
    return evaluation_notes(load_genome(genome, config.world.experiment), config)


@pytest.mark.parametrize("experiment", EXPERIMENTS)
def test_a_showcase_says_how_many_champions_show_its_pattern(experiment):
    assert notes("reference_7", f"scenario={findings.CHANGED[experiment][0]}") == []
    known = pd.read_csv(REFERENCE / "success.csv").set_index(["scenario", "controller", "N", "side"])
    rate = findings.PAPER_N[experiment]
    for scenario in findings.CHANGED[experiment]:
        row = known.loc[(scenario, HEBBIAN, rate, "both")]
        (note,) = notes("reference", f"scenario={scenario}")
        assert f"{row.gained:.0f} of {row.n:.0f} champions" in note
        assert note.endswith(f"-m scenario={scenario} hebbian.N={rate:g} genome=reference_1,...,reference_20")


@pytest.mark.parametrize("words", [["scenario=base_half"], ["scenario.light=0.3"]])
def test_of_a_world_that_the_reference_results_do_not_have_it_tells_nothing(words):
    assert notes("reference", *words) == []


def test_a_champion_in_the_other_experiment_is_said_to_be_of_it():
    file = str(REFERENCE / "champions" / "obstacles_seed007.npz")
    assert notes(file, "scenario=lowlight") == [
        "This champion was evolved for another world: experiment obstacles (here light)."
    ]
    assert notes(file, "scenario=base_half") == []


@pytest.mark.usefixtures("here")
def test_the_note_stands_in_the_terminal_in_the_table_and_on_the_page():
    result = call("evaluate", *LOWLIGHT, "hydra.run.dir=run")
    (note,) = Run(Path("run")).provenance["notes"]
    assert note in " ".join(result.stdout.split())
    assert note in repr(epuckhebb.evaluate("reference", *LOWLIGHT))
    assert tables.plain(note) in Path("run/table.md").read_text()
    replay(Path("run"), Path("page.html"))
    assert f"<p>{note.replace(chr(39), '&#x27;')}</p>" in Path("page.html").read_text()
