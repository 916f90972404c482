"""The replay page of flocks: the same robots with each coupling side by side, the strongest couplings as lines."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from epuckhebb.analysis.replay import fill_page, packed
from epuckhebb.flock.plane import CHANGE_S, SAMPLE_S, Flock, Record
from epuckhebb.flock.tables import WHAT_BREAKS, coupling_title, minute_cosines
from epuckhebb.tmaze.robot import EPUCK

_EVERY = 2  # samples, of which the page has one


def page(flock: Flock, records: Mapping[str, Record], title: str) -> str:
    """The HTML text of the page. records: of each coupling by its name. title: a line that names the run."""
    flocks = {}
    for name, record in records.items():
        path = record.path[::_EVERY].copy()
        path[..., 2] = np.remainder(path[..., 2] + np.pi, 2 * np.pi) - np.pi
        flocks[coupling_title(name)] = {
            "path": packed(path),
            "weights": packed(record.weights),
            "cosine": [round(cosine, 3) for cosine in minute_cosines(flock, record)],
        }
    where, what = f"{flock.robots} robots; after {flock.at_s / 60:g} minutes", WHAT_BREAKS[flock.breaks]
    content = {
        "flocks": flocks,
        "robots": flock.robots,
        "knowers": flock.knowers,
        "broken": flock.broken,
        "at": flock.at_s,
        "samples": len(path),
        "interval": SAMPLE_S * _EVERY,
        "changes": len(record.weights),
        "every": CHANGE_S,
        "radius": EPUCK.radius_m,
        "outcome": f"{where} {what}" if flock.broken >= 0 else what.capitalize(),
    }
    return fill_page(Path(__file__).with_suffix(".html"), title, content)
