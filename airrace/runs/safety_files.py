"""Files of closed-loop flights: numbers, the envelope as a picture, and the document for an authority."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from airrace.checkpoint.atomic import replace_file
from airrace.errors import UsageError
from airrace.runs.output import write_text
from airrace.runs.run import RunState
from airrace.runs.safety_case import SafetyCase
from airrace.runs.safety_rose import SafetyRose, SafetyRuns
from airrace.runs.stage_view import StageView
from airrace.safety.result import ENVELOPE, fewest

NUMBERS = (".csv", ".json")
DOCUMENTS = (".html", ".pdf")
PICTURES = (".png", ".svg")


def ensure_safety_file(path: Path, flights: int, runs: int) -> None:
    """Find out now whether something can be written into a file of this name.

    Raises:
        UsageError: the name says no known format, the format takes one run or more flights, or a drawing needs
            matplotlib, or a PDF a browser.
    """
    from airrace.report.browser import browser_path
    from airrace.views.drawing import ensure_drawable

    suffix = path.suffix.lower()
    if suffix not in (*NUMBERS, *DOCUMENTS, *PICTURES):
        raise UsageError(
            f"{path}: the file must end in {' or '.join(NUMBERS)} for numbers, {' or '.join(DOCUMENTS)} for documents, "
            f"{' or '.join(PICTURES)} for a picture of the envelope"
        )
    if suffix in NUMBERS:
        return
    if runs > 1:
        raise UsageError(f"{path}: a document and an envelope are of one run; {runs} runs are given")
    needed = fewest(ENVELOPE[1])
    if flights < needed:
        raise UsageError(f"{path}: an envelope needs {needed} flights or more, not {flights}")
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
    named: dict[str, Any] = {"label": run.label, **options}  # Any: of many types
    case = view.safety(**named)
    if path is not None:
        write_safety_file(path, case, (run, view, case))
    return case


def write_safety_file(
    path: Path,
    case: SafetyCase | SafetyRose | SafetyRuns,
    of: tuple[RunState, StageView, SafetyCase] | None = None,
    sign_for: Sequence[str] = (),
) -> None:
    """Write closed-loop flights in the format that the name of the file says, replacing the file as a whole.

    Args:
        path: see `ensure_safety_file`.
        case: of one run, of one in many winds, or of several runs.
        of: the run, its stage, and the flights along that in the run's own wind; what documents and pictures show.
        sign_for: who is to sign a document.

    Raises:
        UsageError, CheckpointError, StorageError: see `safety_document`; the system, or a browser, refused.
    """
    suffix = path.suffix.lower()
    if suffix == ".json":
        write_text(path, json.dumps(case.as_object(), allow_nan=False) + "\n")
    elif suffix == ".csv":
        write_text(path, (case.gates_table() if isinstance(case, SafetyCase) else case.table()).csv(".6g"))
    elif of is not None:
        run, view, own = of
        if suffix in PICTURES:
            from airrace.views.drawing import save_figure
            from airrace.views.envelope_figure import envelope_figure

            save_figure(envelope_figure(own.result, view.flight(own.label)), path)
            return
        from airrace.report.printing import print_pdf
        from airrace.runs.safety_document import safety_document

        page = safety_document(run, view, own, case if isinstance(case, SafetyRose) else None, sign_for)
        if suffix == ".html":
            write_text(path, page)
        else:
            replace_file(path, print_pdf(page))
