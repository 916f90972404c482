"""Where the files that belong to the program are: `conf/` and the bundled champions. Needs nothing heavy."""

from pathlib import Path

_PACKAGE = Path(__file__).resolve().parents[1]


def data_folder(name: str) -> Path:
    """A folder that lies beside the package in a checkout and inside it when installed (`conf`, `runs/reference`)."""
    inside = _PACKAGE / name
    return inside if inside.is_dir() else _PACKAGE.parent / name


def groups(verb: str) -> dict[str, list[str]]:
    """The configuration groups of a verb and their choices, as the names of the files say."""
    conf = data_folder("conf")
    defaults = (conf / f"{'evaluate' if verb == 'sweep' else verb}.yaml").read_text()  # a sweep is of evaluations
    return {
        folder.name: sorted(file.stem for file in folder.glob("*.yaml"))
        for folder in sorted(path for path in conf.iterdir() if path.is_dir())
        if f"- {folder.name}:" in defaults
    }
