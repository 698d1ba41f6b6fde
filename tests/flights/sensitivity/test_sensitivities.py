"""Sensitivities obey the symmetries of a race, add up, and are what solving again finds."""

import dataclasses
import math

import pytest
from sensitivity_courses import COURSE, CROWDED, inputs, mirrored_text, optimum, sensitivities_of

from airrace.errors import CheckpointError, NotCertified
from airrace.files.inputs.variation import Variation
from airrace.flights.sensitivity import Activity
from airrace.optimal_control.solvers.service import SolverService
from airrace.procedure.fidelity import iterate_of
from airrace.procedure.result import Silent, Status
from airrace.procedure.solver_session import SolverSession
from airrace.procedure.stage_problem import PerturbedProblem
from airrace.procedure.warm_start import InitialBarrier
from airrace.runs.stage_data import stage_sensitivities

GATES = ("first", "side", "last")
EXACT = 2e-6  # s per unit: what an optimum solved to 1e-7 leaves of laws that hold exactly


def slope(key: str) -> float:
    return sensitivities_of()[key].per_unit


@pytest.mark.parametrize("axis", ["north_m", "east_m"])
def test_moving_the_whole_course_is_free(axis: str) -> None:
    each = [slope(f"gates.{gate}.{axis}") for gate in GATES]
    assert max(map(abs, each)) > 1e-3
    assert sum(each) == pytest.approx(0.0, abs=EXACT)


@pytest.mark.parametrize("axis", ["north_m", "east_m"])
def test_moving_the_whole_course_with_its_people_and_borders_is_free(axis: str) -> None:
    found = sensitivities_of(CROWDED)
    assert found["crowd.stand.distance_m"].per_unit > 1e-3
    assert found["airspace.2.east_m"].per_unit < -1e-3
    assert sum(one.per_unit for key, one in found.items() if key.endswith(axis)) == pytest.approx(0.0, abs=EXACT)


def test_turning_the_whole_course_with_its_wind_is_free() -> None:
    places = {"first": (0.0, 0.0), "side": (300.0, 60.0), "last": (420.0, -260.0)}
    turned = [
        slope(f"gates.{gate}.east_m") * north - slope(f"gates.{gate}.north_m") * east
        for gate, (north, east) in places.items()
    ]
    directions = ("gates.first.heading_deg", "gates.side.pass_side_deg", "gates.last.heading_deg")
    aside = [math.degrees(slope(key)) for key in (*directions, "environment.wind.from_deg")]
    assert abs(aside[-1]) > 1e-2
    assert sum(turned) + sum(aside) == pytest.approx(0.0, abs=500.0 * EXACT)


def test_raising_the_whole_course_is_lowering_the_sea() -> None:
    limits = [slope(key) for key in ("gate_defaults.height_min_m", "gate_defaults.height_max_m", "rules.floor_m")]
    assert max(map(abs, limits)) > 1e-3
    assert sum(limits) == pytest.approx(slope("origin.elevation_m"), abs=EXACT)
    assert slope("origin.elevation_m") > 5.0 * EXACT


def test_a_default_costs_what_it_costs_at_all_gates_that_follow_it() -> None:
    for key in ("height_max_m", "climb_max_deg", "crossing_max_deg"):
        assert slope(f"gate_defaults.{key}") == pytest.approx(sum(slope(f"gates.{gate}.{key}") for gate in GATES))
    two_pylons = slope("gates.first.width_m") + slope("gates.last.width_m")
    assert slope("gate_defaults.width_m") == pytest.approx(two_pylons)


def test_engine_and_drag_count_as_they_should() -> None:
    """Engine and propeller share one sensitivity in per cent; more power and start speed are faster, drag is slower."""
    power, efficiency = (
        sensitivities_of()[f"aircraft.propulsion.{key}"] for key in ("power_max_kW", "propeller_efficiency")
    )
    assert power.per_unit * power.value == pytest.approx(efficiency.per_unit * efficiency.value, rel=1e-5)
    assert power.per_unit < 0.0
    assert slope("rules.start_speed_max_kt") < 0.0
    assert slope("aircraft.drag.C_D0") > 0.0


def test_the_mirrored_course_has_the_mirrored_sensitivities() -> None:
    mirror = sensitivities_of(mirrored_text())
    assert optimum(mirrored_text()).trajectory.race_time == pytest.approx(optimum().trajectory.race_time, abs=1e-5)
    for key, one in sensitivities_of().items():
        odd = key.endswith(("east_m", "heading_deg", "side_deg", "from_deg"))
        assert mirror[key].per_unit * one.usual_step == pytest.approx((-1 if odd else 1) * one.cost_up, abs=2e-4), key


def test_every_number_has_a_sensitivity_the_most_by_a_usual_step_first_and_untouched_limits_are_free() -> None:
    found = sensitivities_of()
    assert found.keys() == Variation(inputs()).parameters.keys()
    weights = [one.weight for one in found.values()]
    assert weights == sorted(weights, reverse=True)
    for key in ("rules.n_z_min", "gates.side.reach_m", "aircraft.envelope.speed_max_m_s", "aircraft.pitch.C_mq"):
        assert (found[key].activity, found[key].weight) == (Activity.FREE, 0.0), key
    of_rules = stage_sensitivities(inputs(), optimum(), "rules")
    assert of_rules
    assert dict(of_rules) == {key: one for key, one in found.items() if key.startswith("rules.")}


def test_where_two_limits_coincide_only_the_tighter_side_costs() -> None:
    """Floor and window begin at the same height: raising either costs, lowering one of them gains nothing."""
    found = sensitivities_of(COURSE, "rules.floor_m=15")
    gates = [found[f"gates.{gate}.height_min_m"] for gate in GATES]
    edge = next(one for one in gates if one.activity is Activity.ONE_SIDED)
    assert edge.cost_up > 1e-5
    assert edge.cost_down == pytest.approx(0.0, abs=1e-9)
    assert "at its edge" in edge.note


def test_where_the_range_of_a_key_ends_there_is_a_sensitivity_to_the_other_side_alone() -> None:
    found = sensitivities_of(COURSE, "gate_defaults.clearance_m=0")["gate_defaults.clearance_m"]
    assert found.activity is Activity.ONE_SIDED
    assert found.upward > 0.0
    assert math.isnan(found.downward)
    assert "no smaller value" in found.note


def assert_found_by_solving_again(key: str, *overrides: str) -> None:
    """The sensitivity of the course with some keys set is the slope between two optima beside it."""
    one, given = sensitivities_of(COURSE, *overrides)[key], inputs(COURSE, *overrides)
    result = optimum(COURSE, *overrides)
    variation, varied = Variation(given), PerturbedProblem.of_result(given.race, given.settings, result)
    closer = dataclasses.replace(given.settings.solver, tolerance=1e-9)
    settings = dataclasses.replace(given.settings, solver=closer)
    change = 0.05 * one.usual_step
    objectives: list[float] = []
    with SolverService() as service:
        session = SolverSession(service, settings, Silent())
        for value in (one.value - change, one.value + change):
            problem = varied.problem(variation.race(key, value))
            guess, barrier = iterate_of(result.trajectory), InitialBarrier.COARSER_MESH
            solution = session.solve(problem, guess, "again", barrier=barrier, solvers=("ipopt",))
            assert solution is not None
            assert solution.success
            objectives.append(solution.objective)
    assert one.per_unit == pytest.approx((objectives[1] - objectives[0]) / (2.0 * change), rel=0.01, abs=1e-5)


@pytest.mark.parametrize(
    "key",
    [
        "rules.start_speed_max_kt",
        "gates.side.east_m",
        "gates.last.heading_deg",
        "gate_defaults.width_m",
        "aircraft.airframe.mass_kg",
        "environment.wind.speed_m_s",
    ],
)
def test_solving_again_finds_the_sensitivity(key: str) -> None:
    assert_found_by_solving_again(key)


PILOT = ("rules.pilot.n_z_min_low=2.5", "rules.pilot.low_height_m=22", "rules.pilot.gate_roll_rate_max_deg_s=20")


@pytest.mark.parametrize("key", ["n_z_min_low", "low_height_m", "gate_roll_rate_max_deg_s"])
def test_solving_again_finds_the_sensitivity_to_a_limit_of_the_pilot(key: str) -> None:
    assert_found_by_solving_again(f"rules.pilot.{key}", *PILOT)


CLEAR = "rules.clearance=flight"


@pytest.mark.parametrize("key", ["gates.side.east_m", "gates.last.width_m", "gates.side.clearance_m", "rules.n_z_max"])
def test_solving_again_finds_the_sensitivity_where_the_wing_keeps_clear_of_pylons_all_along(key: str) -> None:
    assert optimum(COURSE, CLEAR).pylon_conditions
    assert_found_by_solving_again(key, CLEAR)


@pytest.mark.parametrize("key", ["rules.start_speed_max_kt", "environment.wind.speed_m_s", "environment.wind.from_deg"])
def test_solving_again_finds_the_sensitivity_where_the_start_speed_is_an_airspeed(key: str) -> None:
    assert_found_by_solving_again(key, "rules.start_speed=indicated_airspeed")


def test_only_an_optimum_with_its_own_multipliers_has_sensitivities() -> None:
    with pytest.raises(NotCertified, match="not certified"):
        stage_sensitivities(inputs(), dataclasses.replace(optimum(), outcome=Status.NOT_CERTIFIED))
    with pytest.raises(NotCertified, match="guess"):
        stage_sensitivities(inputs(), dataclasses.replace(optimum(), certificate=None))
    fewer = optimum().constraint_multipliers[:-1]
    with pytest.raises(CheckpointError, match="multipliers"):
        stage_sensitivities(inputs(), dataclasses.replace(optimum(), constraint_multipliers=fewer))
