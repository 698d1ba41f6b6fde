"""The safety document for an authority: what was flown, how near it comes to people, and what was not considered.

All of its numbers are plain values first: `Document.as_object` returns them unrounded, and its pages show the same.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime

import numpy as np

from airrace.errors import UsageError
from airrace.files.inputs.rules import ReserveEntry
from airrace.flights.results import Flight
from airrace.flights.results.clearances import near_misses
from airrace.flights.results.flight_facts import LOADS_SOURCE, TOLERATED_LOADS, longest_stretch, sustained_loads
from airrace.flights.safety.disturbances import Disturbances, Gusts
from airrace.flights.safety.footprint import Footprint, Track, footprint_of
from airrace.flights.safety.impacts import outlines_of
from airrace.flights.safety.judge import Thing
from airrace.flights.safety.monte_carlo import OVER_G, Count, Nearness, SafetyResult
from airrace.model.track.course import Course, PilotLimits, geodetic
from airrace.optimal_control.quantities import KNOT
from airrace.pages.report.document import (
    Chapter,
    Document,
    Part,
    facts_part,
    known_part,
    list_part,
    note_part,
    picture_part,
    signature_block,
    table_part,
)
from airrace.pages.views.plain_text import escape_html
from airrace.pages.views.safety_views import (
    borders_table,
    case_map,
    envelope_figure,
    falls_table,
    footprint_facts,
    footprint_figure,
    people_table,
)
from airrace.pages.views.stage_tables import LIMITS_OF_CLAIM, certificate_table, distance_table
from airrace.pages.views.tables import Column, Table, Value
from airrace.procedure.planning.parameters import course_limits
from airrace.runs.flight_sources import claim_of
from airrace.runs.run_state import RunState
from airrace.runs.safety_case import COUNTS, SafetyCase, count_row
from airrace.runs.safety_inputs import assumptions_table, inputs_parts, mark_of, text_parts
from airrace.runs.safety_rose import SafetyRose, SafetyRuns, is_own
from airrace.runs.stage_view import StageView
from airrace.runs.stored_inputs import current_versions

NOT_CONSIDERED = (
    "The pilot is a model and no measurement of one: counts compare lines, aircraft and weather; they are no accident "
    "statistics.",
    "Flights begin on the line, at the first gate, with the gusts of that moment. Neither take-off, ferry flight and "
    "landing nor what a pilot does after a mistake are in them.",
    "Errors of the wind last for the whole flight, and the pilot does not learn from them.",
    "Another mass leaves the moments of inertia as they are. Gusts do not roll the aircraft; the air is as coarse as "
    "its centre of mass sees it.",
    "A pylon is a vertical line up to its height.",
    "Falls are those of an aircraft that is whole and uncontrolled, in the wind of the day without gusts.",
    "Failures of structure, engine and controls, birds, other traffic, visibility and the pilot's health are in no "
    "flight.",
    "The ground is flat, at the height of the course's origin. Terrain, and people, buildings and obstacles that the "
    "course does not name, were not looked at.",
    *LIMITS_OF_CLAIM[:-1],
)
"""What no number of the document contains, a sentence each."""
NO_CROWD = "No crowd is given: the course names no people; distances from them and falls onto them were not looked at"
IN_WINDS = "in each wind an optimum of its own, and flights along it; all else is that of the run's own wind"
NOT_STATED = "not stated"
NO_MARGINS = "all else in this document is by the limits themselves: flights are judged without margins"
_MARGINS = (Column("limit"), Column("by the rules", form=".6g"), Column("margin", form=".4g"), Column("unit"))
_GATES = (
    *(Column("gate"), Column("type"), Column("north", "m", "z.1f"), Column("east", "m", "z.1f")),
    *(
        Column("latitude", "deg", ".6f"),
        Column("longitude", "deg", ".6f"),
        Column("height", "m"),
        Column("width", "m", ".1f"),
    ),
)
GATES_BELOW_MAP, GATES_BESIDE_MAP = 8, 24
"""The largest numbers of gates whose positions stand on the first page, below its map and beside a smaller one."""


@dataclass(frozen=True)
class CaseNotes:
    """What no simulation knows of a document.

    Attributes:
        prepared_for: for whom it is made.
        valid: for when, or until when.
        revision: which one it is.
        sign_for: who is to sign.
    """

    prepared_for: str = ""
    valid: str = ""
    revision: str = ""
    sign_for: Sequence[str] = ()


@dataclass(frozen=True, eq=False)
class SimulatedRun:
    """A run and what was simulated of it.

    Attributes:
        run, view: the run, and its stage.
        own: the flights in the run's own wind.
        every: of the run, of it in several winds, or of several runs; this one is among them.
        runs: of several runs, by the names that they have there; empty where this is the only one.
    """

    run: RunState
    view: StageView
    own: SafetyCase
    every: SafetyCase | SafetyRose | SafetyRuns
    runs: Mapping[str, RunState] = field(default_factory=dict[str, RunState])


@dataclass(frozen=True, eq=False)
class NamedCase:
    """Flights along one line.

    Attributes:
        name: of the run, of the wind, or of both.
        case: the flights; a text says why there are none.
        run: of which it is.
        in_own_wind: whether they are in the wind of that run; in another wind its line has no reserve of its own.
    """

    name: str
    case: SafetyCase | str
    run: RunState
    in_own_wind: bool

    @property
    def has_reserve(self) -> bool:
        """Whether their line keeps a reserve that was measured along it."""
        return self.in_own_wind and has_reserve(self.run)


def named_cases(of: SimulatedRun) -> list[NamedCase]:
    """Return all cases, and that of the run's own wind where it is none of these."""
    every = of.every.cases if isinstance(of.every, SafetyRuns) else {"": of.every}
    named: list[NamedCase] = []
    for name, case in every.items():
        run = of.runs.get(name, of.run)
        if isinstance(case, SafetyRose):
            for wind, of_wind in case.cases.items():
                name_of_wind = f"{name}, {wind.text}" if name else wind.text
                named.append(NamedCase(name_of_wind, of_wind, run, is_own(wind, run)))
        else:
            named.append(NamedCase(name or of.own.label, case, run, in_own_wind=True))
    own_is_named = any(
        named_case.run is of.run and named_case.in_own_wind and isinstance(named_case.case, SafetyCase)
        for named_case in named
    )
    if not own_is_named:
        named.insert(0, NamedCase(f"{of.own.label}, its own wind", of.own, of.run, in_own_wind=True))
    return named


def ensure_one_course(runs: Mapping[str, RunState]) -> None:
    """Find out whether one document can be of all these runs: their courses are the same but for margins and pilots.

    Raises:
        UsageError: two of the courses differ.
    """
    (first, run), *others = runs.items()
    for name, other in others:
        if _course_of(other) != _course_of(run):
            raise UsageError(
                f"a document is of one course: {first} ({run.race.course.name}) and {name} ({other.race.course.name}) "
                "are of different ones; write a document for each"
            )


def _course_of(run: RunState) -> Course:
    """Return the course of a run without what belongs to its line and its pilot."""
    course = run.race.by_rules.course
    return replace(course, rules=replace(course.rules, pilot=PilotLimits()))


def safety_document(of: SimulatedRun, notes: CaseNotes | None = None, *, drawn: bool = True) -> Document:
    """Return the document.

    Args:
        of: what was simulated, enough flights for an envelope, let fall.
        notes: for whom it is, and who signs.
        drawn: whether it has pictures.

    Raises:
        UsageError: matplotlib is not installed.
    """
    run, view, case, notes = of.run, of.view, of.own, notes or CaseNotes()
    flight = view.flight(case.label)
    flight = replace(flight, race=flight.race.by_rules)  # margins are the line's own; a flight is judged without them
    footprint = footprint_of(flight.race, [Track.from_flight(flight)])
    cases = {named_case.name: named_case.case for named_case in named_cases(of)}
    certificate, remarks = view.certificate, [view.message] if view.message else []
    omissions, runs = [] if flight.course.crowd else [NO_CROWD], of.runs or {run.label: run}
    gates, envelope, falls = _gates_table(flight), list[Part](), list[Part]()
    on_first = len(gates.rows) <= GATES_BESIDE_MAP
    course = table_part(gates) if on_first else note_part("Positions of all gates: see the chapter of that name")
    place = [course]
    if drawn:
        picture = picture_part(case_map(flight), "The course from above")
        box = '<div class="course">' if GATES_BELOW_MAP < len(gates.rows) <= GATES_BESIDE_MAP else '<div class="whole">'
        place = [Part(f"{box}{picture.html}<div>{course.html}</div></div>", course.content)]
        envelope = [picture_part(envelope_figure(case.result, flight), "Envelope, on the map")]
        everywhere = outlines_of(flight.race, case.result.stretches) if case.result.stretches else ()
        falls = [picture_part(footprint_figure(footprint, flight, everywhere), "What falls where, on the map")]
    return Document(
        f"Safety case: {flight.course.name}",
        [*_first_page(of, notes, flight), *place],
        [
            Chapter("Results in short", [*_in_short(of, flight, omissions), *_signatures(of, notes)], new_page=True),
            Chapter("Positions of all gates", [] if on_first else [table_part(gates)]),
            Chapter("Margins of the line", list(_margins(of))),
            Chapter("Distances of all flights", list(_distances(cases, flight))),
            Chapter("Envelope", envelope, new_page=True),
            Chapter("What falls where", [*falls, *_falls(cases, footprint, flight)], new_page=True),
            Chapter("Closed-loop flights", list(_closed_loop(case))),
            Chapter(
                "The line replanned", [table_part(replace(case.lines_table(), title=""))] if case.replanned else []
            ),
            Chapter("In every wind and of every aircraft", list(_every(of.every))),
            Chapter("Loads of the optimum", [table_part(_loads_table(flight))]),
            Chapter(
                "The optimum",
                [table_part(certificate_table(certificate, "Certificate", remarks))] if certificate else [],
            ),
            Chapter("Pilot and disturbances", [table_part(assumptions_table(case.result))]),
            Chapter("What was not considered", [list_part([*omissions, *NOT_CONSIDERED])]),
            Chapter("Inputs", list(inputs_parts(runs))),
            Chapter("Files as they were read", list(text_parts(runs))),
        ],
        mark=mark_of(runs),
    )


def _first_page(of: SimulatedRun, notes: CaseNotes, flight: Flight) -> Iterator[Part]:
    """Yield what flight it is, for whom, and until when."""
    run, view, title = of.run, of.view, flight.course.name
    every = of.every.aircraft.values() if isinstance(of.every, SafetyRuns) else ()
    aircraft = dict.fromkeys([flight.aircraft.name, *every])
    reserve = _reserve_text(run, view)
    whose = ""
    if len(of.runs) > 1:
        reserve = "; ".join(
            f"{name}: {_reserve_text(other, other.stages[-1])}" for name, other in of.runs.items() if other.stages
        )
        whose = f"{next(name for name, other in of.runs.items() if other is run)}: "
    line = f"{whose}{_line_text(run)}; {flight.race_time:.3f} s, {view.name}, {claim_of(run, view) or view.status}"
    yield Part(f'<p class="kicker">Safety case</p><h1>{escape_html(title)}</h1>', title)
    yield facts_part(
        [
            ("flight", line),
            ("reserve", reserve),
            ("margins", f"from {len(run.inputs.margins)} of its limits" if run.inputs.margins else ""),
            ("aircraft", ", ".join(aircraft)),
            ("air", view.stamp.air),
            ("pilot's limits", view.stamp.entries().get("pilot's limits", "")),
            ("simulated", _simulated_text(of)),
            ("for", notes.prepared_for or NOT_STATED),
            ("valid", notes.valid or f"{NOT_STATED}; for this course, these aircraft and winds alone"),
            ("revision", notes.revision or NOT_STATED),
            ("runs" if len(of.runs) > 1 else "run", ", ".join(of.runs) or run.label),
            ("made", f"{datetime.now(UTC).date().isoformat()} by airrace {current_versions()['airrace']}"),
        ]
    )


def has_reserve(run: RunState) -> bool:
    """Return whether the line of a run keeps a reserve that was measured along it."""
    reserve = run.inputs.reserve
    return reserve is not None and reserve.found is not None and reserve.found.reached and not reserve.found.source


def _line_text(run: RunState) -> str:
    """Return what line it is."""
    if has_reserve(run):
        return "the fastest line with a measured reserve"
    return "the fastest line with margins" if run.inputs.margins else "the fastest line that was found"


def _reserve_text(run: RunState, view: StageView) -> str:
    """Return the reserve of a line, and in which disturbances it was measured."""
    reserve = run.inputs.reserve
    if reserve is None:
        return view.stamp.reserve_text or "none"
    loads = "" if reserve.load_factor else "; over-g is not in it"
    return f"{view.stamp.reserve_text}; asked for in {_asked_text(reserve)}{loads}"


def _asked_text(reserve: ReserveEntry) -> str:
    """Return the disturbances that a reserve was asked for in, as `_disturbances_text` does."""
    return _disturbances_text(Disturbances.of_reserve(reserve))


def _flown_text(result: SafetyResult) -> str:
    """Return the disturbances in which flights were simulated, as `_disturbances_text` does."""
    scatter = result.scatter
    flown = Disturbances(
        gusts=scatter.gusts.value,
        wind_error_kt=scatter.wind / KNOT,
        mass_error_percent=100.0 * scatter.mass,
        power_error_percent=100.0 * scatter.power,
        density_error_percent=100.0 * scatter.density,
        roll_timing_s=scatter.timing,
        delay_s=result.pilot.delay,
    )
    return _disturbances_text(flown)


def _disturbances_text(disturbances: Disturbances) -> str:
    """Return all disturbances as words that are the same for the same ones."""
    errors = {
        f"wind {disturbances.wind_error_kt:.6g} kt": disturbances.wind_error_kt,
        f"mass {disturbances.mass_error_percent:.6g} %": disturbances.mass_error_percent,
        f"power {disturbances.power_error_percent:.6g} %": disturbances.power_error_percent,
        f"density {disturbances.density_error_percent:.6g} %": disturbances.density_error_percent,
        f"rolls {1000.0 * disturbances.roll_timing_s:.6g} ms": disturbances.roll_timing_s,
    }
    texts = [text for text, error in errors.items() if error]
    gusts = "no gusts" if disturbances.gusts == Gusts.NONE else f"{disturbances.gusts} gusts"
    others = f"errors of {', '.join(texts)}" if texts else "nothing else"
    return f"{gusts} and {others}, with a pilot's delay of {disturbances.delay_s:.6g} s"


def _simulated_text(of: SimulatedRun) -> str:
    """Return how much was simulated, in which disturbances, and where these are not those of a reserve."""
    cases = [(case, case.case.result) for case in named_cases(of) if isinstance(case.case, SafetyCase)]
    flights = sum(result.flights for _, result in cases)
    names = [case.name for case, _ in cases]
    several = f" in {len(cases)} cases ({'; '.join(names)})" if len(cases) > 1 else ""
    by_text: dict[str, list[str]] = {}
    others: list[str] = []
    for case, result in cases:
        by_text.setdefault(_flown_text(result), []).append(case.name)
        reserve = case.run.inputs.reserve
        if case.in_own_wind and reserve is not None and _flown_text(result) != _asked_text(reserve):
            others.append(case.name)
    flown = [f"in {text}" for text in by_text]
    if len(by_text) > 1:
        flown = [f"in {text} ({', '.join(named)})" for text, named in by_text.items()]
    differ = f" of {', '.join(others)}" if len(cases) > 1 else ""
    different = f". These are not the disturbances that the reserve{differ} was asked for in" if others else ""
    return f"{flights} closed-loop flights{several}, {'; '.join(flown)}{different}"


def _gates_table(flight: Flight) -> Table:
    """Return where every gate stands, each once."""
    course, rows = flight.course, list[list[Value]]()
    for element in {passage.element.name: passage.element for passage in course.passages}.values():
        north, east = element.place or (None, None)
        latitude = longitude = None
        if north is not None and east is not None and course.origin.has_coordinates:
            angles = geodetic(np.array([north]), np.array([east]), course.origin)
            latitude, longitude = (math.degrees(float(angle[0])) for angle in angles)
        heights = element.heights
        height = f"{heights.lower:g} to {heights.upper:g}" if math.isfinite(heights.lower + heights.upper) else ""
        width = getattr(element, "width", None)
        rows.append([element.name, element.type_name, north, east, latitude, longitude, height, width])
    return Table("Gates", _GATES, rows)


def _margins(of: SimulatedRun) -> Iterator[Part]:
    """Yield by how much lines keep within their limits, a table for each run that has margins."""
    for name, run in (of.runs or {of.run.label: of.run}).items():
        limits = {limit.key: limit for limit in course_limits(run.race.by_rules)}
        rows = [(key, limits[key].value, margin, limits[key].unit) for key, margin in run.inputs.margins.items()]
        if rows:
            yield table_part(Table(f"By how much {name} keeps within its limits", _MARGINS, rows, [NO_MARGINS]))


def _signatures(of: SimulatedRun, notes: CaseNotes) -> Iterator[Part]:
    """Yield places to sign, below what has to be known of the line."""
    if not notes.sign_for:
        return
    cases = named_cases(of)
    without = [_no_reserve_text(case, several=len(cases) > 1) for case in cases if not case.has_reserve]
    if without:
        yield known_part("No reserve", without)
    yield Part(signature_block(notes.sign_for), list(notes.sign_for))


def _no_reserve_text(case: NamedCase, *, several: bool) -> str:
    """Return what has to be known of a line without a measured reserve."""
    whose = f"The line of {case.name}" if several else "This line"
    if isinstance(case.case, str):
        return f"Nothing is known of a line of {case.name}: {case.case}"
    reserve, broken = case.run.inputs.reserve, case.case.result.broken
    if not case.in_own_wind and has_reserve(case.run):
        why = ", for that of its run was measured in another wind"
    else:
        why = "" if reserve is None else f" ({case.run.stages[-1].stamp.reserve_text})"
        why += "" if case.run.inputs.margins else ": it touches its limits"
    return (
        f"{whose} has no measured reserve{why}; {broken.flights} of {broken.of} simulated flights break a rule. It "
        "shows where a reserve is needed, and is no flight to be flown"
    )


def _in_short(of: SimulatedRun, flight: Flight, omissions: Sequence[str]) -> Iterator[Part]:
    """Yield what has to be known first, and the results that matter most, in words."""
    named = named_cases(of)
    first: list[str] = []
    for case in named:
        known = [case.case] if isinstance(case.case, str) else [case.case.uncertified, case.case.result.note]
        first += [f"{text} ({case.name})" if len(named) > 1 else text for text in known if text]
    first += omissions
    for near_miss in near_misses(flight):
        distance = f"{near_miss.clearance.name} at {near_miss.clearance.distance:.2f} m"
        first.append(f"The optimum itself passes {distance}, {near_miss.where}")
    first += [f"Sustained load: {load.text}" for load in sustained_loads(flight)]
    yield known_part("To be known first", first)
    results = {case.name: case.case.result for case in named if isinstance(case.case, SafetyCase)}
    course = flight.course
    yield table_part(_outcomes_table(results, f"Of {flight.aircraft.name}, {of.view.stamp.air}", course))
    cases = {case.name: case.case for case in named}
    over = "all winds and aircraft" if len(cases) > 1 else "all flights"
    yield table_part(_nearest_table(cases, f"least distances, {over}"))
    yield table_part(_impacts_table(cases, f"impacts of falls, {over}"))
    yield note_part(
        "All of this is computed, by models whose numbers, sources and limits stand below. It is no permission, and no "
        "formula of an authority."
    )


def _outcomes_table(results: Mapping[str, SafetyResult], title: str, course: Course) -> Table:
    """Return how many flights break what matters most, of the case that is worst in it.

    Args:
        results: by the names of cases.
        title: stands above those of a single case.
        course: that is flown.
    """
    contact = _worst_share({name: result.contact for name, result in results.items()})
    broken = _worst_share({name: result.broken for name, result in results.items()})
    rows: list[list[Value]] = [
        ["touch a pylon or the ground, miss a gate or lose the line", *contact],
        ["break any rule", *broken],
    ]
    kinds = {"below the floor": "floor"}
    if course.crowd:
        kinds = {"too near to the crowd": "crowd", **kinds}
    if course.safety_lines:
        kinds["across a safety line"] = "safety line"
    for what, kind in kinds.items():
        rows.append([what, *_worst_share({name: result.counts[kind] for name, result in results.items()})])
    over_g, name = _worst_share({name: result.counts[OVER_G] for name, result in results.items()})
    rows.append([f"over-g: {results[name].load_rule.text}", over_g, name])
    columns = (Column("what"), Column("how many"), Column("in"))
    if len(results) > 1:
        return Table("Of all cases the worst", columns, rows)
    return Table(title, columns[:-1], [row[:-1] for row in rows])


def _worst_share(counts: Mapping[str, Count]) -> tuple[str, str]:
    """Return the largest share of flights as words, and the name of its case."""
    name, count = max(counts.items(), key=lambda item: (item[1].share, item[1].upper))
    interval = f"{100.0 * count.lower:.2f} to {100.0 * count.upper:.2f} %"
    return f"{count.flights} of {count.of} flights; {interval} (confidence 95 %)", name


def _worst(
    cases: Mapping[str, SafetyCase | str], *, impacts: bool
) -> Iterator[tuple[Thing, str, Nearness, float, int, int]]:
    """Yield for every thing where flights of all cases come nearest to it, the least that 99.7 % keep in any case, and
    how many of all flights come too near."""
    by_thing: dict[str, list[tuple[str, Nearness]]] = {}
    for name, case in cases.items():
        if isinstance(case, SafetyCase):
            for nearness in case.result.impacts if impacts else case.result.distances:
                by_thing.setdefault(nearness.thing.text, []).append((name, nearness))
    for nearnesses in by_thing.values():
        name, nearest = min(nearnesses, key=lambda item: item[1].least)
        kept = [nearness.kept for _, nearness in nearnesses if math.isfinite(nearness.kept)]
        counts = [nearness.nearer for _, nearness in nearnesses]
        too_near, of = sum(count.flights for count in counts), sum(count.of for count in counts)
        yield nearest.thing, name, nearest, min(kept, default=math.nan), too_near, of


def _nearest_table(cases: Mapping[str, SafetyCase | str], title: str) -> Table:
    columns = (
        *(Column("from"), Column("asked", "m", ".1f"), Column("least", "m", "z.1f")),
        *(Column("99.7 % keep", "m", "z.1f"), Column("too near", form="d"), Column("of", form="d"), Column("nearest")),
    )
    rows: list[tuple[str, float, float, float, int, int, str]] = [
        (thing.text, thing.required, nearest.least, kept, too_near, of, name)
        for thing, name, nearest, kept, too_near, of in _worst(cases, impacts=False)
    ]
    several = len(cases) > 1 and any(math.isfinite(row[3]) for row in rows)
    return Table(title, columns, rows, ["99.7 % keep: in the case in which that is least"] if several else [])


def _impacts_table(cases: Mapping[str, SafetyCase | str], title: str) -> Table:
    columns = (
        *(Column("impacts and"), Column("nearest", "m", "z.1f"), Column("99.7 % keep", "m", "z.1f")),
        *(Column("hit or beyond", form="d"), Column("of", form="d"), Column("in")),
    )
    rows = [
        [thing.text, nearest.least, kept, too_near, of, name]
        for thing, name, nearest, kept, too_near, of in _worst(cases, impacts=True)
    ]
    note = "from every tenth of a second of every flight; 0: on people; negative: beyond the line or border"
    return Table(title, columns, rows, [note] if rows else [])


def _closed_loop(case: SafetyCase) -> Iterator[Part]:
    counts = case.counts_table()
    yield table_part(replace(counts, title="What the flights break", notes=counts.notes[:2]))
    columns = (replace(COUNTS[0], name="pylon"), *COUNTS[1:], Column("nearest", "m", "z.2f"))
    rows = [
        [*count_row(name, count), least]
        for name, (count, least) in case.result.pylons.items()
        if not name.startswith("obstacle ")  # they stand among the distances
    ]
    yield table_part(Table("Flights that touch each pylon, and the least distance of any wing", columns, rows))
    yield table_part(case.gates_table())
    yield table_part(case.legs_table())


def _distances(cases: Mapping[str, SafetyCase | str], flight: Flight) -> Iterator[Part]:
    for name, case in cases.items():
        if isinstance(case, SafetyCase):
            table = case.distances_table()
            title = f"All flights, {name}" if len(cases) > 1 else table.title
            yield table_part(replace(table, title=title, notes=table.notes if name == next(iter(cases)) else ()))
    note = "Pylons and obstacles are measured from the wing, all else from the aircraft's centre."
    yield table_part(distance_table(flight, "Of the optimum alone", notes=[note]))
    course = flight.course
    kinds = (course.crowd, course.safety_lines, course.obstacles, course.airspace)
    missing = [
        name for name, count in zip(("crowd", "safety line", "obstacle", "airspace"), kinds, strict=True) if not count
    ]
    if missing:
        yield note_part(f"The course names no {', no '.join(missing)}.")


def _every(every: SafetyCase | SafetyRose | SafetyRuns) -> Iterator[Part]:
    if isinstance(every, SafetyCase):
        return
    cases = every.cases.values() if isinstance(every, SafetyRuns) else [every]
    notes = [IN_WINDS] if any(isinstance(case, SafetyRose) for case in cases) else []
    yield table_part(replace(every.table(), title="", notes=notes))


def _loads_table(flight: Flight) -> Table:
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
    return Table("How long load factors are sustained", columns, rows, [note])


def _falls(cases: Mapping[str, SafetyCase | str], footprint: Footprint, flight: Flight) -> Iterator[Part]:
    for name, case in cases.items():
        if isinstance(case, SafetyCase) and case.result.impacts:
            table = case.impacts_table()
            notes = table.notes if name == next(iter(cases)) else ()
            yield table_part(replace(table, title=f"All flights, {name}", notes=notes))
    yield table_part(replace(falls_table(footprint, flight), title="The longest ways over ground, of the optimum"))
    people, borders = people_table(footprint, flight), borders_table(footprint, flight)
    yield table_part(replace(people, title="Impacts of the optimum and people"))
    if borders.rows:
        yield table_part(replace(borders, title="Impacts of the optimum, lines and border"))
    yield list_part(footprint_facts(footprint, flight))
