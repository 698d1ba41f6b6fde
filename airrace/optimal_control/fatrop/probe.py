"""The probe of fatrop's C interface, which finds out before the first solve whether it is laid out as expected.

A field that another release inserts into a struct would not be an error to ctypes: callbacks would be called in each
other's places and results would be read from beside where they stand. So before the first solve of a process a problem
with a known answer is solved through the same structs and prototypes, which takes a few milliseconds: two stages, a
state x and a control u,

    minimise u^2 / 2 + x_1^2 / 2   subject to   x_0 = 1,   x_1 = x_0 + u,   0 <= x_1 <= 5,

with the optimum u = -1/2, x_1 = 1/2. Compared are the dimensions that fatrop has read, the answer and the number of
iterations.
"""

import ctypes
from collections import Counter
from collections.abc import Callable
from functools import cache

import casadi as ca
import numpy as np

from airrace.errors import SolverCrash
from airrace.optimal_control.fatrop.interrupt import interrupts_held_back
from airrace.optimal_control.fatrop.library import (
    EVALUATED,
    OUTPUT,
    Callback,
    doubles_at,
    fatrop,
    interface,
    number_of_stage,
)
from airrace.optimal_control.fatrop.matrices import struct_size
from airrace.trajectory import Array

TESTED = "3.8.2"
"""The release of casadi whose header `tests/optimal_control/test_fatrop_interface.py` compares field by field."""

_N_U, _N_X, _EQUALITIES, _INEQUALITIES = (1, 0), (1, 1), (1, 0), (0, 1)
_EVALUATIONS = ("objective", "gradient", "violation", "jacobian", "hessian")
_OPTIMUM = (-0.5, 1.0, 0.5)  # u, x_0, x_1
_CLOSE = 1e-6  # an interior point method stays off its bounds by about its tolerance, 1e-8


@cache
def require_known_interface() -> None:
    """Solve the problem with the known answer, once per process.

    Raises:
        SolverCrash: the library behaves otherwise than expected.
    """
    with interrupts_held_back():
        differences = _Probe().differences()
    if differences:
        raise SolverCrash(
            f"the solver fatrop in casadi {ca.CasadiMeta.version()} is not laid out as in casadi {TESTED}: "
            + ", ".join(differences)
        )


class _Probe:
    """The callbacks of the problem with the known answer, which count their calls."""

    def __init__(self) -> None:
        self._calls: Counter[str] = Counter()

    def differences(self) -> list[str]:
        """Return the differences from what is expected, in words; empty if there are none."""
        library, problem = fatrop(), interface(self._callbacks())
        OUTPUT.muted = True
        solver = library.fatrop_ocp_c_create(ctypes.byref(problem), OUTPUT.callback, None)
        try:
            dims = library.fatrop_ocp_c_get_dims(solver).contents
            sizes = (dims.K, dims.max_nu, dims.max_nx, dims.max_ng, dims.max_ngineq, dims.n_ineqs)
            if sizes != (2, 1, 1, 1, 1, 1):  # before pointers beside them are followed
                return [f"the sizes are read as {sizes}"]
            read = tuple(tuple(one[:2]) for one in (dims.nu, dims.nx, dims.ng, dims.ng_ineq))
            if read != (_N_U, _N_X, _EQUALITIES, _INEQUALITIES):
                return [f"the dimensions are read as {read}"]
            flag = library.fatrop_ocp_c_solve(solver)
            stats = library.fatrop_ocp_c_get_stats(solver).contents
            found = doubles_at(library.fatrop_ocp_c_get_primal(solver).contents.pa, len(_OPTIMUM)).copy()
        finally:
            library.fatrop_ocp_c_destroy(solver)
            OUTPUT.muted = False
        checks = {
            f"it answers {flag} and {stats.return_flag}": (flag, stats.return_flag) == (0, 0),
            f"the optimum is read as {found.tolist()}": bool(np.abs(found - _OPTIMUM).max() < _CLOSE),
            # casadi 3.8.2 leaves its counts of calls at zero; every iteration asks for the Hessian once.
            f"{stats.iterations_count} iterations are read": stats.iterations_count == self._calls["hessian"],
            "not all callbacks are called": set(self._calls) == set(_EVALUATIONS),
        }
        return [words for words, holds in checks.items() if not holds]

    def _callbacks(self) -> dict[str, Callback]:
        def bounds(lower: int, upper: int, k: int, _: object) -> int:
            doubles_at(lower, _INEQUALITIES[k])[:], doubles_at(upper, _INEQUALITIES[k])[:] = 0.0, 5.0
            return 0

        def initial_state(values: int, _k: int, _: object) -> int:
            doubles_at(values, 1)[:] = 0.3
            return 0

        def initial_control(values: int, k: int, _: object) -> int:
            doubles_at(values, _N_U[k])[:] = 0.3
            return 0

        def horizon(_: object) -> int:
            return 2

        return {
            "get_nx": number_of_stage(_N_X),
            "get_nu": number_of_stage(_N_U),
            "get_ng": number_of_stage(_EQUALITIES),
            "get_ng_ineq": number_of_stage(_INEQUALITIES),
            "get_horizon_length": horizon,
            "get_bounds": bounds,
            "get_initial_xk": initial_state,
            "get_initial_uk": initial_control,
            "full_eval_obj": self._counted("objective", self._objective),
            "full_eval_obj_grad": self._counted("gradient", self._gradient),
            "full_eval_contr_viol": self._counted("violation", self._violation),
            "full_eval_constr_jac": self._counted("jacobian", self._jacobian),
            "full_eval_lag_hess": self._counted("hessian", self._hessian),
        }

    def _counted(self, name: str, evaluate: Callable[..., None]) -> Callback:
        def callback(*arguments: float) -> int:
            self._calls[name] += 1
            evaluate(*arguments)
            return EVALUATED

        return callback

    def _objective(self, factor: float, unknowns: int, _p: int, _q: int, result: int, *_: int) -> None:
        u, _x_0, x_1 = doubles_at(unknowns, 3)
        doubles_at(result, 1)[0] = 0.5 * factor * (u**2 + x_1**2)

    def _gradient(self, factor: float, unknowns: int, _p: int, _q: int, result: int, *_: int) -> None:
        u, _x_0, x_1 = doubles_at(unknowns, 3)
        doubles_at(result, 3)[:] = factor * np.array([u, 0.0, x_1])

    def _violation(self, unknowns: int, _p: int, _q: int, result: int, *_: int) -> None:
        doubles_at(result, 3)[:] = self._residuals(unknowns)

    def _jacobian(
        self, unknowns: int, _p: int, _q: int, dynamics: int, equalities: int, inequalities: int, *_: int
    ) -> None:
        """Write the matrices of the constraints; their rows are (u, x), then the residual, see `stages.py`."""
        fixed, gap, bounded = self._residuals(unknowns)
        self._write(dynamics, 0, np.array([[1.0], [1.0], [gap]]))
        self._write(equalities, 0, np.array([[0.0], [1.0], [fixed]]))
        self._write(inequalities, 1, np.array([[1.0], [bounded]]))

    def _hessian(
        self, factor: float, unknowns: int, multipliers: int, _p: int, _q: int, matrices: int, *_: int
    ) -> None:
        u, _x_0, x_1 = doubles_at(unknowns, 3)
        fixed, gap, bounded = doubles_at(multipliers, 3)
        self._write(matrices, 0, np.array([[factor, 0.0], [0.0, 0.0], [factor * u + gap, gap + fixed]]))
        self._write(matrices, 1, np.array([[factor], [factor * x_1 + bounded]]))

    def _residuals(self, unknowns: int) -> tuple[float, float, float]:
        u, x_0, x_1 = doubles_at(unknowns, 3).tolist()
        return x_0 - 1.0, x_0 + u - x_1, x_1

    def _write(self, structs: int, k: int, matrix: Array) -> None:
        """Write a matrix where fatrop keeps that of stage k."""
        rows, columns = matrix.shape
        columnwise = np.asfortranarray(matrix)
        fatrop().blasfeo_pack_dmat(rows, columns, columnwise.ctypes.data, rows, structs + k * struct_size(), 0, 0)
