"""What turns the pages, which are made to be read in the repository, into a site; see `mkdocs.yml`.

The front page is README.md. Pictures from outside of this folder come along. Other links that leave it lead to the
repository that CITATION.cff names.
"""

import re
from pathlib import Path
from typing import Any

import yaml
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

ROOT = Path(__file__).parents[1]
REPOSITORY = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))["repository-code"]
LINK = re.compile(r"(?<=\]\()([^)#]+)((?:#[^)]*)?\))")
API = """# Python reference

::: epuckhebb
    options:
      show_root_heading: false
      show_root_toc_entry: false
      members: [evaluate, evolve, sweep, load]

::: epuckhebb.api.Evaluation

::: epuckhebb.api.Evolution

::: epuckhebb.sim.plasticity.rule.Rule

::: epuckhebb.sim.plasticity.rule.Evolved

::: epuckhebb.sim.plasticity.rules.paper.Paper

::: epuckhebb.sim.adaptation.adaptation.Adaptation

::: epuckhebb.sim.life.Lifetime

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
    """Lead links that leave the pages to the pictures that came along, or to the repository."""
    inside = Path(__file__).parent

    def led(found: re.Match[str]) -> str:
        target, rest = found.groups()
        if "://" in target:
            return found[0]
        outside = ROOT / target if page.file.src_uri == "index.md" else inside / target
        if page.file.src_uri == "index.md" and (inside / target).exists():
            return found[0]
        path = outside.resolve()
        if not path.exists() or path.is_relative_to(inside):
            return found[0]
        name = path.relative_to(ROOT).as_posix()
        return f"{name}{rest}" if path.suffix == ".png" else f"{REPOSITORY}/blob/main/{name}{rest}"

    return LINK.sub(led, markdown)
