"""A line search with a filter [Waechter & Biegler 2006], for steps towards the minimum of a barrier function.

With slacks s of all one-sided bounds, the barrier function is `phi = f - barrier sum log s`; the infeasibility theta is
the sum of all violations. A step is taken where it lessens one of the two enough, compared with the point where it
begins and with all that the filter remembers. A step that does not is corrected once for the curvature of the
constraints, then halved; where it would be too short, the number on the diagonal grows.
"""

from dataclasses import dataclass

import numpy as np

from airrace.optimal_control.solvers.bounded_program import STEP, BoundedProgram, Measures, Vector
from airrace.trajectory import Array


@dataclass(frozen=True)
class FilterParameters:
    """The constants of the line search, with the names and values of [Waechter & Biegler 2006] where they have any.

    Attributes:
        gamma_theta, gamma_phi: the least part by which a step lessens infeasibility or barrier function.
        delta, s_theta, s_phi: of the condition under which a step has to lessen the barrier function.
        eta_phi: the part of the decrease promised by the slope that it then has to reach.
        theta_max, theta_min: the largest infeasibility, and the one from which on it counts as small, as parts of that
            where the search begins, or of 1.
        kappa_epsilon: the error of a barrier problem that is solved, in barrier parameters.
        kappa_mu, theta_mu: the next barrier parameter, as a part of this one and as its power.
        kappa_sigma: products of slack and multiplier stay within this factor of the barrier parameter.
        rounding: the increase of the barrier function that may be rounding.
        shortest: the shortest step, as a part of the longest that slacks allow.
        largest_step: the largest change of a scaled unknown.
        most_damping, most_rejected_damping: the largest number on the diagonal, and the largest after a step that the
            search rejected.
        damping_factor: by which it grows and falls.
    """

    gamma_theta: float = 1e-5
    gamma_phi: float = 1e-5
    delta: float = 1.0
    s_theta: float = 1.1
    s_phi: float = 2.3
    eta_phi: float = 1e-4
    theta_max: float = 1e4
    theta_min: float = 1e-4
    kappa_epsilon: float = 10.0
    kappa_mu: float = 0.2
    theta_mu: float = 1.5
    kappa_sigma: float = 1e10
    rounding: float = 1e-12
    shortest: float = 0.01
    largest_step: float = 100.0
    most_damping: float = 1e12
    most_rejected_damping: float = 1e4
    damping_factor: float = 4.0


FILTER = FilterParameters()


class FilterSearch:
    """The search from where it begins to where it is left.

    Args:
        program: with its bounds.
        barrier, least_barrier: the first and the last value of the barrier parameter.
        measures: of the point where it begins.
        leave_below: the violation of the conditions of optimality below which there is no more need of it.
    """

    def __init__(
        self, program: BoundedProgram, barrier: float, least_barrier: float, measures: Measures, leave_below: float
    ) -> None:
        self.barrier, self._least_barrier, self.leave_below = barrier, least_barrier, leave_below
        self._program = program
        size = max(1.0, measures.infeasibility)
        self._theta_max, self._theta_min = FILTER.theta_max * size, FILTER.theta_min * size
        self._filter: list[tuple[float, float]] = []
        self._step, self._second, self._trial, self._violations = (program.vector() for _ in range(4))

    def advance(self, point: Vector, residuals: Vector, measures: Measures, damping: float) -> float | None:
        """Let a point become the next one.

        Args:
            point: where the program is linearised.
            residuals, measures: of it.
            damping: the number on the diagonal that is tried first.

        Returns:
            The number on the diagonal; None where there is no step, and the point is what it was.
        """
        program, step, functions = self._program, self._step, self._program.functions
        self._lower_barrier(measures)
        functions.objective_gradient()
        theta, phi, is_rejected = measures.infeasibility, self._barrier_function(point.s), False
        while damping <= FILTER.most_damping:
            if program.factorise(point, damping):
                if damping > FILTER.most_rejected_damping and is_rejected:
                    break
                program.solve(point, residuals, self.barrier - point.s * point.z, step)
                short = float(np.abs(step.w).max()) <= FILTER.largest_step
                if short and self._search(point, residuals, theta, phi):
                    point.whole[:] = self._trial.whole
                    central = self.barrier / point.s
                    np.clip(point.z, central / FILTER.kappa_sigma, central * FILTER.kappa_sigma, out=point.z)
                    return damping
                is_rejected = True
            damping *= FILTER.damping_factor
        return None

    def _lower_barrier(self, measures: Measures) -> None:
        """Lower the barrier parameter as long as its problem is solved; the filter of another one tells nothing."""
        while self.barrier > self._least_barrier:
            distance = max(measures.largest_product - self.barrier, self.barrier - measures.least_product)
            error = max(measures.primal, measures.dual_scale * max(measures.stationarity, distance))
            if error > FILTER.kappa_epsilon * self.barrier:
                break
            lower = min(FILTER.kappa_mu * self.barrier, self.barrier**FILTER.theta_mu)
            self.barrier = max(self._least_barrier, lower)
            self._filter.clear()

    def _barrier_function(self, slacks: Array) -> float:
        return self._program.functions.f - self.barrier * float(np.log(slacks).sum())

    def _search(self, point: Vector, residuals: Vector, theta: float, phi: float) -> bool:
        """Let the trial become the first point along the step that passes the filter; return whether there is one."""
        program, step, trial = self._program, self._step, self._trial
        slope = float(program.functions.f_gradient @ step.w) - self.barrier * float((step.s / point.s).sum())
        longest, dual = _step_lengths(point, step, self._reach)
        length = longest
        while length > FILTER.shortest * longest:
            trial.become(point, step, length, dual)
            reached = self._infeasibility()
            if self._passes(reached, theta, phi, length, slope):
                return True
            if length == longest and reached >= theta:
                self._correct(point, residuals, length)
                if self._passes(self._infeasibility(), theta, phi, length, slope):
                    return True
            length *= 0.5
        return False

    def _correct(self, point: Vector, residuals: Vector, length: float) -> None:
        """Let the trial become the point after a step that takes back the violations at the trial as well."""
        violations, second, unknowns = self._violations, self._second, len(point.w)
        violations.w[:] = residuals.w
        violations.primal[unknowns:] += length * residuals.primal[unknowns:]
        self._program.solve(point, violations, self.barrier - point.s * point.z, second)
        self._trial.become(point, second, *_step_lengths(point, second, self._reach))

    @property
    def _reach(self) -> float:
        """The part of the way to where the first slack or multiplier vanishes."""
        return max(STEP.boundary_fraction, 1.0 - self.barrier)

    def _infeasibility(self) -> float:
        """Evaluate the constraints at the trial, and return the sum of all violations."""
        self._program.go_to(self._trial)
        self._program.functions.values()
        return self._program.residuals(self._trial, self._violations).infeasibility

    def _passes(self, reached: float, theta: float, phi: float, length: float, slope: float) -> bool:
        """Tell whether the trial, of infeasibility `reached`, is better than the point; if so the filter remembers."""
        barrier_function = self._barrier_function(self._trial.s)
        if not (np.isfinite(barrier_function) and reached < self._theta_max):
            return False
        lower = theta * (1.0 - FILTER.gamma_theta), phi - FILTER.gamma_phi * theta
        if not all(reached <= infeasibility or barrier_function <= value for infeasibility, value in self._filter):
            return False
        descends = slope < 0.0 and length * (-slope) ** FILTER.s_phi > FILTER.delta * theta**FILTER.s_theta
        if theta <= self._theta_min and descends:
            return barrier_function <= phi + FILTER.eta_phi * length * slope + FILTER.rounding
        if reached <= lower[0] or barrier_function <= lower[1]:
            self._filter.append(lower)
            return True
        return False


def _step_lengths(point: Vector, step: Vector, reach: float) -> tuple[float, float]:
    """Return how far slacks and multipliers can go, at most the whole step and a part of the way to zero."""
    lengths: list[float] = []
    for values, changes in ((point.s, step.s), (point.z, step.z)):
        ratio = float((changes / values).min(initial=0.0))
        lengths.append(1.0 if ratio >= -reach else -reach / ratio)
    return lengths[0], lengths[1]
