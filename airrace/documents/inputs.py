"""All inputs of a run: read, checked, understood; what is wrong is said all at once."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path

from airrace.documents.aircraft import build_aircraft
from airrace.documents.aircraft_schema import AIRCRAFT_SCHEMA, AircraftEntry
from airrace.documents.consistency import check_together
from airrace.documents.course import build_course
from airrace.documents.document import Document, missing_file, read_document
from airrace.documents.nodes import JSON, Entry, MappingNode, Reporter, ScalarNode
from airrace.documents.overrides import PREFIXED, apply_overrides, parse_overrides
from airrace.documents.places import Places
from airrace.documents.references import check_references
from airrace.documents.resolved import resolved_inputs
from airrace.documents.schema import Schema
from airrace.documents.settings import SETTINGS_SCHEMA, SettingsEntry, build_settings
from airrace.documents.shorthands import expanded
from airrace.documents.track_schema import TRACK_SCHEMA, track_language
from airrace.documents.validation import validate
from airrace.documents.weather import build_air
from airrace.documents.yaml_reader import read_yaml
from airrace.errors import Finding, InputError
from airrace.planning.race import Race
from airrace.procedure.settings import Settings

FINDINGS_MAX = 100
"""So many findings are told of one document."""
QUOTED_MAX = 100
"""So many characters of a quoted word are told."""
NO_SETTINGS = Document("<no settings file>", f"schema: {SETTINGS_SCHEMA}\n")


@dataclass(frozen=True)
class Inputs:
    """What a run is given.

    Attributes:
        race: course, aircraft and air.
        settings: how it is solved.
        track, aircraft, settings_file: the documents as they were read.
        overrides: the `key=value` texts of the command line.
        resolved: everything as understood, plain and JSON-able, SI and radians, defaults filled in; an absent limit
            (an infinity) is null.
    """

    race: Race
    settings: Settings
    track: Document
    aircraft: Document
    settings_file: Document | None
    overrides: tuple[str, ...]
    resolved: Mapping[str, JSON]


def load_inputs(
    track: Path, *, aircraft: Path | None = None, settings: Path | None = None, overrides: Sequence[str] = ()
) -> Inputs:
    """Read and check the files of a run.

    Args:
        track: the track file; it names the aircraft file by a path relative to itself.
        aircraft: an aircraft file instead of the track's.
        settings: a settings file.
        overrides: `key=value`; keys are the track's, or with `aircraft.` or `settings.` before them those documents'.

    Raises:
        InputError: with all findings.
    """
    run = _Run(overrides)
    opened_track = run.open(read_document(track, run.findings), _TRACK)
    if aircraft is not None:
        aircraft_document = read_document(aircraft, run.findings)
    else:
        aircraft_document = _referenced_aircraft(track, opened_track, run.findings)
    opened_aircraft = run.open(aircraft_document, _AIRCRAFT)
    settings_document = read_document(settings, run.findings) if settings is not None else None
    return run.inputs(opened_track, opened_aircraft, settings_document)


def read_documents(
    track: Path, *, aircraft: Path | None = None, overrides: Sequence[str] = ()
) -> tuple[Document, Document]:
    """The track and the aircraft that flies it as texts; nothing else is understood of them yet.

    Args:
        track: the track file; it (or an override) names the aircraft file by a path relative to itself.
        aircraft: an aircraft file instead of the track's.
        overrides: as of `load_inputs`.

    Raises:
        InputError: one of them cannot be read, or the track is no YAML.
    """
    run = _Run(overrides)
    opened = run.open(read_document(track, run.findings), _TRACK)
    flown = (
        _referenced_aircraft(track, opened, run.findings) if aircraft is None else read_document(aircraft, run.findings)
    )
    if opened is None or flown is None:
        inputs = load_inputs(track, aircraft=aircraft, overrides=overrides)  # raises, with all there is to say
        return inputs.track, inputs.aircraft
    return opened.document, flown


def inputs_from_documents(
    track: Document, aircraft: Document, settings_file: Document | None, overrides: Sequence[str]
) -> Inputs:
    """The same from texts alone, for resuming a run; no file is touched.

    Raises:
        InputError: with all findings.
    """
    run = _Run(overrides)
    opened_track = run.open(track, _TRACK)
    opened_aircraft = run.open(aircraft, _AIRCRAFT)
    return run.inputs(opened_track, opened_aircraft, settings_file)


@dataclass(frozen=True)
class _Language:
    """One kind of document: what the command line calls it, how it begins, what it holds."""

    kind: str
    schema: str
    model: Callable[[], type[Schema]]


_TRACK = _Language("track", TRACK_SCHEMA, track_language)
_AIRCRAFT = _Language("aircraft", AIRCRAFT_SCHEMA, lambda: AircraftEntry)
_SETTINGS = _Language("settings", SETTINGS_SCHEMA, lambda: SettingsEntry)


@dataclass(frozen=True)
class _Opened:
    """A document that is YAML of the right schema, with the overrides made."""

    document: Document
    reporter: Reporter


class _Run:
    """The findings and overrides that all documents of a run share."""

    def __init__(self, overrides: Sequence[str]) -> None:
        self.findings: list[Finding] = []
        self._texts = tuple(overrides)
        self._overrides = parse_overrides(overrides, self.findings)

    def open(self, document: Document | None, language: _Language) -> _Opened | None:
        """Read the YAML; None if the document is missing or cannot be trusted to be what it should be."""
        if document is None:
            return None
        try:
            root = read_yaml(document.path, document.text)
        except InputError as error:
            self.findings.extend(error.findings)
            return None
        if not isinstance(root, MappingNode):
            place = root.place
            message = f"must be a mapping that begins with `schema: {language.schema}`"
            self.findings.append(Finding(document.path, place.line, place.column, "", message))
            return None
        mine = [override for override in self._overrides if override.document == language.kind]
        changed = apply_overrides(root, mine, self.findings, lambda node: expanded(node, language.model()))
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
            InputError: with all findings.
        """
        opened_settings = self.open(settings_file or NO_SETTINGS, _SETTINGS)
        track_entry = validate(track_language(), track.reporter) if track else None
        aircraft_entry = validate(AircraftEntry, aircraft.reporter) if aircraft else None
        settings_entry = validate(SettingsEntry, opened_settings.reporter) if opened_settings else None
        if track:
            check_references(track.reporter)
        course = build_course(track_entry, track.reporter) if track and track_entry else None
        air = (
            build_air(track_entry.environment, Places(track_entry.origin, track.reporter))
            if track and track_entry
            else None
        )
        flown = build_aircraft(aircraft_entry, aircraft.reporter) if aircraft and aircraft_entry else None
        settings = (
            build_settings(settings_entry, opened_settings.reporter) if opened_settings and settings_entry else None
        )
        if self.findings or not (track and aircraft and course and air and flown and settings):
            raise InputError(told(self.findings))
        race = Race(course, flown, air)
        check_together(race, track.reporter)
        if self.findings:
            raise InputError(told(self.findings))
        return Inputs(
            race=race,
            settings=settings,
            track=track.document,
            aircraft=aircraft.document,
            settings_file=settings_file,
            overrides=self._texts,
            resolved=resolved_inputs(race, settings),
        )


def told(findings: Sequence[Finding]) -> list[Finding]:
    """At most `FINDINGS_MAX` findings per document, in its order; then one that says how many there are besides."""
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
    parts = message.split("`")  # every second one is quoted
    parts[1::2] = [part if len(part) <= QUOTED_MAX else part[:QUOTED_MAX] + "..." for part in parts[1::2]]
    return "`".join(parts)


def _has_schema(reporter: Reporter, schema: str) -> bool:
    """Whether the document says it is what is expected; nothing else is worth checking if it does not."""
    found = reporter.root.scalar("schema")
    if found == schema:
        return True
    if "schema" not in reporter.root.entries:
        reporter.key(("schema",), f"missing; the file must begin with `schema: {schema}`")
    else:
        reporter.value(("schema",), f"expected `schema: {schema}`, found `{found}`")
    return False


def _referenced_aircraft(track: Path, opened: _Opened | None, findings: list[Finding]) -> Document | None:
    """The aircraft file the track names, by a path relative to the track."""
    if opened is None:
        return None
    entry: Entry | None = opened.reporter.root.entries.get("aircraft")
    if entry is None:
        opened.reporter.key(("aircraft",), "missing; name the aircraft file here, or give --aircraft FILE")
        return None
    if not isinstance(entry.value, ScalarNode) or not isinstance(entry.value.value, str):
        return None  # the schema reports it
    path = track.parent / entry.value.value
    if not path.is_file():
        opened.reporter.value(("aircraft",), missing_file(path))
        return None
    return read_document(path, findings)
