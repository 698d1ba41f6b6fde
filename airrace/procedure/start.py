"""A start of the joint problem, and the initial barrier parameter by its quality."""

from enum import Enum

from airrace.optimal_control.problem import Iterate, Problem
from airrace.optimal_control.solvers.interface import Multipliers
from airrace.procedure.result import NO_PROVENANCE, StageProvenance
from airrace.procedure.stage_problem import StageProblem
from airrace.records import record


class InitialBarrier(Enum):
    """The first value of the barrier parameter, by the quality of the start.

    When those of another stage and of a coarser mesh fell from 1e-2 to 1e-4 and from 1e-3 to 1e-6, all stages together
    took a third fewer iterations.
    """

    COLD = 0.1
    """A guess that may be far off."""
    PIECES = 1e-2
    """Assembled pieces, or the solution of a neighbouring problem. On Rovinj and Abu Dhabi windows took 20 to 56
    iterations, most of them less than 30, and 20 to more than 70 with 0.1, which led to the same flights."""
    COARSE = 1e-3
    """A coarse solution on another mesh."""
    OTHER_STAGE = 1e-4
    """The optimum of another stage, or of the same one under other numbers. A larger value leads astray and back, in
    twice the iterations; on Rovinj and Abu Dhabi it took 14 to 18 iterations, and 17 to 23 with 1e-3."""
    OTHER_MESH = 1e-5
    """An optimum on another mesh with its multipliers, under numbers that may differ a little. On Rovinj changed by
    half a g or 5 kt it takes 31 to 43 iterations on both meshes, and with 1e-4 39 to 50. With 1e-6 it took 28 instead
    of 31 in one case, and 47 instead of 43 in another."""
    COARSER_MESH = 1e-6
    """An optimum on a coarser mesh."""

    @property
    def near_optimum(self) -> bool:
        """Whether predictor-corrector steps lead on; from another stage they fail or take as long as fatrop."""
        return self in (InitialBarrier.OTHER_MESH, InitialBarrier.COARSER_MESH)


@record
class Start:
    """A flight to start from: on the mesh of its problem, with the first value of the barrier parameter.

    `flight` is planned as the start goes round; `provenance` says where it comes from; `multipliers` are those of the
    limits as far as they are known, None if nothing is.
    """

    flight: StageProblem
    problem: Problem
    guess: Iterate
    barrier: InitialBarrier
    provenance: StageProvenance = NO_PROVENANCE
    multipliers: Multipliers | None = None
