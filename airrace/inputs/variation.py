"""The inputs of a run with one number changed: what `--set` would make of it, without reading the files again."""

from functools import cached_property

from airrace.errors import Finding, InputError, UsageError
from airrace.inputs.aircraft import build_aircraft
from airrace.inputs.aircraft_schema import AircraftEntry
from airrace.inputs.course import build_course
from airrace.inputs.document import Document
from airrace.inputs.inputs import Inputs, check_together
from airrace.inputs.nodes import MappingNode, Reporter, ScalarNode
from airrace.inputs.numbers import filled_in, numbers
from airrace.inputs.objects import is_of_objects
from airrace.inputs.overrides import PLACE, PREFIXED, Override, apply_overrides, parse_overrides
from airrace.inputs.places import Places
from airrace.inputs.schema import Schema
from airrace.inputs.shorthands import expanded
from airrace.inputs.surroundings import build_air
from airrace.inputs.track_schema import track_language
from airrace.inputs.validation import validate
from airrace.inputs.yaml_reader import read_yaml
from airrace.planning.race import Race

AIRCRAFT = "aircraft"
TRACK = "track"


class Variation:
    """Track and aircraft of inputs that are known to be without fault, read once and varied number by number."""

    def __init__(self, inputs: Inputs) -> None:
        """Read both documents.

        Raises:
            UsageError: one of them was built in Python, so that it has no keys.
        """
        if is_of_objects(inputs.track) or is_of_objects(inputs.aircraft):
            raise UsageError("numbers have keys in files alone: this course or its aircraft was built in Python")
        self._race = inputs.race
        self._track = _root(inputs.track, TRACK, track_language(), inputs.overrides)
        self._aircraft = _root(inputs.aircraft, AIRCRAFT, AircraftEntry, inputs.overrides)

    @cached_property
    def numbers(self) -> dict[str, float]:
        """The number behind every key that `--set` reaches in track and aircraft, with its present value.

        Numbers that the files leave to a preset or to the language are among them; limits that nobody sets are not.
        """
        findings: list[Finding] = []
        reporter = Reporter(self._track, findings)
        track, aircraft = (
            validate(track_language(), reporter),
            validate(AircraftEntry, Reporter(self._aircraft, findings)),
        )
        if track is None or aircraft is None:
            raise InputError(findings)
        return numbers(filled_in(track, reporter)) | numbers(aircraft, (AIRCRAFT,))

    def race(self, key: str, value: float) -> Race:
        """Return the race with one number set to another value.

        Args:
            key: the key that `--set` takes, e.g. `gates.g4.heading_deg` or `aircraft.airframe.mass_kg`.
            value: the value, in the unit of the key.

        Raises:
            InputError: the inputs do not allow this value.
        """
        first, *rest = key.split(".")
        findings: list[Finding] = []
        track = Reporter(self._track, findings)
        course, flown, air = self._race.course, self._race.aircraft, self._race.air
        if first in PREFIXED:
            reporter = Reporter(_with(self._aircraft, AIRCRAFT, rest, value), findings, prefix=f"{AIRCRAFT}.")
            entry = validate(AircraftEntry, reporter)
            flown = build_aircraft(entry, reporter) if entry else flown
        else:
            track = Reporter(_with(self._track, TRACK, [first, *rest], value), findings)
            entry = validate(track_language(), track)
            course = build_course(entry, track) if entry else course
            air = build_air(entry.environment, Places(entry.origin, track)) if entry else air
        if findings:
            raise InputError(findings)
        race = Race(course, flown, air)
        check_together(race, track)
        if findings:
            raise InputError(findings)
        return race


def _root(document: Document, kind: str, model: type[Schema], texts: tuple[str, ...]) -> MappingNode:
    """Return a document as a tree with the overrides of the run made and all shorthands written out."""
    findings: list[Finding] = []
    mine = [override for override in parse_overrides(texts, findings) if override.document == kind]
    root = read_yaml(document.path, document.text)
    if not isinstance(root, MappingNode):
        raise InputError([Finding(document.path, 0, 0, "", "must be a mapping")])
    changed = apply_overrides(root, mine, findings, lambda node: expanded(node, model))
    if findings:
        raise InputError(findings)
    return changed


def _with(root: MappingNode, kind: str, path: list[str], value: float) -> MappingNode:
    """Return the tree with one number changed or added; nothing of it is a shorthand any more."""
    findings: list[Finding] = []
    changed = apply_overrides(
        root, [Override(kind, tuple(path), ScalarNode(PLACE, value))], findings, lambda node: node
    )
    if findings:
        raise InputError(findings)
    return changed
