"""All inputs of a run: read, checked, understood, with every finding at once."""

import dataclasses
import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import TypeVar

from airrace.aircraft.aircraft import Aircraft
from airrace.documents.aircraft import aircraft as aircraft_from
from airrace.documents.aircraft import weight_not_carried
from airrace.documents.aircraft_schema import AIRCRAFT_SCHEMA, AircraftEntry
from airrace.documents.course import course as course_from
from airrace.documents.document import Document, missing_file, read_document
from airrace.documents.nodes import JSON, MappingNode, Reporter, ScalarNode, dotted
from airrace.documents.overrides import PLACE, Override, apply_overrides, parse_overrides
from airrace.documents.schema import Schema, validate
from airrace.documents.settings import SETTINGS_SCHEMA, SettingsEntry
from airrace.documents.settings import settings as settings_from
from airrace.documents.track_schema import TRACK_SCHEMA, TrackEntry
from airrace.documents.weather import air as air_from
from airrace.documents.yaml_reader import read_yaml
from airrace.errors import Finding, InputError
from airrace.procedure.race import Race
from airrace.procedure.settings import Settings
from airrace.quantities import Interval
from airrace.track.gates import Gate, Passing

SCHEMAS = {TRACK_SCHEMA: "a track", AIRCRAFT_SCHEMA: "an aircraft", SETTINGS_SCHEMA: "settings"}

Model = TypeVar("Model", bound=Schema)


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
    findings: list[Finding] = []
    changes = parse_overrides(overrides, findings)
    track_document = read_document(track, findings)
    track_root = _root(track_document, "track", changes, findings)
    if aircraft is not None:
        aircraft_document = read_document(aircraft, findings)
    else:
        aircraft_document = _referenced_aircraft(track, track_root, findings) if track_root else None
    settings_document = read_document(settings, findings) if settings else None
    inputs = _understand(track_document, aircraft_document, settings_document, overrides, findings)
    if inputs is None or findings:
        raise InputError(findings)
    return inputs


def inputs_from_documents(
    track: Document, aircraft: Document, settings_file: Document | None, overrides: Sequence[str]
) -> Inputs:
    """The same from texts alone, for resuming a run; no file is touched.

    Raises:
        InputError: with all findings.
    """
    findings: list[Finding] = []
    inputs = _understand(track, aircraft, settings_file, overrides, findings)
    if inputs is None or findings:
        raise InputError(findings)
    return inputs
