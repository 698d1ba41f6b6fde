"""Logs as recorders write them: whatever cannot be read is left out and told, and the flight is the same."""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from synthetic import BEGIN, Fixes, acmi_text, assert_same_flight, fixes, gpx_text, igc_text, known, on_globe, race

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


def replaced(lines: Sequence[str], changes: dict[int, str]) -> list[str]:
    return [changes.get(row, line) for row, line in enumerate(lines)]


def moved(row: int, seconds: float) -> str:
    """A row with another time."""
    when, _, rest = rows()[row].partition(",")
    return f"{float(when) + seconds:.3f},{rest}"


@dataclass(frozen=True)
class Recording:
    """A file of the known flight.

    Attributes:
        content: what is in it.
        remark: a part of what is said of it, if anything is.
        name: its name.
        columns: the columns that are named, as `--column` takes them.
        near: how near the passings come to those of the flight, s.
    """

    content: str | bytes
    remark: str = ""
    name: str = "log.csv"
    columns: Sequence[str] = ()
    near: float = 0.002


def clocks(form: str, late: timedelta = timedelta()) -> list[str]:
    """The times as a clock writes them."""
    return [(time + late).strftime(form) for time in CLOCK]


def over_midnight(hours: int) -> str:
    """By the time of day, and once by a clock that is 13 hours behind."""
    times = clocks("%H:%M:%S.%f", timedelta(hours=hours, seconds=-20))
    times[700] = clocks("%H:%M:%S.%f", timedelta(hours=hours - 13, seconds=-20))[700]
    return text(rows(times))


def held(every: int) -> str:
    """By a receiver at 10 or 4 Hz whose positions fill two or five rows, with angles that are fresh in each."""
    last = np.arange(len(EXACT.time)) // every * every
    lines = rows((), ALTITUDE[last], *ANGLES, places=(LATITUDE[last], LONGITUDE[last]))
    return text(lines, f"{SHORT},roll,pitch,heading")


def sampled(rows: slice) -> Fixes:
    return Fixes(*(values[rows] for values in vars(EXACT).values()))


def gpx(pattern: str, new: str, remark: str, count: int = 0) -> Recording:
    """One whose text is changed."""
    assert re.search(pattern, GPX)
    return Recording(re.sub(pattern, new, GPX, count=count), remark, "log.gpx")


def spoilt(changes: dict[int, str], remark: str) -> Recording:
    """A table in which rows are replaced."""
    return Recording(text(replaced(LINES, changes)), remark)


def igc(lines: Sequence[str], remark: str) -> Recording:
    return Recording("\n".join(lines), remark, "log.igc")


def acmi(old: str, new: str) -> Recording:
    assert old in ACMI
    return Recording(ACMI.replace(old, new, 1), name="log.acmi")


LINES = rows()
SHORT = "time,lat,lon,alt"
IN_FEET = rows((), ALTITUDE / FOOT)
IGC, GPX, ACMI = igc_text(EXACT).splitlines(), gpx_text(EXACT), acmi_text(EXACT)
STEPS = ACMI.splitlines()
PLAN = "<trk><name>plan</name><trkseg>" + '<trkpt lat="45.08" lon="13.62"></trkpt>' * 5 + "</trkseg></trk>"
BEGINNING = gpx_text(sampled(slice(9))).partition("<trk>")[2].partition("</gpx>")[0]
OTHER_TIME = "<extensions><time>2014-01-01T00:00:00Z</time><ele>9</ele></extensions></trkpt>"
CARRIER = "301,Name=Carrier,Type=Sea+Watercraft+AircraftCarrier,T=0.6|0.1|0\n#1\n301,T=0.7|0.1|0\n"
OTHER = "b,Name=Else,Type=Air+FixedWing,T=0.6|0.1|0\n#1\nb,T=0.7|0.1|0\n"
NOTES = "0,Comments=first\\\n// second\\\nthird\na1,Name=Edge\\\n// no name\n540,"
FIVE_A_SECOND = [
    line[:-3] if line.startswith("B") else line.replace("I03", "I02").replace("4244TDS", "")
    for line in igc_text(sampled(slice(13, None, 4))).splitlines()
]
UNFIT = "left out for times that do not fit those"
AROUND = f"{UNFIT} around them"

RECORDINGS: dict[str, Recording] = {
    # rows that cannot be read
    "no time": Recording(
        text([*LINES[:9], ",,,", " , , ,", *LINES[9:]]),
        "2 samples are left out, the first one in line 11: `` is no time",
    ),
    "dashes": spoilt({300: "---,---,---,---"}, "1 sample is left out, the first one in line 302: `---` is no"),
    "no number": spoilt(
        {300: LINES[300].rpartition(",")[0] + ",N/A"},
        "1 value of `altitude` is left out, the first one in line 302: `N/A` is no number",
    ),
    "not finite": spoilt({300: "inf,1,2,3", 301: "nan,1,2,3"}, "2 samples are left out, the first one in line"),
    "headers again": Recording(text([*LINES[:600], ",".join(HEADERS), *LINES[600:]]), "line 602: `time` is no time"),
    "a quote that does not end": Recording(
        text([*LINES[:600], '"12.3,45.0', *LINES[600:]]), "line 602: `12.3,45.0` is no time"
    ),
    "zeros behind the end": Recording(text([*LINES, "\0" * 4000]), "1 sample is left out, the first one in line"),
    "a time that runs back": spoilt({500: moved(500, -3.0)}, f"1 sample is {UNFIT}"),
    "a time that runs ahead": spoilt({500: moved(500, 900.0)}, f"1 sample is {UNFIT}"),
    "two rows in the wrong order": spoilt({500: LINES[501], 501: LINES[500]}, "1 sample is left out for times"),
    "many times that run ahead": spoilt(
        {row: moved(row, 3600.0) for row in range(1200, 1240)}, f"40 samples are {AROUND}, the first one in line 1202"
    ),
    "recorded twice": Recording(
        text([*LINES, *LINES]), "time runs backwards for good in line 1273: only the longest part is read"
    ),
    "the last time far ahead": Recording(text([*LINES, "1e9,45.08,13.6,20"]), "positions come at 20 Hz"),
    "heights of zero": spoilt(
        {row: LINES[row].rpartition(",")[0] + ",0" for row in range(301, 400)},
        "99 heights are missing (zero), the first one in line 303",
    ),
    # headers where recorders put them
    "units below": Recording(text(["s,deg,deg,ft", *IN_FEET])),
    "units above": Recording("#s, degrees, degrees, ft msl\n" + text(IN_FEET)),
    "a second row of headers": Recording(text(["Lcl Time,Lat,Lon,AltGPS", *LINES])),
    "a preamble": Recording('"Format","X"\n"Comment","a, b"\n\n' + text(LINES)),
    "behind a hash": Recording("# made by hand\n# " + text(LINES)),
    "behind a hash, with blanks between": Recording("# " + text(LINES).replace(",", " ")),
    "a preamble before named columns": Recording(
        '"Session","4"\n"Time","GPS Lat","GPS Lon","GPS Alt"\n"sec","deg","deg","m"\n\n' + "\n".join(LINES),
        columns=("time=Time", "latitude=GPS Lat", "longitude=GPS Lon", "altitude=GPS Alt"),
    ),
    "copied as they stand": Recording(
        text(
            rows(clocks("%H:%M:%S.%f"), ALTITUDE / FOOT),
            "UTC Time (hh:mm:ss),Latitude (deg),Longitude (deg),GPS Altitude (ft)",
        ),
        columns=(
            *("time=UTC Time (hh:mm:ss)", "latitude=Latitude (deg)"),
            *("longitude=Longitude", "altitude=GPS Altitude (ft)"),
        ),
    ),
    # encodings and ends of lines
    "UTF-16": Recording(text(LINES).encode("utf-16")),
    "UTF-16 without a mark": Recording(text(LINES).encode("utf-16-be")),
    "UTF-16 with commas": Recording(text(LINES).replace(",", ";").replace(".", ",").encode("utf-16-le")),
    "Latin-1": Recording(("Höhe in °\n" + text(LINES)).encode("latin-1")),
    "old Macs": Recording(text(LINES).replace("\n", "\r")),
    "Windows": Recording(text(LINES).replace("\n", "\r\n").encode("utf-8-sig")),
    # clocks
    "twelve hours": Recording(text(rows(clocks("%I:%M:%S.%f PM")))),
    "whole seconds": Recording(text(rows(clocks("%H:%M:%S")))),
    "seconds that are none": Recording(
        text(rows(clocks("%Y-%m-%d %H:%M:%S.%f", timedelta(minutes=-16)))).replace("13:44:30.0", "13:43:90.0")
    ),
    "a second after the 59th": Recording(
        text(rows([time.replace("T14:00:00.", "T13:59:60.") for time in clocks("2016-12-31T%H:%M:%S.%fZ")]))
    ),
    "a time that is wrong": Recording(over_midnight(0), "1 sample is left out for times"),
    "midnight, and a time that is wrong": Recording(over_midnight(10), "1 sample is left out for times"),
    # positions and angles
    "positions held over two rows": Recording(held(2), "positions are held over"),
    "positions held over five rows": Recording(held(5), "positions are held over"),
    "angles in radians": Recording(
        text(rows((), ALTITUDE, *map(np.radians, ANGLES)), f"{SHORT},roll,pitch,heading"), "angles are taken in radians"
    ),
    # IGC
    "no A record": igc(IGC[1:], "positions come at 20 Hz"),
    "a line that is cut": igc(
        replaced(IGC, {500: IGC[500][:20]}), "1 fix is left out, the first one in line 501: is no fix"
    ),
    "no time of day": igc(replaced(IGC, {500: "B99" + IGC[500][3:]}), "1 fix is left out, the first one in line 501"),
    "a false midnight": igc(replaced(IGC, {500: "B01" + IGC[500][3:]}), f"1 sample is {UNFIT}"),
    "fixes that are not valid": igc(
        [line.replace("EA", "EV") if row % 40 == 20 else line for row, line in enumerate(IGC)],
        "fixes are left out as not valid (`V`)",
    ),
    "no date": igc(replaced(IGC, {1: "HFDTE993414"}), "993414 is no date"),
    "no heights at times": igc(
        [line[:30] + "00000" + line[35:] if 500 < row < 600 else line for row, line in enumerate(IGC)],
        "99 fixes are without a height of the satellites",
    ),
    "no heights of satellites": igc(
        [line[:30] + "00000" + line[35:] if line.startswith("B") else line for line in IGC],
        "heights are those of the barometer",
    ),
    "five fixes of one second": Recording("\n".join(FIVE_A_SECOND), "5 samples share each time", "log.igc", near=0.01),
    # GPX
    "a plan": gpx(
        "<trk>", f"{PLAN}<trk>", "5 points are left out, the first one in line 2: a point of the track has no"
    ),
    "a point without a time": gpx("<time>[^<]*:10.0[^<]*</time>", "", "1 point is left out", 1),
    "a time among extensions": gpx("</trkpt>", OTHER_TIME, "20 Hz"),
    "a leap second": gpx("14:00:20.0", "14:00:60.0", AROUND),
    "no latitude": gpx('lat="45', 'lat="x', "1 value of `lat` is left out, the first one in line 3", 1),
    "another track": gpx("<trk>", f"<trk>{BEGINNING}<trk>", "track 2 is taken, which passes the course"),
    **{
        f"GPX in {name}": Recording(GPX.replace('"1.0"?>', f'"1.0" encoding="{name}"?>').encode(name), name="log.gpx")
        for name in ("utf-16", "shift_jis", "euc_kr", "windows-1252", "gb18030")
    },
    # ACMI
    "a ship": acmi("a1,Name", f"{CARRIER}a1,Name"),
    "another aircraft": acmi("a1,Name", f"{OTHER}a1,Name"),
    "texts of several lines": acmi("a1,Name=Edge 540,", NOTES),
    "damaged places": Recording(
        "\n".join([*STEPS[:400], "a1,T=x|1|2", "a1,T=1|2", "#z", *STEPS[400:]]), "", "log.acmi"
    ),
    "a step that runs back": acmi(STEPS[400], "#3"),
}
"""Faults and habits of recorders, after which the flight is the same."""


@pytest.mark.parametrize("kind", RECORDINGS)
def test_a_flight_is_the_same_whatever_its_recorder_does_and_what_is_left_out_is_reported(
    tmp_path: Path, kind: str
) -> None:
    recording = RECORDINGS[kind]
    flown = imported(tmp_path, recording.content, recording.name, recording.columns)
    assert_same_flight(flown, recording.near)
    assert not recording.remark or any(recording.remark in remark for remark in flown.remarks), flown.remarks


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


def test_the_first_date_counts_for_the_first_fix(tmp_path: Path) -> None:
    lines = igc_text(EXACT).replace("B13", "B23").replace("B14", "B00").splitlines()
    first = next(row for row, line in enumerate(lines) if line.startswith("B00"))
    one = imported(tmp_path, "\n".join([*lines[:first], "HFDTE140414", *lines[first:]]), "log.igc")
    assert_same_flight(one)
    assert one.recording.begins is not None
    assert one.recording.begins.replace(microsecond=0, tzinfo=None) == datetime(2014, 4, 13, 23, 59, 54)


@pytest.mark.parametrize("encoding", ["foo", "utf-32", "zlib"])
def test_other_encodings_are_refused_in_a_sentence(tmp_path: Path, encoding: str) -> None:
    with pytest.raises(InputError, match=r"declares an encoding that is not read; save it as UTF-8|is no XML"):
        imported(tmp_path, f'<?xml version="1.0" encoding="{encoding}"?><gpx/>', "log.gpx")


def test_a_track_that_is_cut_ends_there(tmp_path: Path) -> None:
    one = imported(tmp_path, GPX[: len(GPX) * 2 // 3], "log.gpx")
    assert math.isnan(one.flight.race_time)
    assert any("is no XML: unclosed token" in remark for remark in one.remarks)
