"""The inputs of a run with one number changed: what `--set` would make of it, without reading the files again."""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import cached_property, partial
from typing import TypeVar, cast

from airrace.errors import Finding, InputError, UsageError
from airrace.files.inputs.aircraft import AircraftEntry, PublishedEntry
from airrace.files.inputs.inputs import DocumentReader, Inputs, build_course_and_air, check_together, read_aircraft
from airrace.files.inputs.kinds.kind import GateDefaultsEntry, KindEntry, PassingEntry, height_band
from airrace.files.inputs.nodes import KeyPath, Reporter, ScalarNode, dotted
from airrace.files.inputs.overrides import PLACE, PREFIXED, Override, apply_overrides
from airrace.files.inputs.rules import LimitsEntry, ReserveEntry, tighten, with_preset
from airrace.files.inputs.schema import Schema, validate
from airrace.files.inputs.track import TrackEntry, track_language
from airrace.model.parameters import Parameter
from airrace.race import Race

AIRCRAFT = "aircraft"

AnySchema = TypeVar("AnySchema", bound=Schema)


class Variation:
    """Track and aircraft of inputs that are known to be without fault, read once and varied number by number."""

    def __init__(self, inputs: Inputs) -> None:
        """Read both documents.

        Raises:
            UsageError: one of them was built in Python, so that it has no keys.
        """
        self._race = inputs.race
        reader = DocumentReader(inputs.overrides)
        track, aircraft = reader.open(inputs.track, "track"), reader.open(inputs.aircraft, AIRCRAFT)
        if track is None or aircraft is None:
            raise InputError(reader.findings)
        self._track, self._aircraft = track.reporter.root, aircraft.reporter.root
        if not (self._track.entries and self._aircraft.entries):
            raise UsageError("numbers have keys in files alone: this course or its aircraft was built in Python")

    @cached_property
    def _entry(self) -> TrackEntry:
        reporter = Reporter(self._track, [])
        entry = validate(track_language(), reporter)
        if entry is None:
            raise InputError(reporter.findings)
        return entry

    @cached_property
    def parameters(self) -> dict[str, Parameter[Race]]:
        """The parameters of track and aircraft by the key that `--set` takes.

        They include numbers that a preset or the language provides, but neither absent limits nor whole numbers that
        count.
        """
        track = _complete(self._entry, Reporter(self._track, []))
        aircraft = validate(AircraftEntry, Reporter(self._aircraft, []))
        parameters: dict[str, Parameter[Race]] = {}
        for path, value in (*_numbers(track, ()), *_numbers(aircraft, (AIRCRAFT,))):
            key = dotted(path)
            parameters[key] = Parameter(key, value, partial(self._set, key))
        return parameters

    def _set(self, key: str, race: Race, value: float) -> Race:
        return self.race(key, value)

    def race(self, key: str, value: float) -> Race:
        """Return the race with one number set to another value.

        Args:
            key: the key that `--set` takes, e.g. `gates.g4.heading_deg` or `aircraft.airframe.mass_kg`.
            value: the value, in the unit of the key.

        Raises:
            InputError: the inputs do not allow this value.
        """
        findings: list[Finding] = []
        path: KeyPath = tuple(key.split("."))
        kind = AIRCRAFT if path[0] in PREFIXED else "track"
        override = [Override(kind, path[1:] if kind == AIRCRAFT else path, ScalarNode(PLACE, value))]
        race, track = self._race.by_rules, Reporter(self._track, findings)
        entry: TrackEntry | None = self._entry
        if kind == AIRCRAFT:
            changed = apply_overrides(self._aircraft, override, findings, AircraftEntry)
            aircraft = read_aircraft(Reporter(changed, findings, prefix=f"{AIRCRAFT}."))
            race = replace(race, aircraft=aircraft or race.aircraft)
        else:
            track = Reporter(apply_overrides(self._track, override, findings, track_language()), findings)
            if entry := validate(track_language(), track):
                course_and_air = build_course_and_air(entry, track)
                race = replace(race, course=course_and_air.course, air=course_and_air.air)
        if entry and not findings:
            race = tighten(race, entry.margins, track)
            check_together(race, track)
        if findings:
            raise InputError(findings)
        return race


def _complete(entry: TrackEntry, reporter: Reporter) -> TrackEntry:
    """Return a track without fault as if its file gave every number that its preset and the language give it."""
    limits, defaults = with_preset(entry.rules, entry.gate_defaults, entry.default_pilot, reporter)
    environment, wind = entry.environment, entry.environment.wind
    distance = {"distance_m": limits.crowd_distance_m}
    update = {
        "rules": entry.rules.model_copy(update={key: getattr(limits, key) for key in LimitsEntry.model_fields}),
        "gate_defaults": _with_heights(defaults, entry.gates),
        "gates": {name: _fill(gate, gate.numbers(defaults)) for name, gate in entry.gates.items()},
        "crowd": {name: _fill(crowd, distance) for name, crowd in entry.crowd.items()},
        "environment": environment.model_copy(update={"wind": wind and _fill(wind, wind.numbers())}),
    }
    return entry.model_copy(update=update)


def _with_heights(defaults: GateDefaultsEntry, gates: Mapping[str, KindEntry]) -> GateDefaultsEntry:
    """Return the defaults with the legal heights of windows, where they follow from one nominal height."""
    height = defaults.height_m
    if height is None or any(isinstance(gate, PassingEntry) and gate.height_m is not None for gate in gates.values()):
        return defaults
    return _fill(defaults, height_band(height))


def _fill(entry: AnySchema, numbers: Mapping[str, float | None]) -> AnySchema:
    """Return an entry with the numbers that it does not give."""
    return entry.model_copy(update={key: value for key, value in numbers.items() if getattr(entry, key) is None})


def _numbers(value: object, path: KeyPath) -> Iterator[tuple[KeyPath, float]]:
    """Yield all numbers by their keys; whole numbers that count (laps) and absent ones are left out."""
    match value:
        case ReserveEntry() | PublishedEntry():
            return  # no number of the race
        case float():
            yield path, value
        case Schema():
            for key, info in type(value).model_fields.items():
                yield from _numbers(getattr(value, key), (*path, info.alias or key))
        case dict():
            for key, entry in cast(dict[str, object], value).items():
                yield from _numbers(entry, (*path, key))
        case list():
            for index, item in enumerate(cast(list[object], value)):
                yield from _numbers(item, (*path, index))
        case _:
            return
