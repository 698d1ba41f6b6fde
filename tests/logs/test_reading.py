"""Logs of all formats are read alike; what is wrong with one is said with its line, and what would be right."""

import functools
import gzip
import math
import zipfile
from collections.abc import Callable
from datetime import UTC, datetime, timedelta, timezone
from pathlib import Path

import numpy as np
import pytest
from synthetic import BEGIN, GAP, LEAD, Fixes, acmi_text, csv_text, fixes, gpx_text, igc_text, known, on_globe, race

from airrace.errors import InputError, UsageError
from airrace.inputs.log_layout import read_layout, with_columns
from airrace.logs.log_flight import LogFlight, flight_from_log
from airrace.logs.passings import in_frame, in_order
from airrace.logs.reading import read_log
from airrace.logs.recording import ColumnLayout, Recording
from airrace.logs.violations import Penalties
from airrace.quantities import KNOT
from airrace.results import Basis, legs_of
from airrace.trajectory import Array

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
    ("write", "name", "near"),
    [
        (csv_text, "log.csv", 1e-3),
        (gpx_text, "log.gpx", 1e-3),
        (acmi_text, "log.acmi", 1e-3),
        (igc_text, "log.igc", 2e-3),
    ],
)
def test_all_formats_tell_the_same_flight(
    tmp_path: Path, write: Callable[[Fixes], str], name: str, near: float
) -> None:
    placed = in_frame(in_order(read(tmp_path, write(SEEN), name)), race())
    assert placed.time == pytest.approx(SEEN.time - SEEN.time[0], abs=2e-3)
    assert placed.columns["x"] == pytest.approx(SEEN.north, abs=near)
    assert placed.columns["y"] == pytest.approx(SEEN.east, abs=near)
    assert placed.columns["height"] == pytest.approx(SEEN.height, abs=0.51 if name.endswith("igc") else near)


@pytest.mark.parametrize(("write", "name"), [(gpx_text, "a.gpx"), (acmi_text, "a.acmi"), (igc_text, "a.igc")])
def test_dates_are_told(tmp_path: Path, write: Callable[[Fixes], str], name: str) -> None:
    recording = read(tmp_path, write(SEEN), name)
    late = 10.0 if name.endswith("acmi") else 0.0  # the test's recording begins ten seconds after its reference
    assert recording.begins is not None
    assert (recording.begins - BEGIN).total_seconds() == pytest.approx(float(SEEN.time[0]) + late, abs=2e-3)


def test_a_zipped_recording_is_read(tmp_path: Path) -> None:
    path = tmp_path / "log.zip.acmi"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("../../evil.acmi", acmi_text(SEEN))
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


def test_silent_cells_and_repeated_times_are_left_out_and_told(tmp_path: Path) -> None:
    text = "time,x,y,height\n0,1,2,3\n1,,,\n2,1,2,3\n2,5,5,5\n3,1,2,3\n"
    kept = in_order(read(tmp_path, text))
    assert kept.time.tolist() == [0.0, 2.0, 3.0]
    assert kept.remarks == (
        "1 sample is without a position and left out",
        "1 sample is left out for coming less than 0.1 ms behind another",
    )


HEAD = "time,x,y,height\n0,1,2,3\n"
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
        (HEAD + "5,1,2,3\n# a remark\n4,1,2,3\n", "a.csv", "a.csv:5:1: time: time runs backwards: 4.000 s after"),
        (HEAD + "nan,1,2,3\n", "a.csv", "a.csv:3:1: time: `nan` is no time"),
        ("", "a.csv", "a.csv: has no column of time"),
        ("time,x,y,height\n", "a.csv", "a.csv: holds no samples; expected one row for every instant"),
        ("\0\0\0\0", "a.csv", "a.csv: is no log: expected CSV, GPX, IGC or ACMI"),
        (GPX.format(""), "a.gpx", "a.gpx:1:1: time: a point of the track has no time"),
        (GPX.format("<time>noon</time>"), "a.gpx", "a.gpx:1:1: time: `noon` is no time; expected one such as 2016"),
        ("<gpx></gpx>", "a.gpx", "a.gpx: holds no recorded track"),
        ("<gpx><trk>", "a.gpx", "a.gpx:1:1: is no XML: no element found"),
        ('<!DOCTYPE a [<!ENTITY b "c">]><gpx/>', "a.gpx", "a.gpx:1:1: holds a document type; such a file needs none"),
        ("AXXX\nB12345\n", "a.igc", "a.igc:2:1: is no fix of a flight recorder: `B12345`"),
        ("AXXX\n", "a.igc", "a.igc: holds no fixes (B records)"),
        ("FileType=text/acmi/tacview\nFileVersion=3\n", "a.acmi", "a.acmi:2:1: expected `FileVersion=2.x`"),
        ("FileType=text/acmi/tacview\nFileVersion=2.2\n#1\n#0\n", "a.acmi", "a.acmi:4:1: time runs backwards"),
        ("FileType=text/acmi/tacview\nFileVersion=2.2\na,T=1|2\n", "a.acmi", "a.acmi:3:1: T: a place has 2 values"),
        ("FileType=text/acmi/tacview\nFileVersion=2.2\na,T=x|2|3\n", "a.acmi", "a.acmi:3:1: T: `x` is no number"),
        (
            "FileType=text/acmi/tacview\nFileVersion=2.2\n",
            "a.acmi",
            "a.acmi: holds no flight of an aircraft; it has",
        ),
    ],
)
def test_what_is_wrong_is_said_with_its_line(tmp_path: Path, text: str, name: str, said: str) -> None:
    assert refused(tmp_path, text, name).startswith(said)


def test_a_file_that_is_not_there_is_said(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        read_log(tmp_path / "missing.csv")
    with pytest.raises(InputError, match="is not a file"):
        read_log(tmp_path)


def test_a_line_without_end_is_refused(tmp_path: Path) -> None:
    assert "a.csv:1:1: has a line without end" in refused(tmp_path, b"x" * 2_000_000, "a.csv")


def test_a_damaged_archive_is_refused(tmp_path: Path) -> None:
    assert "is a damaged archive" in refused(tmp_path, b"PK\x03\x04" + bytes(100), "a.zip")
    path = tmp_path / "b.zip"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("readme.md", "nothing")
    assert "is an archive without an ACMI recording" in refused(tmp_path, path.read_bytes(), "b.zip")
    assert "is no log" in refused(tmp_path, gzip.compress(b"\0" * 1000) + b"\0", "c.gz")


def test_too_many_samples_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("airrace.logs.recording.SAMPLES_MAX", 3)
    said = refused(tmp_path, HEAD + "".join(f"{row},1,2,3\n" for row in range(1, 9)))
    assert said == "log.csv:5:1: holds more than 3 samples; cut the log to the flight"


def test_a_column_that_is_not_there_is_said(tmp_path: Path) -> None:
    layout = with_columns(ColumnLayout(), ["time=time", "north=x", "east=why", "height=height"])
    assert refused(tmp_path, HEAD, layout=layout).startswith(
        "log.csv:1:1: has no column `why` for east; its columns are"
    )


@pytest.mark.parametrize(
    ("column", "said"),
    [
        ("alt=H", "`alt` is nothing that is read from a log; known are time, latitude"),
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
    from airrace.inputs import load_inputs
    from airrace.logs.log_flight import flight_from_log

    text = csv_text(SEEN)
    with pytest.raises(InputError, match="passes less than half of the 15 gates and pylons of Chiba 2015"):
        flight_from_log(read(tmp_path, text), load_inputs("chiba_2015").race, label="log")
    with pytest.raises(InputError, match="is nowhere within 10 km of the course Rovinj 2014"):
        flight_from_log(read(tmp_path, "time,lat,lon,alt\n0,13,45,3\n1,13,45,3\n"), race(), label="log")
    with pytest.raises(InputError, match="there is no run 2"):
        flight_from_log(read(tmp_path, text), race(), label="log", run=2)


RATES = (5.0, 20.0)
SEEDS = (1, 2, 3)


@functools.cache
def flown(hz: float, seed: int, noise: float = 1.5) -> LogFlight:
    return imported(csv_text(fixes(hz, seed=seed, noise=noise)))


def imported(text: str, path: Path | None = None, penalties: Penalties | None = None) -> LogFlight:
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        file = path or Path(folder) / "log.csv"
        file.write_text(text)
        return flight_from_log(read_log(file), race(), label="log", penalties=penalties or Penalties())


def off_bank(one: LogFlight) -> tuple[Array, Array, Array]:
    """Errors of the bank, deg, away from the gap; the true load factor and roll rate there."""
    time = one.flight.time
    error = np.degrees(np.angle(np.exp(1j * (one.flight["mu"] - known().at("mu", time)))))
    away = (time < GAP[0] - 0.5) | (time > GAP[1] + 0.5)
    return error[away], known().at("n_z", time)[away], known().at("p_Kbar", time)[away]


def rms(values: Array) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


@pytest.mark.parametrize("hz", RATES)
@pytest.mark.parametrize("seed", SEEDS)
def test_passings_are_recovered_within_a_twentieth_of_a_second(hz: float, seed: int) -> None:
    one = flown(hz, seed)
    begin = known().passings["0:g0"]
    for crossing in one.flight.crossings:
        assert crossing.time == pytest.approx(known().passings[crossing.name] - begin, abs=0.05)


@pytest.mark.parametrize("hz", RATES)
@pytest.mark.parametrize("seed", SEEDS)
def test_lost_seconds_of_every_leg_are_recovered_within_a_tenth(hz: float, seed: int) -> None:
    times = list(known().passings.values())
    for leg, before, after in zip(legs_of(flown(hz, seed).flight), times[:-1], times[1:], strict=True):
        assert leg.time == pytest.approx(after - before, abs=0.1)


@pytest.mark.parametrize("hz", RATES)
@pytest.mark.parametrize("seed", SEEDS)
def test_the_bank_of_turns_is_recovered_within_eight_degrees(hz: float, seed: int) -> None:
    """The root mean square, where the aircraft pulls more than 2 g and does not roll.

    While it rolls at 400 deg/s, and at 1 g, positions with 1.5 m of noise do not tell the bank.
    """
    error, n_z, p = off_bank(flown(hz, seed))
    turning = (n_z > 2.0) & (np.abs(p) < math.radians(30.0))
    assert turning.mean() > 0.3
    assert rms(error[turning]) < 8.0


def test_the_better_the_positions_the_better_the_bank() -> None:
    errors: list[float] = []
    for noise in (1.5, 0.5, 0.1, 0.02):
        error, n_z, _ = off_bank(flown(20.0, 1, noise))
        errors.append(rms(error[n_z > 2.0]))
    assert errors == sorted(errors, reverse=True)
    assert errors[-1] < 4.0


def test_the_clock_starts_at_the_start() -> None:
    one = flown(20.0, 1)
    assert one.flight.time[0] == 0.0 == one.flight.crossings[0].time
    assert one.offset == pytest.approx(LEAD - 0.013, abs=0.05)


def test_times_rise_and_hold_all_passings() -> None:
    flight = flown(20.0, 1).flight
    assert (np.diff(flight.time) > 0.0).all()
    assert np.diff(flight.time).max() < 0.0201
    assert {crossing.time for crossing in flight.crossings} <= set(flight.time.tolist())


def test_speed_course_and_climb_are_recovered() -> None:
    flight = flown(20.0, 1).flight
    assert rms(flight["V_K"] - known().at("V_K", flight.time)) < 1.5
    assert math.degrees(rms(flight["gamma"] - known().at("gamma", flight.time))) < 2.0
    course = np.angle(np.exp(1j * (flight["chi"] - known().at("chi", flight.time))))
    assert math.degrees(np.sqrt(np.median(course**2))) < 1.0


def test_histories_say_that_they_are_derived() -> None:
    flight = flown(20.0, 1).flight
    assert {flight.basis(name) for name in ("V_K", "n_z", "mu", "V_I", "height")} == {Basis.DERIVED}
    assert "p_Kbar" not in flight


def test_gap_rate_and_estimates_are_told() -> None:
    told = " ".join(flown(20.0, 1).remarks)
    assert "at 20 Hz and scatter by" in told
    assert "a gap of 0.35 s behind line" in told
    assert "estimated from the positions, not recorded: bank, load factor" in told


def test_noise_is_estimated() -> None:
    from airrace.logs.smoothing import smooth

    for noise in (0.1, 1.5, 5.0):
        seen = fixes(20.0, noise=noise, gap=(0.0, 0.0))
        path = smooth(seen.time, np.stack([seen.north, seen.east, seen.height]))
        assert path.noise == pytest.approx(noise, rel=0.2)
        assert path.scatter == pytest.approx(noise, rel=0.2)


@pytest.mark.parametrize("hz", RATES)
@pytest.mark.parametrize("seed", SEEDS)
def test_an_optimum_breaks_no_rule_for_certain(hz: float, seed: int) -> None:
    assert [one for one in flown(hz, seed).violations if one.certain] == []


def test_outliers_are_left_out_and_told() -> None:
    lines = csv_text(fixes(20.0)).splitlines()
    broken = {200: (400.0, 0.0), 700: (9.0, -9.0)}
    for row, (north, east) in broken.items():
        time, x, y, height = (float(one) for one in lines[row].split(","))
        lines[row] = f"{time},{x + north},{y + east},{height}"
    one = imported("\n".join(lines) + "\n")
    told = " ".join(one.remarks)
    assert "1 outlier is left out: leaps faster than sound, the first one in line 201" in told
    assert "1 outlier is left out, the first one in line 701" in told
    good = flown(20.0, 1).flight
    assert [c.time for c in one.flight.crossings] == pytest.approx([c.time for c in good.crossings], abs=0.01)


def test_a_straight_line_is_smoothed_into_itself() -> None:
    from airrace.logs.smoothing import smooth

    time = np.arange(0.0, 10.0, 0.1)
    places = np.stack([80.0 * time, -3.0 * time, np.full_like(time, 50.0)])
    path = smooth(time, places)
    position, velocity, acceleration = path.at(time)
    assert position == pytest.approx(places, abs=1e-6)
    assert velocity[0] == pytest.approx(80.0, abs=1e-4)
    assert np.abs(acceleration).max() < 1e-3


def test_a_level_turn_has_the_load_factor_of_its_bank() -> None:
    """`n_z = 1 / cos(mu)`, `tan(mu) = V^2 / (g r)`, for a turn to the right."""
    from airrace.environment.atmosphere import g0
    from airrace.logs.smoothing import derived_histories
    from airrace.results.derivation import complete_histories

    speed, bank = 80.0, math.radians(70.0)
    radius = speed**2 / (g0 * math.tan(bank))
    angle = np.linspace(0.0, 3.0, 50)
    position = np.stack([radius * np.sin(angle), radius * (1.0 - np.cos(angle)), np.full_like(angle, 30.0)])
    velocity = speed * np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)])
    acceleration = speed**2 / radius * np.stack([-np.sin(angle), np.cos(angle), np.zeros_like(angle)])
    histories = complete_histories(race(), derived_histories(race(), position, velocity, acceleration))
    assert histories["n_z"].values == pytest.approx(1.0 / math.cos(bank))
    assert histories["mu"].values == pytest.approx(bank)
    assert histories["gamma"].values == pytest.approx(0.0, abs=1e-12)
    assert np.unwrap(histories["chi"].values) == pytest.approx(angle)


def test_a_noise_that_is_said_too_small_leaves_no_log_without_positions() -> None:
    from airrace.logs.smoothing import smooth

    seen = fixes(20.0, noise=5.0)
    path = smooth(seen.time, np.stack([seen.north, seen.east, seen.height]), noise=1e-6)
    assert np.isfinite(path.position).all()
    assert path.outliers.mean() < 0.5


@pytest.mark.parametrize("hz", [200.0, 1000.0])
def test_noise_at_a_high_rate_is_not_taken_for_leaps(hz: float) -> None:
    """Between two samples that are a millisecond apart, 1.5 m of noise look faster than sound."""
    one = imported(csv_text(fixes(hz)))
    assert not any("outlier" in remark for remark in one.remarks)
    begin = known().passings["0:g0"]
    for crossing in one.flight.crossings:
        assert crossing.time == pytest.approx(known().passings[crossing.name] - begin, abs=0.02)


def test_of_samples_that_come_within_a_tenth_of_a_millisecond_one_is_kept() -> None:
    seen = fixes(20.0)
    shifts = 0.00006 * np.arange(5)
    time = (seen.time[:, None] + shifts).ravel()
    often = Fixes(time, *(np.repeat(one, len(shifts)) for one in (seen.north, seen.east, seen.height)))
    one = imported(csv_text(often, offset=52.0, digits=5))
    assert f"{2 * len(seen.time)} samples are left out for coming less than 0.1 ms behind another" in one.remarks
