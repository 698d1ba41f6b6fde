"""Solving a transcribed problem: one nonlinear program, two solvers, one form of answer.

A solve that fails is a value: `Solution.success` is False and `status` holds the solver's own words.
"""

import time
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from airrace.optimal_control.kernels import Kernels
from airrace.optimal_control.kkt import KktError, kkt_error
from airrace.optimal_control.layout import Layout
from airrace.optimal_control.problem import Iterate
from airrace.optimal_control.transcription import NonlinearProgram, transcribe
from airrace.trajectory import Array


@dataclass(frozen=True)
class SolverOptions:
    """`tolerance` on the scaled KKT conditions; `barrier` is the first value of the barrier parameter."""

    tolerance: float = 1e-7
    iterations_max: int = 500
    barrier: float = 0.1


@dataclass(frozen=True)
class Multipliers:
    """Multipliers of the scaled program: of its constraints (n_g,) and of its simple bounds (n_w,)."""

    constraints: Array
    bounds: Array


@dataclass(frozen=True)
class Solution:
    """What a solver returned.

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
        seconds: inside the solver.
        derivative_seconds: of these, in the program's functions.
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


class Solver(ABC):
    """A solver for nonlinear programs, set up once per structure."""

    name: str

    @abstractmethod
    def options(self, layout: Layout, program: NonlinearProgram, options: SolverOptions) -> Mapping[str, Any]:
        """Options of casadi's `nlpsol`."""  # Any: casadi's option dictionaries are heterogeneous

    def infeasible(self, status: str) -> bool:
        """Whether a status claims local infeasibility."""
        return "infeasible" in status.lower()


class Fatrop(Solver):
    """Riccati-structured interior point method (Vanroye et al.)."""

    name = "fatrop"

    def options(self, layout: Layout, program: NonlinearProgram, options: SolverOptions) -> Mapping[str, Any]:
        return {
            "structure_detection": "manual",
            "N": layout.intervals,
            "nx": layout.stage_states.tolist(),
            "nu": layout.stage_controls.tolist(),
            "ng": layout.stage_rows.tolist(),
            "cache": {
                "nlp_grad_f": program.grad_f,
                "nlp_grad": program.grad,
                "nlp_jac_g": program.jac_g,
                "nlp_hess_l": program.hess_l,
            },
            "fatrop": {"tol": options.tolerance, "max_iter": options.iterations_max, "mu_init": options.barrier},
        }


class Ipopt(Solver):
    """IPOPT with MUMPS on the same program."""

    name = "ipopt"

    def options(self, layout: Layout, program: NonlinearProgram, options: SolverOptions) -> Mapping[str, Any]:
        return {
            "cache": {
                "nlp_grad_f": program.f_and_grad,
                "nlp_grad": program.grad,
                "nlp_jac_g": program.jac_g,
                "nlp_hess_l": program.hess_l_upper,
            },
            "ipopt": {
                "tol": options.tolerance,
                "max_iter": options.iterations_max,
                "mu_init": options.barrier,
                "sb": "yes",
            },
        }


SOLVERS: Mapping[str, Solver] = {solver.name: solver for solver in (Fatrop(), Ipopt())}


class PreparedProblem:
    """A problem's structure made ready for one solver; parameters, bounds and guesses may change between solves."""

    def __init__(self, layout: Layout, kernels: Kernels, solver: Solver, options: SolverOptions, threads: int) -> None:
        self._program = transcribe(layout, kernels, threads)
        self._solver = solver
        self._settings = {
            "print_time": False,
            "calc_lam_p": False,
            **solver.options(layout, self._program, options),
        }
        self._nlpsols: dict[bytes, ca.Function] = {}

    def solve(self, layout: Layout, guess: Iterate, multipliers: Multipliers | None = None) -> Solution:
        """Solve with the values of `layout.problem`, which must have the structure this was prepared for."""
        lower, upper = layout.unknown_bounds()
        g_lower, g_upper = layout.constraint_bounds()
        p = layout.parameter_values()
        arguments: dict[str, Array] = {"x0": np.clip(layout.pack(guess), lower, upper), "p": p}
        arguments |= {"lbx": lower, "ubx": upper, "lbg": g_lower, "ubg": g_upper}
        if multipliers is not None:
            arguments |= {"lam_g0": multipliers.constraints, "lam_x0": multipliers.bounds}
        seconds = 0.0
        if refusal := self._refusal(arguments):
            lam_g = np.zeros(layout.constraints)
            result: Mapping[str, Any] = {"x": arguments["x0"], "lam_g": lam_g, "f": np.nan}  # Any: as casadi's own
            stats: Mapping[str, Any] = {"return_status": refusal, "success": False}
        else:
            nlpsol = self._nlpsol(arguments)
            started = time.perf_counter()
            result = nlpsol(**arguments)
            seconds = time.perf_counter() - started
            stats = nlpsol.stats()
        w = np.asarray(result["x"]).ravel()
        lam_g = np.asarray(result["lam_g"]).ravel()
        error, lam_x, worst = kkt_error(self._program, layout, w, p, lam_g)
        return Solution(
            solver=self._solver.name,
            status=str(stats["return_status"]),
            success=bool(stats["success"]),
            infeasible=self._solver.infeasible(str(stats["return_status"])),
            iterate=layout.unpack(w),
            multipliers=Multipliers(lam_g, lam_x),
            objective=float(result["f"]),
            kkt=error,
            worst=layout.describe(worst),
            iterations=int(stats.get("iter_count", 0)),
            seconds=seconds,
            derivative_seconds=sum(value for key, value in stats.items() if key.startswith("t_wall_nlp_")),
        )

    def _nlpsol(self, arguments: Mapping[str, Array]) -> ca.Function:
        """The solver for bounds of these kinds.

        Where an equality turns into a range, or a range is left away, casadi 3.8.2 sets fatrop up anew without its
        options: default tolerance, iterations and barrier from then on.
        """
        kinds = b"".join(
            np.concatenate([np.isfinite(lower), np.isfinite(upper), lower == upper]).tobytes()
            for lower, upper in ((arguments["lbx"], arguments["ubx"]), (arguments["lbg"], arguments["ubg"]))
        )
        if kinds not in self._nlpsols:
            self._nlpsols[kinds] = ca.nlpsol("solve", self._solver.name, self._program.nlp, dict(self._settings))
        return self._nlpsols[kinds]

    def _refusal(self, arguments: Mapping[str, Array]) -> str:
        """Why no solver is to be asked: casadi raises for crossed bounds, fatrop never returns from NaN; else empty."""
        if (arguments["lbx"] > arguments["ubx"]).any() or (arguments["lbg"] > arguments["ubg"]).any():
            return "infeasible: bounds contradict one another"
        values = self._program.nlp(arguments["x0"], arguments["p"])
        if not all(np.isfinite(np.asarray(one)).all() for one in values):
            return "the guess has no finite objective and constraints"
        return ""


def solve(
    layout: Layout, kernels: Kernels, guess: Iterate, *, solver: str = "fatrop", options: SolverOptions | None = None
) -> Solution:
    """Prepare and solve a problem here and now, in this process."""
    prepared = PreparedProblem(layout, kernels, SOLVERS[solver], options or SolverOptions(), threads=1)
    return prepared.solve(layout, guess)
