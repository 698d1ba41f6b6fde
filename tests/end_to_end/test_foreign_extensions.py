"""A fidelity and a gate kind from outside the package."""

import csv
import json
import math
from pathlib import Path

import numpy as np
import pytest
from airrace_command import AIRCRAFT, HALF_CUBAN, POINT_MASS, Ran, airrace

from airrace.files.checkpoint import read_checkpoint

OWN = {"AIRRACE_EXTENSIONS": str(Path(__file__).with_name("first_order_roll.py"))}
TAU = 0.08  # s, of the roll in that file


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> tuple[Ran, Path]:
    """The course flown up to that fidelity, and its checkpoint."""
    run = tmp_path_factory.mktemp("own") / "rolling.h5"
    options = (
        "--until",
        "first-order-roll",
        "--guess",
        "plan",
        "--search",
        "off",
        "--output",
        run,
        "--json",
        "--quiet",
    )
    return airrace("optimize", HALF_CUBAN, *options, cwd=run.parent, environment=OWN), run


def test_own_fidelity_is_flown_certified_above_the_point_mass(flown: tuple[Ran, Path]) -> None:
    ran, _ = flown
    assert ran.code == 0, ran.err
    assert ran.stages == ["point-mass", "first-order-roll"]
    assert ran.answer["certified"] is True
    point_mass, rolling = ran.answer["stages"]
    assert rolling["certified"] is True
    assert rolling["started_from"] == "point-mass"
    assert point_mass["race_time_s"] <= rolling["race_time_s"] <= point_mass["race_time_s"] + 0.05  # a lag is no help


def test_own_fidelity_flies_its_own_equation(flown: tuple[Ran, Path], tmp_path: Path) -> None:
    _, run = flown
    table = tmp_path / "flight.csv"
    options = ("--rate", "200", "--output", table)
    exported = airrace("export", "csv", run, *options, cwd=tmp_path, environment=OWN)
    assert exported.code == 0, exported.err
    rows = list(csv.DictReader(line for line in table.read_text().splitlines() if not line.startswith("#")))
    time, p, p_cmd, lag = (
        np.array([float(row[name]) for row in rows])
        for name in ("time_s", "p_Kbar_deg_s", "p_cmd_deg_s", "p_lag_deg_s")
    )
    assert lag == pytest.approx(p_cmd - p, abs=1e-6)
    middle = TAU * np.diff(p) / np.diff(time)
    assert np.abs(lag).max() > 20.0
    assert middle == pytest.approx(0.5 * (lag[1:] + lag[:-1]), abs=1.0)


def test_own_fidelity_is_unknown_where_its_file_is_not_named_or_does_not_exist(
    flown: tuple[Ran, Path], tmp_path: Path
) -> None:
    _, run = flown
    refused = airrace("optimize", HALF_CUBAN, "--until", "first-order-roll", cwd=tmp_path)
    assert refused.code == 2
    assert "there is no stage 'first-order-roll'" in refused.err
    unread = airrace("show", run, cwd=tmp_path)
    assert unread.code != 0
    assert "'first-order-roll' is unknown" in unread.err
    named = {"AIRRACE_EXTENSIONS": str(tmp_path / "nowhere.py")}
    refused = airrace("optimize", HALF_CUBAN, cwd=tmp_path, environment=named)
    assert refused.code == 2
    assert f"AIRRACE_EXTENSIONS names {tmp_path / 'nowhere.py'}, which is not a Python file" in refused.err


WITH_RING = {"AIRRACE_EXTENSIONS": str(Path(__file__).with_name("ring.py"))}
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
def ring_run(tmp_path_factory: pytest.TempPathFactory) -> tuple[Ran, Path]:
    """A race through rings, and its checkpoint."""
    folder = tmp_path_factory.mktemp("own")
    (folder / "rings.yaml").write_text(TRACK, encoding="utf-8")
    options = (*POINT_MASS, "--guess", "plan", "--search", "off", "--output", "rings.h5", "--json", "--quiet")
    return airrace("optimize", "rings.yaml", *options, cwd=folder, environment=WITH_RING), folder / "rings.h5"


def test_own_kind_is_flown_certified(ring_run: tuple[Ran, Path]) -> None:
    ran, run = ring_run
    assert ran.code == 0, ran.err
    assert ran.answer["certified"] is True
    assert ran.answer["track"] == "rings"
    assert "ring.py" in read_checkpoint(run).versions


def test_own_kind_is_passed_by_its_own_rule_in_any_attitude(ring_run: tuple[Ran, Path]) -> None:
    _, run = ring_run
    (stage,) = read_checkpoint(run).stages
    trajectory, splits = stage.result.trajectory, stage.result.splits
    assert max(abs(math.degrees(split.bank)) for split in splits[:-1]) > 45.0
    farthest: list[float] = []
    for split, node in zip(splits[:-1], trajectory.first_node[:-1].tolist(), strict=True):
        north, east, height, heading_deg = PLACES[split.name.partition(":")[2]]
        axis = np.array([math.cos(math.radians(heading_deg)), math.sin(math.radians(heading_deg))])
        offset = np.array([trajectory["x"][node] - north, trajectory["y"][node] - east])
        up = -trajectory["z"][node] - height
        assert axis @ offset == pytest.approx(0.0, abs=0.01)
        farthest.append(math.hypot(axis[0] * offset[1] - axis[1] * offset[0], up) + HALF_SPAN)
    assert max(farthest) == pytest.approx(ROOM, abs=0.02)  # a fast race touches the limit, and keeps it


def test_own_kind_is_shown_reviewed_and_refused_like_any_other(tmp_path: Path) -> None:
    track, large = tmp_path / "rings.yaml", TRACK.replace("height_m: 35", "height_m: 35, diameter_m: 80")
    track.write_text(large, encoding="utf-8")
    shown = airrace("check", track, "--json", "--plot", "rings.svg", cwd=tmp_path, environment=WITH_RING)
    assert shown.code == 0, shown.err
    course = shown.answer
    assert [passage["type"] for passage in course["passages"]] == ["ring", "ring", "ring", "level"]
    assert [(one["passage"], one["kind"]) for one in course["warnings"] if "radius" in one["text"]] == [
        ("1:side", "element")
    ]
    assert "ring, and the courses through it" in (tmp_path / "rings.svg").read_text(encoding="utf-8")
    track.write_text(TRACK.replace("height_m: 35", "height_m: 35, diameter_m: 8"), encoding="utf-8")
    narrow = airrace("check", track, cwd=tmp_path, environment=WITH_RING)
    assert narrow.code == 3
    assert "gates.side.diameter_m: leaves 7 m between its clearances" in narrow.err
    track.write_text(TRACK.replace("height_m: 35", "height_m: 35, wide: 3"), encoding="utf-8")
    assert "unknown key `wide`" in airrace("check", track, cwd=tmp_path, environment=WITH_RING).err


@pytest.mark.slow
def test_own_kind_has_sensitivities(ring_run: tuple[Ran, Path]) -> None:
    _, run = ring_run
    ran = airrace("sensitivity", run, "--json", cwd=run.parent, environment=WITH_RING)
    assert ran.code == 0, ran.err
    assert "gates.side.diameter_m" in json.dumps(ran.answer["sensitivities"])


def test_own_kind_is_part_of_the_language_only_where_its_file_is_named(tmp_path: Path) -> None:
    track = tmp_path / "rings.yaml"
    track.write_text(TRACK, encoding="utf-8")
    refused = airrace("check", track, cwd=tmp_path)
    assert refused.code == 3
    assert "unknown type `ring`" in refused.err
    told = airrace("schema", "track", cwd=tmp_path, environment=WITH_RING)
    assert json.loads(told.out)["definitions"]["RingEntry"]["title"] == "a ring"
    assert "RingEntry" not in airrace("schema", "track", cwd=tmp_path).out
