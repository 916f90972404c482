"""The commands of the pages are understood and run, the rule shown is the example, and links lead somewhere."""

import functools
import itertools
import re
import shlex
import shutil
import sys
import webbrowser
from pathlib import Path

import numpy as np
import pytest
import yaml
from cases import call, done, first_of
from typer.main import get_command

import epuckhebb
from epuckhebb.cli.commands import app
from epuckhebb.live import server
from epuckhebb.runtime.conf import groups
from epuckhebb.runtime.resources import data_folder

ROOT = Path(__file__).parents[1]
EXAMPLES = sorted((ROOT / "examples").glob("*/README.md"))
RUNS = [ROOT / "runs" / "README.md", ROOT / "runs" / "reference" / "README.md"]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *RUNS, *sorted((ROOT / "docs").glob("*.md")), *EXAMPLES]
APART = ("tutorial", "clusters", "any_world", "evolve_or_adapt")  # tested elsewhere; those of the second fill a cluster
WITH_COMMANDS = [ROOT / "README.md", *EXAMPLES]
PLACEHOLDER = re.compile(r"\b(RUN|NAME|FILE|KEY|GROUP|Best\.npy)\b|[<>…]|\.\.\.|~")
BRIEF = {
    # longer than until the changes of the worlds on the pages
    "evaluate": ["repeats=1", "lifetime.duration_s=SECONDS", "figures=none", "threads=1", "-q"],
    "evolve": ["lifetime.duration_s=1", "-q"],
    "sweep": ["--dry-run"],
    "leaderboard": ["--dry-run"],
    "reproduce": [
        "champions=1",
        "repeats=1",
        "rates=[0.002]",
        "hydra/launcher=basic",
        "ga.population=4",
        "ga.elites=1",
        "ga.generations=1",
        "-q",
    ],
    "flock": ["repeats=1", "flock.duration_s=60", "flock.at_s=30", "-q"],
    "keys": [],
    "export": [],
    "show": [],
    "replay": [],
    "figure": [],
    "play": ["--no-browser", "--port", "0", "-q"],
}
BRIEF_TASK = ["task.trials=6", "task.time_out_s=1"]  # of three switches, too
BRIEF_GA = ["ga.population=4", "ga.elites=1", "ga.generations=1", "ga.loops=2"]


def brief(command, words, seconds=64):
    """What makes a command of a page take little time."""
    of_task = BRIEF_TASK if "task=reversal" in words else []
    in_environment = any(word.startswith("environment=") for word in words)
    no_key = ("lifetime.duration_s", *(["threads"] if in_environment else [])) if of_task or in_environment else ()
    whole = [word for word in BRIEF[command] if not word.startswith(no_key)] + of_task
    if command != "evolve":
        return [word.replace("SECONDS", str(seconds)) for word in whole]
    other = any(word.startswith(("optimizer=", "optimizer.algorithm=", "environment=")) for word in words)
    return [*whole, *(["optimizer.generations=1"] if other else BRIEF_GA)]


def two_of_many(line):
    """A command over many seeds, with two of them."""
    return re.sub(r"\bseed=range\((\d+),\d+\)", lambda found: f"seed={found[1]},{int(found[1]) + 1}", line)


def named(page):
    return str(page.relative_to(ROOT))


def blocks(page, language):
    return re.findall(rf"^```{language}\n(.*?)^```$", page.read_text(), re.MULTILINE | re.DOTALL)


def shown(page):
    """The commands in the shell blocks of a page, without comments."""
    lines = "".join([*blocks(page, "sh"), *blocks(page, "bash")]).splitlines()
    commands = (line.partition(" #")[0].rpartition(" && ")[2].strip() for line in lines)
    return [line for line in commands if line.startswith("epuckhebb ")]


def mentioned(page):
    """The commands in the sentences of a page which have no placeholder."""
    text = re.sub(r"^```.*?^```$", "", page.read_text(), flags=re.MULTILINE | re.DOTALL)
    found = (" ".join(line.split()) for line in re.findall(r"`(epuckhebb [a-z][^`]*)`", text))
    return [line for line in found if not PLACEHOLDER.search(line)]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with what the pages speak of: the examples, a learner, an evolution and a sweep of one's own."""
    folder = tmp_path_factory.mktemp("clone")
    for name in ("examples", "runs/reference/reversal", "runs/reference/champions"):
        shutil.copytree(ROOT / name, folder / name)
    for example, copy in (("own_world", "my_world"), ("rules_by_seeds", "my_study")):
        shutil.copytree(folder / "examples" / example, folder / copy)
    experiments = folder / "my_conf" / "experiment"
    experiments.mkdir(parents=True)
    for name in ("dim", "mine"):
        (experiments / f"{name}.yaml").write_text(blocks(ROOT / "docs" / "tutorial.md", "yaml")[0])
    (folder / "my_conf" / "adaptation").mkdir()
    (folder / "my_conf" / "adaptation" / "mine.yaml").write_text(blocks(ROOT / "docs" / "parts.md", "yaml")[0])
    (folder / "my_conf" / "method").mkdir()
    for name, text in zip(("mine", "after", "fixed"), blocks(ROOT / "docs" / "rules.md", "yaml"), strict=True):
        (folder / "my_conf" / "method" / f"{name}.yaml").write_text(text)
    done("evolve", *brief("evolve", []), f"hydra.run.dir={folder}/runs/evolve/RUN")
    (folder / "runs" / "evolve" / "cma_me").mkdir()
    np.save(folder / "runs" / "evolve" / "cma_me" / "genome.npy", epuckhebb.load())
    for name in ("0", "1"):
        shutil.copytree(folder / "runs" / "evolve" / "RUN", folder / "evolved" / name)
    return folder


@pytest.fixture
def checkout(folder, tmp_path, monkeypatch):
    """A copy of that folder, where the commands of a page are typed; some of them make the rest."""
    shutil.copytree(folder, tmp_path, dirs_exist_ok=True, ignore=shutil.ignore_patterns("evolved", "cma_me"))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def one_job(words):
    """The words of a command over many values, with the first of each."""
    firsts = (re.sub(r"=range\((\d+),.*", r"=\1", word) for word in words if word not in ("-m", "--multirun"))
    return [
        re.sub(r"(?<=\]),\[.*", "", word) if re.search(r"[\[{]", word) else word.partition(",")[0] for word in firsts
    ]


def all_that_it_varies(words):
    """The keys with many values of a named sweep of the program which a command leaves as they are."""
    file, given = data_folder("conf") / "experiment" / f"{words[0]}.yaml", {word.partition("=")[0] for word in words}
    varied = yaml.safe_load(file.read_text())["hydra"]["sweeper"]["params"] if file.is_file() else {}
    return [f"{key}={values}" for key, values in varied.items() if key not in given]


def composed_only(command, words):
    """What shows that the keys of a command are known, and starts no new lifetime; or nothing."""
    if command in ("evaluate", "evolve") and not any(word.startswith("resume=") for word in words):
        return [*one_job(words), *([] if "--cfg" in words else ["--cfg", "job"])]
    if command == "sweep":
        return [*words, *one_job(all_that_it_varies(words)), *([] if "--dry-run" in words else ["--dry-run"])]
    return words if command == "evolve" else []


def together(commands):
    """The calls for these commands: one for each set of groups and options, with all their keys.

    A key or a scenario that has another value begins another call. Where a run is, and where one goes, is left out:
    composing does not look there, but for a champion in an environment. Yields (command, words, the words of each
    command).
    """
    calls = []
    for command, all_words in commands:
        in_environment = any(word.startswith("environment=") for word in all_words)
        left_out = r"hydra\.\w+\.dir=" if in_environment else r"genome=runs/|hydra\.\w+\.dir="
        words = [word.removesuffix("/*") for word in all_words if not re.match(left_out, word)]
        names = {word: word.partition("=")[0] for word in words}
        own = {*groups(command)} - {"scenario"}
        same = {word for word, name in names.items() if name in own or "/" in name or "=" not in word}
        keys = {names[word]: word for word in words if word not in same}
        for of, of_same, of_keys, members in calls:
            if (of, of_same) == (command, same) and all(of_keys.get(name, word) == word for name, word in keys.items()):
                of_keys.update(keys)
                members.append(words)
                break
        else:
            calls.append((command, same, keys, [words]))
    for command, same, keys, members in calls:
        yield command, [word for word in members[0] if word in same] + [*keys.values()], members


@pytest.mark.parametrize(
    "pages", first_of([WITH_COMMANDS, [page for page in PAGES if page not in WITH_COMMANDS]]), ids=len
)
def test_the_commands_of_pages_are_understood(pages, folder, monkeypatch):
    monkeypatch.chdir(folder)
    commands = []
    for line in dict.fromkeys(itertools.chain.from_iterable([*shown(page), *mentioned(page)] for page in pages)):
        _, command, *words = shlex.split(line)
        if words and "--help" not in words:
            get_command(app).commands[command].make_context(command, list(words))  # an unknown option ends this
            if (
                "ray_local" not in line
                and not words[0].startswith("legs")
                and (composed := composed_only(command, words))
            ):
                commands.append((command, composed))
    assert commands
    for command, words, members in together(commands):
        if call(command, *words).exit_code:  # which of them is it, or do they only not go together?
            for own in members:
                done(command, *own)


def test_what_n_means_per_metre_has_the_numbers_of_the_answer():
    _, script = blocks(ROOT / "docs" / "tutorial.md", "python")
    names = {}
    exec(script, names)
    for name, shown in (("steps", ".0f"), ("fast", ".1f"), ("slow", ".1f"), ("small", ".2f")):
        assert re.search(rf"^{name} = .*# .*\b{names[name]:{shown}}\b", script, re.MULTILINE), name


@pytest.mark.thorough
def test_the_methods_of_the_page_of_rules_can_be_listed(folder, monkeypatch):
    monkeypatch.chdir(folder)
    done("leaderboard", "obstacles", "methods=mine,after,fixed", "champions=1", "--config-dir", "my_conf", "--dry-run")


@pytest.mark.thorough
@pytest.mark.usefixtures("checkout")
@pytest.mark.parametrize(
    ("pages", "seconds"),
    [
        pytest.param(WITH_COMMANDS, 64, id="fast"),
        pytest.param(
            [page for page in PAGES if page not in WITH_COMMANDS and page.stem not in APART],
            200,
            id="more",
            marks=pytest.mark.slow,
        ),
    ],
)
def test_the_commands_of_the_pages_run(pages, seconds, monkeypatch):
    """In one folder, page after page; what stands on two of them runs once."""
    monkeypatch.setattr(webbrowser, "open", lambda _: True)
    monkeypatch.setattr(server.Play, "wait", lambda _: None)
    lines = list(dict.fromkeys(itertools.chain.from_iterable(map(shown, pages))))
    assert lines
    for line in lines:
        _, command, *words = shlex.split(two_of_many(line))
        for file in (word.removeprefix("genome=") for word in words if re.fullmatch("genome=.*npy", word)):
            np.save(file, epuckhebb.load())  # a script of the example makes it
        done(command, *words, *brief(command, words, seconds))


@pytest.mark.slow
def test_the_tutorial(checkout, monkeypatch):
    """Its commands with shorter lifetimes, its sweep and its plot."""
    page = ROOT / "docs" / "tutorial.md"
    monkeypatch.setattr(webbrowser, "open", lambda _: True)
    monkeypatch.setenv("MPLBACKEND", "agg")
    short = ["repeats=1", "lifetime.duration_s=64", "threads=1", "-q"]
    more = {"evaluate": short, "sweep": [*short, "hydra/launcher=basic"]}
    for line in shown(page):
        _, command, *words = shlex.split(line)
        done(command, *words, *more.get(command, brief(command, words) if command == "evolve" else []))
    plot, _ = blocks(page, "python")
    exec(plot, {})
    assert (checkout / "dim.png").read_bytes().startswith(b"\x89PNG")


def _briefly(whole, brief, *given, **keys):
    return whole(*given, brief, **keys)


@pytest.mark.slow
@pytest.mark.usefixtures("checkout")
def test_the_python_page(monkeypatch):
    """All its blocks, one after the other, with short lifetimes."""
    for name, brief in (("evaluate", "lifetime.duration_s=2"), ("evolve", "lifetime.duration_s=1")):
        whole = getattr(epuckhebb, name)
        monkeypatch.setattr(epuckhebb, name, functools.partial(_briefly, whole, brief))
    names = {}
    for block in blocks(ROOT / "docs" / "python.md", "python"):
        exec(block, names)
    assert set(names["success"].index.get_level_values("scenario")) == {"base", "4obstacles"}
    assert Path("paths.pdf").is_file()


def test_the_python_of_the_readme_holds_the_pole_up(monkeypatch):
    (script,) = blocks(ROOT / "README.md", "python")
    whole = epuckhebb.evolve
    monkeypatch.setattr(epuckhebb, "evolve", lambda word: whole(word, "environment.horizon=100", progress=False))
    names = {}
    exec(script, names)
    assert names["controller"].steps > 50


def test_a_lifetime_in_pieces_runs_as_shown(capsys):
    (script,) = blocks(ROOT / "docs" / "contribute.md", "python")
    exec(script, {})
    assert float(capsys.readouterr().out) > 0


def test_the_example_of_statistics_has_the_numbers_of_its_comments():
    (script,) = blocks(ROOT / "docs" / "methods.md", "python")
    names = {}
    exec(script, names)
    for name in ("share", "naive"):
        low, high = names[name]
        assert f"[{low:.2f}, {high:.2f}]" in script
    assert names["p"] == 0.25


@pytest.mark.thorough
def test_the_python_of_the_parts_page_runs(checkout, monkeypatch):
    monkeypatch.setattr(sys, "path", list(sys.path))
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(checkout))
    (script,) = (block for block in blocks(ROOT / "docs" / "parts.md", "python") if block.startswith("import sys"))
    names = {}
    exec(script, names)
    sys.modules.pop("my_rules")
    assert set(names["rows"].controller) == {"GA", "gated"}
    assert (names["rows"].query("controller == 'gated'").weight_change_mean > 0).all()


@pytest.mark.parametrize(
    ("example", "pages"),
    [
        ("own_rule/my_rules", ("docs/parts.md",)),
        ("own_fitness/my_fitness", ("docs/parts.md",)),
        ("own_sensor/my_sensors", ("docs/parts.md",)),
        ("own_signal/my_signals", ("docs/parts.md",)),
        ("own_task/my_task", ("docs/parts.md",)),
        ("own_optimizer/hill_climber", ("docs/parts.md",)),
        ("own_controller/my_neurons", ("docs/parts.md",)),
    ],
)
def test_a_class_of_the_parts_page_is_that_of_the_example_and_short(example, pages):
    text = (ROOT / "examples" / f"{example}.py").read_text()
    assert len(text.splitlines()) <= 50
    for page in pages:
        (block,) = (block for block in blocks(ROOT / page, "python") if block in text)
        assert "class" in block


@pytest.mark.parametrize("page", PAGES, ids=named)
def test_commands_work_in_every_shell(page):
    """That of Windows, too, knows double quotes only."""
    assert not [line for block in blocks(page, "sh") for line in block.splitlines() if "'" in line.partition(" # ")[0]]
    assert not re.findall(r"`[^`\n]*'[\w.]+=[^`\n]*`", page.read_text())


def anchors(page):
    """The places in a page that a link may name: its headings, as GitHub writes them."""
    headings = re.findall(r"^#+ (.+)$", page.read_text(), re.MULTILINE)
    return {re.sub(r"[^\w -]", "", heading).lower().replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES, ids=named)
def test_links_lead_somewhere(page):
    for target in re.findall(r"\]\(([^)]+)\)", page.read_text()):
        if "://" not in target:
            file, _, place = target.partition("#")
            found = page.parent / file if file else page
            assert found.exists(), target
            assert not place or place in anchors(found), target


def test_the_paper_cites_what_its_bibliography_has():
    text, bib = ((ROOT / "paper" / f"paper.{name}").read_text() for name in ("md", "bib"))
    assert set(re.findall(r"@(\w+\d{4})", text)) == set(re.findall(r"^@\w+{(\w+),", bib, re.MULTILINE))
