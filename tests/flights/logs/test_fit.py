"""Aircraft fitted to logs: the file, what is told, and logs that tell too little."""

from pathlib import Path

import numpy as np
import pytest
import synthetic
from command import run as airrace

import airrace.runs.fit as fitting
from airrace.api.aircraft import fit
from airrace.runs.aircraft_file import read_aircraft_file

pytestmark = pytest.mark.usefixtures("folder")


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def write_log(hz: float, *, roll: bool = False) -> None:
    fixes = synthetic.fixes(hz, noise=1.0)
    columns = np.stack([fixes.time + 10.0, fixes.north, fixes.east, fixes.height], axis=1)
    header = "time [s],north [m],east [m],height [m]"
    if roll:
        columns = np.column_stack([columns, synthetic.banks(fixes.time, 380.0)])
        header += ",roll [deg]"
    np.savetxt("log.csv", columns, "%.3f", ",", header=header, comments="")


FIT = ("fit", "log.csv", "--course", "rovinj_2014", "--aircraft", "edge540", "--output", "mine.yaml")


def test_the_file_says_what_was_fitted_and_what_was_not(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fitting, "_correct", lambda found, *_: (found, np.zeros(3)))
    write_log(5.0)
    ran = airrace(*FIT)
    assert ran.code == 0, ran.err
    text = Path("mine.yaml").read_text(encoding="utf-8")
    assert text.count("# fitted, +-") == 3
    assert "C_lp: -0.45" in text
    fitted = read_aircraft_file("mine.yaml").aircraft
    assert fitted.drag.C_D0 != read_aircraft_file("edge540").aircraft.drag.C_D0
    assert "420" in ran.out
    assert ran.out.count("not visible") == 1  # the roll rate
    assert airrace("check", "rovinj_2014", "--aircraft", "mine.yaml").code == 0
    assert airrace(*FIT).code == 2  # the file exists


def test_a_roll_that_is_recorded_shows_the_roll_rate(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fitting, "_correct", lambda found, *_: (found, np.zeros(3)))
    write_log(20.0, roll=True)
    assert airrace(*FIT).code == 0
    assert Path("mine.yaml").read_text(encoding="utf-8").count("# fitted, +-") == 6
    start, fitted = (read_aircraft_file(one).aircraft for one in ("edge540", "mine.yaml"))
    ratios = fitted.roll.C_lxi / start.roll.C_lxi, fitted.yaw.C_nxi / start.yaw.C_nxi
    np.testing.assert_allclose(ratios, ratios[0], rtol=1e-4)
    assert fitted.point_mass.p == pytest.approx(np.radians(380.0), rel=0.03)
    assert fitted.roll.C_lp == start.roll.C_lp


def test_a_log_that_is_too_coarse_or_flies_elsewhere_is_told_what_is_missing() -> None:
    write_log(1.0)
    ran = airrace(*FIT)
    assert ran.code == 3
    assert "at least 4 per second" in ran.err
    elsewhere = airrace(*FIT[:3], "chiba_2015", *FIT[4:])
    assert elsewhere.code == 3
    assert "gates and pylons" in elsewhere.err
    assert not Path("mine.yaml").exists()


@pytest.mark.slow
def test_the_truth_lies_within_the_deviations() -> None:
    write_log(20.0)
    fitted = fit("log.csv", "rovinj_2014", aircraft="edge540")
    assert np.all(np.abs(fitted.estimate.factors) < 3.0 * fitted.estimate.deviations[:3])
