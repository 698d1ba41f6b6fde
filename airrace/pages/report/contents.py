"""The contents of a report: what the script in its page reads.

The object, with the format's name first:

    format          "airrace-report/1"
    units           {speed, length, per_m}: those of the page, and how many lengths are a metre
    course          elements, crowd, obstacles, lines, airspace, frame: see below
    flights         the flights, the first of which the page is about; the others are its ghosts
      label           what tells it from the others: who flies, where that is told
      named           whether it is told who flies
      nation, number, colour  of who flies, each empty where it is not told
      stamp           what it is: stage, certificate, aircraft, air; in the language of the broadcast
      aircraft        {name, span}: span of its wing, m
      race_time       s; null where the flight has not made the first and the last passing
      passings        [{name, lap, time, number}], in their order: the element's name, which lap it belongs to, and
                      which passing of the course it is
      penalties       [{time, rule, gate, seconds}], in the order of time: what is broken, at which gate (may be empty),
                      and what is added, s; null where the race is over, 0 where the rules name none
      time            s, rising, N values
      histories       by name, N values each; a flight need not have all of them
      envelope        of closed-loop flights along it, 95 % of them: time (s) and `left`, `right`, `below`, `above`, the
                      deviations (m, to the right and upwards) at these times; null where there are none
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
      legs            those that both completed, [{passing, lost, reasons}]: the number of the passing that ends it,
                      what the other flight loses on it (s; negative where the first one does), and why the one loses
                      that does: {cause, lost, rank, facts}, texts in the language of the broadcast; first what is
                      particular of the leg (rank 0), then the aircraft (1), last the speed before the leg (2)
      common          [{flight, cause}]: what costs the flight of this number time on every leg, in no leg's reasons

    broadcast       of films and cards: `decimal`, the sign before decimals; `texts` by their keys, see languages.toml;
                    `subtitle` and `state` of the first flight on a card

Numbers of histories are 32-bit floats, least significant byte first, written as base64; NaN where nothing is known. The
histories `north`, `east`, `up` (m, in the track's frame), `way` (the distance flown since the first passing) and `q0`
to `q3` (the rotation from body axes to north, east, down; scalar first) are in every flight; all but places and
rotations are in the units in which they are shown.

elements    what is passed
  name
  label       what is written beside it; empty where another one on the same spot carries it
  posts       feet of pylons, [[north, east], ...]
  top         height of the pylons, m
  window      ends [[north, east], [north, east]] of the opening; null where there is none
  reach       likewise, of the stretch beside a pylon in which a passing counts
  heights     [lowest, highest] of the passing, m
  place       [north, east, height] of its name; where it stands nowhere, where the first flight passed it
crowd       [{name, corners, closed, distance, height}]
obstacles   [{name, corners, height}]
lines       safety lines, [{name, start, end, keep_right}]
airspace    corners [[north, east], ...]; empty where there is none
latitude    of the origin, rad; null where it is not known
elevation   of the origin above the sea, m; null where its place is not known
frame       [south, north, west, east] of what is to be seen, m
"""

import base64
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from typing import TYPE_CHECKING

import numpy as np

from airrace.flights.results import Flight
from airrace.flights.results.clearances import with_nearest
from airrace.flights.results.comparison import SHARES, Comparison
from airrace.flights.results.flight import BODY_ATTITUDE, Leg, way
from airrace.flights.results.time_loss import common_causes, leg_losses
from airrace.model.track.course import CrowdShape
from airrace.model.track.element import Element
from airrace.optimal_control.quantities import DEGREE, KNOT
from airrace.optimal_control.trajectory import Array
from airrace.pages.report.film import Language
from airrace.pages.report.languages import cause_text, decimal_sign, graphics_texts, reason_texts, stamp_text
from airrace.pages.views.map_model import MapModel, coordinates
from airrace.pages.views.tables import RACE, Units

if TYPE_CHECKING:
    from airrace.flights.safety.monte_carlo import SafetyResult

FORMAT = "airrace-report/1"


PYLON_HEIGHT = 25.0
"""The usual height of an inflated pylon, m."""
NEAR = 50.0
"""The distance up to which those of the wing are drawn, m; else the near ones would look like zero."""


@dataclass(frozen=True)
class Strip:
    """Histories of one kind over time.

    Attributes:
        title, unit: for people; of speeds and lengths SPEED and LENGTH, which are asked for.
        factor: the unit, in SI units or radians.
        lines: name of a history and what it is called, the main one first.
        limited: those of them whose limits are drawn.
        digits: behind the point.
        wraps: after how many units the quantity repeats; None if never.
        least: smallest extent of the axis, in the unit, so that noise of a constant does not fill the strip.
    """

    title: str
    unit: str
    factor: float
    lines: tuple[tuple[str, str], ...]
    limited: tuple[str, ...] = ()
    digits: int = 0
    wraps: float | None = None
    least: float = 1.0


SPEED, LENGTH = "kt", "m"
"""Units that give way to those that are asked for."""

STRIPS = (
    Strip("Speed", "kt", KNOT, (("V_I", "indicated"), ("V_A", "true"), ("V_K", "over ground")), ("V_K",), least=5.0),
    Strip("Height", "m", 1.0, (("height", "above the origin"),), ("height",), least=5.0),
    Strip("Load factor", "g", 1.0, (("n_z", "up"), ("n_y", "sideways")), ("n_z",), digits=1),
    Strip("Bank", "°", DEGREE, (("mu", "right wing down"),), wraps=360.0),
    Strip("Roll rate", "°/s", DEGREE, (("p_Kbar", "to the right"),), ("p_Kbar",), least=10.0),
    Strip("Climb", "°", DEGREE, (("gamma", "upwards"),), least=5.0),
    Strip("Angles", "°", DEGREE, (("alpha_A", "attack"), ("beta_A", "sideslip")), ("alpha_A", "beta_A"), digits=1),
    Strip(
        "Surfaces",
        "°",
        DEGREE,
        (("eta", "elevator"), ("xi", "ailerons"), ("zeta", "rudder")),
        ("eta", "xi", "zeta"),
        digits=1,
    ),
    Strip("Throttle", "%", 0.01, (("delta_T", "power"),), least=5.0),
    Strip("Wing to the nearest", "m", 1.0, (("nearest_pylon", "pylon"), ("nearest_obstacle", "obstacle"))),
    Strip(
        "Away from",
        "m",
        1.0,
        (("nearest_crowd", "people"), ("nearest_safety_line", "safety line"), ("distance_airspace", "border")),
        ("nearest_crowd",),
    ),
    Strip("Energy height", "m", 1.0, (("h_E", "above the origin"),), least=5.0),
)
"""The strips of a report, from top to bottom."""

COLOURS: tuple[dict[str, object], ...] = (
    {"title": "Load factor", "history": "n_z", "digits": 1, "signed": False},
    {"title": "Speed", "history": "V_I", "digits": 0, "signed": False},
    {"title": "Roll rate", "history": "p_Kbar", "digits": 0, "signed": True},
    {"title": "Energy height", "history": "h_E", "digits": 0, "signed": False},
)


def in_units(strip: Strip, units: Units) -> Strip:
    """Return a strip in the units that are asked for."""
    if strip.unit == SPEED:
        return replace(strip, unit=units.speed, factor=1.0 / units.per_m_s)
    if strip.unit == LENGTH:
        return replace(strip, unit=units.length, factor=1.0 / units.per_m)
    return strip


def unit_of(history: str, units: Units) -> str:
    """Return the unit of a history of a strip."""
    return next(in_units(strip, units).unit for strip in STRIPS if history in dict(strip.lines))


def contents_of(
    flights: Sequence[Flight],
    comparisons: Sequence[Comparison],
    map_: MapModel,
    envelope: "SafetyResult | None" = None,
    units: Units = RACE,
    language: Language = Language.EN,
    card: Mapping[str, str] | None = None,
) -> dict[str, object]:
    """Return the object that the module describes.

    Args:
        flights: the first is what the page is about, the others are its ghosts.
        comparisons: of the others with the first, in their order.
        map_: the race of the first from above.
        envelope: closed-loop flights along the first; None for none.
        units: of speeds and lengths in histories.
        language: of films and cards.
        card: `subtitle` and `state`.
    """
    flights = [with_nearest(flight, NEAR) for flight in flights]
    first = flights[0]
    flight_objects = [
        {**_flight(flight, label, units), "stamp": stamp_text(flight, language, units), "envelope": None}
        for flight, label in zip(flights, short_labels(flights), strict=True)
    ]
    if envelope:
        flight_objects[0]["envelope"] = _envelope(envelope, first)
    histories = {name for flight in flights for name in flight.histories}
    strips = [in_units(strip, units) for strip in STRIPS if any(name in histories for name, _ in strip.lines)]
    return {
        "format": FORMAT,
        "units": {"speed": units.speed, "length": units.length, "per_m": units.per_m},
        "course": _course(map_, first),
        "flights": flight_objects,
        "strips": [_strip(strip, first) for strip in strips],
        "colours": [
            {**colour, "unit": unit_of(str(colour["history"]), units)}
            for colour in COLOURS
            if colour["history"] in first
        ],
        "differences": [
            {
                "flight": number,
                "time": pack(time),
                "difference": pack(loss),
                **_legs_lost(comparison, number, language, units),
            }
            for number, comparison in enumerate(comparisons, start=1)
            for time, loss in [time_lost(comparison)]
        ],
        "broadcast": {"decimal": decimal_sign(language), "texts": graphics_texts(language), **(card or {})},
    }


def _legs_lost(comparison: Comparison, number: int, language: Language, units: Units) -> dict[str, object]:
    """Return the legs of the first flight and that of a number: who loses how much on each, and by what, and on all."""
    numbers = {leg.name: number for number, leg in enumerate(comparison.legs, start=1)}
    differences = {leg.name: leg.difference for leg in comparison.legs}
    other_wind = comparison.reference.air.wind != comparison.flight.air.wind
    reference_causes, flight_causes = common_causes(comparison, other_wind)
    legs: list[dict[str, object]] = []
    for loss in leg_losses(comparison):
        lost = differences[loss.end]
        common = flight_causes if lost >= 0.0 else reference_causes
        reasons = reason_texts(loss, common, other_wind, language, units)
        legs.append({"passing": numbers[loss.end], "lost": lost, "reasons": reasons})
    common = [
        {"flight": loser, "cause": cause_text(cause, other_wind, language)}
        for loser, causes in ((0, reference_causes), (number, flight_causes))
        for cause in causes
    ]
    return {"legs": legs, "common": common}


def _envelope(result: "SafetyResult", flight: Flight) -> dict[str, str]:
    """Return the deviations between which 95 % of closed-loop flights lie; none where that is not known."""
    low, high = (np.nan_to_num(result.envelope[row]) for row in (1, 3))
    edges = {"left": low[0], "right": high[0], "below": low[1], "above": high[1]}
    return {"time": pack(result.clock - clock_start(flight)), **{name: pack(values) for name, values in edges.items()}}


def as_json(contents: Mapping[str, object]) -> str:
    """Return contents as text that may stand in a `script` element: it holds no `<`, so nothing can end the element.

    Raises:
        ValueError: a number other than those of the histories is not finite.
    """
    text = json.dumps(contents, allow_nan=False, separators=(",", ":"))  # ASCII alone: all other letters are escaped
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def pack(values: Array) -> str:
    """Return numbers as 32-bit floats, least significant byte first, in base64."""
    return base64.b64encode(np.asarray(values, dtype="<f4").tobytes()).decode("ascii")


def clock_start(flight: Flight) -> float:
    """Return when the clock of a flight starts, s: at its first passing, or where that is missing at its first time."""
    starts = flight.crossings and flight.crossings[0].found
    return flight.crossings[0].time if starts else float(flight.time[0])


def race_begins(flight: Flight) -> datetime | None:
    """Return when the clock of the race starts in a flight; None where no log knows it."""
    begins = flight.source.begins
    return None if begins is None else begins + timedelta(seconds=clock_start(flight))


def way_from_start(flight: Flight) -> Array:
    """Return the distance along the flight from its first passing, m, shape (n,); negative before it."""
    places = np.stack([flight[name] for name in ("x", "y", "z")])
    distance = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(places, axis=1), axis=0))])
    return distance - np.interp(clock_start(flight), flight.time, distance)


def short_labels(flights: Sequence[Flight]) -> list[str]:
    """Return labels without what they all begin with, up to a colon: stages alone, where all flights are of one run."""
    files = {flight.label.rpartition(":")[0] for flight in flights}
    return [flight.label.rpartition(":")[2] if len(files) == 1 else flight.label for flight in flights]


def time_lost(comparison: Comparison) -> tuple[Array, Array]:
    """Return when the reference was at places along the course, and what the other had lost there, s, (n,) each."""
    reference = comparison.reference
    times = [np.array([reference.crossings[0].time]), *(_times(reference, leg.reference) for leg in comparison.legs)]
    time, loss = np.concatenate(times), comparison.progress.difference
    is_finite = np.isfinite(time)
    return time[is_finite] - clock_start(reference), loss[is_finite]


def _times(flight: Flight, leg: Leg) -> Array:
    """Return when the shares of a leg were reached, its start left out, s; NaN where the leg is incomplete."""
    if not leg.is_complete:
        return np.full(len(SHARES) - 1, np.nan)
    distance = way(flight, leg)
    return np.interp(SHARES[1:], distance / distance[-1], flight.time[leg.rows])


def _flight(flight: Flight, label: str, units: Units) -> dict[str, object]:
    begin = clock_start(flight)
    gates = {crossing.name: crossing.passage.element.name for crossing in flight.crossings}
    histories = {"north": flight["x"], "east": flight["y"], "up": flight["height"]}
    histories["way"] = units.per_m * way_from_start(flight)
    histories |= {f"q{i}": flight[name] for i, name in enumerate(BODY_ATTITUDE)}
    for strip in STRIPS:
        factor = in_units(strip, units).factor
        histories |= {name: flight[name] / factor for name, _ in strip.lines if name in flight}
    return {
        "label": label,
        "named": bool(flight.source.entrant.name),
        **{name: getattr(flight.source.entrant, name) for name in ("nation", "number", "colour")},
        "aircraft": {"name": flight.aircraft.name, "span": flight.aircraft.airframe.b},
        "race_time": flight.race_time if math.isfinite(flight.race_time) else None,
        "passings": [
            {
                "name": crossing.passage.element.name,
                "lap": crossing.lap,
                "time": crossing.time - begin,
                "number": number,
            }
            for number, crossing in enumerate(flight.crossings)
            if crossing.found
        ],
        "penalties": [
            {
                "time": penalty.time - begin,
                "rule": penalty.rule,
                "gate": gates.get(penalty.passing, ""),
                "seconds": None if math.isinf(penalty.seconds) else float(np.nan_to_num(penalty.seconds)),
            }
            for penalty in flight.source.called_penalties
        ],
        "time": pack(flight.time - begin),
        "histories": {name: pack(values) for name, values in histories.items()},
    }


def _strip(strip: Strip, flight: Flight) -> dict[str, object]:
    """Return a strip with the limits of a flight that are finite, each once."""
    bounds: dict[float, str] = {}
    for name in strip.limited:
        allowed = flight.limit(name)
        for value, what in ((allowed.lower, "at least"), (allowed.upper, "at most")):
            if math.isfinite(value):
                bounds.setdefault(round(value / strip.factor, 6), what)
    return {
        "title": strip.title,
        "unit": strip.unit,
        "digits": strip.digits,
        "lines": [{"history": history, "label": label} for history, label in strip.lines],
        "limits": [{"value": value, "label": label} for value, label in bounds.items()],
        "wraps": strip.wraps,
        "least": strip.least,
    }


def _course(map_: MapModel, flight: Flight) -> dict[str, object]:
    """Return the course; what stands nowhere is where the flight passed it first."""
    passed: dict[str, tuple[float, float, float]] = {}
    for crossing in flight.crossings:
        if crossing.found:
            passed.setdefault(
                crossing.passage.element.name, (crossing.value("x"), crossing.value("y"), crossing.value("height"))
            )
    labels = {mark.element.name: mark.label for mark in map_.marks}
    elements = {passage.element.name: passage.element for passage in map_.race.course.passages}
    origin = map_.race.course.origin
    beyond = 0.15 * max(map_.north - map_.south, map_.east - map_.west)  # a safety line has no ends
    return {
        "elements": [
            {"name": name, "label": labels.get(name, name), **_element(element, place)}
            for name, element in elements.items()
            if (place := element.position or passed.get(name)) is not None
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
        "obstacles": [
            {"name": obstacle.name, "corners": outline[:-1].tolist(), "height": obstacle.height}
            for obstacle, outline in map_.obstacles
        ],
        "lines": [
            {
                "name": line.line.name,
                "start": (line.ends[0] - beyond * line.along).tolist(),
                "end": (line.ends[1] + beyond * line.along).tolist(),
                "keep_right": line.line.keep_right,
            }
            for line in map_.lines
        ],
        "airspace": [] if map_.airspace is None else map_.airspace[:-1].tolist(),
        "latitude": origin.latitude,
        "elevation": origin.elevation if origin.has_coordinates else None,
        "frame": [map_.south, map_.north, map_.west, map_.east],
    }


def _element(element: Element, place: tuple[float, float, float]) -> dict[str, object]:
    """Return an element whose passings have bounded heights, also where its rules leave them free."""
    drawing, allowed = element.drawing(), element.heights
    low = allowed.lower if math.isfinite(allowed.lower) else 0.0
    high = allowed.upper if math.isfinite(allowed.upper) else place[2] + PYLON_HEIGHT
    return {
        "posts": coordinates(drawing.posts).tolist(),
        "top": max(PYLON_HEIGHT, high + 5.0) if high < place[2] + 4.0 * PYLON_HEIGHT else place[2] + PYLON_HEIGHT,
        "window": None if drawing.window is None else coordinates(drawing.window).tolist(),
        "reach": None if drawing.reach is None else coordinates(drawing.reach).tolist(),
        "heights": [low, high],
        "place": list(place),
    }
