"""What a finished stage hands on: to the next stage, to the checkpoint, to the terminal."""

from dataclasses import dataclass
from enum import Enum

from airrace.optimal_control.certificate import Certificate
from airrace.trajectory import Array, Trajectory


class Stage(Enum):
    """The stages in the order in which they are flown; values are the user's names.

    `HOMOTOPY` is the assembled guess of the point mass, kept so that an interrupted run resumes behind it;
    it is neither an optimum nor certified.
    """

    HOMOTOPY = "homotopy"
    POINT_MASS = "point-mass"
    TRANSFER_FUNCTION = "transfer-function"
    STATE_SPACE_INVERSION = "state-space-inversion"
    STATE_SPACE = "state-space"
    SIX_DOF = "six-dof"


class Outcome(Enum):
    """How a stage ended."""

    SOLVED = "solved"
    NOT_CERTIFIED = "not certified"
    NOT_CONVERGED = "not converged"
    INFEASIBLE = "infeasible"
    TIMEOUT = "timeout"


@dataclass(frozen=True)
class GateSplit:
    """The passing of one gate. SI and radians; `name` is the passage's, e.g. `1:g4`."""

    name: str
    time: float
    V_K: float
    height: float
    n_z: float
    bank: float
    climb: float
    heading: float


@dataclass(frozen=True)
class Attempt:
    """One call of a solver: which one, what it was for, its verbatim status and its iterations."""

    purpose: str
    solver: str
    status: str
    success: bool
    iterations: int
    seconds: float


@dataclass(frozen=True)
class Timings:
    """Seconds. `solve` is inside the solver, of which `derivatives` evaluates functions; `wall` is the whole stage."""

    solve: float
    derivatives: float
    wall: float


@dataclass(frozen=True)
class Facts:
    """Where a stage started and what its regularisation costs.

    Attributes:
        regularisation: its share of the objective, s.
        source: the stage along whose optimum this one's model was flown for a first guess; empty without one.
        strayed, strayed_at: farthest from that optimum (m), and when (s).
        missed: how far beside its end that flight ended, m.
    """

    regularisation: float = 0.0
    source: str = ""
    strayed: float = 0.0
    strayed_at: float = 0.0
    missed: float = 0.0


NO_FACTS = Facts()


@dataclass(frozen=True)
class StageResult:
    """One stage, finished.

    Attributes:
        stage: which one.
        outcome: how it ended; only `Outcome.SOLVED` with a certificate that holds counts as success.
        message: one sentence for the user (on infeasibility: which gate and which limit).
        trajectory: the flight on its mesh.
        constraint_multipliers: multipliers of the NLP's constraints in its own order; shape (n_g,).
        bound_multipliers: multipliers of the NLP's simple bounds in its own order; shape (n_w,).
        certificate: None where the stage is not certified by design (homotopy).
        splits: one row per passage.
        attempts: every solver call, in order.
        timings: where the time went.
        facts: where it started, what its regularisation costs.
    """

    stage: Stage
    outcome: Outcome
    message: str
    trajectory: Trajectory
    constraint_multipliers: Array
    bound_multipliers: Array
    certificate: Certificate | None
    splits: tuple[GateSplit, ...]
    attempts: tuple[Attempt, ...]
    timings: Timings
    facts: Facts = NO_FACTS

    @property
    def certified(self) -> bool:
        return self.outcome is Outcome.SOLVED and self.certificate is not None and self.certificate.certified

    @property
    def iterations(self) -> int:
        return sum(attempt.iterations for attempt in self.attempts)
