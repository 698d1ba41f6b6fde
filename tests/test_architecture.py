"""The walls of the house: which layer may import which, and what the documents promise about the tree."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
DOCUMENTS = [
    *(ROOT / name for name in ("ARCHITECTURE.md", "CONTRIBUTING.md", "README.md")),
    *sorted((ROOT / "docs").rglob("*.md")),
]
MADE = [ROOT / "docs" / folder for folder in ("reference", "project", "notebooks")]
"""Where pages of the site are that are made while it is built. The build itself checks what links to them."""


def test_no_layer_reaches_upwards() -> None:
    program = "from importlinter.cli import lint_imports_command; lint_imports_command()"
    command = [sys.executable, "-c", program, "--no-cache"]
    checked = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert checked.returncode == 0, checked.stdout + checked.stderr


def test_nothing_but_the_entry_point_knows_the_command_line() -> None:
    outside = [*(ROOT / "scripts").glob("*.py"), *(ROOT / "airrace").rglob("*.py")]
    naming = {
        str(path.relative_to(ROOT))
        for path in outside
        if (ROOT / "airrace" / "cli") not in path.parents and "airrace.cli" in path.read_text(encoding="utf-8")
    }
    assert naming == {"airrace/__main__.py"}


def test_documents_name_every_package_and_no_module_or_path_that_does_not_exist() -> None:
    text = (ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8")
    packages = {path.parent.name for path in (ROOT / "airrace").glob("*/__init__.py")}
    assert {package for package in packages if f"`airrace/{package}/`" not in text} == set()
    modules = {path.name for folder in ("airrace", "scripts") for path in (ROOT / folder).rglob("*.py")}
    assert set(re.findall(r"`(\w+\.py)`", text)) <= modules
    for document in DOCUMENTS:
        text = document.read_text(encoding="utf-8")
        paths = re.findall(r"`((?:airrace|tests|tracks|configs|scripts|\.ci)/[\w./]+)`", text)
        assert [path for path in paths if not (ROOT / path).exists()] == [], document.name


def prose(document: Path) -> str:
    """The text of a document without its blocks of code."""
    return re.sub(r"^```.*?^```", "", document.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)


def headings(document: Path) -> set[str]:
    """Where a link into a document can lead: its headings, lower-case, without punctuation, words joined by hyphens."""
    titles = re.findall(r"^#+ (.+)$", prose(document), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}


def links(document: Path) -> list[tuple[str, str]]:
    """The links and pictures of a document that stay in the repository: paths, and what follows a `#`."""
    found = re.findall(r"\]\(([^)#\s]*)(?:#([^)\s]*))?\)", prose(document))
    return [(path, place) for path, place in found if not path.startswith(("http:", "https:"))]


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_every_link_in_the_documents_leads_to_a_file_and_to_a_heading_of_it(document: Path) -> None:
    for path, place in links(document):
        target = document.parent / path if path else document
        if document.is_relative_to(ROOT / "docs") and not target.exists() and target.resolve().parent in MADE:
            continue
        assert target.exists(), path
        assert not place or place in headings(target), f"{path}#{place}"


def test_the_readme_and_the_pages_it_links_lead_to_every_page_of_the_documentation() -> None:
    """Without the site, too: by links alone, from page to page."""
    reached, waiting = set[Path](), [ROOT / "README.md"]
    while waiting:
        document = waiting.pop()
        if document.suffix == ".md" and document.exists() and document not in reached:
            reached.add(document)
            waiting += [(document.parent / path).resolve() for path, _ in links(document) if path]
    assert set((ROOT / "docs").rglob("*.md")) <= reached


def test_ci_runs_the_very_test_command_of_the_readme() -> None:
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    marked = re.findall(r"<!-- test command -->\s*```\w*\n(.+)\n```", readme)
    assert len(marked) == 1
    assert f"\n{marked[0]}\n" in (ROOT / ".ci" / "run").read_text(encoding="utf-8")


def test_no_file_holds_two_ideas() -> None:
    sources = [
        path
        for folder in ("airrace", "scripts", "tests")
        for pattern in ("*.py", "*.c", "*.h")
        for path in (ROOT / folder).rglob(pattern)
        if "CMakeFiles" not in path.parts
    ]
    lengths = {str(path.relative_to(ROOT)): len(path.read_text(encoding="utf-8").splitlines()) for path in sources}
    assert {path: lines for path, lines in lengths.items() if lines > 600} == {}


READS_A_CLOCK = re.compile(
    r"\b(perf_counter|process_time|thread_time|monotonic|clock_gettime|timeit|time\.time\b|getrusage)"
)
MAY_READ_A_CLOCK = {
    "support/waiting.py": "what hangs is given up, after minutes",
    "test_architecture.py": "it names the clocks",
    "end_to_end/without_posix/sitecustomize.py": "it names the clocks that POSIX alone has, and hides them",
}
"""The only files of tests that do, and why none of them fails beside other work."""


def test_no_test_reads_a_clock_to_say_how_long_something_takes() -> None:
    tests = ROOT / "tests"
    reading = {
        str(path.relative_to(tests))
        for path in tests.rglob("*.py")
        if READS_A_CLOCK.search(path.read_text(encoding="utf-8"))
    }
    assert reading - MAY_READ_A_CLOCK.keys() == set()
