"""What aircraft and rules allow together."""

import dataclasses
import math

import pytest

from airrace.aircraft.aircraft import Aircraft
from airrace.dynamics.aerodynamics import lift_curve
from airrace.dynamics.limits import LEAST_ROOM, bounded, flight_limits
from airrace.errors import InputError
from airrace.quantities import Interval, Quantity
from airrace.track.course import Rules


def test_the_narrower_limit_counts(edge540: Aircraft) -> None:
    strict = Rules(n_z=Interval(-2.0, 10.0), C_L=Interval(-5.0, 1.1), p=3.0, beta_A=0.1)
    limits = flight_limits(edge540, strict)
    assert limits.n_z == Interval(-2.0, 10.0)
    assert (limits.C_L.lower, limits.C_L.upper) == (-1.4, 1.1)
    assert limits.p_Kbar == Interval(-3.0, 3.0)
    assert limits.beta_A == Interval(-0.1, 0.1)


def test_without_rules_the_aircraft_sets_the_limits(edge540: Aircraft) -> None:
    limits = flight_limits(edge540, Rules(n_z=Interval()))
    assert limits.n_z == edge540.envelope.n_z
    assert limits.V_K == edge540.envelope.V
    assert limits.p_Kbar.upper == edge540.point_mass.p
    assert (limits.C_L.lower, limits.C_L.upper) == (-1.4, 1.4)
    assert limits.beta_A.upper == edge540.drag.beta_A_max


def test_floor_and_ceiling_bound_the_down_axis_from_the_other_side(edge540: Aircraft) -> None:
    assert flight_limits(edge540, Rules(n_z=Interval(), height=Interval(5.0, 300.0))).z == Interval(-300.0, -5.0)
    assert flight_limits(edge540, Rules(n_z=Interval(), height=Interval(lower=5.0))).z == Interval(-math.inf, -5.0)


@pytest.mark.parametrize("room", [0.0, 0.1 * LEAST_ROOM, LEAST_ROOM, 2.0 * LEAST_ROOM])
def test_the_least_room_is_left_between_floor_and_ceiling(edge540: Aircraft, room: float) -> None:
    z = flight_limits(edge540, Rules(n_z=Interval(), height=Interval(20.0, 20.0 + room))).z
    assert z.upper - z.lower == pytest.approx(max(room, LEAST_ROOM))
    assert 0.5 * (z.lower + z.upper) == pytest.approx(-20.0 - 0.5 * room)


def test_a_ceiling_below_the_floor_is_contradicting(edge540: Aircraft) -> None:
    with pytest.raises(InputError, match=r"Edge 540: z: no value"):
        flight_limits(edge540, Rules(n_z=Interval(), height=Interval(20.0, 19.999)))


def test_angle_of_attack_bounds_lift_through_the_lift_curve(edge540: Aircraft) -> None:
    rules = Rules(n_z=Interval(), alpha_A=Interval(-0.05, math.radians(12.0)))
    limits = flight_limits(edge540, rules)
    assert limits.C_L.upper == lift_curve(math.radians(12.0), edge540.lift) == pytest.approx(1.0, abs=0.01)
    assert limits.C_L.lower == pytest.approx(-0.24, abs=0.01)


def test_contradicting_limits_are_named(edge540: Aircraft) -> None:
    weak = dataclasses.replace(edge540, envelope=dataclasses.replace(edge540.envelope, n_z=Interval(-1.0, 3.0)))
    with pytest.raises(InputError, match=r"Edge 540: n_z: no value"):
        flight_limits(weak, Rules(n_z=Interval(4.0, 6.0)))


def test_bounds_replace_only_what_they_name() -> None:
    one, other = Quantity("a", "m", lower=-1.0), Quantity("b", "m", upper=2.0)
    assert bounded((one, other), {"b": Interval(0.0, 1.0)}) == (one, Quantity("b", "m", lower=0.0, upper=1.0))


def test_bound_of_an_unknown_quantity_is_refused() -> None:
    with pytest.raises(KeyError, match="c"):
        bounded((Quantity("a", "m"),), {"c": Interval()})
