"""What every solver takes and returns: options, bounds, multipliers, and a result with the reason of its end."""

from dataclasses import dataclass
from enum import Enum
from typing import ClassVar, Protocol

from airrace.optimal_control.evaluation import Evaluation
from airrace.optimal_control.trajectory import Array


@dataclass(frozen=True)
class SolverOptions:
    """The tolerance, the number of iterations and the barrier that a solver is given.

    Attributes:
        tolerance: on the scaled conditions of optimality, without unit; a tenth of what a race's certificate allows.
        iterations_max: number of iterations after which a solve has failed.
        barrier: first value of the barrier parameter, in the objective's unit; 0.1 is for guesses that may be far off,
            and a solve from an optimum of nearly the same problem begins with 1e-4 or less.
        curvature: whether the curvature of an optimum is judged, and a saddle is left.
        stagnation_max: number of iterations that hardly reduce the violations after which the interior point method
            calls a program locally infeasible. Of 731 solves on nine courses that led to an optimum three had 32 or
            more such iterations, one 46.
        nearly_feasible: the largest violation, scaled (1), up to which such iterations do not count.
    """

    tolerance: float = 1e-7
    iterations_max: int = 500
    barrier: float = 0.1
    curvature: bool = True
    stagnation_max: int = 60
    nearly_feasible: float = 1e-3


@dataclass(frozen=True, eq=False)
class Bounds:
    """The bounds of the scaled unknowns, each of shape (n_w,), and of the scaled constraints, each of shape (n_g,)."""

    lower: Array
    upper: Array
    g_lower: Array
    g_upper: Array


@dataclass(frozen=True, eq=False)
class Multipliers:
    """The multipliers of the scaled program: of its constraints (n_g,) and of its simple bounds (n_w,)."""

    constraints: Array
    bounds: Array


class Ending(Enum):
    """Why a solver ended; the value is a sentence for people."""

    OPTIMAL = "solved"
    ITERATION_LIMIT = "more iterations than allowed"
    ACCEPTABLE = "stopped at a point that is nearly optimal"
    INFEASIBLE = "locally infeasible"
    NO_BETTER_POINT = "neither the line search nor the restoration of feasibility found a better point"
    NO_STEP = "no step could be computed"
    SADDLE = "a saddle, where the conditions of first order hold but there is a way down"
    UNKNOWN = "stopped for an unknown reason"
    NOT_FINITE = "the derivatives are not finite, or far too large, at an iterate"
    CROSSED_BOUNDS = "infeasible: bounds contradict one another"
    INVALID_GUESS = "the guess has no finite objective and constraints"
    TIMEOUT = "no iteration finished in time"
    BUDGET_EXHAUSTED = "the budget of iterations is spent"


@dataclass(frozen=True, eq=False)
class SolverResult:
    """The last point of a solver and how it went.

    Attributes:
        w: unknowns, shape (n_w,).
        lam_g: multipliers of the constraints, shape (n_g,).
        objective: at w.
        ending: why it ended.
        status: the same in the solver's own words.
        success: whether it claims an optimum.
        iterations: number of iterations.
        derivative_seconds: spent in the program's functions.
    """

    w: Array
    lam_g: Array
    objective: float
    ending: Ending
    status: str
    success: bool
    iterations: int
    derivative_seconds: float


class Solver(Protocol):
    """A solver for nonlinear programs, set up for the structure of one.

    Attributes:
        begins_with_multipliers: whether a guess of the multipliers changes where it begins.
        effort: the processor time of an iteration, in those of the interior point method (1).
    """

    begins_with_multipliers: ClassVar[bool] = False
    effort: ClassVar[int] = 1

    def __init__(self, functions: Evaluation, options: SolverOptions) -> None: ...

    def solve(self, guess: Array, bounds: Bounds, p: Array, multipliers: Multipliers | None) -> SolverResult:
        """Solve for these numbers; the multipliers are a guess too."""
        ...
