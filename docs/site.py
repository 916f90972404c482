"""What turns the pages, which are made to be read in the repository, into a site; see `mkdocs.yml`.

The front page is README.md. Pictures from outside of this folder come along. Other links that leave it become the
text of the link and the path of the file in the repository, or the line. The page of files ends with tables of all
columns, the page of keys with the files of `conf/`.
"""

import re
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

import yaml
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

from epuckhebb.cli.keys import keys_text, known

ROOT = Path(__file__).parents[1]
LINK = re.compile(r"(?P<text>\[[^]]*\])\((?P<target>[^)#]+)(?P<place>#[^)]*)?\)")
API = """# Python reference

::: epuckhebb.api
    options:
      show_root_heading: false
      show_root_toc_entry: false
      members: [evaluate, evolve, sweep, load]

::: epuckhebb.api.results.Evaluation

::: epuckhebb.api.results.Evolution

::: epuckhebb.api.results.Live

::: epuckhebb.controller.plasticity.rule.Rule

::: epuckhebb.controller.plasticity.rule.Evolved

::: epuckhebb.controller.plasticity.rules.paper.Paper

::: epuckhebb.adaptation.adaptation.Adaptation

::: epuckhebb.tmaze.life.Lifetime

::: epuckhebb.evolution.optimizers.ga.GA
"""


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the front page, the reference of the Python interface, and pictures from outside."""
    front = (ROOT / "README.md").read_text(encoding="utf-8")
    files.append(File.generated(config, "index.md", content=front.replace("](docs/", "](")))
    files.append(File.generated(config, "api.md", content=API))
    for page in Path(config.docs_dir).glob("*.md"):
        for picture in re.findall(r"!\[[^]]*\]\(\.\./([^)]+)\)", page.read_text(encoding="utf-8")):
            if files.get_file_from_path(picture) is None:
                files.append(File.generated(config, picture, abs_src_path=str(ROOT / picture)))
    return files


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Lead links that leave the pages to the pictures that came along; of other files give the path."""
    if page.file.src_uri == "files.md":
        markdown += columns_of_files()
    if page.file.src_uri == "keys.md":
        markdown += "".join(f"\n## {name}\n\n```yaml\n{keys_text(name)}```\n" for name in known())
    inside = Path(__file__).parent
    folder = ROOT if page.file.src_uri == "index.md" else inside

    def replaced(found: re.Match[str]) -> str:
        text, target = found["text"], found["target"]
        path = (folder / target).resolve()
        if "://" in target or not path.exists() or path.is_relative_to(inside):
            return found[0]
        if path == ROOT / "README.md":
            return f"{text}(index.md)"
        name = path.relative_to(ROOT).as_posix()
        if path.suffix == ".png":
            return f"{text}({name})"
        label, line = text[1:-1], (found["place"] or "").removeprefix("#L")
        if line:
            return f"{label} (line {line})"
        return label if label.strip("`").rstrip("/") == name else f"{label} (`{name}`)"

    return LINK.sub(replaced, markdown)


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
