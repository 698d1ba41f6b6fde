"""The room between a wing and a pylon when it is abeam of that, seen from a moment shortly before or after.

A wing that crosses the line between two pylons askew is abeam of one of them some hundredths of a second before, and of
the other one after. With the position `c`, velocity `v`, acceleration `a` and half wing `w` of the moment, the pylon at
`P` is abeam where `(P - c(t)) . v(t) = 0`, all horizontal, on `c(t) = c + v t + a t^2 / 2`; two Newton steps from zero
find it. With the normal `n` to the right of the path there, and `w(t) = w + w' t`, made as long as `w`,

    n . (P - c(t)) -+ n . w(t)

is how far to the right of either wing tip the pylon stands, across the track. Left out are terms of order t^3 of the
position and t^2 of the attitude. Rates are those with all controls at zero, on which neither `a` nor `w'` depends.
"""

from collections.abc import Sequence

import casadi as ca

from airrace.dynamics.flight_model import FlightModel
from airrace.dynamics.outer_loop import ATTITUDE
from airrace.environment.elementary import cos, sin, sqrt
from airrace.frames import Scalar, rotation
from airrace.quantities import Quantity, T, Vector, quantity, vector
from airrace.system import Observation, column, named_symbols

LEVEL_BLEND = 1e-2
"""A squared speed (m2/s2) that keeps the normal of the path defined where the path is vertical."""


@vector
class PylonParameters(Vector[T]):
    """A pylon, and the wing."""

    north: T = quantity("m", scale=100.0, text="pylon, north of the origin")
    east: T = quantity("m", scale=100.0, text="pylon, east of the origin")
    top: T = quantity("m", scale=100.0, text="top of the pylon above the origin")
    semispan: T = quantity("m", text="distance from the aircraft's centre to a wing tip")


@vector
class PylonRoom(Vector[T]):
    """Where the pylon is when it is abeam, as seen from both wing tips."""

    left_tip: T = quantity("m", scale=100.0, text="pylon to the right of the left wing tip, when abeam")
    right_tip: T = quantity("m", scale=100.0, text="pylon to the right of the right wing tip, when abeam")
    above_left: T = quantity("m", scale=100.0, text="left wing tip above the top of the pylon, when abeam")
    above_right: T = quantity("m", scale=100.0, text="right wing tip above the top of the pylon, when abeam")


def pylon_room_observation(model: FlightModel) -> Observation:
    """Return the observation of the room for a model; its parameters are the pylon, then the numbers of the model."""
    system = model.system
    x, p = named_symbols(system.states), named_symbols(system.parameters)
    b = named_symbols(PylonParameters.quantities())
    states, numbers = column(x.values()), column(p.values())
    rates = system.rates(states, column([0.0] * len(system.controls)), numbers)
    R = rotation([x[name] for name in ATTITUDE])
    beta: Scalar = x.get("beta_K", 0.0)
    right = [sin(beta) * R[row][0] + cos(beta) * R[row][1] for row in range(3)]
    velocity = [x["V_K"] * R[row][0] for row in range(3)]
    change: list[Scalar] = [*ca.jtimes(column([*velocity, *right]), states, rates).elements()]
    acceleration, turning = change[:3], change[3:]
    way = [b["north"] - x["x"], b["east"] - x["y"], -b["top"] - x["z"]]

    def ahead(t: Scalar) -> tuple[list[Scalar], list[Scalar]]:
        """Return the way to the top of the pylon and the velocity at a time."""
        rows = list(zip(way, velocity, acceleration, strict=True))
        return [d - v * t - 0.5 * a * t * t for d, v, a in rows], [v + a * t for _, v, a in rows]

    t: Scalar = ca.SX(0.0)
    for _ in range(2):
        d, v = ahead(t)
        slope = v[0] ** 2 + v[1] ** 2 - d[0] * acceleration[0] - d[1] * acceleration[1] + LEVEL_BLEND
        t = t + (d[0] * v[0] + d[1] * v[1]) / slope
    d, v = ahead(t)
    speed = sqrt(v[0] ** 2 + v[1] ** 2 + LEVEL_BLEND)
    wing = [one + rate * t for one, rate in zip(right, turning, strict=True)]
    length = sqrt(sum(one * one for one in wing)) / b["semispan"]
    reach, drop = (v[0] * wing[1] - v[1] * wing[0]) / (speed * length), wing[2] / length
    lateral = (v[0] * d[1] - v[1] * d[0]) / speed
    rooms = PylonRoom(
        left_tip=lateral + reach, right_tip=lateral - reach, above_left=d[2] + drop, above_right=d[2] - drop
    )
    parameters: Sequence[Quantity] = (*PylonParameters.quantities(), *system.parameters)
    values = column(rooms.join())
    function = ca.Function("pylon_room", [states, column([*b.values(), *p.values()])], [values], {"cse": True})
    return Observation("pylon room", PylonRoom.quantities(), tuple(parameters), function)
