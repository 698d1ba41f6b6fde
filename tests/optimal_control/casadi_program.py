"""The nonlinear program of a problem as casadi's own functions, and fatrop through casadi's interface.

The package evaluates programs without either; here both are what it is held against.
"""

import casadi as ca
import numpy as np

from airrace.optimal_control.assembly import Assembly, Calls, FinalCost, Penalty
from airrace.optimal_control.constraint_rows import Indices
from airrace.optimal_control.evaluation import Evaluation
from airrace.optimal_control.kernels import Kernel, Kernels, Part, map_calls
from airrace.optimal_control.layout import Layout
from airrace.optimal_control.solvers.interface import Bounds, Ending, Multipliers, Solver, SolverOptions, SolverResult
from airrace.optimal_control.solvers.solver import SOLVERS, fatrop_options
from airrace.optimal_control.sparse_assembly import SparseAssembly
from airrace.records import record

_NOTHING = ca.MX(0, 1)  # an observation shares nothing between its calls


@record
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


def transcribe(layout: Layout, kernels: Kernels, threads: int = 1) -> NonlinearProgram:
    """Build the nonlinear program of a problem's structure; parameters and bounds stay free."""
    return transcribed(Assembly(layout, kernels), threads)


def transcribed(assembly: Assembly, threads: int = 1) -> NonlinearProgram:
    """Build the nonlinear program of an assembly."""
    return _Transcription(assembly, threads).program()


class _Transcription:
    """A builder that holds the symbols while the program's functions are built."""

    def __init__(self, assembly: Assembly, threads: int) -> None:
        layout = assembly.layout
        self.assembly = assembly
        self.threads = threads
        self.w = ca.MX.sym("w", layout.unknowns)
        self.p = ca.MX.sym("p", len(layout.parameter_values()))
        self.lam_f = ca.MX.sym("lam_f")
        self.lam_g = ca.MX.sym("lam_g", layout.constraints)
        self.unscaled = self.w * ca.DM(layout.scale)
        self.padded = ca.vertcat(self.p, ca.MX.zeros(1))

    def program(self) -> NonlinearProgram:
        w, p, lam_f, lam_g = self.w, self.p, self.lam_f, self.lam_g
        f, grad_f = self._objective()
        g = self._constraints([self._evaluate(calls, Part.VALUES)[0] for calls in self.assembly.calls])
        linear = [self._evaluate(calls, Part.JACOBIAN) for calls in self.assembly.calls]
        curved = [self._evaluate(calls, Part.HESSIAN, self._multipliers(calls)) for calls in self.assembly.calls]
        jacobian = _expression(self.assembly.jacobian, ca.vertcat(*(nonzeros for _, nonzeros in linear), 1.0))
        adjoint = _expression(self.assembly.adjoint, ca.vertcat(*(gradient for gradient, _ in curved), lam_g))
        gradient = lam_f * grad_f + ca.densify(adjoint)
        hessian = self._hessian([nonzeros for _, nonzeros in curved])
        arguments, inputs = [w, p, lam_f, lam_g], ["x", "p", "lam_f", "lam_g"]
        outputs = ["grad_gamma_x", "hess_gamma_x_x"]
        g_and_jacobian = [self._constraints([value for value, _ in linear]), jacobian]
        return NonlinearProgram(
            nlp=ca.Function("nlp", [w, p], [f, g], ["x", "p"], ["f", "g"]),
            grad_f=ca.Function("nlp_grad_f", [w, p], [grad_f], ["x", "p"], ["grad_f_x"]),
            f_and_grad=ca.Function("nlp_grad_f", [w, p], [f, grad_f], ["x", "p"], ["f", "grad_f_x"]),
            jac_g=ca.Function("nlp_jac_g", [w, p], g_and_jacobian, ["x", "p"], ["g", "jac_g_x"]),
            hess_l=ca.Function("nlp_hess_l", arguments, [gradient, hessian], inputs, outputs),
            hess_l_upper=ca.Function("nlp_hess_l", arguments, [ca.triu(hessian)], inputs, outputs[1:]),
            grad=ca.Function("nlp_grad", arguments, [f, g, gradient, ca.MX(0, 1)]),
        )

    # the kernel calls

    def _evaluate(self, calls: Calls, part: Part, *multipliers: ca.MX) -> list[ca.MX]:
        """Return the outputs of a kernel function over all its calls, lanes included, as columns of nonzeros."""
        y = _drawn(self.unscaled, calls.inputs[calls.of_lane])
        if calls.jumps is not None:
            y -= _drawn(self.padded, calls.jumps[calls.of_lane])
        own = _drawn(self.padded, calls.own[calls.of_lane])
        shared = ca.repmat(self.p[calls.shared.tolist()], 1, calls.batches)
        kernel = calls.kernel
        assert isinstance(kernel, Kernel)
        function = map_calls((kernel.value, kernel.jacobian, kernel.hessian)[part], calls.batches, self.threads)
        outputs = function(y, own, shared, *multipliers)
        # the nonzeros of a row come as a row
        return [ca.vec(one.nz[:]) for one in (outputs if isinstance(outputs, tuple) else (outputs,))]

    def _multipliers(self, calls: Calls) -> ca.MX:
        """Return the multipliers of the kernel's outputs in SI, shape (n_c, calls); zero where not constrained."""
        padded = ca.densify(ca.vertcat(self.lam_g, ca.MX.zeros(1)))
        weights = ca.DM(calls.weights[calls.of_lane].T)
        return _drawn(padded, calls.rows[calls.of_lane]) * weights

    # the program's functions

    def _objective(self) -> tuple[ca.MX, ca.MX]:
        """Return f and its gradient."""
        linear = ca.DM(self.assembly.linear)
        f, gradient = ca.dot(linear, self.w), ca.MX(linear)
        if self.assembly.final is not None:
            value, slope = self._final(self.assembly.final)
            f += value
            gradient += slope
        if self.assembly.penalty is not None:
            penalty = self._penalty(self.assembly.penalty)
            f += penalty
            gradient += ca.gradient(penalty, self.w)
        return f, gradient

    def _final(self, final: FinalCost) -> tuple[ca.MX, ca.MX]:
        """Return the cost of the final state and its gradient in the unknowns, shape (n_w,)."""
        y, own, weights = self._final_arguments(final)
        slope = final.kernel.hessian(y, own, _NOTHING, weights)[0]
        layout = self.assembly.layout
        places = final.inputs.tolist()
        at_the_end = ca.MX(ca.Sparsity(layout.unknowns, 1, [0, len(places)], places), ca.densify(slope))
        scaled = at_the_end * ca.DM(layout.scale)
        return ca.dot(weights, final.kernel.value(y, own, _NOTHING)), ca.densify(scaled)

    def _final_arguments(self, final: FinalCost) -> tuple[ca.MX, ca.MX, ca.DM]:
        return self.unscaled[final.inputs.tolist()], self.p[final.own.tolist()], ca.DM(final.weights)

    def _penalty(self, penalty: Penalty) -> ca.MX:
        controls = _drawn(self.w, penalty.controls)
        shares = self.unscaled[penalty.durations.tolist()] * self.p[penalty.fractions.tolist()]
        return ca.dot(ca.mtimes(ca.DM(penalty.weights).T, controls**2).T, shares)

    def _constraints(self, values: list[ca.MX]) -> ca.MX:
        return ca.densify(_expression(self.assembly.constraints, ca.vertcat(*values, self.w)))

    def _hessian(self, drawn: list[ca.MX]) -> ca.MX:
        final, penalty = self.assembly.final, self.assembly.penalty
        if final is not None:
            y, own, weights = self._final_arguments(final)
            curvature = final.kernel.hessian(y, own, _NOTHING, self.lam_f * weights)[1]
            drawn = [*drawn, ca.vec(curvature.nz[:])]
        if penalty is not None:
            share = self.lam_f * ca.repmat(self.p[penalty.fractions.tolist()].T, len(penalty.weights), 1)
            durations = ca.repmat(self.unscaled[penalty.durations.tolist()].T, len(penalty.weights), 1)
            controls = _drawn(self.w, penalty.controls)
            drawn = [*drawn, ca.vec(share * durations), ca.vec(share * controls)]
        return _expression(self.assembly.hessian, ca.vertcat(*drawn))


def _drawn(column: ca.MX, places: Indices) -> ca.MX:
    """Return the entries of a column at places of shape (m, n), as a matrix of shape (n, m)."""
    count, size = places.shape
    return ca.reshape(column[places.ravel().tolist()], size, count)


def _expression(sums: SparseAssembly, drawn: ca.MX) -> ca.MX:
    """Return a matrix of sums as a sparse expression of a dense column of drawn numbers."""
    count = len(sums.rows)
    values = ca.MX(0.0)
    for turn, (nonzeros, weights, sources) in enumerate(sums.turns):
        picked = ca.vec(drawn[sources.tolist()]) * ca.DM(weights)  # of a scalar: a row
        at = ca.Sparsity(count, 1, [0, len(nonzeros)], nonzeros.tolist())
        values += ca.densify(ca.MX(at, picked)) if turn else picked
    return ca.MX(sums.sparsity, values)


class FatropByCasadi(Solver):
    """The solver fatrop through casadi's interface, set up in quadratic time."""

    def __init__(self, functions: Evaluation, options: SolverOptions) -> None:
        layout, program = functions.assembly.layout, transcribed(functions.assembly, functions.threads)
        self._nlp = program.nlp
        self._settings = {
            "print_time": False,
            "calc_lam_p": False,
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
            "fatrop": dict(fatrop_options(options)),
        }

    def solve(self, guess: np.ndarray, bounds: Bounds, p: np.ndarray, multipliers: Multipliers | None) -> SolverResult:
        # One for each solve: where an equality turns into a range, casadi 3.8.2 forgets the options.
        nlpsol = ca.nlpsol("solve", "fatrop", self._nlp, dict(self._settings))
        result = nlpsol(x0=guess, p=p, lbx=bounds.lower, ubx=bounds.upper, lbg=bounds.g_lower, ubg=bounds.g_upper)
        stats = nlpsol.stats()
        return SolverResult(
            w=np.asarray(result["x"]).ravel(),
            lam_g=np.asarray(result["lam_g"]).ravel(),
            objective=float(result["f"]),
            ending=Ending.UNKNOWN,
            status=str(stats["return_status"]),
            success=bool(stats["success"]),
            iterations=int(stats.get("iter_count", 0)),
            derivative_seconds=0.0,
        )


def solver_named(name: str) -> type[Solver]:
    """Return one of the package's solvers, or `fatrop-casadi`."""
    return FatropByCasadi if name == "fatrop-casadi" else SOLVERS[name]
