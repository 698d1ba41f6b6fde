"""Aircraft fitted to logs: the file, what is told, and logs that tell too little."""

from pathlib import Path

import numpy as np
import pytest
import synthetic
from command import run as airrace

import airrace.runs.fit as fitting
from airrace.inputs.aircraft_file import read_aircraft_file

pytestmark = pytest.mark.usefixtures("folder")


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def write_log(hz: float) -> None:
    fixes = synthetic.fixes(hz, noise=1.0)
    columns = np.stack([fixes.time + 10.0, fixes.north, fixes.east, fixes.height], axis=1)
    np.savetxt("log.csv", columns, "%.3f", ",", header="time [s],north [m],east [m],height [m]", comments="")


FIT = ("fit", "log.csv", "--course", "rovinj_2014", "--aircraft", "edge540", "--output", "mine.yaml")


def test_the_file_says_what_was_fitted_and_what_was_not(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fitting, "_corrected", lambda found, *_: (found, np.zeros(3)))
    write_log(5.0)
    ran = airrace(*FIT)
    assert ran.code == 0, ran.err
    text = Path("mine.yaml").read_text(encoding="utf-8")
    assert text.count("# fitted, +-") == 3
    assert "C_lp: -0.45" in text
    fitted = read_aircraft_file("mine.yaml").aircraft
    assert fitted.drag.C_D0 != read_aircraft_file("edge540").aircraft.drag.C_D0
    assert "positions do not show roll rate" in ran.out
    assert airrace("check", "rovinj_2014", "--aircraft", "mine.yaml").code == 0
    assert airrace(*FIT).code == 2  # the file exists


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
    fitted = fitting.fit("log.csv", "rovinj_2014", aircraft="edge540")
    assert np.all(np.abs(fitted.estimate.factors) < 3.0 * fitted.estimate.deviations[:3])
