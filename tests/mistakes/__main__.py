"""Draws mistakes for `nox -s mistakes`, of all that Cosmic Ray can make in the package, and lists what no test noticed.

python tests/mistakes draw SESSION SEED COUNT
python tests/mistakes test
python tests/mistakes report SESSION
"""

import random
import re
import subprocess
import sys
from itertools import groupby
from pathlib import Path

from cosmic_ray.work_db import WorkDB, use_db
from cosmic_ray.work_item import TestOutcome, WorkItem

_NEAR = 6  # files


def place(item: WorkItem) -> tuple[str, tuple[int, int], str]:
    """Where a mistake is, and its family: an operator has ten others in its place, a name has one."""
    (mutation,) = item.mutations
    family = mutation.operator_name.rpartition("/")[2].partition("_")[0]
    return str(mutation.module_path), mutation.start_pos, family


def draw(session: str, seed: int, count: int) -> None:
    """Leave a drawing of mistakes in a session, at different places, each place as likely as another."""
    with use_db(session, WorkDB.Mode.open) as db:
        items = sorted(db.work_items, key=lambda item: (place(item), item.mutations[0].operator_name))
        places = [list(same) for _, same in groupby(items, place)]
        rng = random.Random(seed)
        drawn = [rng.choice(same) for same in rng.sample(places, count)]
        db.clear()
        db.add_work_items(drawn)


def test() -> int:
    """Run the suite of a copy until a test fails; first the files that are about what was changed. Returns exit code.

    Most mistakes are noticed there, in seconds; one that no test notices takes as long as the suite.
    """
    changed = subprocess.run(["git", "diff"], capture_output=True, text=True, check=True).stdout
    names = re.findall(r"^\+\+\+ .*?(\w+)\.py$|^@@ .* @@ (?:def|class) (\w+)", changed, re.MULTILINE)
    about = re.compile(rf"\b({'|'.join(filter(None, sum(names, ())))})\b")  # the module, and the function or class

    def count(text: str) -> int:
        return len(about.findall(text))

    def nearness(file: Path) -> tuple[int, int, int]:
        text = file.read_text()
        imports = [line for line in text.splitlines() if line.startswith(("from", "import"))]
        return count(file.stem.replace("_", " ")), count(" ".join(imports)), count(text)

    files = sorted(Path("tests").glob("test_*.py"), key=nearness, reverse=True)
    near = [Path("tests/test_digest.py"), *(file for file in files[:_NEAR] if any(nearness(file)))]
    others = [f"--ignore={file}" for file in near]
    run = [sys.executable, "-m", "pytest", "-x", "-q", "-n", "2", "--dist", "loadfile"]
    return (
        subprocess.run([*run, *near], check=False).returncode or subprocess.run([*run, *others], check=False).returncode
    )


def report(session: str) -> int:
    """Print how many mistakes the tests noticed, and each that they did not; returns how many these are."""
    with use_db(session, WorkDB.Mode.open) as db:
        tried = [result for _, result in db.results]
    unnoticed = [result for result in tried if result.test_outcome is TestOutcome.SURVIVED]
    for result in unnoticed:
        print(result.diff)
    print(f"{len(tried) - len(unnoticed)} of {len(tried)} mistakes were noticed")
    return len(unnoticed)


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["draw", session, seed, count]:
            draw(session, int(seed), int(count))
        case ["test"]:
            sys.exit(test())
        case ["report", session]:
            sys.exit(min(1, report(session)))
