"""What is seen at gates and pylons, against geometry worked out by hand."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from airrace.dynamics.crossing import CrossingParameters, CrossingValues, crossing_observation
from airrace.dynamics.outer_loop import FlightPathState
from airrace.dynamics.point_mass import PointMassState
from airrace.frames import quaternion
from airrace.quantities import Quantity

HALF_SPAN = 3.7
OBSERVATION = crossing_observation(FlightPathState.quantities())


def gate(heading: float, bank: float = 0.0, *, bank_tolerance: float = 10.0, crossing: float = 60.0) -> list[float]:
    """A gate at (100, 50); angles in degrees."""
    mu_0 = math.radians(bank)
    return list(
        CrossingParameters(
            centre_north=100.0,
            centre_east=50.0,
            axis_north=math.cos(math.radians(heading)),
            axis_east=math.sin(math.radians(heading)),
            bank_cos=math.cos(mu_0),
            bank_sin=math.sin(mu_0),
            bank_tan=math.tan(math.radians(bank_tolerance)),
            crossing_tan=math.tan(math.radians(crossing)),
            half_span=HALF_SPAN,
        ).join()
    )


def seen(
    place: list[float],
    *,
    north: float = 100.0,
    east: float = 50.0,
    height: float = 20.0,
    course: float = 0.0,
    climb: float = 0.0,
    bank: float = 0.0,
) -> CrossingValues[float]:
    """Angles in degrees."""
    q0, q1, q2, q3 = quaternion(*(math.radians(one) for one in (course, climb, bank)))
    state = FlightPathState(x=north, y=east, z=-height, V_K=90.0, q0=q0, q1=q1, q2=q2, q3=q3)
    return CrossingValues[float].split(np.array(OBSERVATION.values(state.join(), place)).ravel().tolist())


def test_level_gate_flown_through_its_centre_shows_zeros() -> None:
    values = seen(gate(30.0), course=30.0)
    expected = {"height": 20.0, "speed": 90.0, "right_wing": HALF_SPAN, "left_wing": -HALF_SPAN}
    expected |= {"bank_cosine": 1.0, "course_cosine": 1.0, "beside_right": HALF_SPAN, "beside_left": -HALF_SPAN}
    for name in ("along", "right", "bank_sine", "climb_sine", "course_sine"):
        assert getattr(values, name) == pytest.approx(0.0, abs=1e-12)
    for name, value in expected.items():
        assert getattr(values, name) == pytest.approx(value, rel=1e-6)


def test_position_is_measured_along_the_axis_and_to_its_right() -> None:
    eastward = gate(90.0)
    ahead, to_the_right = seen(eastward, east=57.0, course=90.0), seen(eastward, north=96.0, course=90.0)
    assert (ahead.along, ahead.right) == (pytest.approx(7.0), pytest.approx(0.0, abs=1e-12))
    assert (to_the_right.along, to_the_right.right) == (pytest.approx(0.0, abs=1e-12), pytest.approx(4.0))


def test_banked_wing_needs_less_width() -> None:
    values = seen(gate(0.0), bank=60.0)
    assert values.right_wing == pytest.approx(HALF_SPAN * 0.5)
    assert values.left_wing == pytest.approx(-HALF_SPAN * 0.5)


@pytest.mark.parametrize("bank", [90.0, -90.0], ids=["right", "left"])
def test_knife_edge_is_met_on_the_prescribed_wing_only(bank: float) -> None:
    right_one, other = seen(gate(0.0, bank), bank=bank), seen(gate(0.0, bank), bank=-bank)
    assert (right_one.bank_sine, right_one.bank_cosine) == (pytest.approx(0.0, abs=1e-12), pytest.approx(1.0))
    assert right_one.bank_excess_right < 0.0
    assert right_one.bank_excess_left < 0.0
    assert other.bank_cosine == pytest.approx(-1.0)
    assert other.bank_excess_right > 0.0
    assert other.bank_excess_left > 0.0


def test_knife_edge_puts_both_wing_tips_on_the_flight_path() -> None:
    values = seen(gate(0.0, 90.0), bank=90.0)
    assert (values.right_wing, values.left_wing) == (pytest.approx(0.0, abs=1e-12), pytest.approx(0.0, abs=1e-12))


def test_inverted_flight_shows_no_bank_sine_and_the_wrong_side_up() -> None:
    upside_down = seen(gate(0.0), bank=180.0)
    assert (upside_down.bank_sine, upside_down.bank_cosine) == (pytest.approx(0.0, abs=1e-12), pytest.approx(-1.0))
    assert max(upside_down.bank_excess_right, upside_down.bank_excess_left) > 0.0
    assert seen(gate(0.0, 180.0), bank=180.0).bank_cosine == pytest.approx(1.0)


@given(st.floats(-179.0, 179.0), st.floats(-60.0, 60.0), st.sampled_from([0.0, 90.0, -90.0, 180.0]))
def test_bank_values_are_sine_and_cosine_of_the_excess_bank(bank: float, climb: float, mu_0: float) -> None:
    values = seen(gate(0.0, mu_0), bank=bank, climb=climb)
    excess, cos_gamma = math.radians(bank - mu_0), math.cos(math.radians(climb))
    assert values.bank_sine == pytest.approx(cos_gamma * math.sin(excess), abs=1e-12)
    assert values.bank_cosine == pytest.approx(cos_gamma * math.cos(excess), abs=1e-12)


@pytest.mark.parametrize(("bank", "legal"), [(9.9, True), (-9.9, True), (10.1, False), (-10.1, False), (175.0, False)])
def test_bank_tolerance_is_kept_exactly_where_no_excess_shows(bank: float, legal: bool) -> None:
    values = seen(gate(0.0, bank_tolerance=10.0), bank=bank, climb=5.0)
    assert (values.bank_excess_right <= 0.0 and values.bank_excess_left <= 0.0) is legal


def test_excess_bank_names_its_side() -> None:
    right_wing_low, left_wing_low = seen(gate(0.0), bank=20.0), seen(gate(0.0), bank=-20.0)
    assert right_wing_low.bank_excess_right > 0.0 > right_wing_low.bank_excess_left
    assert left_wing_low.bank_excess_left > 0.0 > left_wing_low.bank_excess_right


def test_climb_shows_as_positive_sine() -> None:
    assert seen(gate(0.0), climb=10.0).climb_sine == pytest.approx(math.sin(math.radians(10.0)))


@pytest.mark.parametrize(
    ("course", "legal"), [(59.9, True), (-59.9, True), (60.1, False), (-60.1, False), (180.0, False)]
)
def test_crossing_angle_is_kept_exactly_where_no_excess_shows(course: float, legal: bool) -> None:
    values = seen(gate(0.0, crossing=60.0), course=course)
    assert (values.course_excess_right <= 0.0 and values.course_excess_left <= 0.0) is legal


def test_reversed_heading_shows_a_negative_cosine() -> None:
    values = seen(gate(40.0), course=220.0)
    assert values.course_cosine == pytest.approx(-1.0)
    assert values.course_sine == pytest.approx(0.0, abs=1e-12)


def test_gate_flown_from_behind_mirrors_the_axis() -> None:
    forward, backward = seen(gate(40.0), north=103.0), seen(gate(220.0), north=103.0)
    assert (backward.along, backward.right) == (pytest.approx(-forward.along), pytest.approx(-forward.right))


def test_pylon_left_of_the_track_has_both_wing_tips_on_its_right() -> None:
    # flying east, 10 m south of the pylon: south is to the right of the track, so the pylon stands on the left
    values = seen(gate(0.0), north=90.0, course=90.0, bank=-60.0)
    assert values.beside_right == pytest.approx(10.0 + HALF_SPAN * 0.5, rel=1e-6)
    assert values.beside_left == pytest.approx(10.0 - HALF_SPAN * 0.5, rel=1e-6)


@given(st.floats(-180.0, 180.0), st.floats(-80.0, 80.0), st.floats(-50.0, 50.0), st.floats(-50.0, 50.0))
def test_distance_beside_a_pylon_knows_no_axis_and_is_normal_to_the_track(
    course: float, climb: float, ahead: float, to_right: float
) -> None:
    c, s = math.cos(math.radians(course)), math.sin(math.radians(course))
    north, east = 100.0 + ahead * c - to_right * s, 50.0 + ahead * s + to_right * c
    one = seen(gate(0.0), north=north, east=east, course=course, climb=climb)
    other = seen(gate(77.0), north=north, east=east, course=course, climb=climb)
    assert one.beside_right == other.beside_right
    assert 0.5 * (one.beside_right + one.beside_left) == pytest.approx(to_right, abs=1e-3)
    assert one.beside_right - one.beside_left == pytest.approx(2.0 * HALF_SPAN, rel=1e-4)


def test_everything_is_finite_in_vertical_flight() -> None:
    assert all(math.isfinite(value) for value in seen(gate(0.0), climb=90.0).join())


def test_any_model_with_a_flight_path_can_be_observed() -> None:
    shuffled = tuple(reversed(PointMassState.quantities()))
    q0, q1, q2, q3 = quaternion(0.3, 0.1, -0.7)
    path = {"x": 12.0, "y": -5.0, "z": -30.0, "V_K": 70.0, "q0": q0, "q1": q1, "q2": q2, "q3": q3}
    plain = OBSERVATION.values([path[one.name] for one in FlightPathState.quantities()], gate(10.0))
    richer = crossing_observation(shuffled).values([path.get(one.name, 9.0) for one in shuffled], gate(10.0))
    assert np.array(richer) == pytest.approx(np.array(plain), rel=1e-14)


def test_model_without_a_flight_path_cannot_be_observed() -> None:
    with pytest.raises(KeyError, match="V_K"):
        crossing_observation(tuple(one for one in FlightPathState.quantities() if one.name != "V_K"))


def test_declarations_match_the_shapes_of_the_function() -> None:
    assert OBSERVATION.values.size1_in(1) == len(OBSERVATION.parameters)
    assert OBSERVATION.values.size1_out(0) == len(OBSERVATION.quantities)
    assert all(isinstance(one, Quantity) and one.text for one in OBSERVATION.quantities)
