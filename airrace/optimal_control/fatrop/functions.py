"""The functions of the program, evaluated into arrays that stay where they are."""

import time
from collections.abc import Callable, Sequence

import casadi as ca
import numpy as np

from airrace.errors import SolverCrash
from airrace.optimal_control.transcription import NonlinearProgram
from airrace.trajectory import Array


class Functions:
    """The arguments and results of a program's functions; `seconds` adds up the time spent in them.

    Attributes:
        w, p: unknowns and parameters, set from outside.
        lam_f, lam_g: factor of the objective and multipliers of the constraints, set from outside.
        f, g: written by `values`.
        f_gradient: written by `objective_gradient`.
        jacobian: of g, nonzeros, written by `linearise`.
        gradient, hessian: of the Lagrangian, dense and nonzeros, written by `curve`.
    """

    def __init__(self, program: NonlinearProgram) -> None:
        nlp, jac_g, hess_l = program.nlp, program.jac_g, program.hess_l
        self.seconds = 0.0
        self.w, self.p = np.zeros(nlp.nnz_in(0)), np.zeros(nlp.nnz_in(1))
        self.lam_f, self.lam_g = np.ones(1), np.zeros(hess_l.nnz_in(3))
        self.f, self.g = np.zeros(1), np.zeros(nlp.nnz_out(1))
        self.f_gradient = np.zeros(len(self.w))
        self.jacobian = np.zeros(jac_g.nnz_out(1))
        self.gradient, self.hessian = np.zeros(len(self.w)), np.zeros(hess_l.nnz_out(1))
        point = (self.w, self.p)
        self._values = self._bound(nlp, point, (self.f, self.g))
        self.objective_gradient = self._bound(program.grad_f, point, (self.f_gradient,))
        # Its g is left alone: that one belongs to where `values` was last asked for.
        self.linearise = self._bound(jac_g, point, (None, self.jacobian))
        self.curve = self._bound(hess_l, (*point, self.lam_f, self.lam_g), (self.gradient, self.hessian))
        self._evaluated_at: Array | None = None

    def forget(self) -> None:
        """Forget what was evaluated, because parameters have changed."""
        self.seconds = 0.0
        self._evaluated_at = None

    def values(self) -> None:
        """Evaluate f and g, unless they are already those of the same unknowns.

        Raises:
            SolverCrash: they could not be evaluated.
        """
        if self._evaluated_at is None or not np.array_equal(self._evaluated_at, self.w):
            self._evaluated_at = None
            self._values()
            self._evaluated_at = self.w.copy()

    def _bound(
        self, function: ca.Function, arguments: Sequence[Array], results: Sequence[Array | None]
    ) -> Callable[[], None]:
        """Return the function with its arguments and results in these arrays; results without one are dropped."""
        buffer, evaluate = function.buffer()
        # casadi's stubs ask for the buffers' sizes, its code takes them from the buffers.
        for place, array in enumerate(arguments):
            buffer.set_arg(place, array.data)  # pyright: ignore[reportCallIssue]
        for place, array in enumerate(results):
            if array is None:
                continue
            if array.nbytes != 8 * function.nnz_out(place):
                raise SolverCrash(f"{function.name()}: result {place} has another size")
            buffer.set_res(place, array.data)  # pyright: ignore[reportCallIssue]

        def call() -> None:
            started = time.perf_counter()
            evaluate()
            self.seconds += time.perf_counter() - started
            if buffer.ret():
                raise SolverCrash(f"{function.name()} could not be evaluated")

        return call
