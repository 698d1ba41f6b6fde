"""Pages of reference that are written by hand, held against the program."""

import re
from dataclasses import replace
from pathlib import Path
from typing import get_args

import h5py
import pytest
import yaml
from pages import DOCS, README, ROOT

from airrace.files.checkpoint import ReserveAttempt, read_checkpoint, store, write_checkpoint
from airrace.files.checkpoint.log_layout import LOG_SCHEMA
from airrace.files.checkpoint.run_layout import SCHEMA
from airrace.files.inputs import load_inputs
from airrace.files.inputs.json_schema import LANGUAGES
from airrace.files.inputs.rules import PresetEntry
from airrace.procedure.result import BoundedWindow, LowerBound

TRACK = ROOT / "tracks" / "half_cuban_eight.yaml"
CHECKPOINT = (DOCS / "reference" / "checkpoint.md").read_text(encoding="utf-8")
KINDS = {"f": "number", "i": "count", "S": "text"}
COLUMN = re.compile(r"(?:^|; )`?(\w+)`?(?: \((text|count)\))?")
SCALES = {"CLASS", "NAME", "DIMENSION_LIST", "REFERENCE_LIST"}
"""Attributes that HDF5's dimension scales keep for themselves."""


def rows(text: str, *heading: str) -> list[list[str]]:
    """The rows of the table with this heading, without the marks of code."""
    _, heading_row, below = text.partition(f"| {' | '.join(heading)} |\n")
    assert heading_row, f"there is no table of {', '.join(heading)}"
    table = below.split("\n\n")[0].splitlines()[1:]
    return [[cell.strip().strip("`") for cell in line[1:-1].split("|")] for line in table]


def general(path: str) -> str:
    """A path of a file as the page writes it."""
    path = re.sub(r"^reserve/[^/]+", "reserve/N", path)
    path = re.sub(r"^stages/[^/]+", "stages/STAGE", path)
    return "/" + re.sub(r"/(states|controls)/.*", r"/\1/NAME", path)


def stored(run: Path) -> tuple[dict[str, str], set[tuple[str, str, str]], dict[str, str]]:
    """Paths with their kinds; columns of tables with theirs; attributes of a state with theirs."""
    paths: dict[str, str] = {}
    columns: set[tuple[str, str, str]] = set()

    def visit(path: str, node: h5py.Dataset | h5py.Group) -> None:
        if not isinstance(node, h5py.Dataset):
            return
        paths[general(path)] = "table" if node.dtype.names else KINDS[node.dtype.kind]
        for column in node.dtype.names or ():
            columns.add((path.rsplit("/", 1)[-1], column, KINDS[node.dtype[column].kind]))

    with h5py.File(run) as file:
        file.visititems(visit)
        state = file["stages/point-mass/states/V_K"].attrs
        attributes = {name: KINDS[state[name].dtype.kind] for name in state if name not in SCALES}
    return paths, columns, attributes


BOUND = LowerBound(1.0, 1.0, 3, 9, 9, 0, (BoundedWindow("a -> b", 1, 0.0, 9),))


def test_the_layout_of_the_checkpoint_is_documented_in_full(flown: Path, tmp_path: Path) -> None:
    run = read_checkpoint(flown)
    results = [replace(stage.result, search=replace(stage.result.search, bound=BOUND)) for stage in run.stages]
    pairs = zip(run.stages, results, strict=True)
    run = replace(run, stages=tuple(replace(stage, result=result) for stage, result in pairs))
    attempt = ReserveAttempt("{}", 10, 1, 1, 0, 0.1, 1.0, 0.0, done=False)
    write_checkpoint(tmp_path / "run.h5", run.with_attempt(attempt, (), run.stages[-1].result))
    paths, columns, attributes = stored(tmp_path / "run.h5")
    flights = {path for path in paths if path.startswith("/reserve/N/flight/")}
    assert {path.removeprefix("/reserve/N/flight/") for path in flights} == {
        path.removeprefix("/stages/STAGE/")
        for path in paths
        if path.startswith("/stages/STAGE/") and not path.endswith("_hash")
    }
    paths = {path: kind for path, kind in paths.items() if path not in flights}
    documented = {path: kind for path, kind, *_ in rows(CHECKPOINT, "path", "kind", "shape", "content")}
    settings = {"/inputs/settings/path": "text", "/inputs/settings/text": "text"}  # this run had no file of settings
    conflicts = {"/stages/STAGE/suggested_changes": "table"}  # this run has a flight
    assert documented == paths | settings | conflicts
    tables = rows(CHECKPOINT, "table", "columns")
    named = {(table, name, kind or "number") for table, text in tables for name, kind in COLUMN.findall(text)}
    assert named == columns
    assert {name: kind for name, kind, _ in rows(CHECKPOINT, "attribute", "kind", "content")} == attributes


def test_the_shapes_of_the_checkpoint_are_as_documented(flown: Path) -> None:
    with h5py.File(flown) as file:
        stage = file["stages/point-mass"]
        N, P = len(stage["interval_time"]), len(stage["durations"])
        sizes = {"N": N, "N + 1": N + 1, "P": P, "P + 1": P + 1, "1": 1}
        for path, _, shape, _ in rows(CHECKPOINT, "path", "kind", "shape", "content"):
            if shape:
                path = path.replace("STAGE", "point-mass").replace("states/NAME", "states/x")
                values = file[path.replace("NAME", "n_z_dot")]
                assert values.shape == (sizes[shape.strip("`")],), path


def test_the_readme_has_at_most_150_lines() -> None:
    assert len(README.read_text(encoding="utf-8").splitlines()) <= 150


@pytest.mark.parametrize(
    "example",
    [row[1] for row in rows((DOCS / "course.md").read_text(encoding="utf-8"), "`type`", "example", "meaning")],
)
def test_every_example_of_an_element_is_valid(example: str, tmp_path: Path) -> None:
    (name,) = yaml.safe_load(example)
    course = {"start": "first", "lap": [name, "last"]}
    first = {"type": "level", "north_m": -900, "east_m": 0, "heading_deg": 0}
    gates = {"first": first, "last": {**first, "north_m": 2000}, **yaml.safe_load(example)}
    track = {"schema": "airrace/track/1", "name": "one", "rules": {"n_z_max": 10}, "gates": gates, "course": course}
    path = tmp_path / "one.yaml"
    path.write_text(yaml.safe_dump(track), encoding="utf-8")
    inputs = load_inputs(path, aircraft=ROOT / "configs" / "edge540.yaml")
    assert len(inputs.race.course.passages) >= 3


def test_the_page_on_versions_lists_the_schemas_that_are_read() -> None:
    page = (DOCS / "versions.md").read_text(encoding="utf-8")
    models = [*(model() for model in LANGUAGES.values()), PresetEntry]
    languages = {tag for model in models for tag in get_args(model.model_fields["schema_"].annotation)}
    assert set(re.findall(r"`schema: (airrace/\w+/\d+)`", page)) == languages
    numbers = re.findall(r"^\| (?:\[checkpoints|flight logs|the user block).*?\| (\d+) \|", page, re.MULTILINE)
    assert [int(number) for number in numbers] == [SCHEMA, LOG_SCHEMA, store.VERSION]
