"""The check of a setting: a number out of its range raises a ValueError that names key, range and value."""

import math


def check_range(
    owner: object, group: str, *names: str, least: float = 0.0, most: float = math.inf, above: bool = False
) -> None:
    """Check that settings of a group of keys are finite numbers from `least` to `most`; above: more than `least`."""
    bound = f"be more than {least:g}" if above else f"be {least:g} or more"
    if math.isfinite(most):
        bound = f"{bound} and at most {most:g}" if above else f"lie in [{least:g}, {most:g}]"
    for name in names:
        value = getattr(owner, name)
        if not (math.isfinite(value) and least <= value <= most and not (above and value == least)):
            raise ValueError(f"{group}.{name} must {bound}, got {value}")
