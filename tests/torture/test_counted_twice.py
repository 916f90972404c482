"""Values that repeat and names that collide: no lifetime counts twice, and no two champions are taken for one."""

import math
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from contract import bounded, type_in

import epuckhebb
from epuckhebb.runtime.errors import USAGE

pytestmark = [pytest.mark.torture, pytest.mark.usefixtures("here")]

SHORT = ["lifetime.duration_s=0.064", "lifetime.record_every=0", "repeats=1", "threads=1"]
BASIC = "hydra/launcher=basic"
SPELT = {  # key -> for each value, what a user may type for it
    "seed": {1: ["1", "1"], 2: ["2", "+2"], 30: ["30", "3_0"]},
    "hebbian.N": {0.001: ["0.001", "1e-3", "1.0e-3", ".001"], 0.002: ["0.002", "2e-3"], 0.5: ["0.5", ".5", "5e-1"]},
    "lifetime.noise": {0.0: ["0", "0.0", "0e3"], 1.0: ["1", "1.0"]},
    "scenario": {"base": ["base", "base"], "4obstacles": ["4obstacles"]},
}


def champions(chance):
    """Files of champions, and of each file who is in it; some names collide, and some files are copies."""
    genomes = np.random.default_rng(chance.randrange(1000)).uniform(-1, 1, (3, 234))
    whose = {}
    for place in ("x1/champion.npz", "x2/champion.npz", "x3/champion.npz", "a.npz", "b.npz", "a.npy", "deep/a.npz"):
        number = chance.randrange(3)
        Path(place).parent.mkdir(parents=True, exist_ok=True)
        if place.endswith(".npy"):
            np.save(place, genomes[number])
        else:
            np.savez(place, genome=genomes[number])
        whose[place] = number
    whose |= {f"./{place}": number for place, number in whose.items()}
    whose |= {place: whose[f"{place}/champion.npz"] for place in ("x1", "x2", "x3")}
    Path("link.npz").symlink_to("a.npz")
    return {**whose, "link.npz": whose["a.npz"]}


def drawn(chance):
    """What to give to keys, how many different values each has then, and whether any of them is there twice."""
    keys = chance.sample(list(SPELT), chance.choice([1, 2]))
    words, different, repeated = [], {}, False
    for key in keys:
        values = [chance.choice(list(SPELT[key])) for _ in range(chance.choice([2, 3]))]
        words.append(f"{key}={','.join(chance.choice(SPELT[key][value]) for value in values)}")
        different[key] = len(set(values))
        repeated |= len(values) > different[key]
    if chance.random() < 0.5:
        whose = champions(chance)
        given = chance.sample(list(whose), chance.choice([2, 3]))
        words.append(f"genome={','.join(given)}")
        different["genome"] = len({whose[place] for place in given})
        repeated |= len(given) > different["genome"]
    return words, different, repeated


def checked(table, different):
    """No lifetime counts twice in a table, whose rows may be of several, and no two genomes have one name."""
    plastic = table[table.controller == "Hebbian"]
    counted, expected = plastic.n.sum() if "n" in plastic else len(plastic), 2 * math.prod(different.values())
    assert counted == expected, f"{counted} lifetimes where {expected} differ"
    if "genome" in different:
        assert plastic.genome.nunique() == different["genome"], set(plastic.genome)


@pytest.mark.parametrize("chance", range(15), indirect=True)
@pytest.mark.parametrize("command", ["evaluate", "sweep"])
def test_values_that_repeat(command, chance):
    words, different, repeated = drawn(chance)
    if command == "sweep":
        words = ["obstacles", *words, *([] if "scenario" in different else ["scenario=base"])]
    flags = ["-m"] if command == "evaluate" else []
    result = type_in(command, *words, *SHORT, BASIC, "hydra.sweep.dir=out", *flags)
    if result.exit_code == USAGE:  # refused: then the message says what is there twice
        assert repeated, result.output
        assert any(key in result.stderr for key in different), result.output
        assert not list(Path().glob("out/*/metrics.csv"))
        return
    assert result.exit_code == 0, result.output
    if command == "sweep":
        checked(pd.read_csv("out/sweep.csv"), different)
    checked(pd.read_csv("out/summary.csv"), different)


@pytest.mark.parametrize("chance", range(6), indirect=True)
def test_rescue_and_harm_do_not_depend_on_the_names_of_files(chance):
    """The same champions as `a.npz, b.npz` and as `x1/champion.npz, x2/champion.npz` lead to the same report."""
    values = np.random.default_rng(chance.randrange(1000)).uniform(-1, 1, (2, 234))
    named = {"apart": ["a.npz", "b.npz"], "alike": chance.choice([["x1/c.npz", "x2/c.npz"], ["x1", "x2"]])}
    if chance.random() < 0.3:
        named["alike"] = ["x1/run/champion.npz", "x2/run/champion.npz"]
    results = {}
    for how, places in named.items():
        for place, genes in zip(places, values, strict=True):
            file = Path(place) if place.endswith(".npz") else Path(place, "champion.npz")
            file.parent.mkdir(parents=True, exist_ok=True)
            np.savez(file, genome=genes)
        words = ["obstacles", f"genome={','.join(places)}", "scenario=base,4obstacles", *SHORT, BASIC]
        assert type_in("sweep", *words, f"hydra.sweep.dir={how}").exit_code == 0
        results[how] = Path(how)
    files = {how: {file.name for file in folder.glob("*.*") if file.is_file()} for how, folder in results.items()}
    assert files["apart"] == files["alike"]
    tables = {how: pd.read_csv(folder / "rescue_over_all.csv") for how, folder in results.items()}
    pd.testing.assert_frame_equal(tables["apart"], tables["alike"])


@pytest.mark.parametrize("chance", range(20), indirect=True)
def test_values_that_repeat_in_python(chance):
    given = {
        "seed": {1: [1, np.int64(1)], 2: [2]},
        "hebbian.N": {0.001: [0.001, 1e-3, np.float64(0.001), "1e-3"], 0.002: [0.002]},
        "lifetime.noise": {0.0: [0, 0.0], 1.0: [1.0, 1]},
    }
    genomes = np.random.default_rng(chance.randrange(1000)).uniform(-1, 1, (3, 234)).round(3)
    given["genome"] = {number: [genes, genes.copy(), list(genes)] for number, genes in enumerate(genomes)}
    over, different = {}, {}
    for key in chance.sample(list(given), chance.choice([1, 2])):
        values = [chance.choice(list(given[key])) for _ in range(chance.choice([2, 3]))]
        over[key] = [chance.choice(given[key][value]) for value in values]
        different[key] = len(set(values))
    with bounded(over):
        try:
            table = epuckhebb.sweep(over=over, lifetime={"duration_s": 0.064}, repeats=1, threads=1, progress=False)
        except ValueError as error:
            if not any(key in str(error) for key in over):
                raise
        else:
            checked(table, different)


@pytest.mark.parametrize("chance", range(8), indirect=True)
def test_what_a_user_puts_among_the_jobs_of_a_sweep_stays(chance):
    """In whole jobs, damaged ones, and beside them: the sweep goes on to the same tables. Attempts are removed."""
    words = ["sweep", "obstacles", "scenario=base,4obstacles", *SHORT, BASIC, "seed=1,2", "hydra.sweep.dir=out"]
    assert type_in(*words).exit_code == 0
    tables = {name: Path("out", name).read_bytes() for name in ("sweep.csv", "summary.csv", "failed.csv")}
    jobs = sorted(Path("out").glob("job_*"))
    attempts = [Path("out/unfinished", f"20260101-000000-0123abcd_{number}") for number in range(3)]
    for attempt in attempts:
        shutil.copytree(jobs[0], attempt)
    own = {}
    names = ["notes.txt", "figures/mine.png", "deep/er/x.csv", ".hidden", "metrics.csv.bak", "~"]
    for _ in range(6):
        file = Path(chance.choice(["out", *jobs]), chance.choice(names))
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(content := chance.randbytes(20))
        own[file] = content
    for job in chance.sample(jobs, 2):
        file = job / chance.choice(["metrics.csv", "status.json"])
        if chance.random() < 0.3:
            file.unlink()
        else:
            file.write_bytes(file.read_bytes()[: chance.randrange(40)])
    if chance.random() < 0.3:
        shutil.rmtree(jobs[0])
        own = {file: content for file, content in own.items() if jobs[0] not in file.parents}
        jobs[0].write_text("a file in the way")
        own[jobs[0]] = b"a file in the way"
    result = type_in(*words)
    assert result.exit_code == 0, result.output
    assert {name: Path("out", name).read_bytes() for name in tables} == tables
    there = [file.read_bytes() for file in Path("out").rglob("*") if file.is_file()]
    for file, content in own.items():
        assert content in there, f"{file} has gone"
        assert file.exists() or f"{Path('out/set_aside')}" in result.output, f"nothing tells where {file} is"
    assert [job.name for job in sorted(Path("out").glob("job_*"))] == [job.name for job in jobs]
    assert "0 to do" in type_in(*words).stderr
