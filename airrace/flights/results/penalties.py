"""The penalties of a season: seconds that are added for what is broken, and what ends the race."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

ENDS_RACE = math.inf
"""The penalty that ends the race."""


@dataclass(frozen=True)
class Penalties:
    """Seconds that are added for what is broken; `ENDS_RACE` where the race is over, None where no rule states them.

    Attributes:
        pylon: a wing touches a pylon.
        missed: a gate or pylon is passed outside of its pylons or on the wrong side, or not at all.
        too_high, too_low: a gate is passed above or below its legal heights.
        bank: a gate is passed with another bank than prescribed.
        climb: a gate is passed climbing or descending too steeply.
        manoeuvre: a height or an attitude is not reached.
        manoeuvres: the same of single kinds of elements, by the names of the kinds.
        start_speed: the start is passed too fast.
        start_speed_end: m/s, from which on that ends the race.
        load_factor: the load factor exceeds the limit of the rules.
        load_factor_from: g, from which it counts; None for the limit that the course has.
        load_factor_time: s, for which it has to last before it counts.
        load_factor_end: g, above which the race is over at once.
        source: where the numbers come from.
    """

    pylon: float | None = None
    missed: float | None = None
    too_high: float | None = None
    too_low: float | None = None
    bank: float | None = None
    climb: float | None = None
    manoeuvre: float | None = None
    manoeuvres: Mapping[str, float | None] = field(default_factory=dict[str, float | None])
    start_speed: float | None = None
    start_speed_end: float | None = None
    load_factor: float | None = None
    load_factor_from: float | None = None
    load_factor_time: float = 0.0
    load_factor_end: float | None = None
    source: str = ""


NONE_KNOWN = Penalties()
"""The penalties of a course whose rules name none."""
