"""What Hydra and OmegaConf say is wrong, in the words of our own messages."""

import difflib
import re
from collections.abc import Iterator, Sequence
from typing import Any

from omegaconf import OmegaConf

from epuckhebb.app.config import SCHEMAS, near_keys
from epuckhebb.app.data import groups

_EXTRAS = {"submitit": "slurm", "ray": "ray"}  # what is missing of Hydra's -> the extra of this package that has it
_MANY, _SOME = 30, 4  # choices that are no longer listed in a message, and how many of them are
_KINDS = {"Float": "a number", "Integer": "a whole number", "Boolean": "true or false"}  # OmegaConf's words, and ours


def explain(error: BaseException) -> str:
    """Hydra's message, made fit for a reader: causes included, advice that does not apply left out, near keys named."""
    lines: list[str] = []
    causes: list[BaseException] = [error]
    # Under a debugger, OmegaConf gives an error itself as its cause.
    while (cause := causes[-1].__cause__) is not None and cause not in causes:
        causes.append(cause)
    for current in causes:
        for line in str(current).splitlines():
            kept = line.strip()
            if kept and kept not in lines and not kept.startswith(("object_type=", "reference_type=", "full_key:")):
                lines.append(kept)
    full_key = re.search(r"full_key: (\S+)", str(error))
    if full_key and not any(full_key[1] in line for line in lines):
        lines.insert(0, f"{full_key[1]}:")
    lines = [
        line
        for line in lines
        if not line.startswith(("Config search path", "To append to your ")) and "provider=" not in line
    ]
    text = re.sub(r"Did you mean: '(.+?)'\?", r"Did you mean: \1?", "\n".join(lines))
    missing = re.search(r"Could not (?:find|load) 'hydra/launcher/(submitit|ray)(?:_\w+)?'", text)
    if missing:
        text += f'\nThis launcher is a plug-in: pip install "epuckhebb[{_EXTRAS[missing[1]]}]"'
    if "LexerNoViableAlt" in text:
        text = text.replace("LexerNoViableAltException: ", "cannot be read: ")
        text += """\nSigns such as ~ need quotes within quotes, for example "genome='~/champion.npz'\""""
    elif "mismatched input" in text or "missing EQUAL" in text:
        text += "\nSettings are written KEY=VALUE, for example scenario=4obstacles or hebbian.N=0.002"
    choice = re.search(r"Could not (?:find|load) '(\w+)/(\w+)'", text)
    if choice and "Available options" in text:
        text, _, options = text.partition(f"Available options in '{choice[1]}':\n")
        text = _no_choice(choice[1], choice[2], options.split())
    wrong = re.search(r"Could not override '([^']+)'", text)
    if wrong and "." in wrong[1]:
        text = re.sub(r"\nDid you mean: \w+\?", "", text)  # Hydra means the group alone
    if wrong and "Did you mean" not in text:
        owners = [verb for verb in SCHEMAS if wrong[1] in _known_keys(verb)]
        near = _near(wrong[1])
        if owners:
            text += f"\n{wrong[1]} is a key of `epuckhebb {'` and `epuckhebb '.join(owners)}`; give it there"
            text += f": epuckhebb evaluate genome=latest {wrong[1]}=..." if owners == ["evaluate"] else ""
        else:
            text += near
    return _plainly(_of_a_file(text))


def _asked(near: str) -> str:
    """A line that asks whether these names were meant; nothing if there are none."""
    return f"\nDid you mean: {near}?" if near else ""


def _alike(name: str, choices: Sequence[str]) -> str:
    """A line that asks for the choices that are like one that is not there."""
    return _asked(", ".join(difflib.get_close_matches(name, choices, n=3)))


def _near(key: str) -> str:
    """A line that asks for the keys that are like one that is not known; of a misspelt group, for its keys."""
    known = sorted({key for verb in ("evaluate", "evolve") for key in _known_keys(verb)})
    group, _, rest = key.partition(".")
    alike = difflib.get_close_matches(group, groups("evolve"), n=1)
    if rest and alike and alike[0] != group:
        key = f"{alike[0]}.{rest}"
        if key in known or not any(other.startswith(f"{alike[0]}.") for other in known):  # or it may have any
            return _asked(key)
    return _asked(near_keys(key, known))


def _no_choice(group: str, name: str, options: Sequence[str]) -> str:
    """What to say of a choice of a group that is not there."""
    text = f"there is no {group}={name}{_alike(name, options)}"
    text += (
        f"\n`epuckhebb keys {group}` lists all {len(options)} of them, for example {', '.join(options[:_SOME])}"
        if len(options) > _MANY
        else f"\n{group} must be one of {', '.join(options)}"
    )
    return f"{text}\nIs it a file of yours, {group}/{name}.yaml? Then add --config-dir and the folder of {group}/"


def _of_a_file(text: str) -> str:
    """What Hydra says of a file of the user's own, with the name of the file and what should stand there."""
    within = re.search(r"In '(\w+)/([^']+)': (?:\w+ raised while composing config:\n)?", text)
    if not within or within[1] not in {*groups("evaluate"), *groups("evolve"), "experiment"}:
        return text  # a file of Hydra's own
    group, name = within[1], within[2]
    file = f"{group}/{name}.yaml"
    load = re.search(r"Could not load '(\w+)/([^']+)'", text)
    if load:
        choices = groups("evolve").get(load[1], groups("evaluate").get(load[1], []))
        return f"{file}: there is no {load[1]}={load[2]}, which its defaults name{_alike(load[2], choices)}"
    key = re.search(r"Key '([^']+)' not in '\w+'", text)
    if key and key[1] == group == "experiment":
        return f"{file} must begin with the line `# @package _global_`: its keys are those of the whole configuration"
    if key and key[1] == group:
        return f"{file}: leave out the line `{group}:`, and begin the keys below it at the left edge"
    if key:
        full = text.partition(":")[0]
        return f"{file}: there is no key {full}{_near(full)}"
    value = re.search(r"^(\S+):\n.*\nValue '(.*)' of type '\w+' could not be converted to (\w+)", text)
    if value and value[3] in _KINDS:
        return f"{file}: {value[1]} must be {_KINDS[value[3]]}, got {value[2]}"
    return text


def _plainly(text: str) -> str:
    """What OmegaConf says of a value or a key, in the words of our own messages."""
    text = re.sub(r"Could not override '(\S+)'\.\nKey '\S+' not in '\w+'", r"there is no key \1", text)
    text = re.sub(r"Error merging override \S+\nfield '(\S+)' is not Optional", r"\1 must have a value, got null", text)
    several = re.search(r"Ambiguous value for argument '([^'=]+)=([^']*)'[\s\S]*", text)
    if several:
        told = f"{several[1]}={several[2]} has several values; to do a run with each of them, add -m (--multirun)"
        if re.fullmatch(r"\d+,\d+", several[2]):
            told += f". A number is written {several[2].replace(',', '.')}"
        text = text.replace(several[0], told)
    kind = re.search(r"Error merging override ([^=\s]+)=(.*)\nValue .* could not be converted to (\w+)", text)
    if kind and kind[3] in _KINDS:
        text = text.replace(kind[0], f"{kind[1]} must be {_KINDS[kind[3]]}, got {kind[2]}")
    return text


def _known_keys(verb: str) -> list[str]:
    """All keys and groups of a verb, as they are written in an override."""

    def below(node: Any, prefix: str) -> Iterator[str]:
        for key, value in node.items():
            yield prefix + key
            if isinstance(value, dict):
                yield from below(value, f"{prefix}{key}.")

    schema = OmegaConf.to_container(OmegaConf.structured(SCHEMAS[verb]))
    return sorted({*below(schema, ""), *groups(verb)})
