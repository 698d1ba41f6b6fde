"""The site is built without a warning, and nothing in it is fetched from elsewhere."""

import html
import inspect
import re
import shutil
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from types import ModuleType

import pytest
from pages import ROOT

import airrace

LOADING = {
    "audio": "src",
    "embed": "src",
    "iframe": "src",
    "image": "href",
    "img": "src",
    "input": "src",
    "object": "data",
    "script": "src",
    "source": "src",
    "track": "src",
    "use": "href",
    "video": "src",
}
"""Elements for which a browser fetches something, and the attribute that says what."""

LOADING_LINKS = {"dns-prefetch", "icon", "manifest", "modulepreload", "preconnect", "prefetch", "preload", "stylesheet"}
ELSEWHERE = re.compile(r"(?:[a-z]+:)?//", re.IGNORECASE)


def build(folder: Path, output: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(output)]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The site, built as strictly as can be: a link or a heading that does not exist is an error."""
    output = tmp_path_factory.mktemp("site")
    built = build(ROOT, output)
    assert built.returncode == 0, built.stdout + built.stderr
    return output


class Fetched(HTMLParser):
    """What a browser fetches for a page; scripts within the page and styles are looked at, too."""

    def __init__(self) -> None:
        super().__init__()
        self.addresses: list[str] = []
        self.classes: set[str] = set()
        self._inside = ""

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = {name: value or "" for name, value in attrs}
        self._inside = tag
        self.classes |= set(values.get("class", "").split())
        if tag in LOADING:
            self.addresses.append(values.get(LOADING[tag], ""))
        if tag == "link" and LOADING_LINKS & set(values.get("rel", "").split()):
            self.addresses.append(values.get("href", ""))
        self.addresses += styled(values.get("style", ""))

    def handle_data(self, data: str) -> None:
        if self._inside == "style":
            self.addresses += styled(data)


def styled(text: str) -> list[str]:
    """What a style sheet fetches."""
    return re.findall(r"(?:url\(|@import)\s*[\"']?([^\"')\s]+)", text)


def elsewhere(addresses: list[str]) -> list[str]:
    return [address for address in addresses if ELSEWHERE.match(address)]


def test_pages_fetch_nothing_from_elsewhere(site: Path) -> None:
    pages = list(site.rglob("*.html"))
    assert len(pages) > 25
    for page in pages:
        parser = Fetched()
        parser.feed(page.read_text(encoding="utf-8"))
        assert parser.addresses, page.name
        assert elsewhere(parser.addresses) == [], page.name
        assert "mermaid" not in parser.classes, "the theme would fetch a script for this diagram"
        assert "arithmatex" not in parser.classes, "a formula was left to a script"


def test_every_formula_is_drawn(site: Path) -> None:
    for page in (site / "theory").glob("*.html"):
        source = (ROOT / "docs" / "theory" / f"{page.stem}.md").read_text(encoding="utf-8")
        text = page.read_text(encoding="utf-8")
        assert text.count("<math ") == source.count("\\(") + source.count("\\[") > 0, page.name


def test_style_sheets_fetch_nothing_from_elsewhere(site: Path) -> None:
    sheets = list(site.rglob("*.css"))
    assert len(sheets) > 2
    for sheet in sheets:
        assert elsewhere(styled(sheet.read_text(encoding="utf-8"))) == [], sheet.name


@pytest.mark.parametrize(
    "page",
    [
        '<script src="https://one.example/x.js"></script>',
        '<img src="//one.example/x.png">',
        '<link rel="preconnect stylesheet" href="https://one.example">',
        "<style>@import 'https://one.example/x.css'</style>",
        '<p style="background: url(https://one.example/x.png)">',
    ],
)
def test_what_is_fetched_from_elsewhere_would_be_found(page: str) -> None:
    parser = Fetched()
    parser.feed(page)
    assert len(elsewhere(parser.addresses)) == 1


def test_the_site_has_what_is_generated(site: Path) -> None:
    text = (site / "reference" / "commands.html").read_text(encoding="utf-8")
    assert "airrace optimize" in text
    assert (site / "theory" / "model.html").read_text(encoding="utf-8").count("<math ") > 30
    assert "Minimum" in (site / "index.html").read_text(encoding="utf-8")


def test_the_api_has_every_public_name_with_its_docstring(site: Path, generators: dict[str, ModuleType]) -> None:
    page = (site / "reference" / "api.html").read_text(encoding="utf-8")
    text = html.unescape(re.sub(r"<[^>]+>", "", page))
    names = generators["api_pages"].public_names()
    assert {"Course", "Race", "StageResult", "load_inputs"} <= set(names)
    for name in names:
        assert f'id="{generators["api_pages"].home_of(name)}"' in page, name
        described = inspect.getdoc(getattr(airrace, name))
        assert described, name
        assert described.splitlines()[0].replace("`", "") in text, name


@pytest.mark.slow  # a second build of the site
def test_a_link_that_leads_nowhere_ends_the_build(tmp_path: Path) -> None:
    copy = tmp_path / "copy"
    ignored = shutil.ignore_patterns(".git", ".venv", "site", "*.h5", "__pycache__")
    shutil.copytree(ROOT, copy, ignore=ignored)
    (copy / "docs" / "index.md").write_text("# One\n\n[two](evidence.md#no-such-heading)\n", encoding="utf-8")
    built = build(copy, tmp_path / "site")
    assert built.returncode != 0
    assert "no-such-heading" in built.stdout + built.stderr
