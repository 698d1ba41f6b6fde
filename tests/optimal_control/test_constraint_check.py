"""What the nodes hide is measured: its size, where it is, and which intervals are too coarse for it."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from known_flights import FREQUENCY, LENS, SYSTEM, exact, flight, problem

from airrace.optimal_control.certificate import Item
from airrace.optimal_control.constraint_check import ConstraintCheck, Tolerance, check_constraints, outside
from airrace.optimal_control.problem import Boundary, Iterate, PathConstraint, Problem
from airrace.optimal_control.quantities import Interval, Quantity
from airrace.optimal_control.replay import replay
from airrace.optimal_control.system import Observation

TOLERANCES = (
    Tolerance("length", ("m",), 0.05, 0.01),
    Tolerance("speed", ("m/s",), 0.1, 0.1),
    Tolerance("power", ("W/kg",), 0.2, 0.2),
)
HALF = 0.6 / FREQUENCY  # s from the top to the nodes on either side of it


def swing(amplitude: float = 1.0) -> Iterate:
    """Free oscillation whose top lies half way between the nodes 1 and 2 of four intervals in two phases."""
    start = np.array([amplitude * np.cos(3.0 * 0.6), amplitude * FREQUENCY * np.sin(3.0 * 0.6)])
    times = 2.0 * HALF * np.arange(5)
    return Iterate(np.array([4.0, 4.0]) * HALF, exact(start, 0.0, times), np.zeros((1, 4)))


def limited(**bounds: Interval) -> Problem:
    """Four equal intervals in two phases; the first phase has limits of its own."""
    stated = problem((0.5, 0.5), (0.5, 0.5))
    first, second = stated.phases
    return replace(stated, phases=(replace(first, bounds=bounds), second))


def audited(stated: Problem, iterate: Iterate, defect_limit: float = 1e-4) -> ConstraintCheck:
    return check_constraints(stated, iterate, replay(stated, iterate), tolerances=TOLERANCES, defect_limit=defect_limit)


def wrong(measured: ConstraintCheck, defect_limit: float = 1e-4) -> np.ndarray:
    """Which intervals leave a limit between their nodes or miss the next one."""
    return (measured.excess > 1.0) | (measured.defect > defect_limit)


def item(measured: ConstraintCheck, name: str) -> Item:
    (found,) = [one for one in measured.items if one.name == name]
    return found


def test_exact_flight_within_its_limits_has_nothing_to_report() -> None:
    measured = audited(problem(), flight(problem()))
    assert all(one.holds for one in measured.items)
    assert not wrong(measured).any()
    assert item(measured, "path_length").value == 0.0


@pytest.mark.parametrize("name", ["x", "elongation"])
def test_violation_between_nodes_is_measured_with_its_size_and_named(name: str) -> None:
    stated, flown = limited(**{name: Interval(upper=0.9)}), swing()
    assert flown.state[0, :3].max() < 0.9  # no node of the phase shows it
    measured = audited(stated, flown)
    found = item(measured, "path_length")
    assert found.value == pytest.approx(0.1, abs=1e-6)
    assert found.where == f"up, {name}"
    assert (found.unit, found.limit) == ("m", 0.05)
    assert not found.holds
    assert wrong(measured).tolist() == [False, True, False, False]


def test_limits_hold_on_both_sides_and_in_all_phases_that_they_are_stated_for() -> None:
    x, v = SYSTEM.states
    free = limited()
    first, second = free.phases
    everywhere = replace(free, system=replace(SYSTEM, states=(replace(x, upper=0.9), v)))
    later = replace(free, phases=(first, replace(second, bounds={"x": Interval(upper=0.9)})))
    for stated, flown, excess in (
        (limited(x=Interval(lower=-0.9)), swing(-1.0), 0.1),
        (everywhere, swing(), 0.1),
        (later, swing(), 0.0),
    ):
        assert item(audited(stated, flown), "path_length").value == pytest.approx(excess, abs=1e-6)


def test_violation_within_its_tolerance_holds_and_refines_nothing() -> None:
    measured = audited(limited(x=Interval(upper=0.96)), swing())
    assert item(measured, "path_length").value == pytest.approx(0.04, abs=1e-6)
    assert item(measured, "path_length").holds
    assert not wrong(measured).any()


def test_defect_is_named_and_marks_its_interval() -> None:
    stated, flown = problem(), flight(problem())
    state = flown.state.copy()
    state[1, -1] += 0.5
    measured = audited(stated, replace(flown, state=state), 1e-3)
    found = item(measured, "replay_defect")
    assert found.value == pytest.approx(0.5 / SYSTEM.states[1].scale, abs=1e-6)
    assert found.where == "down, v"
    assert wrong(measured, 1e-3).tolist() == [False] * 4 + [True]


@pytest.mark.parametrize(("interval", "phase"), [(0, "up"), (2, "up"), (3, "down"), (4, "down")])
def test_phase_is_named_from_its_first_interval_to_its_last(interval: int, phase: str) -> None:
    stated, flown = problem(), flight(problem())
    control = flown.control.copy()
    control[0, interval] += 0.5
    assert item(audited(stated, replace(flown, control=control)), "replay_defect").where.startswith(f"{phase}, ")


def with_ranges(**bounds: Interval) -> Problem:
    """The end of the first phase is observed."""
    stated = problem()
    first, second = stated.phases
    return replace(stated, phases=(replace(first, end=Boundary("gate", bounds, LENS, (0.3,))), second))


def test_gates_are_measured_by_unit_and_the_worst_of_them_is_named() -> None:
    flown = flight(problem())
    x, v = flown.state[:, 3].tolist()
    found = item(audited(with_ranges(distance=Interval(upper=x - 0.3 - 0.25)), flown), "gate_length")
    assert (found.value, found.limit, found.where) == (pytest.approx(0.25), 0.01, "gate, distance")
    assert not found.holds
    found = item(audited(with_ranges(v=Interval.exactly(v + 0.3)), flown), "gate_speed")
    assert (found.value, found.where) == (pytest.approx(0.3), "gate, v")
    first, second = with_ranges(x=Interval.exactly(x + 0.1)).phases
    end = Boundary("finish", {"x": Interval.exactly(float(flown.state[0, -1]) - 0.4)})
    found = item(audited(replace(problem(), phases=(first, replace(second, end=end))), flown), "gate_length")
    assert (found.value, found.where) == (pytest.approx(0.4), "finish, x")


def test_unbounded_gates_have_no_items() -> None:
    assert not [one for one in audited(problem(), flight(problem())).items if one.name.startswith("gate")]


def test_what_is_not_a_number_does_not_hold() -> None:
    flown, seen = flight(problem()), replay(problem(), flight(problem()))
    broken = replace(seen, defect=np.full_like(seen.defect, np.nan))
    measured = check_constraints(problem(), flown, broken, tolerances=TOLERANCES, defect_limit=1e-4)
    assert not item(measured, "replay_defect").holds
    state = flown.state.copy()
    state[0, 3] = np.nan
    first, second = with_ranges(x=Interval(-9.0, 9.0)).phases
    stated = replace(problem(), phases=(first, replace(second, end=Boundary("finish", {"x": Interval(-9.0, 9.0)}))))
    lost = replace(flown, state=state)
    measured = check_constraints(stated, lost, seen, tolerances=TOLERANCES, defect_limit=1e-4)
    assert not item(measured, "gate_length").holds


def test_distance_outside_a_range_is_zero_within_it() -> None:
    values = np.array([-2.0, -1.0, 0.0, 3.0, 5.0])
    assert outside(values, -1.0, 3.0).tolist() == [1.0, 0.0, 0.0, 0.0, 2.0]


def on_watch(exact: Observation | None = None, **bounds: Interval) -> Problem:
    """As `limited`, but by a path constraint on the same two quantities."""
    x, nothing = ca.SX.sym("x", 2), ca.SX.sym("none", 0)
    quantities = (Quantity("height", "m"), Quantity("rising", "m/s"))
    seen = Observation("seen", quantities, (), ca.Function("seen", [x, nothing], [x]))
    stated = problem((0.5, 0.5), (0.5, 0.5))
    first, second = stated.phases
    constraint = PathConstraint("lookout", bounds, seen, (), exact)
    return replace(stated, phases=(replace(first, path_constraints=(constraint,)), second))


def test_watch_is_measured_between_nodes_by_its_exact_measure() -> None:
    measured = audited(on_watch(height=Interval(upper=0.9)), swing())
    found = item(measured, "path_length")
    assert (found.value, found.where) == (pytest.approx(0.1, abs=1e-6), "up, lookout")
    assert wrong(measured).tolist() == [False, True, False, False]
    measured = audited(on_watch(height=Interval(upper=1.1), rising=Interval(-9.0, 9.0)), swing())
    assert item(measured, "path_length").value == 0.0
    assert not wrong(measured).any()
    x, nothing = ca.SX.sym("x", 2), ca.SX.sym("none", 0)
    quantities = (Quantity("height", "m"), Quantity("rising", "m/s"))
    doubled = Observation("exact", quantities, (), ca.Function("exact", [x, nothing], [2 * x]))
    measured = audited(on_watch(doubled, height=Interval(upper=1.9)), swing())
    assert item(measured, "path_length").value == pytest.approx(0.1, abs=1e-6)


@pytest.mark.parametrize(
    ("stated", "name"),
    [(on_watch(height=Interval(upper=1.0)), "height"), (limited(x=Interval(upper=1.0)), "x")],
)
def test_bounded_quantity_without_a_tolerance_is_refused(stated: Problem, name: str) -> None:
    with pytest.raises(ValueError, match=f"no tolerance for {name}"):
        check_constraints(stated, swing(), replay(stated, swing()), tolerances=TOLERANCES[1:], defect_limit=1e-4)
