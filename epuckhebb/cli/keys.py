"""`epuckhebb keys`: every group of settings, its choices and its keys.

What they mean stands beside them, in the comments of the files of `conf/`; of what kind they are, the schema says.
There is no other list of keys: `docs/keys.md` is made of this one.
"""

from collections.abc import Iterator, Sequence

from rich.console import Console
from rich.text import Text

from epuckhebb.cli.console import print_table
from epuckhebb.config import Group, Key


def print_groups(wanted: Sequence[Group], console: Console) -> None:
    """Print groups: their choices, then their keys."""
    for group in wanted:
        console.print(Text(title(group), style="bold"))
        if group.choices:
            print_table(console, "", ("choice", "what it is"), group.choices.items(), text=2)
        for before, keys in sections(group):
            rows = ((key.name, key.default, key.description) for key in keys)
            print_table(console, before, ("key", "default", "what it is"), rows, text=3)


def title(group: Group) -> str:
    """The heading of a group."""
    return f"Group {group.name}" if group.of else f"Keys of epuckhebb {group.name}"


def sections(group: Group) -> Iterator[tuple[str, list[Key]]]:
    """The keys of a group with what is to be said before: those of its usual choice, and those of others only."""
    if group.keys:
        yield f"Defaults are those of {group.name}={group.of}." if group.of else "", group.keys
    for choice, keys in group.more.items():
        yield f"Only with {group.name}={choice}:", keys
