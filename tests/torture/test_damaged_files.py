"""Random damage to every file of a run that is read: no traceback, and no other number shown without a word.

What each command on a damaged run may do:

- exit 2 (or 1) and one message: the damage was noticed;
- exit 0 and what the undamaged run shows: the damage is in nothing that was shown, or was made good;
- exit 0 and something else: only for damage to `status.json`, which holds the SHA-256 of all other files.
"""

import pytest
from cases import call, done

from epuckhebb.runtime.errors import ConfigError
from epuckhebb.store.genome import load_genome

pytestmark = pytest.mark.torture

SHORT = ["lifetime.duration_s=2", "threads=1", "-q"]
WHOLE = [b"", b"{}", b"[]", b"null", b"5", b'"text"', b"\0" * 64, b"\xff\xfe", b"[" * 5000, b"a: b: c", b"PK\x05\x06"]


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A folder with a run of each kind."""
    folder = tmp_path_factory.mktemp("made")
    tiny = ["ga.population=4", "ga.elites=1", "ga.loops=1", "ga.generations=2"]
    done("evaluate", "repeats=2", f"hydra.run.dir={folder}/evaluate", *SHORT)
    done("evolve", *tiny, f"hydra.run.dir={folder}/evolve", *SHORT)
    sweep = ["repeats=1", "hydra/launcher=basic", "scenario=base", f"hydra.sweep.dir={folder}/sweep"]
    done("sweep", "light", *sweep, *SHORT)
    return folder


def damaged(chance, content):
    """The content with random damage; None if the file is to be lost."""
    place = chance.randrange(len(content))
    kind = chance.choice(["lost", "other", "cut", "flipped", "flipped", "digit", "line"])
    if kind in ("lost", "other"):
        return None if kind == "lost" else chance.choice(WHOLE)
    if kind == "cut":
        return content[:place]
    if kind == "line":
        lines = content.splitlines(keepends=True)
        number = chance.randrange(len(lines))
        return b"".join([*lines[:number], *chance.choice([[], [lines[number]] * 2]), *lines[number + 1 :]])
    if kind == "digit":
        place = chance.choice([at for at, byte in enumerate(content) if chr(byte).isdigit()] or [0])
        return content[:place] + str(chance.randrange(10)).encode() + content[place + 1 :]
    flipped = bytearray(content)
    for _ in range(chance.choice([1, 1, 1, 8])):
        flipped[chance.randrange(len(flipped))] ^= 1 << chance.randrange(8)
    return bytes(flipped)


def command(*words):
    """A function that calls a command on a folder; returns its exit code and what it shows."""

    def run(folder):
        result = call(*(word.format(folder) for word in words))
        assert isinstance(result.exception, SystemExit | None), result.exc_info
        if result.exit_code:
            assert result.stderr.count("Error: ") == 1, result.output
            assert "Traceback" not in result.output
        return result.exit_code, result.stdout

    return run


def champion(folder):
    """What the file of a champion holds."""
    try:
        genome = load_genome(str(folder), "obstacles")
    except ConfigError as error:
        return 2, str(error)
    return 0, (genome.sha256, genome.nominal_sha256, genome.network, genome.plan, genome.robot)


SHOW, SHOW_JSON = command("show", "{}"), command("show", "{}", "--json")
REPLAY = command("replay", "{}", "-o", "page.html")
CASES = [  # kind of run, file, how often, what reads it
    ("evaluate", "metrics.csv", 200, [SHOW, SHOW_JSON]),
    ("evaluate", "provenance.json", 200, [SHOW, SHOW_JSON]),
    ("evaluate", "status.json", 300, [SHOW, SHOW_JSON]),
    ("evaluate", ".hydra/config.yaml", 200, [SHOW, REPLAY]),
    ("evaluate", "traces.npz", 200, [REPLAY]),
    ("evolve", "history.csv", 200, [SHOW, SHOW_JSON]),
    ("evolve", "champion.npz", 300, [champion]),
    ("evolve", "checkpoint.npz", 200, [command("evolve", "resume={}", "ga.generations=2", "-q")]),
    ("sweep", "summary.csv", 200, [SHOW]),
]


@pytest.mark.parametrize(("kind", "name", "times", "commands"), CASES, ids=[f"{case[0]}-{case[1]}" for case in CASES])
@pytest.mark.usefixtures("here")
def test_damage_is_noticed_or_does_no_harm(made, chance, kind, name, times, commands):
    run = made / kind
    file, noticed = run / name, 0
    whole, before = file.read_bytes(), [command(run) for command in commands]
    for number in range(times):
        content = damaged(chance, whole)
        if content is None:
            file.unlink()
        else:
            file.write_bytes(content)
        code, shown = commands[number % len(commands)](run)
        file.write_bytes(whole)
        assert code in (0, 1, 2), (number, content)
        noticed += code != 0
        as_before = code != 0 or shown == before[number % len(commands)][1]
        assert as_before or content is None or name == "status.json", ("another number was shown", number, content)
    assert noticed
