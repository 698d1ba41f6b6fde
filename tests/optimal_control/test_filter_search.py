"""The filter line search: acceptance, switching, the filter's memory, second-order correction, barrier parameters."""

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from airrace.optimal_control.solvers.bounded_program import Measures, ProgramVector
from airrace.optimal_control.solvers.filter_search import (
    ETA_PHI,
    GAMMA_PHI,
    GAMMA_THETA,
    KAPPA_EPSILON,
    KAPPA_MU,
    THETA_MAX,
    FilterSearch,
)

BARRIER_MIN = 1e-9


class EqualityProgram:
    """Minimise f(x) subject to c(x) = 0, with the interface of `BoundedProgram` as far as a search needs it.

    Steps are those of sequential quadratic programming with the identity as Hessian.
    """

    def __init__(
        self,
        objective: Callable[[np.ndarray], float],
        gradient: Callable[[np.ndarray], np.ndarray],
        constraint: Callable[[np.ndarray], np.ndarray],
        jacobian: Callable[[np.ndarray], np.ndarray],
        start: np.ndarray,
    ) -> None:
        self.objective, self.gradient, self.constraint, self.jacobian = objective, gradient, constraint, jacobian
        self.functions: Any = SimpleNamespace(  # Any: stands for an Evaluation
            f=objective(start), f_gradient=gradient(start), values=lambda: None, objective_gradient=lambda: None
        )
        self.at, self.corrections = start, 0
        self.point = self.vector()
        self.point.w[:] = start

    def vector(self) -> ProgramVector:
        return ProgramVector((len(self.at), len(self.constraint(self.at)), 0, 0))

    def go_to(self, point: ProgramVector) -> None:
        self.at, self.functions.f = point.w.copy(), self.objective(point.w)

    def residuals(self, point: ProgramVector, residuals: ProgramVector) -> Measures:
        residuals.w[:], residuals.y[:] = self.gradient(point.w), self.constraint(point.w)
        return measures(np.abs(residuals.y).sum())

    def factorise(self, _: ProgramVector, damping: float) -> bool:
        return damping < np.inf

    def solve(self, point: ProgramVector, residuals: ProgramVector, _: np.ndarray, step: ProgramVector) -> None:
        n, A = len(point.w), self.jacobian(point.w)
        matrix = np.block([[np.eye(n), A.T], [A, np.zeros((len(A), len(A)))]])
        step.whole[:] = np.linalg.solve(matrix, -np.concatenate([residuals.w, residuals.y]))

    def advance(self, search: FilterSearch) -> float:
        """The change of the unknowns, its norm, by a search from the point, which becomes the next one."""
        residuals, before = self.vector(), self.point.w.copy()
        self.go_to(self.point)
        self.functions.f_gradient = self.gradient(before)
        found = search.advance(self.point, residuals, self.residuals(self.point, residuals), 1e-6)
        assert found is not None or (self.point.w == before).all()
        return float(np.linalg.norm(self.point.w - before))


class Line(EqualityProgram):
    """Points on a line with given infeasibilities and objectives; every step goes from one to the next."""

    def __init__(self, *points: tuple[float, float], slope: float = 0.0) -> None:
        def look_up(x: np.ndarray) -> tuple[float, float]:
            return points[int(x[0])] if x[0] == int(x[0]) else (1e3, 1e3)  # what lies between is no good

        super().__init__(
            objective=lambda x: look_up(x)[1],
            gradient=lambda _: np.array([slope]),
            constraint=lambda x: np.array([look_up(x)[0]]),
            jacobian=lambda _: np.ones((1, 1)),
            start=np.zeros(1),
        )

    def solve(self, point: ProgramVector, residuals: ProgramVector, _: np.ndarray, step: ProgramVector) -> None:
        step.whole[:] = [1.0, 0.0]


def measures(infeasibility: float, *, error: float = 1.0) -> Measures:
    return Measures(error, error, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, float(infeasibility))


def search_of(program: EqualityProgram, infeasibility: float, barrier: float = BARRIER_MIN) -> FilterSearch:
    stand_in: Any = program
    return FilterSearch(stand_in, barrier, BARRIER_MIN, measures(infeasibility), 0.0)


def takes(program: EqualityProgram, infeasibility: float = 1.0) -> bool:
    """Whether the whole first step is taken."""
    return program.advance(search_of(program, infeasibility)) == 1.0


# acceptance [Waechter & Biegler 2006, (18)]


@pytest.mark.parametrize(
    ("infeasibility", "objective", "accepted"),
    [
        (1.0 - 2.0 * GAMMA_THETA, 5.0, True),
        (1.0 - 0.5 * GAMMA_THETA, 5.0, False),  # too little of either
        (2.0, -2.0 * GAMMA_PHI, True),
        (2.0, -0.5 * GAMMA_PHI, False),
        (2.0, 5.0, False),
        (1.01 * THETA_MAX, -1e9, False),  # too far away
        (0.0, np.inf, False),  # no number
        (0.0, np.nan, False),
    ],
)
def test_a_step_has_to_reduce_infeasibility_or_objective_by_a_margin(
    infeasibility: float, objective: float, accepted: bool
) -> None:
    assert takes(Line((1.0, 0.0), (infeasibility, objective))) is accepted


# switching [Waechter & Biegler 2006, (19), (20)]


SMALL = 1e-5


@pytest.mark.parametrize(
    ("infeasibility", "slope", "switches"), [(SMALL, -1.0, True), (SMALL, -1e-4, False), (SMALL, 1.0, False)]
)
def test_nearly_feasible_points_with_a_steep_slope_have_to_reduce_the_objective(
    infeasibility: float, slope: float, switches: bool
) -> None:
    """Else it suffices to come closer to feasibility."""
    closer = Line((infeasibility, 0.0), (0.5 * infeasibility, 1.0), slope=slope)
    assert takes(closer, infeasibility) is not switches


def test_far_from_feasibility_no_slope_asks_for_a_lower_objective() -> None:
    assert takes(Line((1.0, 0.0), (0.5, 1.0), slope=-10.0), 1.0)


@pytest.mark.parametrize(("part", "accepted"), [(2.0, True), (0.5, False)])
def test_where_the_objective_has_to_fall_it_has_to_by_a_part_of_what_its_slope_says(
    part: float, accepted: bool
) -> None:
    armijo = Line((SMALL, 0.0), (SMALL, -part * ETA_PHI), slope=-1.0)
    assert takes(armijo, SMALL) is accepted


# memory


def test_a_step_may_not_lead_back_to_what_the_filter_holds() -> None:
    """Feasibility for objective, and back again: two points between which a search would go to and fro."""
    there_and_back = Line((1.0, 0.0), (0.5, 10.0), (1.0, 0.0))
    search = search_of(there_and_back, 1.0)
    assert there_and_back.advance(search) == 1.0
    assert there_and_back.advance(search) == 0.0
    assert there_and_back.advance(search_of(there_and_back, 0.5)) == 1.0  # of which another filter knows nothing


def test_a_step_that_reduces_the_objective_near_feasibility_leaves_the_filter_alone() -> None:
    line = Line((SMALL, 0.0), (2.0 * SMALL, -1.0), (1.5 * SMALL, 0.5), slope=-1.0)
    search = search_of(line, SMALL)
    assert line.advance(search) == 1.0
    line.gradient = lambda _: np.zeros(1)
    assert line.advance(search) == 1.0


def test_another_barrier_parameter_begins_with_an_empty_filter() -> None:
    there_and_back = Line((1.0, 0.0), (0.5, 10.0), (1.0, 0.0))
    search = search_of(there_and_back, 1.0, barrier=0.05)
    assert there_and_back.advance(search) == 1.0
    assert search.advance(there_and_back.point, there_and_back.vector(), measures(0.5, error=0.4), 1e-6) is not None
    assert search.barrier < 0.05


@pytest.mark.parametrize(("error", "solved"), [(0.99, True), (1.01, False)])
def test_the_barrier_parameter_falls_once_its_problem_is_solved(error: float, solved: bool) -> None:
    barrier = 0.05
    line = Line((1.0, 0.0), (0.5, 0.0))
    search = search_of(line, 1.0, barrier)
    errors = measures(1.0, error=error * KAPPA_EPSILON * barrier)
    search.advance(line.point, line.vector(), errors, 1e-6)
    assert search.barrier == pytest.approx(KAPPA_MU * barrier if solved else barrier)


# second-order correction


@pytest.mark.parametrize("radius", [1.0, 1.01])
def test_the_maratos_effect_does_not_cut_a_step_short(radius: float) -> None:
    """On a circle, both the objective and the violation rise along a step that leads closer [N&W 2006, 15.4]."""
    angle = 0.3
    start = radius * np.array([np.cos(angle), np.sin(angle)])
    circle = EqualityProgram(
        objective=lambda x: 2.0 * (x @ x - 1.0) - x[0],
        gradient=lambda x: 4.0 * x - np.array([1.0, 0.0]),
        constraint=lambda x: np.array([x @ x - 1.0]),
        jacobian=lambda x: 2.0 * x[None],
        start=start,
    )
    step, residuals = circle.vector(), circle.vector()
    circle.residuals(circle.point, residuals)
    circle.solve(circle.point, residuals, np.zeros(0), step)
    step = step.w
    assert circle.objective(start + step) > circle.objective(start)
    assert circle.constraint(start + step) > circle.constraint(start)
    length = circle.advance(search_of(circle, 0.0))
    assert length == pytest.approx(np.linalg.norm(step), rel=0.1)
    assert abs(circle.constraint(circle.point.w)[0]) < 0.1 * float(step @ step)
    assert np.linalg.norm(circle.point.w - [1.0, 0.0]) < 0.2 * angle
