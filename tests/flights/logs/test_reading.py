"""Logs of all formats are read alike; what is wrong with one is said with its line, and what would be right."""

import gzip
import io
import math
import zipfile
from collections.abc import Callable
from datetime import UTC, datetime, timedelta, timezone
from pathlib import Path

import numpy as np
import pytest
from synthetic import BEGIN, Fixes, acmi_text, csv_text, fixes, gpx_text, igc_text, on_globe, race

from airrace.errors import InputError, UsageError
from airrace.files.inputs import load_inputs
from airrace.files.inputs.log_columns import read_layout, with_columns
from airrace.flights.logs.csv_log import ColumnLayout
from airrace.flights.logs.log_flight import flight_from_log
from airrace.flights.logs.passings import in_frame, in_order
from airrace.flights.logs.reading import read_log
from airrace.flights.logs.recording import Recording
from airrace.optimal_control.quantities import KNOT

SEEN = fixes(5.0)


def read(folder: Path, text: str, name: str = "log.csv", layout: ColumnLayout | None = None) -> Recording:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return read_log(path, layout)


def refused(folder: Path, text: str | bytes, name: str = "log.csv", layout: ColumnLayout | None = None) -> str:
    path = folder / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(InputError) as caught:
        read_log(path, layout)
    assert len(caught.value.findings) == 1
    return str(caught.value).removeprefix(f"{folder}/")


@pytest.mark.parametrize(
    ("write", "name"),
    [(csv_text, "log.csv"), (gpx_text, "log.gpx"), (acmi_text, "log.acmi"), (igc_text, "log.igc")],
)
def test_all_formats_tell_the_same_flight(tmp_path: Path, write: Callable[[Fixes], str], name: str) -> None:
    placed = in_frame(in_order(read(tmp_path, write(SEEN), name)), race())
    near = 2e-3 if name.endswith("igc") else 1e-3
    assert placed.time == pytest.approx(SEEN.time - SEEN.time[0], abs=2e-3)
    assert placed.columns["x"] == pytest.approx(SEEN.north, abs=near)
    assert placed.columns["y"] == pytest.approx(SEEN.east, abs=near)
    assert placed.columns["height"] == pytest.approx(SEEN.height, abs=0.51 if name.endswith("igc") else near)
    if name.endswith("csv"):
        assert placed.begins is None
    else:
        late = 10.0 if name.endswith("acmi") else 0.0  # the test's recording begins ten seconds after its reference
        assert placed.begins is not None
        assert (placed.begins - BEGIN).total_seconds() == pytest.approx(float(SEEN.time[0]) + late, abs=2e-3)


def packed(text: str, name: str = "log.acmi", method: int = zipfile.ZIP_DEFLATED) -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", method) as archive:
        archive.writestr(name, text)
    return file.getvalue()


def test_a_zipped_recording_is_read(tmp_path: Path) -> None:
    path = tmp_path / "log.zip.acmi"
    path.write_bytes(packed(acmi_text(SEEN), "../../evil.acmi"))
    assert len(read_log(path).time) == len(SEEN.time)


def test_one_aircraft_of_several_is_chosen(tmp_path: Path) -> None:
    other = "b2,Name=MXS-R,Type=Air+FixedWing,T=0.5|0.1|100\n"
    text = acmi_text(SEEN) + other + "#99\nb2,T=0.6||\n"
    (tmp_path / "two.acmi").write_text(text)
    assert "2 aircraft" in read_log(tmp_path / "two.acmi").remarks[0]
    chosen = read_log(tmp_path / "two.acmi", aircraft="MXS-R")
    assert np.degrees(chosen.columns["longitude"]) == pytest.approx([13.5, 13.6])
    assert np.degrees(chosen.columns["latitude"]) == pytest.approx([45.1, 45.1])  # left out: as before
    with pytest.raises(InputError, match=r"`Extra` *; it has|holds no flight of `Extra`"):
        read_log(tmp_path / "two.acmi", aircraft="Extra")


def test_a_mapping_names_columns_units_and_zone(tmp_path: Path) -> None:
    latitude, longitude, up = on_globe(SEEN)
    rows = [
        f"{(BEGIN + timedelta(seconds=float(t), hours=2)).replace(tzinfo=None).isoformat()};{lat:.9f};{lon:.9f};"
        f"{alt / 0.3048:.4f};{180.0 + index:.1f};4,5".replace(".", ",")
        for index, (t, lat, lon, alt) in enumerate(zip(SEEN.time, latitude, longitude, up, strict=True))
    ]
    mapping = tmp_path / "receiver.yaml"
    mapping.write_text(
        "schema: airrace/log/1\ndelimiter: semicolon\ndecimal: comma\ntime_zone: +02:00\nposition_noise_m: 0.7\n"
        "columns:\n  time: Zeit [iso]\n  latitude: B\n  longitude: L\n  altitude: H [ft]\n"
        "  true_airspeed: Fahrt [kt]\n  load_factor: g\n"
    )
    layout, noise = read_layout(mapping)
    text = "\n".join(["Zeit;B;L;H;Fahrt;g", *rows]) + "\n"
    recording = read(tmp_path, text, layout=layout)
    assert noise == 0.7
    assert recording.begins == pytest.approx(
        BEGIN + timedelta(seconds=float(SEEN.time[0])), abs=timedelta(seconds=1e-3)
    )
    assert np.degrees(recording.columns["latitude"]) == pytest.approx(latitude, abs=1e-8)
    assert recording.columns["altitude"] == pytest.approx(up, abs=1e-3)
    assert recording.columns["V_A"][0] == pytest.approx(180.0 * KNOT)
    assert recording.columns["n_z"] == pytest.approx(4.5)


@pytest.mark.parametrize(
    ("times", "seconds"),
    [
        (("12.5", "13.25"), 0.75),
        (("23:59:59.5", "00:00:01"), 1.5),
        (("2014-04-13T12:00:00Z", "2014-04-13T14:00:02+02:00"), 2.0),
        (("2016-12-31T23:59:59Z", "2016-12-31T23:59:60Z"), 1.0),
        (("2016-12-31T23:59:60Z", "2017-01-01T00:00:01Z"), 1.0),
        (("1397390400.25", "1397390401"), 0.75),
        (("1397390400250", "1397390401000"), 0.75),
    ],
)
def test_times_are_read_as_they_are_written(tmp_path: Path, times: tuple[str, str], seconds: float) -> None:
    recording = read(tmp_path, "time,x,y,height\n" + "".join(f"{one},1,2,3\n" for one in times))
    assert recording.time.tolist() == pytest.approx([0.0, seconds])


def test_a_zone_moves_times_that_name_none(tmp_path: Path) -> None:
    text = "time,x,y,height\n2014-04-13T12:00:00,1,2,3\n2014-04-13T12:00:01,1,2,3\n"
    naive = read(tmp_path, text)
    assert naive.begins == datetime(2014, 4, 13, 12, tzinfo=UTC)
    assert naive.remarks == ("times name no zone and are taken as UTC",)
    zoned = read(tmp_path, text, layout=ColumnLayout(zone=timezone(timedelta(hours=2))))
    assert zoned.begins == datetime(2014, 4, 13, 10, tzinfo=UTC)


def test_units_of_headers_are_understood(tmp_path: Path) -> None:
    text = "Timestamp;lat [deg];Lon;Altitude (ft);gs_kt;roll_deg\n0;45.0;13.0;100;200;90\n1;45.0;13.0;100;200;90\n"
    columns = read(tmp_path, text).columns
    assert columns["altitude"][0] == pytest.approx(30.48)
    assert columns["V_G"][0] == pytest.approx(200.0 * KNOT)
    assert columns["phi"][0] == pytest.approx(math.pi / 2)


def test_silent_cells_and_repeated_times_are_left_out_and_reported(tmp_path: Path) -> None:
    text = "time,x,y,height\n0,1,2,3\n1,,,\n2,1,2,3\n2,5,5,5\n3,1,2,3\n"
    kept = in_order(read(tmp_path, text))
    assert kept.time.tolist() == [0.0, 2.0, 3.0]
    assert kept.remarks == (
        "1 sample is without a position and left out",
        "1 sample is left out for coming less than 0.1 ms behind another",
    )


HEAD = "time,x,y,height\n0,1,2,3\n"
ACMI = "FileType=text/acmi/tacview\nFileVersion=2.2\n"
ZIPPED = packed(acmi_text(SEEN))
LZMA, BZIP2 = (packed(acmi_text(SEEN), method=method) for method in (zipfile.ZIP_LZMA, zipfile.ZIP_BZIP2))
METHOD = "neither stored nor deflated (method {}); pack it again"
GPX = '<gpx><trk><trkseg><trkpt lat="1" lon="2"><ele>3</ele>{}</trkpt></trkseg></trk></gpx>'


@pytest.mark.parametrize(
    ("text", "name", "said"),
    [
        ("t1,x,y,height\n0,1,2,3\n", "a.csv", "a.csv:1:1: has no column of time; its columns are `t1`, `x`"),
        ("time,x,height\n0,1,2\n", "a.csv", "a.csv:1:1: has no position: expected latitude and longitude, or north"),
        ("time,x,y\n0,1,2\n", "a.csv", "a.csv:1:1: has no height; its columns are"),
        (HEAD + "1,abc,2,3\n", "a.csv", "a.csv:3:1: x: `abc` is no number"),
        (HEAD + "soon,1,2,3\n", "a.csv", "a.csv:3:1: time: `soon` is no time; expected one such as"),
        (HEAD + ",1,2,3\n", "a.csv", "a.csv:3:1: time: `` is no time"),
        (HEAD + "nan,1,2,3\n", "a.csv", "a.csv:3:1: time: `nan` is no time"),
        ("", "a.csv", "a.csv: has no column of time"),
        ("time,x,y,height\n", "a.csv", "a.csv: holds no samples; expected one row for every instant"),
        ("\0\0\0\0", "a.csv", "a.csv: is no log: expected CSV, GPX, KML, NMEA, IGC, ACMI or FIT"),
        (GPX.format(""), "a.gpx", "a.gpx:1:1: time: a point of the track has no time"),
        (GPX.format("<time>noon</time>"), "a.gpx", "a.gpx:1:1: time: `noon` is no time; expected one such as 2016"),
        ("<gpx></gpx>", "a.gpx", "a.gpx: holds no recorded track"),
        ("<gpx><trk>", "a.gpx", "a.gpx:1:1: is no XML: no element found"),
        ('<!DOCTYPE a [<!ENTITY b "c">]><gpx/>', "a.gpx", "a.gpx:1:1: holds a document type; such a file needs none"),
        ("AXXX\nB12345\n", "a.igc", "a.igc:2:1: is no fix of a flight recorder: `B12345`"),
        ("AXXX\n", "a.igc", "a.igc: holds no fixes (B records)"),
        ("FileType=text/acmi/tacview\nFileVersion=3\n", "a.acmi", "a.acmi:2:1: expected `FileVersion=2.x`"),
        (ACMI + "a,T=1|2\n", "a.acmi", "a.acmi:3:1: T: a place has 2 values"),
        (ACMI + "a,T=x|2|3\n", "a.acmi", "a.acmi:3:1: T: `x` is no number"),
        (ACMI, "a.acmi", "a.acmi: holds no flight of an aircraft; it has"),
        (b"x" * 2_000_000, "a.csv", "a.csv:1:1: has a line without end"),
        (b"PK\x03\x04" + bytes(100), "a.zip", "a.zip: is a damaged archive"),
        (ZIPPED[:200] + bytes(range(60)) + ZIPPED[260:], "a.zip", "a.zip: is a damaged archive"),
        (packed(ACMI + "1,T=13|45|100\n" * 1_000_000), "a.zip", "is packed to less"),
        (LZMA, "a.zip", METHOD.format(14)),
        (BZIP2, "a.zip", METHOD.format(12)),
        (packed("nothing", "readme.md"), "a.zip", "is an archive without an ACMI recording"),
        ("<gpx>" + "<a>" * 300, "a.gpx", "more than 200 deep"),
        (b",".join([b"time (s)"] * 90_000) + b"\n1,2\n", "a.csv", "has no column of time"),
        (gzip.compress(b"\0" * 1000, mtime=0) + b"\0", "c.gz", "c.gz: this is compressed; unpack it"),
    ],
    ids=lambda value: None if len(value) < 100 else "long",
)
def test_what_is_wrong_is_said_with_its_line(tmp_path: Path, text: str | bytes, name: str, said: str) -> None:
    message = refused(tmp_path, text, name)
    assert message.startswith(said) if said.startswith(name) else said in message


def test_files_without_a_recording_and_with_too_many_samples_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(InputError, match="no such file"):
        read_log(tmp_path / "missing.csv")
    with pytest.raises(InputError, match="is not a file"):
        read_log(tmp_path)
    layout = with_columns(ColumnLayout(), ["time=time", "north=x", "east=why", "height=height"])
    assert refused(tmp_path, HEAD, layout=layout).startswith("log.csv:1:1: has no column `why` for east; its columns")
    monkeypatch.setattr("airrace.flights.logs.recording.SAMPLES_MAX", 3)
    said = refused(tmp_path, HEAD + "".join(f"{row},1,2,3\n" for row in range(1, 9)))
    assert said == "log.csv:5:1: holds more than 3 samples; cut the log to the flight"


@pytest.mark.parametrize(
    ("column", "said"),
    [
        ("alt=H", "`alt` is nothing that is read from a log; known are time, date"),
        ("altitude=H [kg]", "`kg` is no unit of altitude; known are m, ft, km"),
        ("altitude", "expected NAME=HEADER"),
    ],
)
def test_columns_that_are_not_understood_are_said(column: str, said: str) -> None:
    with pytest.raises(UsageError, match="--column") as caught:
        with_columns(ColumnLayout(), [column])
    assert said in str(caught.value)


def test_faults_of_a_mapping_are_said_with_their_lines(tmp_path: Path) -> None:
    path = tmp_path / "m.yaml"
    path.write_text("schema: airrace/log/1\ntime_zone: Mars/Crater\ncolumns:\n  alt: H\n  altitude: H [kg]\n")
    with pytest.raises(InputError) as caught:
        read_layout(path)
    assert [one.line for one in caught.value.findings] == [2, 4, 5]


def test_another_course_is_refused(tmp_path: Path) -> None:
    text = csv_text(SEEN)
    with pytest.raises(InputError, match="passes less than half of the 15 gates and pylons of Chiba 2015"):
        flight_from_log(read(tmp_path, text), load_inputs("chiba_2015").race, label="log")
    with pytest.raises(InputError, match="is nowhere within 10 km of the course Rovinj 2014"):
        flight_from_log(read(tmp_path, "time,lat,lon,alt\n0,13,45,3\n1,13,45,3\n"), race(), label="log")
    with pytest.raises(InputError, match="there is no run 2"):
        flight_from_log(read(tmp_path, text), race(), label="log", run=2)
