"""The nonlinear program of a problem as casadi's own functions, which the package's evaluation is held against."""

from dataclasses import dataclass

import casadi as ca

from airrace.optimal_control.assembly import Assembly, Calls, EndCost
from airrace.optimal_control.casadi_nlp import NlpExpressions, sum_of, take_columns
from airrace.optimal_control.kernels import Kernels, Part
from airrace.optimal_control.layout import Layout

_NOTHING = ca.MX(0, 1)  # an observation shares nothing between its calls


@dataclass(frozen=True, eq=False)
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


class _Transcription(NlpExpressions):
    """The expressions of a program with those of its derivatives."""

    def __init__(self, assembly: Assembly, threads: int) -> None:
        super().__init__(assembly, threads)
        self.lam_f = ca.MX.sym("lam_f")
        self.lam_g = ca.MX.sym("lam_g", assembly.layout.constraints)

    def program(self) -> NonlinearProgram:
        w, p, lam_f, lam_g = self.w, self.p, self.lam_f, self.lam_g
        f, grad_f = self._objective()
        g = self.constraints()
        linear = [self.evaluate(calls, Part.JACOBIAN) for calls in self.assembly.calls]
        curved = [self.evaluate(calls, Part.HESSIAN, self._multipliers(calls)) for calls in self.assembly.calls]
        jacobian = sum_of(self.assembly.jacobian, ca.vertcat(*(nonzeros for _, nonzeros in linear), 1.0))
        adjoint = sum_of(self.assembly.adjoint, ca.vertcat(*(gradient for gradient, _ in curved), lam_g))
        gradient = lam_f * grad_f + ca.densify(adjoint)
        hessian = self._hessian([nonzeros for _, nonzeros in curved])
        arguments, inputs = [w, p, lam_f, lam_g], ["x", "p", "lam_f", "lam_g"]
        outputs = ["grad_gamma_x", "hess_gamma_x_x"]
        g_and_jacobian = [self.constraints_of([value for value, _ in linear]), jacobian]
        return NonlinearProgram(
            nlp=ca.Function("nlp", [w, p], [f, g], ["x", "p"], ["f", "g"]),
            grad_f=ca.Function("nlp_grad_f", [w, p], [grad_f], ["x", "p"], ["grad_f_x"]),
            f_and_grad=ca.Function("nlp_grad_f", [w, p], [f, grad_f], ["x", "p"], ["f", "grad_f_x"]),
            jac_g=ca.Function("nlp_jac_g", [w, p], g_and_jacobian, ["x", "p"], ["g", "jac_g_x"]),
            hess_l=ca.Function("nlp_hess_l", arguments, [gradient, hessian], inputs, outputs),
            hess_l_upper=ca.Function("nlp_hess_l", arguments, [ca.triu(hessian)], inputs, outputs[1:]),
            grad=ca.Function("nlp_grad", arguments, [f, g, gradient, ca.MX(0, 1)]),
        )

    def _multipliers(self, calls: Calls) -> ca.MX:
        """Return the multipliers of the kernel's outputs in SI, shape (n_c, calls); zero where not constrained."""
        padded = ca.densify(ca.vertcat(self.lam_g, ca.MX.zeros(1)))
        weights = ca.DM(calls.weights[calls.of_lane].T)
        return take_columns(padded, calls.rows[calls.of_lane]) * weights

    def _objective(self) -> tuple[ca.MX, ca.MX]:
        """Return f and its gradient."""
        gradient = ca.MX(ca.DM(self.assembly.linear))
        for cost in self.assembly.end_costs:
            gradient += self._at_end(cost)
        if self.assembly.penalty is not None:
            gradient += ca.gradient(self.regularisation(self.assembly.penalty), self.w)
        return self.objective(), gradient

    def _at_end(self, cost: EndCost) -> ca.MX:
        """Return the gradient of the cost of the state at one end in the unknowns, shape (n_w,)."""
        y, own, weights = self.arguments_at_end(cost)
        slope = cost.kernel.hessian(y, own, _NOTHING, weights)[0]
        layout = self.assembly.layout
        places = cost.inputs.tolist()
        at_the_end = ca.MX(ca.Sparsity(layout.unknowns, 1, [0, len(places)], places), ca.densify(slope))
        scaled = at_the_end * ca.DM(layout.scale)
        return ca.densify(scaled)

    def _hessian(self, drawn: list[ca.MX]) -> ca.MX:
        penalty = self.assembly.penalty
        for cost in self.assembly.end_costs:
            y, own, weights = self.arguments_at_end(cost)
            curvature = cost.kernel.hessian(y, own, _NOTHING, self.lam_f * weights)[1]
            drawn = [*drawn, ca.vec(curvature.nz[:])]
        if penalty is not None:
            share = self.lam_f * ca.repmat(self.p[penalty.fractions.tolist()].T, len(penalty.weights), 1)
            durations = ca.repmat(self.unscaled[penalty.durations.tolist()].T, len(penalty.weights), 1)
            values = take_columns(self.w, penalty.places)
            drawn = [*drawn, ca.vec(share * durations), ca.vec(share * values)]
        return sum_of(self.assembly.hessian, ca.vertcat(*drawn))
