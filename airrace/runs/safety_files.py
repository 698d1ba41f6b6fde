"""Files of closed-loop flights: numbers, the envelope as a picture, and the safety document for an authority."""

import hashlib
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from airrace.errors import UsageError
from airrace.files.checkpoint import StoredDocument, inputs_hash
from airrace.files.checkpoint.atomic import replace_file
from airrace.files.inputs.inputs import sources_of
from airrace.files.inputs.variation import Variation
from airrace.flights.results import Flight
from airrace.flights.results.clearances import least_distances, near_misses
from airrace.flights.results.flight_facts import LOADS_SOURCE, TOLERATED_LOADS, longest_stretch, sustained_loads
from airrace.flights.safety.closed_loop import LOST
from airrace.flights.safety.footprint import Footprint, Track, footprint_of
from airrace.flights.safety.judge import ANGLE_ALLOWED, LENGTH_ALLOWED, SPEED_ALLOWED, TOUCH_DISTANCE
from airrace.flights.safety.monte_carlo import ENVELOPE, LOAD, Count, SafetyResult, fewest
from airrace.flights.safety.over_g import LOAD_ALLOWED
from airrace.optimal_control.quantities import KNOT
from airrace.pages.report.browser import browser_path, print_pdf
from airrace.pages.report.document import (
    chapter,
    document_page,
    facts_block,
    figure_block,
    known_block,
    list_block,
    signature_block,
    table_block,
)
from airrace.pages.views.drawing import Figure, ensure_drawable, figure_address, save_figure
from airrace.pages.views.plain_text import escape_html
from airrace.pages.views.safety_views import (
    envelope_figure,
    falls_table,
    footprint_facts,
    footprint_figure,
    people_table,
)
from airrace.pages.views.stage_tables import LIMITS_OF_CLAIM, certificate_table, distance_table
from airrace.pages.views.tables import Column, Table, Value
from airrace.runs.flight_sources import claim_of
from airrace.runs.output import write_text
from airrace.runs.run_state import RunState
from airrace.runs.safety_case import COUNTS, SafetyCase, count_row
from airrace.runs.safety_rose import SafetyRose, SafetyRuns
from airrace.runs.stage_view import StageView
from airrace.runs.stored_inputs import current_versions
from airrace.runtime.standard_streams import STANDARD

NUMBERS = (".csv", ".json")
DOCUMENTS = (".html", ".pdf")
PICTURES = (".png", ".svg")
NOT_CONSIDERED = (
    "The pilot is a model and no measurement of one: counts compare lines, aircraft and weather; they are no accident "
    "statistics.",
    "Flights begin on the line, at the first gate, with the gusts of that moment. Neither take-off, ferry flight and "
    "landing nor what a pilot does after a mistake are in them.",
    "Errors of the wind last for the whole flight, and the pilot does not learn from them.",
    "Another mass leaves the moments of inertia as they are. Gusts do not roll the aircraft; the air is as coarse as "
    "its centre of mass sees it.",
    "A pylon is a vertical line up to its height.",
    "What falls where is that of the optimum; other flights fall as much farther as they stray.",
    "Failures of structure, engine and controls, birds, other traffic, visibility and the pilot's health are in no "
    "flight.",
    "The ground is flat, at the height of the course's origin. Terrain, and people, buildings and obstacles that the "
    "course does not name, were not looked at.",
    *LIMITS_OF_CLAIM[:-1],
)
"""What no number of the document contains, a sentence each."""
NO_CROWD = "No crowd is given: the course names no people; distances from them and falls onto them were not looked at"
IN_WINDS = "in each wind an optimum of its own, and flights along it; all else is that of the run's own wind"
_NUMBER_COLUMNS = (Column("number"), Column("value", form=".6g"), Column("unit"))


def safety_document(
    run: RunState, view: StageView, case: SafetyCase, rose: SafetyRose | None = None, sign_for: Sequence[str] = ()
) -> str:
    """Return the document as HTML, one file that loads nothing.

    Args:
        run: whose stage was simulated.
        view: the stage.
        case: its closed-loop flights, enough of them for an envelope.
        rose: the same in many winds; None without.
        sign_for: who is to sign.

    Raises:
        UsageError: matplotlib is not installed.
    """
    flight = view.flight(case.label)
    footprint = footprint_of(flight.race, [Track.from_flight(flight)])
    certificate, notes = view.certificate, [view.message] if view.message else []
    omissions, documents = [] if flight.course.crowd else [NO_CROWD], _documents(run)
    content = b"" if run.path is None or run.path == STANDARD else run.path.read_bytes()
    digest = hashlib.sha256(content).hexdigest() if content else inputs_hash(run.checkpoint.inputs.resolved)
    return document_page(
        f"Safety case: {flight.course.name}",
        [
            *_first_page(run, view, case, flight, footprint, omissions),
            signature_block(sign_for),
            _map("Envelope", envelope_figure(case.result, flight)),
            _map("What falls where", footprint_figure(footprint, flight)),
            chapter("Closed-loop flights", *_closed_loop(case)),
            chapter("In many winds", table_block(replace(rose.table(), title="", notes=[IN_WINDS]))) if rose else "",
            chapter("Distances of the optimum", *_distances(flight)),
            chapter("Loads of the optimum", *_loads(flight)),
            chapter("Falls and glides", *_falls(footprint, flight)),
            chapter("The optimum", table_block(certificate_table(certificate, "Certificate", notes)))
            if certificate
            else "",
            chapter("Pilot and disturbances", table_block(_assumptions(case.result))),
            chapter("What was not considered", list_block([*omissions, *NOT_CONSIDERED])),
            chapter("Inputs", *_inputs(run, digest if content else "")),
            chapter(
                "Files as they were read",
                *(f"<h3>{what}</h3><pre>{escape_html(document.text)}</pre>" for what, document in documents),
            ),
        ],
        mark=f"run {digest[:16]}",
    )


def _first_page(
    run: RunState, view: StageView, case: SafetyCase, flight: Flight, footprint: Footprint, omissions: Sequence[str]
) -> Iterator[str]:
    """Yield what is on the first page: what it is about, what has to be known first, and the results in short."""
    yield f'<p class="kicker">Safety case</p><h1>{escape_html(flight.course.name)}</h1>'
    yield facts_block(
        [
            ("aircraft", flight.aircraft.name),
            ("race time", f"{flight.race_time:.3f} s, {view.name}"),
            ("the optimum is", claim_of(run, view) or view.status),
            *((name, view.stamp.entries().get(name, "")) for name in ("pilot's limits", "reserve")),
            ("margins", f"from {len(run.inputs.margins)} of its limits" if run.inputs.margins else ""),
            ("air", view.stamp.air),
            ("simulated", f"{case.result.flights} closed-loop flights, gusts: {case.result.scatter.gusts.value}"),
            ("run", run.label),
            ("made", f"{datetime.now(UTC).date().isoformat()} by airrace {current_versions()['airrace']}"),
        ]
    )
    first = [*filter(None, (case.uncertified, case.result.note)), *omissions]
    for near_miss in near_misses(flight):
        distance = f"{near_miss.clearance.name} at {near_miss.clearance.distance:.2f} m"
        first.append(f"The optimum itself passes {distance}, {near_miss.where}")
    first += [f"Sustained load: {load.text}" for load in sustained_loads(flight)]
    yield known_block("To be known first", first)
    yield table_block(replace(_in_short(case, flight, footprint), title="In short"))
    yield (
        '<p class="note">All of this is computed, by models whose numbers, sources and limits stand below. It is no '
        "permission, and no formula of an authority.</p>"
    )


def _in_short(case: SafetyCase, flight: Flight, footprint: Footprint) -> Table:
    """Return the results that matter most, in words."""
    result = case.result

    def share(count: Count) -> str:
        interval = f"{100.0 * count.lower:.2f} to {100.0 * count.upper:.2f} %"
        return f"{count.flights} of {count.of} flights; {interval} (confidence 95 %)"

    rows: list[tuple[str, str]] = [
        ("touch a pylon or the ground, miss a gate or lose the line", share(result.contact)),
        ("break any rule but the load factor", share(result.outside)),
        ("below the floor", share(result.counts["floor"])),
        ("load factor beyond its limit", share(result.counts[LOAD])),
    ]
    if flight.course.crowd:
        rows.insert(2, ("too near to the crowd", share(result.counts["crowd"])))
        crowd_clearances = [clearance for clearance in least_distances(flight) if clearance.kind == "crowd"]
        least = min(crowd_clearances, key=lambda clearance: clearance.margin)
        text = f"{least.distance:.1f} m from {least.name}, required {least.required:g} m"
        rows.append(("least distance of the optimum from people", text))
        worst = min(footprint.crowds, key=lambda crowd: (crowd.distance, -crowd.overlap))
        hit = f"{worst.distance:.0f} m" if worst.distance else f"onto them, {worst.overlap:.0f} m2"
        rows.append(("nearest impact of a fall to people", f"{hit}, {worst.crowd.name}"))
    return Table("", (Column("what"), Column("how many, how near")), rows)


def _map(title: str, figure: Figure) -> str:
    """Return a map on a page of its own."""
    return chapter(title, figure_block(figure_address(figure), f"{title}, on the map"), new_page=True)


def _closed_loop(case: SafetyCase) -> Iterator[str]:
    counts = case.counts_table()
    yield table_block(replace(counts, title="What the flights break", notes=counts.notes[:1]))
    columns = (replace(COUNTS[0], name="pylon or obstacle"), *COUNTS[1:], Column("nearest", "m", "z.2f"))
    rows = [[*count_row(name, count), least] for name, (count, least) in case.result.pylons.items()]
    yield table_block(Table("Flights that touch each pylon, and the least distance of any wing", columns, rows))
    yield table_block(case.gates_table())
    yield table_block(case.legs_table())


def _distances(flight: Flight) -> Iterator[str]:
    note = "Pylons and obstacles are measured from the wing, all else from the aircraft's centre."
    table = distance_table(flight, "", notes=[note])
    yield table_block(table) if table.rows else ""
    course = flight.course
    kinds = (course.crowd, course.safety_lines, course.obstacles, course.airspace)
    missing = [
        name for name, count in zip(("crowd", "safety line", "obstacle", "airspace"), kinds, strict=True) if not count
    ]
    yield f'<p class="note">The course names no {", no ".join(missing)}.</p>' if missing else ""


def _loads(flight: Flight) -> Iterator[str]:
    rows: list[list[Value]] = []
    for level, tolerated in TOLERATED_LOADS:
        begin, duration = longest_stretch(flight.time, math.copysign(1.0, level) * flight["n_z"], abs(level))
        text = f"{level:g} g or {'more' if level > 0.0 else 'less'}"
        rows.append([text, duration, begin if duration else math.nan, tolerated])
    heads = (("longest", ".2f"), ("from", ".2f"), ("tolerated", "g"))
    columns = (Column("load factor"), *(Column(name, "s", form) for name, form in heads))
    n_z, allowed = flight["n_z"], flight.limit("n_z")
    note = (
        f"The load factor is {n_z.min():.2f} to {n_z.max():.2f} g; the limits are {allowed.lower:g} to "
        f"{allowed.upper:g} g. Durations that experienced persons tolerate: S. R. Mohler, G effects on the pilot "
        f"during aerobatics, {LOADS_SOURCE}, July 1972."
    )
    yield table_block(Table("How long load factors are sustained", columns, rows, [note]))


def _falls(footprint: Footprint, flight: Flight) -> Iterator[str]:
    yield table_block(replace(falls_table(footprint, flight), title="The longest ways over ground"))
    yield table_block(people_table(footprint, flight))
    yield list_block(footprint_facts(footprint, flight))


def _assumptions(result: SafetyResult) -> Table:
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


def _inputs(run: RunState, digest: str) -> Iterator[str]:
    """Yield what went in: files with their hashes, versions, sources, and the numbers of rules, air and aircraft."""
    stored_inputs = run.checkpoint.inputs
    files = [(f"run {run.label}", digest)] if digest else []
    for what, document in _documents(run):
        files.append((f"{what} {Path(document.path).name}", hashlib.sha256(document.text.encode()).hexdigest()))
    files.append(("resolved configuration", inputs_hash(stored_inputs.resolved)))
    columns = (Column("what"), Column("SHA-256"))
    yield table_block(Table("Files", columns, files, ["of a text: as UTF-8, without a byte order mark"]))
    versions = {"solved by": run.checkpoint.versions, "simulated by": current_versions()}
    yield facts_block(
        [
            ("set by hand", ", ".join(run.inputs.overrides) or "nothing"),
            *(
                (what, ", ".join(f"{name} {version}" for name, version in packages.items()))
                for what, packages in versions.items()
            ),
        ]
    )
    yield table_block(Table("Sources", (Column("of"), Column("schema"), Column("source")), sources_of(run.inputs)))
    try:
        numbers = Variation(run.inputs).parameters.values()
    except UsageError as error:
        yield list_block([str(error)])
        return
    rules = ("rules", "gate_defaults", "margins", "environment")
    for title, groups in (("Rules, gates, margins, air", rules), ("Aircraft", ("aircraft",))):
        rows = [(number.key, number.value, number.unit) for number in numbers if number.key.partition(".")[0] in groups]
        yield table_block(Table(title, _NUMBER_COLUMNS, rows), columns=True)


def _documents(run: RunState) -> list[tuple[str, StoredDocument]]:
    stored_inputs = run.checkpoint.inputs
    documents = {"track": stored_inputs.track, "aircraft": stored_inputs.aircraft, "settings": stored_inputs.settings}
    return [(what, document) for what, document in documents.items() if document is not None]


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
    if runs > 1:
        raise UsageError(f"{path}: a document and an envelope are of one run; {runs} runs are given")
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
    keywords: dict[str, Any] = {"label": run.label, **options}  # Any: of many types
    case = view.safety(**keywords)
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
            save_figure(envelope_figure(own.result, view.flight(own.label)), path)
            return
        page = safety_document(run, view, own, case if isinstance(case, SafetyRose) else None, sign_for)
        if suffix == ".html":
            write_text(path, page)
        else:
            replace_file(path, print_pdf(page))
