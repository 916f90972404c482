"""Self-checks before a lifetime: their findings as rows of `findings.csv`, and in words."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence

from epuckhebb.adaptation.self_check.check import Checked, check, unexplained
from epuckhebb.adaptation.self_check.memory import SelfMemory
from epuckhebb.controller import random
from epuckhebb.controller.random import Stream
from epuckhebb.tmaze.maze import SIDES, Side
from epuckhebb.tmaze.scenario import Scenario

_LISTED = "; "  # between the items of a cell

Checks = Mapping[tuple[bool, Side, int], Checked]


def self_checks(
    memory: SelfMemory, scenario: Scenario, noise: float, *, repeats: int, seed: int, careful: Iterable[bool] = (False,)
) -> Checks:
    """The self-checks of an evaluation, by whether they are careful, side and repeat; controllers share them.

    noise: a factor on the noise of the sensors. careful: which of the two kinds are wanted.

    Raises:
        ValueError: the robot has no self-check, or the memory is of another robot.
    """
    return {
        (kind, side, repeat): check(
            memory,
            scenario,
            side,
            random.key(seed, Stream.evaluation_noise, repeat, SIDES.index(side)),
            noise,
            careful=kind,
        )
        for kind in sorted(careful)
        for side in SIDES
        for repeat in range(repeats)
    }


def findings(checks: Checks) -> list[dict[str, object]]:
    """A row for each self-check."""
    return [
        {"side": side, "repeat": repeat, **_row(checked), "careful": int(careful)}
        for (careful, side, repeat), checked in checks.items()
    ]


def _row(checked: Checked) -> dict[str, object]:
    found = checked.found
    return {
        "lamp": "on" if found.lamp else "off",
        "dead_sensors": _LISTED.join(map(str, found.dead_sensors)),
        "left_wheel_loss": found.wheel_loss[0],
        "left_wheel_loss_error": found.wheel_loss_error[0],
        "right_wheel_loss": found.wheel_loss[1],
        "right_wheel_loss_error": found.wheel_loss_error[1],
        "light_ratio": found.light_ratio,
        "light_ratio_error": found.light_ratio_error,
        "distance_misfit": found.distance_misfit,
        "light_misfit": found.light_misfit,
        "unexplained": _LISTED.join(unexplained(found)),
        "corrected": _LISTED.join(checked.corrected),
        "turned_back": int(checked.turned_back),
    }


def text(row: Mapping[str, object]) -> str:
    """A row of findings in words: what is corrected, and what is unexplained."""
    corrected = str(row["corrected"]).split(_LISTED) if row["corrected"] else []
    parts = []
    for wheel in ("left", "right"):
        if f"{wheel} wheel" in corrected:
            loss = float(str(row[f"{wheel}_wheel_loss"]))
            parts.append(f"{wheel} wheel {100 * abs(loss):.0f} % {'slow' if loss > 0 else 'fast'}")
    if "light" in corrected:
        parts.append(f"light {float(str(row['light_ratio'])):.2g} times that in training")
    dead = str(row["dead_sensors"]).split(_LISTED) if row["dead_sensors"] != "" else []
    if dead:
        parts.append(f"sensor{'s' if len(dead) > 1 else ''} {' and '.join(dead)} dead")
    if row["unexplained"]:
        parts.append(f"{str(row['unexplained']).replace(_LISTED, ' and ')} readings unexplained")
    if row.get("turned_back"):
        parts.append("the manoeuvre left it turned")
    return ", ".join(parts) or "no change"


def in_words(rows: Iterable[Mapping[str, object]]) -> dict[str, Sequence[tuple[str, int]]]:
    """The findings on each side, and how often each occurred, the most frequent first."""
    words: dict[str, Counter[str]] = {}
    for row in rows:
        words.setdefault(str(row["side"]), Counter())[text(row)] += 1
    return {side: counted.most_common() for side, counted in words.items()}
