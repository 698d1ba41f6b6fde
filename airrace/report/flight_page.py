"""The page about flights, whatever their sources; what only runs know is handed in as further sections."""

import math
from collections.abc import Sequence

import numpy as np

from airrace.quantities import KNOT, Quantity
from airrace.report.flight_contents import contents_of
from airrace.report.flight_sections import flights_section, legs_section, lost_section
from airrace.report.page import Page
from airrace.report.shown import READINGS
from airrace.results import Flight
from airrace.results.comparison import Comparison, compared
from airrace.trajectory import Trajectory
from airrace.views.map_model import map_model
from airrace.views.plan_svg import plan_svg


def flight_page(flights: Sequence[Flight], sections: Sequence[str] = (), footer: str = "") -> Page:
    """Return the page about some flights.

    Args:
        flights: the first is what the page is about, the others fly beside it as its ghosts.
        sections: HTML of further sections, which stand below the legs; empty ones are left out.
        footer: plain text.

    Raises:
        UsageError: a flight is of a course with other passings.
    """
    first = flights[0]
    comparisons = [compared(first, other) for other in flights[1:]]
    seen = map_model(first.race)
    return Page(
        title=first.course.name,
        subtitle=_subtitle(first),
        race_time=first.race_time,
        verdict=first.source.verdict or "recorded",
        good=not first.source.doubtful,
        readings=[one for one in READINGS if one.history in first],
        plan=plan_svg(seen, _ground_track(first)),
        sections=[one for one in (*_flight_sections(flights, comparisons), *sections) if one],
        footer=footer,
        contents=contents_of(flights, comparisons, seen),
    )


def _flight_sections(flights: Sequence[Flight], comparisons: Sequence[Comparison]) -> list[str]:
    return [flights_section(flights), legs_section(flights[0]), *(lost_section(one) for one in comparisons)]


def _subtitle(flight: Flight) -> str:
    """Return a line that says which aircraft flies, at which stage, and in which wind."""
    wind = flight.air.wind
    blowing = "calm air"
    if wind is not None and wind.speed > 0.0:
        blowing = f"wind {wind.speed / KNOT:.0f} kt from {round(math.degrees(wind.origin)) % 360:03d}°"
    return ", ".join(text for text in (flight.aircraft.name, flight.source.stage, blowing) if text)


def _ground_track(flight: Flight) -> Trajectory:
    """Return as much of a flight as the drawing from above needs, as one phase."""
    shown = (Quantity("x", "m"), Quantity("y", "m"), Quantity("V_K", "m/s"))
    last = len(flight.time) - 1
    return Trajectory(
        phases=(flight.label,),
        first_node=np.array([0, last]),
        durations=np.array([flight.time[-1] - flight.time[0]]),
        time=flight.time,
        states=shown,
        state=np.stack([flight[one.name] for one in shown]),
        controls=(),
        control=np.zeros((0, last)),
    )
