"""The site is built without a warning, and nothing in it is fetched from elsewhere."""

import functools
import html
import inspect
import re
import shutil
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest
import typer.main
from pages import ROOT, build

import airrace
from airrace.cli.main import app
from airrace.files.inputs import load_inputs
from airrace.files.inputs.json_schema import LANGUAGES, json_schema

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


def test_pages_and_style_sheets_fetch_nothing_from_elsewhere(site: Path) -> None:
    pages = list(site.rglob("*.html"))
    assert len(pages) > 25
    for page in pages:
        parser = Fetched()
        parser.feed(page.read_text(encoding="utf-8"))
        assert parser.addresses, page.name
        assert elsewhere(parser.addresses) == [], page.name
        assert "mermaid" not in parser.classes, "the theme would fetch a script for this diagram"
        assert "arithmatex" not in parser.classes, "a formula was left to a script"
    sheets = list(site.rglob("*.css"))
    assert len(sheets) > 2
    for sheet in sheets:
        assert elsewhere(styled(sheet.read_text(encoding="utf-8"))) == [], sheet.name


def test_every_formula_is_drawn(site: Path) -> None:
    for page in (site / "theory").glob("*.html"):
        source = (ROOT / "docs" / "theory" / f"{page.stem}.md").read_text(encoding="utf-8")
        text = page.read_text(encoding="utf-8")
        assert text.count("<math ") == source.count("\\(") + source.count("\\[") > 0, page.name


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


def text_of(page: Path) -> str:
    """What a page says, without its marks, in one line."""
    text = re.sub(r"<[^>]+>", "", page.read_text(encoding="utf-8"))
    return " ".join(html.unescape(text).split())


def public_names() -> Iterator[tuple[str, str]]:
    """The anchor of every public name, and the first line of its docstring."""
    for name in dir(airrace):
        if not name.startswith("_"):
            member = getattr(airrace, name)
            yield f'id="{member.__module__}.{member.__qualname__}"', (inspect.getdoc(member) or "").partition("\n")[0]


def options() -> Iterator[tuple[str, str]]:
    """Every command and every way to write its options, with their meanings."""
    for name, command in commands("airrace", typer.main.get_command(app)):
        yield name, command.help
        for parameter in command.params:
            for option in parameter.opts:
                yield option if option[0] == "-" else name, getattr(parameter, "help", "")


def commands(name: str, command: Any) -> Iterator[tuple[str, Any]]:  # Any: typer hides the class
    """Every command that does something, with the words that call it."""
    if not hasattr(command, "list_commands"):
        yield name, command
        return
    context = typer.Context(command)
    for word in command.list_commands(context):
        yield from commands(f"{name} {word}", command.get_command(context, word))


def properties(node: Any) -> list[tuple[str, str]]:  # Any: JSON of any shape
    """Every key of a schema with its meaning, at any depth."""
    if isinstance(node, list):
        return [entry for element in node for entry in properties(element)]
    if not isinstance(node, dict):
        return []
    own = [(key, entry.get("description", "")) for key, entry in node.get("properties", {}).items()]
    return own + properties(list(node.values()))


def keys(language: str) -> Iterator[tuple[str, str]]:
    """Every key of a language, and its meaning."""
    return ((f"<code>{key}</code>", meaning) for key, meaning in properties(json_schema(language)))


PAGES = {"api": public_names, "commands": options, **{name: functools.partial(keys, name) for name in LANGUAGES}}


@pytest.mark.parametrize("page", PAGES)
def test_a_page_of_reference_has_every_name_with_its_meaning(site: Path, page: str) -> None:
    path = site / "reference" / f"{page}.html"
    content, text = path.read_text(encoding="utf-8"), text_of(path)
    names = list(PAGES[page]())
    assert len(names) > (5 if page in LANGUAGES else 50)
    for name, meaning in names:
        assert name in (content if name.startswith(("<", "id=")) else text), name
        assert meaning, f"{name} is not explained"
        assert " ".join(meaning.replace("`", "").split()) in text, name
    definitions = json_schema(page)["definitions"] if page in LANGUAGES else ()
    assert all(f'id="{name}"' in content for name in definitions)


def test_the_api_tells_the_parameters_of_a_record_and_names_that_share_a_description(site: Path) -> None:
    text = text_of(site / "reference" / "api.html")
    assert re.search(r"Quantity dataclass .{80,200}name str the symbol", text)
    assert re.search(r"lower float (.+?) upper float \1 ", text)


def test_values_of_a_language_are_described_in_words(site: Path) -> None:
    text = text_of(site / "reference" / "track.html")
    assert "bank right or left or either either the wing that points down" in text
    assert "laps whole number from 1 to 100 the number of laps; 1 by default" in text
    assert "n_z_max number above 1 and at most 25" in text
    assert "A bare text stands for a mapping with this text as its gate." in text
    assert "each_lap list of: list of: passing reference, at most 10000, at most 100" in text


def test_the_documented_defaults_of_the_settings_are_the_defaults(site: Path) -> None:
    page = (site / "reference" / "settings.html").read_text(encoding="utf-8")
    cell = r"<td>(?:<code>)?([^<]*)(?:</code>)?</td>\s*"
    documented = {key: default for key, default in re.findall(rf"{cell}<td>.*?</td>\s*{cell}", page) if default}
    parts = json_schema("settings")["definitions"]
    keys = {key: f"{name.removesuffix('Entry').lower()}.{key}" for name in parts for key in parts[name]["properties"]}
    assert keys.keys() <= documented.keys()
    track = ROOT / "tracks" / "half_cuban_eight.yaml"
    defaults = load_inputs(track).settings
    for key, default in documented.items():
        if key != "schema":
            assert load_inputs(track, overrides=[f"settings.{keys.get(key, key)}={default}"]).settings == defaults, key


def test_notebooks_and_documents_of_the_root_are_pages(site: Path) -> None:
    assert "data:image/png;base64," in (site / "notebooks" / "rovinj.html").read_text(encoding="utf-8")
    architecture = text_of(site / "project" / "architecture.html")
    assert "procedure Problem, guess optimal_control" in architecture
    modules = text_of(site / "project" / "modules.html")
    assert {path.name for path in (ROOT / "airrace").rglob("*.py")} - {"__init__.py"} <= set(modules.split())


@pytest.mark.slow  # a second build of the site
def test_a_link_that_leads_nowhere_ends_the_build(tmp_path: Path) -> None:
    copy = tmp_path / "copy"
    ignored = shutil.ignore_patterns(".git", ".venv", "site", "*.h5", "__pycache__")
    shutil.copytree(ROOT, copy, ignore=ignored)
    (copy / "docs" / "index.md").write_text("# One\n\n[two](evidence.md#no-such-heading)\n", encoding="utf-8")
    built = build(copy, tmp_path / "site")
    assert built.returncode != 0
    assert "no-such-heading" in built.stdout + built.stderr
