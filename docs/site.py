"""What turns the pages, which are made to be read in the repository, into a site; see `mkdocs.yml`.

The reports of `runs/reference/` and all pictures come along. Links to other files outside of this folder lead to the
repository if its address is known (`EPUCKHEBB_REPOSITORY`), and else become the path of the file. Docstrings make the
reference of the Python interface, `conf/` the page of keys, and `epuckhebb/store/columns.yaml` the tables of files.
"""

import re
from fnmatch import fnmatch
from os.path import relpath
from pathlib import Path
from typing import Any

import yaml
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

import epuckhebb
from epuckhebb.cli.keys import key_files, keys_text

ROOT, PAGES = Path(__file__).parents[1], Path(__file__).parent
REFERENCE = ROOT / "runs" / "reference"
REPORTS = [REFERENCE / "README.md", *sorted(REFERENCE.rglob("report.md"))]
LINK = re.compile(r"(?P<text>\[[^]]*\])\((?P<target>[^)#\s]+)(?P<place>#[^)]*)?\)")
PICTURE = re.compile(r"!\[[^]]*\]\(([^)#]+)[^)]*\)")
IMG = re.compile(r'<img src="([^"]+)" alt="([^"]*)">')
NAMES = sorted(epuckhebb.__all__, key=lambda name: (not name.islower(), name))  # functions first
API = """# Python reference

::: epuckhebb.api
    options: {members: false, show_root_heading: false, show_root_toc_entry: false}
""" + "".join(
    f"\n::: {thing.__module__}.{thing.__qualname__}\n    options: {{heading: {name}, toc_label: {name}}}\n"
    for name, thing in ((name, getattr(epuckhebb, name)) for name in NAMES)
)


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the reference of the Python interface, the reports, and pictures from outside."""
    files.append(File.generated(config, "api.md", content=API))
    pictures = {
        (page.parent / picture).resolve()
        for page in [*PAGES.glob("*.md"), *REPORTS]
        for picture in PICTURE.findall(IMG.sub(r"![\2](\1)", page.read_text(encoding="utf-8")))
    }
    for path in [*REPORTS, *sorted(path for path in pictures if not path.is_relative_to(PAGES))]:
        files.append(File.generated(config, place_of(path), abs_src_path=str(path)))
    return files


def place_of(path: Path) -> str:
    """Where a file of the repository is, or would be, on the site."""
    return path.relative_to(PAGES if path.is_relative_to(PAGES) else ROOT).as_posix()


def on_page_markdown(markdown: str, page: Any, config: MkDocsConfig, files: Files) -> str:
    """Complete the pages of keys and files, and lead each link to the site, to the repository, or to no place."""
    own = page.file.src_uri
    if own == "files.md":
        markdown += columns_of_files()
    if own == "keys.md":
        markdown += "".join(f"\n## {name}\n\n```yaml\n{keys_text(name)}```\n" for name in key_files())
    is_report = own.startswith("runs/")
    if is_report or own == "index.md":  # tables of a report need the whole width
        page.meta["hide"] = ["navigation", "toc"]
    folder = (ROOT if is_report else PAGES) / Path(own).parent

    def replaced(found: re.Match[str]) -> str:
        text, place = found["text"], found["place"] or ""
        path = (folder / found["target"]).resolve()
        if "://" in found["target"] or not path.exists():
            return found[0]
        if path == ROOT / "README.md":
            path = PAGES / "index.md"
        if files.get_file_from_path(place_of(path)) is not None:
            return f"{text}({relpath(place_of(path), Path(own).parent)}{place})"
        name = place_of(path)
        if config.repo_url:
            return f"{text}({config.repo_url.rstrip('/')}/{'tree' if path.is_dir() else 'blob'}/main/{name}{place})"
        label = text[1:-1]
        return f"`{name}`" if label.strip("`").rstrip("/") == name else f"{label} (`{name}`)"

    return LINK.sub(replaced, IMG.sub(r"![\2](\1)", markdown))


def columns_of_files() -> str:
    """A section for each file, with a table of its columns, from `epuckhebb/store/columns.yaml`."""
    files = yaml.safe_load((ROOT / "epuckhebb" / "store" / "columns.yaml").read_text(encoding="utf-8"))
    everywhere, first, sections = files.pop("everywhere"), {}, []
    for name, file in files.items():
        rows = []
        for column, text in file["columns"].items():
            common = next((text for pattern, text in everywhere.items() if fnmatch(column, pattern)), None)
            meaning = text or common or first[column]
            first.setdefault(column, meaning)
            rows.append(f"| `{column}` | {meaning} |\n")
        sections.append(f"\n### {name}\n\n{file['about']}\n\n| column | what it is |\n| --- | --- |\n{''.join(rows)}")
    return "".join(sections)
