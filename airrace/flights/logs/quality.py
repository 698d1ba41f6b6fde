"""What a log says of its own quality: satellites, dilution of precision, accuracies and the type of the fix.

A receiver's position is off by its range error times the dilution of precision (DOP). Receivers that know their
accuracy state it. All are standard deviations here; the error itself changes slowly, so it is common to neighbouring
samples.
"""

import math
import re
from dataclasses import dataclass, replace
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from airrace.flights.logs.recording import Recording, count_of
from airrace.optimal_control.trajectory import Array

PLAIN_RECEIVER = 2.5
"""The standard deviation over ground of a receiver without corrections at a DOP of 1, m [GPS SPS Performance Standard,
2020: a range error of 7.8 m (95 %) at worst; phones and loggers are commonly off by 2 to 3 m]."""
VERTICAL_RATIO = 1.6
"""The ratio of the deviation of heights to that over ground: no satellite is below."""
LOSS_FACTOR = 2.0
"""The factor by which positions have to be known worse at times for that to be reported."""
SATELLITES_MIN = 4
"""The number of satellites that a position in space takes."""
SATELLITES_COUNT = 64
"""Racelogic's recorders add this, or twice this, to the number of satellites for a trigger or corrections."""


class FixType(IntEnum):
    """The type of a fix; the numbers are those of MAVLink's GPS_FIX_TYPE."""

    NONE = 0
    NOT_CONNECTED = 1
    FLAT = 2
    SPACE = 3
    DIFFERENTIAL = 4
    FLOAT = 5
    FIXED = 6


DEVIATIONS = {
    FixType.FLAT: 2.0 * PLAIN_RECEIVER,
    FixType.SPACE: PLAIN_RECEIVER,
    FixType.DIFFERENTIAL: 1.0,
    FixType.FLOAT: 0.4,
    FixType.FIXED: 0.02,
}
"""The standard deviations over ground by the type of the fix, m; those of manufacturers' data sheets, rounded up."""
_NMEA = ("NONE", "SPACE", "DIFFERENTIAL", "SPACE", "FIXED", "FLOAT", "NONE", "SPACE", "NONE", "DIFFERENTIAL")
_RACELOGIC = ("NONE", "SPACE", "DIFFERENTIAL", "FLOAT", "FIXED")
CODES = {
    "mavlink": (*FixType, FixType.FIXED, FixType.FIXED),
    "nmea": tuple(FixType[name] for name in _NMEA),
    "racelogic": tuple(FixType[name] for name in _RACELOGIC),
}
"""Fix types by number: of MAVLink (PX4, ArduPilot; u-blox up to 3), of GGA sentences, of Racelogic's solution type."""
_WORDS = (
    (re.compile(r"\bno\b|^no(ne|fix)|inv|void|0d|dead|^est"), FixType.NONE),
    (re.compile(r"float"), FixType.FLOAT),
    (re.compile(r"rtk|^fixed"), FixType.FIXED),
    (re.compile(r"dgps|dgnss|diff|sbas|waas|egnos"), FixType.DIFFERENTIAL),
    (re.compile(r"2d"), FixType.FLAT),
    (re.compile(r"3d|gps|gnss|pps|standalone|single|fix|valid"), FixType.SPACE),
)
"""Fix types by the first of these that a text begins with, or holds behind another word."""


def fix_type(text: str, code: str = "mavlink") -> float:
    """Return the number of the fix type that a text means; NaN where it means none.

    Args:
        text: a word (`3D`, `RTK float`) or a number.
        code: what numbers mean, of `CODES`.
    """
    plain = text.strip().lower()
    try:
        number = int(float(plain))
    except (ValueError, OverflowError):
        return next((float(fix) for words, fix in _WORDS if words.search(plain)), math.nan)
    return float(CODES[code][number]) if 0 <= number < len(CODES[code]) else math.nan


def without_fix_left_out(recording: Recording) -> Recording:
    """Return the recording without positions where there was no fix, and without heights where it was a flat one.

    Where that would be most of them, the column means something else and is not used.
    """
    columns = dict(recording.columns)
    fix, satellites = (columns.get(name, np.full(len(recording.time), np.nan)) for name in ("fix_type", "satellites"))
    missing = np.isin(fix, (FixType.NONE, FixType.NOT_CONNECTED))
    missing |= np.mod(satellites, SATELLITES_COUNT) < SATELLITES_MIN - 1
    flat = ~missing & ((fix == FixType.FLAT) | (np.mod(satellites, SATELLITES_COUNT) == SATELLITES_MIN - 1))
    remarks: list[str] = []
    for rows, names, words in (
        (missing, ("latitude", "longitude", "x", "y", "altitude", "height"), "without a fix and left out"),
        (flat, ("altitude", "height"), "with a fix over ground only, whose heights are left out"),
    ):
        if 2 * rows.sum() > len(rows):
            remarks.append(f"most samples are {words.partition(' and')[0].partition(',')[0]}: that is not believed")
        elif rows.any():
            columns |= {name: np.where(rows, np.nan, columns[name]) for name in names if name in columns}
            first = int(recording.lines[rows][0])
            remarks.append(f"{count_of(int(rows.sum()), 'sample')} {words}, the first one in line {first}")
    return replace(recording, columns=columns, remarks=(*recording.remarks, *remarks))


@dataclass(frozen=True, eq=False)
class ReceiverAccuracy:
    """How well a receiver knows its positions.

    Attributes:
        across, up: standard deviations over ground and of heights, m, shape (n,).
        source: where they come from, in words; empty where nothing is stated.
    """

    across: Array
    up: Array
    source: str

    def loss(self, time: Array) -> str:
        """Return since when, of times of the samples, positions are known much worse, as a sentence; else empty."""
        least, most = float(np.min(self.across)), float(np.max(self.across))
        if most < LOSS_FACTOR * least:
            return ""
        since = float(time[int(np.argmax(self.across > math.sqrt(least * most)))])
        return f"{self.source} say {most:.2g} m instead of {least:.2g} m from {since:.1f} s after the start on"

    @property
    def text(self) -> str:
        """What judgements assume, in words."""
        if self.source.startswith("stated"):
            return f"an accuracy of {self.across[0]:g} m, as stated"
        least, most = float(np.min(self.across)), float(np.max(self.across))
        span = f"{least:.2g} m" if most < 1.1 * least else f"{least:.2g} to {most:.2g} m"
        if self.source:
            return f"an accuracy of {span} by {self.source}, and an offset of all that passings tell"
        return f"an accuracy of {span} and an offset of all that passings tell: nothing is stated (--accuracy does)"


def receiver_accuracy(recording: Recording) -> ReceiverAccuracy:
    """Return the accuracy of every sample: what the user states, else what the log says, else a plain receiver's.

    Of the log's own words stated accuracies count first, then the type of the fix, scaled by the DOP; where there is no
    DOP, by the satellites that are missing, for it grows as they get fewer.
    """
    one = np.ones(len(recording.time))
    if recording.accuracy is not None:
        stated = recording.accuracy * one
        return ReceiverAccuracy(stated, VERTICAL_RATIO * stated, f"stated {recording.accuracy:g} m")
    across, up, sources = PLAIN_RECEIVER * one, VERTICAL_RATIO * PLAIN_RECEIVER * one, list[str]()
    fix, satellites, hdop, vdop, pdop, h_acc, v_acc = (
        _filled(recording, name) for name in ("fix_type", "satellites", "hdop", "vdop", "pdop", "h_acc", "v_acc")
    )
    if fix is not None:
        by_type = np.array([DEVIATIONS.get(FixType(int(code)), PLAIN_RECEIVER) for code in np.rint(fix)])
        across, up, sources = by_type, VERTICAL_RATIO * by_type, ["fix type"]
    if hdop is not None or pdop is not None:
        assert pdop is not None or hdop is not None
        horizontal = hdop if hdop is not None else np.asarray(pdop) / math.hypot(1.0, VERTICAL_RATIO)
        vertical = VERTICAL_RATIO * horizontal
        if vdop is not None:
            vertical = vdop
        elif hdop is not None and pdop is not None:
            vertical = np.sqrt(np.maximum(pdop**2 - hdop**2, horizontal**2))
        across, up = across * np.maximum(horizontal, 1.0), up * np.maximum(vertical / VERTICAL_RATIO, 1.0)
        sources.append("HDOP" if hdop is not None else "PDOP")
    elif satellites is not None:
        count = np.maximum(np.mod(satellites, SATELLITES_COUNT), SATELLITES_MIN)
        fewer = np.sqrt((np.max(count) - SATELLITES_MIN + 1.0) / (count - SATELLITES_MIN + 1.0))
        across, up = across * fewer, up * fewer
        sources.append("satellites")
    if h_acc is not None:
        across, up, sources = h_acc, VERTICAL_RATIO * h_acc, ["horizontal accuracy"]
    if v_acc is not None:
        up, sources = v_acc, [*sources, "vertical accuracy"]
        across = v_acc / VERTICAL_RATIO if len(sources) == 1 else across
    return ReceiverAccuracy(across, up, f"the log's {' and '.join(sources)}" if sources else "")


def _filled(recording: Recording, name: str) -> Array | None:
    """Return a column with the last value where a sample says nothing; None where no sample says anything."""
    values = recording.columns.get(name)
    least = FixType.NOT_CONNECTED if name == "fix_type" else 0.0  # what has no fix has no position that counts, either
    usable: NDArray[np.bool_] = np.zeros(0, np.bool_) if values is None else np.isfinite(values) & (values > least)
    if values is None or not usable.any():
        return None
    rows = np.flatnonzero(usable)
    return values[rows[np.maximum(np.searchsorted(rows, np.arange(len(values)), side="right") - 1, 0)]]
