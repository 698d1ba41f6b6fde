"""The solution of a transcribed problem: one nonlinear program, two solvers, one form of answer.

A solve that fails is a value: `ProgramSolution.success` is False, `ending` says why, `status` in
the solver's own words.
"""

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from airrace.optimal_control.assembly import Assembly
from airrace.optimal_control.certificate import Curvature, SecondOrder
from airrace.optimal_control.evaluation import Evaluation
from airrace.optimal_control.kernels import Kernels
from airrace.optimal_control.layout import Layout
from airrace.optimal_control.optimality import KktError, kkt_error
from airrace.optimal_control.problem import Iterate, Problem
from airrace.optimal_control.second_order import judge
from airrace.optimal_control.solvers import INTERIOR_POINT, IPOPT
from airrace.optimal_control.solvers.bounded_program import available
from airrace.optimal_control.solvers.interface import (
    Bounds,
    Ending,
    Multipliers,
    Solver,
    SolverOptions,
    SolverResult,
)
from airrace.optimal_control.solvers.interior_point import InteriorPoint
from airrace.optimal_control.solvers.ipopt import Ipopt
from airrace.optimal_control.trajectory import Array


@dataclass(frozen=True)
class ProgramSolution:
    """The answer of a solver, whether it found an optimum or not.

    Attributes:
        solver: its name.
        ending: why it ended.
        status: the same in its own words.
        success: whether it is an optimum: the errors are within the tolerance, and there is no way down as far as its
            curvature was judged.
        iterate: the last iterate, SI.
        multipliers: of the scaled program.
        objective: value of the objective.
        kkt: errors of the optimality conditions, measured here and not taken from the solver.
        worst: the most violated constraint, for people.
        iterations: number of iterations.
        seconds: that the solver took.
        derivative_seconds: how many of them were spent in the program's functions.
        replay_error: largest distance between an interval integrated again, by an independent integrator, and the next
            node, in scaled units; NaN where it was not requested.
        second_order: the curvature of an optimum; None where it was not requested, or is not finite.
    """

    solver: str
    ending: Ending
    status: str
    success: bool
    iterate: Iterate
    multipliers: Multipliers
    objective: float
    kkt: KktError
    worst: str
    iterations: int
    seconds: float
    derivative_seconds: float
    replay_error: float = np.nan
    second_order: SecondOrder | None = None

    @property
    def infeasible(self) -> bool:
        """Whether the solver claims that there is no feasible point nearby."""
        return self.ending in (Ending.INFEASIBLE, Ending.CROSSED_BOUNDS)

    @classmethod
    def without_answer(
        cls,
        problem: Problem,
        guess: Iterate,
        solver: str,
        ending: Ending,
        status: str = "",
        *,
        iterations: int = 0,
        seconds: float = 0.0,
    ) -> "ProgramSolution":
        """Return what is known where no solver came back, or none was asked: the guess, of which nothing is measured.

        Args:
            problem: that was to be solved.
            guess: of it.
            solver: that was, or would have been, asked.
            ending: why there is no answer.
            status: the same for people; by default the ending's own sentence.
            iterations: that were reported nevertheless.
            seconds: that were waited.
        """
        layout = Layout(problem)
        return cls(
            solver=solver,
            ending=ending,
            status=status or ending.value,
            success=False,
            iterate=guess,
            multipliers=Multipliers(np.zeros(layout.constraints), np.zeros(layout.unknowns)),
            objective=np.nan,
            kkt=KktError(np.nan, np.nan, np.nan),
            worst="",
            iterations=iterations,
            seconds=seconds,
            derivative_seconds=np.nan,
        )


SOLVERS: Mapping[str, type[Solver]] = {INTERIOR_POINT: InteriorPoint, IPOPT: Ipopt}
"""The solvers by the names that settings know; where the former's steps cannot be computed the latter is used."""


STEP_FROM_SADDLE = 0.1
"""The largest change of a scaled unknown (1) in the step along negative curvature that leaves a saddle.

From the saddles of the tests a hundredth of it and ten times as much lead to the same minima.
"""
OPTIMAL = 1e-6
"""The largest errors of the first-order conditions, scaled, of an optimum whose solver does not claim it."""


class PreparedProblem:
    """A problem's structure made ready for one solver; parameters, bounds and guesses may change between solves.

    Args:
        solver: one of the names in `SOLVERS`, or a solver of that kind.
    """

    def __init__(
        self, layout: Layout, kernels: Kernels, solver: str | type[Solver], options: SolverOptions, threads: int = 1
    ) -> None:
        self._functions = Evaluation(Assembly(layout, kernels), threads)
        self._options = options
        if solver == INTERIOR_POINT and not available(self._functions.assembly):
            solver = IPOPT
        self._name = solver if isinstance(solver, str) else solver.__name__
        self._solver = (SOLVERS[solver] if isinstance(solver, str) else solver)(self._functions, options)

    def solve(self, layout: Layout, guess: Iterate, multipliers: Multipliers | None = None) -> ProgramSolution:
        """Solve with the values of `layout.problem`, which must have the structure this was prepared for."""
        bounds = Bounds(*layout.unknown_bounds(), *layout.constraint_bounds())
        p = layout.parameter_values()
        start = np.clip(layout.pack(guess), bounds.lower, bounds.upper)
        started = time.perf_counter()
        if refusal := self._refusal(start, bounds, p):
            unsolved = np.zeros(layout.constraints)
            result = SolverResult(start, unsolved, np.nan, refusal, refusal.value, False, 0, 0.0)
        else:
            result = self._solver.solve(start, bounds, p, multipliers)
        error, lam_x, worst = kkt_error(self._functions, layout, result.w, p, result.lam_g)
        second_order: SecondOrder | None = None
        if self._options.curvature and (result.success or error.largest <= OPTIMAL):
            reached = result
            result, second_order = self._beyond_saddles(layout, bounds, p, reached)
            if result is not reached:
                error, lam_x, worst = kkt_error(self._functions, layout, result.w, p, result.lam_g)
        ending, status = result.ending, result.status
        if second_order is not None:
            is_saddle = second_order.curvature is Curvature.INDEFINITE
            if is_saddle or ending is Ending.SADDLE:
                ending = Ending.SADDLE if is_saddle else Ending.OPTIMAL
                status = ending.value
        success = bool(error.largest <= self._options.tolerance) and ending is not Ending.SADDLE
        if success:
            ending = Ending.OPTIMAL
        elif ending is Ending.OPTIMAL:
            ending, status = Ending.ACCEPTABLE, f"{status}; its errors are measured to be larger than asked"
        seconds = time.perf_counter() - started
        return ProgramSolution(
            solver=self._name,
            ending=ending,
            status=status,
            success=success,
            iterate=layout.unpack(result.w),
            multipliers=Multipliers(result.lam_g, lam_x),
            objective=result.objective,
            kkt=error,
            worst=layout.describe(worst),
            iterations=result.iterations,
            seconds=seconds,
            derivative_seconds=result.derivative_seconds,
            second_order=second_order,
        )

    def _beyond_saddles(
        self, layout: Layout, bounds: Bounds, p: Array, result: SolverResult
    ) -> tuple[SolverResult, SecondOrder | None]:
        """Judge an optimum by its curvature; from a saddle solve again, from a step to either side of it.

        Returns:
            The better optimum, else the one that is given, and the verdict on it.
        """
        judged = judge(self._functions, layout, result.w, p, result.lam_g)
        for length in (STEP_FROM_SADDLE, -STEP_FROM_SADDLE):
            if judged is None or judged[0].curvature is not Curvature.INDEFINITE:
                break
            start = np.clip(result.w + length * judged[1], bounds.lower, bounds.upper)
            _, lam_x, _ = kkt_error(self._functions, layout, result.w, p, result.lam_g)
            beyond = self._solver.solve(start, bounds, p, Multipliers(result.lam_g, lam_x))
            is_better = beyond.success and beyond.objective < result.objective
            iterations = result.iterations + beyond.iterations
            seconds = result.derivative_seconds + beyond.derivative_seconds
            result = replace(beyond, status=f"{beyond.status}, beyond a saddle") if is_better else result
            result = replace(result, iterations=iterations, derivative_seconds=seconds)
            if is_better:
                judged = judge(self._functions, layout, result.w, p, result.lam_g)
        return result, None if judged is None else judged[0]

    def _refusal(self, start: Array, bounds: Bounds, p: Array) -> Ending | None:
        """Return why no solver is to be asked: crossed bounds, or a guess without finite values."""
        if (bounds.lower > bounds.upper).any() or (bounds.g_lower > bounds.g_upper).any():
            return Ending.CROSSED_BOUNDS
        self._functions.at(start, p)
        finite = np.isfinite(self._functions.f) and np.isfinite(self._functions.g).all()
        return None if finite else Ending.INVALID_GUESS
