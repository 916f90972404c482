"""Flocks: the estimator against theory, couplings and their controls, the command, its replay, the reference study."""

import math
import shutil
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from cases import contents, done, first_of, refused

from epuckhebb import Coupling
from epuckhebb.controller.compiling.errors import PartError
from epuckhebb.flock import tables
from epuckhebb.flock.coupling import Moment, changed, shuffled, transfer_entropy
from epuckhebb.flock.couplings.frozen import Frozen
from epuckhebb.flock.couplings.live_fitness import LiveFitness
from epuckhebb.flock.couplings.oracle import Oracle
from epuckhebb.flock.couplings.transfer_entropy import TransferEntropy
from epuckhebb.flock.couplings.transfer_entropy_x_fitness import TransferEntropyXFitness
from epuckhebb.flock.plane import Flock, run
from epuckhebb.store.run import Run

ROOT = Path(__file__).parents[1]
EXAMPLE = ROOT / "examples" / "own_coupling" / "my_couplings.py"
PAGE, REFERENCE = ROOT / "docs" / "flock.md", ROOT / "runs" / "reference" / "flock"
SHORT = ["repeats=2", "flock.duration_s=120", "flock.at_s=60"]
ENTROPY = np.array([[0.0, 3.0, 1.0], [2.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
NOW = Moment(np.ones((3, 3)) - np.eye(3), ENTROPY, np.array([1.0, 0.5, -0.5]), 2, 60.0)


def test_transfer_entropy_is_what_theory_says():
    rng = np.random.default_rng(0)
    x, noise = rng.standard_normal((2, 40_000))
    for own, across in ((0.0, 2.0), (0.5, 0.5), (0.8, 1.0)):
        y = noise.copy()
        for t in range(1, len(y)):
            y[t] += own * y[t - 1] + across * x[t - 1]
        found = transfer_entropy(np.stack([x, y], axis=1))
        assert found[1, 0] == pytest.approx(math.log(1 + across**2) / 2, rel=0.06)  # three times its error
        assert found[0, 1] == pytest.approx(0.0, abs=2e-4)
    independent = [transfer_entropy(rng.standard_normal((200, 6))).sum() / 30 for _ in range(200)]
    assert np.mean(independent) == pytest.approx(1 / (2 * 199), rel=0.1)


def test_series_that_never_change_have_no_transfer_entropy():
    still = np.column_stack([np.zeros(100), np.random.default_rng(0).standard_normal(100)])
    assert (transfer_entropy(still) == 0).all()


@pytest.mark.parametrize(
    ("coupling", "expected"),
    [
        (Frozen(), [[0, 1, 1], [1, 0, 1], [1, 1, 0]]),
        (TransferEntropy(), [[0, 1.6, 1.0], [1.3, 0, 0.7], [0.7, 0.7, 0]]),
        (LiveFitness(), [[0, 1.1, 0.5], [1.4, 0, 0.5], [1.4, 1.1, 0]]),
        (TransferEntropyXFitness(), [[0, 0.7 + 0.3 * 6 * 3 / 7, 0.7], [0.7 + 0.3 * 6 * 4 / 7, 0, 0.7], [0.7, 0.7, 0]]),
        (Oracle(), [[0, 1, 0], [1, 0, 0], [1, 1, 0]]),
    ],
    ids=lambda value: type(value).__name__,
)  # fmt: skip
def test_couplings_change_by_their_equations(coupling, expected):
    wanted = np.array(expected, float)
    found = changed(coupling, NOW)
    np.testing.assert_allclose(found, wanted * 2 / wanted.sum(axis=1, keepdims=True), rtol=1e-12)


def test_the_control_is_given_the_numbers_of_others():
    mixed = shuffled(NOW, np.random.default_rng(1))
    assert sorted(mixed.transfer_entropy.ravel()) == sorted(ENTROPY.ravel())
    assert (np.diag(mixed.transfer_entropy) == 0).all()
    assert mixed.fitness.tolist() == [0.5, -0.5, 1.0]
    assert (mixed.weights == NOW.weights).all()


@pytest.mark.parametrize(
    ("gives", "message"),
    [(np.nan, "finite weights of 0 or more, it gave nan"), (-0.5, "it gave -0.5"), ("x", "failed"), ([1.0], "3 rows")],
)
def test_a_coupling_without_weights_is_refused(gives, message):
    @dataclass(frozen=True, kw_only=True)
    class Wrong(Coupling):
        def weights(self, now):
            return gives if isinstance(gives, list) else now.weights * gives

    with pytest.raises(PartError, match=message):
        changed(Wrong(), NOW)


def test_all_couplings_of_a_seed_begin_alike_and_differ_after_their_first_change():
    flock = Flock(robots=5, knowers=1, duration_s=60.0, at_s=30.0, breaks="knower")
    frozen, fit, again = (run(flock, coupling, 3) for coupling in (Frozen(), LiveFitness(), LiveFitness()))
    first = 20  # samples of 0.8 s until the first change, after 16 s and at a multiple of 6.4 s
    assert (frozen.path[: first + 1] == fit.path[: first + 1]).all()
    assert (frozen.path[30] != fit.path[30]).any()
    assert fit.path.tobytes() == again.path.tobytes()
    assert (frozen.weights == np.ones((5, 5)) - np.eye(5)).all()
    np.testing.assert_allclose(fit.weights.sum(axis=2), 4.0)
    other = run(Flock(robots=5, knowers=1, duration_s=60.0, at_s=30.0), Frozen(), 3)
    assert (frozen.path[:38] == other.path[:38]).all()
    assert (frozen.path[45] != other.path[45]).any()


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """A small study with the coupling of the example."""
    folder = tmp_path_factory.mktemp("flock")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        shutil.copy(EXAMPLE, folder)
        own = ["flock.coupling=my_couplings.py:Fitter", "flock.own.margin=0.2"]
        done("flock", "--quick", *own, *SHORT, "hydra.sweep.dir=study")
    return folder / "study"


def test_its_figures_are_drawn_again(study, tmp_path):
    assert "has the figures couplings, flock; got x" in refused("figure", study, "x")
    done("figure", study, "flock", "-f", "pdf", "-o", tmp_path / "flock.pdf")
    assert (tmp_path / "flock.pdf").read_bytes().startswith(b"%PDF")


def test_a_study_has_its_rows_its_page_and_its_figures(study):
    runs = Run(study).table("runs.csv")
    assert list(runs.coupling.unique()) == ["frozen", "Fitter", "Fitter (shuffled)", "oracle"]
    assert len(runs) == 2 * 4 * 2
    flock = Flock(duration_s=120.0, at_s=60.0, breaks="knower")
    alone = tables.run_metrics(flock, run(flock, Frozen(), 2))
    row = runs[(runs.coupling == "frozen") & (runs.breaks == "knower") & (runs.seed == 2)].iloc[0]
    assert row.long_after == alone["long_after"]
    assert "smoke test" in (study / "report.md").read_text()
    assert {"figures/flock.png", "figures/couplings.png", "report.html"} <= contents(study).keys()
    assert "Fitter" in done("show", str(study)).stdout


def test_a_study_is_replayed_with_its_own_coupling(study, tmp_path, monkeypatch):
    monkeypatch.chdir(study.parent)
    page = tmp_path / "page.html"
    done("replay", str(study), "-o", str(page))
    assert '"Fitter":{"path":' in page.read_text()
    assert "a flock is replayed as a page" in refused("replay", str(study), "--gif", "film.gif")
    text = Path("my_couplings.py").read_text()
    Path("my_couplings.py").write_text(text.replace("np.sign", "0.5 * np.sign"))
    assert "made by another version" in refused("replay", str(study))
    Path("my_couplings.py").write_text(text)


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize(
    ("words", "message"),
    first_of(
        [
            ("flock.robots=1", "flock.robots must lie in [2, 100], got 1"),
            ("flock.knowers=11", "flock.knowers must lie in [1, 10], got 11"),
            ("flock.at_s=2400", "flock.at_s must lie in"),
            ("flock.spacing_m=0.07", "flock.spacing_m must lie in"),
            ("flock.breaks=all", "flock.breaks must be one of none, stranger, knower"),
            ("flock.breaks=[knower,knower]", "a list of different ones"),
            ("flock.knowers=10", "flock.breaks=stranger needs flock.knowers"),
            ("flock.coupling=influence", "flock.coupling must be one of frozen"),
            ("flock.coupling=wrong.py:Wrong", "it gave nan"),
            ("flock.coupling=wrong.py:Lucky", "gives other results"),
            ("flock.coupling=wrong.py:Leaving", "SystemExit"),
            ("flock.coupling=wrong.py:Empty", "needs a method `drive`"),
            ("flock.own.margin=1", "flock.own.margin is no key of coupling transfer_entropy"),
            ("adaptation=late", "no key adaptation"),
            ("scenario.changes=[]", "no key scenario.changes"),
        ],
        4,
    ),
)
def test_bad_input_is_refused_in_one_message(words, message):
    Path("wrong.py").write_text(
        "import numpy as np\nfrom epuckhebb import Coupling\nclass Wrong(Coupling):\n"
        "    def drive(self, now):\n        return np.full_like(now.weights, np.nan)\n"
        "class Empty(Coupling):\n    pass\n"
        "class Lucky(Coupling):\n    def drive(self, now):\n        return np.random.random(now.weights.shape)\n"
        "class Leaving(Coupling):\n    def drive(self, now):\n        raise SystemExit\n"
    )
    assert message in refused("flock", words)
    assert [path.name for path in Path().iterdir() if path.name != "__pycache__"] == ["wrong.py"]


def reference(name):
    return pd.read_csv(REFERENCE / f"{name}.csv")


def test_the_table_of_the_reference_study_follows_from_its_runs():
    runs, table = reference("runs"), reference("flock")
    usual = tables.usual(runs)
    again = tables.table(usual, int(runs.seed.min()))
    pd.testing.assert_frame_equal(again, tables.usual(table), check_exact=False, rtol=1e-9)
