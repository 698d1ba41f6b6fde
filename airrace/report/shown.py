"""The histories that a report shows, with their units and limits."""

import math
from collections.abc import Sequence

from airrace.quantities import KNOT
from airrace.records import record
from airrace.report.contents import Scale, Strip
from airrace.report.page import Reading
from airrace.results import Flight
from airrace.trajectory import Array

DEGREE = math.pi / 180.0


@record
class Drawn:
    """A strip as it is planned: histories of a flight with their unit, `factor` in SI units or radians.

    Attributes:
        lines: name of a history and what it is called, the main one first.
        limited: those of them whose limits are drawn.
        digits, wraps, least: as of `airrace.report.contents.Strip`, in the unit.
    """

    title: str
    unit: str
    factor: float
    lines: tuple[tuple[str, str], ...]
    limited: tuple[str, ...] = ()
    digits: int = 0
    wraps: float | None = None
    least: float = 1.0


STRIPS = (
    Drawn("Speed", "kt", KNOT, (("V_I", "indicated"), ("V_A", "true"), ("V_K", "over ground")), ("V_K",), least=5.0),
    Drawn("Height", "m", 1.0, (("height", "above the origin"),), ("height",), least=5.0),
    Drawn("Load factor", "g", 1.0, (("n_z", "up"), ("n_y", "sideways")), ("n_z",), digits=1),
    Drawn("Bank", "°", DEGREE, (("mu", "right wing down"),), wraps=360.0),
    Drawn("Roll rate", "°/s", DEGREE, (("p_Kbar", "to the right"),), ("p_Kbar",), least=10.0),
    Drawn("Climb", "°", DEGREE, (("gamma", "upwards"),), least=5.0),
    Drawn("Angles", "°", DEGREE, (("alpha_A", "attack"), ("beta_A", "sideslip")), ("alpha_A", "beta_A"), digits=1),
    Drawn(
        "Surfaces",
        "°",
        DEGREE,
        (("eta", "elevator"), ("xi", "ailerons"), ("zeta", "rudder")),
        ("eta", "xi", "zeta"),
        digits=1,
    ),
    Drawn("RelaxableParameter", "%", 0.01, (("delta_T", "power"),), least=5.0),
    Drawn("Energy height", "m", 1.0, (("h_E", "above the origin"),), least=5.0),
)
"""The strips of a report, from top to bottom."""

COLOURS = (
    Scale("Load factor", "n_z", "g", 1),
    Scale("Speed", "V_I", "kt", 0),
    Scale("Roll rate", "p_Kbar", "°/s", 0, signed=True),
    Scale("Energy height", "h_E", "m", 0),
)
READINGS = (
    Reading("Indicated", "V_I", "kt"),
    Reading("Height", "height", "m"),
    Reading("Load factor", "n_z", "g", 1),
    Reading("Bank", "mu", "°", 0, 360.0),
    Reading("Roll rate", "p_Kbar", "°/s"),
    Reading("Climb", "gamma", "°"),
)


def histories_shown(flight: Flight) -> dict[str, Array]:
    """Return all histories that a report shows of a flight, by name, in the units in which they are shown."""
    return {
        name: flight[name] / drawn.factor for drawn in STRIPS for name, _ in drawn.lines if name in flight
    }  # fmt: skip


def strips_of(flights: Sequence[Flight]) -> list[Strip]:
    """Return the strips of which some flight knows something; limits are those of the first flight."""
    return [_strip(drawn, flights[0]) for drawn in STRIPS if any(_known(drawn, flight) for flight in flights)]


def colours_of(flight: Flight) -> list[Scale]:
    """Return the scales by which the line of a flight can be coloured."""
    return [scale for scale in COLOURS if scale.history in flight]


def _known(drawn: Drawn, flight: Flight) -> bool:
    return any(name in flight for name, _ in drawn.lines)


def _strip(drawn: Drawn, flight: Flight) -> Strip:
    return Strip(
        title=drawn.title,
        unit=drawn.unit,
        digits=drawn.digits,
        lines=drawn.lines,
        limits=_limits(drawn, flight),
        wraps=drawn.wraps,
        least=drawn.least,
    )


def _limits(drawn: Drawn, flight: Flight) -> list[tuple[float, str]]:
    """Return the bounds that are finite, each once."""
    bounds: dict[float, str] = {}
    for name in drawn.limited:
        allowed = flight.limit(name)
        for value, what in ((allowed.lower, "at least"), (allowed.upper, "at most")):
            if math.isfinite(value):
                bounds.setdefault(round(value / drawn.factor, 6), what)
    return list(bounds.items())
