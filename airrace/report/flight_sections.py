"""What a report tells of flights as tables: the flights side by side, and the legs of the first."""

import math
from collections.abc import Sequence

import numpy as np

from airrace.flights import Flight, Leg, laps_of, legs_of
from airrace.report.differences import started
from airrace.report.html_tables import DASH, Cell, Head, Row, note, number, section, table
from airrace.report.shown import DEGREE, KNOT
from airrace.trajectory import Array

FLIGHTS = (
    Head("flight", text=True),
    Head("aircraft", text=True),
    Head("race time", "s"),
    Head("difference", "s"),
    Head("certified", text=True),
)
LEGS = (
    Head("to", text=True),
    Head("at", "s"),
    Head("leg", "s"),
    Head("speed", "kt indicated"),
    Head("speed", "kt over ground"),
    Head("load factor", "g"),
    Head("height", "m"),
    Head("roll rate", "°/s, largest"),
    Head("energy height", "m, at the end"),
)


def flights_section(flights: Sequence[Flight]) -> str:
    """All flights with their race times; empty where there is only one."""
    if len(flights) < 2:
        return ""
    first = flights[0]
    rows = [
        Row((
            Cell(flight.label, flight=place),
            flight.aircraft.name,
            number(flight.race_time, 3),
            "" if flight is first else number(flight.race_time - first.race_time, 3, signed=True),
            {True: "yes", False: "no", None: "recorded"}[flight.source.certified],
        ))
        for place, flight in enumerate(flights)
    ]  # fmt: skip
    told = "The first flight is the one that the page is about; the others fly beside it on the same clock."
    return section("Flights", table(FLIGHTS, rows) + note(told))


def legs_section(flights: Sequence[Flight]) -> str:
    """Leg by leg what the first flight does, and how much longer the others take for it."""
    first, others = flights[0], flights[1:]
    begin = started(first)
    heads = [*LEGS, *(Head("longer", f"s, {flight.label}") for flight in others)]
    beside = [legs_of(flight) for flight in others]
    rows = [
        Row(
            (*_leg(first, leg, begin), *(number(legs[i].time - leg.time, 3, signed=True) for legs in beside)),
            passing=i,
        )
        for i, leg in enumerate(legs_of(first))
    ]
    return section("Legs", table(heads, rows) + note(_laps(first)))


def _leg(flight: Flight, leg: Leg, begin: float) -> tuple[Cell | str, ...]:
    def over(name: str, factor: float, digits: int) -> str:
        return _range(flight.values(name)[leg.rows] / factor, digits)

    rate = np.abs(flight.values("p_Kbar")[leg.rows]) / DEGREE
    return (
        Cell(leg.name, time=leg.before.time - begin) if leg.before.found else leg.name,
        number(leg.after.time - begin, 3),
        number(leg.time, 3),
        over("V_I", KNOT, 0),
        over("V_K", KNOT, 0),
        over("n_z", 1.0, 1),
        over("height", 1.0, 0),
        number(float(rate.max(initial=-math.inf)), 0),
        number(leg.after.value("h_E"), 0),
    )


def _range(values: Array, digits: int) -> str:
    """From the least to the greatest; a dash where nothing is known."""
    known = values[np.isfinite(values)]
    if not len(known):
        return DASH
    least, greatest = number(float(known.min()), digits), number(float(known.max()), digits)
    return least if least == greatest else f"{least} … {greatest}"


def _laps(flight: Flight) -> str:
    laps = laps_of(flight)
    if len(laps) < 2:
        return ""
    return "Laps: " + ", ".join(f"{lap.number} in {number(lap.time, 3)} s" for lap in laps) + "."
