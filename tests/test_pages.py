"""The commands in sh blocks of the pages run, the rule shown is the example, and links lead somewhere."""

import itertools
import re
import shlex
import shutil
import sys
import webbrowser
from pathlib import Path

import pytest
from cases import call, done

from epuckhebb import api

ROOT = Path(__file__).parents[1]
EXAMPLES = sorted((ROOT / "examples").glob("*/README.md"))
PAGES = [*ROOT.glob("*.md"), ROOT / "runs" / "README.md", *sorted((ROOT / "docs").glob("*.md")), *EXAMPLES]
WITH_COMMANDS = [ROOT / "README.md", *EXAMPLES]
MORE_COMMANDS = [
    ROOT / "docs" / f"{name}.md"
    for name in ("parts", "changes", "clusters", "keys", "leaderboard", "results", "reversal", "rules", "webots")
]
BRIEF = {
    # longer than until the changes of the worlds on the pages
    "evaluate": ["repeats=1", "lifetime.duration_s=SECONDS", "lifetime.record_every=0", "threads=1", "-q"],
    "evolve": ["lifetime.duration_s=1", "-q"],
    "sweep": ["--dry-run"],
    "leaderboard": ["--dry-run"],
    "keys": [],
    "export": [],
}
BRIEF_TASK = ["task.trials=2", "task.last_switch=2", "task.time_out_s=1"]  # these say how long a life is
BRIEF_GA = ["ga.population=4", "ga.elites=1", "ga.generations=1", "ga.loops=1"]


def brief(command, words, seconds=64):
    """What makes a command of a page take little time."""
    of_task = BRIEF_TASK if "task=reversal" in words else []
    whole = [word for word in BRIEF[command] if not (of_task and word.startswith("lifetime.duration_s"))] + of_task
    if command != "evolve":
        shorter = [word.replace("SECONDS", str(seconds)) for word in whole]
        return [*shorter, *(["lifetime.record_every=250"] if "--open" in words else [])]
    other = any(word.startswith("optimizer=") for word in words)
    return [*whole, *(["optimizer.generations=1"] if other else BRIEF_GA)]


def two_of_many(line):
    """A command over many seeds, with two of them."""
    return re.sub(r"\bseed=range\((\d+),\d+\)", lambda found: f"seed={found[1]},{int(found[1]) + 1}", line)


def told(page):
    return str(page.relative_to(ROOT))


def blocks(page, language):
    return re.findall(rf"^```{language}\n(.*?)^```$", page.read_text(), re.MULTILINE | re.DOTALL)


@pytest.fixture
def checkout(tmp_path, monkeypatch):
    """A folder with copies of the examples and of a learner, where the commands of a page are typed."""
    for folder in ("examples", "runs/reference/reversal"):
        shutil.copytree(ROOT / folder, tmp_path / folder)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.thorough
@pytest.mark.usefixtures("checkout")
@pytest.mark.parametrize(
    ("pages", "seconds"),
    [pytest.param(WITH_COMMANDS, 64, id="most"), pytest.param(MORE_COMMANDS, 200, id="more", marks=pytest.mark.slow)],
)
def test_the_commands_of_the_pages_run(pages, seconds, monkeypatch):
    """In one folder, page after page; what stands on two of them runs once. Some want a champion to be there."""
    monkeypatch.setattr(webbrowser, "open", lambda _: True)
    shown = {page: "".join(blocks(page, "sh")).splitlines() for page in pages}
    assert all(shown.values())
    done("evolve", *brief("evolve", []))
    for line in filter(None, dict.fromkeys(itertools.chain(*shown.values()))):
        program, command, *words = shlex.split(two_of_many(line), comments=True)
        assert program == "epuckhebb"
        done(command, *words, *brief(command, words, seconds))


@pytest.mark.slow
def test_the_tutorial(checkout, monkeypatch):
    """Its commands with shorter lifetimes, its sweep and its plot."""
    page = ROOT / "docs" / "tutorial.md"
    monkeypatch.setattr(webbrowser, "open", lambda _: True)
    monkeypatch.setenv("MPLBACKEND", "agg")
    (checkout / "my_conf" / "experiment").mkdir(parents=True)
    (sweep,) = blocks(page, "yaml")
    (checkout / "my_conf" / "experiment" / "dim.yaml").write_text(sweep)
    short = ["repeats=1", "lifetime.duration_s=64", "threads=1", "-q"]
    more = {"evaluate": short, "sweep": [*short, "hydra/launcher=basic"]}
    for line in "".join(blocks(page, "sh")).splitlines():
        _, command, *words = shlex.split(line)
        done(command, *words, *more.get(command, brief(command, words) if command == "evolve" else []))
    (plot,) = blocks(page, "python")
    exec(plot, {})
    assert (checkout / "dim.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.slow
@pytest.mark.usefixtures("checkout")
def test_the_python_page(monkeypatch):
    """All its blocks, one after the other, with short lifetimes."""
    evaluate, evolve = api.evaluate, api.evolve

    def briefly(genome, overrides, *more):
        return evaluate(genome, [*overrides, "lifetime.duration_s=2"], *more)

    monkeypatch.setattr(api, "evaluate", briefly)
    monkeypatch.setattr(api, "evolve", lambda overrides, *more: evolve([*overrides, "lifetime.duration_s=1"], *more))
    names = {}
    for block in blocks(ROOT / "docs" / "python.md", "python"):
        exec(block, names)
    assert set(names["success"].index.get_level_values("scenario")) == {"base", "4obstacles"}
    assert Path("paths.png").is_file()


@pytest.mark.thorough
def test_the_python_of_the_parts_page_runs(checkout, monkeypatch):
    monkeypatch.setattr(sys, "path", list(sys.path))
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(checkout))
    (script,) = (block for block in blocks(ROOT / "docs" / "parts.md", "python") if block.startswith("import"))
    names = {}
    exec(script, names)
    sys.modules.pop("my_rules")
    assert set(names["rows"].controller) == {"GA", "gated"}
    assert (names["rows"].query("controller == 'gated'").weight_change_mean > 0).all()


def test_the_rule_of_the_parts_page_is_that_of_the_example_and_short():
    text = (ROOT / "examples" / "own_rule" / "my_rules.py").read_text()
    assert len(text.splitlines()) <= 20
    (shown,) = (block for block in blocks(ROOT / "docs" / "parts.md", "python") if "class" in block)
    assert shown in text


@pytest.mark.parametrize("page", EXAMPLES, ids=told)
def test_the_page_of_an_example_is_short(page):
    assert len(page.read_text().splitlines()) <= 25


@pytest.mark.parametrize("page", PAGES, ids=told)
def test_commands_work_in_every_shell(page):
    """That of Windows, too, knows double quotes only."""
    assert not [line for block in blocks(page, "sh") for line in block.splitlines() if "'" in line.partition(" # ")[0]]
    assert not re.findall(r"`[^`\n]*'[\w.]+=[^`\n]*`", page.read_text())


@pytest.mark.parametrize("command", ["evaluate", "evolve", "sweep", "reproduce"])
def test_examples_of_help_work_in_every_shell(command):
    examples = call(command, "--help").stdout.partition("Examples")[2]
    assert f"epuckhebb {command}" in examples
    assert "'" not in examples


def anchors(page):
    """The places in a page that a link may name: its headings, as GitHub writes them."""
    headings = re.findall(r"^#+ (.+)$", page.read_text(), re.MULTILINE)
    return {re.sub(r"[^\w -]", "", heading).lower().replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES, ids=told)
def test_links_lead_somewhere(page):
    for target in re.findall(r"\]\(([^)]+)\)", page.read_text()):
        if "://" not in target:
            file, _, place = target.partition("#")
            found = page.parent / file if file else page
            assert found.exists(), target
            assert not place or place in anchors(found), target
