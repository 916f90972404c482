"""Draws mistakes for `nox -s mistakes`, of all that Cosmic Ray can make in the package, and lists what no test noticed.

python tests/mistakes draw SESSION SEED COUNT
python tests/mistakes report SESSION
"""

import random
import sys
from itertools import groupby

from cosmic_ray.work_db import WorkDB, use_db
from cosmic_ray.work_item import TestOutcome, WorkItem


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
    command, session, *numbers = sys.argv[1:]
    if command == "draw":
        draw(session, *map(int, numbers))
    else:
        sys.exit(min(1, report(session)))
