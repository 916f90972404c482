"""300 combinations of what own parts do wrong: each ends in one message, or gives the same bits twice."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from cases import SMALL_GA, call, contents
from test_own_parts import BODIES, part

import epuckhebb
from epuckhebb.config.parts import KINDS
from epuckhebb.runtime.errors import JOB_FAILED, USAGE
from epuckhebb.store.run import Run

COMBINATIONS = 300
GIVES = {  # what a method gives for its last argument, x; the first are as they should be
    "fine": "x",
    "truth": "x == x",
    "nothing": "None",
    "nothing sometimes": "x if COUNT[0] > 5 else None",
    "several": "(x, x)",
    "text": "'good'",
    "complex": "1j * x",
    "shape": "np.zeros((3, 7))",
    "type": "int",
    "nan": "x * np.nan",
    "infinite": "x * np.inf",
    "large": "x * 1e300",
    "huge": "10 ** 400",
    "random": "x * np.random.random()",
    "random of Python's": "x * random.random()",
    "random by overload": "x * drawn()",
    "the time": "x * time.perf_counter()",
    "a counter": "x * COUNT[0]",
    "beyond the end": "x * LIST[99]",
}
DOES = {  # before
    "fine": "pass",
    "print": "print('hello', 1.5)",
    "raise": "raise ValueError('no\\nno')",
    "assert": "assert COUNT is None",
    "leave": "sys.exit(0)",
    "stop": "raise StopIteration",
    "interrupt nobody": "raise BrokenPipeError",
    "count": "COUNT[0] += 1",
    "remember": "LIST.append(1.0)",
    "write": "open('written.txt', 'w').close()",
    "change what it is given": "x[0] = 5.0",
    "warn": "warnings.warn('hm')",
    "divide": "1 // (COUNT[0] * 0)",
    "recur": "forever()",
}
HEADS = {  # of a file
    "fine": "",
    "leave": "sys.exit(0)",
    "print": "print('{')",
    "raise": "raise KeyError",
    "broken": "def f(:",
    "replace": "print = None; len = 3; dataclass = 5",
}
MORE = {  # in a class
    "fine": "more: float = 1.0",
    "default": "more: float = 'far'",
    "list": "more: list = ()",
    "needed": "more: float",
    "nan": "more: float = np.nan",
    "name": "name: str = 'x\\ny'",
    "state": "state: ClassVar = {'a': 'b'}",
    "states": "state: ClassVar = {'a': np.zeros(3), 'b': 2}; synapse_state: ClassVar = {'a': np.nan}",
    "evolved": "evolved: ClassVar = {'a': 3}",
    "sizes": "sizes: ClassVar = (3, 'a')",
    "readings": "readings: ClassVar = ('a', 'a')",
    "leave": "def __post_init__(self): sys.exit(0)",
    "draw": "def __post_init__(self): object.__setattr__(self, 'more', np.random.random())",
    "forget": "def __post_init__(self): self.more = None",
    "init": "def __init__(self): pass",
    "repr": "def __repr__(self): return str(1 / 0)",
}
TOP = """\
import os, random, sys, time, warnings
from numba.extending import overload
COUNT, LIST = np.zeros(1), [1.0]
def drawn(): return np.random.random()
overload(drawn)(lambda: lambda: np.random.random())
def forever(): return forever()
"""
METHODS = {  # of a kind, with the arguments of each
    "rule": ["synapse(weight, post, pre)", "express(cls, x)", "check_wiring(self, x)"],
    "fitness": ["step(readings, left)", "life(paper, success)", "initial_state(self)"],
    "wiring": ["neuron(before, drive)", "synapses(self, x)", "step_s(self, y, x)"],
    "sensor": ["read(heading, x)"],
    "task": ["fitness(self, behaviour, x, trials, start)", "terms(self, goals, x)", "hooks(self, x)"],
    "optimizer": ["start(self, plan, x)", "ask(self)", "tell(self, fitness)", "candidates(self)", "tables(self)"],
    "coupling": ["drive(self, x)", "weights(self, x)"],
    "change signal": ["signal(nominal, away_s)"],
}
SETTINGS = {"rule": ["hebbian.N=0.001"], "change signal": ["adaptation.threshold=0.5"]}
SHORT = ["lifetime.duration_s=0.64", "threads=1", "figures=none"]
COMMANDS = {  # their kinds, and what makes them short
    "evaluate": (["rule", "fitness", "task", "change signal"], [*SHORT, "repeats=1"]),
    "evolve": (["rule", "fitness", "task", "sensor", "wiring", "optimizer"], [*SMALL_GA, *SHORT, "ga.generations=2"]),
    "flock": (["coupling"], ["repeats=1", "flock.duration_s=40", "flock.at_s=20", "flock.robots=3", "flock.knowers=1",
                             "flock.sweep={loudness: [], knowers: [], range_m: []}", "hydra/launcher=basic"]),
}  # fmt: skip


def bad_part(kind, chance):
    """A file with a part, in which one thing or two are wrong, and what these are."""
    method = chance.choice(METHODS[kind])
    tables = {"head": HEADS, "more": MORE, "does": DOES, "gives": GIVES}
    wrong = chance.choices(list(tables), [1, 3, 6, 10], k=chance.choice([1, 1, 2]))
    drawn = {name: chance.choice(list(table)) if name in wrong else "fine" for name, table in tables.items()}
    head, more, does, gives = (table[drawn[name]] for name, table in tables.items())
    name, arguments = re.fullmatch(r"(\w+)\((.*)\)", method).groups()
    own = (arguments.split(", ") or ["1.0"])[-1]
    body = re.sub(r"\bx\b", own, f"{does}; return {gives}")
    decorated = "" if "self" in arguments or "cls" in arguments else f"\n    {name} = staticmethod({name})"
    text = part(kind, method=f"{BODIES[kind][2]}\n    def {name}({arguments}): {body}{decorated}", more=more)
    return f"import numpy as np\n{TOP}{head}\n{text}", {"kind": kind, "method": method, **drawn}


def combination(chance):
    """A command line with one bad part or two, whose files are here, and what is wrong."""
    command = chance.choices(list(COMMANDS), [5, 5, 1])[0]
    known, words = COMMANDS[command]
    kinds, wrong = chance.sample(known, min(len(known), chance.choice([1, 1, 1, 2]))), []
    if command != "flock" and not {"sensor", "wiring"} & {*kinds}:  # a small network compiles in half the time
        words = [*words, "network.layers=[16,2]"]
    if command == "evaluate":
        np.save("small.npy", np.full(34, 0.1))
        words = [*words, "genome=small.npy"]
    for kind in kinds:
        text, what = bad_part(kind, chance)
        file = f"{kind.replace(' ', '_')}.py"
        Path(file).write_text(text)
        name = f"{file}:Fine"
        words = [*words, f"{KINDS[kind].base.KEY}={name}"] if kind != "sensor" else [
            *words, f"robot.sensors=[{{sensor: {name}}}]"]  # fmt: skip
        words = [*words, *SETTINGS.get(kind, [])]
        if kind == "optimizer":
            words = [word for word in words if not word.startswith("ga.")] + ["optimizer.generations=2"]
        wrong.append(what)
    return [command, *words, "--json"], wrong


def ends_well(words, folder):
    """Call a command that writes into a folder; its exit code. What it printed and left must be whole."""
    before = contents()
    result = call(*words, f"hydra.{'sweep' if words[0] == 'flock' else 'run'}.dir={folder}")
    assert isinstance(result.exception, SystemExit | None), result.exc_info
    assert result.exit_code in (0, JOB_FAILED, USAGE), result.output
    assert "Traceback" not in result.output
    assert len(re.findall("^Error: ", result.stderr, re.MULTILINE)) == bool(result.exit_code), result.output
    assert len(result.stderr.partition("Error: ")[2].splitlines()) <= 10, result.stderr
    if result.exit_code == 0:
        json.loads(result.stdout)
    elif result.exit_code == USAGE:
        assert {*contents()} - {*before} <= {"written.txt"}
    else:
        assert Run(Path(folder)).status["state"] == "failed"
    assert list(Path().rglob(".*.tmp")) == []
    return result


@pytest.mark.torture
@pytest.mark.filterwarnings("ignore")
def test_bad_parts(tmp_path, monkeypatch, chance):
    """Each is told before it runs (`pytest -s`)."""
    epuckhebb.load()
    codes = {}
    for number in range(COMBINATIONS):
        here = tmp_path / str(number)
        here.mkdir()
        monkeypatch.chdir(here)
        words, wrong = combination(chance)
        print(number, wrong, flush=True)
        result = ends_well(words, "one")
        print(result.exit_code, result.stderr.partition("Error: ")[2].strip(), flush=True)
        codes[result.exit_code] = codes.get(result.exit_code, 0) + 1
        if result.exit_code == 0:
            assert ends_well(words, "two").exit_code == 0
            one, two = ({name: content for name, content in contents(run).items() if name.endswith((".csv", "n.npz"))}
                        for run in ("one", "two"))  # fmt: skip
            assert one == two, [name for name in one if one[name] != two.get(name)]
        assert Path.cwd() == here
    print(codes)
    assert min(codes[0], codes[USAGE]) > COMBINATIONS // 10
