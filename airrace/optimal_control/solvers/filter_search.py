"""A line search with a filter [Waechter & Biegler 2006], for steps towards the minimum of a barrier function.

With slacks s of all one-sided bounds, the barrier function is `phi = f - barrier sum log s`; the infeasibility theta is
the sum of all violations. A step is taken where it reduces one of the two enough, compared with the point where it
begins and with all pairs in the filter. A step that does not is corrected once for the curvature of the constraints
(second-order correction), then halved; where it would be too short, the damping grows.
"""

import numpy as np

from airrace.optimal_control.solvers.bounded_program import BOUNDARY_FRACTION, BoundedProgram, Measures, ProgramVector
from airrace.optimal_control.trajectory import Array

# The names and values of [Waechter & Biegler 2006] where they have any.
GAMMA_THETA = GAMMA_PHI = 1e-5
"""The least part by which a step reduces infeasibility or barrier function."""
DELTA, S_THETA, S_PHI = 1.0, 1.1, 2.3
"""The switching condition: where it holds, a step has to reduce the barrier function."""
ETA_PHI = 1e-4
"""The part of the decrease predicted by the slope that it then has to reach (Armijo)."""
THETA_MAX, THETA_MIN = 1e4, 1e-4
"""The largest infeasibility, and the one below which it counts as small, as parts of that where the search begins, or
of 1."""
KAPPA_EPSILON = 10.0
"""The error of a barrier problem that is solved, in barrier parameters."""
KAPPA_MU, THETA_MU = 0.2, 1.5
"""The next barrier parameter, as a part of this one and as its power."""
KAPPA_SIGMA = 1e10
"""Products of slack and multiplier stay within this factor of the barrier parameter."""
ROUNDING = 1e-12
"""The increase of the barrier function that may be rounding."""
SHORTEST = 0.01
"""The shortest step, as a part of the longest that slacks allow."""
STEP_MAX = 100.0
"""The largest change of a scaled unknown."""
DAMPING_MAX, REJECTED_DAMPING_MAX = 1e12, 1e4
"""The largest damping, and the largest after a step that the search rejected."""
DAMPING_FACTOR = 4.0
"""By which damping grows."""


class FilterSearch:
    """The search from where it begins to where it is left.

    Args:
        program: with its bounds.
        barrier, barrier_min: the first and the last value of the barrier parameter.
        measures: of the point where it begins.
        violation_max: the violation of the conditions of optimality at which the search is left.
    """

    def __init__(
        self, program: BoundedProgram, barrier: float, barrier_min: float, measures: Measures, violation_max: float
    ) -> None:
        self.barrier, self._barrier_min, self.violation_max = barrier, barrier_min, violation_max
        self._program = program
        size = max(1.0, measures.infeasibility)
        self._theta_max, self._theta_min = THETA_MAX * size, THETA_MIN * size
        self._filter: list[tuple[float, float]] = []
        self._step, self._correction, self._trial, self._violations = (program.vector() for _ in range(4))

    def advance(
        self, point: ProgramVector, residuals: ProgramVector, measures: Measures, damping: float
    ) -> float | None:
        """Let a point become the next one.

        Args:
            point: where the program is linearised.
            residuals, measures: of it.
            damping: that is tried first.

        Returns:
            The damping of the step; None where there is none, and the point is what it was.
        """
        program, step, functions = self._program, self._step, self._program.functions
        self._lower_barrier(measures)
        functions.objective_gradient()
        theta, phi, is_rejected = measures.infeasibility, self._barrier_function(point.s), False
        while damping <= DAMPING_MAX:
            if program.factorise(point, damping):
                if damping > REJECTED_DAMPING_MAX and is_rejected:
                    break
                program.solve(point, residuals, self.barrier - point.s * point.z, step)
                is_short = float(np.abs(step.w).max()) <= STEP_MAX
                if is_short and self._search(point, residuals, theta, phi):
                    point.whole[:] = self._trial.whole
                    central = self.barrier / point.s
                    np.clip(point.z, central / KAPPA_SIGMA, central * KAPPA_SIGMA, out=point.z)
                    return damping
                is_rejected = True
            damping *= DAMPING_FACTOR
        return None

    def _lower_barrier(self, measures: Measures) -> None:
        """Lower the barrier parameter as long as its problem is solved; each has a filter of its own."""
        while self.barrier > self._barrier_min:
            distance = max(measures.largest_product - self.barrier, self.barrier - measures.least_product)
            error = max(measures.primal, measures.dual_scale * max(measures.stationarity, distance))
            if error > KAPPA_EPSILON * self.barrier:
                break
            lower = min(KAPPA_MU * self.barrier, self.barrier**THETA_MU)
            self.barrier = max(self._barrier_min, lower)
            self._filter.clear()

    def _barrier_function(self, slacks: Array) -> float:
        return self._program.functions.f - self.barrier * float(np.log(slacks).sum())

    def _search(self, point: ProgramVector, residuals: ProgramVector, theta: float, phi: float) -> bool:
        """Let the trial become the first point along the step that passes the filter; return whether there is one."""
        program, step, trial = self._program, self._step, self._trial
        slope = float(program.functions.f_gradient @ step.w) - self.barrier * float((step.s / point.s).sum())
        longest, dual = _step_lengths(point, step, self._reach)
        length = longest
        while length > SHORTEST * longest:
            trial.become(point, step, length, dual)
            trial_theta = self._infeasibility()
            if self._passes(trial_theta, theta, phi, length, slope):
                return True
            if length == longest and trial_theta >= theta:
                self._correct(point, residuals, length)
                if self._passes(self._infeasibility(), theta, phi, length, slope):
                    return True
            length *= 0.5
        return False

    def _correct(self, point: ProgramVector, residuals: ProgramVector, length: float) -> None:
        """Let the trial become the point after a second-order correction, for the violations at the trial as well."""
        violations, correction, unknowns = self._violations, self._correction, len(point.w)
        violations.w[:] = residuals.w
        violations.primal[unknowns:] += length * residuals.primal[unknowns:]
        self._program.solve(point, violations, self.barrier - point.s * point.z, correction)
        self._trial.become(point, correction, *_step_lengths(point, correction, self._reach))

    @property
    def _reach(self) -> float:
        """The part of the way to where the first slack or multiplier vanishes."""
        return max(BOUNDARY_FRACTION, 1.0 - self.barrier)

    def _infeasibility(self) -> float:
        """Evaluate the constraints at the trial, and return the sum of all violations."""
        self._program.go_to(self._trial)
        self._program.functions.values()
        return self._program.residuals(self._trial, self._violations).infeasibility

    def _passes(self, trial_theta: float, theta: float, phi: float, length: float, slope: float) -> bool:
        """Return whether the trial, of infeasibility `trial_theta`, is acceptable; extend the filter if need be."""
        trial_phi = self._barrier_function(self._trial.s)
        if not (np.isfinite(trial_phi) and trial_theta < self._theta_max):
            return False
        for filter_theta, filter_phi in self._filter:
            if trial_theta > filter_theta and trial_phi > filter_phi:
                return False
        switches = slope < 0.0 and length * (-slope) ** S_PHI > DELTA * theta**S_THETA
        if switches and theta <= self._theta_min:
            return trial_phi <= phi + ETA_PHI * length * slope + ROUNDING
        margin_theta, margin_phi = theta * (1.0 - GAMMA_THETA), phi - GAMMA_PHI * theta
        if trial_theta > margin_theta and trial_phi > margin_phi:
            return False
        self._filter.append((margin_theta, margin_phi))
        return True


def _step_lengths(point: ProgramVector, step: ProgramVector, reach: float) -> tuple[float, float]:
    """Return how far slacks and multipliers can go, at most the whole step and a part of the way to zero."""
    lengths: list[float] = []
    for values, changes in ((point.s, step.s), (point.z, step.z)):
        ratio = float((changes / values).min(initial=0.0))
        lengths.append(1.0 if ratio >= -reach else -reach / ratio)
    return lengths[0], lengths[1]
