"""Several flight logs over one course, judged with gates where all of them together tell that these stand."""

import contextlib
from collections.abc import Sequence
from dataclasses import replace

from airrace.errors import CheckpointError, InputError
from airrace.flights.logs.log_flight import LogFlight, judged_together
from airrace.runs.log_view import LogView
from airrace.runs.verification import flight_again


def log_views_judged_together(views: Sequence[LogView]) -> list[LogView]:
    """Return flight logs with the violations and remarks that follow from all of them; their files stay as they are.

    A log that its file does not verify tells nothing of the others, and is returned as it is.
    """
    logs: dict[int, LogFlight] = {}
    for number, view in enumerate(views):
        if view.verification is None or view.verification.verified is not False:
            with contextlib.suppress(CheckpointError, InputError):
                logs[number] = flight_again(view)
    if len(logs) < 2:
        return list(views)
    judged = list(views)
    for number, log in zip(logs, judged_together(list(logs.values())), strict=True):
        displaced = log.errors.common.displacement_remarks
        if not displaced:
            continue
        recorded, before = views[number].recorded, logs[number].errors.common.displacement_remarks
        # What its import remarked on the samples that it has left out, no stored log can tell once more.
        remarks = (*(remark for remark in recorded.log.remarks if remark not in before), *displaced)
        recorded = replace(recorded, log=replace(recorded.log, remarks=remarks), violations=log.violations)
        judged[number] = replace(views[number], recorded=recorded, displaced=displaced)
    return judged
