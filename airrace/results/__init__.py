"""One flight, whatever its source: the optimum of a stage or a recorded flight, with the same named histories."""

from airrace.results.flight import Crossing, Flight, Source
from airrace.results.history import Basis, Histories, History
from airrace.results.legs import Lap, Leg, laps_of, legs_of
from airrace.results.of_stage import flight_of

__all__ = [
    "Basis",
    "Crossing",
    "Flight",
    "Histories",
    "History",
    "Lap",
    "Leg",
    "Source",
    "flight_of",
    "laps_of",
    "legs_of",
]
