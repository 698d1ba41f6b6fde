"""How far the search for a reserve has come, as read from the file of a run."""

from dataclasses import dataclass

from airrace.files.checkpoint import Checkpoint, StoredAttempt
from airrace.files.inputs.rules import ReserveEntry
from airrace.flights.results import ReserveState

ATTEMPTS_MAX = 4
"""The number of times that a line is measured at most."""


def asked_text(entry: ReserveEntry) -> str:
    """Return what is asked for as a text, equal for equal reserves."""
    return entry.model_dump_json(exclude={"found"})


def attempts_of(checkpoint: Checkpoint, entry: ReserveEntry | None) -> tuple[StoredAttempt, ...]:
    """Return the attempts that still stand; none where nothing is asked for, or the search has ended."""
    if entry is None or entry.found is not None:
        return ()
    return checkpoint.standing_attempts(asked_text(entry))


def reserve_state(entry: ReserveEntry | None, attempts: int = 0) -> ReserveState | None:
    """Return what was asked of a flight in disturbances, and what was found; None for nothing.

    Args:
        entry: of the inputs.
        attempts: that a search which has not ended has made.
    """
    if entry is None:
        return None
    if entry.found is None:
        return ReserveState(entry.probability, attempts=attempts, attempts_max=ATTEMPTS_MAX)
    found = entry.found
    return ReserveState(entry.probability, found.measured, found.flights, found.reached, found.source or "")


@dataclass(frozen=True)
class PlannedReserve:
    """The search for a reserve in a plan.

    Attributes:
        asked: the probability.
        attempts: that are made already and stand.
        done: whether none is needed any more.
    """

    asked: float
    attempts: int
    done: bool = False

    @property
    def reason(self) -> str:
        """What is left, a clause."""
        if self.done or self.attempts >= ATTEMPTS_MAX:
            return f"all {self.attempts} attempts are made; the best is left to be stored"
        return f"attempt {self.attempts + 1} of {ATTEMPTS_MAX} is next"

    def as_object(self) -> dict[str, object]:
        return {"stage": "reserve", "action": "run", "reason": self.reason}

    def __str__(self) -> str:
        return f"reserve {self.asked:g}: run ({self.reason})"
