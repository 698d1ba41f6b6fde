"""Units of speed and length in which people want to read a flight; files and objects always have SI units."""

from airrace.errors import UsageError
from airrace.quantities import FOOT, KNOT
from airrace.records import record

"""The international foot, m."""


@record
class Units:
    """Units of speed and length.

    Attributes:
        speed, length: how they are written.
        per_m_s, per_m: how many of them are one metre per second, and one metre.
    """

    speed: str
    length: str
    per_m_s: float
    per_m: float


RACE = Units("kt", "m", 1.0 / KNOT, 1.0)
UNITS = {"kt-m": RACE, "kt-ft": Units("kt", "ft", 1.0 / KNOT, 1.0 / FOOT), "kmh-m": Units("km/h", "m", 3.6, 1.0)}
"""The choices by name; `kt-m` are those of the rules of air races."""


def units_named(name: str) -> Units:
    """Return the units of a name.

    Raises:
        UsageError: there are none.
    """
    if name not in UNITS:
        raise UsageError(f"there are no units {name!r}; known are {', '.join(UNITS)}")
    return UNITS[name]
