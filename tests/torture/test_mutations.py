"""Random damage to the files of runs that ended: no traceback, and no other number shown without a word.

In each call of a verb on a damaged run, either the exit code is 2 (or 1) and one message says what was noticed, or the
verb shows what the undamaged run shows.
"""

import json
from pathlib import Path

import numpy as np
import pytest
from cases import call, done

from epuckhebb.controller.compiling.kernel import kernel
from epuckhebb.runtime.errors import ConfigError, JobFailedError
from epuckhebb.store import disk
from epuckhebb.store.folder import RunFolder
from epuckhebb.store.genome import load_genome
from epuckhebb.store.run import Run
from epuckhebb.studies import identity, jobs

pytestmark = pytest.mark.torture

SHORT = ["lifetime.duration_s=2", "threads=1", "-q"]
REPOSITORY = Path(__file__).parents[2]
WHOLE = [b"", b"{}", b"[]", b"null", b"5", b'"text"', b"\0" * 64, b"\xff\xfe", b"[" * 5000, b"a: b: c", b"PK\x05\x06"]


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A folder with a run of each kind."""
    folder = tmp_path_factory.mktemp("made")
    tiny = ["ga.population=4", "ga.elites=1", "ga.loops=1", "ga.generations=2"]
    for words in (
        ["evaluate", "repeats=2", f"hydra.run.dir={folder}/evaluate"],
        ["evolve", *tiny, f"hydra.run.dir={folder}/evolve"],
        ["sweep", "light", "repeats=1", "hydra/launcher=basic", "scenario=base", f"hydra.sweep.dir={folder}/sweep"],
    ):
        done(*words, *SHORT)
    config = (folder / "evaluate" / disk.CONFIG).read_text()
    with RunFolder.new(folder / "reproduce", "reproduce", config, [], {}) as run:
        run.write("claims.csv", (REPOSITORY / "runs" / "reference" / "claims.csv").read_bytes())
    with RunFolder.new(folder / "rescue", "sweep", config, [], {}) as run:
        for file in (REPOSITORY / "runs" / "reference" / "adaptive").glob("rescue_over_all.csv"):
            run.write(file.name, file.read_bytes())
        run.write("summary.csv", (folder / "sweep" / "summary.csv").read_bytes())
    return folder


def damaged(chance, content):
    """The content with random damage; None if the file is to be lost."""
    change = chance.randrange(7)
    if change == 0:
        return None if chance.random() < 0.3 else chance.choice(WHOLE)
    if change == 1:
        return content[: chance.randrange(len(content))]
    if change in (2, 3):
        flipped = bytearray(content)
        for _ in range(chance.choice([1, 1, 1, 8])):
            flipped[chance.randrange(len(flipped))] ^= 1 << chance.randrange(8)
        return bytes(flipped)
    if change == 4:
        lines = content.splitlines(keepends=True)
        number = chance.randrange(len(lines))
        return b"".join([*lines[:number], *chance.choice([[], [lines[number]] * 2]), *lines[number + 1 :]])
    if change == 5:
        digits = [place for place, byte in enumerate(content) if chr(byte).isdigit()]
        place = chance.choice(digits or [0])
        return content[:place] + str(chance.randrange(10)).encode() + content[place + 1 :]
    return chance.randbytes(len(content))


def torture(chance, run, name, times, commands, tmp_path):
    """Damage a file of a run time and again, and let the verbs in turn read it.

    verbs: functions that are given the folder, and return an exit code and what is shown.
    """
    file, counts = run / name, {"noticed": 0, "as before": 0}
    whole = file.read_bytes()
    before = [command(run) for command in commands]
    for number in range(times):
        content = damaged(chance, whole)
        try:
            if content is None:
                file.unlink()
            else:
                file.write_bytes(content)
            place = number % len(commands)
            kept = tmp_path / f"{run.name}_{number}_{file.name}"
            try:
                code, shown = commands[place](run)
                assert code in (0, 1, 2)
                if code != 0:
                    counts["noticed"] += 1
                elif shown == before[place][1]:
                    counts["as before"] += 1
                elif content is None and ("Lost " in shown or name not in shown):
                    counts["noticed"] += 1  # it is among the lost files
                else:
                    pytest.fail("another number was shown without a word")
            except BaseException:
                kept.write_bytes(content or b"")  # for a look
                raise
        finally:
            file.write_bytes(whole)
    return counts


def command(*words):
    """A function that calls a verb on a folder."""

    def run(folder):
        result = call(*(word.format(folder) for word in words))
        if result.exception is not None and not isinstance(result.exception, SystemExit):
            raise result.exception
        if result.exit_code:
            assert result.stderr.startswith("Error: "), result.output
            assert "Traceback" not in result.output
        if "--json" in words and result.exit_code == 0:
            json.loads(result.stdout, parse_constant=lambda name: pytest.fail(f"{name} is not JSON"))
        return result.exit_code, result.stdout

    return run


def loaded(folder):
    """What a champion's file holds."""
    try:
        genome = load_genome(str(folder), "obstacles")
    except ConfigError as error:
        return 2, str(error)
    nominal = genome.nominal
    assert np.isfinite(genome.genes).all()
    assert nominal is None or np.isfinite(nominal.fitness).all()
    return 0, (genome.sha256, genome.nominal_sha256, genome.network, genome.plan, genome.robot, genome.lights)


def job_read(folder):
    """What a job of a sweep reads."""
    try:
        told = Run(folder).json("sweep.json")
        job = jobs.read_job(folder, min(told["jobs"]), identity.Identities().of)
    except (ConfigError, JobFailedError) as error:
        return 2, str(error)
    return 0, (told, job["config"])


SHOW, SHOW_JSON = command("show", "{}"), command("show", "{}", "--json")
REPLAY = command("replay", "{}", "-o", "page.html")
RESUME = command("evolve", "resume={}", "ga.generations=2", "-q")
CASES = [  # kind of run, file, how often, what reads it
    ("evaluate", "metrics.csv", 110, [SHOW, SHOW_JSON]),
    ("evaluate", "provenance.json", 110, [SHOW, SHOW_JSON]),
    ("evaluate", ".hydra/config.yaml", 50, [SHOW, REPLAY]),
    ("evaluate", ".hydra/overrides.yaml", 10, [SHOW]),
    ("evaluate", "traces.npz", 80, [REPLAY]),
    ("evolve", "history.csv", 80, [SHOW, SHOW_JSON]),
    ("evolve", "champion.npz", 160, [loaded]),
    ("evolve", "checkpoint.npz", 60, [RESUME]),
    ("sweep", "summary.csv", 80, [SHOW]),
    ("sweep", "sweep.json", 80, [job_read]),
    ("sweep", "jobs/*.json", 40, [job_read]),
    ("rescue", "rescue_over_all.csv", 60, [SHOW]),
    ("reproduce", "claims.csv", 80, [SHOW]),
]


@pytest.mark.parametrize(("kind", "name", "times", "commands"), CASES, ids=[f"{case[0]}-{case[1]}" for case in CASES])
def test_damage_is_noticed_or_does_no_harm(made, chance, kind, name, times, commands, here):
    run = made / kind
    file = min(run.glob(name))
    counts = torture(chance, run, file.relative_to(run).as_posix(), times, commands, here)
    print(kind, name, counts)
    assert counts["noticed"] or name == ".hydra/overrides.yaml"


def double(x):
    return 2.0 * x


def test_damaged_machine_code_is_never_run(chance, tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    assert kernel(double)(4.0) == 8.0
    for _ in range(60):
        file = chance.choice(sorted(tmp_path.rglob("*.nb?")))
        whole = file.read_bytes()
        content = damaged(chance, whole)
        file.unlink() if content is None else file.write_bytes(content)
        made = kernel(double)
        assert made(4.0) == 8.0
        assert content == whole or not sum(made.stats.cache_hits.values())
