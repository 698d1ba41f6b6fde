"""Imported logs are verified like runs: what is stored of the flight has to follow from the log that is stored."""

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from command import run

import airrace
from airrace.files.checkpoint import LogCheckpoint, write_log
from airrace.flights.logs import smoothing as log_path
from airrace.flights.results import Verification
from airrace.optimal_control.trajectory import Array
from airrace.runs.flight_sources import open_flights
from airrace.runs.log_view import LogView, open_log
from airrace.runs.verification import verify_log

TRACK = """
schema: airrace/track/1
name: Straight
aircraft: edge540
rules: rbar-2016
gates:
  a: {type: level, north_m: 0, east_m: 0, heading_deg: 0}
  b: {type: level, north_m: 400, east_m: 0, heading_deg: 0}
  c: {type: level, north_m: 800, east_m: 0, heading_deg: 0}
course: {start: a, lap: [b], finish: c}
"""


@pytest.fixture(scope="module")
def view(tmp_path_factory: pytest.TempPathFactory) -> LogView:
    """A straight flight at 80 m/s, recorded at 10 Hz, too high at the second gate."""
    folder = tmp_path_factory.mktemp("log")
    (folder / "straight.yaml").write_text(TRACK)
    time = np.arange(-2.0, 13.0, 0.1)
    height = 20.0 + 15.0 * np.exp(-((time - 5.0) ** 2))
    rows = (f"{t:.1f},{80.0 * t:.2f},0,{h:.2f}" for t, h in zip(time, height, strict=True))
    (folder / "log.csv").write_text("\n".join(["time [s],north [m],east [m],height [m]", *rows]))
    return airrace.import_log(folder / "log.csv", folder / "straight.yaml", noise=0.05, accuracy=0.05)


def later(stored: LogCheckpoint) -> LogCheckpoint:
    first, *rest = stored.passings
    moved = [replace(one, time=one.time - 0.01) for one in rest]
    return replace(stored, passings=(first, *moved))


def forgiven(stored: LogCheckpoint) -> LogCheckpoint:
    return replace(stored, violations=())


def uncertain(stored: LogCheckpoint) -> LogCheckpoint:
    return replace(stored, violations=tuple(replace(one, deviation=10.0) for one in stored.violations))


def slower(stored: LogCheckpoint) -> LogCheckpoint:
    histories = [
        replace(one, values=one.values * (0.99 if one.quantity.name == "V_K" else 1.0)) for one in stored.histories
    ]
    return replace(stored, histories=tuple(histories))


def another_log(stored: LogCheckpoint) -> LogCheckpoint:
    columns = {**stored.log.columns, "x": stored.log.columns["x"] + 1.0}
    return replace(stored, log=replace(stored.log, columns=columns))


def test_what_was_imported_is_verified_from_its_file(view: LogView, tmp_path: Path) -> None:
    view.save(tmp_path / "flown.h5")
    assert any(one.certain for one in view.violations)
    result = run("verify", str(tmp_path / "flown.h5"), "--json")
    assert result.code == 0
    assert result.answer["verified"] is True
    shown = run("show", str(tmp_path / "flown.h5"), "--json").answer
    assert shown["verified"] is True
    shown = run("show", str(tmp_path / "flown.h5"), "--json", "--no-verify").answer
    assert shown["verified"] is None
    assert "not verified" in run("show", str(tmp_path / "flown.h5"), "--no-verify").out


@pytest.mark.parametrize("tamper", [later, forgiven, uncertain, slower, another_log])
def test_a_tampered_flight_is_found_out(
    view: LogView, tmp_path: Path, tamper: Callable[[LogCheckpoint], LogCheckpoint]
) -> None:
    path = tmp_path / "tampered.h5"
    write_log(path, tamper(view.recorded))
    for command in ("verify", "show"):
        result = run(command, str(path), "--json")
        assert result.code == 5
        assert result.answer["verified"] is False


def test_report_and_compare_refuse_a_tampered_flight(view: LogView, tmp_path: Path) -> None:
    view.save(tmp_path / "flown.h5")
    write_log(tmp_path / "tampered.h5", later(view.recorded))
    files = [str(tmp_path / one) for one in ("flown.h5", "tampered.h5")]
    compared = run("compare", *files)
    assert compared.code == 5
    assert "verification failed" in compared.out
    reported = run("report", files[1], "--output", str(tmp_path / "page.html"))
    assert reported.code == 5
    assert "recorded; verification failed" in (tmp_path / "page.html").read_text()


def test_a_flight_of_another_version_is_not_verified_unless_asked(view: LogView) -> None:
    other = open_log(replace(view.recorded, versions={**view.recorded.versions, "numpy": "0.1"}))
    assert verify_log(other).verified is None
    assert verify_log(other, versions=False).verified
    assert math.isnan(view.recorded.log.receiver.noise) is False


def test_logs_that_are_verified_and_judged_together_are_smoothed_once(
    view: LogView, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    smoothed: list[int] = []

    def counted(time: Array, places: Array, noise: float | None, least: Array) -> log_path.Path:
        smoothed.append(len(time))
        return log_path.smooth(time, places, noise, least)

    monkeypatch.setattr("airrace.flights.logs.log_flight.smooth", counted)
    files = [str(tmp_path / name) for name in ("a.h5", "b.h5")]
    for file in files:
        view.save(Path(file))
    flights = open_flights(files, verify=True)
    assert [flight.source.verification for flight in flights] == [Verification(True)] * 2
    assert len(smoothed) == 2
