"""Places as north, east and height, for files in which equations' x, y and z beside a height would be a riddle."""

from collections.abc import Mapping
from dataclasses import replace

from airrace.flights.results import History

EARTH: Mapping[str, tuple[str, float, str]] = {
    "x": ("north", 1.0, "north of the track's origin"),
    "y": ("east", 1.0, "east of the track's origin"),
    "z": ("height", -1.0, "height above the track's origin"),
}
"""What x, y and z are called in files, the sign that they have there, and what they are."""


def earth_histories(histories: Mapping[str, History]) -> dict[str, History]:
    """Return histories with north and east in place of x and y, and height, where z is one or it is there already."""
    renamed: dict[str, History] = {}
    for name, history in histories.items():
        new_name, sign, text = EARTH.get(name, (name, 1.0, history.quantity.text))
        if new_name == name or new_name not in histories:
            quantity = history.quantity
            lower, upper = sorted((sign * quantity.lower, sign * quantity.upper))
            quantity = replace(quantity, name=new_name, text=text, lower=lower, upper=upper)
            renamed[new_name] = replace(history, quantity=quantity, values=sign * history.values)
    return renamed
