"""The contents of a report as its script is told them: plain data, written into the page as JSON.

The object, with the format's name first:

    format          "airrace-report/1"
    course          elements, crowd, lines, airspace, frame: see `airrace.report.course_contents`
    flights         the flights, the first of which the page is about; the others are its ghosts
      label           what tells it from the others
      aircraft        {name, span}: span of its wing, m
      race_time       s; null where the flight has not made the first and the last passing
      passings        [{name, time}], in their order
      time            s, rising, N values
      histories       by name, N values each; a flight need not have all of them
    strips          the histories that are drawn over time, from top to bottom
      title, unit, digits
      lines           [{history, label}], the main one first
      limits          [{value, label}], in the strip's unit
      wraps           after how many units the quantity repeats (a bank angle after 360); null if never
      least           smallest extent of the axis, in its unit
    colours         by what the line in space can be coloured
      title, history, unit, digits
      signed          whether the scale is symmetric about zero
    differences     for every other flight how far it is behind, place by place along the course
      flight          its number
      time            when the first flight was at these places, s, n values
      difference      how much later the other flight was there, s, n values

Numbers of histories are 32-bit floats, least significant byte first, written as base64; NaN where nothing is known. The
histories `north`, `east`, `height` (m, in the track's frame) and `q0` to `q3` (the rotation from body axes to north,
east, down; scalar first) are in every flight; all others are in the units in which they are shown.
"""

import base64
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import field

import numpy as np

from airrace.records import record
from airrace.trajectory import Array

FORMAT = "airrace-report/1"
POSE = ("north", "east", "height", "q0", "q1", "q2", "q3")
"""Histories that every flight has."""


@record
class FlightContents:
    """One flight as the page sees it.

    Attributes:
        label: what tells it from the others.
        aircraft: the name of its aircraft.
        span: of its wing, m.
        race_time: s; NaN where the flight has not made the first and the last passing.
        passings: name and time (s) of each, in their order.
        time: s, rising; shape (N,).
        histories: by name, each of shape (N,); those of `POSE` and any others, in the units in which they are shown.
    """

    label: str
    aircraft: str
    span: float
    race_time: float
    passings: Sequence[tuple[str, float]]
    time: Array
    histories: Mapping[str, Array]

    def as_object(self) -> dict[str, object]:
        return {
            "label": self.label,
            "aircraft": {"name": self.aircraft, "span": self.span},
            "race_time": self.race_time if math.isfinite(self.race_time) else None,
            "passings": [{"name": name, "time": time} for name, time in self.passings],
            "time": packed(self.time),
            "histories": {name: packed(values) for name, values in self.histories.items()},
        }


@record
class Strip:
    """Histories of one kind over time.

    Attributes:
        lines: name of a history and what it is called, the main one first.
        limits: values that must not be passed, in the strip's unit, and what sets each.
        wraps: after how many units the quantity repeats; None if never.
        least: smallest extent of the axis, in its unit, so that noise of a constant does not fill the strip.
    """

    title: str
    unit: str
    digits: int
    lines: Sequence[tuple[str, str]]
    limits: Sequence[tuple[float, str]] = ()
    wraps: float | None = None
    least: float = 1e-3

    def as_object(self) -> dict[str, object]:
        return {
            "title": self.title,
            "unit": self.unit,
            "digits": self.digits,
            "lines": [{"history": history, "label": label} for history, label in self.lines],
            "limits": [{"value": value, "label": label} for value, label in self.limits],
            "wraps": self.wraps,
            "least": self.least,
        }


@record
class Scale:
    """A history by which the line in space can be coloured; `signed` scales are symmetric about zero."""

    title: str
    history: str
    unit: str
    digits: int
    signed: bool = False


@record
class Difference:
    """The delay (s) with which a flight was where the first one was at the times `time` (s); each of shape (n,)."""

    flight: int
    time: Array
    difference: Array

    def as_object(self) -> dict[str, object]:
        return {"flight": self.flight, "time": packed(self.time), "difference": packed(self.difference)}


@record
class Contents:
    """All the data that the script of a report is told."""

    course: Mapping[str, object]
    flights: Sequence[FlightContents]
    strips: Sequence[Strip]
    colours: Sequence[Scale]
    differences: Sequence[Difference] = field(default=())

    def as_json(self) -> str:
        """Return the object as text that may stand in a `script` element: it holds no `<`, so nothing can end the
        element.

        Raises:
            ValueError: a number other than those of the histories is not finite.
        """
        told = {
            "format": FORMAT,
            "course": self.course,
            "flights": [flight.as_object() for flight in self.flights],
            "strips": [strip.as_object() for strip in self.strips],
            "colours": [vars(scale) for scale in self.colours],
            "differences": [one.as_object() for one in self.differences],
        }
        text = json.dumps(told, allow_nan=False, separators=(",", ":"))  # ASCII alone: all other letters are escaped
        return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def packed(values: Array) -> str:
    """Return numbers as 32-bit floats, least significant byte first, in base64."""
    return base64.b64encode(np.asarray(values, dtype="<f4").tobytes()).decode("ascii")


def unpacked(text: str) -> Array:
    """Return the numbers that `packed` has written."""
    return np.frombuffer(base64.b64decode(text), dtype="<f4").astype(np.float64)
