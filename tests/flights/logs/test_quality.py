"""What a log says of its own quality becomes the accuracy of its positions."""

from pathlib import Path

import numpy as np
import pytest
from synthetic import Fixes, csv_text, fixes, gpx_text, igc_text, imported, on_globe

import airrace
from airrace.errors import UsageError
from airrace.flights.logs.csv_log import ColumnLayout
from airrace.flights.logs.quality import PLAIN_RECEIVER, VERTICAL_RATIO, FixType, fix_type, receiver_accuracy
from airrace.flights.logs.reading import read_log
from airrace.flights.logs.recording import Recording

SEEN = fixes(2.0, noise=0.02, gap=(0.0, 0.0))
COUNT = len(SEEN.time)


def with_columns(header: str, *cells: str) -> str:
    rows = csv_text(SEEN).splitlines()
    return "\n".join([f"{rows[0]},{header}", *(",".join([row, *cells]) for row in rows[1:])]) + "\n"


def read(folder: Path, text: str, layout: ColumnLayout | None = None, name: str = "log.csv") -> Recording:
    path = folder / name
    path.write_text(text)
    return read_log(path, layout)


@pytest.mark.parametrize(
    ("header", "cells", "across", "up"),
    [
        ("numSV,hAcc [m],vAcc [mm]", ("16", "0.5", "900"), 0.5, 0.9),
        ("hAcc [m]", ("0.5",), 0.5, 0.5 * VERTICAL_RATIO),
        ("hdop", ("2",), 2.0 * PLAIN_RECEIVER, 2.0 * VERTICAL_RATIO * PLAIN_RECEIVER),
        ("pdop", ("2",), 2.0 / np.hypot(1.0, VERTICAL_RATIO) * PLAIN_RECEIVER, None),
        ("hdop", ("0.6",), PLAIN_RECEIVER, VERTICAL_RATIO * PLAIN_RECEIVER),
        ("fix type", ("6",), 0.02, 0.02 * VERTICAL_RATIO),
        ("fix type,hdop", ("RTK float", "1.5"), 0.6, None),
        ("fix [nmea]", ("4",), 0.02, None),
        ("satellites", ("9",), PLAIN_RECEIVER, VERTICAL_RATIO * PLAIN_RECEIVER),
        ("nothing", ("9",), PLAIN_RECEIVER, VERTICAL_RATIO * PLAIN_RECEIVER),
    ],
)
def test_columns_of_quality_are_the_accuracy(
    tmp_path: Path, header: str, cells: tuple[str, ...], across: float, up: float | None
) -> None:
    accuracy = receiver_accuracy(read(tmp_path, with_columns(header, *cells)))
    assert accuracy.across == pytest.approx(np.full(COUNT, across))
    assert up is None or accuracy.up == pytest.approx(np.full(COUNT, up))
    assert (accuracy.source == "") == (header == "nothing")


def test_a_stated_accuracy_counts_more_than_the_columns(tmp_path: Path) -> None:
    accuracy = receiver_accuracy(read(tmp_path, with_columns("hAcc [m]", "5"), ColumnLayout(accuracy=0.02)))
    assert accuracy.across == pytest.approx(0.02)
    assert "stated" in accuracy.source


def test_the_deviation_rises_as_satellites_are_lost(tmp_path: Path) -> None:
    rows = with_columns("satellites", "16").splitlines()
    fewer = [row.rpartition(",")[0] + ",11" for row in rows[COUNT // 2 :]]
    across = receiver_accuracy(read(tmp_path, "\n".join([*rows[: COUNT // 2], *fewer]) + "\n")).across
    assert across[0] == PLAIN_RECEIVER
    assert across[-1] > 1.2 * PLAIN_RECEIVER


def test_positions_without_a_fix_are_left_out(tmp_path: Path) -> None:
    rows = with_columns("fix type", "3D").splitlines()
    rows[10] = rows[10].replace("3D", "no fix")
    found = read(tmp_path, "\n".join(rows) + "\n")
    assert np.flatnonzero(np.isnan(found.columns["x"])).tolist() == [9]
    assert any("1 sample is without a fix and left out, the first one in line 11" in remark for remark in found.remarks)
    nothing = read(tmp_path, with_columns("fix type", "0"))
    assert np.isfinite(nothing.columns["x"]).all()
    assert any("not believed" in remark for remark in nothing.remarks)


@pytest.mark.parametrize(
    ("text", "code", "fix"),
    [
        *(
            ("NoFix", "mavlink", FixType.NONE),
            ("3DDiff", "mavlink", FixType.DIFFERENTIAL),
            ("2D", "nmea", FixType.FLAT),
        ),
        *(
            ("RTK fixed", "mavlink", FixType.FIXED),
            ("4", "nmea", FixType.FIXED),
            ("4", "mavlink", FixType.DIFFERENTIAL),
        ),
        *(
            ("pps", "mavlink", FixType.SPACE),
            ("3D fixed", "mavlink", FixType.SPACE),
            ("GPS no fix", "mavlink", FixType.NONE),
        ),
        *(("5", "nmea", FixType.FLOAT), ("3", "racelogic", FixType.FLOAT), ("invalid", "nmea", FixType.NONE)),
    ],
)
def test_words_and_numbers_of_fix_types_are_understood(text: str, code: str, fix: FixType) -> None:
    assert fix_type(text, code) == fix
    assert np.isnan(fix_type("whatever", code))
    assert np.isnan(fix_type("normal", code))


def test_gpx_and_igc_say_it_in_their_own_way(tmp_path: Path) -> None:
    gpx = gpx_text(SEEN).replace("</time>", "</time><fix>dgps</fix><sat>9</sat><hdop>1.5</hdop>")
    found = receiver_accuracy(read(tmp_path, gpx, name="log.gpx"))
    assert found.across == pytest.approx(1.5)
    igc = igc_text(SEEN).replace("I033638LAD3941LOD4244TDS", "I043638LAD3941LOD4244TDS4547FXA")
    lines = [f"{line}012" if line.startswith("B") else line for line in igc.splitlines()]
    assert receiver_accuracy(read(tmp_path, "\n".join(lines) + "\n", name="log.igc")).across == pytest.approx(6.0)


def test_a_dialect_knows_its_columns_of_quality(tmp_path: Path) -> None:
    latitude, longitude, height = on_globe(SEEN)
    places = zip(SEEN.time, latitude, longitude, height, strict=True)
    rows = [f"{t * 1e6 + 9e6:.0f},6,0.8,{north:.7f},{east:.7f},{up:.2f}" for t, north, east, up in places]
    found = read(tmp_path, "\n".join(["TimeUS,Status,HDop,Lat,Lng,Alt", *rows]) + "\n")
    assert receiver_accuracy(found).across == pytest.approx(0.02)


def test_lost_satellites_of_a_fast_receiver_are_told_and_accuse_nobody() -> None:
    """Positions wander by metres without any noise from sample to sample, as the log's own accuracy says."""
    seen = fixes(20.0, noise=0.0, gap=(0.0, 0.0))
    lost = np.clip((seen.time - 20.0) / 5.0, 0.0, 1.0)
    wander = 4.0 * lost * np.sin(2.0 * np.pi * (seen.time - 20.0) / 20.0)
    text = csv_text(Fixes(seen.time, seen.north + wander, seen.east - wander, seen.height - wander))
    cells = [f"{16 - 5 * share:.0f},{0.02 + 3.0 * share:.2f},{0.03 + 4.5 * share:.2f}" for share in lost]
    rows = zip(text.splitlines(), ["satellites,hAcc [m],vAcc [m]", *cells], strict=True)
    flown = imported("\n".join(",".join(row) for row in rows) + "\n")
    assert [breach for breach in flown.violations if breach.certain] == []
    assert any("say 3 m instead of 0.02 m from" in remark for remark in flown.remarks)


def test_an_accuracy_that_no_receiver_has_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text(csv_text(SEEN))
    with pytest.raises(UsageError, match="an accuracy of 0 m is out of range"):
        airrace.import_log(path, "rovinj_2014", accuracy=0.0)
