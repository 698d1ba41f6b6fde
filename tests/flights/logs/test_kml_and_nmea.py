"""Tracks as KML and sentences of receivers: the flight is that of any other format, and what is damaged is left out."""

import functools
import io
import operator
import zipfile
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from airrace.errors import InputError
from airrace.flights.logs.quality import FixType
from airrace.flights.logs.reading import read_log
from airrace.flights.logs.recording import Recording
from airrace.optimal_control.quantities import KNOT

BEGIN = datetime(2014, 4, 13, 23, 59, 58, tzinfo=UTC)
COUNT = 40
CLOCK = [BEGIN + timedelta(seconds=0.2 * row) for row in range(COUNT)]
LATITUDE, LONGITUDE = 45.084 + 1.2e-4 * np.arange(COUNT), -13.623 + 1e-5 * np.arange(COUNT)
HEIGHT = 20.0 + 0.1 * np.arange(COUNT)
PLACES = [f"{lon:.8f},{lat:.8f},{up:.4f}" for lat, lon, up in zip(LATITUDE, LONGITUDE, HEIGHT, strict=True)]
WHENS = [f"{when:%Y-%m-%dT%H:%M:%S.%f}Z" for when in CLOCK]


def assert_same(recording: Recording, near: float = 1e-7) -> None:
    assert recording.begins == BEGIN
    assert recording.time == pytest.approx(0.2 * np.arange(COUNT), abs=1e-4)
    assert np.degrees(recording.columns["latitude"]) == pytest.approx(LATITUDE, abs=near)
    assert np.degrees(recording.columns["longitude"]) == pytest.approx(LONGITUDE, abs=near)
    assert recording.columns["altitude"] == pytest.approx(HEIGHT, abs=1e-3)


# KML


def kml(*marks: str, mode: str = "absolute") -> str:
    name_spaces = 'xmlns="http://www.opengis.net/kml/2.2" xmlns:gx="http://www.google.com/kml/ext/2.2"'
    body = "\n".join(f"<Placemark><name>run</name>{mark}</Placemark>" for mark in marks)
    body = body.replace("MODE", f"<altitudeMode>{mode}</altitudeMode>" if mode else "")
    return f'<?xml version="1.0"?>\n<kml {name_spaces}><Document><name>day</name>\n{body}\n</Document></kml>\n'


def track(places: Sequence[str] = PLACES, whens: Sequence[str] = WHENS, more: str = "") -> str:
    times = "\n".join(f"<when>{when}</when>" for when in whens)
    coords = "\n".join(f"<gx:coord>{place.replace(',', ' ')}</gx:coord>" for place in places)
    return f"<gx:Track>MODE{times}\n{coords}{more}</gx:Track>"


def interleaved() -> str:
    pairs = zip(WHENS, PLACES, strict=True)
    rows = [f"<when>{when}</when><gx:coord>{place.replace(',', ' ')}</gx:coord>" for when, place in pairs]
    return "<gx:Track>MODE" + "\n".join(rows) + "</gx:Track>"


def stamped_point(when: str, place: str) -> str:
    point = f"<Point>MODE<coordinates>{place}</coordinates></Point>"
    return f"<TimeStamp><when>{when}</when></TimeStamp>{point}"


def timed_piece(row: int) -> str:
    span = f"<TimeSpan><begin>{WHENS[row]}</begin><end>{WHENS[row + 1]}</end></TimeSpan>"
    return f"{span}<LineString>MODE<coordinates>\n{PLACES[row]} {PLACES[row + 1]}\n</coordinates></LineString>"


LINE = f"<LineString>MODE<coordinates>{' '.join(PLACES)}</coordinates></LineString>"
DOCUMENTS = {
    "track": kml(track()),
    "interleaved": kml(interleaved()),
    "behind a line": kml(LINE, track()),
    "of several parts": kml(
        f"<gx:MultiTrack>{track(PLACES[:9], WHENS[:9])}{track(PLACES[9:], WHENS[9:])}</gx:MultiTrack>"
    ),
    "KML 2.3": kml(track()).replace("gx:", ""),
    "points": kml(*map(stamped_point, WHENS, PLACES)),
    "pieces of a line": kml(*map(timed_piece, range(0, COUNT, 2))),
    "without a mode": kml(track(), mode=""),
}


@pytest.mark.parametrize("name", DOCUMENTS)
@pytest.mark.parametrize("zipped", [False, True], ids=["KML", "KMZ"])
def test_a_track_is_read_however_it_is_drawn(tmp_path: Path, name: str, zipped: bool) -> None:
    content = DOCUMENTS[name].encode()
    if zipped:
        archive = io.BytesIO()
        with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED) as folder:
            folder.writestr("files/model.txt", "no track")
            folder.writestr("doc.kml", content)
        content = archive.getvalue()
    path = tmp_path / "log"
    path.write_bytes(content)
    assert_same(read_log(path))


def read_text(folder: Path, text: str) -> Recording:
    path = folder / "log"
    path.write_text(text)
    return read_log(path)


def test_places_without_a_fix_are_left_out_and_counted(tmp_path: Path) -> None:
    places = [*PLACES[:5], "", "", *PLACES[7:]]
    recording = read_text(tmp_path, kml(track(places)))
    assert len(recording.time) == COUNT - 2
    assert np.degrees(recording.columns["latitude"]).min() > 45.0
    assert any("2 points are left out" in remark and "has no position" in remark for remark in recording.remarks)


def test_angles_are_heading_pitch_and_roll_and_zeros_are_none(tmp_path: Path) -> None:
    turned = "".join(f"<gx:angles>{10 + row} {row} {-row}</gx:angles>" for row in range(COUNT))
    columns = read_text(tmp_path, kml(track(more=turned))).columns
    for name, expected in (("psi", 10.0 + np.arange(COUNT)), ("theta", np.arange(COUNT)), ("phi", -np.arange(COUNT))):
        assert np.degrees(columns[name]) == pytest.approx(expected)
    level = "<gx:angles>0 0 0</gx:angles>" * COUNT
    assert not {"psi", "theta", "phi"} & read_text(tmp_path, kml(track(more=level))).columns.keys()


def test_heights_count_from_where_their_mode_says(tmp_path: Path) -> None:
    assert "height" in read_text(tmp_path, kml(track(), mode="relativeToGround")).columns
    flat = [place.rpartition(",")[0] + ",0" for place in PLACES]
    assert not {"height", "altitude"} & read_text(tmp_path, kml(track(flat), mode="clampToGround")).columns.keys()


def test_a_line_without_times_is_refused_with_what_would_be_right(tmp_path: Path) -> None:
    for text in (kml(LINE), kml(track(whens=[])), kml("<Point><coordinates>1,2</coordinates></Point>")):
        with pytest.raises(InputError, match=r"KML without times.*gx:Track"):
            read_text(tmp_path, text)


def test_a_cut_file_is_read_as_far_as_it_goes(tmp_path: Path) -> None:
    text = kml(interleaved())
    recording = read_text(tmp_path, text[: len(text) // 2])
    assert COUNT // 3 < len(recording.time) < COUNT
    assert any("is no XML" in remark for remark in recording.remarks)


# NMEA


def sentence(content: str) -> str:
    return f"${content}*{functools.reduce(operator.xor, content.encode(), 0):02X}"


def packed(angle: float, digits: int) -> str:
    whole, part = divmod(abs(angle), 1.0)
    return f"{int(whole):0{digits}d}{60.0 * part:010.7f}"


def place_fields(row: int) -> str:
    return f"{packed(LATITUDE[row], 2)},N,{packed(LONGITUDE[row], 3)},W"


def rmc(row: int, talker: str = "GN", status: str = "A") -> str:
    when = CLOCK[row]
    time = f"{when:%H%M%S}.{when.microsecond // 10000:02d}"
    return sentence(f"{talker}RMC,{time},{status},{place_fields(row)},100.0,0,{when:%d%m%y},,,A")


def gga(row: int, talker: str = "GN", quality: int = 1) -> str:
    when = CLOCK[row]
    time = f"{when:%H%M%S}.{when.microsecond // 10000:02d}"
    return sentence(f"{talker}GGA,{time},{place_fields(row)},{quality},12,0.8,{HEIGHT[row]:.4f},M,44.6,M,,")


def gns(row: int) -> str:
    when = CLOCK[row]
    time = f"{when:%H%M%S}.{when.microsecond // 10000:02d}"
    return sentence(f"GNGNS,{time},{place_fields(row)},RN,12,0.8,{HEIGHT[row]:.4f},44.6,,")


ROWS = range(COUNT)
GSV, GSA = sentence("GPGSV,1,1,01,05,40,083,46"), sentence("GNGSA,A,3,05,,,,,,,,,,,,1.7,0.8,1.5")
ZDA = sentence(f"GNZDA,235959.00,{CLOCK[0]:%d,%m,%Y},00,00")
STREAMS = {
    "RMC before GGA": [line for row in ROWS for line in (rmc(row), gga(row), GSV, GSA)],
    "GGA before RMC": [line for row in ROWS for line in (gga(row), rmc(row))],
    "of two talkers": [line for row in ROWS for line in (gga(row, "GN"), rmc(row, "GP"))],
    "GNS": [line for row in ROWS for line in (gns(row), rmc(row))],
    "a date now and then": [line for row in ROWS for line in ([gga(row)] if row % 9 else [gga(row), rmc(row)])],
    "behind a logger's time": [f"[12:00:00] {line}" for row in ROWS for line in (rmc(row), gga(row))],
    "with the date of another second": [line for row in ROWS for line in (gga(row), ZDA, rmc(row))],
    "without checksums": [line.partition("*")[0] for row in ROWS for line in (rmc(row), gga(row))],
}


@pytest.mark.parametrize("name", STREAMS)
def test_sentences_of_one_time_are_one_sample(tmp_path: Path, name: str) -> None:
    recording = read_text(tmp_path, "\r\n".join(STREAMS[name]) + "\r\n")
    assert_same(recording, 2e-8)
    if "V_G" in recording.columns:
        assert np.nanmax(np.abs(recording.columns["V_G"] - 100.0 * KNOT)) < 1e-9


def test_a_sentence_whose_checksum_is_wrong_or_missing_is_left_out(tmp_path: Path) -> None:
    lines = list(STREAMS["RMC before GGA"])
    lines[41] = lines[41].replace(",N,", ",S,")
    lines[61] = lines[61][:30]
    recording = read_text(tmp_path, "\n".join(lines))
    assert np.degrees(recording.columns["latitude"]) == pytest.approx(LATITUDE, abs=2e-8)  # RMC tells it, too
    assert np.flatnonzero(np.isnan(recording.columns["altitude"])).tolist() == [10, 15]
    assert any("line 42: is damaged: its checksum is" in remark for remark in recording.remarks)
    assert any("line 62: is cut" in remark for remark in recording.remarks)


def test_a_fix_that_one_sentence_warns_of_is_none(tmp_path: Path) -> None:
    lines = [line for row in ROWS for line in (rmc(row, status="V" if row in (3, 4) else "A"), gga(row))]
    columns = read_text(tmp_path, "\n".join(lines)).columns
    assert np.flatnonzero(np.isnan(columns["latitude"])).tolist() == [3, 4]


def test_the_quality_of_a_fix_is_told(tmp_path: Path) -> None:
    lines = [line for row in ROWS for line in (rmc(row), gga(row, quality=5 if row > 20 else 4))]
    columns = read_text(tmp_path, "\n".join(lines)).columns
    assert columns["fix_type"].tolist() == [FixType.FLOAT if row > 20 else FixType.FIXED for row in ROWS]
    assert set(columns["satellites"]) == {12.0}


def test_sentences_without_heights_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="NMEA without heights: expected GGA or GNS"):
        read_text(tmp_path, "\n".join(rmc(row) for row in ROWS))
