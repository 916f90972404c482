"""`epuckhebb keys`: every key and its default, as the commented files of `conf/` have them."""

from collections.abc import Iterator
from pathlib import Path

from epuckhebb.runtime import ConfigError, conf, data_folder, did_you_mean

COMMANDS = ("evaluate", "evolve", "evaluate_environment", "evolve_environment", "reproduce", "leaderboard", "flock")


def key_files() -> dict[str, list[Path]]:
    """The files with the keys of each command and each group."""
    files = {command: [conf.command_file(command)] for command in COMMANDS}
    for group in (group for command in COMMANDS for group in conf.groups(command) if group != "experiment"):
        own = files.setdefault(group, [])
        own += [file for file in conf.files(group) if file not in own]
    return files


def keys_text(name: str | None) -> str:
    """The files of a command or a group, which say what each key is; without a name, those of the commands."""
    files = key_files()
    if name is None:
        groups = ", ".join(group for group in files if group not in COMMANDS)
        return "\n".join([*_texts([files[command][0] for command in COMMANDS]), f"# epuckhebb keys GROUP: {groups}"])
    group = name.partition(".")[0]
    if group not in files:
        raise ConfigError(f"keys {name}: the group must be one of {', '.join(files)}{did_you_mean(group, files)}")
    return "\n".join(_texts(files[group]))


def _texts(files: list[Path]) -> Iterator[str]:
    """The content of files, each below its name."""
    for file in files:
        name = file.relative_to(data_folder("conf")).as_posix()
        yield f"# conf/{name}\n{file.read_text(encoding='utf-8')}"
