"""Courses before the race: the shipped ones, a new file to begin with, and the check of a course."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from importlib import resources
from pathlib import Path

from airrace.errors import Finding, InputError, UsageError
from airrace.files.inputs import Inputs, load_inputs
from airrace.files.inputs.course_import import sketch_course
from airrace.files.inputs.document import AIRCRAFT, SUFFIX, TRACKS, Document
from airrace.files.inputs.import_sketch import ImportRemark
from airrace.files.inputs.json_schema import schema_text
from airrace.files.inputs.placemarks import read_placemark_file
from airrace.files.inputs.rules import preset_names
from airrace.flights.results import Flight
from airrace.flights.results.clearances import Clearance
from airrace.flights.results.planned import plan_clearances, planned_flight, remarks_on_line
from airrace.pages.views.course_figure import course_figure
from airrace.pages.views.course_page import course_object, course_page
from airrace.pages.views.drawing import ensure_drawable, save_figure
from airrace.pages.views.map_model import MapModel, map_model
from airrace.procedure.planning.lint import Remark, RemarkKind, forgotten_lines, in_order, review
from airrace.race import Race
from airrace.runs.aircraft_file import read_aircraft_file
from airrace.runs.json_objects import planned_object
from airrace.runs.output import ensure_file_name, ensure_free, write_text
from airrace.runtime.standard_streams import STANDARD, name_of


@dataclass(frozen=True)
class ShippedTrack:
    """A shipped course.

    Attributes:
        name: what it is called in commands and in Python.
        title: its name as the file gives it.
        passages: passings of the whole race, start and finish included.
        laps: laps of the race.
        aircraft: the aircraft that its file names.
    """

    name: str
    title: str
    passages: int
    laps: int
    aircraft: str


@dataclass(frozen=True)
class ShippedAircraft:
    """A shipped aircraft: its name, its name as the file gives it, and its mass (kg)."""

    name: str
    title: str
    mass: float


@dataclass(frozen=True)
class Catalogue:
    """All shipped inputs; `rules` are the names that a track file's `rules` may give."""

    tracks: tuple[ShippedTrack, ...]
    aircraft: tuple[ShippedAircraft, ...]
    rules: tuple[str, ...]

    def as_object(self) -> dict[str, object]:
        """Return all that is listed as plain values, for JSON."""
        return {
            "tracks": [asdict(track) for track in self.tracks],
            "aircraft": [
                {"name": aircraft.name, "title": aircraft.title, "mass_kg": aircraft.mass} for aircraft in self.aircraft
            ],
            "rules": list(self.rules),
        }


def catalogue() -> Catalogue:
    """Read the shipped courses and aircraft, and aircraft of installed packages, each by name."""
    return Catalogue(tuple(map(_track, TRACKS.names)), tuple(map(_aircraft, AIRCRAFT.names)), preset_names())


def _track(name: str) -> ShippedTrack:
    inputs = load_inputs(TRACKS.named(name))  # not a file of that name in the current folder
    course = inputs.race.course
    laps = max(passage.lap for passage in course.passages)
    return ShippedTrack(name, course.name, len(course.passages), laps, Path(inputs.aircraft.path).stem)


def _aircraft(name: str) -> ShippedAircraft:
    aircraft = read_aircraft_file(AIRCRAFT.named(name)).aircraft
    return ShippedAircraft(name, aircraft.name, aircraft.airframe.m)


TEMPLATE = resources.files("airrace.files.inputs") / "templates" / "course.yaml"
SCHEMA_FILE = "track.schema.json"
"""The name of the file that holds the JSON Schema of tracks."""
EDITORS_LINE = "# yaml-language-server: $schema="
"""The line that names the schema of a file to editors, up to the path."""


@dataclass(frozen=True)
class CourseFile:
    """A track file that was written.

    Attributes:
        path: of the file.
        remarks: on the placemarks from which it was sketched.
        faults: of the file, for which `check` refuses it; empty where it can be flown.
    """

    path: Path
    remarks: tuple[ImportRemark, ...] = ()
    faults: tuple[Finding, ...] = ()

    @property
    def tasks(self) -> tuple[str, ...]:
        """What is to be put right before the course can be flown, one line each."""
        return tuple(f"to be put right: {fault.key}: {fault.message}" for fault in self.faults)

    def as_object(self) -> dict[str, list[dict[str, str]]]:
        """Return guesses, placemarks that are not taken over, and what is to be put right as plain values, for JSON."""
        guessed = [asdict(remark) for remark in self.remarks if remark.taken_as]
        omitted = [remark for remark in self.remarks if not remark.taken_as]
        not_taken_over = [{"name": remark.name, "form": remark.form, "reason": remark.reason} for remark in omitted]
        faults = [{"key": fault.key, "message": fault.message} for fault in self.faults]
        return {"guessed": guessed, "not_taken_over": not_taken_over, "to_put_right": faults}


def init(
    name: str | Path,
    *,
    like: str | Path | None = None,
    from_: str | Path | None = None,
    yes: bool = False,
    force: bool = False,
) -> Path:
    """Write a track file to begin with, and beside it the schema by which editors complete its keys.

    Args:
        name: the name of the new file; `.yaml` is added where it is missing.
        like: a shipped course, or a file, to be copied; None for a short course with a comment on every part.
        from_: a file of placemarks (KML, KMZ, GPX, GeoJSON, OpenAir or SeeYou CUP) from which the course is sketched;
            None for none. The last lines of the file tell its guesses, what is not taken over, and what is to be put
            right before the course can be flown.
        yes: whether placemarks may be left out that are, or may be, people or safety lines.
        force: whether existing files are overwritten. A schema that is already what it should be is none of them.

    Returns:
        The path of the file.

    Raises:
        UsageError: a file exists and `force` is not given, or is read; the name is one of a folder; or a course is to
            be copied and to be sketched.
        InputError: there is no such course to be copied, or the placemarks make none; or some that may keep aircraft
            from people would be left out, and `yes` is not given.
        StorageError: the folder does not exist or takes no files.
    """
    return begin_course(name, like=like, from_=from_, yes=yes, force=force).path


def begin_course(
    name: str | Path,
    *,
    like: str | Path | None = None,
    from_: str | Path | None = None,
    yes: bool = False,
    force: bool = False,
) -> CourseFile:
    """Write a track file as `init` does; return it with the remarks on it."""
    path = Path(name)
    ensure_file_name(path)
    path = path if path.suffix == SUFFIX or path == STANDARD else path.with_name(path.name + SUFFIX)
    if like is not None and from_ is not None:
        raise UsageError("a course is copied or sketched from placemarks; leave one of them out")
    ensure_free(path, force=force, sources=[like, from_])
    schema, schema_file = schema_text("track"), path.with_name(SCHEMA_FILE)
    schema_is_written = path == STANDARD or _holds(schema_file, schema)
    if not schema_is_written:
        ensure_free(schema_file, force=force, hint="it is not the schema of this version; ", sources=[like, from_])
    remarks: tuple[ImportRemark, ...] = ()
    if from_ is not None:
        sketched = sketch_course(name_of(Path(from_)), _title(path), read_placemark_file(Path(from_)))
        if sketched.lost and not yes:
            raise InputError(_losses(name_of(Path(from_)), sketched.lost))
        text, remarks = sketched.text, sketched.remarks
    else:
        text = _text_of(Path(like)) if like is not None else _begun(path)
    if EDITORS_LINE not in text and path != STANDARD:
        text = f"{EDITORS_LINE}{SCHEMA_FILE}\n{text}"
    course = CourseFile(path, remarks, () if from_ is None else _faults(path, text))
    text += "".join(f"# {task}\n" for task in course.tasks)
    if not schema_is_written:
        write_text(schema_file, schema)
    write_text(path, text)
    return course


def _losses(path: str, lost: Sequence[ImportRemark]) -> list[Finding]:
    """Return findings on placemarks without which aircraft may fly over people."""
    advice = "name it as what it is (crowd, safety line, obstacle, ...), or leave it out with --yes"
    return [
        Finding(path, 0, 0, "", f"'{remark.name}', {remark.form}, would be left out: {remark.reason}; {advice}")
        for remark in lost
    ]


def _faults(path: Path, text: str) -> tuple[Finding, ...]:
    """Return the findings for which a track file is refused."""
    try:
        load_inputs(Document(str(path), text))
    except InputError as error:
        return tuple(error.findings)
    return ()


def _holds(path: Path, text: str) -> bool:
    """Return whether there is a file of exactly this text."""
    try:
        return path.read_bytes() == text.encode()
    except OSError:
        return False


def _title(path: Path) -> str:
    return ("course" if path == STANDARD else path.stem).replace("_", " ").capitalize()


def _begun(path: Path) -> str:
    quoted = "'" + _title(path).replace("'", "''") + "'"  # it might be a number or a truth value
    return TEMPLATE.read_text(encoding="utf-8").replace("{file}", path.name).replace("{name}", quoted)


def _text_of(like: Path) -> str:
    findings: list[Finding] = []
    document = TRACKS.read(like, findings)
    if document is None:
        raise InputError(findings)
    return document.text


@dataclass(frozen=True, eq=False, repr=False)
class CourseCheck:
    """A course that is valid, and what a race director would ask about it.

    Attributes:
        inputs: what a run would be given.
        planned: the flight as which the race is planned, before anything is optimised; what is drawn and measured.
        warnings: remarks of the review; the course is valid with them.
    """

    inputs: Inputs
    planned: Flight
    warnings: tuple[Remark, ...]

    @property
    def race(self) -> Race:
        """The race: course, aircraft and air."""
        return self.inputs.race

    @cached_property
    def map_model(self) -> MapModel:
        """The course from above, with the line of the planned flight."""
        return map_model(self.race, self.planned)

    @cached_property
    def clearances(self) -> tuple[Clearance, ...]:
        """The least distances of the planned flight from everything that the course names."""
        return plan_clearances(self.planned)

    def draw(self, path: str | Path) -> Path:
        """Draw the course from above into a file.

        Args:
            path: its name ends in `.png`, `.svg` or `.pdf`; a file that exists is replaced.

        Returns:
            The path.

        Raises:
            UsageError: the name says no known format, or matplotlib is not installed.
            StorageError: the system refused.
        """
        ensure_drawable(Path(path))
        save_figure(course_figure(self.map_model), Path(path))
        return Path(path)

    def as_object(self) -> dict[str, object]:
        """Return what `airrace check --json` prints of the course."""
        return {**course_object(self.race, self.warnings), "planned": planned_object(self.planned, self.clearances)}

    def __repr__(self) -> str:
        course, count = self.race.course, len(self.warnings)
        passages = f"{len(course.passages)} passages"
        return f"<CourseCheck {course.name}: {passages}, {count} warning{'' if count == 1 else 's'}>"

    def _repr_html_(self) -> str:
        return course_page(self.map_model, [remark.text for remark in self.warnings])


def check_course(inputs: Inputs) -> CourseCheck:
    """Review a course as a race director would."""
    unused = (
        Remark("", RemarkKind.ELEMENT, f"no lap passes the gate `{name}`: is its name missing in `course`?")
        for name in inputs.unused_gates
    )
    flight = planned_flight(inputs.race)
    course = inputs.race.course
    remarks = in_order([*review(inputs.race), *forgotten_lines(course), *remarks_on_line(flight)], course)
    language = (Remark("", RemarkKind.LANGUAGE, inputs.remark),) if inputs.remark else ()
    return CourseCheck(inputs, flight, (*language, *unused, *remarks))
