"""One flight from any source: the optimum of a stage or a recorded flight, with the same named histories."""

from airrace.flights.results.derivation import flight_of
from airrace.flights.results.flight import (
    Basis,
    Entrant,
    Flight,
    Histories,
    History,
    Lap,
    Leg,
    Penalty,
    Source,
    StoredOptimum,
    TimedCrossing,
    Verification,
    laps_of,
    legs_of,
)
from airrace.flights.results.stamp import ReserveState, Stamp

__all__ = [
    "Basis",
    "Entrant",
    "Flight",
    "Histories",
    "History",
    "Lap",
    "Leg",
    "Penalty",
    "ReserveState",
    "Source",
    "Stamp",
    "StoredOptimum",
    "TimedCrossing",
    "Verification",
    "flight_of",
    "laps_of",
    "legs_of",
]
