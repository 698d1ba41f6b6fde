"""The quantities that are limited along the path of every model with angle of attack and sideslip."""

from airrace.aircraft.aircraft import Aircraft, Lift
from airrace.dynamics.limits import Limits, symmetric
from airrace.errors import Finding, InputError
from airrace.quantities import Interval, T, Vector, quantity, vector
from airrace.track.course import Rules


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
