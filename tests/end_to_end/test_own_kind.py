"""A kind of gate of one's own: one file, named in the environment, and nothing of the package touched."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from airrace_command import AIRCRAFT, POINT_MASS, Ran, airrace

from airrace.checkpoint import read_checkpoint

OWN = {"AIRRACE_EXTENSIONS": str(Path(__file__).with_name("ring.py"))}
TRACK = f"""
schema: airrace/track/1
name: Rings
aircraft: {AIRCRAFT}
rules: {{n_z_max: 10, start_speed_max_kt: 200}}
gates:
  start: {{type: ring, north_m: 0, east_m: 0, heading_deg: 0, height_m: 40}}
  high: {{type: ring, north_m: 450, east_m: 80, heading_deg: 40, height_m: 60}}
  side: {{type: ring, north_m: 500, east_m: 420, heading_deg: 150, height_m: 35}}
  end: {{type: level, north_m: 100, east_m: 500, heading_deg: 180}}
course:
  start: start
  lap: [high, side, end]
"""
PLACES = {"start": (0.0, 0.0, 40.0, 0.0), "high": (450.0, 80.0, 60.0, 40.0), "side": (500.0, 420.0, 35.0, 150.0)}
HALF_SPAN = 7.43 / 2
ROOM = 16.0 / 2 - 0.5  # m, between the axis of a ring and its clearance


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> tuple[Ran, Path]:
    """A race through rings, and its checkpoint."""
    folder = tmp_path_factory.mktemp("own")
    (folder / "rings.yaml").write_text(TRACK, encoding="utf-8")
    options = (*POINT_MASS, "--guess", "plan", "--search", "off", "--output", "rings.h5", "--json", "--quiet")
    return airrace("optimize", "rings.yaml", *options, cwd=folder, environment=OWN), folder / "rings.h5"


def test_own_kind_is_flown_certified(flown: tuple[Ran, Path]) -> None:
    ran, run = flown
    assert ran.code == 0, ran.err
    assert ran.answer["certified"] is True
    assert ran.answer["track"] == "rings"
    assert "ring.py" in read_checkpoint(run).versions


def test_own_kind_is_passed_by_its_own_rule_in_any_attitude(flown: tuple[Ran, Path]) -> None:
    _, run = flown
    (stage,) = read_checkpoint(run).stages
    trajectory, splits = stage.result.trajectory, stage.result.splits
    assert max(abs(math.degrees(split.bank)) for split in splits[:-1]) > 45.0
    farthest: list[float] = []
    for split, node in zip(splits[:-1], trajectory.first_node[:-1].tolist(), strict=True):
        north, east, height, heading_deg = PLACES[split.name.partition(":")[2]]
        axis = np.array([math.cos(math.radians(heading_deg)), math.sin(math.radians(heading_deg))])
        offset = np.array([trajectory.of("x")[node] - north, trajectory.of("y")[node] - east])
        up = -trajectory.of("z")[node] - height
        assert axis @ offset == pytest.approx(0.0, abs=0.01)
        farthest.append(math.hypot(axis[0] * offset[1] - axis[1] * offset[0], up) + HALF_SPAN)
    assert max(farthest) == pytest.approx(ROOM, abs=0.02)  # a fast race touches the limit, and keeps it


def test_own_kind_is_shown_reviewed_and_refused_like_any_other(tmp_path: Path) -> None:
    track, large = tmp_path / "rings.yaml", TRACK.replace("height_m: 35", "height_m: 35, diameter_m: 80")
    track.write_text(large, encoding="utf-8")
    shown = airrace("check", track, "--json", "--plot", "rings.svg", cwd=tmp_path, environment=OWN)
    assert shown.code == 0, shown.err
    course = shown.answer
    assert [passage["type"] for passage in course["passages"]] == ["ring", "ring", "ring", "level"]
    assert [(one["passage"], one["kind"]) for one in course["warnings"] if "radius" in one["text"]] == [
        ("1:side", "element")
    ]
    assert "ring, and the courses through it" in (tmp_path / "rings.svg").read_text(encoding="utf-8")
    track.write_text(TRACK.replace("height_m: 35", "height_m: 35, diameter_m: 8"), encoding="utf-8")
    narrow = airrace("check", track, cwd=tmp_path, environment=OWN)
    assert narrow.code == 3
    assert "gates.side.diameter_m: leaves 7 m between its clearances" in narrow.err
    track.write_text(TRACK.replace("height_m: 35", "height_m: 35, wide: 3"), encoding="utf-8")
    assert "unknown key `wide`" in airrace("check", track, cwd=tmp_path, environment=OWN).err


def test_own_kind_has_prices(flown: tuple[Ran, Path]) -> None:
    _, run = flown
    priced = airrace("sensitivity", run, "--json", cwd=run.parent, environment=OWN)
    assert priced.code == 0, priced.err
    assert "gates.side.diameter_m" in json.dumps(priced.answer["sensitivities"])


def test_own_kind_is_unknown_where_its_file_is_not_named(tmp_path: Path) -> None:
    track = tmp_path / "rings.yaml"
    track.write_text(TRACK, encoding="utf-8")
    refused = airrace("check", track, cwd=tmp_path)
    assert refused.code == 3
    assert "unknown type `ring`" in refused.err


def test_own_kind_is_part_of_the_language_that_editors_are_told(tmp_path: Path) -> None:
    told = airrace("schema", "track", cwd=tmp_path, environment=OWN)
    assert json.loads(told.out)["definitions"]["RingEntry"]["title"] == "a ring"
    assert "RingEntry" not in airrace("schema", "track", cwd=tmp_path).out
