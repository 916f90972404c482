"""The project says each thing as its field says it: no word of its old dialect, and on pages no long sentence."""

import ast
import json
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PAGES = (
    "README.md",
    "CONTRIBUTING.md",
    "mkdocs.yml",
    "docs/*.md",
    "runs/README.md",
    "runs/reference/README.md",
    "examples/*.ipynb",
    "examples/*/README.md",
    "examples/*/*.py",
    "examples/*/*/*.yaml",
)
PACKAGE = ("epuckhebb/**/*.py", "conf/**/*.yaml", "docs/keys.md", "docs/files.md")  # two pages are made of the package
GENERATED = PACKAGE[-2:]

# What not to say, as regular expressions, and what to say instead. A letter ends a word, `_` does not.
AVOID = {
    r"(laid|lays?|laying) over": "added after evolution; as a kind of method post_hoc",
    r"home": "the training world",
    r"twins?": "matched control",
    r"baselines?": "nominal statistics",
    r"sound": "intact",
    r"master(s|ed|ing)?": "solves, solved",
    r"born|births?|unborn": "initial, initial weights, initialise",
    r"dies?|died": "ends",
    r"forgets?|forgotten|forgot": "reset to the genes",
    r"lives|lived|living": "runs; lifetimes",
    r"(robots?|champions?|controllers?|genomes?|individuals?|to|lets?|they|who) live(?! fitness)": "runs",
    r"danc(e|es|ed|ing)": "calibration manoeuvre, calibration",
    r"shak(e|es|ing)": "motor noise",
    r"told|tells|hears?|heard": "is given, receives; for a text: says, shows, lists",
    r"robots? knows?|knows only": "say which knowledge: senses, clock, goal signal, live fitness, sensor model",
    r"lateness": "late",
    r"light synapses?": "weights from the light sensors",
    r"pace": "wheel gain",
    r"(its|their|all) readings": "sensor readings",
    r"verbs?": "command",
    r"noise repeats?": "repeat",
    r"first looks?|(is|as|was) a look": "smoke test",
    r"c[ao]mes? to|coming to": "reached, was, is",
    r"numbers (are )?evolved|evolved numbers": "evolved parameters",
    r"same (bytes|bits)|(to|by) (the|a) (byte|bit)": "bit-identical",
    r"brittle(ness)?": "fragile, fragility",
    r"spoil(s|ed|t)?": "breaks",
    r"been put through": "robustness tests",
    r"(had|has|have) in mind": "unseen kinds of change",
    r"mid-life": "during a lifetime",
    r"what came of it": "Result",
    r"refuse what cannot be": "validate the settings",
    r"without a word": "unexpectedly",
}
ALLOWED = {  # what looks like one of these words, and why it stands
    r"/home/\w+": "a folder",
    r"Path\.home\(\)|XDG_CACHE_HOME": "names of others",
    r"[Ss]table-[Bb]aselines3": "the name of a library",
    r"home_base_201": "a name in the committed tables of the reference run",
    r"(reference/)?baseline/\w*": "a folder of the reference run",
    r"<!-- .*? -->": "a mark around a generated part of a page",
}
NAMES = {  # of functions, classes, arguments and fields: what to say instead
    "told": "value, facts, text",
    "born": "initial_life",
    "Birth": "Genotype",
    "Room": "Workspace",
    "kept": "synapse_state",
    "Now": "StepContext",
    "spare": "fallback_rule",
    "unborn": "dummy",
    "misread": "apply_sensor_faults",
    "judge": "end_step",
    "Danced": "CalibrationRecord",
    "asked": "prepare",
    "fit": "check_genome",
    "lives": "run_lifetimes",
    "completed": "resolve_names",
    "meet": "validate_shared",
    "of_today": "migrate",
    "_brought": "default_override",
    "hold": "lock",
    "is_held": "is_locked",
    "going_on": "resume",
    "write_whole": "write_atomic",
    "carry_out": "run_tasks",
    "at_work": "open_study",
    "end_with": "exit_with_parent",
    "fall_silent": "discard_output",
    "show_what_can_be_shown": "replace_unencodable",
    "who": "individual",
}
MAY_TELL = (
    "epuckhebb/evolution/",
    "examples/own_optimizer/",
)  # `ask` and `tell` are the words of every library of optimizers
MOST_WORDS = 25


def files(patterns):
    """Files of these patterns; a page that is made of the package only if the package is among them."""
    found = (path for pattern in patterns for path in sorted(ROOT.glob(pattern)))
    own = {ROOT / page for page in GENERATED}
    return [path for path in found if path not in own or GENERATED[0] in patterns]


def text_of(path):
    """What a reader meets; of a notebook, its text."""
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".ipynb":
        return "\n\n".join(
            "".join(cell["source"]) for cell in json.loads(text)["cells"] if cell["cell_type"] == "markdown"
        )
    return text


def named(path):
    return path.relative_to(ROOT).as_posix()


@pytest.mark.parametrize("path", files((*PAGES, *PACKAGE)), ids=named)
def test_no_word_of_the_old_dialect(path):
    text = " ".join(re.sub("|".join(ALLOWED), "", text_of(path)).split())
    said = [
        f"{text[max(found.start() - 30, 0) : found.end() + 30]!r}: say {instead}"
        for words, instead in AVOID.items()
        for found in re.finditer(rf"(?<![A-Za-z])(?:{words})(?![A-Za-z])", text, re.IGNORECASE)
    ]
    assert said == []


@pytest.mark.parametrize("path", [path for path in files((*PAGES, *PACKAGE)) if path.suffix == ".py"], ids=named)
def test_no_name_of_the_old_dialect(path):
    names = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            names.add(node.name)
        elif isinstance(node, ast.arg):
            names.add(node.arg)
        elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            names.add(node.target.id)
    assert {name: NAMES[name] for name in names & set(NAMES)} == {}
    if not named(path).startswith(MAY_TELL):
        assert [name for name in names if re.match(r"_?tell(_|$)", name)] == []


def sentences(text):
    """The sentences of a page, without its code, tables and the places that links lead to."""
    text = re.sub(r"<!-- (\w+): .*?<!-- end of \1 -->|^```.*?^```$", "\n", text, flags=re.DOTALL | re.MULTILINE)
    text = re.sub(r"\]\([^)]*\)", "]", re.sub(r"`[^`\n]*`", "code", text))
    text = re.sub(r"^\|.*\|$", "\n", text, flags=re.MULTILINE)
    for part in re.split(r"\n\s*\n|\n(?=\s*(?:- |\d+\. |#))", text):
        yield from re.split(r"(?<=[.!?:;])\s+", " ".join(part.split()))


@pytest.mark.parametrize("path", [path for path in files(PAGES) if path.suffix in (".md", ".ipynb")], ids=named)
def test_sentences_are_short(path):
    assert [sentence for sentence in sentences(text_of(path)) if len(sentence.split()) > MOST_WORDS] == []


@pytest.mark.parametrize("path", [path for path in files(PAGES) if path.suffix == ".md"], ids=named)
def test_a_page_shows_its_first_command_soon(path):
    before, _, after = text_of(path).partition("\n```")
    assert not after or len(before.split()) <= 300


def test_the_glossary_is_short():
    rows = re.findall(r"^\| (?!word |---)", (ROOT / "docs" / "glossary.md").read_text(), re.MULTILINE)
    assert 0 < len(rows) <= 35
