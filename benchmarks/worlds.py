"""Which environments of which packages evolve and evaluate here, and whether a change of each acts.

`python worlds.py PACKAGE [ID ...]` tries ids of a package of worlds.toml, all unless some are named, and writes their
rows of worlds.csv. `nox -s worlds` calls it for each package, at its newest version in an environment of its own.
`python worlds.py PACKAGE none` writes that the package could not be installed.
"""

import csv
import json
import re
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Iterator
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
PACKAGES = tomllib.loads((HERE / "worlds.toml").read_text(encoding="utf-8"))
TABLE = HERE / "worlds.csv"
COLUMNS = ["package", "versions", "id", "observations", "actions", "loop", "evolves", "evaluates"]
COLUMNS += ["change", "acts", "repeats", "notes", "why"]
YES, NO = "yes", "no"
HORIZON, CHANGED = 40, 40  # steps in training, and the step of the change; `evaluate` doubles the horizon
LIMIT_S = 600  # for one id
STAGES, MARK = ("loop", "evolves", "evaluates"), "row: "
SMALL = ["generations=1", "population=4", "starts=4", "confirm=1"]


def written(value: Any) -> str:
    """A value as the command line takes it."""
    match value:
        case dict():
            return "{" + ", ".join(f"{key}: {written(one)}" for key, one in value.items()) + "}"
        case list():
            return "[" + ", ".join(map(written, value)) + "]"
        case str():
            return f"'{value}'"
    return json.dumps(value)


def seen(words: list[str]) -> dict[str, str]:
    """The spaces of an environment, and whether a lifetime is that of a plain loop with Gymnasium's own functions."""
    import numpy as np
    from gymnasium.spaces import Dict, flatten

    from epuckhebb.config import load_any

    world = load_any("evolve", words).world
    outputs = np.random.default_rng(1).uniform(-1.0, 1.0, (HORIZON, world.outputs))
    got: list[Any] = []

    def act(step: int, readings: Any, _reward: float, _observation: Any) -> Any:
        got.append(readings.copy())
        return outputs[step]

    lived = world.episode(world.make(), act, 3, HORIZON)
    env = world.make()
    observation, _ = env.reset(seed=3)
    space, texts = env.observation_space, set[str]()
    if isinstance(space, Dict):
        texts = {key for key, part in space.items() if getattr(part.dtype, "kind", "") == "U"}
        space = Dict({key: part for key, part in space.items() if key not in texts})
    is_same, rewards = True, list[float]()
    for readings, output in zip(got, outputs, strict=False):
        if texts:
            observation = {key: value for key, value in observation.items() if key not in texts}
        flat = np.asarray(flatten(space, observation), float)
        expected = np.where(world.read.is_measured, np.tanh(flat / world.read.scale), flat)
        action = world.turn(output)
        is_same &= bool(np.allclose(expected, readings, rtol=1e-6, atol=1e-9) and env.action_space.contains(action))
        observation, reward, *_ = env.step(action)
        weights = world.settings.reward_weights
        rewards.append(float(reward if weights is None else np.dot(weights, reward)))
    is_same &= rewards == lived.tolist()
    spaces = {"observations": env.observation_space, "actions": env.action_space}
    told = {key: f"{type(space).__name__}{shape(space)}" for key, space in spaces.items()}
    return {**told, "loop": YES if is_same else "no: another lifetime"}


def shape(space: Any) -> str:
    """The size of a space, as short as it goes."""
    match type(space).__name__:
        case "Discrete":
            return f" {space.n}"
        case "Box" | "MultiBinary":
            return f" {' x '.join(map(str, space.shape))}"
        case "MultiDiscrete":
            return f" {' + '.join(map(str, space.nvec.ravel()))}"
        case "Dict":
            return f" of {', '.join(space)}"
        case "Tuple":
            return f" of {len(space)}"
    return ""


def stages(name: str, wish: dict[str, Any]) -> Iterator[dict[str, str]]:
    """What is found out of an environment, one thing after the other. wish: as in worlds.toml."""
    words = ["environment=gym", f"environment.id={name}", f"environment.horizon={HORIZON}", "environment.hidden=[4]"]
    words += [*wish.get("words", []), "environment.processes=1"]
    yield seen(words)
    small = [f"optimizer.{each}" for each in SMALL]
    yield {"evolves": called("evolve", *words, *small, "hebbian=abcd", "hydra.run.dir=evolved")}
    changes = f"environment.changes=[{written({'at': CHANGED} | wish['change'])}]"
    usual = ["genome=evolved", "repeats=2", "figures=none", "environment.processes=1"]
    row = {"change": written(wish["change"])[1:-1]}
    row["evaluates"] = called("evaluate", *usual, changes, "hydra.run.dir=tested")
    if row["evaluates"] == YES:
        table, world = Path("tested", "table.md").read_text(encoding="utf-8"), re.escape(name.rpartition(":")[2])
        row["notes"] = " ".join(re.findall(rf"environment {world}: (.*)", table)).replace("\\", "")
        row["acts"] = NO if "changes nothing" in row["notes"] else YES
        row["acts"] = "not known" if "cannot be tested" in row["notes"] else row["acts"]
        row["repeats"] = YES if called("rerun", "tested") == YES else NO
    yield row


def called(*words: str) -> str:
    """Call the program: whether it did well, or its message."""
    from typer.testing import CliRunner

    from epuckhebb.cli.commands import app

    result = CliRunner().invoke(app, list(words))
    if result.exit_code == 0:
        return YES
    is_told = isinstance(result.exception, SystemExit)
    told = result.stderr.strip().rpartition("Error: ")[2] if is_told else f"a fault: {result.exception!r}"
    return " ".join([f"{NO}:", *told.split()])


def tried(name: str, wish: dict[str, Any], folder: Path) -> dict[str, str]:
    """A row for an environment, made by a process of its own, which may come to an end or hang."""
    row, limit = {"id": name}, f"no: more than {LIMIT_S} s"
    command = [sys.executable, "-W", "ignore", str(Path(__file__).resolve()), "stages", name, json.dumps(wish)]
    try:
        ended = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=LIMIT_S, check=False)
        told = [f"exit code {ended.returncode}", *ended.stderr.splitlines()][-1]
        lines, end, is_over = ended.stdout, f"{NO}: {told.rpartition('Error: ')[2]}", ended.returncode == 0
    except subprocess.TimeoutExpired as error:
        lines, end, is_over = (error.stdout or b"").decode(), limit, False
    for line in re.findall(rf"^{MARK}(.*)$", lines, re.MULTILINE):
        row |= json.loads(line)
    if not is_over:
        row[next(stage for stage in STAGES if stage not in row)] = end
    return row


def versions(install: list[str]) -> str:
    """The versions of what was installed, and of what it stands on."""
    found, names = [], [re.split(r"[\[<>=]", one)[0] for one in install]
    for name in dict.fromkeys([*names, "gymnasium", "mujoco"]):
        try:
            found.append(f"{name} {version(name)}")
        except PackageNotFoundError:
            continue
    return ", ".join(found)


def write(rows: list[dict[str, str]]) -> None:
    """Write rows in place of those of the same ids. All stand as in worlds.toml; what it lacks is left out."""
    kept: list[dict[str, str]] = []
    if TABLE.is_file():
        with TABLE.open(newline="", encoding="utf-8") as file:
            kept = list(csv.DictReader(file))
    found = {(row["package"], row["id"]): row for row in [*kept, *rows]}
    places = [(package, name) for package, wanted in PACKAGES.items() for name in ("", *wanted["ids"])]
    with TABLE.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, COLUMNS, restval="", lineterminator="\n")
        writer.writeheader()
        writer.writerows({**found[place], "why": why(*place)} for place in places if place in found)


def why(package: str, name: str) -> str:
    """Why something does not work, as worlds.toml has it."""
    return str((PACKAGES[package]["ids"][name] if name else PACKAGES[package]).get("why", ""))


def main(package: str, *words: str) -> None:
    if package == "stages":
        for found in stages(words[0], json.loads(words[1])):
            print(f"\n{MARK}{json.dumps(found)}", flush=True)
        return
    wanted = PACKAGES[package]
    if words == ("none",):
        write([{"package": package, "id": "", "loop": "no: it does not install"}])
        return
    for name in words or wanted["ids"]:
        with tempfile.TemporaryDirectory() as folder:
            Path(folder, "own.py").write_text(wanted.get("own", ""), encoding="utf-8")
            row = tried(name, wanted["ids"][name], Path(folder))
        print(row, flush=True)
        write([{"package": package, "versions": versions(wanted["install"]), **row}])


if __name__ == "__main__":
    main(*sys.argv[1:])
