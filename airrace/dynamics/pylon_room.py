"""The room between a wing and the pylons beside a passing when it is abeam of them, seen from the crossing.

A wing that crosses the line between two pylons askew is abeam of one of them some hundredths of a second before, and of
the other one after. With the position `c`, velocity `v`, acceleration `a` and half wing `w` of the crossing, the pylon
at `P` is abeam where `(P - c(t)) . v(t) = 0`, all horizontal, on `c(t) = c + v t + a t^2 / 2`; two Newton steps from
zero find it. With the normal `n` to the right of the path there, and `w(t) = w + w' t`, made as long as `w`,

    room = side n . (P - c(t)) -+ n . w(t)

is the distance of either wing tip from the pylon across the track. Left out are terms of order t^3 of the position and
t^2 of the attitude. Rates are those with all controls at zero, on which neither `a` nor `w'` depends.
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
    """The pylons beside a passing, as seen along its axis."""

    left_north: T = quantity("m", scale=100.0, text="pylon on the left, north of the origin")
    left_east: T = quantity("m", scale=100.0, text="pylon on the left, east of the origin")
    right_north: T = quantity("m", scale=100.0, text="pylon on the right, north of the origin")
    right_east: T = quantity("m", scale=100.0, text="pylon on the right, east of the origin")
    semispan: T = quantity("m", text="distance from the aircraft's centre to a wing tip")


@vector
class PylonRoom(Vector[T]):
    """The distances across the track of both wing tips from the pylons, when abeam of them."""

    left_of_left: T = quantity("m", scale=100.0, text="left wing tip from the pylon on the left")
    right_of_left: T = quantity("m", scale=100.0, text="right wing tip from the pylon on the left")
    left_of_right: T = quantity("m", scale=100.0, text="left wing tip from the pylon on the right")
    right_of_right: T = quantity("m", scale=100.0, text="right wing tip from the pylon on the right")


def pylon_room_observation(model: FlightModel) -> Observation:
    """Return the observation of the room for a model; its parameters are the pylons, then the numbers of the model."""
    system = model.system
    x, p = named_symbols(system.states), named_symbols(system.parameters)
    b = named_symbols(PylonParameters.quantities())
    states, numbers = column(x.values()), column(p.values())
    rates = system.rates(states, column([0.0] * len(system.controls)), numbers)
    R = rotation([x[name] for name in ATTITUDE])
    beta: Scalar = x.get("beta_K", 0.0)
    right = [sin(beta) * R[row][0] + cos(beta) * R[row][1] for row in range(3)]
    v_N, v_E = x["V_K"] * R[0][0], x["V_K"] * R[1][0]
    moving = column([v_N, v_E, *right])
    change: list[Scalar] = [*ca.jtimes(moving, states, rates).elements()]
    a_N, a_E, turning = change[0], change[1], change[2:]

    def ahead(north: Scalar, east: Scalar, t: Scalar) -> tuple[Scalar, Scalar, Scalar, Scalar]:
        """Return the way to the pylon and the velocity at a time, each to the north and to the east."""
        d_N = north - x["x"] - v_N * t - 0.5 * a_N * t * t
        d_E = east - x["y"] - v_E * t - 0.5 * a_E * t * t
        return d_N, d_E, v_N + a_N * t, v_E + a_E * t

    rooms: list[Scalar] = []
    for side, name in ((-1.0, "left"), (1.0, "right")):
        place = b[f"{name}_north"], b[f"{name}_east"]
        t: Scalar = ca.SX(0.0)
        for _ in range(2):
            d_N, d_E, u_N, u_E = ahead(*place, t)
            slope = u_N * u_N + u_E * u_E - d_N * a_N - d_E * a_E + LEVEL_BLEND
            t = t + (d_N * u_N + d_E * u_E) / slope
        d_N, d_E, u_N, u_E = ahead(*place, t)
        speed = sqrt(u_N * u_N + u_E * u_E + LEVEL_BLEND)
        wing = [one + rate * t for one, rate in zip(right, turning, strict=True)]
        length = sqrt(sum(one * one for one in wing))
        reach = b["semispan"] * (u_N * wing[1] - u_E * wing[0]) / (speed * length)
        lateral = side * (u_N * d_E - u_E * d_N) / speed
        rooms += [lateral + side * reach, lateral - side * reach]
    parameters: Sequence[Quantity] = (*PylonParameters.quantities(), *system.parameters)
    function = ca.Function("pylon_room", [states, column([*b.values(), *p.values()])], [column(rooms)], {"cse": True})
    return Observation("pylon room", PylonRoom.quantities(), tuple(parameters), function)
