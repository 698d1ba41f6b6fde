"""Tacview's ACMI 2.2: several aircraft on one clock, with attitude, airspeeds, load factors and throttle.

Gates, pylons and people are static objects; every passing is an event of its aircraft. Lengths are in metres, speeds in
m/s, angles in degrees, as the format requires.
"""

import math
from collections.abc import Iterator, Sequence
from datetime import datetime

import numpy as np

from airrace.files.export.globe import Shape, courses, features, places, printable, stamp
from airrace.flights.results import Flight

FIRST_AIRCRAFT, FIRST_FEATURE = 0x100, 0x1000
COLOURS = ("Red", "Blue", "Green", "Orange", "Violet", "Cyan")
PROPERTIES: tuple[tuple[str, str, float, int], ...] = (
    ("IAS", "V_I", 1.0, 2),
    ("TAS", "V_A", 1.0, 2),
    ("AOA", "alpha_A", math.degrees(1.0), 2),
    ("AOS", "beta_A", math.degrees(1.0), 2),
    ("Throttle", "delta_T", 1.0, 3),
    ("VerticalGForce", "n_z", 1.0, 3),
    ("LateralGForce", "n_y", 1.0, 3),
    ("LongitudinalGForce", "n_x", 1.0, 3),
)
"""Properties of an aircraft: their names, histories, factors from SI, and decimals."""


def acmi(flights: Sequence[Flight], begin: datetime) -> bytes:
    """Return a recording of flights that start together."""
    title = ", ".join(dict.fromkeys(flight.course.name for flight in flights))
    lines = [
        "FileType=text/acmi/tacview",
        "FileVersion=2.2",
        f"0,ReferenceTime={stamp(begin, 0.0)[:19]}Z",
        "0,ReferenceLongitude=0",
        "0,ReferenceLatitude=0",
        "0,DataSource=airrace",
        f"0,Title={_text(title)}",
        f"0,Comments={_text('; '.join(f'{flight.label}: {flight.stamp.text}' for flight in flights))}",
        *_features(flights),
    ]
    for number, flight in enumerate(flights):
        name, pilot, colour = _text(flight.aircraft.name), _text(flight.label), COLOURS[number % len(COLOURS)]
        key = f"{FIRST_AIRCRAFT + number:x}"
        lines.append(f"{key},Name={name},Type=Air+FixedWing,Pilot={pilot},CallSign={pilot},Color={colour}")
    last, lead = -math.inf, begin.microsecond / 1e6  # the reference is a whole second
    for time, _, line in sorted(_moments(flights), key=lambda moment: moment[:2]):
        if time != last:
            lines.append(f"#{time + lead:.3f}")
            last = time
        lines.append(line)
    return ("\ufeff" + "\n".join(lines) + "\n").encode()


def _features(flights: Sequence[Flight]) -> Iterator[str]:
    """Yield a line for every place of the courses' features."""
    number = FIRST_FEATURE
    for course in courses(flights):
        for feature in features(course):
            for east, north in feature.places:
                kind = "Navaid+Static+Waypoint" if feature.shape is not Shape.AREA else "Navaid+Static+Bullseye"
                place = f"{east:.8f}|{north:.8f}|{course.origin.elevation:.2f}"
                size = f",Height={feature.height:g}" if feature.height else ""
                yield f"{number:x},T={place},Type={kind},Name={_text(f'{feature.kind} {feature.name}')}{size}"
                number += 1


def _moments(flights: Sequence[Flight]) -> Iterator[tuple[float, int, str]]:
    """Yield time, rank within the time, and line of every state and event."""
    for number, flight in enumerate(flights):
        key = f"{FIRST_AIRCRAFT + number:x}"
        for time, text in zip(np.round(flight.time, 3).tolist(), _states(flight), strict=True):
            yield time, 0, f"{key},{text}"
        for crossing in flight.crossings:
            if crossing.found:
                message = _text(f"{flight.label}: {crossing.name} at {crossing.time:.3f} s")
                yield round(crossing.time, 3), 1, f"0,Event=Message|{key}|{message}"
        yield round(float(flight.time[-1]) + 0.001, 3), 2, f"-{key}"


def _states(flight: Flight) -> Iterator[str]:
    """Yield, for every time, the place and the attitude of the aircraft and those of its properties that it has."""
    attitude = [np.degrees(flight.values("phi")), np.degrees(flight.values("theta"))]
    attitude.append(np.remainder(np.degrees(flight.values("psi")), 360.0))
    properties = [
        (name, factor * flight[history], digits) for name, history, factor, digits in PROPERTIES if history in flight
    ]
    for row, (east, north, up) in enumerate(places(flight)):
        texts = [f"T={east:.8f}", f"{north:.8f}", f"{up:.3f}"]
        texts += [f"{angle[row]:.2f}" if math.isfinite(angle[row]) else "" for angle in attitude]
        state = "|".join(texts)
        for name, values, digits in properties:
            if math.isfinite(values[row]):
                state += f",{name}={values[row]:.{digits}f}"
        yield state


def _text(text: str) -> str:
    """Return a text in which no comma ends a property and no bar an event's text."""
    return printable(text).replace("\\", "/").replace(",", "\\,").replace("|", "/")
