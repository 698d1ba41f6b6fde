"""The evaluation of a nonlinear program with numpy, into arrays that stay where they are.

Each kernel is called for all intervals at once; constraints and derivatives are sums of what the kernels return, see
`assembly.py`.
"""

import time

import numpy as np

from airrace.optimal_control.assembly import Assembly, Calls, FinalCost, Penalty
from airrace.optimal_control.kernels import BoundCall, Part, bind
from airrace.optimal_control.layout import Indices
from airrace.trajectory import Array


class Evaluation:
    """The functions of a program at a point; `seconds` adds up the time spent in them.

    Attributes:
        assembly: of the program.
        threads: number of threads that the calls of a kernel are spread over.
        w, p: unknowns and parameters, set from outside; `forget` after a change of p.
        lam_f, lam_g: factor of the objective and multipliers of the constraints, set from outside.
        f, g: written by `values`.
        f_gradient: written by `objective_gradient`.
        jacobian: of g, nonzeros, written by `linearise`.
        gradient, hessian: of the Lagrangian, dense and nonzeros, written by `curve`.
    """

    def __init__(self, assembly: Assembly, threads: int = 1) -> None:
        self.assembly = assembly
        self.threads = threads
        layout = assembly.layout
        self.seconds = 0.0
        self.w, self.p = np.zeros(layout.unknowns), np.zeros(len(layout.parameter_values()))
        self.lam_f, self.lam_g = 1.0, np.zeros(layout.constraints)
        self.f, self.g = 0.0, np.zeros(layout.constraints)
        self.f_gradient = np.zeros(layout.unknowns)
        self.jacobian = np.zeros(0)
        self.gradient, self.hessian = np.zeros(layout.unknowns), np.zeros(0)
        self._calls = [_Evaluated(calls, threads) for calls in assembly.calls]
        self._final = None if assembly.final is None else _EvaluatedFinal(assembly.final)
        self._evaluated_at: Array | None = None

    def forget(self) -> None:
        """Forget what was evaluated, because parameters have changed."""
        self.seconds = 0.0
        self._evaluated_at = None
        padded = np.append(self.p, 0.0)
        for calls in self._calls:
            calls.take_parameters(padded)
        if self._final is not None:
            self._final.take_parameters(padded)

    def at(self, w: Array, p: Array) -> None:
        """Evaluate the objective and the constraints at a point.

        Raises:
            SolverCrash: they could not be evaluated.
        """
        self.w[:], self.p[:] = w, p
        self.forget()
        self.values()

    def values(self) -> None:
        """Evaluate f and g, unless they are already those of the same unknowns.

        Raises:
            SolverCrash: they could not be evaluated.
        """
        if self._evaluated_at is not None and np.array_equal(self._evaluated_at, self.w):
            return
        started = time.perf_counter()
        self._evaluated_at = None
        unscaled = self._unscaled()
        self.f = self._objective(unscaled)
        drawn = np.concatenate([*(calls.values(unscaled) for calls in self._calls), self.w])
        self.g[:] = self.assembly.constraints.column(drawn)
        self._evaluated_at = self.w.copy()
        self.seconds += time.perf_counter() - started

    def objective_gradient(self) -> None:
        """Evaluate the gradient of the objective."""
        self.f_gradient[:] = self._objective_gradient(self._unscaled())

    def linear(self) -> Array:
        """Evaluate the Jacobians of all kernels, and return what the constraints' Jacobian is drawn from.

        Raises:
            SolverCrash: they could not be evaluated.
        """
        started = time.perf_counter()
        unscaled = self._unscaled()
        drawn = np.concatenate([*(calls.jacobians(unscaled) for calls in self._calls), [1.0]])
        self.seconds += time.perf_counter() - started
        return drawn

    def linearise(self) -> None:
        """Evaluate the Jacobian of the constraints.

        Raises:
            SolverCrash: it could not be evaluated.
        """
        self.jacobian = self.assembly.jacobian.of(self.linear())

    def slope(self) -> None:
        """Evaluate the gradient of the Lagrangian.

        Raises:
            SolverCrash: it could not be evaluated.
        """
        self._curved()

    def curve(self) -> None:
        """Evaluate the gradient of the Lagrangian and its Hessian.

        Raises:
            SolverCrash: they could not be evaluated.
        """
        self.hessian = self.assembly.hessian.of(self.curved())

    def curved(self) -> Array:
        """Evaluate the gradient of the Lagrangian, and return what its Hessian is drawn from.

        Raises:
            SolverCrash: they could not be evaluated.
        """
        started = time.perf_counter()
        unscaled, blocks = self._curved()
        if self._final is not None:
            blocks.append(self._final.derivatives(unscaled, self.lam_f)[1])
        if self.assembly.penalty is not None:
            blocks += self._penalty_curvature(self.assembly.penalty, unscaled)
        drawn = np.concatenate(blocks)
        self.seconds += time.perf_counter() - started
        return drawn

    def _curved(self) -> tuple[Array, list[Array]]:
        """Evaluate the gradient of the Lagrangian.

        Returns:
            The unknowns in SI, and the nonzeros of the kernels' Hessians.
        """
        unscaled, multipliers = self._unscaled(), np.append(self.lam_g, 0.0)
        curved = [calls.hessians(unscaled, multipliers) for calls in self._calls]
        adjoint = self.assembly.adjoint.column(np.concatenate([*(gradient for gradient, _ in curved), self.lam_g]))
        self.gradient[:] = self.lam_f * self._objective_gradient(unscaled) + adjoint
        return unscaled, [nonzeros for _, nonzeros in curved]

    def _unscaled(self) -> Array:
        return self.w * self.assembly.layout.scale

    def _objective(self, unscaled: Array) -> float:
        f = _sum(self.assembly.linear * self.w)
        if self._final is not None:
            f += self._final.value(unscaled)
        if self.assembly.penalty is not None:
            penalty = self.assembly.penalty
            moved = _weighed(penalty.weights, self.w[penalty.controls] ** 2)
            f += _sum(moved * self._shares(penalty, unscaled))
        return f

    def _objective_gradient(self, unscaled: Array) -> Array:
        gradient, scale = self.assembly.linear.copy(), self.assembly.layout.scale
        if self._final is not None:
            places = self._final.cost.inputs
            gradient[places] += self._final.derivatives(unscaled, 1.0)[0] * scale[places]
        if self.assembly.penalty is not None:
            penalty = self.assembly.penalty
            controls = self.w[penalty.controls]
            shares = self._shares(penalty, unscaled)[:, None]
            gradient[penalty.controls] += 2.0 * controls * (penalty.weights * shares)
            moved = _weighed(penalty.weights, controls**2)
            gradient[penalty.durations] += scale[penalty.durations] * (moved * self.p[penalty.fractions])
        return gradient

    def _shares(self, penalty: Penalty, unscaled: Array) -> Array:
        """Return the durations of all intervals, s."""
        return unscaled[penalty.durations] * self.p[penalty.fractions]

    def _penalty_curvature(self, penalty: Penalty, unscaled: Array) -> list[Array]:
        """Return what the penalty's second derivatives in w w and in w T are drawn from."""
        share = (self.lam_f * self.p[penalty.fractions])[:, None]
        durations = np.broadcast_to(unscaled[penalty.durations][:, None], penalty.controls.shape)
        return [(share * durations).ravel(), (share * self.w[penalty.controls]).ravel()]


class _Evaluated:
    """All calls of one kernel, with arguments and results in arrays that stay."""

    def __init__(self, calls: Calls, threads: int) -> None:
        self._calls = calls
        self._inputs: Indices = calls.inputs[calls.filled]
        self._own: Indices = calls.own[calls.filled]
        self._rows: Indices = calls.rows[calls.filled]
        self._weights: Array = np.ascontiguousarray(calls.weights[calls.filled])
        self._jumps = None if calls.jumps is None else calls.jumps[calls.filled]
        self._y, self._multipliers = np.zeros(self._inputs.shape), np.zeros(self._rows.shape)
        self._given = self._y, np.zeros(self._own.shape), np.zeros((calls.batches, len(calls.shared)))
        self._taken_off: Array | None = None
        self._threads = threads
        self._functions: dict[Part, BoundCall] = {}

    def take_parameters(self, padded: Array) -> None:
        """Take what belongs to the calls out of (p, 0)."""
        _, own, shared = self._given
        own[:] = padded[self._own]
        shared[:] = padded[self._calls.shared]
        self._taken_off = None if self._jumps is None else padded[self._jumps]

    def values(self, unscaled: Array) -> Array:
        """Return the values, lanes that are left over included."""
        (values,) = self._called(Part.VALUES, unscaled)
        return values

    def jacobians(self, unscaled: Array) -> Array:
        """Return the nonzeros of the Jacobians."""
        return self._called(Part.JACOBIAN, unscaled)[1]

    def hessians(self, unscaled: Array, multipliers: Array) -> tuple[Array, Array]:
        """Return the gradients, and the nonzeros of the Hessians, for the multipliers of all constraints and a zero."""
        np.take(multipliers, self._rows, out=self._multipliers, mode="clip")
        self._multipliers *= self._weights
        gradient, hessian = self._called(Part.HESSIAN, unscaled)
        return gradient, hessian

    def _called(self, part: Part, unscaled: Array) -> list[Array]:
        np.take(unscaled, self._inputs, out=self._y, mode="clip")  # which, unlike the default, needs no copy
        if self._taken_off is not None:
            self._y -= self._taken_off
        if part not in self._functions:
            given = (*self._given, self._multipliers) if part is Part.HESSIAN else self._given
            self._functions[part] = self._calls.kernel.bind(part, self._calls.batches, self._threads, given)
        call, results = self._functions[part]
        call()
        return results


class _EvaluatedFinal:
    """The cost of the final state and its derivatives."""

    def __init__(self, cost: FinalCost) -> None:
        self.cost = cost
        self._y, self._own = np.zeros(len(cost.inputs)), np.zeros(len(cost.own))
        self._weights = np.zeros(len(cost.weights))
        nothing = np.zeros(0)
        self._value = bind(cost.kernel.value, (self._y, self._own, nothing))
        self._derivatives = bind(cost.kernel.hessian, (self._y, self._own, nothing, self._weights))

    def take_parameters(self, padded: Array) -> None:
        self._own[:] = padded[self.cost.own]

    def value(self, unscaled: Array) -> float:
        """Return the cost."""
        call, (seen,) = self._value
        self._y[:] = unscaled[self.cost.inputs]
        call()
        return _sum(self.cost.weights * seen)

    def derivatives(self, unscaled: Array, factor: float) -> list[Array]:
        """Return the gradient of the cost times a factor in y, and the nonzeros of its Hessian's upper triangle."""
        call, results = self._derivatives
        self._y[:] = unscaled[self.cost.inputs]
        self._weights[:] = factor * self.cost.weights
        call()
        return results


def _sum(values: Array) -> float:
    """Return the sum, added up from the first to the last: a solver's line search compares sums of neighbours."""
    return float(np.add.accumulate(values)[-1]) if len(values) else 0.0


def _weighed(weights: Array, values: Array) -> Array:
    """Return the sums of the columns of values times their weights, added up one after the other."""
    total = np.zeros(len(values))
    for weight, column in zip(weights.tolist(), values.T, strict=True):
        total += weight * column
    return total
