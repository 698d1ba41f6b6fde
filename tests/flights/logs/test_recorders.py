"""Logs as recorders write them: whatever cannot be read is left out and told, and the flight is the same."""

import math
import re
from collections.abc import Sequence
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from synthetic import BEGIN, Fixes, acmi_text, fixes, gpx_text, igc_text, known, on_globe, race

from airrace.errors import InputError
from airrace.files.inputs.log_columns import with_columns
from airrace.flights.logs.csv_log import ColumnLayout
from airrace.flights.logs.log_flight import LogFlight, flight_from_log
from airrace.flights.logs.reading import read_log
from airrace.optimal_control.trajectory import Array

EXACT = fixes(20.0, noise=0.02, gap=(0.0, 0.0))
LATITUDE, LONGITUDE, ALTITUDE = on_globe(EXACT)
CLOCK = [BEGIN + timedelta(seconds=float(one)) for one in EXACT.time]
HEADERS = ("time", "latitude", "longitude", "altitude")
FOOT = 0.3048
ANGLES = [
    np.degrees(np.interp(EXACT.time, known().time, np.unwrap(known().histories[name])))
    for name in ("mu", "gamma", "chi")
]


def rows(
    times: Sequence[object] = (),
    altitude: Array = ALTITUDE,
    *more: Array,
    places: tuple[Array, Array] = (LATITUDE, LONGITUDE),
) -> list[str]:
    first = times or [f"{one + 100.0:.3f}" for one in EXACT.time]
    columns = (places[0], places[1], altitude, *more)
    return [",".join([str(when), *(f"{one:.8f}" for one in row)]) for when, *row in zip(first, *columns, strict=True)]


def text(lines: Sequence[str], head: str = ",".join(HEADERS)) -> str:
    return "\n".join([head, *lines]) + "\n"


def imported(folder: Path, content: str | bytes, name: str = "log.csv", columns: Sequence[str] = ()) -> LogFlight:
    path = folder / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return flight_from_log(read_log(path, with_columns(ColumnLayout(), columns)), race(), label="log")


def assert_same_flight(one: LogFlight, near: float = 0.002) -> None:
    """The passings of the optimum, none of them missing, and no rule broken for certain."""
    begin = known().passings["0:g0"]
    assert {crossing.name for crossing in one.flight.crossings if crossing.found} == set(known().passings)
    for crossing in one.flight.crossings:
        assert crossing.time == pytest.approx(known().passings[crossing.name] - begin, abs=near)
    assert [breach for breach in one.violations if breach.certain] == []


def replaced(lines: Sequence[str], changes: dict[int, str]) -> list[str]:
    return [changes.get(row, line) for row, line in enumerate(lines)]


def moved(row: int, seconds: float) -> str:
    """A row with another time."""
    when, _, rest = rows()[row].partition(",")
    return f"{float(when) + seconds:.3f},{rest}"


LINES = rows()
BAD_ROWS: dict[str, tuple[list[str], str]] = {
    "no time": (
        [*LINES[:9], ",,,", " , , ,", *LINES[9:]],
        "2 samples are left out, the first one in line 11: `` is no time",
    ),
    "dashes": (
        replaced(LINES, {300: "---,---,---,---"}),
        "1 sample is left out, the first one in line 302: `---` is no",
    ),
    "no number": (
        replaced(LINES, {300: LINES[300].rpartition(",")[0] + ",N/A"}),
        "1 value of `altitude` is left out, the first one in line 302: `N/A` is no number",
    ),
    "not finite": (
        replaced(LINES, {300: "inf,1,2,3", 301: "nan,1,2,3"}),
        "2 samples are left out, the first one in line",
    ),
    "headers again": ([*LINES[:600], ",".join(HEADERS), *LINES[600:]], "line 602: `time` is no time"),
    "a quote that does not end": ([*LINES[:600], '"12.3,45.0', *LINES[600:]], "line 602: `12.3,45.0` is no time"),
    "zeros behind the end": ([*LINES, "\0" * 4000], "1 sample is left out, the first one in line"),
    "a time that runs back": (
        replaced(LINES, {500: moved(500, -3.0)}),
        "1 sample is left out for times that do not fit those",
    ),
    "a time that runs ahead": (
        replaced(LINES, {500: moved(500, 900.0)}),
        "1 sample is left out for times that do not fit those",
    ),
    "two rows in the wrong order": (
        replaced(LINES, {500: LINES[501], 501: LINES[500]}),
        "1 sample is left out for times",
    ),
    "many times that run ahead": (
        replaced(LINES, {row: moved(row, 3600.0) for row in range(1200, 1240)}),
        "40 samples are left out for times that do not fit those around them, the first one in line 1202",
    ),
    "recorded twice": ([*LINES, *LINES], "time runs backwards for good in line 1273: only the longest part is read"),
    "the last time far ahead": ([*LINES, "1e9,45.08,13.6,20"], "positions come at 20 Hz"),
    "heights of zero": (
        [line if not 300 < row < 400 else line.rpartition(",")[0] + ",0" for row, line in enumerate(LINES)],
        "99 heights are missing (zero), the first one in line 303",
    ),
}


@pytest.mark.parametrize("kind", BAD_ROWS)
def test_rows_that_cannot_be_read_are_left_out_and_reported(tmp_path: Path, kind: str) -> None:
    lines, said = BAD_ROWS[kind]
    one = imported(tmp_path, text(lines))
    assert_same_flight(one)
    assert any(said in remark for remark in one.remarks), one.remarks


HEADS: dict[str, tuple[str | bytes, Sequence[str]]] = {
    "units below": (text(["s,deg,deg,ft", *rows((), ALTITUDE / FOOT)]), ()),
    "units above": ("#s, degrees, degrees, ft msl\n" + text(rows((), ALTITUDE / FOOT)), ()),
    "a second row of headers": (text(["Lcl Time,Lat,Lon,AltGPS", *LINES]), ()),
    "a preamble": ('"Format","X"\n"Comment","a, b"\n\n' + text(LINES), ()),
    "behind a hash": ("# made by hand\n# " + text(LINES), ()),
    "behind a hash, with blanks between": ("# " + text(LINES).replace(",", " "), ()),
    "a preamble before named columns": (
        '"Session","4"\n"Time","GPS Lat","GPS Lon","GPS Alt"\n"sec","deg","deg","m"\n\n' + "\n".join(LINES),
        ("time=Time", "latitude=GPS Lat", "longitude=GPS Lon", "altitude=GPS Alt"),
    ),
    "copied as they stand": (
        text(
            rows([f"{one:%H:%M:%S.%f}" for one in CLOCK], ALTITUDE / FOOT),
            "UTC Time (hh:mm:ss),Latitude (deg),Longitude (deg),GPS Altitude (ft)",
        ),
        (
            "time=UTC Time (hh:mm:ss)",
            "latitude=Latitude (deg)",
            "longitude=Longitude",
            "altitude=GPS Altitude (ft)",
        ),
    ),
}


@pytest.mark.parametrize("kind", HEADS)
def test_headers_are_found_where_recorders_put_them(tmp_path: Path, kind: str) -> None:
    content, columns = HEADS[kind]
    assert_same_flight(imported(tmp_path, content, columns=columns))


@pytest.mark.parametrize(
    "content",
    [
        text(LINES).encode("utf-16"),
        text(LINES).encode("utf-16-be"),
        text(LINES).replace(",", ";").replace(".", ",").encode("utf-16-le"),
        ("Höhe in °\n" + text(LINES)).encode("latin-1"),
        text(LINES).replace("\n", "\r").encode(),
        text(LINES).replace("\n", "\r\n").encode("utf-8-sig"),
    ],
    ids=["UTF-16", "UTF-16 without a mark", "UTF-16 with commas", "Latin-1", "old Macs", "Windows"],
)
def test_encodings_and_ends_of_lines_are_found_out(tmp_path: Path, content: bytes) -> None:
    assert_same_flight(imported(tmp_path, content))


@pytest.mark.parametrize(
    ("tick", "offset", "unit"),
    [(1e-3, 100.0, "ms"), (1e-6, 100.0, "us"), (1e-9, 0.0, "ns"), (1e-6, 1.397e9, "us"), (1e-9, 1.397e9, "ns")],
)
def test_the_unit_of_the_time_follows_from_the_speed(tmp_path: Path, tick: float, offset: float, unit: str) -> None:
    one = imported(tmp_path, text(rows([f"{(when + offset) / tick:.0f}" for when in EXACT.time])))
    assert_same_flight(one)
    assert any(f"times are taken as {unit}: so the aircraft flies at 9" in remark for remark in one.remarks)
    assert (one.recording.begins is not None) == (offset > 1e9)


def test_a_unit_of_the_time_that_cannot_be_true_is_asked_for(tmp_path: Path) -> None:
    times = [f"{1e6 * one:.0f}" for one in EXACT.time]
    head = "time [s],latitude,longitude,altitude"
    with pytest.raises(InputError, match=r"spans 7\d\d days and moves at .* m/s; are its times us\? Then say --column"):
        imported(tmp_path, text(rows(times), head))
    assert_same_flight(
        imported(tmp_path, text(rows(times), head), columns=[*map("{0}={0}".format, HEADERS[1:]), "time=time [us]"])
    )


def test_feet_and_knots_that_nobody_names_are_found_out_by_the_course_and_the_path(tmp_path: Path) -> None:
    kt = np.full_like(EXACT.time, 185.0)
    one = imported(tmp_path, text(rows((), ALTITUDE / FOOT, kt), "time,lat,lon,alt,tas"))
    assert_same_flight(one)
    assert any("heights are taken as feet" in remark for remark in one.remarks)
    assert any("V_A is taken in kt" in remark for remark in one.remarks)
    assert one.flight["V_A"] == pytest.approx(185.0 * 1852.0 / 3600.0)


def test_heights_of_another_zero_accuse_nobody(tmp_path: Path) -> None:
    one = imported(tmp_path, text(rows((), ALTITUDE + 45.0), "time,lat,lon,alt [m]"))
    assert any("almost all passings are about" in remark for remark in one.remarks)
    assert not any(breach.certain for breach in one.violations)


@pytest.mark.parametrize(
    "times",
    [
        [f"{one:%I:%M:%S.%f} PM" for one in CLOCK],
        [f"{one:%H:%M:%S}" for one in CLOCK],
        [f"{one - timedelta(minutes=16):%Y-%m-%d %H:%M:%S.%f}".replace("13:44:30.0", "13:43:90.0") for one in CLOCK],
    ],
    ids=["twelve hours", "whole seconds", "seconds that are none"],
)
def test_clocks_are_understood(tmp_path: Path, times: list[str]) -> None:
    assert_same_flight(imported(tmp_path, text(rows(times))))


@pytest.mark.parametrize("hours", [0, 10])
def test_a_clock_passes_midnight_once_and_not_for_a_time_that_is_wrong(tmp_path: Path, hours: int) -> None:
    times = [one + timedelta(hours=hours) - timedelta(seconds=20.0) for one in CLOCK]
    written = [f"{one:%H:%M:%S.%f}" for one in times]
    written[700] = f"{times[700] - timedelta(hours=13):%H:%M:%S.%f}"
    one = imported(tmp_path, text(rows(written)))
    assert_same_flight(one)
    assert any("1 sample is left out for times" in remark for remark in one.remarks)


def test_a_leap_second_is_the_second_behind(tmp_path: Path) -> None:
    times = [f"2016-12-31T{one:%H:%M:%S.%f}Z" for one in CLOCK]
    leap = [one.replace("14:00:10.", "14:00:09.").replace("14:00:09.", "14:00:60.") for one in times[:1]]
    assert_same_flight(imported(tmp_path, text(rows([*leap, *times[1:]]))))
    text_ = "time,x,y,height\n2016-12-31T23:59:59Z,1,2,3\n2016-12-31T23:59:60Z,1,2,3\n2017-01-01T00:00:01Z,1,2,3\n"
    (tmp_path / "leap.csv").write_text(text_)
    assert read_log(tmp_path / "leap.csv").time.tolist() == [0.0, 1.0, 2.0]


@pytest.mark.parametrize("every", [2, 5])
def test_held_positions_count_once(tmp_path: Path, every: int) -> None:
    """A receiver at 10 or 4 Hz whose positions fill two or five rows, with angles that are fresh in each."""
    last = np.arange(len(EXACT.time)) // every * every
    held = rows((), ALTITUDE[last], *ANGLES, places=(LATITUDE[last], LONGITUDE[last]))
    one = imported(tmp_path, text(held, "time,lat,lon,alt,roll,pitch,heading"))
    assert_same_flight(one)
    assert any("positions are held over" in remark for remark in one.remarks)


def test_rows_between_positions_tell_the_attitude(tmp_path: Path) -> None:
    lines = rows((), ALTITUDE, *ANGLES)
    sparse = [
        line if row % 4 == 0 else ",".join([line.split(",")[0], "", "", "", *line.split(",")[4:]])
        for row, line in enumerate(lines)
    ]
    one = imported(tmp_path, text(sparse, "time,lat,lon,alt,roll,pitch,heading"))
    assert_same_flight(one)
    off = np.angle(np.exp(1j * (one.flight["phi"] - known().at("mu", one.flight.time))))
    assert math.degrees(float(np.sqrt(np.mean(off**2)))) < 1.0


def test_a_roll_without_heading_is_the_bank_as_far_as_it_is_recorded(tmp_path: Path) -> None:
    """It is right within a degree where the path is not steep, and the other sign is found out."""
    for sign in (1.0, -1.0):
        one = imported(tmp_path, text(rows((), ALTITUDE, sign * ANGLES[0]), "time,lat,lon,alt,roll"))
        assert_same_flight(one)
        made = [crossing for crossing in one.flight.crossings if abs(crossing.value("gamma")) < math.radians(15.0)]
        true = known().at("mu", np.array([known().passings[crossing.name] for crossing in made]))
        off = np.angle(np.exp(1j * (np.array([crossing.value("mu") for crossing in made]) - true)))
        assert np.degrees(np.abs(off)).max() < 2.0


def test_angles_in_radians_are_found_out(tmp_path: Path) -> None:
    one = imported(tmp_path, text(rows((), ALTITUDE, *map(np.radians, ANGLES)), "time,lat,lon,alt,roll,pitch,heading"))
    assert_same_flight(one)
    assert any("angles are taken in radians" in remark for remark in one.remarks)


@pytest.mark.parametrize("digits", [(8, 0), (6, 1), (5, 0)])
def test_numbers_that_are_written_coarsely_are_known_no_better(tmp_path: Path, digits: tuple[int, int]) -> None:
    place, height = digits
    coarse = rows((), np.round(ALTITUDE, height), places=(np.round(LATITUDE, place), np.round(LONGITUDE, place)))
    one = imported(tmp_path, text(coarse))
    assert_same_flight(one, 0.02 if place == 5 else 0.002)
    assert not any("outlier" in remark for remark in one.remarks)
    assert min(deviations.up for deviations in one.known.values()) >= 10.0**-height / math.sqrt(12.0)


@pytest.mark.parametrize("until", [12.0, 26.0, 40.0])
def test_a_log_that_ends_early_is_not_finished(tmp_path: Path, until: float) -> None:
    """A passing in its middle of the gate that is start and finish is not the finish, and a cut number no height."""
    content = text([line for line, when in zip(LINES, EXACT.time, strict=True) if when < until])[:-7]
    if until < 20.0:
        with pytest.raises(InputError, match="passes less than half of the 17 gates"):
            imported(tmp_path, content)
        return
    one = imported(tmp_path, content)
    assert math.isnan(one.flight.race_time)
    made = [crossing.name for crossing in one.flight.crossings if crossing.found]
    assert made == [name for name, when in known().passings.items() if when < until]
    assert not any(breach.certain for breach in one.violations)


def test_a_log_that_begins_late_has_no_start(tmp_path: Path) -> None:
    one = imported(tmp_path, text([line for line, when in zip(LINES, EXACT.time, strict=True) if when > 20.0]))
    made = [crossing.name for crossing in one.flight.crossings if crossing.found]
    assert made == [name for name, when in known().passings.items() if when > 20.0]
    assert math.isnan(one.flight.race_time)


IGC = igc_text(EXACT).splitlines()
BAD_FIXES: dict[str, tuple[list[str], str]] = {
    "no A record": (IGC[1:], "positions come at 20 Hz"),
    "a line that is cut": (
        replaced(IGC, {500: IGC[500][:20]}),
        "1 fix is left out, the first one in line 501: is no fix",
    ),
    "no time of day": (replaced(IGC, {500: "B99" + IGC[500][3:]}), "1 fix is left out, the first one in line 501"),
    "a false midnight": (
        replaced(IGC, {500: "B01" + IGC[500][3:]}),
        "1 sample is left out for times that do not fit those",
    ),
    "fixes that are not valid": (
        [line.replace("EA", "EV") if row % 40 == 20 else line for row, line in enumerate(IGC)],
        "fixes are left out as not valid (`V`)",
    ),
    "no date": (replaced(IGC, {1: "HFDTE993414"}), "993414 is no date"),
    "no heights at times": (
        [line[:30] + "00000" + line[35:] if 500 < row < 600 else line for row, line in enumerate(IGC)],
        "99 fixes are without a height of the satellites",
    ),
    "no heights of satellites": (
        [line[:30] + "00000" + line[35:] if line.startswith("B") else line for line in IGC],
        "heights are those of the barometer",
    ),
}


@pytest.mark.parametrize("kind", BAD_FIXES)
def test_fixes_that_cannot_be_true_are_left_out_and_reported(tmp_path: Path, kind: str) -> None:
    lines, said = BAD_FIXES[kind]
    one = imported(tmp_path, "\n".join(lines), "log.igc")
    assert_same_flight(one)
    assert any(said in remark for remark in one.remarks), one.remarks


def test_the_first_date_counts_for_the_first_fix(tmp_path: Path) -> None:
    lines = igc_text(EXACT).replace("B13", "B23").replace("B14", "B00").splitlines()
    first = next(row for row, line in enumerate(lines) if line.startswith("B00"))
    one = imported(tmp_path, "\n".join([*lines[:first], "HFDTE140414", *lines[first:]]), "log.igc")
    assert_same_flight(one)
    assert one.recording.begins is not None
    assert one.recording.begins.replace(microsecond=0, tzinfo=None) == datetime(2014, 4, 13, 23, 59, 54)


def test_fixes_that_share_a_second_are_spread_over_it(tmp_path: Path) -> None:
    seen = Fixes(*(one[13::4] for one in vars(EXACT).values()))  # five in every second
    lines = [
        line[:-3] if line.startswith("B") else line.replace("I03", "I02").replace("4244TDS", "")
        for line in igc_text(seen).splitlines()
    ]
    one = imported(tmp_path, "\n".join(lines), "log.igc")
    assert any("5 samples share each time" in remark for remark in one.remarks)
    assert_same_flight(one, 0.01)


GPX = gpx_text(EXACT)
PLAN = "<trk><name>plan</name><trkseg>" + '<trkpt lat="45.08" lon="13.62"></trkpt>' * 5 + "</trkseg></trk>"


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (
            GPX.replace("<trk>", f"{PLAN}<trk>"),
            "5 points are left out, the first one in line 2: a point of the track has no",
        ),
        (re.sub("<time>[^<]*:10.0[^<]*</time>", "", GPX, count=1), "1 point is left out"),
        (
            GPX.replace("</trkpt>", "<extensions><time>2014-01-01T00:00:00Z</time><ele>9</ele></extensions></trkpt>"),
            "20 Hz",
        ),
        (GPX.replace("14:00:20.0", "14:00:60.0"), "left out for times that do not fit those around them"),
        (GPX.replace('lat="45', 'lat="x', 1), "1 value of `lat` is left out, the first one in line 3"),
        (
            GPX.replace(
                "<trk>",
                gpx_text(Fixes(*(one[:9] for one in vars(EXACT).values())))
                .partition("<trk>")[2]
                .partition("</gpx>")[0]
                .join(("<trk>", "<trk>")),
            ),
            "track 2 is taken, which passes the course",
        ),
    ],
    ids=["a plan", "no time", "extensions", "a leap second", "no latitude", "another track"],
)
def test_points_that_are_none_are_passed_over(tmp_path: Path, content: str, said: str) -> None:
    one = imported(tmp_path, content, "log.gpx")
    assert_same_flight(one)
    assert any(said in remark for remark in one.remarks), one.remarks


@pytest.mark.parametrize("encoding", ["utf-16", "shift_jis", "euc_kr", "windows-1252", "gb18030"])
def test_declared_encodings_are_read(tmp_path: Path, encoding: str) -> None:
    content = GPX.replace('<?xml version="1.0"?>', f'<?xml version="1.0" encoding="{encoding}"?>')
    assert_same_flight(imported(tmp_path, content.encode(encoding), "log.gpx"))


@pytest.mark.parametrize("encoding", ["foo", "utf-32", "zlib"])
def test_other_encodings_are_refused_in_a_sentence(tmp_path: Path, encoding: str) -> None:
    with pytest.raises(InputError, match=r"declares an encoding that is not read; save it as UTF-8|is no XML"):
        imported(tmp_path, f'<?xml version="1.0" encoding="{encoding}"?><gpx/>', "log.gpx")


def test_a_track_that_is_cut_ends_there(tmp_path: Path) -> None:
    one = imported(tmp_path, GPX[: len(GPX) * 2 // 3], "log.gpx")
    assert math.isnan(one.flight.race_time)
    assert any("is no XML: unclosed token" in remark for remark in one.remarks)


ACMI = acmi_text(EXACT)
STEPS = ACMI.splitlines()
CARRIER = "301,Name=Carrier,Type=Sea+Watercraft+AircraftCarrier,T=0.6|0.1|0\n"


@pytest.mark.parametrize(
    "content",
    [
        ACMI.replace("a1,Name", f"{CARRIER}#1\n301,T=0.7|0.1|0\na1,Name", 1),
        ACMI.replace("a1,Name", "b,Name=Else,Type=Air+FixedWing,T=0.6|0.1|0\n#1\nb,T=0.7|0.1|0\na1,Name", 1),
        ACMI.replace(
            "a1,Name=Edge 540,", "0,Comments=first\\\n// second\\\nthird\na1,Name=Edge\\\n// no name\n540,", 1
        ),
        "\n".join([*STEPS[:400], "a1,T=x|1|2", "a1,T=1|2", "#z", *STEPS[400:]]),
        "\n".join([*STEPS[:400], "#3", STEPS[401], *STEPS[402:]]),
    ],
    ids=["a ship", "another aircraft", "texts of several lines", "damaged places", "a time that runs back"],
)
def test_the_aircraft_that_passes_the_course_is_found(tmp_path: Path, content: str) -> None:
    assert_same_flight(imported(tmp_path, content, "log.acmi"))
