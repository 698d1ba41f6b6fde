"""The distances of a flight from everything on its course as named histories: at every instant, in metres.

`distance_pylon_g1` and `distance_obstacle_mast` are those of the wing; `distance_crowd_stands`,
`distance_safety_line_shore`, `distance_airspace`, `distance_floor` and `distance_ceiling` are those of the aircraft's
centre, negative beyond a line or a border. They follow from position and attitude, and no file stores them.
"""

import re
from collections.abc import Callable, Collection, Mapping
from dataclasses import replace

import numpy as np

from airrace.planning.race import Race
from airrace.planning.waypoints import PLANNED_MAX
from airrace.planning.wing_clearance import wing_distance
from airrace.quantities import Quantity
from airrace.results.clearances import Distance, pylons, surroundings
from airrace.results.derivation import Values, complete_histories
from airrace.results.flight import Basis, Flight, Histories, History, Source
from airrace.trajectory import Array

POSITION = ("x", "y", "height")


def with_distances(flight: Flight) -> Flight:
    """Return the flight with the histories of its distances, at its crossings as well; as it is without a position."""
    if not flight.has(*POSITION):
        return flight
    found = distance_histories(flight)
    crossings = list(flight.crossings)
    for place, one in enumerate(crossings):
        if one.found:
            row = min(int(np.searchsorted(flight.time, one.time - 1e-9)), len(flight.time) - 1)
            values = {name: float(history.values[row]) for name, history in found.items()}
            crossings[place] = replace(one, values={**one.values, **values})
    return replace(flight, histories={**flight.histories, **found}, crossings=tuple(crossings))


def distance_histories(flight: Flight) -> Histories:
    """Return the histories of all distances of a flight whose position is known, by name.

    On a course that is too long to be planned pylons are left out.
    """
    short = len(flight.course.passages) <= PLANNED_MAX
    wing = pylons(flight, lambda wing, post: wing_distance(post, wing.centre, wing.half)) if short else ()
    found: dict[str, History] = {}
    for one in (*wing, *surroundings(flight)):
        plain = re.sub(r"\W+", "_", f"distance {one.kind} {one.name}".strip(), flags=re.ASCII)
        number, name = 2, plain
        while name in found:
            name, number = f"{plain}_{number}", number + 1
        found[name] = History(_quantity(name, one), one.values, Basis.DERIVED)
    return found


def _quantity(name: str, one: Distance) -> Quantity:
    text = f"distance from {one.kind} {one.name}".rstrip()
    lower = -np.inf if one.legs is not None or one.kind == "pylon" else one.required
    return Quantity(name, "m", lower=lower, text=text)


def distance_columns(race: Race, names: Collection[str]) -> Mapping[Quantity, Callable[[Values], Array]]:
    """Return the distances that tables of a flight hold besides its states; see `derivation.table_columns`."""
    if not {"x", "y", "z"} <= set(names):
        return {}
    last: tuple[Values, Histories] = {}, {}  # of the samples that were asked for last: all columns of them come at once

    def of(known: Values) -> Histories:
        given = {name: History(Quantity(name, ""), values, Basis.SOLVED) for name, values in known.items()}
        time = np.arange(len(known["x"]), dtype=np.float64)
        return distance_histories(Flight(race, Source(""), time, complete_histories(race, given), ()))

    def column(name: str) -> Callable[[Values], Array]:
        def values(known: Values) -> Array:
            nonlocal last
            if last[0] is not known:
                last = known, of(known)
            return last[1][name].values

        return values

    nowhere = {name: np.zeros(1) for name in ("x", "y", "z")}
    return {one.quantity: column(name) for name, one in of(nowhere).items()}


def with_nearest(flight: Flight, within: float) -> Flight:
    """Return the flight with the distance from the nearest thing of every kind, for pictures: `nearest_pylon`, ...

    Args:
        flight: one with distances.
        within: the distance beyond which those of the wing, which are short, are NaN, m.
    """
    found: dict[str, History] = {}
    for kind in ("pylon", "obstacle", "crowd", "safety_line"):
        each = [one for name, one in flight.histories.items() if name.startswith(f"distance_{kind}_")]
        if each:
            values = np.minimum.reduce([one.values for one in each])
            if kind in ("pylon", "obstacle"):
                values = np.where(values <= within, values, np.nan)
            lower = max(one.quantity.lower for one in each)
            found[f"nearest_{kind}"] = History(Quantity(f"nearest_{kind}", "m", lower=lower), values, Basis.DERIVED)
    return replace(flight, histories={**flight.histories, **found})
