"""The contents of a report: what the script in its page reads.

The object, with the format's name first:

    format          "airrace-report/1"
    course          elements, crowd, lines, airspace, frame: see `course_contents`
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

elements    what is passed
  name
  label       what is written beside it; empty where another one on the same spot carries it
  posts       feet of pylons, [[north, east], ...]
  top         height of the pylons, m
  window      ends [[north, east], [north, east]] of the stretch that is flown through; null where there is none
  reach       likewise, of the stretch beside a pylon in which a passing counts
  heights     [lowest, highest] of the passing, m
  place       [north, east, height] of its name; where it stands nowhere, where the first flight passed it
crowd       [{name, corners, closed, distance, height}]
lines       safety lines, [{name, start, end, keep_right}]
airspace    corners [[north, east], ...]; empty where there is none
frame       [south, north, west, east] of what is to be seen, m
"""

import base64
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import field

import numpy as np

from airrace.records import record
from airrace.track.course import CrowdShape
from airrace.track.element import Element
from airrace.trajectory import Array
from airrace.views.map_model import MapModel, coordinates

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
            "time": pack(self.time),
            "histories": {name: pack(values) for name, values in self.histories.items()},
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
class TimeDifference:
    """The delay (s) with which a flight was where the first one was at the times `time` (s); each of shape (n,)."""

    flight: int
    time: Array
    difference: Array

    def as_object(self) -> dict[str, object]:
        return {"flight": self.flight, "time": pack(self.time), "difference": pack(self.difference)}


@record
class Contents:
    """All the data that the script of a report is told."""

    course: Mapping[str, object]
    flights: Sequence[FlightContents]
    strips: Sequence[Strip]
    colours: Sequence[Scale]
    differences: Sequence[TimeDifference] = field(default=())

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


def pack(values: Array) -> str:
    """Return numbers as 32-bit floats, least significant byte first, in base64."""
    return base64.b64encode(np.asarray(values, dtype="<f4").tobytes()).decode("ascii")


def unpack(text: str) -> Array:
    """Return the numbers that `pack` has written."""
    return np.frombuffer(base64.b64decode(text), dtype="<f4").astype(np.float64)


INFLATED = 25.0
"""The usual height of an inflated pylon, m."""
ABOVE = 5.0
"""The height by which a pylon rises above the highest passing that counts, m."""
ENDLESS = 0.15
"""The share of the course's extent by which a safety line, which has no ends, is drawn beyond its defining points."""


def course_contents(map_: MapModel, passed: Mapping[str, tuple[float, float, float]]) -> dict[str, object]:
    """Return the object that the module describes.

    Args:
        map_: the race from above.
        passed: where the first flight passed the elements, by their names: north, east, height, m.
    """
    labels = {mark.element.name: mark.label for mark in map_.marks}
    elements = {passage.element.name: passage.element for passage in map_.race.course.passages}
    beyond = ENDLESS * max(map_.north - map_.south, map_.east - map_.west)
    return {
        "elements": [
            {"name": name, "label": labels.get(name, name), **_element(one, place)}
            for name, one in elements.items()
            if (place := one.position or passed.get(name)) is not None
        ],
        "crowd": [
            {
                "name": crowd.name,
                "corners": coordinates(crowd.corners).tolist(),
                "closed": crowd.shape is CrowdShape.AREA,
                "distance": crowd.distance,
                "height": crowd.height,
            }
            for crowd in map_.crowd
        ],
        "lines": [
            {
                "name": one.line.name,
                "start": (one.ends[0] - beyond * one.along).tolist(),
                "end": (one.ends[1] + beyond * one.along).tolist(),
                "keep_right": one.line.keep_right,
            }
            for one in map_.lines
        ],
        "airspace": [] if map_.airspace is None else map_.airspace[:-1].tolist(),
        "frame": [map_.south, map_.north, map_.west, map_.east],
    }


def _element(element: Element, place: tuple[float, float, float]) -> dict[str, object]:
    """Return an element whose passings have bounded heights, also where its rules leave them free."""
    drawing, allowed = element.drawing(), element.heights
    low = allowed.lower if math.isfinite(allowed.lower) else 0.0
    high = allowed.upper if math.isfinite(allowed.upper) else place[2] + INFLATED
    return {
        "posts": coordinates(drawing.posts).tolist(),
        "top": max(INFLATED, high + ABOVE) if high < place[2] + 4.0 * INFLATED else place[2] + INFLATED,
        "window": None if drawing.window is None else coordinates(drawing.window).tolist(),
        "reach": None if drawing.reach is None else coordinates(drawing.reach).tolist(),
        "heights": [low, high],
        "place": list(place),
    }
