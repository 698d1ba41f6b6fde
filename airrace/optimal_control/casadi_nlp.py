"""The discretised problem as a nonlinear program of CasADi, with a name for every unknown and every row.

    minimise f(x, p)    subject to    lbx <= x <= ubx,    lbg <= g(x, p) <= ubg

in scaled units. The package's own solvers evaluate the same sums from index arrays (`evaluation.py`); this is for
users who pass a problem to another solver or analyse it with CasADi.
"""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from airrace.optimal_control.assembly import Assembly, Calls, EndCost, Penalty
from airrace.optimal_control.kernels import Kernel, Part, casadi_kernels, map_calls
from airrace.optimal_control.layout import Layout
from airrace.optimal_control.problem import Iterate, Problem
from airrace.optimal_control.sparse_assembly import SparseAssembly
from airrace.optimal_control.trajectory import Array, Indices

_NOTHING = ca.MX(0, 1)  # an observation shares nothing between its calls


@dataclass(frozen=True, eq=False)
class CasadiNlp:
    """A nonlinear program as `casadi.nlpsol` takes it.

    Examples:
        >>> nlp = run["point-mass"].to_casadi()
        >>> solver = ca.nlpsol("solver", "ipopt", nlp.nlp)
        >>> nlp.x_names[0], len(nlp.g_names) == len(nlp.lbg)
        ('x at node 0', True)

    Attributes:
        nlp: the expressions `x`, `p`, `f` and `g`, all of MX, scaled.
        x0: where to begin, shape (n_x,).
        p: values of the parameters, shape (n_p,).
        lbx, ubx: bounds of x, shape (n_x,).
        lbg, ubg: bounds of g, shape (n_g,).
        x_names, g_names: what every unknown and every constraint is, e.g. `V_K at node 12`.
        scale: SI units per unit of x, shape (n_x,).
    """

    nlp: dict[str, ca.MX]
    x0: Array
    p: Array
    lbx: Array
    ubx: Array
    lbg: Array
    ubg: Array
    x_names: tuple[str, ...]
    g_names: tuple[str, ...]
    scale: Array

    def __repr__(self) -> str:
        return f"<CasadiNlp of {len(self.x0)} unknowns, {len(self.lbg)} constraints, {len(self.p)} parameters>"


def to_casadi(problem: Problem, guess: Iterate) -> CasadiNlp:
    """Return a discretised problem as a nonlinear program of CasADi.

    Args:
        problem: with its meshes.
        guess: where to begin, SI.

    Raises:
        ValueError: the problem does not say what it seems to say, or the guess has other shapes.
    """
    layout = Layout(problem)
    expressions = NlpExpressions(Assembly(layout, casadi_kernels(problem.system, problem.scheme)))
    lbx, ubx = layout.unknown_bounds()
    lbg, ubg = layout.constraint_bounds()
    return CasadiNlp(
        nlp={"x": expressions.w, "p": expressions.p, "f": expressions.objective(), "g": expressions.constraints()},
        x0=layout.pack(guess),
        p=layout.parameter_values(),
        lbx=lbx,
        ubx=ubx,
        lbg=lbg,
        ubg=ubg,
        x_names=unknown_names(layout),
        g_names=constraint_names(layout),
        scale=layout.scale,
    )


def unknown_names(layout: Layout) -> tuple[str, ...]:
    """Return what every unknown is: a state at a node, a control of an interval, or a phase's duration as it is
    carried along (each node has its own, tied to the one before)."""
    names = np.full(layout.unknowns, "", dtype=object)
    system = layout.problem.system
    for node, place in enumerate(layout.duration_index.tolist()):
        names[place] = f"duration at node {node}"
    for phase, place in zip(layout.problem.phases, layout.phase_durations.tolist(), strict=True):
        names[place] = f"duration of {phase.name}"
    for rows, quantities, where in (
        (layout.state_index, system.states, "node"),
        (layout.control_index, system.controls, "interval"),
    ):
        for number, row in enumerate(rows):
            names[row] = [f"{quantity.name} at {where} {number}" for quantity in quantities]
    return tuple(names.tolist())


def constraint_names(layout: Layout) -> tuple[str, ...]:
    """Return what every constraint is: the gap of a state before a node, or a limit at a node."""
    names = np.full(layout.constraints, "", dtype=object)
    gaps = [*(quantity.name for quantity in layout.problem.system.states), "duration"]
    for node, places in enumerate(layout.gap_index, start=1):
        names[places] = [f"gap of {name} before node {node}" for name in gaps]
    for place, node in zip(layout.row_index.tolist(), layout.rows.node.tolist(), strict=True):
        names[place] = f"{layout.describe(place)} at node {node}"
    return tuple(names.tolist())


class NlpExpressions:
    """The expressions of a nonlinear program over the symbols `w` (unknowns, scaled) and `p` (parameters)."""

    def __init__(self, assembly: Assembly, threads: int = 1) -> None:
        layout = assembly.layout
        self.assembly = assembly
        self.threads = threads
        self.w = ca.MX.sym("x", layout.unknowns)
        self.p = ca.MX.sym("p", len(layout.parameter_values()))
        self.unscaled = self.w * ca.DM(layout.scale)
        self.padded = ca.vertcat(self.p, ca.MX.zeros(1))

    def objective(self) -> ca.MX:
        """Return f."""
        f = ca.dot(ca.DM(self.assembly.linear), self.w)
        for cost in self.assembly.end_costs:
            y, own, weights = self.arguments_at_end(cost)
            f += ca.dot(weights, cost.kernel.value(y, own, _NOTHING))
        if self.assembly.penalty is not None:
            f += self.regularisation(self.assembly.penalty)
        return f

    def regularisation(self, penalty: Penalty) -> ca.MX:
        """Return the cost of the squared states and controls."""
        values = take_columns(self.w, penalty.places)
        shares = self.unscaled[penalty.durations.tolist()] * self.p[penalty.fractions.tolist()]
        return ca.dot(ca.mtimes(ca.DM(penalty.weights).T, values**2).T, shares)

    def constraints(self) -> ca.MX:
        """Return g."""
        return self.constraints_of([self.evaluate(calls, Part.VALUES)[0] for calls in self.assembly.calls])

    def constraints_of(self, values: list[ca.MX]) -> ca.MX:
        """Return g from the outputs of all calls."""
        return ca.densify(sum_of(self.assembly.constraints, ca.vertcat(*values, self.w)))

    def evaluate(self, calls: Calls, part: Part, *multipliers: ca.MX) -> list[ca.MX]:
        """Return the outputs of a kernel function over all its calls, lanes included, as columns of nonzeros."""
        y = take_columns(self.unscaled, calls.inputs[calls.of_lane])
        if calls.jumps is not None:
            y -= take_columns(self.padded, calls.jumps[calls.of_lane])
        own = take_columns(self.padded, calls.own[calls.of_lane])
        shared = ca.repmat(self.p[calls.shared.tolist()], 1, calls.batches)
        kernel = calls.kernel
        assert isinstance(kernel, Kernel)
        function = map_calls((kernel.value, kernel.jacobian, kernel.hessian)[part], calls.batches, self.threads)
        outputs = function(y, own, shared, *multipliers)
        # the nonzeros of a row come as a row
        columns = outputs if isinstance(outputs, tuple) else (outputs,)
        return [ca.vec(column.nz[:]) for column in columns]

    def arguments_at_end(self, cost: EndCost) -> tuple[ca.MX, ca.MX, ca.DM]:
        """Return the state at that end, the observation's parameters and the weights of the cost."""
        return self.unscaled[cost.inputs.tolist()], self.p[cost.own.tolist()], ca.DM(cost.weights)


def take_columns(column: ca.MX, places: Indices) -> ca.MX:
    """Return the entries of a column at places of shape (m, n), as a matrix of shape (n, m)."""
    count, size = places.shape
    return ca.reshape(column[places.ravel().tolist()], size, count)


def sum_of(sums: SparseAssembly, terms: ca.MX) -> ca.MX:
    """Return a matrix of sums as a sparse expression of a dense column of terms."""
    count = len(sums.rows)
    values = ca.MX(0.0)
    for turn, (nonzeros, weights, sources) in enumerate(sums.turns):
        picked = ca.vec(terms[sources.tolist()]) * ca.DM(weights)  # of a scalar: a row
        at = ca.Sparsity(count, 1, [0, len(nonzeros)], nonzeros.tolist())
        values += ca.densify(ca.MX(at, picked)) if turn else picked
    return ca.MX(sums.sparsity, values)
