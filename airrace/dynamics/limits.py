"""The limits that the aircraft and the rules of a course set together."""

import dataclasses
import math
from collections.abc import Mapping, Sequence

from airrace.aircraft.aircraft import Aircraft, Lift
from airrace.dynamics.aerodynamics import lift_curve
from airrace.errors import Finding, InputError
from airrace.quantities import Interval, Quantity, T, Vector, quantity, vector
from airrace.records import record
from airrace.track.course import Rules

LEAST_ROOM = 1e-2
"""The least room that is left between floor and ceiling, m; a certificate allows ten times as much beyond each.

A height that is prescribed at every node leaves the vertical motion more conditions than controls, and fatrop searches
for its first step for ever. Straight on 0.1 mm of room was enough; of two courses with turns one found no optimum in
1 mm, the other none in 2 mm, and both were certified in 5 mm.
"""


@record
class Limits:
    """The allowed ranges along the whole flight, (16) of the paper; SI, rad, g.

    Attributes:
        z: position below the origin.
        V_K: kinematic speed.
        n_z: load factor.
        p_Kbar: roll rate.
        C_L: lift coefficient.
        beta_A: sideslip.
    """

    z: Interval
    V_K: Interval
    n_z: Interval
    p_Kbar: Interval
    C_L: Interval
    beta_A: Interval


def flight_limits(aircraft: Aircraft, rules: Rules) -> Limits:
    """Return the limits common to aircraft and rules.

    Raises:
        InputError: some quantity has no value that both allow.
    """
    limits = Limits(
        z=_with_room(Interval(-rules.height.upper, -rules.height.lower)),
        V_K=aircraft.envelope.V,
        n_z=aircraft.envelope.n_z.intersect(rules.n_z),
        p_Kbar=symmetric(min(aircraft.point_mass.p, rules.p)),
        C_L=Interval(aircraft.lift.C_L_min, aircraft.lift.C_L_max)
        .intersect(rules.C_L)
        .intersect(lift_range(rules.alpha_A, aircraft.lift)),
        beta_A=symmetric(min(aircraft.drag.beta_A_max, rules.beta_A)),
    )
    findings = [
        Finding(aircraft.name, 0, 0, name, "no value satisfies both the aircraft's limits and the rules of the course")
        for name, allowed in vars(limits).items()
        if allowed.empty
    ]
    if findings:
        raise InputError(findings)
    return limits


def _with_room(z: Interval) -> Interval:
    """Return the allowed positions below the origin, with the least room around their middle."""
    if z.empty or z.upper - z.lower >= LEAST_ROOM:
        return z
    middle = 0.5 * (z.lower + z.upper)
    return Interval(middle - 0.5 * LEAST_ROOM, middle + 0.5 * LEAST_ROOM)


def lift_range(alpha_A: Interval, lift: Lift) -> Interval:
    """Return the lift coefficients between two angles of attack (rad); an infinite angle sets no limit."""
    return Interval(
        lift_curve(alpha_A.lower, lift) if math.isfinite(alpha_A.lower) else -math.inf,
        lift_curve(alpha_A.upper, lift) if math.isfinite(alpha_A.upper) else math.inf,
    )


def symmetric(magnitude: float) -> Interval:
    """Return the interval `[-magnitude, magnitude]`."""
    return Interval(-magnitude, magnitude)


def bounded(quantities: Sequence[Quantity], bounds: Mapping[str, Interval]) -> tuple[Quantity, ...]:
    """Return the declarations with the bounds given by name; the others keep their own.

    Raises:
        KeyError: a bound names no quantity.
    """
    unknown = bounds.keys() - {one.name for one in quantities}
    if unknown:
        raise KeyError(", ".join(sorted(unknown)))
    return tuple(
        dataclasses.replace(one, lower=bounds[one.name].lower, upper=bounds[one.name].upper)
        if one.name in bounds
        else one
        for one in quantities
    )


@vector
class BodyPath(Vector[T]):
    """The quantities that are limited along the path of a model with angles, (16) of the paper.

    States and controls have bounds of their own.
    """

    n_z: T = quantity("1", scale=5.0, text="load factor, 1 in level flight")
    n_y: T = quantity("1", text="lateral load factor, to the right")
    C_L: T = quantity("1", text="lift coefficient")
    alpha_A: T = quantity("rad", scale=0.2, text="angle of attack")
    beta_A: T = quantity("rad", scale=0.2, text="sideslip")


def body_path_bounds(aircraft: Aircraft, rules: Rules, limits: Limits) -> dict[str, Interval]:
    """Return the ranges of `BodyPath` by name; SI, rad, g.

    Args:
        aircraft: whose own limits hold.
        rules: of the course.
        limits: what both allow together.

    Raises:
        InputError: they leave no angle of attack.
    """
    return {
        "n_z": limits.n_z,
        "n_y": symmetric(aircraft.point_mass.n_y),
        "C_L": limits.C_L,
        "alpha_A": angle_of_attack_limits(aircraft, rules),
        "beta_A": limits.beta_A,
    }


def angle_of_attack_limits(aircraft: Aircraft, rules: Rules) -> Interval:
    """Return the angles of attack (rad) that the rules allow within the linear part of the lift curve.

    Raises:
        InputError: the rules allow none of them.
    """
    allowed = rules.alpha_A.intersect(linear_range(aircraft.lift))
    if allowed.empty:
        message = "the rules of the course allow no angle of attack short of the stall"
        raise InputError([Finding(aircraft.name, 0, 0, "alpha_A", message)])
    return allowed


def linear_range(lift: Lift) -> Interval:
    """Return the angles of attack (rad) between which the linear lift curve runs from `C_L_min` to `C_L_max`."""
    return Interval((lift.C_L_min - lift.C_L0) / lift.C_Lalpha, (lift.C_L_max - lift.C_L0) / lift.C_Lalpha)
