"""The result of a finished stage, for the next stage, the checkpoint and the terminal, and the progress towards it.

The procedure reports to a `Progress`; the default one is silent.
"""

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from airrace.optimal_control.certificate import Certificate
from airrace.optimal_control.trajectory import Array, Trajectory
from airrace.procedure.stage import Stage

UNVERIFIABLE = (
    "messages and notes",
    "attempts and timings",
    "conflicts of limits",
    "routes that were tried, and the lower bound of the race time",
    "what intervals were last cut or joined for",
    "tracking error of a start",
)
"""The records of a stage that nobody can measure again."""


CLEARANCE = "clearance"
"""The certificate's item on the wing's distance from pylons."""


class Status(Enum):
    """The trust that a stage deserves.

    `CERTIFIED` holds in all that a certificate measures. `SOLVED` holds in all of it but the race time on a second
    mesh, which was not looked for. `GUESS` is no optimum, by design. The others say how a stage failed.
    """

    CERTIFIED = "certified"
    SOLVED = "solved"
    GUESS = "a guess"
    NOT_CERTIFIED = "not certified"
    NOT_CONVERGED = "not converged"
    INFEASIBLE = "infeasible"
    TIMEOUT = "timeout"


OUTCOMES = (Status.SOLVED, Status.NOT_CERTIFIED, Status.NOT_CONVERGED, Status.INFEASIBLE, Status.TIMEOUT)
"""The ways in which the solution of a stage ends; its certificate refines `SOLVED`."""


@dataclass(frozen=True)
class GateSplit:
    """The passing of one gate, in SI and radians; `name` is the passage's, e.g. `1:g4`."""

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
    """A call of a solver: which one, what it was for, its verbatim status and its iterations."""

    purpose: str
    solver: str
    status: str
    success: bool
    iterations: int
    seconds: float


@dataclass(frozen=True)
class Timings:
    """The times of a stage, s.

    `solve` is inside the solver, of which `derivatives` evaluates functions; `wall` is the whole stage. Routes that are
    solved side by side all count in the first two, which may then exceed the last.
    """

    solve: float
    derivatives: float
    wall: float


@dataclass(frozen=True)
class StageProvenance:
    """The start of a stage, and the cost of its regularisation.

    Attributes:
        regularisation: its share of the objective, s.
        source_stage: name of the stage whose optimum the first guess was made of; empty without one.
        source_run: the run that holds that stage, as users call it; empty for this run.
        tracking_error, tracking_error_time: farthest from that optimum (m), and when (s).
        terminal_miss: how far beside its end that flight ended, m.
    """

    regularisation: float = 0.0
    source_stage: str = ""
    source_run: str = ""
    tracking_error: float = 0.0
    tracking_error_time: float = 0.0
    terminal_miss: float = 0.0

    @property
    def source(self) -> str:
        """The source in words: "point-mass of calm.h5"; empty without one."""
        return f"{self.source_stage} of {self.source_run}" if self.source_run else self.source_stage


NO_PROVENANCE = StageProvenance()


HARDLY_SLOWER = 0.010
"""The difference of race times below which the flight that is simpler to fly is chosen, s."""


class NoteKind(Enum):
    """What a note is about."""

    START = "start"
    """Which start from another run failed, and what was started from instead."""
    PLANNED_PHASES = "planned phases"
    """Which phases the homotopy could not add."""
    SIMPLER_ROUTE = "simpler route"
    """Which hardly faster flight was left for one that is simpler to fly."""
    MESH_CHECK = "mesh check"
    """Why the race time could not be confirmed on a second mesh."""


@dataclass(frozen=True)
class Note:
    """Something that users should know of a stage although it holds."""

    kind: NoteKind
    text: str


@dataclass(frozen=True, eq=False)
class MeshRecord:
    """The record of a mesh: where its nodes come from, and the measurements of its N intervals.

    It is empty where nothing was measured.

    Attributes:
        why: a `RefinementReason` per interval, shape (N,).
        coarser: which nodes belong to the mesh that the race time was compared with, shape (N + 1,).
        defect: scaled deviation of the replay from the next node, shape (N,).
        drift: distance of the Hamiltonian from -1, shape (N,).
    """

    why: NDArray[np.int8]
    coarser: NDArray[np.bool_]
    defect: Array
    drift: Array


class PylonSide(Enum):
    """Where a pylon stands as the pilot passes it."""

    RIGHT = "right"
    LEFT = "left"
    BELOW = "below"


@dataclass(frozen=True)
class PylonCondition:
    """A condition that the wing keeps clear of a pylon when it is abeam of that, asked for at a node nearby.

    Attributes:
        element: the name of the element that the pylon belongs to.
        post: its number among the pylons of that, from 0.
        leg: on which the node lies, from 0.
        share: of the leg's duration, at whose nearest node it is asked for.
        side: where the pylon stands.
        error: the length by which the room is larger that is seen from there, as far as it was measured, m.
        roll_acceleration: with which the right wing tip goes down there, as far as it was measured, rad/s2.
    """

    element: str
    post: int
    leg: int
    share: float
    side: PylonSide
    error: float
    roll_acceleration: float = 0.0


NO_RECORD = MeshRecord(np.zeros(0, np.int8), np.zeros(0, np.bool_), np.zeros(0), np.zeros(0))
"""The empty record."""


OPTIMUM = "optimum"
"""What a route was evaluated by whose race time is that of an optimum of the stage, and no rough one."""


@dataclass(frozen=True)
class Route:
    """A route that was tried.

    Attributes:
        text: what it is, in words.
        race_time: of the whole race on this route, as far as a rough mesh tells unless it is an optimum, s.
        difference: to the route of the flight, on the same terms, s; negative for one that is ahead of it.
        evaluated_by: "joint" if optimized as a whole, "window" if only some legs were, the rest held, "priced" if its
            race time is a lower bound by windows between priced gates; `OPTIMUM`.
        rolls: whether it rolls from side to side on each leg on which it differs from that.
    """

    text: str
    race_time: float
    difference: float
    evaluated_by: str
    rolls: bool = False


@dataclass(frozen=True)
class BoundedWindow:
    """A stretch of a race whose least priced time is part of a lower bound.

    Attributes:
        text: the gates at which it begins and ends.
        legs: its number of legs.
        slack: by how much its least priced time is shorter than that of the best flight there, s.
        solved: number of starts that led to a flight at the final prices.
    """

    text: str
    legs: int
    slack: float
    solved: int


@dataclass(frozen=True)
class LowerBound:
    """A lower bound of the race time, as far as its windows were solved globally by a local method from several starts.

    Attributes:
        seconds: no flight is faster, s, on the mesh on which routes are compared.
        race_time: of the best flight on that mesh, s.
        legs_max: largest number of legs of a window, from one gate that stands to the next.
        starts: least number of starts of a window; those that led to flights far from the least, or to none, were not
            tried at the final prices.
        solves: number of all solves of windows and of joined flights.
        unsolved: number of those that led to no flight.
        windows: end to end, they make up the race; none as long as not all of them have been solved from all starts.
        stopped: whether the search was stopped before its end. The bound is that of the last round in which all windows
            were solved from all starts, or 0 if there was none.
    """

    seconds: float
    race_time: float
    legs_max: int
    starts: int
    solves: int
    unsolved: int
    windows: tuple[BoundedWindow, ...]
    stopped: bool = False

    @property
    def gap(self) -> float:
        """By what share of its race time the best flight could be slower than the fastest (1)."""
        return max(0.0, 1.0 - self.seconds / self.race_time)


@dataclass(frozen=True)
class SearchReport:
    """The routes that the search evaluated.

    Attributes:
        routes: that of the flight first, then the others by race time; empty without a search.
        converged_to_best: number of joint optimizations that converged to the first route.
        converged_elsewhere: number that converged to other routes.
        failed: number that did not converge.
        seconds: duration of the search, s.
        loops: needless loops that the best still flies, a sentence each.
        bound: below which no race time is; None where it was not sought.
    """

    routes: tuple[Route, ...] = ()
    converged_to_best: int = 0
    converged_elsewhere: int = 0
    failed: int = 0
    seconds: float = 0.0
    loops: tuple[str, ...] = ()
    bound: LowerBound | None = field(default=None, metadata={"counts": "where set"})  # older records have none

    @property
    def goes_on(self) -> bool:
        """Whether a lower bound is still being sought, or was when the search was stopped."""
        return self.bound is not None and self.bound.stopped

    @property
    def refined(self) -> bool:
        """Whether the race times are those of optima of the stage, not those of the point mass on a rough mesh."""
        return bool(self.routes) and all(route.evaluated_by == OPTIMUM for route in self.routes)


NOT_SEARCHED = SearchReport()
"""The record of a stage without a search."""


@dataclass(frozen=True)
class SuggestedChange:
    """A number that resolves a conflict of limits when it is changed alone.

    Attributes:
        conflict: the number of the conflict, from 1; a course may have several, and all of them must be resolved.
        where: the leg or the passage that is infeasible.
        key: the number's, that `--set` takes; empty where no single number was found that resolves the conflict.
        text: what it is, for people.
        unit: of both values; empty for a plain number.
        given: the value as it is.
        needed: the least value of those that were tried with which a flight was found, rounded to the milder side.
        race_time: of the flight with that value, and the first of every other conflict, on three meshes, s.
        failed: the mildest value that was tried with which no flight was certified; infinite if no other was.
        failed_flies: whether a flight was found with that value.
        certified: whether the flight with the value that is needed is certified.
    """

    conflict: int
    where: str
    key: str
    text: str
    unit: str
    given: float
    needed: float
    race_time: float
    failed: float = math.inf
    failed_flies: bool = False
    certified: bool = True


@dataclass(frozen=True, eq=False)
class StageResult:
    """The result of one finished stage.

    Attributes:
        stage: which one.
        outcome: how its solution ended, one of `OUTCOMES`; see `status`.
        message: why there is no certified flight (on infeasibility: which gate and which limit); else empty.
        trajectory: the flight on its mesh.
        constraint_multipliers: multipliers of the NLP's constraints in its own order; shape (n_g,).
        bound_multipliers: multipliers of the NLP's simple bounds in its own order; shape (n_w,).
        certificate: None where the stage is not certified by design (homotopy). One without the item
            `race_time_change` is that of a stage that was solved on one mesh, see `holds` and `is_rough`.
        splits: one row per passage.
        attempts: every solver call, in order.
        timings: where the time went.
        provenance: where it started, what its regularisation costs.
        mesh: how its mesh came about; empty where it is not certified by design, or not solved.
        search: which other routes were tried; empty in all stages but the one that searches.
        suggested_changes: what would resolve the conflicts for which no flight was found, the least of each first.
        alternatives: flights of this stage on other routes that hold, which go through all stages as well: slower ones,
            or hardly faster ones that are harder to fly.
        notes: what users should know although the stage holds.
        pylon_conditions: that it was solved with; none where the rules ask for none.
    """

    stage: Stage
    outcome: Status
    message: str
    trajectory: Trajectory
    constraint_multipliers: Array
    bound_multipliers: Array
    certificate: Certificate | None
    splits: tuple[GateSplit, ...]
    attempts: tuple[Attempt, ...]
    timings: Timings
    provenance: StageProvenance = NO_PROVENANCE
    mesh: MeshRecord = NO_RECORD
    search: SearchReport = NOT_SEARCHED
    suggested_changes: tuple[SuggestedChange, ...] = ()
    alternatives: tuple["StageResult", ...] = ()
    notes: tuple[Note, ...] = ()
    pylon_conditions: tuple[PylonCondition, ...] = ()

    @property
    def remarks(self) -> str:
        """The notes and the message, in a sentence; often empty."""
        return "; ".join(text for text in (*(note.text for note in self.notes), self.message) if text)

    @property
    def is_flight(self) -> bool:
        """Whether the stage found a flight at all; otherwise its trajectory is only where the solver gave up."""
        return self.outcome in (Status.SOLVED, Status.NOT_CERTIFIED)

    @property
    def has_race_time(self) -> bool:
        """Whether the stage found a flight whose time is that of a race; a guess may be faster than any optimum."""
        return self.is_flight and self.status is not Status.GUESS

    @property
    def holds(self) -> bool:
        """Whether the stage found an optimum, and all that was measured of it holds.

        Then it is certified, or it was solved on one mesh only, and nobody knows what another would do to its race
        time.
        """
        return self.outcome is Status.SOLVED and self.certificate is not None and self.certificate.holds

    @property
    def certified(self) -> bool:
        """Tell whether all that was measured holds, and the race time was compared with that on a coarser mesh."""
        return self.holds and self.certificate is not None and self.certificate.certified

    @property
    def is_rough(self) -> bool:
        """Whether it was solved on one mesh only as closely as the next stage needs, see `certify_rough`."""
        return self.certificate is not None and self.certificate.is_rough

    @property
    def status(self) -> Status:
        """The trust that the stage deserves: its outcome, refined by what its certificate measures."""
        if self.outcome is not Status.SOLVED:
            return self.outcome
        if self.certificate is None:
            return Status.GUESS
        if not self.holds:
            return Status.NOT_CERTIFIED
        return Status.CERTIFIED if self.certified else Status.SOLVED

    @property
    def coarser_nodes(self) -> NDArray[np.bool_]:
        """The nodes that belong to the mesh from which its own was divided, shape (N + 1,); all where there is none."""
        record = self.mesh.coarser
        return record if len(record) else np.ones(len(self.trajectory.time), dtype=np.bool_)

    @property
    def iterations(self) -> int:
        """The number of iterations of all solver calls."""
        return sum(attempt.iterations for attempt in self.attempts)


@dataclass(frozen=True)
class Iteration:
    """A solver's iteration: its number, the objective (s) and the largest scaled infeasibility."""

    number: int
    objective: float
    infeasibility: float


class Progress(ABC):
    """The callbacks of a run, called one at a time, though not always from the same thread.

    The procedure tells of all but the end of a stage: whoever stores the result reports it, once it is stored.
    """

    @abstractmethod
    def stage_started(self, stage: Stage) -> None: ...

    @abstractmethod
    def activity(self, text: str, done: int, total: int) -> None:
        """Receive what is being done within the stage.

        An example is `("phase 3 of 16: start -> g1", 2, 16)`; `total` is 0 if it is unknown.
        """

    @abstractmethod
    def iteration(self, iteration: Iteration) -> None: ...

    @abstractmethod
    def stage_finished(self, result: StageResult) -> None: ...

    def remark(self, text: str) -> None:
        """Receive a line on what is done besides the stages, such as an attempt of a reserve; by default not heard."""
        del text


class Silent(Progress):
    """A progress that shows nothing."""

    def stage_started(self, stage: Stage) -> None: ...

    def activity(self, text: str, done: int, total: int) -> None: ...

    def iteration(self, iteration: Iteration) -> None: ...

    def stage_finished(self, result: StageResult) -> None: ...
