"""Random damage to the files of `--config-dir`: each is refused with its file and line, or does no harm, in time."""

import shutil

import pytest
import yaml
from cases import contents
from contract import half_written, type_in

from epuckhebb.runtime.errors import USAGE
from epuckhebb.runtime.resources import data_folder

pytestmark = pytest.mark.torture

CASES = 300
BOUND_S = 60  # of one command line; a kernel may have to be compiled on a busy machine
SHORT = ["lifetime.duration_s=0.064", "lifetime.record_every=0", "repeats=1", "-q"]
BRIEF = ["lifetime.duration_s=0.064", "ga.population=2", "ga.elites=1", "ga.generations=1", "ga.loops=1", "-q"]
OF_EVALUATIONS = ("scenario", "maze", "hebbian", "adaptation", "robot", "lifetime")
OF_EVOLUTIONS = ("ga", "optimizer", "training")


def a_key_twice(chance, text):
    """The text with one of its keys once more, and another value."""
    lines = [line for line in text.splitlines(keepends=True) if line.strip() and not line.lstrip().startswith("#")]
    keyed = [line for line in lines if line.partition(":")[2].partition("#")[0].strip() not in ("", "|", ">")]
    keyed = [line for line in keyed if not line.lstrip().startswith(("-", "defaults", "[", "{"))]
    if not keyed:
        return text + "\ntwice: 1\ntwice: 2\n"
    line = chance.choice(keyed)
    place = text.index(line) + len(line)
    again = f"{line.partition(':')[0]}: {chance.choice(['0.5', '7', 'x', 'null'])}\n"
    return text[:place] + ("" if line.endswith("\n") else "\n") + again + text[place:]


SIGNS = [b"\0", b"\t", b"\xff", b"\xef\xbb\xbf", b"\x85", b"\x1b[2J", b"\r", b"---\n", b": ", b"- "]
ADDED = [
    *("own: &own [*own]", "own: &own {again: *own}", "own: &own {<<: *own}", "own: *nobody"),
    *("own: !!python/object/apply:os.system ['touch harm']", "own: !mine x", "own: !!binary x", "own: !!timestamp x"),
    *("own: !!int x", "own: 2001-99-99", f"own: {'9' * 5000}", f"own: {'[' * 3000}", f"own: {'[' * 3000}{']' * 3000}"),
    *("own: ${oc.env:HOME}", "own: ${own}", "own: ${..own}", "own: ${nothing.like.this}", "? [a, b]\n: 1"),
    *("1: 2\ntrue: 3\nnull: 4", "own: .nan", "own: 0o7", "own: '\udcff'", "--- \nown: 1"),
]
WHOLE = [
    *(b"", b"#", b"[]", b"- a\n- b\n", b"5", b"null", b"text", b"\0" * 64, b"\xff\xfe\0", b"[" * 5000, b"a: b: c"),
    *(b"%YAML 9.9\n---\na: 1\n", b"defaults: 5\n", b"defaults: {a: b}\n", b"defaults: [[a]]\n", b"...", b"true"),
]
ITSELF = [
    *("[{name}]", "[{name}, _self_]", "[_self_, {name}]", "[{{/{group}: {name}}}]", "[{{override /{group}: {name}}}]"),
    *("[_self_, _self_]", "[nobody]", "[{{{group}@{group}: {name}}}]", "[/evaluate]", "['${{own}}', _self_]"),
]
DAMAGE = ["cut", "cut", "flipped", *["twice"] * 3, "bracket", "inserted", "added", "added", "whole", "itself"]


def damaged(chance, text, group, name):
    """The damaged content of a file, as bytes, and what was done to it."""
    whole, one = text.encode(), chance.choice(DAMAGE)
    place = chance.randrange(len(whole))
    if one == "cut":
        content = whole[:place]
    elif one == "flipped":
        content = bytearray(whole)
        for _ in range(chance.choice([1, 1, 8])):
            content[chance.randrange(len(content))] ^= 1 << chance.randrange(8)
    elif one == "twice":
        content = a_key_twice(chance, text).encode()
    elif one == "bracket":
        colon, sign = text.find(":") + 1, chance.choice([" [", " {", ' "', " '", " [}", " &", " *", " |x"])
        content = (text[:colon] + sign + text[colon:]).encode()
    elif one == "inserted":
        content = whole[:place] + chance.choice(SIGNS) + whole[place:]
    elif one == "added":
        content = f"{text}\n{chance.choice(ADDED)}\n".encode(errors="surrogateescape")
    elif one == "whole":
        content = chance.choice(WHOLE)
    else:
        defaults = f"defaults: {chance.choice(ITSELF).format(group=group, name=name)}\n"
        lines = text.splitlines(keepends=True)
        rest = "".join(line for line in lines if not line.startswith(("#", "defaults")))
        content = ("".join(line for line in lines if line.startswith("#")) + defaults + rest).encode()
    return bytes(content), one


def drawn(chance):
    """A group, a file of the program's in it, the name under which the user has it, and a command that names it."""
    group = chance.choice([*OF_EVALUATIONS, *OF_EVOLUTIONS, "experiment"])
    files = sorted((data_folder("conf") / group).glob("*.yaml"))
    file = chance.choice([file for file in files if file.stem != "epuck_lidar"])  # for which there is no champion
    name = chance.choice(["mine", "mine", file.stem])
    command = "evolve" if group in OF_EVOLUTIONS else "evaluate"
    if group == "experiment":
        words = [["sweep", name, "--dry-run"], ["evaluate", f"experiment={name}", *SHORT]]
        return group, file, name, chance.choice(words)
    words = [command, f"{group}={name}", *(BRIEF if command == "evolve" else SHORT)]
    if group == "lifetime":
        words = [word for word in words if not word.startswith("lifetime.")] + ["--cfg=job"]
    elif group == "optimizer":
        words = [command, f"{group}={name}", "--cfg=job"]
    elif chance.random() < 0.3:
        words.append(chance.choice(["--cfg=job", "--cfg=hydra"]))
    elif chance.random() < 0.2:
        words += ["-m", "seed=1,2"]
    return group, file, name, words


def is_broken(content):
    """Whether YAML itself cannot read it."""
    try:
        yaml.safe_load(content)
    except (yaml.YAMLError, UnicodeDecodeError):
        return True
    except Exception:  # what it says means nothing to YAML's own types, such as a month 99
        return False
    return False


@pytest.mark.parametrize("chance", range(3), indirect=True)
def test_damaged_files_of_a_user(chance, tmp_path, monkeypatch):
    failures, counts = [], {}
    for number in range(CASES // 3):
        group, file, name, words = drawn(chance)
        content, what = damaged(chance, file.read_text(encoding="utf-8"), group, name)
        around = tmp_path / str(number)
        mine = around / "own" / group / f"{name}.yaml"
        mine.parent.mkdir(parents=True)
        mine.write_bytes(content)
        before = contents(around)
        monkeypatch.chdir(around)
        try:
            result = type_in(*words, "--config-dir", "own", seconds=BOUND_S)
            after = contents(around)
            assert {path: after.get(path) for path in before} == before, "a file of the user's was touched"
            assert not (around / "harm").exists(), "code of a file was run"
            if result.exit_code == USAGE and "-m" not in words:
                assert after.keys() == before.keys(), f"left behind: {after.keys() - before.keys()}"
            assert half_written(around) == ([], []), "left half-written"
            if what == "twice" or is_broken(content):
                assert result.exit_code == USAGE, f"{what}: not refused\n{result.output}"
                assert f"{name}.yaml" in result.stderr, f"{what}: no file in the message\n{result.output}"
            counts[what, result.exit_code] = counts.get((what, result.exit_code), 0) + 1
        except (AssertionError, pytest.fail.Exception) as error:
            told = str(error)
            told = told if len(told) < 900 else f"{told[:300]}\n...\n{told[-600:]}"
            failures.append(f"{number} {what}, {group}/{name}.yaml: {words}\n{told}")
        monkeypatch.chdir(tmp_path)
        if not failures or not failures[-1].startswith(f"{number} "):
            shutil.rmtree(around)
    print(counts)
    assert not failures, f"{len(failures)} of {CASES // 3}; what was damaged is in {tmp_path}\n" + "\n\n".join(failures)
