"""IPOPT on a program whose functions are callbacks of casadi that hand over the bits of `evaluation.py`."""

from collections.abc import Callable, Mapping, Sequence

import casadi as ca
import numpy as np

from airrace.optimal_control.evaluation import Evaluation
from airrace.optimal_control.solvers.interface import (
    Bounds,
    Ending,
    Multipliers,
    Solver,
    SolverOptions,
    SolverResult,
)
from airrace.optimal_control.trajectory import Array

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


class Ipopt(Solver):
    """The solver IPOPT with MUMPS on the same program.

    On Abu Dhabi 2016, which is made impossible, an iteration takes it 57 to 83 us per interval of the point mass.
    """

    effort = 2

    def __init__(self, functions: Evaluation, options: SolverOptions) -> None:
        self._program = ProgramFunctions(functions)
        own: dict[str, float | str] = {"tol": options.tolerance, "max_iter": options.iterations_max, "sb": "yes"}
        own |= {"mu_init": options.barrier, "bound_relax_factor": 0.0, "nlp_scaling_method": "none"}
        derivatives = self._program.derivatives
        self._settings = {"print_time": False, "calc_lam_p": False, "cache": derivatives, "ipopt": own}
        self._nlpsols: dict[bytes, ca.Function] = {}

    def solve(self, guess: Array, bounds: Bounds, p: Array, multipliers: Multipliers | None) -> SolverResult:
        """Solve; the multipliers are left out: with a warm start IPOPT takes slacks and barrier as they are."""
        self._program.begin(p)
        arguments: dict[str, Array] = {"x0": guess, "p": p, "lbx": bounds.lower, "ubx": bounds.upper}
        arguments |= {"lbg": bounds.g_lower, "ubg": bounds.g_upper}
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


class ProgramFunctions:
    """The functions of a program in the scaled unknowns x and the parameters p, named as casadi's solvers name them.

    Attributes:
        nlp: (x, p) -> f, g.
        derivatives: casadi's names to functions: `nlp_grad_f` (x, p) -> f, gradient of f; `nlp_jac_g` (x, p) -> g,
            Jacobian of g; `nlp_hess_l` (x, p, lam_f, lam_g) -> upper triangle of the Hessian of the Lagrangian;
            `nlp_grad` (x, p, lam_f, lam_g) -> f, g, gradient of the Lagrangian in x, and in p (unused).
    """

    def __init__(self, functions: Evaluation) -> None:
        self._functions = functions
        assembly, layout = functions.assembly, functions.assembly.layout
        x, p, g = layout.unknowns, functions.p.size, layout.constraints
        hessian, dense = assembly.hessian.sparsity, ca.Sparsity.dense
        self._upper = np.flatnonzero(np.asarray(hessian.row()) <= assembly.hessian.columns)
        point, adjoint = {"x": x, "p": p}, {"x": x, "p": p, "lam_f": 1, "lam_g": g}
        value, values, gradient = {"f": dense(1)}, {"g": dense(g)}, dense(x)
        slopes = {"grad_gamma_x": gradient, "grad_gamma_p": ca.Sparsity(0, 1)}
        jacobian = {"jac_g_x": assembly.jacobian.sparsity}
        self.nlp = _Callback("nlp", point, value | values, self._values)
        callbacks = (
            _Callback("nlp_grad_f", point, value | {"grad_f_x": gradient}, self._gradient),
            _Callback("nlp_jac_g", point, values | jacobian, self._jacobian),
            _Callback("nlp_hess_l", adjoint, {"hess_gamma_x_x": ca.triu(hessian)}, self._hessian),
            _Callback("nlp_grad", adjoint, value | values | slopes, self._lagrangian_gradient),
        )
        self.derivatives: Mapping[str, ca.Function] = {callback.name(): callback for callback in callbacks}

    def begin(self, p: Array) -> None:
        """Take the parameters of the next solve."""
        self._functions.p[:] = p
        self._functions.forget()

    def _values(self, x: Array, _: Array) -> Sequence[Array | float]:
        self._functions.w[:] = x
        self._functions.values()
        return self._functions.f, self._functions.g

    def _gradient(self, x: Array, p: Array) -> Sequence[Array | float]:
        self._values(x, p)
        self._functions.objective_gradient()
        return self._functions.f, self._functions.f_gradient

    def _jacobian(self, x: Array, p: Array) -> Sequence[Array | float]:
        self._values(x, p)
        self._functions.linearise()
        return self._functions.g, self._functions.jacobian

    def _hessian(self, x: Array, _: Array, lam_f: Array, lam_g: Array) -> Sequence[Array | float]:
        self._functions.w[:], self._functions.lam_f, self._functions.lam_g[:] = x, float(lam_f[0]), lam_g
        self._functions.curve()
        return (self._functions.hessian[self._upper],)

    def _lagrangian_gradient(self, x: Array, p: Array, lam_f: Array, lam_g: Array) -> Sequence[Array | float]:
        self._values(x, p)
        self._functions.lam_f, self._functions.lam_g[:] = float(lam_f[0]), lam_g
        self._functions.slope()
        return self._functions.f, self._functions.g, self._functions.gradient, np.zeros(0)


class _Callback(ca.Callback):
    """A function of casadi that a function of numpy's arrays evaluates, without conversions."""

    def __init__(
        self,
        name: str,
        inputs: Mapping[str, int],
        outputs: Mapping[str, ca.Sparsity],
        evaluate: Callable[..., Sequence[Array | float]],
    ) -> None:
        super().__init__()
        self._inputs, self._outputs, self._evaluate = list(inputs.items()), list(outputs.items()), evaluate
        self.construct(name, {})

    def get_n_in(self) -> int:
        return len(self._inputs)

    def get_n_out(self) -> int:
        return len(self._outputs)

    def get_name_in(self, i: int) -> str:
        return self._inputs[i][0]

    def get_name_out(self, i: int) -> str:
        return self._outputs[i][0]

    def get_sparsity_in(self, i: int) -> ca.Sparsity:
        return ca.Sparsity.dense(self._inputs[i][1])

    def get_sparsity_out(self, i: int) -> ca.Sparsity:
        return self._outputs[i][1]

    def has_eval_buffer(self) -> bool:
        return True

    def eval_buffer(self, arg: Sequence[memoryview], res: Sequence[memoryview]) -> int:
        """Evaluate; the results that casadi does not ask for have no buffer."""
        results = self._evaluate(*map(np.frombuffer, arg))
        for buffer, result in zip(res, results, strict=True):
            if buffer:
                np.frombuffer(buffer)[:] = result
        return 0
