"""The limits that the aircraft and the rules of a course set together, and what aircraft that rotate are steered by.

They are steered by control surfaces, or by commands to a controller; the controls are the rates of either.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

from airrace.errors import Finding, InputError
from airrace.model.aircraft import Aircraft, Lift
from airrace.model.dynamics.aerodynamics import lift_curve
from airrace.model.track.course import Rules
from airrace.optimal_control.quantities import Interval, T, Vector, quantity, vector

LEAST_ROOM = 1e-2
"""The least room that is left between floor and ceiling, m; a certificate allows ten times as much beyond each.

A height that is prescribed at every node leaves the vertical motion more conditions than controls, and no solver finds
a first step. Straight on 0.1 mm of room was enough; of two courses with turns one found no optimum in
1 mm, the other none in 2 mm, and both were certified in 5 mm.
"""


@dataclass(frozen=True)
class Limits:
    """The allowed ranges along the whole flight, equation (16); SI, rad, g.

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


def symmetric(magnitude: float) -> Interval:
    """Return the interval `[-magnitude, magnitude]`."""
    return Interval(-magnitude, magnitude)


def contradictions(aircraft: Aircraft, rules: Rules) -> Iterator[tuple[str, str]]:
    """Yield what no flight of any model can keep: the key of the rule, and why.

    The angle of attack stays within the linear part of the lift curve. Simpler models know none, but a race that no
    later stage can fly is refused before the first is solved.
    """
    lift, allowed, linear = aircraft.lift, rules.alpha_A, linear_range(aircraft.lift)
    C_L_max = min(lift.C_L_max, rules.C_L.upper)
    if allowed.lower > linear.upper:
        stall = f"the angle at which {aircraft.name} stalls"
        yield "alpha_min_deg", _outside("at most", linear.upper, stall, allowed.lower)
    elif allowed.upper < linear.lower:
        stall = f"the angle at which {aircraft.name} stalls with negative lift"
        yield "alpha_max_deg", _outside("at least", linear.lower, stall, allowed.upper)
    elif math.isfinite(allowed.lower) and lift_curve(allowed.lower, lift) > C_L_max:
        most = (C_L_max - lift.C_L0) / lift.C_Lalpha
        yield "alpha_min_deg", _outside("at most", most, "the angle of the largest lift coefficient", allowed.lower)
    n_z_max = min(aircraft.envelope.n_z.upper, rules.n_z.upper)
    if rules.pilot.n_z_ends > n_z_max:
        text = f"must be at most {n_z_max:g}, the largest load factor; is {rules.pilot.n_z_ends:g}"
        yield "pilot.n_z_min_ends", text


def _outside(bound: str, limit: float, reason: str, value: float) -> str:
    limit, value = (math.degrees(angle) for angle in (limit, value))
    return f"must be {bound} {limit:.1f}, {reason}; is {value:.4g}"


def flight_limits(aircraft: Aircraft, rules: Rules) -> Limits:
    """Return the limits common to aircraft and rules.

    Raises:
        InputError: some quantity has no value that both allow.
    """
    lift, alpha_A, z = aircraft.lift, rules.alpha_A, Interval(-rules.height.upper, -rules.height.lower)
    if not z.empty and z.upper - z.lower < LEAST_ROOM:
        middle = 0.5 * (z.lower + z.upper)
        z = Interval(middle - 0.5 * LEAST_ROOM, middle + 0.5 * LEAST_ROOM)
    C_L = Interval(
        lift_curve(alpha_A.lower, lift) if math.isfinite(alpha_A.lower) else -math.inf,
        lift_curve(alpha_A.upper, lift) if math.isfinite(alpha_A.upper) else math.inf,
    )
    limits = Limits(
        z=z,
        V_K=aircraft.envelope.V,
        n_z=aircraft.envelope.n_z.intersect(rules.n_z_allowed),
        p_Kbar=symmetric(min(aircraft.point_mass.p, rules.p)),
        C_L=Interval(lift.C_L_min, lift.C_L_max).intersect(rules.C_L).intersect(C_L),
        beta_A=symmetric(min(aircraft.drag.beta_A_max, rules.beta_A)),
    )
    findings = [Finding(aircraft.name, 0, 0, f"rules.{key}", text) for key, text in contradictions(aircraft, rules)]
    findings = findings or [
        Finding(aircraft.name, 0, 0, name, "no value satisfies both the aircraft's limits and the rules of the course")
        for name, allowed in vars(limits).items()
        if allowed.empty
    ]
    if findings:
        raise InputError(findings)
    return limits


def linear_range(lift: Lift) -> Interval:
    """Return the angles of attack (rad) between which the linear lift curve runs from `C_L_min` to `C_L_max`."""
    return Interval((lift.C_L_min - lift.C_L0) / lift.C_Lalpha, (lift.C_L_max - lift.C_L0) / lift.C_Lalpha)


def load_factor_bounds(aircraft: Aircraft, rules: Rules) -> dict[str, Interval]:
    """Return the bounds of a model without angles by name: flight path, load factors, roll rate, `LoadFactorPath`.

    Raises:
        InputError: aircraft and rules leave no allowed value of some quantity.
    """
    return {**vars(flight_limits(aircraft, rules)), "n_y": symmetric(aircraft.point_mass.n_y)}


def body_bounds(aircraft: Aircraft, rules: Rules, roll_rate: str) -> dict[str, Interval]:
    """Return the bounds of a model with angles by name: flight path, `BodyPath` and what it calls the roll rate.

    The angle of attack stays within the linear part of the lift curve.

    Raises:
        InputError: aircraft and rules leave no allowed value of some quantity.
    """
    bounds = load_factor_bounds(aircraft, rules)
    bounds["alpha_A"] = rules.alpha_A.intersect(linear_range(aircraft.lift))
    bounds[roll_rate] = bounds.pop("p_Kbar")
    return bounds


@vector
class BodyPath(Vector[T]):
    """The quantities that are limited along the path of a model with angles, equation (16).

    States and controls have bounds of their own.
    """

    n_z: T = quantity("1", scale=5.0, text="load factor, 1 in level flight")
    n_y: T = quantity("1", text="lateral load factor, to the right")
    C_L: T = quantity("1", text="lift coefficient")
    alpha_A: T = quantity("rad", scale=0.2, text="angle of attack")
    beta_A: T = quantity("rad", scale=0.2, text="sideslip")


@vector
class Deflected(Vector[T]):
    """The deflections of the control surfaces."""

    eta: T = quantity("rad", scale=0.2, text="elevator, positive nose down")
    xi: T = quantity("rad", scale=0.2, text="ailerons, positive left wing down")
    zeta: T = quantity("rad", scale=0.2, text="rudder, positive nose left")


@vector
class Commanded(Vector[T]):
    """The commands to a controller."""

    n_z_cmd: T = quantity("1", scale=5.0, text="commanded load factor")
    n_y_cmd: T = quantity("1", text="commanded lateral load factor")
    p_cmd: T = quantity("rad/s", scale=3.0, text="commanded roll rate")


@vector
class SurfaceControl(Vector[T]):
    """The rates of the deflections, and the commanded throttle; equation (12) with rates instead of deflections."""

    eta_dot: T = quantity("rad/s", text="rate of the elevator", rate_of="eta")
    xi_dot: T = quantity("rad/s", text="rate of the ailerons", rate_of="xi")
    zeta_dot: T = quantity("rad/s", text="rate of the rudder", rate_of="zeta")
    delta_T_cmd: T = quantity("1", lower=0.0, upper=1.0, text="commanded throttle")


@vector
class CommandControl(Vector[T]):
    """The rates of the commands, and the commanded throttle."""

    n_z_cmd_dot: T = quantity("1/s", scale=20.0, text="rate of the commanded load factor", rate_of="n_z_cmd")
    n_y_cmd_dot: T = quantity("1/s", scale=5.0, text="rate of the commanded lateral load factor", rate_of="n_y_cmd")
    p_cmd_dot: T = quantity("rad/s2", scale=20.0, text="rate of the commanded roll rate", rate_of="p_cmd")
    delta_T_cmd: T = quantity("1", lower=0.0, upper=1.0, text="commanded throttle")


BRISK_COMMANDS = {"n_y_cmd_dot": 0.1}
"""The rates of commands, by name, that count as brisk where their cost is weighed: `n_y_cmd_dot` in g/s.

Side force in step with the bank turns the path at hardly any cost, so the optimum wags the rudder in slow or hard turns
for next to nothing, and no solver soon finds how exactly. On a generated course for the PC-9 this stage took 2,600
iterations with 0.4 g/s, 31 with 0.2 and 25 with 0.1; on the shipped courses 0.1 costs 1 to 28 ms.
"""


def brisk_rudder(aircraft: Aircraft) -> dict[str, float]:
    """Return the rate of the rudder that counts as brisk, rad/s, by name: a quarter of its limit.

    Of the other surfaces it is half. So the rudder turns back 0.2 to 0.4 times per second on five generated courses,
    with half 0.2 to 0.6 times; a quarter costs 5 to 60 ms on those and 1 to 22 ms on the shipped ones.
    """
    return {"zeta_dot": 0.25 * aircraft.surfaces.rate}


def deflection_bounds(aircraft: Aircraft) -> dict[str, Interval]:
    """Return the travels of the control surfaces by name, rad."""
    return {"eta": aircraft.surfaces.eta, "xi": aircraft.surfaces.xi, "zeta": aircraft.surfaces.zeta}


def surface_bounds(aircraft: Aircraft) -> dict[str, Interval]:
    """Return the travels (rad) and the allowed rates (rad/s) of the control surfaces by name."""
    rate = symmetric(aircraft.surfaces.rate)
    return {**deflection_bounds(aircraft), "eta_dot": rate, "xi_dot": rate, "zeta_dot": rate}


def command_bounds(aircraft: Aircraft) -> dict[str, Interval]:
    """Return the ranges of the commands and the rates at which a pilot moves the stick, by name; SI, rad, g.

    Commands reach to what the aircraft is built for, even where the rules limit the resulting load factor or roll rate
    to less.
    """
    pilot = aircraft.point_mass
    return {
        "n_z_cmd": aircraft.envelope.n_z,
        "n_y_cmd": symmetric(pilot.n_y),
        "p_cmd": symmetric(pilot.p),
        "n_z_cmd_dot": symmetric(pilot.n_z_dot),
        "n_y_cmd_dot": symmetric(pilot.n_y_dot),
        "p_cmd_dot": symmetric(pilot.p_dot),
    }
