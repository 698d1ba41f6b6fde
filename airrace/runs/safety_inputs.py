"""What a safety document says of itself: who flew in what, and what went in, with hashes, versions and sources."""

import hashlib
import math
from collections.abc import Iterator, Mapping
from pathlib import Path

from airrace.errors import UsageError
from airrace.files.checkpoint import StoredDocument, inputs_hash
from airrace.files.inputs.inputs import sources_of
from airrace.files.inputs.variation import Variation
from airrace.flights.safety.closed_loop import LOST
from airrace.flights.safety.judge import ANGLE_ALLOWED, LENGTH_ALLOWED, SPEED_ALLOWED, TOUCH_DISTANCE
from airrace.flights.safety.monte_carlo import SafetyResult
from airrace.flights.safety.over_g import LOAD_ALLOWED
from airrace.optimal_control.quantities import KNOT
from airrace.pages.report.document import Part, facts_part, list_part, table_part
from airrace.pages.views.plain_text import escape_html
from airrace.pages.views.tables import Column, Table
from airrace.runs.run_state import RunState
from airrace.runs.stored_inputs import current_versions
from airrace.runtime.standard_streams import STANDARD

_NUMBER_COLUMNS = (Column("number"), Column("value", form=".6g"), Column("unit"))


def assumptions_table(result: SafetyResult) -> Table:
    """Return who flew in what, and where that comes from."""
    scatter, pilot, chosen = result.scatter, result.pilot, "standard deviation, chosen for this case"
    gusts = f"{scatter.gusts.value}, wind of {scatter.gusts.wind_at_20_ft / KNOT:.0f} kt at 20 ft"
    beyond = f"{LENGTH_ALLOWED:g} m, {math.degrees(ANGLE_ALLOWED):.1f} deg, {SPEED_ALLOWED / KNOT:.0f} kt"
    model = "model of Kleinman, Baron and Levison (1970), Automatica 6, 357-369; weights are a judgement"
    rows: list[tuple[str, str, str]] = [
        ("pilot", "optimal regulator behind a delay, with prediction", model),
        ("delay of the pilot", f"{pilot.delay:g} s", "McRuer and Jex (1967), IEEE HFE-8, 231-249: 0.1 to 0.2 s"),
        ("deviation corrected hardest", f"{pilot.urgent:g} m", "judgement"),
        ("lost", f"{LOST:g} m off the line", "judgement"),
        ("gusts", gusts, "Dryden at low altitude, MIL-F-8785C (1980), 3.7.3"),
        ("wind, north and east", f"{scatter.wind / KNOT:.3g} kt", chosen),
        ("mass", f"{100.0 * scatter.mass:.3g} %", chosen),
        ("power", f"{100.0 * scatter.power:.3g} %", chosen),
        ("density of the air", f"{100.0 * scatter.density:.3g} %", chosen),
        ("begin of rolls", f"{1000.0 * scatter.timing:.3g} ms", chosen),
        ("not counted beyond a limit", f"{beyond}, {LOAD_ALLOWED:g} g", "judgement: an optimum lies on its limits"),
        ("a touch", f"within {TOUCH_DISTANCE:g} m of a pylon's line", "judgement"),
        ("flights, seed", f"{result.flights}, {result.seed}", "the same seed gives the same flights"),
        ("intervals", "confidence 95 %", "Clopper and Pearson (1934)"),
    ]
    return Table("", (Column("what"), Column("value"), Column("source")), rows)


def inputs_parts(runs: Mapping[str, RunState]) -> Iterator[Part]:
    """Yield what went in: files with their hashes, versions, sources, and the numbers of rules, air and aircraft."""
    files: list[tuple[str, str]] = []
    facts: list[tuple[str, str]] = []
    sources: list[tuple[str, str, str]] = []
    for name, run in runs.items():
        of_run, digest = f"{name}: " if len(runs) > 1 else "", _digest(run)
        if digest:
            files.append((f"run {name}", digest))
        for what, document in _documents(run):
            digest = hashlib.sha256(document.text.encode()).hexdigest()
            files.append((f"{of_run}{what} {Path(document.path).name}", digest))
        files.append((f"{of_run}resolved configuration", inputs_hash(run.checkpoint.inputs.resolved)))
        facts.append((f"{of_run}set by hand", ", ".join(run.inputs.overrides) or "nothing"))
        facts.append((f"{of_run}solved by", _versions_text(run.checkpoint.versions)))
        sources += [(f"{of_run}{what}", schema, source) for what, schema, source in sources_of(run.inputs)]
    columns = (Column("what"), Column("SHA-256"))
    yield table_part(Table("Files", columns, files, ["of a text: as UTF-8, without a byte order mark"]))
    yield facts_part([*facts, ("simulated by", _versions_text(current_versions()))])
    yield table_part(Table("Sources", (Column("of"), Column("schema"), Column("source")), sources))
    yield from _numbers(runs)


def _versions_text(packages: Mapping[str, str]) -> str:
    return ", ".join(f"{name} {version}" for name, version in packages.items())


def _numbers(runs: Mapping[str, RunState]) -> Iterator[Part]:
    """Yield the numbers of rules, air and aircraft, once for all runs that have the same ones."""
    tables: dict[tuple[str, tuple[tuple[str, float, str], ...]], list[str]] = {}
    rules = ("rules", "gate_defaults", "margins", "environment")
    for name, run in runs.items():
        try:
            numbers = Variation(run.inputs).parameters.values()
        except UsageError as error:
            yield list_part([f"{name}: {error}" if len(runs) > 1 else str(error)])
            continue
        for title, groups in (("Rules, gates, margins, air", rules), ("Aircraft", ("aircraft",))):
            rows = [
                (number.key, number.value, number.unit) for number in numbers if number.key.partition(".")[0] in groups
            ]
            tables.setdefault((title, tuple(rows)), []).append(name)
    for (title, rows), names in sorted(tables.items(), key=lambda item: item[0][0] == "Aircraft"):
        of_runs = f": {', '.join(names)}" if len(runs) > 1 else ""
        yield table_part(Table(f"{title}{of_runs}", _NUMBER_COLUMNS, rows), columns=True)


def text_parts(runs: Mapping[str, RunState]) -> Iterator[Part]:
    """Yield the texts of all files, once for all runs that have the same one."""
    names_by_text: dict[tuple[str, str], list[str]] = {}
    for name, run in runs.items():
        for what, document in _documents(run):
            names_by_text.setdefault((what, document.text), []).append(name)
    for (what, text), names in names_by_text.items():
        title = f"{what} of {', '.join(names)}" if len(runs) > 1 else what
        yield Part(f"<h3>{escape_html(title)}</h3><pre>{escape_html(text)}</pre>", {title: text})


def _digest(run: RunState) -> str:
    """Return the SHA-256 of the file of a run; empty where it has none."""
    content = b"" if run.path is None or run.path == STANDARD else run.path.read_bytes()
    return hashlib.sha256(content).hexdigest() if content else ""


def mark_of(runs: Mapping[str, RunState]) -> str:
    """Return what stands on every page, by which it is known of which runs it is."""
    digests = [_digest(run) or inputs_hash(run.checkpoint.inputs.resolved) for run in runs.values()]
    if len(digests) == 1:
        return f"run {digests[0][:16]}"
    return f"runs {' '.join(digest[:8] for digest in digests)}"


def _documents(run: RunState) -> list[tuple[str, StoredDocument]]:
    stored_inputs = run.checkpoint.inputs
    documents = {"track": stored_inputs.track, "aircraft": stored_inputs.aircraft, "settings": stored_inputs.settings}
    return [(what, document) for what, document in documents.items() if document is not None]
