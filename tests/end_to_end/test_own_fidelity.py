"""A fidelity of one's own: one file, named in the environment, and nothing of the package touched."""

import csv
from pathlib import Path

import numpy as np
import pytest
from airrace_command import HALF_CUBAN, Ran, airrace

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


def test_own_fidelity_is_unknown_where_its_file_is_not_named(flown: tuple[Ran, Path], tmp_path: Path) -> None:
    _, run = flown
    refused = airrace("optimize", HALF_CUBAN, "--until", "first-order-roll", cwd=tmp_path)
    assert refused.code == 2
    assert "there is no stage 'first-order-roll'" in refused.err
    unread = airrace("show", run, cwd=tmp_path)
    assert unread.code != 0
    assert "unknown stage 'first-order-roll'" in unread.err


def test_extension_that_does_not_exist_is_named(tmp_path: Path) -> None:
    named = {"AIRRACE_EXTENSIONS": str(tmp_path / "nowhere.py")}
    refused = airrace("optimize", HALF_CUBAN, cwd=tmp_path, environment=named)
    assert refused.code == 2
    assert f"AIRRACE_EXTENSIONS names {tmp_path / 'nowhere.py'}, which is not a Python file" in refused.err
