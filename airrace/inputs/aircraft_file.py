"""The file of an aircraft that was estimated or fitted: every number with the relation it comes from."""

import json
from collections.abc import Iterator
from pathlib import Path

from airrace.aircraft.aircraft import Aircraft
from airrace.dynamics.estimation import ManualFigures, Relations
from airrace.errors import InputError, UsageError
from airrace.inputs.aircraft import AircraftEntry, PublishedEntry
from airrace.inputs.document import AIRCRAFT, Document
from airrace.inputs.inputs import DocumentReader, read_aircraft, read_named
from airrace.inputs.schema import SI, Schema, language_of, validate
from airrace.records import record

_HEAD = """\
# {origin} and {template}.
#
{legend}
#   {template:<14} taken over: nothing that was given says anything about it
#
# Derivatives are per radian; rates are made dimensionless with b/(2 V) (p, r) and cbar/(2 V) (q, alpha-dot).
# A positive deflection makes a negative moment about its own axis.
schema: {language}
name: {name}
source: {source}
"""


@record
class Provenance:
    """What an aircraft's numbers come from: the start of a sentence, marks and their meanings, and a source."""

    sentence: str
    marks: tuple[tuple[str, str], ...]
    source: str


MANUAL = Provenance(
    "An aircraft that is estimated from its flight manual",
    (
        ("given", "a figure of the flight manual"),
        ("else", "the relation by which it follows from the figures and the template"),
    ),
    "a flight manual",
)


@record
class AircraftFile:
    """An aircraft file as it is read: what it says, and the aircraft that it makes."""

    entry: AircraftEntry
    aircraft: Aircraft

    @property
    def published(self) -> ManualFigures:
        """The figures that are published of it, SI."""
        given = self.entry.published.arguments() if self.entry.published else {}
        return ManualFigures(**{name: value for name, value in given.items() if name != "source"})


def read_aircraft_file(named: str | Path | Document) -> AircraftFile:
    """Read an aircraft file or the name of one that comes along.

    Raises:
        InputError: it cannot be read, or is no aircraft.
    """
    reader = DocumentReader(())
    opened = reader.open(read_named(AIRCRAFT, named, reader.findings), "aircraft")
    entry = validate(AircraftEntry, opened.reporter) if opened else None
    aircraft = read_aircraft(opened.reporter) if opened and entry else None
    if entry is None or aircraft is None or reader.findings:
        raise InputError(reader.findings)
    return AircraftFile(entry, aircraft)


def aircraft_text(
    template: AircraftFile,
    named: str,
    aircraft: Aircraft,
    relations: Relations,
    figures: ManualFigures | None = None,
    origin: Provenance = MANUAL,
) -> str:
    """Return the text of the file of an aircraft that was made of a template, with a manual's figures at its end.

    `named` is how the template was called.

    Raises:
        UsageError: it is no aircraft that flies.
    """
    name, source = map(json.dumps, (aircraft.name, f"{origin.source}; what that leaves open, {named}"))
    legend = "\n".join(f"#   {mark:<14} {meaning}" for mark, meaning in origin.marks)
    texts = {"origin": origin.sentence, "legend": legend, "name": name, "source": source, "template": named}
    lines = [_HEAD.format(**texts, language=language_of(AircraftEntry))]
    for group, entry in template.entry:
        if isinstance(entry, Schema) and group != "published" and (group != "linear" or aircraft.linear):
            lines += [f"{group}:", *_align(list(_numbers(group, entry, aircraft, relations, named))), ""]
    lines += [] if figures is None else ["published:"]
    for field, info in PublishedEntry.model_fields.items():
        key, value = info.alias or field, getattr(figures, field, None)
        lines += [] if value is None else [f"  {key}: {value / _factor(key):.6g}"]
    text = "\n".join(lines) + "\n"
    try:
        read_aircraft_file(Document(aircraft.name, text))
    except InputError as error:
        first = error.findings[0]
        message = f"these figures make no aircraft that flies: {first.key}: {first.message}"
        raise UsageError(message) from error
    return text


def _numbers(
    group: str, entry: Schema, aircraft: Aircraft, relations: Relations, named: str
) -> Iterator[tuple[str, str]]:
    """Yield the keys of a group with their values, and where each comes from."""
    V, n_z = aircraft.envelope.V, aircraft.envelope.n_z
    ends = {"speed_min_m_s": V.lower, "speed_max_m_s": V.upper, "n_z_min": n_z.lower, "n_z_max": n_z.upper}
    for field, info in type(entry).model_fields.items():
        key, value, relation = info.alias or field, getattr(entry, field), relations.get((group, field))
        if value is None:
            continue
        if relation:
            value = (ends[field] if group == "envelope" else getattr(getattr(aircraft, group), field)) / _factor(key)
        text = f"{value:.6g}" if isinstance(value, float) else str(value).lower()
        yield f"  {key}: {text}", relation or named


def _factor(key: str) -> float:
    return next((factor for ending, factor in SI.items() if key.endswith(ending)), 1.0)


def _align(lines: list[tuple[str, str]]) -> Iterator[str]:
    width = max(len(text) for text, _ in lines)
    for text, comment in lines:
        yield f"{text:<{width}}  # {comment}"
