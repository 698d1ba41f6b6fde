"""Controls that are linear over an interval: continuous, within their limits, and closer to smooth optima."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from small_problems import gate, rich_system

from airrace.optimal_control.optimality import hamiltonian
from airrace.optimal_control.problem import Boundary, Objective, Phase, Problem, interpolate, uniform
from airrace.optimal_control.quantities import Interval, Quantity, T, Vector, quantity, vector
from airrace.optimal_control.replay import replay
from airrace.optimal_control.solve_problem import solve
from airrace.optimal_control.solvers.interface import SolverOptions
from airrace.optimal_control.solvers.solver import SOLVERS, ProgramSolution
from airrace.optimal_control.system import System, of_first_states, system_of, with_linear_controls

exactly = Interval.exactly


# the system


def test_chosen_controls_become_states_and_their_rates_controls() -> None:
    system = with_linear_controls(rich_system(), ["s"], seconds=0.5)
    assert [one.name for one in system.states] == ["a", "b", "c", "s"]
    assert [one.name for one in system.controls] == ["t", "s_dot"]
    assert system.states[3] == rich_system().controls[0]
    assert system.controls[1] == Quantity("s_dot", "m/s2/s", 8.0, text="rate of s")
    assert system.parameters == rich_system().parameters
    assert system.path == rich_system().path


@pytest.mark.parametrize("names", [["s"], ["t"], ["t", "s"], None])
def test_equations_are_those_of_the_system_with_the_values_for_controls(names: list[str] | None) -> None:
    plain, system = rich_system(), with_linear_controls(rich_system(), names, seconds=1.0)
    x, p = np.array([0.4, -0.7, 1.1]), np.array([0.7, -0.4])
    u = {"s": 0.3, "t": -0.6}
    linear = [one.name for one in system.states[3:]]
    values = [u[name] for name in linear]
    rates = {f"{name}_dot": 0.1 * (1 + number) for number, name in enumerate(linear)}
    controls = [{**u, **rates}[one.name] for one in system.controls]
    before = [u[one.name] for one in plain.controls]
    found = np.asarray(system.rates([*x, *values], controls, p)).ravel()
    assert found[:3] == pytest.approx(np.asarray(plain.rates(x, before, p)).ravel())
    assert found[3:] == pytest.approx(list(rates.values()))
    path = system.path_values([*x, *values], controls, p)
    assert np.asarray(path).ravel() == pytest.approx(np.asarray(plain.path_values(x, before, p)).ravel())
    projected = np.asarray(system.projection([*x, *values])).ravel()
    assert projected == pytest.approx([*np.asarray(plain.projection(x)).ravel(), *values])


def test_a_control_that_does_not_exist_is_refused() -> None:
    with pytest.raises(ValueError, match="no controls a, q"):
        with_linear_controls(rich_system(), ["s", "q", "a"], seconds=1.0)


def test_an_observation_sees_the_states_it_was_made_for() -> None:
    wider = of_first_states(gate(), with_linear_controls(rich_system(), seconds=1.0))
    assert wider.quantities == gate().quantities
    seen = wider.values([0.4, -0.7, 1.1, 9.0, 9.0], [0.1, 0.2])
    assert np.asarray(seen) == pytest.approx(np.asarray(gate().values([0.4, -0.7, 1.1], [0.1, 0.2])))


# optima


@vector
class Cart(Vector[T]):
    x: T = quantity("m")
    v: T = quantity("m/s")
    effort: T = quantity("m2/s3", scale=10.0, text="integral of the square of the acceleration")


@vector
class Push(Vector[T]):
    f: T = quantity("m/s2", scale=5.0)


CART = system_of("cart", Cart, Push, lambda x, u: Cart(x=x.v, v=u.f, effort=u.f**2))
LEAST_EFFORT = 12.0  # over 1 m in 1 s from rest to rest: f = 6 - 12 t


def least_effort(system: System, intervals: int, **limits: Interval) -> tuple[Problem, ProgramSolution]:
    """Over 1 m in 1 s, from rest to rest, with the least integral of the square of the acceleration."""
    start = Boundary("start", {"x": exactly(0.0), "v": exactly(0.0), "effort": exactly(0.0)})
    end = Boundary("end", {"x": exactly(1.0), "v": exactly(0.0)})
    phase = Phase("cart", uniform(intervals), exactly(1.0), end, bounds=limits)
    problem = Problem(system, (), start, (phase,), Objective(time=0.0, terminal={"effort": 1.0}))
    return problem, solved(problem)


def solved(problem: Problem, solver: str = "interior-point") -> ProgramSolution:
    n_x, n_u = len(problem.system.states), len(problem.system.controls)
    begin, end = np.zeros(n_x), np.zeros(n_x)
    end[0] = 1.0
    guess = interpolate(problem, [1.0], np.stack([begin, end], axis=1), np.full(n_u, 0.1))
    solution = solve(problem, guess, solver=solver, options=SolverOptions(tolerance=1e-9))
    assert solution.success, solution.status
    return solution


LINEAR = with_linear_controls(CART, seconds=0.5)


@pytest.mark.parametrize("intervals", [1, 2, 7])
def test_a_linear_optimum_is_met_on_any_mesh(intervals: int) -> None:
    problem, solution = least_effort(LINEAR, intervals)
    assert solution.objective == pytest.approx(LEAST_EFFORT, abs=1e-7)
    nodes = np.linspace(0.0, 1.0, intervals + 1)
    assert solution.iterate.state[3] == pytest.approx(6.0 - 12.0 * nodes, abs=1e-5)
    assert solution.kkt.largest < 1e-7
    assert np.abs(replay(problem, solution.iterate).defect).max() < 1e-8


def test_held_controls_pay_for_their_steps() -> None:
    """On N equal intervals the least effort is 12 N^2 / (N^2 - 1), for values that fall evenly."""
    for intervals in (4, 8):
        _, solution = least_effort(CART, intervals)
        assert solution.objective == pytest.approx(LEAST_EFFORT / (1.0 - intervals**-2), rel=1e-6)


def test_limits_hold_between_the_nodes_too() -> None:
    problem, solution = least_effort(LINEAR, 12, f=Interval(-5.0, 5.0))
    flown = replay(problem, solution.iterate).state[3]
    assert flown.max() == pytest.approx(5.0, abs=1e-6)
    assert flown.min() == pytest.approx(-5.0, abs=1e-6)
    assert solution.objective > LEAST_EFFORT + 0.01


@pytest.mark.parametrize("solver", SOLVERS)
def test_a_linear_control_goes_on_from_phase_to_phase(solver: str) -> None:
    problem, whole = least_effort(LINEAR, 6)
    (phase,) = problem.phases
    first = replace(phase, fractions=uniform(2), duration=exactly(1 / 3), end=Boundary())
    parts = replace(problem, phases=(first, replace(phase, fractions=uniform(4), duration=exactly(2 / 3))))
    guess = interpolate(parts, [1 / 3, 2 / 3], np.array([[0, 0.5, 1], [0, 0, 0], [0, 5, 12], [0, 0, 0]]), [0.1])
    split = solve(parts, guess, solver=solver, options=SolverOptions(tolerance=1e-9))
    assert split.iterate.state == pytest.approx(whole.iterate.state, abs=1e-6)


@vector
class Swing(Vector[T]):
    angle: T = quantity("rad")
    rate: T = quantity("rad/s")
    effort: T = quantity("1/s3")


@vector
class Torque(Vector[T]):
    M: T = quantity("1/s2")


SWING = system_of(
    "swing", Swing, Torque, lambda x, u: Swing(angle=x.rate, rate=u.M - 4.0 * ca.sin(x.angle), effort=u.M**2)
)


def drift(system: System, intervals: int) -> float:
    """How far the Hamiltonian is from its constant where a swing takes a free time, with a price on its effort."""
    start = Boundary("start", {"angle": exactly(0.0), "rate": exactly(0.0), "effort": exactly(0.0)})
    end = Boundary("end", {"angle": exactly(1.0), "rate": exactly(0.0)})
    phase = Phase("swing", uniform(intervals), Interval(0.1, 5.0), end)
    problem = Problem(system, (), start, (phase,), Objective(terminal={"effort": 0.2}))
    solution = solved(problem)
    return float(np.abs(hamiltonian(problem, solution.iterate, solution.multipliers.constraints) + 1.0).max())


def test_hamiltonian_is_closer_to_its_constant_with_linear_controls() -> None:
    linear = with_linear_controls(SWING, seconds=0.5)
    coarse, fine = drift(linear, 10), drift(linear, 20)
    assert fine < 0.35 * coarse  # of second order
    assert coarse < 0.3 * drift(SWING, 10)
