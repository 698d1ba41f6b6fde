"""The kinds of elements that airrace brings along, and what they are made of. A further kind is one more class."""

from airrace.track.element import Element, Standing
from airrace.track.gate import KNIFE_EDGE_LEFT, KNIFE_EDGE_RIGHT, LEVEL, Gate
from airrace.track.manoeuvre import INVERTED, Manoeuvre
from airrace.track.passing import Passing, Tolerances
from airrace.track.pylon import Pylon

__all__ = [
    "INVERTED",
    "KNIFE_EDGE_LEFT",
    "KNIFE_EDGE_RIGHT",
    "LEVEL",
    "Element",
    "Gate",
    "Manoeuvre",
    "Passing",
    "Pylon",
    "Standing",
    "Tolerances",
]
