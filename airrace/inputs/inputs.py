"""All inputs of a run, read, checked and understood; what is wrong is reported all at once."""

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from itertools import groupby
from pathlib import Path
from typing import TypeVar

from airrace.aircraft.aircraft import Aircraft
from airrace.errors import Finding, InputError
from airrace.inputs.aircraft import AIRCRAFT_SCHEMA, AircraftEntry, build_aircraft, weight_not_carried
from airrace.inputs.course_order import check_references
from airrace.inputs.document import AIRCRAFT, TRACKS, Collection, Document, read_document
from airrace.inputs.nodes import JSON, MappingNode, Place, Reporter, ScalarNode, dotted
from airrace.inputs.objects import CourseAndAir, aircraft_of, course_and_air_of, is_of_objects, resolved_inputs
from airrace.inputs.overrides import PLACE, PREFIXED, apply_overrides, parse_overrides
from airrace.inputs.places import Places
from airrace.inputs.rules import penalties_of
from airrace.inputs.schema import Schema
from airrace.inputs.settings import SETTINGS_SCHEMA, SettingsEntry, build_settings
from airrace.inputs.track import TRACK_SCHEMA, build_course, track_language
from airrace.inputs.validation import read_mapping, validate
from airrace.logs.violations import NONE_KNOWN, Penalties
from airrace.planning.race import Race
from airrace.procedure.settings import Settings
from airrace.quantities import KNOT
from airrace.records import record

FINDINGS_MAX = 100
"""The largest number of findings that are reported for one document."""
BUILT_IN_PYTHON = "cannot be set here: this was built in Python, so change it there"
"""The message for an override of a document that was built in Python."""
QUOTED_MAX = 100
"""The largest number of characters of a quoted word in a message."""
NO_SETTINGS = Document("<no settings file>", f"schema: {SETTINGS_SCHEMA}\n")
"""The document that stands for settings where no file was given: all defaults."""

T = TypeVar("T")


@record
class Inputs:
    """The inputs of a run, as documents and as objects.

    Attributes:
        race: course, aircraft and air.
        settings: how it is solved.
        track, aircraft, settings_file: the documents as they were read.
        overrides: the `key=value` texts of the command line.
        resolved: everything as understood, plain and JSON-able, SI and radians, defaults filled in; an absent limit
            (an infinity) is null.
        penalties: of the season whose rules the course names; no optimum depends on them.
        unused_gates: gates that stand in the track file and in no lap, in its order.
    """

    race: Race
    settings: Settings
    track: Document
    aircraft: Document
    settings_file: Document | None
    overrides: tuple[str, ...]
    resolved: Mapping[str, JSON]
    penalties: Penalties = NONE_KNOWN
    unused_gates: tuple[str, ...] = ()


def load_inputs(
    track: str | Path | Document,
    *,
    aircraft: str | Path | Document | None = None,
    settings: str | Path | None = None,
    overrides: Sequence[str] = (),
) -> Inputs:
    """Read and check the files of a run; a document stands for a file that is read already.

    Args:
        track: the track file, or the name of a course that comes along; it names the aircraft likewise, with a path
            relative to itself.
        aircraft: an aircraft file, or the name of one that comes along, instead of the track's.
        settings: a settings file.
        overrides: `key=value`; keys are the track's, or with `aircraft.` or `settings.` before them those documents'.

    Raises:
        InputError: the inputs are not valid; it carries all findings.
    """
    run = _Run(overrides)
    opened_track = run.open(read_named(TRACKS, track, run.findings), _TRACK)
    if aircraft is not None:
        aircraft_document = read_named(AIRCRAFT, aircraft, run.findings)
    else:
        beside = Path(track.path) if isinstance(track, Document) else TRACKS.file(Path(track))
        aircraft_document = _referenced_aircraft(beside.parent, opened_track, run.findings)
    opened_aircraft = run.open(aircraft_document, _AIRCRAFT)
    settings_document = read_document(Path(settings), run.findings) if settings is not None else None
    return run.inputs(opened_track, opened_aircraft, settings_document)


def read_documents(
    track: Path, *, aircraft: Path | None = None, overrides: Sequence[str] = ()
) -> tuple[Document, Document]:
    """Return the track and the aircraft that flies it as texts, of which nothing else is understood yet.

    Args:
        track: see `load_inputs`; an override may name the aircraft, too.
        aircraft: see `load_inputs`.
        overrides: see `load_inputs`.

    Raises:
        InputError: one of them cannot be read, or the track is no YAML.
    """
    run = _Run(overrides)
    opened = run.open(TRACKS.read(track, run.findings), _TRACK)
    if aircraft is None:
        flown = _referenced_aircraft(TRACKS.file(track).parent, opened, run.findings)
    else:
        flown = AIRCRAFT.read(aircraft, run.findings)
    if opened is None or flown is None:
        inputs = load_inputs(track, aircraft=aircraft, overrides=overrides)  # raises with all findings
        return inputs.track, inputs.aircraft
    return opened.document, flown


def read_named(collection: Collection, named: str | Path | Document, findings: list[Finding]) -> Document | None:
    """Return the document that a path or a name stands for; a document is handed back as it is."""
    return named if isinstance(named, Document) else collection.read(Path(named), findings)


def inputs_from_documents(
    track: Document, aircraft: Document, settings_file: Document | None, overrides: Sequence[str]
) -> Inputs:
    """Understand and check documents that are read already, for resuming a run; no file is touched.

    Raises:
        InputError: the inputs are not valid; it carries all findings.
    """
    run = _Run(overrides)
    opened_track = run.open(track, _TRACK)
    opened_aircraft = run.open(aircraft, _AIRCRAFT)
    return run.inputs(opened_track, opened_aircraft, settings_file)


@record
class _Language:
    """A kind of document: what the command line calls it, how it begins, what it holds."""

    kind: str
    schema: str
    model: Callable[[], type[Schema]]


_TRACK = _Language("track", TRACK_SCHEMA, track_language)
_AIRCRAFT = _Language("aircraft", AIRCRAFT_SCHEMA, lambda: AircraftEntry)
_SETTINGS = _Language("settings", SETTINGS_SCHEMA, lambda: SettingsEntry)


@record
class _Opened:
    """A document that is YAML of the right schema, with the overrides made."""

    document: Document
    reporter: Reporter


class _Run:
    """A reading of all documents of a run, with the findings and overrides that they share."""

    def __init__(self, overrides: Sequence[str]) -> None:
        self.findings: list[Finding] = []
        self._texts = tuple(overrides)
        self._penalties = NONE_KNOWN
        self._gates: tuple[str, ...] = ()
        self._overrides = parse_overrides(overrides, self.findings)

    def open(self, document: Document | None, language: _Language) -> _Opened | None:
        """Read the YAML; return None if the document is missing or cannot be trusted to be what it should be."""
        if document is None:
            return None
        mine = [override for override in self._overrides if override.document == language.kind]
        if is_of_objects(document):
            keys = [dotted(one.path) for one in mine]
            self.findings.extend(Finding(PLACE.file, 0, 0, key, BUILT_IN_PYTHON) for key in keys)
            return _Opened(document, Reporter(MappingNode(Place(document.path, 0, 0), {}), self.findings))
        try:
            root = read_mapping(document, language.schema)
        except InputError as error:
            self.findings.extend(error.findings)
            return None
        changed = apply_overrides(root, mine, self.findings, language.model())
        own = language.kind in PREFIXED
        reporter = Reporter(
            changed,
            self.findings,
            prefix=f"{language.kind}." if own else "",
            others=() if own else tuple(f"{kind}." for kind in PREFIXED),
        )
        return _Opened(document, reporter) if _has_schema(reporter, language.schema) else None

    def inputs(self, track: _Opened | None, aircraft: _Opened | None, settings_file: Document | None) -> Inputs:
        """Understand all documents.

        Raises:
            InputError: the inputs are not valid; it carries all findings.
        """
        opened_settings = self.open(settings_file or NO_SETTINGS, _SETTINGS)
        scene = self._course_and_air(track) if track else None
        flown = self._aircraft(aircraft) if aircraft else None
        settings_entry = validate(SettingsEntry, opened_settings.reporter) if opened_settings else None
        settings = (
            build_settings(settings_entry, opened_settings.reporter) if opened_settings and settings_entry else None
        )
        if self.findings or not (track and aircraft and scene and flown and settings):
            raise InputError(shorten(self.findings), len(self.findings))
        race = Race(scene.course, flown, scene.air)
        check_together(race, track.reporter)
        passed = {passage.element.base_name for passage in race.course.passages}
        if self.findings:
            raise InputError(shorten(self.findings), len(self.findings))
        return Inputs(
            race=race,
            settings=settings,
            track=track.document,
            aircraft=aircraft.document,
            settings_file=settings_file,
            overrides=self._texts,
            resolved=resolved_inputs(race, settings),
            penalties=self._penalties,
            unused_gates=tuple(name for name in self._gates if name not in passed),
        )

    def _course_and_air(self, track: _Opened) -> CourseAndAir | None:
        """Return the course and the air of a track."""
        if is_of_objects(track.document):
            return self._read(course_and_air_of, track.document)
        entry = validate(track_language(), track.reporter)
        check_references(track.reporter)
        if entry is None:
            return None
        course = build_course(entry, track.reporter)
        self._penalties, self._gates = penalties_of(entry.rules), tuple(entry.gates)
        return CourseAndAir(course, entry.environment.build(Places(entry.origin, track.reporter)))

    def _aircraft(self, aircraft: _Opened) -> Aircraft | None:
        if is_of_objects(aircraft.document):
            return self._read(aircraft_of, aircraft.document)
        entry = validate(AircraftEntry, aircraft.reporter)
        return build_aircraft(entry, aircraft.reporter) if entry else None

    def _read(self, read: Callable[[Document], T], document: Document) -> T | None:
        """Return the objects of a document, and add what is wrong to the findings."""
        try:
            return read(document)
        except InputError as error:
            self.findings.extend(error.findings)
            return None


def shorten(findings: Sequence[Finding]) -> list[Finding]:
    """Return at most `FINDINGS_MAX` findings per document, in its order.

    Where there are more, one more finding says how many.
    """
    kept: list[Finding] = []
    findings = [dataclasses.replace(one, message=_with_short_quotes(one.message)) for one in findings]
    for _, group in groupby(sorted(findings), key=lambda finding: finding.file):
        mine = list(group)
        kept.extend(mine[:FINDINGS_MAX])
        if len(mine) > FINDINGS_MAX:
            rest = len(mine) - FINDINGS_MAX
            kept.append(dataclasses.replace(mine[FINDINGS_MAX], message=f"and {rest} more findings from here on"))
    return kept


def _with_short_quotes(message: str) -> str:
    parts = message.split("`")  # every second part is quoted
    parts[1::2] = [part if len(part) <= QUOTED_MAX else part[:QUOTED_MAX] + "..." for part in parts[1::2]]
    return "`".join(parts)


def _has_schema(reporter: Reporter, schema: str) -> bool:
    """Return whether the document says it is what is expected; nothing else is worth checking if it does not."""
    found = reporter.root.scalar("schema")
    if found == schema:
        return True
    if "schema" not in reporter.root.entries:
        reporter.key(("schema",), f"missing; the file must begin with `schema: {schema}`")
    else:
        reporter.value(("schema",), f"expected `schema: {schema}`, found `{found}`")
    return False


def _referenced_aircraft(folder: Path, opened: _Opened | None, findings: list[Finding]) -> Document | None:
    """Return the document of the aircraft that a track names.

    The name is that of a file, by a path relative to the track's folder, or that of an aircraft that comes along.
    """
    if opened is None:
        return None
    if is_of_objects(opened.document):
        findings.append(Finding(opened.document.path, 0, 0, "", "a course that was built in Python names no aircraft"))
        return None
    node = opened.reporter.root.get("aircraft")
    if node is None:
        opened.reporter.key(("aircraft",), "missing; name the aircraft file here, or give --aircraft FILE")
        return None
    if not isinstance(node, ScalarNode) or not isinstance(node.value, str):
        return None  # the schema reports it
    named = Path(node.value)
    if not AIRCRAFT.finds(named, folder):
        opened.reporter.value(("aircraft",), AIRCRAFT.missing(named, folder))
        return None
    return AIRCRAFT.read(named, findings, folder)


def check_together(race: Race, track: Reporter) -> None:
    """Report in the track what this aircraft cannot do."""
    rules, aircraft = race.course.rules, race.aircraft
    start_speed, slowest = race.course.passages[0].speed.upper, aircraft.envelope.V.lower
    if start_speed <= slowest:
        track.value(
            ("rules", "start_speed_max_kt"),
            f"must be above {slowest / KNOT:.4g} kt, the least speed of {aircraft.name}; is {start_speed / KNOT:.4g}",
        )
    shortfall = "" if math.isinf(rules.C_L.upper) else weight_not_carried(aircraft, rules.C_L.upper)
    if shortfall:
        track.value(("rules", "C_L_max"), shortfall)
    gates = {passage.element.name: passage.element for passage in race.course.passages}
    remarked: set[str] = set()
    for gate in gates.values():
        name, misfit = gate.base_name, gate.misfit(aircraft.airframe.b, aircraft.name)
        if misfit is not None and name not in remarked:
            key, text = misfit
            track.value(("gates", name, key), text)
            remarked.add(name)
