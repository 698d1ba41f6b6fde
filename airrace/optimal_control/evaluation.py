"""The evaluation of a nonlinear program with numpy, into arrays that stay where they are.

Each kernel is called for all intervals at once; constraints and derivatives are sums of what the kernels return, see
`assembly.py`.
"""

import time
from collections.abc import Generator
from contextlib import contextmanager
from functools import cached_property

import numpy as np

from airrace.optimal_control.assembly import Assembly, Calls, EndCost, Penalty, StageMatrices
from airrace.optimal_control.kernels import BoundCall, Part, bind
from airrace.optimal_control.trajectory import Array


class Evaluation:
    """The functions of a program at a point; `seconds` adds up the time spent in them.

    All methods that evaluate raise SolverCrash where a kernel reports a failure.

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
        self._calls = [_KernelEvaluation(calls, threads) for calls in assembly.calls]
        self._end_costs = [_EndCostEvaluation(cost) for cost in assembly.end_costs]
        self._evaluated_at: Array | None = None
        self._curved_at: tuple[float, Array] | None = None
        self._curved: list[Array] = []

    @cached_property
    def stage_matrices(self) -> StageMatrices:
        """The matrices of the program's stages, to be written."""
        return StageMatrices(self.assembly)

    def forget(self) -> None:
        """Forget what was evaluated, because parameters have changed."""
        self.seconds = 0.0
        self._evaluated_at = self._curved_at = None
        padded = np.append(self.p, 0.0)
        for calls in self._calls:
            calls.take_parameters(padded)
        for end in self._end_costs:
            end.own[:] = padded[end.cost.own]

    @contextmanager
    def _clock(self) -> Generator[None]:
        started = time.perf_counter()
        yield
        self.seconds += time.perf_counter() - started

    def at(self, w: Array, p: Array) -> None:
        """Evaluate the objective and the constraints at a point, unless they are already those of it."""
        unchanged = (
            self._evaluated_at is not None and np.array_equal(self._evaluated_at, w) and np.array_equal(self.p, p)
        )
        self.w[:], self.p[:] = w, p
        if not unchanged:
            self.forget()
            self.values()

    def values(self) -> None:
        """Evaluate f and g, unless they are already those of the same unknowns."""
        if self._evaluated_at is not None and np.array_equal(self._evaluated_at, self.w):
            return
        with self._clock():
            self._evaluated_at = None
            unscaled = self._unscale()
            self.f = self._objective(unscaled)
            values = np.concatenate([*(calls.call(Part.VALUES, unscaled)[0] for calls in self._calls), self.w])
            self.g[:] = self.assembly.constraints.column(values)
            self._evaluated_at = self.w.copy()

    def objective_gradient(self) -> None:
        """Evaluate the gradient of the objective."""
        self.f_gradient[:] = self._objective_gradient(self._unscale())

    def jacobian_sources(self) -> Array:
        """Evaluate the Jacobians of all kernels, and return the sources of the constraints' Jacobian."""
        with self._clock():
            unscaled = self._unscale()
            return np.concatenate([*(calls.call(Part.JACOBIAN, unscaled)[1] for calls in self._calls), [1.0]])

    def linearise(self) -> None:
        """Evaluate the Jacobian of the constraints."""
        self.jacobian = self.assembly.jacobian.of(self.jacobian_sources())

    def slope(self) -> None:
        """Evaluate the gradient of the Lagrangian."""
        self._hessian_blocks(self._unscale())

    def curve(self) -> None:
        """Evaluate the gradient of the Lagrangian and its Hessian."""
        self.hessian = self.assembly.hessian.of(self.hessian_sources())

    def hessian_sources(self) -> Array:
        """Evaluate the gradient of the Lagrangian, and return the sources of its Hessian."""
        with self._clock():
            unscaled = self._unscale()
            blocks = self._hessian_blocks(unscaled)
            blocks += [end.derivatives(unscaled, self.lam_f)[1] for end in self._end_costs]
            if (penalty := self.assembly.penalty) is not None:
                share = (self.lam_f * self.p[penalty.fractions])[:, None]
                durations = np.broadcast_to(unscaled[penalty.durations][:, None], penalty.places.shape)
                blocks += [(share * durations).ravel(), (share * self.w[penalty.places]).ravel()]
            return np.concatenate(blocks)

    def _hessian_blocks(self, unscaled: Array) -> list[Array]:
        """Evaluate the gradient of the Lagrangian, and return the nonzeros of the kernels' Hessians, unless they are
        already those of the same unknowns and multipliers."""
        multipliers, at = np.append(self.lam_g, 0.0), np.concatenate([self.w, self.lam_g])
        last = self._curved_at
        if last is not None and last[0] == self.lam_f and np.array_equal(last[1], at):
            return list(self._curved)
        self._curved_at = None
        curved = [calls.hessians(unscaled, multipliers) for calls in self._calls]
        adjoint = self.assembly.adjoint.column(np.concatenate([*(gradient for gradient, _ in curved), self.lam_g]))
        self.gradient[:] = self.lam_f * self._objective_gradient(unscaled) + adjoint
        self._curved, self._curved_at = [nonzeros for _, nonzeros in curved], (self.lam_f, at)
        return list(self._curved)

    def _unscale(self) -> Array:
        return self.w * self.assembly.layout.scale

    def _objective(self, unscaled: Array) -> float:
        f = _sum(self.assembly.linear * self.w)
        for end in self._end_costs:
            f += end.value(unscaled)
        if (penalty := self.assembly.penalty) is not None:
            weighted = _weighted_sums(penalty.weights, self.w[penalty.places] ** 2)
            f += _sum(weighted * self._interval_durations(penalty, unscaled))
        return f

    def _objective_gradient(self, unscaled: Array) -> Array:
        gradient, scale = self.assembly.linear.copy(), self.assembly.layout.scale
        for end in self._end_costs:
            places = end.cost.inputs
            gradient[places] += end.derivatives(unscaled, 1.0)[0] * scale[places]
        if (penalty := self.assembly.penalty) is not None:
            values = self.w[penalty.places]
            durations = self._interval_durations(penalty, unscaled)[:, None]
            gradient[penalty.places] += 2.0 * values * (penalty.weights * durations)
            weighted = _weighted_sums(penalty.weights, values**2)
            gradient[penalty.durations] += scale[penalty.durations] * (weighted * self.p[penalty.fractions])
        return gradient

    def _interval_durations(self, penalty: Penalty, unscaled: Array) -> Array:
        return unscaled[penalty.durations] * self.p[penalty.fractions]


class _KernelEvaluation:
    """All calls of one kernel, lanes that are left over included, with arguments and results in arrays that stay."""

    def __init__(self, calls: Calls, threads: int) -> None:
        lanes = calls.of_lane
        self._calls, self._threads = calls, threads
        self._inputs, self._own, self._rows = calls.inputs[lanes], calls.own[lanes], calls.rows[lanes]
        self._weights: Array = np.ascontiguousarray(calls.weights[lanes])
        self._jumps = None if calls.jumps is None else calls.jumps[lanes]
        self._y, self._multipliers = np.zeros(self._inputs.shape), np.zeros(self._rows.shape)
        self._arguments = self._y, np.zeros(self._own.shape), np.zeros((calls.batches, len(calls.shared)))
        self._offsets: Array | None = None
        self._functions: dict[Part, BoundCall] = {}
        self._complete_at: Array | None = None  # where the Hessian's results are followed by values and Jacobian

    def take_parameters(self, padded: Array) -> None:
        """Take what belongs to the calls out of (p, 0)."""
        _, own, shared = self._arguments
        own[:] = padded[self._own]
        shared[:] = padded[self._calls.shared]
        self._complete_at = None
        self._offsets = None if self._jumps is None else padded[self._jumps]

    def hessians(self, unscaled: Array, multipliers: Array) -> tuple[Array, Array]:
        """Return the gradients, and the nonzeros of the Hessians, for the multipliers of all constraints and a zero."""
        np.take(multipliers, self._rows, out=self._multipliers, mode="clip")
        self._multipliers *= self._weights
        self._complete_at = None
        gradient, hessian, *linear = self.call(Part.HESSIAN, unscaled)
        self._complete_at = self._y.copy() if linear else None
        return gradient, hessian

    def call(self, part: Part, unscaled: Array) -> list[Array]:
        """Return all results of one of the kernel's functions."""
        np.take(unscaled, self._inputs, out=self._y, mode="clip")  # which, unlike the default, needs no copy
        if self._offsets is not None:
            self._y -= self._offsets
        if part is not Part.HESSIAN and self._complete_at is not None and np.array_equal(self._y, self._complete_at):
            return self._functions[Part.HESSIAN][1][2:]
        if part not in self._functions:
            arguments = (*self._arguments, self._multipliers) if part is Part.HESSIAN else self._arguments
            kernel, counting = self._calls.kernel, len(self._calls.inputs)
            self._functions[part] = kernel.bind(part, self._calls.batches, self._threads, arguments, counting)
        call, results = self._functions[part]
        call()
        return results


class _EndCostEvaluation:
    """The cost of the state at one end and its derivatives."""

    def __init__(self, cost: EndCost) -> None:
        self.cost, self.own = cost, np.zeros(len(cost.own))
        self._y, self._weights = np.zeros(len(cost.inputs)), np.zeros(len(cost.weights))
        arguments = self._y, self.own, np.zeros(0)
        self._value = bind(cost.kernel.value, arguments)
        self._derivatives = bind(cost.kernel.hessian, (*arguments, self._weights))

    def value(self, unscaled: Array) -> float:
        """Return the cost."""
        call, (outputs,) = self._value
        self._y[:] = unscaled[self.cost.inputs]
        call()
        return _sum(self.cost.weights * outputs)

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


def _weighted_sums(weights: Array, values: Array) -> Array:
    """Return the sums of the columns of values times their weights, added up one after the other."""
    total = np.zeros(len(values))
    for weight, column in zip(weights.tolist(), values.T, strict=True):
        total += weight * column
    return total
