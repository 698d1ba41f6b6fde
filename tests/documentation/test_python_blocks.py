"""The Python of the pages runs as it stands, page by page from the first block to the last."""

import shutil
from pathlib import Path
from typing import Any

import pytest
from pages import ROOT, Block, blocks

NOT_RUN = "not run: "
"""Begins the comment above a block that cannot run here, with the reason behind it."""

FROM = "from: "
"""Begins the comment above a block that is a part of a file, which other tests run, with its path behind it."""

BLOCKS = blocks("python")
RUN = [block for block in BLOCKS if not block.comment.startswith((NOT_RUN, FROM))]
PARTS = [block for block in BLOCKS if block.comment.startswith(FROM)]
BY_PAGE = {page: [block for block in RUN if block.page == page] for page in dict.fromkeys(one.page for one in RUN)}


def parameters() -> list[Any]:  # Any: pytest's parameter sets
    """Every page; those that optimise a race take half a minute each and are slow."""
    return [
        pytest.param(page, marks=pytest.mark.slow if any("airrace.optimize(" in one.text for one in found) else ())
        for page, found in BY_PAGE.items()
    ]


@pytest.mark.parametrize("page", parameters())
def test_the_python_of_a_page_runs(
    page: str, flown: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    found = BY_PAGE[page]
    for folder in ("tracks", "configs"):
        shutil.copytree(ROOT / folder, tmp_path / folder)
    for name in ("rovinj.h5", "rovinj_2014.h5"):
        shutil.copy(flown, tmp_path / name)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "Agg")
    names: dict[str, Any] = {"__name__": "page"}  # Any: whatever the page defines
    for block in found:
        exec(compiled(block), names)
    assert "certified: False" not in capsys.readouterr().out


@pytest.mark.parametrize("block", BLOCKS, ids=str)
def test_every_block_of_python_can_be_read(block: Block) -> None:
    compiled(block)


@pytest.mark.parametrize("block", PARTS, ids=str)
def test_a_block_that_is_a_part_of_a_file_stands_there(block: Block) -> None:
    path = ROOT / block.comment.removeprefix(FROM)
    assert f"\n{bare(block.text)}\n" in f"\n{bare(path.read_text(encoding='utf-8'))}\n"


def test_a_block_that_is_not_run_says_why() -> None:
    left_out = [block for block in BLOCKS if block.comment.startswith(NOT_RUN)]
    assert left_out
    assert all(len(block.comment) > len(NOT_RUN) for block in left_out)


def bare(text: str) -> str:
    """The lines of a text that hold anything, without their indents: a method is shown as if it were a function."""
    return "\n".join(line.strip() for line in text.splitlines() if line.strip())


def compiled(block: Block) -> Any:  # Any: a code object
    """The code, with the lines of its page in tracebacks."""
    return compile("\n" * (block.line - 1) + block.text, block.page, "exec")
