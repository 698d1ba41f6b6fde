"""The transcription by direct multiple shooting: from a problem to a nonlinear program with exact derivatives.

    minimise f(w; p)   subject to   lower <= w <= upper,   g_lower <= g(w; p) <= g_upper

The derivatives are put together here from those of the interval kernels, so the program is built in time linear in its
length and evaluated by a few mapped calls whatever the number of phases. Sparse constant matrices do the scattering: a
nonzero of the Jacobian (of the Hessian) is a weighted sum of kernel outputs, and the weights carry the scaling.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from airrace.optimal_control.final_cost import final_cost
from airrace.optimal_control.kernels import Kernel, Kernels, observation_kernel
from airrace.optimal_control.layout import Indices, Layout, Row, Sighting
from airrace.optimal_control.scatter import Scatter
from airrace.trajectory import Array

MAP_IN_THREADS = 64
"""The number of calls of a kernel from which they are spread over threads; twice as many if it has lanes.

Handing calls to two threads and collecting them takes 40 to 60 microseconds more than one thread needs for its loop,
a fifth of the 280 microseconds that 64 calls of the cheapest derivative take, the compiled Jacobian of a point mass's
step, or 128 intervals in lanes. For fewer calls little of the gain would be left.
"""


@dataclass(frozen=True)
class NonlinearProgram:
    """The casadi functions of the scaled unknowns x and parameters p, named as casadi's solvers name them.

    Attributes:
        nlp: (x, p) -> f, g.
        grad_f: (x, p) -> gradient of f.
        f_and_grad: (x, p) -> f, gradient of f.
        jac_g: (x, p) -> g, Jacobian of g.
        hess_l: (x, p, lam_f, lam_g) -> gradient of the Lagrangian, its Hessian (both triangles).
        hess_l_upper: (x, p, lam_f, lam_g) -> upper triangle of the Hessian.
        grad: (x, p, lam_f, lam_g) -> f, g, gradient of the Lagrangian in x; and in p, empty as nobody asks for it.
    """

    nlp: ca.Function
    grad_f: ca.Function
    f_and_grad: ca.Function
    jac_g: ca.Function
    hess_l: ca.Function
    hess_l_upper: ca.Function
    grad: ca.Function


@dataclass(frozen=True)
class _Calls:
    """All calls of one kernel.

    Attributes:
        kernel: what is called.
        inputs: places of y among the unknowns, shape (calls, n_y).
        own: `own` of every call, shape (n_own, calls).
        shared: `shared`, shape (n_shared,).
        rows: places of c among the constraints, the number of constraints where not constrained; shape (calls, n_c).
        weights: factors from c to the scaled constraints; shape (calls, n_c).
        jumps: what is taken off the unknowns before they become y, shape (n_y, calls); None for nothing.
    """

    kernel: Kernel
    inputs: Indices
    own: ca.MX
    shared: ca.MX
    rows: Indices
    weights: Array
    jumps: ca.MX | None = None


def transcribe(layout: Layout, kernels: Kernels, threads: int = 1) -> NonlinearProgram:
    """Build the nonlinear program of a problem's structure; parameters and bounds stay free."""
    return _Transcription(layout, kernels, threads).program()


def constraint_function(layout: Layout, kernels: Kernels) -> ca.Function:
    """Build the constraints alone, `(x, p) -> g`: a tenth of the work where no derivatives are asked for."""
    return _Transcription(layout, kernels, 1).constraint_function()


class _Transcription:
    """A builder that holds the symbols while the program's functions are built."""

    def __init__(self, layout: Layout, kernels: Kernels, threads: int) -> None:
        self.layout = layout
        self.threads = threads
        self.w = ca.MX.sym("w", layout.unknowns)
        self.p = ca.MX.sym("p", len(layout.parameter_values()))
        self.lam_f = ca.MX.sym("lam_f")
        self.lam_g = ca.MX.sym("lam_g", layout.constraints)
        self.unscaled = self.w * ca.DM(layout.scale)
        self.system_parameters = self.p[: len(layout.problem.parameters)]
        first = len(layout.problem.parameters)
        self.fractions = self.p[first : first + layout.intervals]
        final = len(layout.parameter_values()) - len(layout.problem.objective.values)
        self.final = final_cost(layout.problem, self.unscaled[layout.state_index[-1].tolist()], self.p[final:])
        self.calls = [self._steps(kernels.step), *self._path(kernels.path), *self._sightings()]

    def program(self) -> NonlinearProgram:
        w, p, lam_f, lam_g = self.w, self.p, self.lam_f, self.lam_g
        f, grad_f = self._objective()
        values = [self._evaluate(calls, _value)[0] for calls in self.calls]
        linear = [self._evaluate(calls, _jacobian) for calls in self.calls]
        curved = [self._evaluate(calls, _hessian, self._multipliers(calls)) for calls in self.calls]
        gradient = lam_f * grad_f + self._adjoint([gradient for gradient, _ in curved])
        arguments, inputs = [w, p, lam_f, lam_g], ["x", "p", "lam_f", "lam_g"]
        outputs = ["grad_gamma_x", "hess_gamma_x_x"]
        hessian = self._hessian([hessian for _, hessian in curved])
        g = self._constraints(values)
        g_and_jacobian = [self._constraints([value for value, _ in linear]), self._jacobian([j for _, j in linear])]
        return NonlinearProgram(
            nlp=ca.Function("nlp", [w, p], [f, g], ["x", "p"], ["f", "g"]),
            grad_f=ca.Function("nlp_grad_f", [w, p], [grad_f], ["x", "p"], ["grad_f_x"]),
            f_and_grad=ca.Function("nlp_grad_f", [w, p], [f, grad_f], ["x", "p"], ["f", "grad_f_x"]),
            jac_g=ca.Function("nlp_jac_g", [w, p], g_and_jacobian, ["x", "p"], ["g", "jac_g_x"]),
            hess_l=ca.Function("nlp_hess_l", arguments, [gradient, hessian], inputs, outputs),
            hess_l_upper=ca.Function("nlp_hess_l", arguments, [ca.triu(hessian)], inputs, outputs[1:]),
            grad=ca.Function("nlp_grad", arguments, [f, g, gradient, ca.MX(0, 1)]),
        )

    def constraint_function(self) -> ca.Function:
        values = [self._evaluate(calls, _value)[0] for calls in self.calls]
        return ca.Function("nlp_g", [self.w, self.p], [self._constraints(values)], ["x", "p"], ["g"])

    # the kernel calls

    def _steps(self, kernel: Kernel) -> _Calls:
        layout = self.layout
        rows = layout.gap_index[:, :-1]
        scale = np.array([quantity.scale for quantity in layout.problem.system.states])
        weights = np.broadcast_to(-1.0 / scale, rows.shape)
        return _Calls(kernel, layout.interval_index, self.fractions.T, self.system_parameters, rows, weights)

    def _path(self, kernel: Kernel | None) -> list[_Calls]:
        layout = self.layout
        if kernel is None:
            return []
        # The last node has no control of its own; no row there depends on it.
        controls = np.vstack([layout.control_index, layout.control_index[-1:]])
        inputs = np.hstack([layout.state_index, controls])
        rows, weights = self._rows(kernel, len(inputs), lambda row: row.node if row.source < 0 else None)
        return [_Calls(kernel, inputs, ca.MX(0, len(inputs)), self.system_parameters, rows, weights)]

    def _sightings(self) -> list[_Calls]:
        """Return the calls of the observations, those of one kind together."""
        groups: dict[int, list[int]] = {}
        for number, sighting in enumerate(self.layout.sightings):
            groups.setdefault(id(sighting.observation), []).append(number)
        return [self._observations(members) for members in groups.values()]

    def _observations(self, members: list[int]) -> _Calls:
        layout = self.layout
        sightings = [layout.sightings[number] for number in members]
        observation = sightings[0].observation
        call_of = {number: call for call, number in enumerate(members)}
        kernel = observation_kernel(observation, layout.n_x)
        inputs = layout.state_index[[sighting.node for sighting in sightings]]
        rows, weights = self._rows(kernel, len(members), lambda row: call_of.get(row.source))
        count, first = len(observation.parameters), len(layout.problem.parameters) + layout.intervals
        places = np.concatenate([first + sighting.offset + np.arange(count) for sighting in sightings])
        own = ca.reshape(self.p[places.tolist()], count, len(members))
        return _Calls(kernel, inputs, own, ca.MX(0, 1), rows, weights, self._unseen_jumps(sightings))

    def _unseen_jumps(self, sightings: Sequence[Sighting]) -> ca.MX | None:
        """Return the changes to be subtracted from the states at these nodes, shape (n_x, sightings).

        It is None if none of the nodes has a jump.
        """
        layout = self.layout
        if all(sighting.jump is None for sighting in sightings):
            return None
        padded = ca.vertcat(self.p, ca.MX.zeros(1))
        nothing = np.full(layout.n_x, len(layout.parameter_values()))
        places = [
            nothing if one.jump is None else layout.jump_offset + one.jump * layout.n_x + np.arange(layout.n_x)
            for one in sightings
        ]
        return ca.reshape(padded[np.concatenate(places).tolist()], layout.n_x, len(sightings))

    def _rows(self, kernel: Kernel, calls: int, call_of: Callable[[Row], int | None]) -> tuple[Indices, Array]:
        """Return the places and weights of the outputs that are constrained."""
        rows = np.full((calls, kernel.value.size1_out(0)), self.layout.constraints)
        weights = np.zeros(rows.shape)
        for row, place in zip(self.layout.flat_rows, self.layout.row_index, strict=True):
            call = call_of(row)
            if call is not None:
                rows[call, row.component] = place
                weights[call, row.component] = 1.0 / row.quantity.scale
        return rows, weights

    def _evaluate(self, calls: _Calls, of: Callable[[Kernel], ca.Function], *multipliers: ca.MX) -> list[ca.MX]:
        """Return the outputs of a kernel function over all its calls, as columns of nonzeros.

        Several calls are made at once where the kernel has lanes for them. Lanes that are left over repeat the last
        call, so that they hold nothing that could not be evaluated.
        """
        kernel = calls.kernel
        count, n_y = calls.inputs.shape
        y = ca.reshape(self.unscaled[calls.inputs.ravel().tolist()], n_y, count)
        if calls.jumps is not None:
            y -= calls.jumps
        function = of(kernel if kernel.several is None else kernel.several)
        batches = -(-count // kernel.lanes)
        filling = batches * kernel.lanes - count
        y, own, *given = (_filled(one, filling) for one in (y, calls.own, *multipliers))
        enough = MAP_IN_THREADS if kernel.lanes == 1 else 2 * MAP_IN_THREADS
        how = "thread" if self.threads > 1 and count >= enough else "serial"
        mapped = function.map(batches, how, self.threads) if how == "thread" else function.map(batches)
        outputs = mapped(y, own, ca.repmat(calls.shared, 1, batches), *given)
        # the nonzeros of a row come as a row
        columns = [ca.vec(one.nz[:]) for one in (outputs if isinstance(outputs, tuple) else (outputs,))]
        return [column[: column.numel() // (count + filling) * count] if filling else column for column in columns]

    def _multipliers(self, calls: _Calls) -> ca.MX:
        """Return the multipliers of the kernel's outputs in SI, shape (n_c, calls); zero where not constrained."""
        padded = ca.densify(ca.vertcat(self.lam_g, ca.MX.zeros(1)))
        picked = padded[calls.rows.ravel().tolist()] * ca.DM(calls.weights.ravel())
        return ca.reshape(picked, calls.rows.shape[1], calls.rows.shape[0])

    # the program's functions

    def _objective(self) -> tuple[ca.MX, ca.MX]:
        """Return f and its gradient.

        The regularisation is `sum_k T_k fraction_k sum_j weight_j w_kj^2` in scaled controls.
        """
        layout, objective = self.layout, self.layout.problem.objective
        linear = np.zeros(layout.unknowns)
        linear[layout.duration_index[layout.first_node[:-1]]] = objective.time
        for component, quantity in enumerate(layout.problem.system.states):
            linear[layout.state_index[-1, component]] += objective.terminal.get(quantity.name, 0.0)
        linear *= layout.scale
        f, gradient = ca.dot(ca.DM(linear), self.w), ca.MX(ca.DM(linear))
        if self.final is not None:
            f += self.final.value()
            gradient += ca.densify(self._at_the_end(self.final.gradient()))
        weights = self._regularisation_weights()
        if weights.any():
            penalty = self._penalty(weights)
            f += penalty
            gradient += ca.gradient(penalty, self.w)
        return f, gradient

    def _at_the_end(self, gradient: ca.MX) -> ca.MX:
        """Return a gradient in the final state, shape (n_x,), as one in the unknowns, shape (n_w,)."""
        places = self.layout.state_index[-1]
        column = Scatter(self.layout.unknowns, 1)
        column.draw_from(gradient)
        column.add(places, np.zeros_like(places), self.layout.scale[places], np.arange(len(places)))
        return column.matrix()

    def _regularisation_weights(self) -> Array:
        objective = self.layout.problem.objective
        return np.array([objective.regularisation.get(one.name, 0.0) for one in self.layout.problem.system.controls])

    def _penalty(self, weights: Array) -> ca.MX:
        layout = self.layout
        controls = ca.reshape(self.w[layout.control_index.ravel().tolist()], layout.n_u, layout.intervals)
        durations = self.unscaled[layout.duration_index[:-1].tolist()]
        return ca.dot(ca.mtimes(ca.DM(weights).T, controls**2).T, durations * self.fractions)

    def _constraints(self, values: list[ca.MX]) -> ca.MX:
        """Return g: the gaps `x_next - F(x, u, T)` and `T_next - T`, the rows of path and boundaries.

        The gap at the end of a phase is bounded to that phase's jump, all others to zero.
        """
        layout = self.layout
        g = Scatter(layout.constraints, 1)
        for calls, value in zip(self.calls, values, strict=True):
            g.draw_from(value)
            rows, weights = calls.rows.ravel(), calls.weights.ravel()
            used = np.flatnonzero(rows < layout.constraints)
            g.add(rows[used], np.zeros_like(used), weights[used], used)
        g.draw_from(self.w)
        for gap, unknown, sign in self._linear_gaps():
            g.add(gap, np.zeros_like(gap), np.full(len(gap), sign), unknown)
        return ca.densify(g.matrix())

    def _linear_gaps(self) -> list[tuple[Indices, Indices, float]]:
        """Return the linear part of the gaps: (rows, unknowns, sign), all in scaled units."""
        layout = self.layout
        duration_gap = layout.gap_index[:, -1]
        return [
            (layout.gap_index[:, :-1].ravel(), layout.state_index[1:].ravel(), 1.0),
            (duration_gap, layout.duration_index[1:], 1.0),
            (duration_gap, layout.duration_source, -1.0),
        ]

    def _jacobian(self, jacobians: list[ca.MX]) -> ca.MX:
        layout = self.layout
        matrix = Scatter(layout.constraints, layout.unknowns)
        for calls, nonzeros in zip(self.calls, jacobians, strict=True):
            matrix.draw_from(nonzeros)
            component, of = _pattern(calls.kernel.jacobian.sparsity_out(1))
            rows, columns = calls.rows[:, component].ravel(), calls.inputs[:, of].ravel()
            weights = calls.weights[:, component].ravel() * layout.scale[columns]
            used = np.flatnonzero(rows < layout.constraints)
            matrix.add(rows[used], columns[used], weights[used], used)
        matrix.draw_from(ca.MX(1.0))
        for gap, unknown, sign in self._linear_gaps():
            matrix.add(gap, unknown, np.full(len(gap), sign), np.zeros_like(gap))
        return matrix.matrix()

    def _adjoint(self, gradients: list[ca.MX]) -> ca.MX:
        """Return the Jacobian of g transposed times lam_g, from the kernels' gradients."""
        layout = self.layout
        adjoint = Scatter(layout.unknowns, 1)
        for calls, gradient in zip(self.calls, gradients, strict=True):
            adjoint.draw_from(gradient)
            places = calls.inputs.ravel()
            adjoint.add(places, np.zeros_like(places), layout.scale[places], np.arange(len(places)))
        adjoint.draw_from(self.lam_g)
        for gap, unknown, sign in self._linear_gaps():
            adjoint.add(unknown, np.zeros_like(unknown), np.full(len(gap), sign), gap)
        return ca.densify(adjoint.matrix())

    def _hessian(self, hessians: list[ca.MX]) -> ca.MX:
        layout = self.layout
        matrix = Scatter(layout.unknowns, layout.unknowns, symmetric=True)
        for calls, nonzeros in zip(self.calls, hessians, strict=True):
            matrix.draw_from(nonzeros)
            row, column = _pattern(calls.kernel.hessian.sparsity_out(1))
            rows, columns = calls.inputs[:, row].ravel(), calls.inputs[:, column].ravel()
            # what the last node's path would say of the control before it is zero: no row there depends on that
            within = np.flatnonzero(layout.stage_of_unknown[rows] == layout.stage_of_unknown[columns])
            rows, columns = rows[within], columns[within]
            matrix.add(rows, columns, layout.scale[rows] * layout.scale[columns], within)
        if self.final is not None:
            curvature = self.final.hessian(self.lam_f)
            row, column = _pattern(curvature.sparsity())
            rows, columns = layout.state_index[-1][row], layout.state_index[-1][column]
            matrix.draw_from(ca.vec(curvature.nz[:]))
            matrix.add(rows, columns, layout.scale[rows] * layout.scale[columns], np.arange(len(rows)))
        weights = self._regularisation_weights()
        if weights.any():
            self._penalty_hessian(matrix, weights)
        return matrix.matrix()

    def _penalty_hessian(self, matrix: Scatter, weights: Array) -> None:
        """Add the second derivatives of `T fraction weight w^2`: in w w and in w T."""
        layout = self.layout
        places = layout.control_index.ravel()
        factor = 2.0 * np.tile(weights, layout.intervals)
        interval = np.repeat(np.arange(layout.intervals), layout.n_u)
        durations = layout.duration_index[:-1][interval]
        share = self.lam_f * self.fractions[interval.tolist()]
        everywhere = np.arange(len(places))
        matrix.draw_from(share * self.unscaled[durations.tolist()])
        matrix.add(places, places, factor, everywhere)
        matrix.draw_from(share * self.w[places.tolist()])
        matrix.add(places, durations, factor * layout.scale[durations], everywhere)


def _value(kernel: Kernel) -> ca.Function:
    return kernel.value


def _jacobian(kernel: Kernel) -> ca.Function:
    return kernel.jacobian


def _hessian(kernel: Kernel) -> ca.Function:
    return kernel.hessian


def _filled(columns: ca.MX, filling: int) -> ca.MX:
    """Return the columns, followed by so many copies of the last one."""
    return ca.horzcat(columns, ca.repmat(columns[:, -1], 1, filling)) if filling else columns


def _pattern(sparsity: ca.Sparsity) -> tuple[Indices, Indices]:
    """Return the rows and columns of the nonzeros in casadi's order."""
    rows, columns = sparsity.get_triplet()
    return np.array(rows, dtype=np.int64), np.array(columns, dtype=np.int64)
