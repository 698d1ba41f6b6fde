"""Columns are recognised without a mapping, and named ones come on top: every spelling gives the same recording."""

import re
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from airrace.errors import InputError
from airrace.files.inputs.log_columns import with_columns, with_zone
from airrace.flights.logs.angles import parse_angle, parse_pair
from airrace.flights.logs.csv_log import ColumnLayout
from airrace.flights.logs.reading import read_log
from airrace.flights.logs.recording import Recording

BEGIN = datetime(2014, 4, 13, 13, 59, 54, tzinfo=UTC)
CLOCK = [BEGIN + timedelta(seconds=0.2 * row) for row in range(30)]
LATITUDE, LONGITUDE = 45.084 + 1.2e-4 * np.arange(30), 13.623 + 1e-5 * np.arange(30)
HEIGHT = 20.0 + 0.1 * np.arange(30)
FOOT = 0.3048


def read(folder: Path, header: str, row: str, *columns: str, zone: str = "") -> Recording:
    """A log whose rows are a format of time, latitude, longitude, and height in metres and feet."""
    lines = [
        row.format(t=when, lat=lat, lon=lon, m=up, ft=up / FOOT, unix=when.timestamp())
        for when, lat, lon, up in zip(CLOCK, LATITUDE, LONGITUDE, HEIGHT, strict=True)
    ]
    path = folder / "log.csv"
    path.write_text("\n".join([header, *lines]) + "\n")
    layout = with_columns(ColumnLayout(), columns)
    return read_log(path, with_zone(layout, zone) if zone else layout)


def assert_same(recording: Recording) -> None:
    assert np.degrees(recording.columns["latitude"]) == pytest.approx(LATITUDE, abs=1e-7)
    assert np.degrees(recording.columns["longitude"]) == pytest.approx(LONGITUDE, abs=1e-7)
    assert recording.columns["altitude"] == pytest.approx(HEIGHT, abs=1e-3)
    assert recording.time == pytest.approx(0.2 * np.arange(30), abs=1e-3)


SPELLINGS = {
    "date and time": (
        "Date,UTC Time,Lat,Lon,GPS Alt [ft]",
        "{t:%Y-%m-%d},{t:%H:%M:%S.%f},{lat:.8f},{lon:.8f},{ft:.4f}",
    ),
    "day first": ("UTC Date,GPS Time,Lat,Lon,Alt [m]", "{t:%d.%m.%Y},{t:%H:%M:%S.%f},{lat:.8f},{lon:.8f},{m:.4f}"),
    "month first": ("Alt [m],Date,UTC Time,Lat,Lon", "{m:.4f},{t:%m/%d/%Y},{t:%H:%M:%S.%f},{lat:.8f},{lon:.8f}"),
    "six digits": ("Date,Time (UTC),Lat,Lon,Alt [m]", "{t:%d%m%y},{t:%H:%M:%S.%f},{lat:.8f},{lon:.8f},{m:.4f}"),
    "in one cell": ("Time,Lat,Lon,Alt [m]", "{t:%d.%m.%Y %H:%M:%S.%f},{lat:.8f},{lon:.8f},{m:.4f}"),
    "position": ("Position,Altitude [ft],Timestamp", '"{lat:.8f},{lon:.8f}",{ft:.4f},{unix:.3f}'),
    "position with sides": ("Timestamp,Lat/Lon,Altitude [m]", "{unix:.3f},{lat:.8f}N {lon:.8f}E,{m:.4f}"),
    "FlightRadar24": (
        "\nTimestamp,UTC,Callsign,Position,Altitude,Speed,Direction",
        '{unix:.3f},{t:%Y-%m-%dT%H:%M:%S}Z,T1,"{lat:.8f},{lon:.8f}",{ft:.4f},130,67',
    ),
    "FlightRadar24 in metres": (
        "Timestamp;Position;Altitude (m);Direction;Speed (km/h)",
        "{unix:.3f};{lat:.8f},{lon:.8f};{m:.4f};67;240",
    ),
    "German": ("Datum;Uhrzeit;Breite;Länge;Höhe [m]", "{t:%d.%m.%Y};{t:%H:%M:%S.%f};{lat:.8f};{lon:.8f};{m:.4f}"),
}


@pytest.mark.parametrize("name", SPELLINGS)
def test_time_with_its_date_and_place_are_recognised(tmp_path: Path, name: str) -> None:
    recording = read(tmp_path, *SPELLINGS[name])
    assert_same(recording)
    assert recording.begins is not None
    assert abs((recording.begins - BEGIN).total_seconds()) < 1e-3


@pytest.mark.parametrize(
    ("header", "row", "columns"),
    [
        ("Time,Lat,Lon,Up", "{unix:.3f},{lat:.8f},{lon:.8f},{m:.4f}", ["altitude=Up [m]"]),
        ("Time,Lat,Lon,Alt,Up", "{unix:.3f},{lat:.8f},{lon:.8f},0,{m:.4f}", ["altitude=Up [m]"]),
        ("Time,Lat,Lon,Height,Up", "{unix:.3f},{lat:.8f},{lon:.8f},0,{m:.4f}", ["altitude=Up [m]"]),
        ("Time,Where,Alt", '{unix:.3f},"{lon:.8f},{lat:.8f}",{m:.4f}', ["position=Where [lon lat]"]),
        ("Time,Lat,Lon,P,Alt", '{unix:.3f},0,0,"{lat:.8f},{lon:.8f}",{m:.4f}', ["position=P"]),
    ],
    ids=["the one that is missing", "another one", "of another zero", "longitude first", "instead of two"],
)
def test_a_named_column_comes_on_top_of_those_that_are_recognised(
    tmp_path: Path, header: str, row: str, columns: Sequence[str]
) -> None:
    assert_same(read(tmp_path, header, row, *columns))


def test_a_header_that_is_named_means_nothing_else(tmp_path: Path) -> None:
    recording = read(
        tmp_path, "Time,Lat,Lon,Alt,Roll", "{unix:.3f},{lat:.8f},{lon:.8f},{m:.4f},{m:.4f}", "pitch=Roll [deg]"
    )
    assert np.degrees(recording.columns["theta"]) == pytest.approx(HEIGHT, abs=1e-3)
    assert "phi" not in recording.columns


def test_a_date_counts_in_the_zone_of_its_clock(tmp_path: Path) -> None:
    row = "{t:%Y-%m-%d},{t:%H:%M:%S.%f},{lat:.8f},{lon:.8f},{m:.4f}"
    local = read(tmp_path, "Date,Time,Lat,Lon,Alt [m]", row, zone="+02:00")
    assert local.begins == BEGIN - timedelta(hours=2)
    own = read(tmp_path, "Date,UTCOfst,Time,Lat,Lon,Alt [m]", row.replace(",", ",-04:00,", 1))
    assert own.begins == BEGIN + timedelta(hours=4)
    unknown = read(tmp_path, "Date,Time,Lat,Lon,Alt [m]", row)
    assert unknown.begins == BEGIN
    assert any("name no zone and are taken as UTC" in remark for remark in unknown.remarks)


def test_an_ambiguous_date_is_told_and_a_wrong_one_not_used(tmp_path: Path) -> None:
    row = "{date},{{t:%H:%M:%S.%f}},{{lat:.8f}},{{lon:.8f}},{{m:.4f}}"
    header = "Date,UTC Time,Lat,Lon,Alt [m]"
    ambiguous = read(tmp_path, header, row.format(date="04/05/2014"))
    assert ambiguous.begins == BEGIN.replace(month=5, day=4)
    assert any("taken as day/month/year" in remark for remark in ambiguous.remarks)
    stated = read(tmp_path, header, row.format(date="04/05/2014"), "date=Date [mdy]")
    assert stated.begins == BEGIN.replace(month=4, day=5)
    wrong = read(tmp_path, header, row.format(date="soon"))
    assert wrong.begins is None
    assert any("`soon`" in remark for remark in wrong.remarks)


def test_a_position_that_is_none_is_refused_with_its_line(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="`nowhere`"):
        read(tmp_path, "Time,Position,Alt", "{unix:.3f},nowhere,{m:.4f}")


def test_an_angle_is_the_same_in_every_spelling() -> None:
    spellings = ("-7.505", "7.505 W", "W007.505", "7°30'18\" W", "007:30:18 W", "7 30.3W")
    assert [parse_angle(text) for text in spellings] == pytest.approx([-7.505] * len(spellings))
    pairs = ("46.5,-7.505", "(46.5 -7.505)", "46°30'N, 7°30'18\"W", "N46 30 W7 30 18", "46:30 N 7:30:18 W")
    assert [parse_pair(text) for text in pairs] == [pytest.approx((46.5, -7.505))] * len(pairs)
    for text in ("", "north", "46 61 N", "1.2.3"):
        with pytest.raises(ValueError, match=re.escape(text) or "^$"):
            parse_angle(text)
