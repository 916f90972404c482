"""An optimizer of the user's own: the example from its first command to its last, what it is told, and bad ones."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from cases import SHORT, call, contents, done, evolve_in_maze, refused, refused_before, runs_of

from epuckhebb.config.parts import part_class
from epuckhebb.controller.genome import make_plan
from epuckhebb.controller.network import PAPER_NETWORK
from epuckhebb.controller.random import Stream, key
from epuckhebb.evolution.search import Search
from epuckhebb.store.run import Run
from epuckhebb.tmaze.batch import run_lifetimes
from epuckhebb.tmaze.individual import Individual
from epuckhebb.tmaze.life import Lifetime
from epuckhebb.tmaze.maze import SIDES
from epuckhebb.tmaze.scenario import Scenario

HERE = Path(__file__).parent
EXAMPLE = HERE.parent / "examples" / "own_optimizer"
OWN = "optimizer.algorithm=my_optimizer.py:CmaMe"
SMALL = ["optimizer.population=6", "optimizer.emitters=2", "optimizer.cells=5", "optimizer.confirm=2", "-q"]
SMALL += ["lifetime.duration_s=2", "scenario.paper_duration_s=10", "threads=1"]
RESULTS = ("history.csv", "champion.npz", "archive.csv")
PLAN = make_plan(PAPER_NETWORK)


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    return runs_of(
        tmp_path_factory.mktemp("optimizer"),
        EXAMPLE,
        ["evolve", OWN, *SMALL, "optimizer.generations=4", "hydra.run.dir=evolved"],
        ["evaluate", "genome=evolved", *SHORT, "hydra.run.dir=evaluated"],
    )


@pytest.mark.thorough
@pytest.mark.usefixtures("copy")
def test_it_is_resumed_to_the_same_genomes_after_its_emitters_have_restarted():
    own = part_class("optimizer", "my_optimizer.py:CmaMe", "optimizer")(cells=5)
    rng, search = np.random.default_rng(1), Search(own, PLAN, 1)
    for _ in range(60):
        search.tell(rng.random(len(search.ask())), {"x": rng.uniform(-0.4, 0.4, (30, 1, 2))})
    assert Search(own, PLAN, 1, search.log).ask().tobytes() == search.ask().tobytes()


@pytest.mark.thorough
def test_it_survives_kill_9_at_any_moment(copy):
    points = ["5", "beside", "9", "after", "12", "before", "17", "before", "18", "beside"]
    words = ["evolve", f"optimizer.algorithm={copy}/my_optimizer.py:CmaMe", *SMALL, "optimizer.generations=4"]
    subprocess.run([sys.executable, HERE / "killed.py", *words, "--", *points], cwd=copy, check=True)
    killed = list(copy.glob("killed_*"))
    assert len(killed) == len(points) / 2
    for run in killed:
        assert all((copy / "evolved" / name).read_bytes() == (run / name).read_bytes() for name in RESULTS), run


@pytest.mark.thorough
@pytest.mark.usefixtures("copy")
def test_a_point_of_the_archive_is_drawn_evaluated_and_replayed():
    words = ["archive.py", "evolved", "--lamp-on", "0", "--lamp-off", "0"]
    subprocess.run([sys.executable, *words], check=True, capture_output=True)
    assert Path("evolved/archive.png").read_bytes().startswith(b"\x89PNG")
    archive = pd.read_csv("evolved/archive.csv", dtype=str).astype(float)
    genome = np.load("evolved/genome.npy")
    assert genome.tobytes() in [row.tobytes() for row in archive.filter(like="solution").to_numpy()]
    done("evaluate", "genome=evolved/genome.npy", *SHORT, "hydra.run.dir=point")
    done("replay", "point")
    done("sweep", "n_sweep", "genome=evolved/genome.npy", "--dry-run")


def climber(**settings):
    """An optimizer whose one candidate is of its first generation."""
    Path("climber.py").write_text(
        """\
from dataclasses import dataclass
import numpy as np
from epuckhebb import Optimizer


@dataclass(kw_only=True)
class Climber(Optimizer):
    def start(self, plan, seed):
        self.rng, self.first, self.told = np.random.default_rng(seed), None, []
    def ask(self):
        self.asked = self.rng.uniform(-2, 2, (self.population, 234))
        self.first = self.asked[1].copy() if self.first is None else self.first
        return self.asked
    def tell(self, x, success, fitness):
        self.told.append((self.asked.copy(), x.copy(), success.copy(), fitness.copy()))
        for mine in (self.asked, x, success, fitness):
            mine[:] = 7
    def candidates(self):
        return self.first
"""
    )
    return part_class("optimizer", "climber.py:Climber", "optimizer")(
        **{"population": 3, "generations": 2, "confirm": 4, **settings}
    )


@pytest.mark.usefixtures("here")
def test_it_is_told_how_each_lifetime_ended_and_its_candidate_is_confirmed():
    life = Lifetime(duration_s=6, gain_rad_s=4)
    *_, last = evolve_in_maze(climber(loops=2), Scenario(), life, seed=5)
    search = Search(climber(loops=2), PLAN, 5, last.log)
    for number, (asked, x, success, fitness) in enumerate(search._optimizer.told):
        assert x.shape == success.shape == (3, 2, 2)
        np.testing.assert_array_equal(fitness, last.log[number].fitness)
        for side, column in (("right", 0), ("left", 1)):  # lamp on first
            noise = key(5, Stream.training_noise, number, 0, 1, SIDES.index(side))
            individual = Individual(genes=asked[2], side=side, key=noise)
            ((outcome, _),) = run_lifetimes([individual], Scenario(), life)
            assert outcome.x == x[2, 1, column]
            assert outcome.success == success[2, 1, column]
    first, *_ = search._optimizer.told
    np.testing.assert_array_equal(last.champion, first[0][1])  # of the generation before the last
    assert last.champion_fitness not in [*first[3], *last.fitness]  # that of fresh lifetimes


BAD = """\
from dataclasses import dataclass
from pathlib import Path
import numpy as np
from epuckhebb import Optimizer

class Still(Optimizer):
    def start(self, plan, seed):
        self.genes, self.generation = np.zeros((3, 234)), 0
    def ask(self):
        return self.genes
    def tell(self):
        self.generation += 1

class Mute(Optimizer):
    start = Still.start
    tell = Still.tell
class Shy(Still):
    def ask(self): return None
class Greedy(Still):
    def ask(self): return np.zeros((31, 234))
class Undefined(Still):
    def ask(self): return self.genes * np.nan
class Wide(Still):
    def ask(self): return self.genes + 2.5
class Lucky(Still):
    def ask(self): return np.random.default_rng().uniform(-1, 1, (3, 234))
@dataclass(kw_only=True)
class Fine(Still):
    sigma: float = 1.0
    def __post_init__(self):
        super().__post_init__()
        if self.sigma < 0: raise ValueError("sigma must be 0 or more")
class Tired(Still):
    def tell(self, fitness):
        self.generation += 1
        if self.generation == 2: raise KeyError("tired")
class Candid(Still):
    def candidates(self): return [1.0]
class Fickle(Still):
    def ask(self): return self.genes + (float(Path("dial").read_text()) if self.generation == 1 else 0.0)
"""


@pytest.fixture
def bad(here):
    (here / "bad.py").write_text(BAD)
    return here


@pytest.mark.usefixtures("bad")
@pytest.mark.parametrize(
    ("words", "texts"),
    [
        (["bad.py:Mute"], ["Can't instantiate abstract class Mute", "ask"]),
        (["bad.py:Shy"], ["Shy: `ask` must return 1 to 30 genomes of 234"]),
        (["bad.py:Greedy"], ["return 1 to 30 genomes of 234", "shape (31, 234)"]),
        (["bad.py:Undefined"], ["`ask` must return", "nan"]),
        (["bad.py:Wide"], ["optimizer.gene_limit", "2.5"]),
        (["bad.py:Lucky"], ["Lucky asks for other genomes with the same seed"]),
        (["bad.py:Fine", "optimizer.sigma=-1"], ["bad.py:Fine: sigma must be 0 or more"]),
        (["bad.py:Fine", "ga.population=8"], ["ga.population"]),
    ],
)
def test_what_cannot_be_an_optimizer_is_refused_before_anything_runs(words, texts):
    words = [f"optimizer.algorithm={words[0]}", *words[1:], "lifetime.duration_s=1"]
    refused_before("runs", ["evolve", *words], texts)


@pytest.mark.parametrize(
    ("name", "text", "generations"),
    [
        ("Tired", "optimizer Tired: `tell` failed in line 36: KeyError: 'tired'", 1),
        ("Candid", "Candid: `candidates` must return", 0),
    ],
)
def test_what_fails_in_a_run_keeps_its_whole_generations(bad, name, text, generations):
    result = call("evolve", f"optimizer.algorithm=bad.py:{name}", *SMALL[3:], "hydra.run.dir=out")
    assert result.exit_code == 1
    assert text in result.stderr
    assert "Traceback" not in result.stderr
    run = Run(bad / "out")
    assert (run.status["state"], text in run.status["error"]) == ("failed", True)
    assert run.has("checkpoint.npz") == bool(generations)
    assert not generations or len(run.table("history.csv")) == generations


def test_one_that_asks_for_other_genomes_is_not_resumed(bad):
    (bad / "dial").write_text("0.5")
    words = ["optimizer.algorithm=bad.py:Fickle", *SMALL[3:], "optimizer.generations=2", "hydra.run.dir=out"]
    done("evolve", *words)
    (bad / "dial").write_text("0.25")
    before = contents("out")
    said = refused("evolve", "resume=out", "optimizer.generations=3")
    assert "optimizer Fickle asks for other genomes than before in generation 1" in said
    assert contents("out") == before
