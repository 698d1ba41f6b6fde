"""The quantities observed where an aircraft crosses a gate or passes a pylon, (13) and (14) of the paper.

They are its position, wing tips, bank, climb and course. Let `e` be the path's direction (first column of `R_OKbar`),
`y_B` the right wing (second column), `a` the axis and `l` the direction to its right (both horizontal), and `d` the
horizontal position relative to the centre. Angles appear only as products of R's entries, which have no jumps; `mu_0`
is the prescribed bank:

    bank_sine = cos(gamma) sin(mu - mu_0),   bank_cosine = cos(gamma) cos(mu - mu_0)

A tolerance `|mu - mu_0| <= t` below 90 degrees is `bank_excess_right, bank_excess_left <= 0` with `bank_tan = tan(t)`;
the horizontal angle between path and axis is limited likewise through `course_excess_right` and `course_excess_left`.
"""

import functools
from collections.abc import Sequence

import casadi as ca

from airrace.dynamics.outer_loop import ATTITUDE
from airrace.environment.elementary import sqrt
from airrace.frames import Scalar, rotation
from airrace.quantities import Quantity, T, Vector, quantity, vector
from airrace.system import Observation, column, named_symbols
from airrace.track.element import GateOutput

LEVEL_BLEND = 1e-6
"""A small number (1) that keeps the horizontal normal of the path defined where the path is vertical."""


@vector
class CrossingParameters(Vector[T]):
    """The place of a crossing, and the attitude and course that it is measured against."""

    centre_north: T = quantity("m", scale=100.0, text="centre of the gate, or the pylon, north of the origin")
    centre_east: T = quantity("m", scale=100.0, text="centre of the gate, or the pylon, east of the origin")
    axis_north: T = quantity("1", text="cosine of the axis' heading")
    axis_east: T = quantity("1", text="sine of the axis' heading")
    bank_cos: T = quantity("1", text="cosine of the prescribed bank")
    bank_sin: T = quantity("1", text="sine of the prescribed bank")
    bank_tan: T = quantity("1", text="tangent of the tolerance of the bank")
    crossing_tan: T = quantity("1", text="tangent of the largest angle between path and axis")
    half_span: T = quantity("m", text="distance from the aircraft's centre to a wing tip")


@vector
class CrossingValues(Vector[T]):
    """The quantities observed at a crossing."""

    along: T = quantity("m", scale=100.0, text="position along the axis")
    right: T = quantity("m", scale=100.0, text="position to the right of the axis")
    height: T = quantity("m", scale=100.0, text="height above the origin")
    right_wing: T = quantity("m", scale=100.0, text="right wing tip to the right of the axis")
    left_wing: T = quantity("m", scale=100.0, text="left wing tip to the right of the axis")
    beside_right: T = quantity("m", scale=100.0, text="right wing tip to the right of the centre, across the track")
    beside_left: T = quantity("m", scale=100.0, text="left wing tip to the right of the centre, across the track")
    bank_sine: T = quantity("1", text="sine of the excess bank times cosine of the climb angle")
    bank_cosine: T = quantity("1", text="cosine of the excess bank times cosine of the climb angle")
    bank_excess_right: T = quantity("1", text="positive where the bank exceeds its tolerance to the right")
    bank_excess_left: T = quantity("1", text="positive where the bank exceeds its tolerance to the left")
    climb_sine: T = quantity("1", text="sine of the climb angle")
    course_sine: T = quantity("1", text="component of the path's direction to the right of the axis")
    course_cosine: T = quantity("1", text="component of the path's direction along the axis")
    course_excess_right: T = quantity("1", text="positive where the course exceeds its tolerance to the right")
    course_excess_left: T = quantity("1", text="positive where the course exceeds its tolerance to the left")
    speed: T = quantity("m/s", scale=50.0, text="kinematic speed")
    attitude_norm: T = quantity("1", text="squared length of the attitude quaternion")


def crossing_observation(states: Sequence[Quantity]) -> Observation:
    """Return the observation of a crossing for a model.

    Args:
        states: declarations that include `x, y, z, V_K, q0, q1, q2, q3`.
    """
    x, b = named_symbols(states), named_symbols(CrossingParameters.quantities())
    values = crossing_values(
        position=(x["x"], x["y"], x["z"]),
        V_K=x["V_K"],
        q=[x[name] for name in ATTITUDE],
        place=CrossingParameters(**b),
    )
    arguments = [column(x.values()), column(b.values())]
    return Observation(
        name="crossing",
        quantities=CrossingValues.quantities(),
        parameters=CrossingParameters.quantities(),
        values=ca.Function("crossing", arguments, [column(values.join())], {"cse": True}),
    )


@functools.lru_cache(maxsize=64)
def with_sight(crossing: Observation, sight: GateOutput | None) -> Observation:
    """Return the crossing together with what a kind of element observes besides.

    Equal arguments give one and the same object, so that all elements of a kind share it. Quantities and parameters of
    the sight come last.

    Raises:
        ValueError: a quantity of the sight has the name of one of the crossing.
    """
    if sight is None:
        return crossing
    x = ca.SX.sym("x", crossing.values.size1_in(0))
    b, own = named_symbols(crossing.parameters), named_symbols(sight.parameters)
    seen = crossing.values(x, column(b.values()))
    by_name = {one.name: seen[row] for row, one in enumerate(crossing.quantities)}
    if twice := by_name.keys() & {one.name for one in sight.quantities}:
        raise ValueError(f"{sight.name} sees {', '.join(sorted(twice))}, which is seen at every crossing")
    values = column([*seen.elements(), *sight.values(by_name, {**b, **own})])
    return Observation(
        name=f"{crossing.name} and {sight.name}",
        quantities=(*crossing.quantities, *sight.quantities),
        parameters=(*crossing.parameters, *sight.parameters),
        values=ca.Function("seen", [x, column([*b.values(), *own.values()])], [values], {"cse": True}),
    )


def crossing_values(
    *, position: tuple[Scalar, Scalar, Scalar], V_K: Scalar, q: Sequence[Scalar], place: CrossingParameters[Scalar]
) -> CrossingValues[Scalar]:
    """Return the quantities observed at one instant.

    Args:
        position: `(x, y, z)` in O, m.
        V_K: kinematic speed, m/s.
        q: attitude of Kbar, scalar first.
        place: the gate or pylon.
    """
    R = rotation(q)
    e_N, e_E, e_D = R[0][0], R[1][0], R[2][0]
    d = (position[0] - place.centre_north, position[1] - place.centre_east)
    wing = (place.half_span * R[0][1], place.half_span * R[1][1])
    right_tip = (d[0] + wing[0], d[1] + wing[1])
    left_tip = (d[0] - wing[0], d[1] - wing[1])
    axis = (place.axis_north, place.axis_east)
    to_right = (-place.axis_east, place.axis_north)
    level = sqrt(e_N * e_N + e_E * e_E + LEVEL_BLEND)
    normal = (-e_E / level, e_N / level)
    bank_sine = R[2][1] * place.bank_cos - R[2][2] * place.bank_sin
    bank_cosine = R[2][2] * place.bank_cos + R[2][1] * place.bank_sin
    course_sine, course_cosine = _dot((e_N, e_E), to_right), _dot((e_N, e_E), axis)
    return CrossingValues(
        along=_dot(axis, d),
        right=_dot(to_right, d),
        height=-position[2],
        right_wing=_dot(to_right, right_tip),
        left_wing=_dot(to_right, left_tip),
        beside_right=_dot(normal, right_tip),
        beside_left=_dot(normal, left_tip),
        bank_sine=bank_sine,
        bank_cosine=bank_cosine,
        bank_excess_right=bank_sine - place.bank_tan * bank_cosine,
        bank_excess_left=-bank_sine - place.bank_tan * bank_cosine,
        climb_sine=-e_D,
        course_sine=course_sine,
        course_cosine=course_cosine,
        course_excess_right=course_sine - place.crossing_tan * course_cosine,
        course_excess_left=-course_sine - place.crossing_tan * course_cosine,
        speed=V_K,
        attitude_norm=sum(one * one for one in q),
    )


def _dot(one: tuple[Scalar, Scalar], other: tuple[Scalar, Scalar]) -> Scalar:
    return one[0] * other[0] + one[1] * other[1]
