"""Prices obey the symmetries of a race, add up, and are what solving again finds."""

import dataclasses
import math

import pytest
from sensitivity_courses import COURSE, CROWDED, inputs, mirrored_text, optimum, priced

from airrace.errors import CheckpointError, NotCertified
from airrace.inputs.variation import Variation
from airrace.optimal_control.solvers.process.service import SolverService
from airrace.parameters import ParameterGroup
from airrace.procedure.models import iterate_of
from airrace.procedure.perturbed import PerturbedProblem
from airrace.procedure.progress import Silent
from airrace.procedure.result import Status
from airrace.procedure.solver_session import SolverSession
from airrace.sensitivity.lagrangian import prices
from airrace.sensitivity.sensitivity import Activity

GATES = ("first", "side", "last")
EXACT = 2e-6  # s per unit: what an optimum solved to 1e-7 leaves of laws that hold exactly


def price(key: str) -> float:
    return priced()[key].price


@pytest.mark.parametrize("axis", ["north_m", "east_m"])
def test_moving_the_whole_course_is_free(axis: str) -> None:
    each = [price(f"gates.{gate}.{axis}") for gate in GATES]
    assert max(map(abs, each)) > 1e-3
    assert sum(each) == pytest.approx(0.0, abs=EXACT)


@pytest.mark.parametrize("axis", ["north_m", "east_m"])
def test_moving_the_whole_course_with_its_people_and_borders_is_free(axis: str) -> None:
    found = priced(CROWDED)
    assert found["crowd.stand.distance_m"].price > 1e-3
    assert found["airspace.2.east_m"].price < -1e-3
    assert sum(one.price for key, one in found.items() if key.endswith(axis)) == pytest.approx(0.0, abs=EXACT)


def test_turning_the_whole_course_with_its_wind_is_free() -> None:
    places = {"first": (0.0, 0.0), "side": (300.0, 60.0), "last": (420.0, -260.0)}
    turned = [
        price(f"gates.{gate}.east_m") * north - price(f"gates.{gate}.north_m") * east
        for gate, (north, east) in places.items()
    ]
    directions = ("gates.first.heading_deg", "gates.side.pass_side_deg", "gates.last.heading_deg")
    aside = [math.degrees(price(key)) for key in (*directions, "environment.wind.from_deg")]
    assert abs(aside[-1]) > 1e-2
    assert sum(turned) + sum(aside) == pytest.approx(0.0, abs=500.0 * EXACT)


def test_raising_the_whole_course_is_lowering_the_sea() -> None:
    limits = [price(key) for key in ("gate_defaults.height_min_m", "gate_defaults.height_max_m", "rules.floor_m")]
    assert max(map(abs, limits)) > 1e-3
    assert sum(limits) == pytest.approx(price("origin.elevation_m"), abs=EXACT)
    assert price("origin.elevation_m") > 5.0 * EXACT


def test_a_default_costs_what_it_costs_at_all_gates_that_follow_it() -> None:
    for key in ("height_max_m", "climb_max_deg", "crossing_max_deg"):
        assert price(f"gate_defaults.{key}") == pytest.approx(sum(price(f"gates.{gate}.{key}") for gate in GATES))
    two_pylons = price("gates.first.width_m") + price("gates.last.width_m")
    assert price("gate_defaults.width_m") == pytest.approx(two_pylons)


def test_engine_and_propeller_share_one_price_in_per_cent() -> None:
    power, efficiency = (priced()[f"aircraft.propulsion.{key}"] for key in ("power_max_kW", "propeller_efficiency"))
    assert power.price * power.value == pytest.approx(efficiency.price * efficiency.value, rel=1e-5)


def test_more_power_and_start_speed_are_faster_and_drag_is_slower() -> None:
    assert price("aircraft.propulsion.power_max_kW") < 0.0
    assert price("rules.start_speed_max_kt") < 0.0
    assert price("aircraft.drag.C_D0") > 0.0


def test_the_mirrored_course_has_the_mirrored_prices() -> None:
    mirror = priced(mirrored_text())
    assert optimum(mirrored_text()).trajectory.race_time == pytest.approx(optimum().trajectory.race_time, abs=1e-5)
    for key, one in priced().items():
        odd = key.endswith(("east_m", "heading_deg", "side_deg", "from_deg"))
        assert mirror[key].price * one.usual_step == pytest.approx((-1 if odd else 1) * one.cost_up, abs=2e-4), key


def test_limits_that_nobody_touches_are_free() -> None:
    for key in ("rules.n_z_min", "gates.side.reach_m", "aircraft.envelope.speed_max_m_s", "aircraft.pitch.C_mq"):
        assert priced()[key].activity is Activity.FREE, key
        assert priced()[key].weight == 0.0, key


def test_prices_come_with_the_dearest_usual_step_first() -> None:
    weights = [one.weight for one in priced().values()]
    assert weights == sorted(weights, reverse=True)


def test_every_number_of_the_documents_has_a_price() -> None:
    assert priced().keys() == Variation(inputs()).parameters.keys()


def test_only_the_groups_that_are_asked_for_are_priced() -> None:
    found = prices(inputs(), optimum(), groups=frozenset([ParameterGroup.RULES]))
    assert found
    assert found == {key: one for key, one in priced().items() if key.startswith("rules.")}


def test_where_two_limits_coincide_only_the_tighter_side_costs() -> None:
    """Floor and window begin at the same height: raising either costs, lowering one of them gains nothing."""
    found = priced(COURSE, "rules.floor_m=15")
    gates = [found[f"gates.{gate}.height_min_m"] for gate in GATES]
    edge = next(one for one in gates if one.activity is Activity.ONE_SIDED)
    assert edge.cost_up > 1e-5
    assert edge.cost_down == pytest.approx(0.0, abs=1e-9)
    assert "at its edge" in edge.note


def test_where_the_range_of_a_key_ends_there_is_a_price_to_the_other_side_alone() -> None:
    found = priced(COURSE, "gate_defaults.clearance_m=0")["gate_defaults.clearance_m"]
    assert found.activity is Activity.ONE_SIDED
    assert found.upward > 0.0
    assert math.isnan(found.downward)
    assert "no smaller value" in found.note


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
def test_solving_again_finds_the_price(key: str) -> None:
    one, given, result = priced()[key], inputs(), optimum()
    variation, varied = Variation(given), PerturbedProblem.of_result(given.race, given.settings, result)
    closer = dataclasses.replace(given.settings.solver, tolerance=1e-9)
    settings = dataclasses.replace(given.settings, solver=closer)
    change = 0.05 * one.usual_step
    objectives: list[float] = []
    with SolverService() as service:
        session = SolverSession(service, settings, Silent())
        for value in (one.value - change, one.value + change):
            problem = varied.problem(variation.race(key, value))
            solution = session.solve(problem, iterate_of(result.trajectory), "again", barrier=1e-6, solvers=("ipopt",))
            assert solution is not None
            assert solution.success
            objectives.append(solution.objective)
    assert one.price == pytest.approx((objectives[1] - objectives[0]) / (2.0 * change), rel=0.01, abs=1e-5)


def test_only_a_certified_stage_has_prices() -> None:
    with pytest.raises(NotCertified, match="not certified"):
        prices(inputs(), dataclasses.replace(optimum(), outcome=Status.NOT_CERTIFIED))
    with pytest.raises(NotCertified, match="guess"):
        prices(inputs(), dataclasses.replace(optimum(), certificate=None))


def test_multipliers_of_another_flight_are_refused() -> None:
    fewer = optimum().constraint_multipliers[:-1]
    with pytest.raises(CheckpointError, match="multipliers"):
        prices(inputs(), dataclasses.replace(optimum(), constraint_multipliers=fewer))
