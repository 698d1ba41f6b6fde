"""The pages that users read, and the blocks of code in them."""

import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
README = ROOT / "README.md"
PAGES = [README, *sorted(DOCS.rglob("*.md"))]

FENCED = re.compile(
    r"(?P<comment><!-- [^\n]*? -->\n+)?^```(?P<language>\w*)\n(?P<text>.*?)^```$", re.MULTILINE | re.DOTALL
)
INDENTED = re.compile(r"(?:^    [^\n]*\n)+", re.MULTILINE)


@dataclass(frozen=True)
class Block:
    """A block of code.

    Attributes:
        page: where it stands, relative to the repository.
        line: its first line there.
        language: what its fence says.
        text: the code.
        comment: what the HTML comment above it says, if any.
    """

    page: str
    line: int
    language: str
    text: str
    comment: str = ""

    def __str__(self) -> str:
        return f"{self.page}:{self.line}"


def name_of(page: Path) -> str:
    return str(page.relative_to(ROOT))


def blocks(language: str) -> list[Block]:
    """All fenced blocks of a language, page by page in their order."""
    found: list[Block] = []
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        for match in FENCED.finditer(text):
            if match["language"] == language:
                line = text.count("\n", 0, match.start("text")) + 1
                comment = (match["comment"] or "").strip().removeprefix("<!-- ").removesuffix(" -->")
                found.append(Block(name_of(page), line, language, match["text"], comment))
    return found


def languages() -> set[str]:
    return {match["language"] for page in PAGES for match in FENCED.finditer(page.read_text(encoding="utf-8"))}


def shell_lines() -> Iterator[tuple[str, str]]:
    """Every command line of the pages, with its page: of blocks that are fenced as `sh`, and of indented ones.

    Lines that go on are joined; explanations behind a command (after four blanks) are cut off.
    """
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        fenced = [match["text"] for match in FENCED.finditer(text) if match["language"] == "sh"]
        indented = [match[0] for match in INDENTED.finditer(FENCED.sub("", text))]
        for block in (*fenced, *indented):
            for line in re.sub(r"\\\n\s*", "", block).splitlines():
                command = re.split(r" {4,}", line.strip().removeprefix("$ "))[0].strip()
                if command:
                    yield name_of(page), command


def build(folder: Path, output: Path) -> subprocess.CompletedProcess[str]:
    """Build the site of a folder as strictly as can be: a link or a heading that does not exist is an error."""
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(output)]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
