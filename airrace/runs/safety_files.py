"""Files of closed-loop flights: numbers, the envelope as a picture, and the safety document for an authority."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from airrace.errors import UsageError
from airrace.files.checkpoint.atomic import replace_file
from airrace.flights.safety.monte_carlo import ENVELOPE, fewest
from airrace.pages.report.browser import browser_path, print_pdf
from airrace.pages.views.drawing import ensure_drawable, save_figure
from airrace.pages.views.safety_views import envelope_figure
from airrace.runs.output import write_text
from airrace.runs.run_state import RunState
from airrace.runs.safety_case import SafetyCase
from airrace.runs.safety_document import CaseNotes, SimulatedRun, safety_document
from airrace.runs.stage_view import StageView

NUMBERS = (".csv", ".json")
DOCUMENTS = (".html", ".pdf")
PICTURES = (".png", ".svg")


def ensure_safety_file(path: Path, flights: int, runs: int) -> None:
    """Find out now whether something can be written into a file of this name.

    Raises:
        UsageError: the name says no known format, the format takes one run or more flights, or a drawing needs
            matplotlib, or a PDF a browser.
    """
    suffix = path.suffix.lower()
    if suffix not in (*NUMBERS, *DOCUMENTS, *PICTURES):
        raise UsageError(
            f"{path}: the file must end in {' or '.join(NUMBERS)} for numbers, {' or '.join(DOCUMENTS)} for documents, "
            f"{' or '.join(PICTURES)} for a picture of the envelope"
        )
    if suffix in NUMBERS:
        return
    if runs > 1 and suffix in PICTURES:
        raise UsageError(f"{path}: an envelope is of one run; {runs} runs are given")
    flights_needed = fewest(ENVELOPE[1])
    if flights < flights_needed:
        raise UsageError(f"{path}: an envelope needs {flights_needed} flights or more, not {flights}")
    ensure_drawable(Path("figure.svg"))
    if suffix == ".pdf":
        browser_path()


def fly_into_file(run: RunState, view: StageView, path: Path | None, options: Mapping[str, Any]) -> SafetyCase:
    """Fly a stage's optimum many times, and write that into a file unless it is None.

    Args:
        run, view: the run and its stage.
        path: see `ensure_safety_file`.
        options: of `StageView.safety`.
    """
    if path is not None:
        ensure_safety_file(path, options.get("flights", 1000), 1)
    keywords: dict[str, Any] = {"label": run.label, "falls": lets_fall(path), **options}  # Any: of many types
    case = view.safety(**keywords)
    if path is not None:
        write_safety_file(path, SimulatedRun(run, view, case, case))
    return case


def lets_fall(path: Path | None) -> bool:
    """Return whether what is written into a file tells where flights fall to."""
    return path is not None and path.suffix.lower() in (*DOCUMENTS, ".json")


def write_safety_file(path: Path, of: SimulatedRun, notes: CaseNotes | None = None) -> None:
    """Write closed-loop flights in the format that the name of the file says, replacing the file as a whole.

    Args:
        path: see `ensure_safety_file`.
        of: what was simulated.
        notes: for whom a document is, and who signs it.

    Raises:
        UsageError, CheckpointError, StorageError: see `safety_document`; the system, or a browser, refused.
    """
    suffix, case = path.suffix.lower(), of.every
    if suffix == ".json":
        document = safety_document(of, notes, drawn=False).as_object()
        write_text(path, json.dumps({**case.as_object(), "document": document}, allow_nan=False) + "\n")
    elif suffix == ".csv":
        write_text(path, (case.gates_table() if isinstance(case, SafetyCase) else case.table()).csv(".6g"))
    elif suffix in PICTURES:
        save_figure(envelope_figure(of.own.result, of.view.flight(of.own.label)), path)
    else:
        page = safety_document(of, notes).html()
        if suffix == ".html":
            write_text(path, page)
        else:
            replace_file(path, print_pdf(page))
