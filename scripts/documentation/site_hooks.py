"""What mkdocs does besides its own: pages that are generated, documents of the root, formulas.

Pages that say what the program says are made from the program while the site is built, so they cannot drift from it.
"""

import re
from pathlib import Path

from api_pages import api_page
from command_pages import commands_page
from flow_tables import with_tables
from language_pages import language_pages
from mathml import with_formulas
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from module_page import module_page
from notebook_pages import notebook_page

ROOT_DOCUMENTS = {
    "ARCHITECTURE.md": "project/architecture.md",
    "CONTRIBUTING.md": "project/contributing.md",
    "CHANGELOG.md": "project/changelog.md",
}
"""Where documents of the repository's root stand in the site."""


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages that are not files of the documentation's folder."""
    root = Path(config.config_file_path).parent
    pages = {"reference/commands.md": commands_page(), "reference/api.md": api_page()}
    pages["project/modules.md"] = module_page(root / "airrace")
    pages |= {f"reference/{language}.md": page for language, page in language_pages()}
    for name, page in ROOT_DOCUMENTS.items():
        pages[page] = moved((root / name).read_text(encoding="utf-8"))
    for notebook in sorted((root / "docs" / "notebooks").glob("*.ipynb")):
        pages[f"notebooks/{notebook.stem}.md"] = notebook_page(notebook)
    for path, text in pages.items():
        files.append(File.generated(config, path, content=text))
    return files


def on_page_content(html: str, **_: object) -> str:
    """Draw the formulas."""
    return with_formulas(html)


def moved(text: str) -> str:
    """A document of the root as a page one folder below that of the documentation: its links lead on."""
    text = re.sub(r"\]\(docs/", "](../", with_tables(text))
    for name, page in ROOT_DOCUMENTS.items():
        text = text.replace(f"]({name}", f"](../{page}")
    return text
