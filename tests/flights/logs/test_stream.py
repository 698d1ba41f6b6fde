"""States of a stream are those that were flown, whatever language they come in, and what cannot be true is no state."""

import dataclasses
import json
import math
import struct
from collections.abc import Iterable

import numpy as np
import pytest
from races import SHIPPED

from airrace.flights.logs.stream import FOOT, StreamError, StreamReader
from airrace.model.frames import QUATERNION, angles, rotation
from airrace.model.track.course import Origin, geodetic

ORIGIN = Origin(math.radians(45.08), math.radians(13.63), 5.0)
RACE = SHIPPED["rovinj_2014"]
RACE = dataclasses.replace(RACE, course=dataclasses.replace(RACE.course, origin=ORIGIN))
SPEED, RADIUS = 90.0, 250.0
"""Of a level circle to the right, m/s and m."""


def place_at(time: float) -> tuple[float, float, float]:
    turned = SPEED * time / RADIUS
    return RADIUS * math.sin(turned), RADIUS * (1.0 - math.cos(turned)), 40.0


def coordinates(time: float) -> tuple[float, float, float]:
    north, east, height = place_at(time)
    latitude, longitude = geodetic(np.array([north]), np.array([east]), ORIGIN)
    return math.degrees(float(latitude[0])), math.degrees(float(longitude[0])), height + ORIGIN.elevation


def as_json(time: float, **changes: float) -> list[bytes]:
    north, east, height = place_at(time)
    return [json.dumps({"time_s": time, "x_m": north, "y_m": east, "height_m": height, **changes}).encode()]


def as_nmea(time: float, quality: int = 1, status: str = "A") -> list[bytes]:
    latitude, longitude, altitude = coordinates(time)
    clock = f"1200{time:09.6f}"
    place = ",".join(
        f"{int(angle):0{digits}d}{60.0 * (angle % 1.0):012.9f},{side}"
        for angle, digits, side in ((latitude, 2, "N"), (longitude, 3, "E"))
    )
    sentences = (
        f"GPGGA,{clock},{place},{quality},12,0.8,{altitude:.4f},M,0.0,M,,",
        f"GPRMC,{clock},{status},{place},175.0,0.0,130414,,",
    )
    messages: list[bytes] = []
    for sentence in sentences:
        checksum = 0
        for character in sentence:
            checksum ^= ord(character)
        messages.append(f"${sentence}*{checksum:02X}\r\n".encode())
    return messages


def as_xplane(time: float) -> list[bytes]:
    latitude, longitude, altitude = coordinates(time)
    rows = [
        (1, 0.0, 0.0, time),
        (4, 0.0, 0.0, 0.0, 0.0, 3.4),
        (17, 3.0, 73.0),
        (20, latitude, longitude, altitude / FOOT),
    ]
    packed = [struct.pack("<i8f", row[0], *row[1:], *[0.0] * (9 - len(row))) for row in rows]
    return [b"DATA*" + b"".join(packed)]


@pytest.mark.parametrize("write", [as_json, as_nmea, as_xplane])
def test_states_of_a_circle_are_recovered_from_every_language(write: object) -> None:
    reader, state, time = StreamReader(RACE), None, 0.0
    assert callable(write)
    for number in range(20):
        for message in write(0.1 * number):
            state = reader.state(message) or state
    assert state is not None
    time, values = state
    coarse = write is as_xplane  # its coordinates have 24 bits
    north, east, height = place_at(1.9)
    assert time % 43200.0 == pytest.approx(1.9, abs=1e-3)
    assert math.dist((values["x"], values["y"]), (north, east)) < (1.0 if coarse else 0.05)
    assert values["z"] == pytest.approx(-height, abs=0.05)
    if not coarse:
        assert values["V_K"] == pytest.approx(SPEED, rel=0.01)
        _, gamma, bank = angles(rotation([values[name] for name in QUATERNION]))
        assert gamma == pytest.approx(0.0, abs=0.02)
        assert bank == pytest.approx(math.atan(SPEED**2 / RADIUS / 9.80665), abs=0.03)
        assert values["n_z"] == pytest.approx(math.hypot(1.0, SPEED**2 / RADIUS / 9.80665), rel=0.05)


@pytest.mark.parametrize(
    ("message", "words"),
    [
        (b"nonsense\n", "no JSON object"),
        (b"[1, 2]\n", "no JSON object"),
        (b'{"x_m": 1.0}\n', "without time_s"),
        (b'{"time_s": 2.0}\n', "without a place"),
        (as_json(2.0, x_m=math.nan)[0], "no number"),
        (as_json(0.5)[0], "does not run forwards"),
        (as_json(1.1, x_m=5000.0)[0], "a jump of"),
        (b"9" * 400, "no JSON object"),
        (as_json(1.1, x_m=10**400)[0], "no number"),
        (as_json(1.1, time_s=10**400)[0], "no number"),
        (b"[" * 60_000, "no JSON object"),
        (b"$GPGGA,120000.0,4500.0,N*00\r\n", "checksum"),
        (b"$GPGGA,120000.0,4500.0\r\n", "with a fix"),
        (b"DATA*", "lacks a row"),
        (b"DATA", "lacks a row"),
    ],
)
def test_what_is_no_state_is_told_and_survived(message: bytes, words: str) -> None:
    reader = StreamReader(RACE)
    for number in range(11):
        reader.state(as_json(0.1 * number)[0])
    with pytest.raises(StreamError, match=words):
        reader.state(message)
    after = reader.state(as_json(1.2)[0])
    assert after is not None
    assert after[1]["V_K"] == pytest.approx(SPEED, rel=0.02)


def test_a_clock_that_starts_anew_is_believed() -> None:
    reader = StreamReader(RACE)
    for time in (50.0, 50.1, 50.2):
        reader.state(as_json(time)[0])
    for time in (0.1, 0.2):
        with pytest.raises(StreamError, match="run forwards"):
            reader.state(as_json(time)[0])
    states = [reader.state(as_json(time)[0]) for time in (0.3, 0.4, 0.4, 0.5)]
    assert states[2] is None  # a pause tells nothing new
    assert states[3] is not None


def test_a_place_that_stays_after_a_jump_is_believed() -> None:
    reader = StreamReader(RACE)
    reader.state(as_json(0.0)[0])
    for time in (0.1, 0.2):
        with pytest.raises(StreamError, match="a jump"):
            reader.state(as_json(time, x_m=5000.0)[0])
    for time in (0.3, 0.4, 0.5):
        state = reader.state(as_json(time, x_m=5000.0)[0])
    assert state is not None
    assert state[1]["x"] == 5000.0


def answers_to(reader: StreamReader, messages: Iterable[bytes]) -> tuple[list[float], list[str]]:
    """Return the times of the states of some messages, s, and the remarks on them."""
    times, remarks = list[float](), list[str]()
    for message in messages:
        try:
            state = reader.state(message)
        except StreamError as error:
            remarks.append(str(error))
            continue
        if state is not None:
            times.append(state[0] % 60.0)
    return times, remarks


@pytest.mark.parametrize(("quality", "status"), [(0, "A"), (6, "A"), (1, "V"), (0, "V")])
@pytest.mark.parametrize("order", [1, -1])
def test_a_place_without_a_fix_is_no_state(quality: int, status: str, order: int) -> None:
    reader = StreamReader(RACE)
    for number in range(5):
        answers_to(reader, as_nmea(0.1 * number)[::order])
    times, remarks = answers_to(reader, as_nmea(0.5, quality, status)[::order])
    assert times == []
    assert remarks == ["NMEA without a fix: the receiver has no position"]
    times, remarks = answers_to(reader, as_nmea(0.6)[::order])
    assert times == pytest.approx([0.6], abs=1e-6)
    assert remarks == []


@pytest.mark.parametrize(("sentence", "words"), [(0, "without RMC"), (1, "no height comes")])
def test_sentences_that_never_make_a_state_are_told_of_once(sentence: int, words: str) -> None:
    times, remarks = answers_to(StreamReader(RACE), (as_nmea(0.1 * number)[sentence] for number in range(20)))
    assert times == []
    assert len(remarks) == 1
    assert words in remarks[0]
