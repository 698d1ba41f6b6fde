"""The solution of a transcribed problem with fatrop (Vanroye et al.), called through its C interface.

Everything is set up in time linear in the number of stages, and anew for every solve, so that fatrop keeps no options
or bounds that belong to another one.

A field that another release of fatrop inserts into a struct would not be an error to ctypes: callbacks would be called
in each other's places and results would be read from beside where they stand. So before the first solve of a process a
problem with a known answer is solved, which takes a few milliseconds: a state x and a control u over one interval,

    minimise u^2 + x_1^2   subject to   x_0 = 1,   x_1 = x_0 + u,   0 <= x_1 <= 5,

with the optimum u = -1/2, x_1 = 1/2.

What fatrop prints meanwhile is read, for it tells where fatrop creeps, see `CreepingLimits`.
"""

import ctypes
import math
import re
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from functools import cache

import casadi as ca
import numpy as np

from airrace.errors import SolverCrash
from airrace.interrupts import defer_signals
from airrace.optimal_control.assembly import Assembly
from airrace.optimal_control.evaluation import Evaluation
from airrace.optimal_control.kernels import casadi_kernels
from airrace.optimal_control.layout import Layout
from airrace.optimal_control.problem import Boundary, Objective, Phase, Problem
from airrace.optimal_control.runge_kutta import RK4
from airrace.optimal_control.solvers.fatrop.blasfeo import MatrixFamily, memory_of
from airrace.optimal_control.solvers.fatrop.library import OUTPUT, Callback, doubles_at, fatrop, interface
from airrace.optimal_control.solvers.fatrop.stages import InitialPoint, Rows, Stages
from airrace.optimal_control.solvers.interface import Bounds, Ending, SolverResult
from airrace.optimal_control.sparse_assembly import Memory
from airrace.quantities import Interval, Quantity
from airrace.records import record
from airrace.system import Observation, System
from airrace.trajectory import Array, Indices

ENDINGS = tuple(Ending)[:7]
"""The endings in the order of `IpSolverReturnFlag`."""


@record
class SolveLimits:
    """The limits beyond which a solve is given up.

    Attributes:
        restoration: the number of successive steps of a restoration of feasibility. Where it led on it took 17 steps at
            most, in the ladders of the shipped courses with exploring and on 30 generated courses; where it did not, it
            went on until no iterations were left, 400 and more.
        derivative: the size of a scaled derivative of the constraints. They are of the order of 100. Products of larger
            ones over the intervals overflow in the factorisation, to whose diagonal fatrop then adds for ever.
    """

    restoration: int = 100
    derivative: float = 1e9


LIMITS = SolveLimits()


@record
class WarmStartSettings:
    """The settings of a solve that begins with known multipliers.

    Attributes:
        largest_costate: the size of the first multipliers of equalities beyond which fatrop does not believe them. Its
            own value of 1000 is for multipliers that were found from a guess; these are known.
        bound_push: the multiple of the barrier parameter by which slacks are pushed off their limits. Where a limit
            begins or ceases to be pressed on, the first step is then longer. Of the stages above the point mass of
            Rovinj, Abu Dhabi and the half Cuban eight, iterations times intervals fell from 96, 101 and 17 thousand
            with a factor of 1 to 93, 92 and 13; with 100 they were 99, 93 and 14.
    """

    largest_costate: float = 1e9
    bound_push: float = 30.0


WARM_START = WarmStartSettings()
_DOUBLE = 8


@record
class FatropResult(SolverResult):
    """The answer of fatrop.

    Attributes:
        lam_w: multipliers of the simple bounds, shape (n_w,).
        barrier: last value of the barrier parameter.
        hessians: number of Hessians that it asked for, those of a restoration of feasibility included.
        reported_iterations: number of iterations that it reports.
    """

    lam_w: Array
    barrier: float
    hessians: int
    reported_iterations: int


class FatropSolver:
    """A solver for one program with changing bounds, parameters and guesses.

    Args:
        functions: of the program.
        options: of fatrop, by its names; integers and floats are distinguished.
        exact: whether bounds hold that fatrop relaxes, see `undo_relaxation`.

    Raises:
        SolverCrash: the library is missing.
    """

    def __init__(self, functions: Evaluation, options: Mapping[str, float | int], *, exact: bool = False) -> None:
        self._stages = Stages(functions.assembly)
        self._functions = functions
        self._options = dict(options)
        self._exact = exact

    def solve(
        self, guess: Array, bounds: Bounds, p: Array, multipliers: Array | None = None, **changed: float
    ) -> FatropResult:
        """Solve from a guess.

        Args:
            guess: of the unknowns, shape (n_w,).
            bounds: of unknowns and constraints.
            p: the parameters.
            multipliers: a guess of those of (g, w), shape (n_g + n_w,); None if nothing is known of them.
            changed: options of this solve alone.

        Raises:
            SolverCrash: the library is not what it should be.
            BaseException: what was raised in a function or while printing, such as KeyboardInterrupt.
        """
        self._functions.p[:] = p
        self._functions.forget()
        options, start = self._options | changed, None
        if multipliers is not None:
            self._functions.w[:] = guess
            self._functions.values()
            barrier = float(options["mu_init"])
            start = InitialPoint(np.concatenate([self._functions.g, guess]), multipliers, barrier)
            options = options | {
                "bound_push": WARM_START.bound_push * barrier,
                "lam_max": WARM_START.largest_costate,
            }
        rows = Rows(self._stages, bounds, start, exact=self._exact)
        return _FatropCall(self._stages, rows, self._functions, guess, options).solve()


class _FatropCall:
    """One solve: the callbacks, and the memory that they share with fatrop."""

    def __init__(
        self, stages: Stages, rows: Rows, functions: Evaluation, guess: Array, options: Mapping[str, float | int]
    ) -> None:
        self._stages, self._rows, self._functions = stages, rows, functions
        self._options = options
        self._error: BaseException | None = None
        self._not_finite = False
        self._steps = 0
        self._restoring = 0  # so many of the last steps
        self._initial = guess.copy()
        self._buffers = _OutputBuffers(stages, rows)
        self._values = np.empty(stages.constraints + stages.unknowns)
        self._solver = 0
        self._stopped = False
        self._detector = CreepingDetector()

    def solve(self) -> FatropResult:
        """Create fatrop's solver, run it and destroy it."""
        library, problem = fatrop(), interface(self._callbacks())
        OUTPUT.error, OUTPUT.listener = None, self._watch
        with defer_signals(self._stop):
            self._solver = library.fatrop_ocp_c_create(ctypes.byref(problem), OUTPUT.callback, None)
            try:
                self._require_dimensions()
                for name, value in self._options.items():
                    self._set_option(name, value)
                if self._stopped:
                    self._stop()
                flag: int = library.fatrop_ocp_c_solve(self._solver)
                stats = library.fatrop_ocp_c_get_stats(self._solver).contents
                reason, iterations = int(stats.return_flag), int(stats.iterations_count)
                w = self._unknowns(library.fatrop_ocp_c_get_primal(self._solver).contents.pa)
                dual = library.fatrop_ocp_c_get_dual(self._solver).contents.pa
                multipliers = self._multipliers(doubles_at(dual, len(self._rows.items)))
            finally:
                OUTPUT.listener = None
                library.fatrop_ocp_c_destroy(self._solver)
                self._solver = 0
        if error := self._error or OUTPUT.error:
            raise error
        self._functions.w[:] = w
        self._functions.values()
        if not 0 <= reason < len(ENDINGS):
            raise SolverCrash(f"the reason of its end is read as {reason}")
        ending = Ending.EXCEPTION if flag < 0 else ENDINGS[reason]
        if ending is Ending.ITERATION_LIMIT and self._detector.creeping:
            ending = Ending.CREEPING
        if self._restoring > LIMITS.restoration:
            ending = Ending.RESTORATION_LIMIT
        if self._not_finite:
            ending = Ending.NOT_FINITE
        own_words = ending in (Ending.CREEPING, Ending.NOT_FINITE, Ending.EXCEPTION)
        return FatropResult(
            w=w,
            lam_g=multipliers[: self._stages.constraints],
            lam_w=multipliers[self._stages.constraints :],
            barrier=self._detector.barrier,
            objective=self._functions.f,
            ending=ending,
            status=ending.value if own_words else f"{reason}: {ending.value}",
            success=flag == 0 and not self._not_finite,
            iterations=max(iterations, self._steps),  # those of a restoration of feasibility included
            hessians=self._steps,
            reported_iterations=iterations,
            derivative_seconds=self._functions.seconds,
        )

    def _require_dimensions(self) -> None:
        """Compare the dimensions that fatrop has read with those that it was given.

        Raises:
            SolverCrash: they differ.
        """
        dims = fatrop().fatrop_ocp_c_get_dims(self._solver).contents
        stages, rows = self._stages, self._rows
        expected = stages.n_u, stages.n_x, rows.equalities, rows.inequalities
        sizes = dims.K, dims.max_nu, dims.max_nx, dims.max_ng, dims.max_ngineq
        if sizes != (stages.count, *(int(one.max()) for one in expected)):  # before pointers are followed
            raise SolverCrash(f"the sizes are read as {sizes}")
        read = [one[: stages.count] for one in (dims.nu, dims.nx, dims.ng, dims.ng_ineq)]
        if read != [one.tolist() for one in expected]:
            raise SolverCrash(f"the dimensions are read as {read}")

    def _set_option(self, name: str, value: float | int) -> None:
        kind = "int" if isinstance(value, int) else "double"
        getattr(fatrop(), f"fatrop_ocp_c_set_option_{kind}")(self._solver, name.encode(), value)

    def _stop(self) -> None:
        """Let fatrop end after this iteration: it knows no other request."""
        self._stopped = True
        if self._solver:
            self._set_option("max_iter", 0)

    def _watch(self, text: str) -> None:
        """Read what fatrop prints, and stop it where it creeps."""
        self._detector.read(text)
        if self._detector.creeping and not self._stopped:
            self._stop()

    # what fatrop asks for; pointers are addresses, see the header

    def _callbacks(self) -> dict[str, Callback]:
        stages, rows = self._stages, self._rows
        n_x, n_u, first = stages.n_x.tolist(), stages.n_u.tolist(), stages.first.tolist()
        inequalities, first_inequality = rows.inequalities.tolist(), rows.first_inequality.tolist()

        def bounds(lower: int, upper: int, k: int, _: object) -> int:
            offset, size = _DOUBLE * first_inequality[k], _DOUBLE * inequalities[k]
            ctypes.memmove(lower, rows.lower.ctypes.data + offset, size)
            ctypes.memmove(upper, rows.upper.ctypes.data + offset, size)
            return 0

        def initial_states(states: int, k: int, _: object) -> int:
            ctypes.memmove(states, self._initial.ctypes.data + _DOUBLE * first[k], _DOUBLE * n_x[k])
            return 0

        def initial_controls(controls: int, k: int, _: object) -> int:
            ctypes.memmove(controls, self._initial.ctypes.data + _DOUBLE * (first[k] + n_x[k]), _DOUBLE * n_u[k])
            return 0

        return {
            "get_nx": _look_up(n_x),
            "get_nu": _look_up(n_u),
            "get_ng": _look_up(rows.equalities.tolist()),
            "get_ng_ineq": _look_up(inequalities),
            "get_horizon_length": lambda *_: stages.count,
            "get_bounds": bounds,
            "get_initial_xk": initial_states,
            "get_initial_uk": initial_controls,
            "full_eval_obj": self._guard(self._evaluate_objective),
            "full_eval_obj_grad": self._guard(self._evaluate_gradient),
            "full_eval_contr_viol": self._guard(self._evaluate_violation),
            "full_eval_constr_jac": self._guard(self._evaluate_jacobian),
            "full_eval_lag_hess": self._guard(self._evaluate_hessian),
        }

    def _guard(self, evaluate: Callable[..., None]) -> Callback:
        """Return a callback whose exception is raised after the solve, which ends early: none may unwind fatrop."""

        def callback(*arguments: float) -> int:
            try:
                evaluate(*arguments)
                if OUTPUT.error is not None:
                    self._stop()
            except BaseException as error:
                self._error = self._error or error
                self._stop()
            return 1  # everything is evaluated

        return callback

    def _evaluate_objective(self, factor: float, unknowns: int, _p: int, _q: int, result: int, *_: int) -> None:
        self._functions.w[:] = self._unknowns(unknowns)
        self._functions.values()
        f = self._functions.f
        doubles_at(result, 1)[0] = factor * (f if f == f else np.inf)

    def _evaluate_gradient(self, factor: float, unknowns: int, _p: int, _q: int, result: int, *_: int) -> None:
        self._functions.w[:] = self._unknowns(unknowns)
        self._functions.objective_gradient()
        doubles_at(result, self._stages.unknowns)[self._stages.place] = factor * self._functions.f_gradient

    def _evaluate_violation(self, unknowns: int, _p: int, _q: int, result: int, *_: int) -> None:
        self._functions.w[:] = self._unknowns(unknowns)
        self._functions.values()
        doubles_at(result, len(self._rows.items))[:] = self._residuals()

    def _evaluate_jacobian(
        self, unknowns: int, _p: int, _q: int, dynamics: int, equalities: int, inequalities: int, *_: int
    ) -> None:
        functions, rows = self._functions, self._rows
        functions.w[:] = self._unknowns(unknowns)
        memory, places = self._buffers.constraints((dynamics, equalities, inequalities))
        # At a point that will not be accepted numbers may be none; fatrop's loops need numbers.
        values, seen = functions.jacobian_sources(), self._residuals()
        if LIMITS.derivative < np.fmax.reduce(np.abs(values)) < np.inf:
            self._not_finite = True
            values = np.where(np.abs(values) < LIMITS.derivative, values, 0.0)
            self._stop()
        if not rows.jacobian.write(values, memory, rows.weights):
            rows.jacobian.clean(memory)
        memory.doubles[places] = np.nan_to_num(seen, posinf=0.0, neginf=0.0)

    def _evaluate_hessian(
        self, factor: float, unknowns: int, multipliers: int, _p: int, _q: int, matrices: int, *_: int
    ) -> None:
        functions, stages = self._functions, self._stages
        self._steps += 1
        self._restoring = self._restoring + 1 if factor == 0.0 else 0  # a restoration leaves the objective out
        if self._restoring > LIMITS.restoration:
            self._stop()
        functions.w[:] = self._unknowns(unknowns)
        functions.lam_f = factor
        both = self._multipliers(doubles_at(multipliers, len(self._rows.items)))
        functions.lam_g[:] = both[: stages.constraints]
        values = functions.hessian_sources()
        gradient = functions.gradient + both[stages.constraints :]
        gradient[stages.next_states] -= functions.lam_g[stages.gaps]  # fatrop's Lagrangian leaves x_next out
        memory, slope = self._buffers.costs(matrices)
        finite = stages.hessian.write(values, memory)
        memory.doubles[slope] = gradient
        self._not_finite = self._not_finite or not (finite and np.isfinite(gradient).all())
        if self._not_finite:  # fatrop would add to the diagonal for ever
            stages.hessian.fill(stages.on_diagonal.astype(np.float64), memory)
            memory.doubles[slope] = 0.0
            self._stop()

    def _unknowns(self, address: int) -> Array:
        return doubles_at(address, self._stages.unknowns).take(self._stages.place, mode="clip")  # none is clipped

    def _residuals(self) -> Array:
        """Return fatrop's constraints, infinite where they are not numbers, which its line search can refuse."""
        self._values[: self._stages.constraints] = self._functions.g
        self._values[self._stages.constraints :] = self._functions.w
        values = self._values.take(self._rows.items, mode="clip")  # none is clipped
        values *= self._rows.factors
        values += self._rows.shifts
        values[np.isnan(values)] = np.inf
        return values

    def _multipliers(self, dual: Array) -> Array:
        """Return the multipliers of (g, w) from fatrop's; zero for what is not bounded."""
        count = self._stages.constraints + self._stages.unknowns
        return np.bincount(self._rows.items, self._rows.factors * dual, count).astype(np.float64, copy=False)


def _look_up(numbers: Sequence[int]) -> Callback:
    """Return a callback with the number of stage k."""

    def callback(k: int, _: object) -> int:
        return numbers[k]

    return callback


class _OutputBuffers:
    """The matrices of one solve. fatrop has a few sets of them and uses them in turn.

    When a set is met first, zero is written to all of its entries; those that no pattern holds stay so.
    """

    def __init__(self, stages: Stages, rows: Rows) -> None:
        self._stages = stages
        self._rows = rows
        self._known: dict[bytes, tuple[Memory, Indices]] = {}

    def constraints(self, structs: Sequence[int]) -> tuple[Memory, Indices]:
        """Return the memory of the matrices BAbt and both Ggt at these addresses, and the places of the residuals.

        Raises:
            SolverCrash: the matrices have other shapes.
        """
        rows, columns = self._rows, self._rows.columns

        def prepare(memory: Memory) -> Indices:
            begins = memory.begins[columns.stages, columns.families]
            bounded, offsets = rows.constants
            memory.doubles[begins[bounded] + offsets] = rows.factors[bounded]
            return begins + rows.residual_offsets

        return self._memory(rows.families, structs, prepare)

    def costs(self, structs: int) -> tuple[Memory, Indices]:
        """Return the memory of the matrices RSQrqt, and the places of the gradient in it; otherwise the same."""
        stages = self._stages
        return self._memory(
            (stages.matrices,),
            (structs,),
            lambda memory: memory.begins[stages.stage_of_unknown, 0] + stages.gradient_offsets,
        )

    def _memory(
        self, families: Sequence[MatrixFamily], structs: Sequence[int], prepare: Callable[[Memory], Indices]
    ) -> tuple[Memory, Indices]:
        addresses = [family.addresses(address) for family, address in zip(families, structs, strict=True)]
        key = b"".join(one.tobytes() for one in addresses)
        if key not in self._known:
            memory = memory_of(families, addresses)
            for number, family in enumerate(families):
                family.clear(memory.doubles, memory.begins[: len(family.rows), number])
            self._known[key] = memory, prepare(memory)
        return self._known[key]


TESTED = "3.8.2"
"""The release of casadi whose header `tests/optimal_control/test_fatrop_interface.py` compares field by field."""


@cache
def require_known_interface() -> None:
    """Solve the problem with the known answer, once per process.

    Raises:
        SolverCrash: the library behaves otherwise than expected.
    """
    OUTPUT.muted = True
    try:
        difference = _difference()
    except SolverCrash as error:
        difference = str(error)
    finally:
        OUTPUT.muted = False
    if difference:
        version = ca.CasadiMeta.version()
        raise SolverCrash(f"the solver fatrop in casadi {version} is not laid out as in casadi {TESTED}: {difference}")


def _difference() -> str:
    """Return how the answer differs from what is expected; empty if it does not."""
    problem = _problem()
    layout = Layout(problem)
    solver = FatropSolver(Evaluation(Assembly(layout, casadi_kernels(problem.system, problem.scheme))), {"tol": 1e-8})
    bounds = Bounds(*layout.unknown_bounds(), *layout.constraint_bounds())
    guess = np.clip(np.full(layout.unknowns, 0.3), bounds.lower, bounds.upper)
    found = solver.solve(guess, bounds, layout.parameter_values())
    iterate = layout.unpack(found.w)
    numbers = [*iterate.state[0].tolist(), *iterate.control[0].tolist()]
    if not found.success:
        return f"it answers {found.status}"
    # An interior point method stays off its bounds by about its tolerance, 1e-8.
    if np.abs(np.array(numbers) - (1.0, 0.5, -0.5)).max() > 1e-6:
        return f"the optimum is read as {numbers}"
    if found.reported_iterations != found.hessians:  # one in every iteration
        return f"{found.reported_iterations} iterations are read"
    return ""


def _problem() -> Problem:
    x, u, nothing = ca.SX.sym("x"), ca.SX.sym("u"), ca.SX.sym("nothing", 0)
    state, control = Quantity("x", "1", lower=0.0, upper=5.0), Quantity("u", "1")
    system = System("probe", (state,), (control,), (), ca.Function("rates", [x, u, nothing], [u]))
    square = Observation("square", (Quantity("square", "1"),), (), ca.Function("square", [x, nothing], [x**2]))
    return Problem(
        system=system,
        parameters=(),
        start=Boundary("start", bounds={"x": Interval.exactly(1.0)}),
        phases=(Phase("only", (1.0,), Interval.exactly(1.0)),),
        objective=Objective(time=0.0, terminal={"square": 1.0}, regularisation={"u": 1.0}, observation=square),
        scheme=RK4,
    )


# Columns: iteration (with r within a restoration), objective, inf_pr, inf_du, lg(mu), ||d||, lg(rg).
_ITERATION = re.compile(r"^\s*\d+(r?)\s+(\S+)\s+(\S+)\s+\S+\s+(\S+)\s+\S+\s+(\S+)\s")


@record
class CreepingLimits:
    """What creeping is: short steps at nearly feasible points, seen in the lines that fatrop prints.

    From some guesses on, its factorisation claims negative curvature in every iteration where a sparse one finds none.
    What it then adds to the Hessian, 1 to 50, leaves steps of 1e-4, and hundreds of iterations lead nowhere. Another
    method, given the iterate and its multipliers, is soon done.

    In the ladders of `abu_dhabi_2016`, `air_race_x_2024`, `rovinj_2014` and `half_cuban_eight`, 211 solves, fatrop
    never creeps by these limits. On a course of 18 phases it does in six solves of 62 to 502 iterations, and is
    found out after 7 to 27.

    Attributes:
        iterations: the number of successive iterations, outside of a restoration of feasibility.
        regularisation: the least that is added to the Hessian in all of them.
        infeasibility: the largest scaled infeasibility at all of them; far from feasible points curvature is negative
            in good earnest.
        change: the largest change of the objective over all of them, as a part of it or of 1.
    """

    iterations: int = 6
    regularisation: float = 0.1
    infeasibility: float = 0.01
    change: float = 3e-3


CREEPING = CreepingLimits()


class CreepingDetector:
    """A reader of fatrop's output.

    Attributes:
        creeping: whether it was seen to creep.
        barrier: last value of the barrier parameter; not a number before the first iteration.
    """

    def __init__(self) -> None:
        self.creeping = False
        self.barrier = math.nan
        self._line = ""
        self._objectives = deque[float](maxlen=CREEPING.iterations)  # of successive iterations that may be creeping

    def read(self, text: str) -> None:
        """Take a piece of the output, which may end anywhere within a line."""
        *lines, self._line = (self._line + text).split("\n")
        for line in lines:
            if match := _ITERATION.match(line):
                self.barrier = 10.0 ** float(match[4])
                self._count(not match[1], float(match[2]), float(match[3]), match[5])

    def _count(self, ordinary: bool, objective: float, infeasibility: float, regularisation: str) -> None:
        added = 0.0 if regularisation == "-" else 10.0 ** float(regularisation)
        if not (ordinary and infeasibility <= CREEPING.infeasibility and added >= CREEPING.regularisation):
            self._objectives.clear()
            return
        self._objectives.append(objective)
        if len(self._objectives) == CREEPING.iterations:
            change = abs(objective - self._objectives[0])
            self.creeping = self.creeping or change <= CREEPING.change * max(1.0, abs(objective))
