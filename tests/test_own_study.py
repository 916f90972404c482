"""A study of the user's own: planned, run, interrupted and resumed, drawn again; and what is refused."""

import json
import shutil
from pathlib import Path

import pandas as pd
import pytest
from cases import call, contents, done, refused

from epuckhebb import api
from epuckhebb.runtime import INTERRUPTED

EXAMPLE = Path(__file__).parents[1] / "examples" / "own_study" / "my_studies.py"
ASKED = ["sweep", "my_studies.py:Dimming", "champions=[reference_1,reference_2]", "lights=[1.0,0.1]", "repeats=1"]
ASKED += ["duration_s=0.064", "hydra/launcher=basic"]


@pytest.fixture
def study(here):
    """The example in an empty folder; its file."""
    shutil.copy(EXAMPLE, here)
    return here / EXAMPLE.name


def results(folder):
    """The bytes of all tables and of the page."""
    return {name: content for name, content in contents(folder).items() if name.endswith((".csv", ".md"))}


@pytest.mark.usefixtures("study")
def test_it_is_planned_run_interrupted_and_resumed_to_the_same_bytes(here, monkeypatch):
    listed = json.loads(done(*ASKED, "--dry-run", "--json").stdout)["jobs"]
    assert [job["done"] for job in listed] == [False, False]
    assert not (here / "runs").exists()
    evaluate, calls = api.evaluate, []

    def interrupted(*words, **settings):
        calls.append(words)
        if len(calls) > 3:  # in the second job
            raise KeyboardInterrupt
        return evaluate(*words, **settings)

    with monkeypatch.context() as patch:
        patch.setattr(api, "evaluate", interrupted)
        result = call(*ASKED)
    assert result.exit_code == INTERRUPTED
    assert "1 of 2 jobs are done; the same command does the rest" in result.stderr
    assert "1 done before, 1 to do" in done(*ASKED).stderr
    (folder,) = (here / "runs" / "sweep").iterdir()
    assert list(pd.read_csv(folder / "success.csv").lifetimes) == [4, 4, 4, 4]  # two champions, two sides
    resumed = results(folder)
    shutil.rmtree(folder)
    done(*ASKED)
    assert results(folder) == resumed
    assert "2 done before, 0 to do" in done(*ASKED).stderr


def test_its_figure_is_drawn_again_and_it_is_shown(study, here):
    done(*ASKED)
    (folder,) = (here / "runs" / "sweep").iterdir()
    assert done("figure", folder).stdout.split() == ["success"]
    assert Path(done("figure", folder, "success", "-f", "svg").stdout.strip()).read_bytes().startswith(b"<?xml")
    assert "Hebbian" in done("show", folder).stdout
    assert "Share of the lifetimes" in (folder / "report.md").read_text()
    provenance = json.loads((folder / "provenance.json").read_text())
    assert list(provenance["own_code"]) == [str(study)]


@pytest.mark.parametrize(
    ("words", "texts"),
    [
        (["my_studies.py:Dim"], ["Dim", "Dimming"]),
        (["none.py:Dimming"], ["none.py"]),
        (["my_studies.py:Dimming", "light=1"], ["light"]),
        (["my_studies.py:Dimming", "lights=dark"], ["lights"]),
        (["my_studies.py:Dimming", "hydra/sweeper=basic"], ["hydra/sweeper"]),
        (["empty.py:Empty"], ["plan"]),
        (["broken.py:Broken"], ["ZeroDivisionError"]),
        (["none_to_do.py:NoneToDo"], ["plan"]),
        (["arrays.py:Arrays"], ["plan"]),
    ],
)
@pytest.mark.usefixtures("study")
def test_what_cannot_be_planned_is_refused(here, words, texts):
    start = "from epuckhebb import Study\n\n\nclass"
    (here / "empty.py").write_text(f"{start} Empty(Study):\n    pass\n")
    plan = "    def plan(self):\n        return [1 / 0]\n"
    do = "    @classmethod\n    def do(cls, job):\n        return {}\n"
    (here / "broken.py").write_text(f"{start} Broken(Study):\n{plan}\n{do}")
    for name, jobs in {"NoneToDo": "[]", "Arrays": "[{'a': __import__('numpy').zeros(2)}]"}.items():
        file = "none_to_do.py" if name == "NoneToDo" else "arrays.py"
        (here / file).write_text(f"{start} {name}(Study):\n{plan.replace('[1 / 0]', jobs)}\n{do}")
    told = refused("sweep", *words)
    assert [text for text in texts if text not in told] == []
    assert not (here / "runs").exists()


@pytest.mark.parametrize(("body", "key"), [("{'../outside': pd.DataFrame()}", "../outside"), ("1 / 0", "ZeroDivision")])
def test_a_job_that_cannot_be_done_is_one_message_and_writes_nothing_outside(here, body, key):
    (here / "mine.py").write_text(
        "import pandas as pd\nfrom epuckhebb import Study\n\n\nclass Mine(Study):\n"
        "    def plan(self):\n        return [{'a': 1}]\n\n"
        f"    @classmethod\n    def do(cls, job):\n        return {body}\n"
    )
    told = call("sweep", "mine.py:Mine", "hydra/launcher=basic", "hydra.sweep.dir=out")
    assert told.exit_code == 1
    assert key in told.stderr
    assert "Traceback" not in told.stderr
    assert list(here.rglob("outside.csv")) == []


@pytest.mark.parametrize("batch", [1, 3])
def test_a_killed_worker_costs_its_job_alone_and_a_job_may_go_elsewhere(here, batch):
    (here / "mine.py").write_text(
        "import os\nimport signal\nimport pandas as pd\nfrom epuckhebb import Study\n\n\nclass Mine(Study):\n"
        "    def plan(self):\n        return [{'number': number} for number in range(6)]\n\n"
        "    @classmethod\n    def do(cls, job):\n        os.chdir('/')\n"
        "        if job['number'] == 1:\n            os.kill(os.getpid(), signal.SIGKILL)\n"
        "        return {'numbers': pd.DataFrame([job])}\n"
    )
    words = ["hydra/launcher=joblib", "hydra.launcher.n_jobs=2", "hydra.sweep.dir=out", f"--batch={batch}"]
    told = call("sweep", "mine.py:Mine", *words)
    assert told.exit_code == 1
    assert "1 of 6 jobs" in told.stderr
    done_jobs = [pd.read_csv(file).number[0] for file in (here / "out").glob("job_*/numbers.csv")]
    assert sorted(done_jobs) == [0, 2, 3, 4, 5]
