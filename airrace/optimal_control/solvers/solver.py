"""The solution of a transcribed problem: one nonlinear program, two solvers, one form of answer.

A solve that fails is a value: `Solution.success` is False, `ending` says why, `status` in the solver's own words.
"""

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property

import casadi as ca
import numpy as np

from airrace.optimal_control.assembly import Assembly, StageMatrices
from airrace.optimal_control.certificate import Curvature, SecondOrder
from airrace.optimal_control.evaluation import Evaluation
from airrace.optimal_control.kernels import Kernels
from airrace.optimal_control.layout import Layout
from airrace.optimal_control.optimality import KktError, kkt_error
from airrace.optimal_control.problem import Iterate, Problem
from airrace.optimal_control.second_order import judge
from airrace.optimal_control.solvers.fatrop.solver import FatropResult, FatropSolver, require_known_interface
from airrace.optimal_control.solvers.interface import Bounds, Ending, Multipliers, Solver, SolverOptions, SolverResult
from airrace.optimal_control.solvers.ipopt_functions import ProgramFunctions
from airrace.optimal_control.solvers.predictor_corrector import PredictorCorrector, available
from airrace.records import record
from airrace.trajectory import Array


@record
class Solution:
    """The answer of a solver, whether it found an optimum or not.

    Attributes:
        solver: its name.
        ending: why it ended.
        status: the same in its own words.
        success: whether it claims an optimum.
        iterate: the last iterate, SI.
        multipliers: of the scaled program.
        objective: value of the objective.
        kkt: errors of the optimality conditions, measured here and not taken from the solver.
        worst: the most violated constraint, for people.
        iterations: number of iterations.
        seconds: that the solver took.
        derivative_seconds: how many of them were spent in the program's functions.
        replay_error: largest distance between an interval integrated again, by an independent integrator, and the next
            node, in scaled units; NaN where nobody has asked for it.
        second_order: what the curvature of an optimum tells; None where nobody has asked for it, or it is not finite.
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
    ) -> "Solution":
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


STALLED_ITERATIONS = 8
"""The number of iterations with errors below 1e-6 after which fatrop stops short of a smaller tolerance.

Its own value is 15. On Abu Dhabi in a wind it stops so in most stages, with errors of 6e-7 and less as measured, and
what it does after the first of these iterations changes the race time by less than 1e-6 s.
"""


def fatrop_options(options: SolverOptions) -> Mapping[str, float | int]:
    """Translate the options to fatrop's own names."""
    return {
        "tol": options.tolerance,
        "max_iter": options.iterations_max,
        "mu_init": options.barrier,
        "acceptable_iter": STALLED_ITERATIONS,
    }


HAND_OVER = 20
"""The number of iterations after which fatrop hands over a solve with known multipliers.

From where predictor-corrector steps had run out of iterations, it ended three of five such solves in 18 to 21.
"""


class FatropRelay(Solver):
    """The Riccati-structured interior point method fatrop (Vanroye et al.), with predictor-corrector steps and IPOPT.

    With the native library, predictor-corrector steps come first where the options say so; where they fail fatrop
    begins with the same guess. It hands over to them a solve with known multipliers after `HAND_OVER` iterations, and
    any solve where it creeps (`CreepingDetector`). Where they fail then, it goes on, or IPOPT where it creeps, with
    iterate, multipliers and barrier. All of them together have the iterations of the options, first steps without
    multipliers half of these.
    """

    begins_with_multipliers = True

    def __init__(self, functions: Evaluation, options: SolverOptions) -> None:
        require_known_interface()
        self._fatrop = FatropSolver(functions, fatrop_options(options), exact=options.exact)
        self._options = options
        self._functions = functions

    @cached_property
    def _steps(self) -> PredictorCorrector | None:
        return PredictorCorrector(self._functions) if available(self._functions.assembly) else None

    def solve(self, guess: Array, bounds: Bounds, p: Array, multipliers: Multipliers | None) -> SolverResult:
        known = None if multipliers is None else np.concatenate([multipliers.constraints, multipliers.bounds])
        results: list[SolverResult] = []
        for result in self._relay(guess, bounds, p, known, results):
            results.append(result)
            if result.success or self._left(results) <= 0:
                break
        handed = [one.iterations for one in results[:-1] if isinstance(one, FatropResult)]
        after = f", handed over by fatrop after {sum(handed)} iterations" if handed else ""
        status = results[-1].status + after
        return replace(results[-1], iterations=sum(one.iterations for one in results), status=status)

    def _left(self, results: Sequence[SolverResult]) -> int:
        return self._options.iterations_max - sum(one.iterations for one in results)

    def _relay(
        self, guess: Array, bounds: Bounds, p: Array, known: Array | None, results: Sequence[SolverResult]
    ) -> Iterator[SolverResult]:
        """Yield what everybody reaches who is asked, one after the other, until one of them succeeds.

        Args:
            guess, bounds, p: of the program.
            known: multipliers of constraints and bounds; None if nothing is known of them.
            results: those that were yielded, which leave the others fewer iterations.
        """
        steps, first = self._steps, HAND_OVER
        if steps is not None and self._options.algorithm == "predictor-corrector":
            most = self._options.iterations_max // (2 if known is None else 1)
            yield steps.solve(guess, bounds, p, known, replace(self._options, iterations_max=most))
        if known is None or steps is None:
            first = self._options.iterations_max
        reached = self._fatrop.solve(guess, bounds, p, known, max_iter=min(first, self._left(results)))
        yield reached
        while reached.ending in (Ending.CREEPING, Ending.ITERATION_LIMIT):
            options = replace(self._options, barrier=reached.barrier, iterations_max=self._left(results))
            known = np.concatenate([reached.lam_g, reached.lam_w])
            if steps is not None:
                yield steps.solve(reached.w, bounds, p, known, options)
            left = self._left(results)
            if reached.ending is Ending.CREEPING:
                ipopt = Ipopt(self._functions, replace(options, iterations_max=left), resumes=True)
                yield ipopt.solve(reached.w, bounds, p, Multipliers(reached.lam_g, reached.lam_w))
                break
            reached = self._fatrop.solve(reached.w, bounds, p, known, mu_init=reached.barrier, max_iter=left)
            yield reached


IPOPT_ENDINGS = {
    "Solve_Succeeded": Ending.OPTIMAL,
    "Solved_To_Acceptable_Level": Ending.ACCEPTABLE,
    "Infeasible_Problem_Detected": Ending.INFEASIBLE,
    "Maximum_Iterations_Exceeded": Ending.ITERATION_LIMIT,
    "Restoration_Failed": Ending.NO_BETTER_POINT,
    "Error_In_Step_Computation": Ending.NO_STEP,
    "Search_Direction_Becomes_Too_Small": Ending.NO_STEP,
    "Invalid_Number_Detected": Ending.NOT_FINITE,
}


RESUMING: Mapping[str, float | str] = {
    "warm_start_init_point": "yes",
    **dict.fromkeys(("warm_start_bound_push", "warm_start_slack_bound_push"), 1e-9),
    **dict.fromkeys(("warm_start_bound_frac", "warm_start_slack_bound_frac"), 1e-9),
    "warm_start_mult_bound_push": 1e-9,
}
"""The settings with which IPOPT begins with the iterate of another interior point method, slacks and multipliers."""


class Ipopt(Solver):
    """The solver IPOPT with MUMPS on the same program, which it evaluates through `ipopt_functions.py`.

    On Abu Dhabi 2016, which is made impossible, an iteration takes it 57 to 83 us per interval of the point mass, and
    fatrop 37 to 47 us.

    Args:
        resumes: whether it goes on from multipliers and slacks as they are given.
    """

    effort = 2

    def __init__(self, functions: Evaluation, options: SolverOptions, *, resumes: bool = False) -> None:
        self._program = ProgramFunctions(functions)
        own: dict[str, float | str] = {"tol": options.tolerance, "max_iter": options.iterations_max, "sb": "yes"}
        own["mu_init"] = options.barrier
        if resumes:
            own |= RESUMING
        cache = self._program.derivatives
        self._settings = {"print_time": False, "calc_lam_p": False, "cache": cache, "ipopt": own}
        self._nlpsols: dict[bytes, ca.Function] = {}

    def solve(self, guess: Array, bounds: Bounds, p: Array, multipliers: Multipliers | None) -> SolverResult:
        self._program.begin(p)
        arguments: dict[str, Array] = {"x0": guess, "p": p, "lbx": bounds.lower, "ubx": bounds.upper}
        arguments |= {"lbg": bounds.g_lower, "ubg": bounds.g_upper}
        if multipliers is not None:
            arguments |= {"lam_g0": multipliers.constraints, "lam_x0": multipliers.bounds}
        nlpsol = self._nlpsol(bounds)
        result = nlpsol(**arguments)
        stats = nlpsol.stats()
        status = str(stats["return_status"])
        return SolverResult(
            w=np.asarray(result["x"]).ravel(),
            lam_g=np.asarray(result["lam_g"]).ravel(),
            objective=float(result["f"]),
            ending=IPOPT_ENDINGS.get(status, Ending.UNKNOWN),
            status=status,
            success=bool(stats["success"]),
            iterations=int(stats.get("iter_count", 0)),
            derivative_seconds=sum(value for key, value in stats.items() if key.startswith("t_wall_nlp_")),
        )

    def _nlpsol(self, bounds: Bounds) -> ca.Function:
        """Return the solver for bounds of these kinds: casadi tells IPOPT once which constraints are equalities."""
        kinds = b"".join(
            np.concatenate([np.isfinite(lower), np.isfinite(upper), lower == upper]).tobytes()
            for lower, upper in ((bounds.lower, bounds.upper), (bounds.g_lower, bounds.g_upper))
        )
        if kinds not in self._nlpsols:
            self._nlpsols[kinds] = ca.nlpsol("solve", "ipopt", self._program.nlp, dict(self._settings))
        return self._nlpsols[kinds]


SOLVERS: Mapping[str, type[Solver]] = {"fatrop": FatropRelay, "ipopt": Ipopt}
"""The solvers by the names that settings know."""


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
        self._name = solver if isinstance(solver, str) else solver.__name__
        self._options = options
        self._solver = (SOLVERS[solver] if isinstance(solver, str) else solver)(self._functions, options)

    def solve(self, layout: Layout, guess: Iterate, multipliers: Multipliers | None = None) -> Solution:
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
        seconds = time.perf_counter() - started
        return Solution(
            solver=self._name,
            ending=result.ending,
            status=result.status,
            success=result.success,
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

    @cached_property
    def _matrices(self) -> StageMatrices:
        return StageMatrices(self._functions.assembly)

    def _beyond_saddles(
        self, layout: Layout, bounds: Bounds, p: Array, result: SolverResult
    ) -> tuple[SolverResult, SecondOrder | None]:
        """Judge an optimum by its curvature; from a saddle solve again, from a step to either side of it.

        Returns:
            The better optimum, else the one that is given, and the verdict on it.
        """
        judged = judge(self._functions, self._matrices, layout, result.w, p, result.lam_g)
        for side in (STEP_FROM_SADDLE, -STEP_FROM_SADDLE):
            if judged is None or judged[0].curvature is not Curvature.INDEFINITE:
                break
            start = np.clip(result.w + side * judged[1], bounds.lower, bounds.upper)
            _, lam_x, _ = kkt_error(self._functions, layout, result.w, p, result.lam_g)
            found = self._solver.solve(start, bounds, p, Multipliers(result.lam_g, lam_x))
            better = found.success and found.objective < result.objective
            spent = result.iterations + found.iterations
            derived = result.derivative_seconds + found.derivative_seconds
            result = replace(found, status=f"{found.status}, beyond a saddle") if better else result
            result = replace(result, iterations=spent, derivative_seconds=derived)
            if better:
                judged = judge(self._functions, self._matrices, layout, result.w, p, result.lam_g)
        return result, None if judged is None else judged[0]

    def _refusal(self, start: Array, bounds: Bounds, p: Array) -> Ending | None:
        """Return why no solver is to be asked: crossed bounds, or a guess without finite values."""
        if (bounds.lower > bounds.upper).any() or (bounds.g_lower > bounds.g_upper).any():
            return Ending.CROSSED_BOUNDS
        self._functions.at(start, p)
        finite = np.isfinite(self._functions.f) and np.isfinite(self._functions.g).all()
        return None if finite else Ending.INVALID_GUESS
