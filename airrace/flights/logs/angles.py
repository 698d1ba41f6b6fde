"""Angles of places as people and receivers write them: `45.08`, `N45 04 54.4`, `45:04:54.43 N`, `4504.907`."""

import re

_ANGLE = re.compile(
    r"(?P<side>[NSEWO])? ?(?P<sign>[+-]?)(?P<parts>\d[\d.:°'\u2032\"\u2033 ]*)(?P<side_behind>[NSEWO])?", re.IGNORECASE
)
_SIGNS = {"N": 1.0, "E": 1.0, "O": 1.0, "S": -1.0, "W": -1.0}
"""The sign of a side of the world; `O` is east in German."""
_SIDES = (re.compile(r"(.*[NS])(.*[EWO])", re.IGNORECASE), re.compile(r"([NS].*)([EWO].*)", re.IGNORECASE))
_LENGTH_MAX = 80
"""The letters of a place, at most."""


def parse_angle(text: str) -> float:
    """Return an angle in degrees, negative to the south and to the west.

    Raises:
        ValueError: the text is no such angle.
    """
    match = _ANGLE.fullmatch(" ".join(text[:_LENGTH_MAX].split()))
    if match is None:
        raise ValueError(text)
    degrees, *sixtieths = (float(part) for part in re.findall(r"[\d.]+", match["parts"]))
    if len(sixtieths) > 2 or any(part >= 60.0 for part in sixtieths):
        raise ValueError(text)
    for place, part in enumerate(sixtieths, start=1):
        degrees += part / 60.0**place
    side = (match["side"] or match["side_behind"] or "N").upper()
    return _SIGNS[side] * (-degrees if match["sign"] == "-" else degrees)


def parse_pair(text: str) -> tuple[float, float]:
    """Return the two angles of a place in one text, degrees, as they follow one another: `46.5,7.6`.

    Raises:
        ValueError: the text holds no such pair.
    """
    plain = text[:_LENGTH_MAX].strip(" \t()[]")
    parts = re.split(r"\s*[,;/|]\s*", plain)
    if len(parts) != 2:
        sided = next((match for match in (side.fullmatch(plain) for side in _SIDES) if match), None)
        parts = plain.split() if sided is None else [*sided.groups()]
    first, second = (parse_angle(part) for part in parts)
    return first, second


def packed_degrees(text: str) -> float:
    """Return the degrees of an angle whose last two integer digits are minutes: `4504.907`.

    Raises:
        ValueError: the text is no such angle.
    """
    degrees, minutes = divmod(float(text), 100.0)
    if not (text[:1].isdigit() and minutes < 60.0):
        raise ValueError(text)
    return degrees + minutes / 60.0
