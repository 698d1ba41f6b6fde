"""What the documentation's blocks of code say is so."""

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import h5py
import jsonschema
import numpy as np
import pytest
import typer.core
import typer.main
import yaml
from pages import DOCS, PAGES, ROOT, Block, blocks, languages, shell_lines

from airrace.cli.main import app
from airrace.files.export import formats
from airrace.files.inputs import Document, load_inputs
from airrace.files.inputs.json_schema import LANGUAGES, json_schema
from airrace.files.inputs.log_columns import read_layout
from airrace.files.inputs.schema import read_entry
from airrace.files.inputs.settings import BatchEntry

ENDS = ("|", ">", "&&", ";", "&")
"""Where the shell takes over from the command."""


def calls() -> Iterator[tuple[str, list[str]]]:
    """Every call of airrace, as the words that follow it; a call behind `&&` is one of its own."""
    for page, line in shell_lines():
        if "airrace " not in line:  # of another program, or what one prints: an apostrophe in it quotes nothing
            continue
        words = shlex.split(re.sub(r"\[[^]]*\]", "", line), comments=True)
        for start, word in enumerate(words):
            if word != "airrace" or (start and words[start - 1] not in ENDS):
                continue
            end = next((index for index in range(start, len(words)) if words[index] in ENDS), len(words))
            yield page, words[start + 1 : end]


CALLS = list(calls())


def test_the_pages_call_the_command() -> None:
    assert len(CALLS) > 40
    assert {page for page, _ in CALLS} >= {"README.md", "docs/tutorial.md", "docs/command_line.md"}


@pytest.mark.parametrize(("page", "words"), CALLS, ids=[f"{page}: airrace {' '.join(words)}" for page, words in CALLS])
def test_every_call_in_the_pages_is_understood(page: str, words: list[str]) -> None:
    parse(words)


def parse(words: list[str]) -> None:
    """Read the words as the command line does, and call nothing."""
    command = typer.main.get_command(app)
    while isinstance(command, typer.core.TyperGroup):
        name, *words = words
        command = command.get_command(typer.Context(command), name)
        assert command is not None, name
    command.make_context("airrace", words)


def test_no_block_is_in_a_language_that_no_test_reads_and_scripts_that_the_pages_run_exist() -> None:
    assert languages() <= {"python", "yaml", "sh", "diff", "toml"}
    texts = "".join(page.read_text(encoding="utf-8") for page in PAGES)
    scripts = set(re.findall(r"python ((?:scripts|tests)/[\w/]+\.py)", texts))
    assert len(scripts) > 5
    assert {script for script in scripts if not (ROOT / script).exists()} == set()


BLOCKS = blocks("yaml")
WORKFLOW = "# .github/workflows/"
WHOLE = [block for block in BLOCKS if block.text.startswith("schema: ")]
WITH = "with: "
"""Begins the comment above a part of a file that needs an extension, with the path of the extension behind it."""

EXTENDED = [block for block in BLOCKS if block.comment.startswith(WITH)]
PARTS = [block for block in BLOCKS if not block.text.startswith(("schema: ", WORKFLOW)) and block not in EXTENDED]
TRACK = ROOT / "tracks" / "half_cuban_eight.yaml"
AIRCRAFT = ROOT / "configs" / "edge540.yaml"


def read(block: Block, folder: Path) -> None:
    """Read a whole file as the command does; it raises if anything is wrong."""
    language = block.text.split("\n", 1)[0].split("/")[1]
    path = folder / f"{language}.yaml"
    path.write_text(block.text, encoding="utf-8")
    match language:
        case "track":
            load_inputs(path, aircraft=AIRCRAFT)
        case "aircraft":
            load_inputs(TRACK, aircraft=path)
        case "settings":
            load_inputs(TRACK, aircraft=AIRCRAFT, settings=path)
        case "batch":
            _, reporter = read_entry(BatchEntry, Document("batch.yaml", block.text))
            assert reporter.findings == []
        case "log":
            layout, _ = read_layout(path)
            assert layout.columns
        case _:
            raise AssertionError(f"{block}: {language} is no language")


@pytest.mark.parametrize("block", WHOLE, ids=str)
def test_every_whole_file_in_the_pages_is_valid(block: Block, tmp_path: Path) -> None:
    assert {whole.text.split("/")[1] for whole in WHOLE} >= {"track", "settings", "batch"}
    read(block, tmp_path)


@pytest.mark.parametrize("block", PARTS, ids=str)
def test_every_part_of_a_file_in_the_pages_is_valid(block: Block) -> None:
    part: dict[str, Any] = yaml.safe_load(block.text)  # Any: YAML of any shape
    fitting = [json_schema(one) for one in LANGUAGES if part.keys() <= json_schema(one)["properties"].keys()]
    assert len(fitting) == 1, f"{block}: the keys {', '.join(part)} belong to {len(fitting)} languages"
    (schema,) = fitting
    jsonschema.validate(part, {**schema, "required": []})


@pytest.mark.parametrize("block", EXTENDED, ids=str)
def test_every_part_that_needs_an_extension_is_valid_with_it_alone(block: Block) -> None:
    extension = ROOT / block.comment.removeprefix(WITH)
    program = (
        "import json; from airrace.files.inputs.json_schema import json_schema; print(json.dumps(json_schema('track')))"
    )
    environment = {**os.environ, "AIRRACE_EXTENSIONS": str(extension)}
    schema = subprocess.run(
        [sys.executable, "-c", program], env=environment, capture_output=True, text=True, check=True
    )
    part = yaml.safe_load(block.text)
    jsonschema.validate(part, {**json.loads(schema.stdout), "required": []})
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(part, {**json_schema("track"), "required": []})


DIFFS = blocks("diff")


def changed(diff: str, root: Path) -> None:
    """Make the changes of a diff whose hunks carry no line numbers: each must fit in exactly one place."""
    for part in diff.split("--- ")[1:]:
        name, *hunks = part.split("@@\n")
        path = root / name.strip()
        text = path.read_text(encoding="utf-8")
        for hunk in hunks:
            lines = hunk.splitlines(keepends=True)
            before = "".join(line[1:] for line in lines if line[0] in " -")
            assert text.count(before) == 1, f"{name.strip()}: {before}"
            text = text.replace(before, "".join(line[1:] for line in lines if line[0] in " +"))
        path.write_text(text, encoding="utf-8")


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """A folder with a copy of the package and of its built-in courses and aircraft."""
    for folder in ("airrace", "tracks", "configs"):
        shutil.copytree(ROOT / folder, tmp_path / folder, ignore=shutil.ignore_patterns("__pycache__"))
    return tmp_path


LIMIT = """
import sys
from pathlib import Path

from airrace.errors import InputError
from airrace.files.inputs import load_inputs
from airrace.model.dynamics.limits import flight_limits

for override in sys.argv[2:]:
    try:
        race = load_inputs(Path(sys.argv[1]), overrides=[override]).race
        print(flight_limits(race.aircraft, race.course.rules).V_K.upper * 3600 / 1852)
    except InputError as error:
        print(*str(error).splitlines())
"""


def speed_limits(package: Path, *overrides: str) -> list[str]:
    """The highest speed, in knots, under one more rule, or why there is none."""
    return subprocess.run(
        [sys.executable, "-c", LIMIT, str(TRACK), *overrides],
        cwd=package,
        env={**os.environ, "PYTHONPATH": str(package)},
        capture_output=True,
        text=True,
        check=True,
    ).stdout.splitlines()


def test_a_speed_limit_is_added_as_the_page_says(package: Path) -> None:
    (diff,) = (block for block in DIFFS if block.page == "docs/how_to/limit.md")
    (unknown,) = speed_limits(package, "rules.speed_max_kt=200")
    assert "unknown key" in unknown
    changed(diff.text, package)
    limited, free, contradiction = speed_limits(
        package, "rules.speed_max_kt=200", "rules.n_z_max=9", "rules.speed_max_kt=60"
    )
    assert float(limited) == pytest.approx(200.0)
    assert float(free) > 200.0
    assert "V_K: no value satisfies both" in contradiction


NOT_RUN = "not run: "
"""Begins the comment above a block that cannot run here, with the reason behind it."""

FROM = "from: "
"""Begins the comment above a block that is a part of a file, which other tests run, with its path behind it."""

PYTHON = blocks("python")
RUN = [block for block in PYTHON if not block.comment.startswith((NOT_RUN, FROM))]
PYTHON_PARTS = [block for block in PYTHON if block.comment.startswith(FROM)]
BY_PAGE = {page: [block for block in RUN if block.page == page] for page in dict.fromkeys(one.page for one in RUN)}


def parameters() -> list[Any]:  # Any: pytest's parameter sets
    """Every page; those that optimise a race take half a minute each and are slow."""
    return [
        pytest.param(
            page, marks=pytest.mark.slow if any("airrace.optimize" in block.text for block in page_blocks) else ()
        )
        for page, page_blocks in BY_PAGE.items()
    ]


@pytest.mark.parametrize("page", parameters())
def test_the_python_of_a_page_runs(
    page: str, flown: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for folder in ("tracks", "configs"):
        shutil.copytree(ROOT / folder, tmp_path / folder)
    for name in ("rovinj.h5", "rovinj_2014.h5"):
        shutil.copy(flown, tmp_path / name)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "Agg")
    monkeypatch.setattr(formats, "_formats", dict(formats.formats()))  # a page registers one of its own
    names: dict[str, Any] = {"__name__": "page"}  # Any: whatever the page defines
    for block in BY_PAGE[page]:
        exec(compiled(block), names)
    assert "certified: False" not in capsys.readouterr().out


@pytest.mark.parametrize(
    ("overrides", "kept"),
    [
        (["name=Two words", "margins.rules.floor_m=2"], ["name=Two words", "margins.rules.floor_m=2"]),
        (
            ["rules.reserve.probability=0.9", "margins.rules.floor_m=2", "rules.reserve.found.reached=true"],
            ["rules.reserve.probability=0.9"],
        ),
    ],
)
@pytest.mark.parametrize("settings", [False, True])
def test_the_inputs_of_another_schema_are_extracted_in_full(
    overrides: list[str],
    kept: list[str],
    settings: bool,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """What a search for a reserve has found is left out, margins that were set by hand are not."""
    names = ["track", "aircraft", *(["settings"] if settings else [])]
    monkeypatch.chdir(tmp_path)
    with h5py.File("rovinj.h5", "w") as file:
        for name in names:
            file[f"inputs/{name}/text"] = np.bytes_(f"the {name}")
        rows = np.array([(text.encode(),) for text in overrides], [("override", "S64")])
        file["inputs/overrides"] = rows
    (block,) = (one for one in RUN if one.page == "docs/how_to/hdf5.md" and "old_track.yaml" in one.text)
    exec(compiled(block), {"h5py": h5py})
    assert {path.name: path.read_text() for path in tmp_path.glob("*.yaml")} == {
        f"old_{name}.yaml": f"the {name}" for name in names
    }
    words = shlex.split(capsys.readouterr().out)
    assert words == [
        *("airrace", "optimize", "old_track.yaml", "--aircraft", "old_aircraft.yaml"),
        *(["--settings", "old_settings.yaml"] if settings else []),
        *(word for text in kept for word in ("--set", text)),
    ]
    parse(words[1:])


@pytest.mark.parametrize("block", PYTHON, ids=str)
def test_every_block_of_python_compiles(block: Block) -> None:
    compiled(block)


@pytest.mark.parametrize("block", PYTHON_PARTS, ids=str)
def test_a_block_that_is_a_part_of_a_file_stands_there(block: Block) -> None:
    path = ROOT / block.comment.removeprefix(FROM)
    assert f"\n{bare(block.text)}\n" in f"\n{bare(path.read_text(encoding='utf-8'))}\n"


def bare(text: str) -> str:
    """The lines of a text that hold anything, without their indents: a method is shown as if it were a function."""
    return "\n".join(line.strip() for line in text.splitlines() if line.strip())


def compiled(block: Block) -> Any:  # Any: a code object
    """The code, with the lines of its page in tracebacks."""
    return compile("\n" * (block.line - 1) + block.text, block.page, "exec")


NOTEBOOKS = sorted(DOCS.rglob("*.ipynb"))
Cell = dict[str, Any]  # Any: JSON of any shape


def cells(path: Path) -> list[Cell]:
    return json.loads(path.read_text(encoding="utf-8"))["cells"]


def code(path: Path) -> list[Cell]:
    return [cell for cell in cells(path) if cell["cell_type"] == "code"]


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_has_a_title_and_outputs_of_all_cells_in_order_and_names_no_folder_of_its_machine(
    path: Path,
) -> None:
    executed = code(path)
    assert [cell["execution_count"] for cell in executed] == list(range(1, len(executed) + 1))
    assert all(cell["outputs"] for cell in executed)
    kinds = {output["output_type"] for cell in executed for output in cell["outputs"]}
    assert kinds <= {"display_data", "execute_result", "stream"}
    assert "".join(cells(path)[0]["source"]).startswith("# ")
    text = path.read_text(encoding="utf-8")
    assert not any(folder in text for folder in ("/home/", "/root/", "/tmp/", "/Users/"))


@pytest.mark.slow  # it flies several races
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs(path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "Agg")
    names: dict[str, Any] = {}  # Any: whatever the notebook defines
    for number, cell in enumerate(code(path), start=1):
        exec(compile("".join(cell["source"]), f"{path.name}, cell {number}", "exec"), names)
