"""All inputs of a run, read, checked and built; all findings are reported at once."""

import dataclasses
import math
from collections.abc import Generator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import field
from itertools import groupby
from pathlib import Path

from airrace.errors import Finding, InputError
from airrace.files.inputs.aircraft import AircraftEntry, build_aircraft, weight_not_carried
from airrace.files.inputs.course_order import check_references
from airrace.files.inputs.document import AIRCRAFT, TRACKS, Collection, Document, read_document
from airrace.files.inputs.nodes import FINDINGS_MAX, JSON, QUOTE_MAX, MappingNode, Place, Reporter, ScalarNode, dotted
from airrace.files.inputs.objects import CourseAndAir, aircraft_of, course_and_air_of, is_of_objects, resolved_inputs
from airrace.files.inputs.overrides import PLACE, PREFIXED, apply_overrides, parse_overrides
from airrace.files.inputs.places import Places
from airrace.files.inputs.rules import ReserveEntry, check_reserve, penalties_of, pilot_name, read_preset, tighten
from airrace.files.inputs.schema import Schema, language_of, languages_of, read_mapping, validate
from airrace.files.inputs.settings import SettingsEntry, build_settings
from airrace.files.inputs.track import TrackEntry, build_course, track_language
from airrace.flights.results.penalties import NONE_KNOWN, Penalties
from airrace.model.aircraft import Aircraft
from airrace.model.dynamics.aerodynamics import lift_curve
from airrace.model.dynamics.limits import contradictions
from airrace.optimal_control.quantities import KNOT
from airrace.procedure.settings import Settings
from airrace.race import Race

NO_SETTINGS = Document("<no settings file>", f"schema: {language_of(SettingsEntry)}\n")
"""The document that stands for settings where no file was given: all defaults."""


@dataclasses.dataclass(frozen=True)
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
        reserve: what is asked of the flight in disturbances; None for nothing.
        margins: of the course, by key.
        remark: what a reader should know of the language of the track file; empty where there is nothing.
        pilot: whose limits a pilot keeps to: the name of a preset, `NAME, changed`, or `own`.
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
    reserve: ReserveEntry | None = None
    margins: Mapping[str, float] = field(default_factory=dict[str, float])
    remark: str = ""
    pilot: str = "none"


def load_inputs(
    track: str | Path | Document,
    *,
    aircraft: str | Path | Document | None = None,
    settings: str | Path | None = None,
    overrides: Sequence[str] = (),
) -> Inputs:
    """Read and check the files of a run; a document stands for a file that is read already.

    Args:
        track: the track file, or the name of a shipped course; it names the aircraft likewise, with a path relative to
            itself.
        aircraft: an aircraft file, or the name of a shipped aircraft, instead of the track's.
        settings: a settings file.
        overrides: `key=value`; keys are the track's, or with `aircraft.` or `settings.` before them those documents'.

    Raises:
        InputError: the inputs are not valid; it carries all findings.
    """
    reader = DocumentReader(overrides)
    parsed_track, aircraft_document = reader.track_and_aircraft(track, aircraft)
    settings_file = None if settings is None else read_document(Path(settings), reader.findings)
    return _inputs(reader, parsed_track, aircraft_document, settings_file)


def read_documents(
    track: Path, *, aircraft: Path | None = None, overrides: Sequence[str] = ()
) -> tuple[Document, Document]:
    """Return the texts of the track and of the aircraft that flies it, not validated yet.

    Args:
        track: see `load_inputs`; an override may name the aircraft, too.
        aircraft: see `load_inputs`.
        overrides: see `load_inputs`.

    Raises:
        InputError: one of them cannot be read, or the track is no YAML.
    """
    parsed_track, aircraft_document = DocumentReader(overrides).track_and_aircraft(track, aircraft)
    if parsed_track is None or aircraft_document is None:
        inputs = load_inputs(track, aircraft=aircraft, overrides=overrides)  # raises with all findings
        return inputs.track, inputs.aircraft
    return parsed_track.document, aircraft_document


def read_named(collection: Collection, name: str | Path | Document, findings: list[Finding]) -> Document | None:
    """Return the document at a path or of a name; a document is returned unchanged."""
    return name if isinstance(name, Document) else collection.read(Path(name), findings)


def inputs_from_documents(
    track: Document, aircraft: Document, settings_file: Document | None, overrides: Sequence[str]
) -> Inputs:
    """Check documents that are read already, for resuming a run; no file is touched.

    Raises:
        InputError: the inputs are not valid; it carries all findings.
    """
    reader = DocumentReader(overrides)
    return _inputs(reader, reader.open(track, "track"), aircraft, settings_file)


@dataclasses.dataclass(frozen=True)
class ParsedDocument:
    """A document that is YAML of the right schema, with the overrides made; one of objects has no keys at all."""

    document: Document
    reporter: Reporter


class DocumentReader:
    """A reader of all documents of a run, with the findings and overrides that they share."""

    def __init__(self, overrides: Sequence[str]) -> None:
        self.findings: list[Finding] = []
        self.texts = tuple(overrides)
        self._overrides = parse_overrides(overrides, self.findings)

    def open(self, document: Document | None, kind: str) -> ParsedDocument | None:
        """Read the YAML; return None if the document is missing or cannot be trusted to be what it should be.

        Args:
            document: what is to be read.
            kind: what it should be: `track`, `aircraft` or `settings`.
        """
        if document is None:
            return None
        overrides = [override for override in self._overrides if override.document == kind]
        if is_of_objects(document):
            message = "cannot be set here: this was built in Python, so change it there"
            for override in overrides:
                self.findings.append(Finding(PLACE.file, 0, 0, dotted(override.path), message))
            return ParsedDocument(document, Reporter(MappingNode(Place(document.path, 0, 0), {}), self.findings))
        models: dict[str, type[Schema]] = {"aircraft": AircraftEntry, "settings": SettingsEntry}
        model = models.get(kind) or track_language()
        with gather(self.findings):
            root = apply_overrides(read_mapping(document, model), overrides, self.findings, model)
            if kind in PREFIXED:
                reporter = Reporter(root, self.findings, prefix=f"{kind}.")
            else:
                reporter = Reporter(root, self.findings, other_prefixes=tuple(f"{name}." for name in PREFIXED))
            language, actual = language_of(model), root.scalar("schema")
            if actual in languages_of(model):
                return ParsedDocument(document, reporter)
            if "schema" in root.entries:
                reporter.value(("schema",), f"expected `schema: {language}`, found `{actual}`")
            else:
                reporter.key(("schema",), f"missing; the file must begin with `schema: {language}`")
        return None

    def track_and_aircraft(
        self, track: str | Path | Document, aircraft: str | Path | Document | None
    ) -> tuple[ParsedDocument | None, Document | None]:
        """Return the track, and the given aircraft or else the one that the track names; None for a missing one.

        A track names a file by its path relative to the track's folder, or a shipped aircraft.
        """
        parsed = self.open(read_named(TRACKS, track, self.findings), "track")
        if aircraft is not None:
            return parsed, read_named(AIRCRAFT, aircraft, self.findings)
        if parsed is None:
            return None, None
        if is_of_objects(parsed.document):
            message = "a course that was built in Python names no aircraft"
            self.findings.append(Finding(parsed.document.path, 0, 0, "", message))
            return parsed, None
        node = parsed.reporter.root.get("aircraft")
        if node is None:
            parsed.reporter.key(("aircraft",), "missing; name the aircraft file here, or give --aircraft FILE")
        if not isinstance(node, ScalarNode) or not isinstance(node.value, str):
            return parsed, None  # the schema reports what is no text
        folder = (Path(track.path) if isinstance(track, Document) else TRACKS.file(Path(track))).parent
        name = Path(node.value)
        if not AIRCRAFT.finds(name, folder):
            parsed.reporter.value(("aircraft",), AIRCRAFT.missing(name, folder))
            return parsed, None
        return parsed, AIRCRAFT.read(name, self.findings, folder)


@contextmanager
def gather(findings: list[Finding]) -> Generator[None]:
    """Add the findings of an InputError to others instead of raising it."""
    try:
        yield
    except InputError as error:
        findings.extend(error.findings)


def _inputs(
    reader: DocumentReader, track: ParsedDocument | None, aircraft: Document | None, settings_file: Document | None
) -> Inputs:
    """Validate and build all documents.

    Raises:
        InputError: the inputs are not valid; it carries all findings.
    """
    parsed_aircraft = reader.open(aircraft, "aircraft")
    parsed_settings = reader.open(settings_file or NO_SETTINGS, "settings")
    entry: TrackEntry | None = None
    course_and_air: CourseAndAir | None = None
    model: Aircraft | None = None
    settings: Settings | None = None
    with gather(reader.findings):
        if track and is_of_objects(track.document):
            course_and_air = course_and_air_of(track.document)
        elif track:
            entry = validate(track_language(), track.reporter)
            check_references(track.reporter)
            course_and_air = build_course_and_air(entry, track.reporter) if entry else None
    with gather(reader.findings):
        if parsed_aircraft and is_of_objects(parsed_aircraft.document):
            model = aircraft_of(parsed_aircraft.document)
        elif parsed_aircraft:
            model = read_aircraft(parsed_aircraft.reporter)
    if parsed_settings and (settings_entry := validate(SettingsEntry, parsed_settings.reporter)):
        settings = build_settings(settings_entry, parsed_settings.reporter)
    if track and aircraft and course_and_air and model and settings and not reader.findings:
        race = Race(course_and_air.course, model, course_and_air.air)
        if entry:
            check_reserve(entry.rules.reserve, entry.margins, race, track.reporter)
            race = tighten(race, entry.margins, track.reporter)
        check_together(race, track.reporter)
        if not reader.findings:
            passed = {passage.element.base_name for passage in race.course.passages}
            return Inputs(
                race=race,
                settings=settings,
                track=track.document,
                aircraft=aircraft,
                settings_file=settings_file,
                overrides=reader.texts,
                resolved=resolved_inputs(race, settings),
                penalties=penalties_of(entry.rules) if entry else NONE_KNOWN,
                unused_gates=tuple(name for name in entry.gates if name not in passed) if entry else (),
                reserve=entry.rules.reserve if entry else None,
                margins=entry.margins.by_key() if entry else {},
                remark=entry.remark if entry else "",
                pilot=pilot_name(course_and_air.course.rules.pilot, entry.pilot_preset if entry else "none"),
            )
    raise InputError(shorten(reader.findings), len(reader.findings))


def build_course_and_air(entry: TrackEntry, reporter: Reporter) -> CourseAndAir:
    """Return the course and the air of a track; valid only if nothing was reported."""
    return CourseAndAir(build_course(entry, reporter), entry.environment.build(Places(entry.origin, reporter)))


def read_aircraft(reporter: Reporter) -> Aircraft | None:
    """Return the aircraft of a document; valid only if nothing was reported."""
    entry = validate(AircraftEntry, reporter)
    return build_aircraft(entry, reporter) if entry else None


def shorten(findings: Sequence[Finding]) -> list[Finding]:
    """Return at most `FINDINGS_MAX` findings per document, sorted, and one more that counts the rest."""
    shortened: list[Finding] = []
    findings = [dataclasses.replace(finding, message=_with_short_quotes(finding.message)) for finding in findings]
    for _, group in groupby(sorted(findings), key=lambda finding: finding.file):
        of_file = list(group)
        shortened += of_file[:FINDINGS_MAX]
        if omitted := of_file[FINDINGS_MAX:]:
            shortened.append(dataclasses.replace(omitted[0], message=f"and {len(omitted)} more findings from here on"))
    return shortened


def _with_short_quotes(message: str) -> str:
    parts = message.split("`")  # every second part is quoted
    parts[1::2] = [part if len(part) <= QUOTE_MAX else part[:QUOTE_MAX] + "..." for part in parts[1::2]]
    return "`".join(parts)


def check_together(race: Race, track: Reporter) -> None:
    """Report in the track what this aircraft cannot do."""
    rules, aircraft = race.course.rules, race.aircraft
    start_speed, slowest = race.course.passages[0].speed.upper, aircraft.envelope.V.lower
    if start_speed <= slowest:
        track.value(
            ("rules", "start_speed_max_kt"),
            f"must be above {slowest / KNOT:.4g} kt, the least speed of {aircraft.name}; is {start_speed / KNOT:.4g}",
        )
    most = {"C_L_max": rules.C_L.upper}
    if math.isfinite(rules.alpha_A.upper):
        most["alpha_max_deg"] = float(lift_curve(rules.alpha_A.upper, aircraft.lift))
    for key, C_L in most.items():
        shortfall = "" if math.isinf(C_L) else weight_not_carried(aircraft, C_L)
        if shortfall:
            track.value(("rules", key), shortfall)
    for key, text in contradictions(aircraft, rules):
        track.value(("rules", *key.split(".")), text)
    gates = {passage.element.name: passage.element for passage in race.course.passages}
    pilot, n_z_max = rules.pilot, min(aircraft.envelope.n_z.upper, rules.n_z.upper)
    low = next((gate.name for gate in gates.values() if gate.heights.upper <= pilot.low_height), None)
    if pilot.n_z_low > n_z_max and low is not None:  # else it might be flown above that height
        text = f"must be at most {n_z_max:g}, the largest load factor, for `{low}` is passed near the ground; "
        track.value(("rules", "pilot", "n_z_min_low"), f"{text}is {pilot.n_z_low:g}")
    reported: set[str] = set()  # the passings of a quad share its numbers
    for gate in gates.values():
        misfit = gate.misfit(aircraft.airframe.b, aircraft.name)
        if misfit is not None and gate.base_name not in reported:
            reported.add(gate.base_name)
            key, text = misfit
            track.value(("gates", gate.base_name, key), text)


def sources_of(inputs: Inputs) -> tuple[tuple[str, str, str], ...]:
    """Return the sources of the numbers of course and aircraft, and of the rules of a season.

    They are what the numbers are of, the schema of their file, and where they come from.
    """
    sources: list[tuple[str, str, str]] = []
    reader = DocumentReader(inputs.overrides)
    for kind, document in (("track", inputs.track), ("aircraft", inputs.aircraft)):
        parsed = None if is_of_objects(document) else reader.open(document, kind)
        if parsed is None:
            sources.append((kind, "", "built in Python, not read from a file"))
            continue
        root = parsed.reporter.root
        source, rules = root.scalar("source"), root.get("rules")
        default = "the file names none as a whole; see the comments beside its numbers"
        sources.append((kind, str(root.scalar("schema")), str(source or default)))
        preset = rules.scalar("preset") if isinstance(rules, MappingNode) else root.scalar("rules")
        if preset:
            entry = read_preset(str(preset))
            sources.append((f"rules {preset}", entry.schema_, entry.source))
    return tuple(sources)
