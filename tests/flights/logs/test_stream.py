"""States of a stream are those that were flown, whatever language they come in, and what cannot be true is no state."""

import dataclasses
import json
import math
import struct
from collections.abc import Callable, Iterable, Mapping

import numpy as np
import pytest
from races import SHIPPED

from airrace.flights.logs.stream import FOOT, StreamError, StreamReader
from airrace.model.environment import g0
from airrace.model.frames import QUATERNION, angles, rotation
from airrace.model.track.course import Origin, geodetic

ORIGIN = Origin(math.radians(45.08), math.radians(13.63), 5.0)
RACE = SHIPPED["rovinj_2014"]
RACE = dataclasses.replace(RACE, course=dataclasses.replace(RACE.course, origin=ORIGIN))
SPEED, RADIUS = 90.0, 250.0
"""Of a level circle to the right, m/s and m."""
BANK = math.atan(SPEED**2 / RADIUS / g0)
LOAD = 1.0 / math.cos(BANK)


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


def as_xplane(time: float, *, motion: bool = True) -> list[bytes]:
    latitude, longitude, altitude = coordinates(time)
    turned = SPEED * time / RADIUS
    rows: list[tuple[float, ...]] = [
        (1, 0.0, 0.0, time),
        (4, 0.0, 0.0, 0.0, 0.0, LOAD),
        (17, 3.0, math.degrees(BANK)),
        (20, latitude, longitude, altitude / FOOT),
    ]
    if motion:  # east, up and south of some origin
        rows.append((21, 1e3, 50.0, -2e3, SPEED * math.sin(turned), 0.0, -SPEED * math.cos(turned)))
    packed = [struct.pack("<i8f", row[0], *row[1:], *[0.0] * (9 - len(row))) for row in rows]
    return [b"DATA*" + b"".join(packed)]


def as_xplane_without_motion(time: float) -> list[bytes]:
    return as_xplane(time, motion=False)


def assert_on_circle(time: float, values: Mapping[str, float], *, place: float, speed: float, angle: float) -> None:
    """Assert that a state is that of the circle, within errors of place (m), speed (m/s) and angles (rad)."""
    north, east, height = place_at(time)
    assert math.dist((values["x"], values["y"]), (north, east)) < place
    assert values["z"] == pytest.approx(-height, abs=0.05)
    assert values["V_K"] == pytest.approx(SPEED, abs=speed)
    chi, gamma, bank = angles(rotation([values[name] for name in QUATERNION]))
    assert math.remainder(float(chi) - SPEED * time / RADIUS, 2.0 * math.pi) == pytest.approx(0.0, abs=angle)
    assert gamma == pytest.approx(0.0, abs=angle)
    assert bank == pytest.approx(BANK, abs=angle)
    assert values["n_z"] == pytest.approx(LOAD, rel=0.05)


@pytest.mark.parametrize(
    ("write", "rate", "place", "speed", "angle"),
    [
        (as_json, 10.0, 1e-6, 0.2, 0.03),
        (as_json, 4.0, 1e-6, 1.0, 0.05),
        (as_nmea, 10.0, 0.05, 0.2, 0.03),
        (as_xplane, 20.0, 0.5, 1e-3, 1e-3),
        (as_xplane, 100.0, 0.5, 1e-3, 1e-3),
        (as_xplane_without_motion, 20.0, 0.5, 2.5, 0.03),
    ],
)
def test_states_of_a_circle_are_recovered_from_every_language(
    write: Callable[[float], list[bytes]], rate: float, place: float, speed: float, angle: float
) -> None:
    reader, states = StreamReader(RACE), list[tuple[float, dict[str, float]]]()
    for number in range(int(3.0 * rate)):
        for message in write(number / rate):
            state = reader.state(message)
            if state is not None:
                states.append(state)
    assert len(states) >= 2.0 * rate
    for time, values in states:
        assert_on_circle(time % 43200.0, values, place=place, speed=speed, angle=angle)


@pytest.mark.parametrize("silence", [0.5, 2.0])
def test_nothing_is_derived_across_a_silence(silence: float) -> None:
    reader, states, remarks = StreamReader(RACE), list[tuple[float, dict[str, float]]](), list[str]()
    for number in range(20):
        time = 0.1 * number + (silence if number > 9 else 0.0)
        try:
            state = reader.state(as_json(time)[0])
        except StreamError as error:
            remarks.append(str(error))
            continue
        if state is not None:
            states.append(state)
    assert len(states) == 16  # each piece begins with two places
    for time, values in states:
        assert_on_circle(time, values, place=1e-6, speed=0.2, angle=0.03)
    assert len(remarks) == 1
    assert "without a state" in remarks[0]


def test_a_state_with_all_that_is_needed_takes_no_others() -> None:
    sent = {"north_m_s": SPEED, "east_m_s": 0.0, "up_m_s": 0.0, "bank_deg": math.degrees(BANK), "n_z": LOAD}
    state = StreamReader(RACE).state(as_json(0.0, **sent)[0])
    assert state is not None
    assert_on_circle(*state, place=1e-9, speed=1e-9, angle=1e-9)


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
        (b'{"time_s": 1.1, "latitude_deg": 1e999, "longitude_deg": 1, "altitude_m": 1}', "no number"),
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
