"""The verification of an imported log: passings, histories and violations made once more of the log that is stored.

The log itself is taken as it is: nobody can record it again.
"""

import math
from collections.abc import Iterator
from datetime import datetime

import numpy as np

from airrace.errors import CheckpointError, InputError
from airrace.logs.log_flight import LogFlight, flight_of_part
from airrace.logs.recording import Recording
from airrace.logs.violations import Violation
from airrace.results import Confirmation
from airrace.runs.log_view import LogView
from airrace.runs.run import library_versions
from airrace.runs.verification import TOLERANCES, in_one_sentence, other_versions
from airrace.trajectory import Array


def confirmation_of(view: LogView, *, versions: bool = True) -> Confirmation:
    """Return what making the flight of the stored log once more tells.

    Args:
        view: as it was read.
        versions: whether a flight that other versions have made is left alone.
    """
    if versions and (other := other_versions(view.recorded.versions, library_versions())):
        return Confirmation(None, other)
    try:
        clauses = list(_discrepancies(view, flight_again(view)))
    except (CheckpointError, InputError) as error:
        clauses = [str(error)]
    return Confirmation(False, in_one_sentence(clauses)) if clauses else Confirmation(True)


def flight_again(view: LogView) -> LogFlight:
    """Return the flight that follows from the stored log.

    Raises:
        InputError: none does.
    """
    log = view.recorded.log
    if missing := [name for name in ("x", "y", "height") if name not in log.columns]:
        raise CheckpointError(f"the stored log has no column {missing[0]!r}")
    begins = datetime.fromisoformat(log.begins) if log.begins else None
    receiver = log.receiver
    part = Recording(
        log.path,
        log.format,
        log.time,
        log.columns,
        log.lines,
        begins,
        barometric=receiver.barometric,
        accuracy=receiver.accuracy,
    )
    noise = None if math.isnan(receiver.noise) else receiver.noise
    inputs = view.inputs
    return flight_of_part(part, inputs.race, label=view.recorded.label, penalties=inputs.penalties, noise=noise)


def _discrepancies(view: LogView, again: LogFlight) -> Iterator[str]:
    """Yield a clause for everything that is stored otherwise than it follows from the log."""
    stored, flight = view.recorded, again.flight
    for mine, its in zip(stored.passings, flight.crossings, strict=False):
        if not _same(mine.time, its.time):
            yield f"{mine.passing} is passed after {mine.time:.3f} s by the file, after {its.time:.3f} s by its log"
    if [one.passing for one in stored.passings] != [one.name for one in flight.crossings]:
        yield "its passings are not those of its course"
    if not _same(stored.log.offset, again.offset) or not _same(stored.time, flight.time):
        yield "its clock is not that of its log"
    histories = {one.quantity.name: one for one in stored.histories}
    if set(histories) != set(flight.histories):
        yield "it has other histories than follow from its log"
    for name in histories.keys() & flight.histories.keys():
        mine, its = histories[name], flight.histories[name]
        if mine.basis != its.basis.value or mine.quantity != its.quantity or not _same(mine.values, its.values):
            yield f"{name} does not follow from its log"
    if len(stored.violations) != len(again.violations):
        yield f"{len(stored.violations)} violations are stored, {len(again.violations)} follow from its log"
    for mine, its in zip(stored.violations, again.violations, strict=False):
        if (mine.passing, mine.rule) != (its.passing, its.rule) or not _same(_numbers(mine), _numbers(its)):
            yield f"the violation {mine.rule} at {mine.passing or 'no passing'} does not follow from its log"


def _numbers(one: Violation) -> Array:
    return np.array([one.time, one.value, one.limit, one.deviation, one.penalty])


def _same(stored: Array | float, again: Array | float) -> bool:
    mine, its = np.asarray(stored), np.asarray(again)
    if mine.shape != its.shape:
        return False
    return np.allclose(mine, its, rtol=TOLERANCES.rounded, atol=TOLERANCES.rounded, equal_nan=True)
