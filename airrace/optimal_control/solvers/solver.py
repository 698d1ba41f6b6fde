"""The solution of a transcribed problem: one nonlinear program, two solvers, one form of answer.

A solve that fails is a value: `Solution.success` is False and `status` holds the solver's own words.
"""

import time
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import replace
from typing import Protocol

import casadi as ca
import numpy as np

from airrace.optimal_control.assembly import Assembly
from airrace.optimal_control.evaluation import Evaluation
from airrace.optimal_control.kernels import Kernels
from airrace.optimal_control.layout import Layout
from airrace.optimal_control.optimality import KktError, kkt_error
from airrace.optimal_control.problem import Iterate, Problem
from airrace.optimal_control.solvers import riccati
from airrace.optimal_control.solvers.fatrop.abi_check import require_known_interface
from airrace.optimal_control.solvers.fatrop.solver import FatropSolver
from airrace.optimal_control.solvers.fatrop.stages import Bounds
from airrace.optimal_control.solvers.ipopt_functions import ProgramFunctions
from airrace.optimal_control.solvers.predictor_corrector import PredictorCorrector
from airrace.records import record
from airrace.trajectory import Array


@record
class SolverOptions:
    """The tolerance, the number of iterations and the barrier that a solver is given.

    Attributes:
        tolerance: on the scaled conditions of optimality, without unit; a tenth of what a race's certificate allows.
        iterations_max: number of iterations after which a solve has failed.
        barrier: first value of the barrier parameter, in the objective's unit; 0.1 is the solvers' own, for guesses
            that may be far off, and a solve from an optimum of nearly the same problem begins with 1e-4 or less.
        exact: whether bounds are kept as they are, which fatrop relaxes by 1e-8.
    """

    tolerance: float = 1e-7
    iterations_max: int = 500
    barrier: float = 0.1
    exact: bool = False


@record
class Multipliers:
    """The multipliers of the scaled program: of its constraints (n_g,) and of its simple bounds (n_w,)."""

    constraints: Array
    bounds: Array


@record
class Solution:
    """The answer of a solver, whether it found an optimum or not.

    Attributes:
        solver: its name.
        status: its own words.
        success: whether it claims an optimum.
        infeasible: whether it claims that there is no feasible point nearby.
        iterate: the last iterate, SI.
        multipliers: of the scaled program.
        objective: value of the objective.
        kkt: errors of the optimality conditions, measured here and not taken from the solver.
        worst: the most violated constraint, for people.
        iterations: number of iterations.
        seconds: that the solver took.
        derivative_seconds: how many of them were spent in the program's functions.
    """

    solver: str
    status: str
    success: bool
    infeasible: bool
    iterate: Iterate
    multipliers: Multipliers
    objective: float
    kkt: KktError
    worst: str
    iterations: int
    seconds: float
    derivative_seconds: float

    @classmethod
    def unsolved(
        cls, problem: Problem, guess: Iterate, solver: str, status: str, *, iterations: int = 0, seconds: float = 0.0
    ) -> "Solution":
        """Return what is known where no solver came back, or none was asked: the guess, of which nothing is measured.

        Args:
            problem: that was to be solved.
            guess: of it.
            solver: that was, or would have been, asked.
            status: why there is no answer.
            iterations: that were reported nevertheless.
            seconds: that were waited.
        """
        layout = Layout(problem)
        return cls(
            solver=solver,
            status=status,
            success=False,
            infeasible=False,
            iterate=guess,
            multipliers=Multipliers(np.zeros(layout.constraints), np.zeros(layout.unknowns)),
            objective=np.nan,
            kkt=KktError(np.nan, np.nan, np.nan),
            worst="",
            iterations=iterations,
            seconds=seconds,
            derivative_seconds=np.nan,
        )


@record
class Answer:
    """The result of a solver: the last unknowns w (n_w,), the multipliers of the constraints (n_g,), how it went."""

    w: Array
    lam_g: Array
    objective: float
    status: str
    success: bool
    iterations: int
    derivative_seconds: float


class SolverInstance(Protocol):
    """A solver set up for one program."""

    def solve(self, guess: Array, bounds: Bounds, p: Array, multipliers: Multipliers | None) -> Answer:
        """Solve for these numbers; the multipliers are a guess too."""
        ...


class Solver(ABC):
    """A solver for nonlinear programs, set up once per structure.

    Attributes:
        name: that settings know.
        begins_with_multipliers: whether a guess of the multipliers changes where it begins.
        effort: the processor time of an iteration, in those of fatrop (1).
    """

    name: str
    begins_with_multipliers = False
    effort = 1

    @abstractmethod
    def ready(self, functions: Evaluation, options: SolverOptions) -> SolverInstance:
        """Set up the solver for a program that these functions evaluate."""

    def infeasible(self, status: str) -> bool:
        """Return whether a status claims local infeasibility."""
        return "infeasible" in status.lower()


NEAR_BARRIER = 1e-5
"""The largest first value of the barrier parameter of a solve that begins near its optimum.

From another stage, with 1e-4, predictor-corrector steps lead astray: they took as long as fatrop, or failed.
"""


class Fatrop(Solver):
    """The Riccati-structured interior point method fatrop (Vanroye et al.).

    Near an optimum with known multipliers predictor-corrector steps come first, with the native library.
    """

    name = "fatrop"
    begins_with_multipliers = True

    def ready(self, functions: Evaluation, options: SolverOptions) -> SolverInstance:
        require_known_interface()
        solver = FatropSolver(functions, fatrop_options(options), exact=options.exact)
        near = options.barrier <= NEAR_BARRIER and riccati.available(functions.assembly)
        return _ReadyFatrop(solver, functions, options, PredictorCorrector(functions) if near else None)


@record
class _ReadyFatrop:
    solver: FatropSolver
    functions: Evaluation
    options: SolverOptions
    near: PredictorCorrector | None

    def solve(self, guess: Array, bounds: Bounds, p: Array, multipliers: Multipliers | None) -> Answer:
        known = None if multipliers is None else np.concatenate([multipliers.constraints, multipliers.bounds])
        if known is None or self.near is None:
            return self._by_fatrop(guess, bounds, p, known)
        options = self.options
        found = self.near.solve(
            guess,
            bounds,
            p,
            known,
            tolerance=options.tolerance,
            barrier=options.barrier,
            iterations_max=options.iterations_max,
        )
        if not found.optimal:
            answer = self._by_fatrop(guess, bounds, p, known)
            return replace(answer, iterations=answer.iterations + found.iterations)
        return Answer(
            w=found.w,
            lam_g=found.lam_g,
            objective=self.functions.f,
            status="solved by predictor-corrector steps",
            success=True,
            iterations=found.iterations,
            derivative_seconds=self.functions.seconds,
        )

    def _by_fatrop(self, guess: Array, bounds: Bounds, p: Array, known: Array | None) -> Answer:
        result = self.solver.solve(guess, bounds, p, known)
        return Answer(
            w=result.w,
            lam_g=result.lam_g,
            objective=result.objective,
            status=result.status,
            success=result.success,
            iterations=result.iterations,
            derivative_seconds=result.derivative_seconds,
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


class Ipopt(Solver):
    """The solver IPOPT with MUMPS on the same program, which it evaluates through `program_functions.py`.

    On Abu Dhabi 2016, which is made impossible, an iteration takes it 57 to 83 us per interval of the point mass, and
    fatrop 37 to 47 us.
    """

    name = "ipopt"
    effort = 2

    def ready(self, functions: Evaluation, options: SolverOptions) -> SolverInstance:
        settings = {"tol": options.tolerance, "max_iter": options.iterations_max, "mu_init": options.barrier}
        return _ReadyIpopt(functions, settings)


class _ReadyIpopt:
    def __init__(self, functions: Evaluation, settings: Mapping[str, float | int]) -> None:
        self._program = ProgramFunctions(functions)
        self._settings = {
            "print_time": False,
            "calc_lam_p": False,
            "cache": self._program.derivatives,
            "ipopt": {**settings, "sb": "yes"},
        }
        self._nlpsols: dict[bytes, ca.Function] = {}

    def solve(self, guess: Array, bounds: Bounds, p: Array, multipliers: Multipliers | None) -> Answer:
        self._program.begin(p)
        arguments: dict[str, Array] = {"x0": guess, "p": p, "lbx": bounds.lower, "ubx": bounds.upper}
        arguments |= {"lbg": bounds.g_lower, "ubg": bounds.g_upper}
        if multipliers is not None:
            arguments |= {"lam_g0": multipliers.constraints, "lam_x0": multipliers.bounds}
        nlpsol = self._nlpsol(bounds)
        result = nlpsol(**arguments)
        stats = nlpsol.stats()
        return Answer(
            w=np.asarray(result["x"]).ravel(),
            lam_g=np.asarray(result["lam_g"]).ravel(),
            objective=float(result["f"]),
            status=str(stats["return_status"]),
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


SOLVERS: Mapping[str, Solver] = {solver.name: solver for solver in (Fatrop(), Ipopt())}


class PreparedProblem:
    """A problem's structure made ready for one solver; parameters, bounds and guesses may change between solves."""

    def __init__(self, layout: Layout, kernels: Kernels, solver: Solver, options: SolverOptions, threads: int) -> None:
        self._functions = Evaluation(Assembly(layout, kernels), threads)
        self._solver = solver
        self._ready = solver.ready(self._functions, options)

    def solve(self, layout: Layout, guess: Iterate, multipliers: Multipliers | None = None) -> Solution:
        """Solve with the values of `layout.problem`, which must have the structure this was prepared for."""
        bounds = Bounds(*layout.unknown_bounds(), *layout.constraint_bounds())
        p = layout.parameter_values()
        start = np.clip(layout.pack(guess), bounds.lower, bounds.upper)
        seconds = 0.0
        if refusal := self._refusal(start, bounds, p):
            answer = Answer(start, np.zeros(layout.constraints), np.nan, refusal, False, 0, 0.0)
        else:
            started = time.perf_counter()
            answer = self._ready.solve(start, bounds, p, multipliers)
            seconds = time.perf_counter() - started
        error, lam_x, worst = kkt_error(self._functions, layout, answer.w, p, answer.lam_g)
        return Solution(
            solver=self._solver.name,
            status=answer.status,
            success=answer.success,
            infeasible=self._solver.infeasible(answer.status),
            iterate=layout.unpack(answer.w),
            multipliers=Multipliers(answer.lam_g, lam_x),
            objective=answer.objective,
            kkt=error,
            worst=layout.describe(worst),
            iterations=answer.iterations,
            seconds=seconds,
            derivative_seconds=answer.derivative_seconds,
        )

    def _refusal(self, start: Array, bounds: Bounds, p: Array) -> str:
        """Return why no solver is to be asked; empty if there is no reason.

        Reasons are crossed bounds, and a guess without finite values.
        """
        if (bounds.lower > bounds.upper).any() or (bounds.g_lower > bounds.g_upper).any():
            return "infeasible: bounds contradict one another"
        self._functions.at(start, p)
        if not (np.isfinite(self._functions.f) and np.isfinite(self._functions.g).all()):
            return "the guess has no finite objective and constraints"
        return ""
