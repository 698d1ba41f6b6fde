"""Texts in the languages of the documents, and what they are understood as."""

from dataclasses import dataclass, replace
from pathlib import Path

import pytest

from airrace.errors import Finding, InputError
from airrace.files.inputs import Document, Inputs, inputs_from_documents

ROOT = Path(__file__).parents[3]

TRACK = """\
schema: airrace/track/1
name: Test
rules:
  n_z_max: 10
  start_speed_max_kt: 200
gates:
  g0:
    type: level
    north_m: 0
    east_m: 0
    heading_deg: 90
  g1: {type: pylon, north_m: 0, east_m: 300, pass_side_deg: 180}
  g2: {type: knife-edge, north_m: 200, east_m: 500, heading_deg: 270, bank: left}
  top: {type: manoeuvre, inverted: true, height_min_m: 100}
course:
  start: g0
  lap: [g1, {gate: g2, direction: planned}, top, g0]
  laps: 2
"""
RICH = """\
schema: airrace/track/1
name: Every element
rules: rbar-2016
origin: {latitude_deg: 45.08, longitude_deg: 13.63, elevation_m: 12}
environment:
  temperature_offset_K: 5
  wind: {from_deg: 320, speed_kt: 8, profile: log, roughness_m: 0.03}
  thermals: [{latitude_deg: 45.085, longitude_deg: 13.635, w_star_m_s: 2, mixing_height_m: 900}]
gate_defaults: {height_m: 21}
gates:
  g0: {type: level, north_m: 0, east_m: 0, heading_deg: 70}
  g1: {type: pylon, latitude_deg: 45.0887, longitude_deg: 13.6363, pass_side_deg: 110}
  g2: {type: knife-edge, north_m: 100, east_m: 400, heading_deg: 70, bank: either}
  q: {type: quad, north_m: 280, east_m: 480, heading_deg: 270, then: left}
  top: {type: high-turn, height_min_m: 152.4}
  roll: {type: vertical-roll, roll_deg: 315, height_min_m: 213.4, height_gain_m: 60}
  dive: {type: manoeuvre, climb_deg: -45, inverted: true, east_max_m: 900}
safety_lines:
  beach:
    from: {north_m: -557, east_m: -375}
    to: {north_m: -479, east_m: -252}
    keep: left
    margin_m: 10
crowd:
  stands: {line: [{north_m: -500, east_m: 0}, {north_m: -450, east_m: 200}], distance_m: 100}
  tower: {point: {latitude_deg: 45.07, longitude_deg: 13.63}, distance_m: 50, measured: over-ground}
  village:
    polygon: [{north_m: 900, east_m: -900}, {north_m: 900, east_m: -600}, {north_m: 1200, east_m: -600}]
    distance_m: 150
airspace:
  - {north_m: -2000, east_m: -2000}
  - {north_m: 2000, east_m: -2000}
  - {north_m: 2000, east_m: 2000}
  - {north_m: -2000, east_m: 2000}
course:
  start: g0
  lap: [g1, {gate: g2, direction: reverse, safety_lines: [beach]}, top, roll, q, dive]
  laps: 2
  finish: g0
"""
"""One of everything the track language knows."""

OBSTACLES = """\
obstacles:
  crane: {north_m: 700, east_m: -300, height_m: 80}
  silo: {latitude_deg: 45.09, longitude_deg: 13.63, height_m: 40, radius_m: 6, clearance_m: 20}
  hall: {north_m: 0, east_m: 900, height_m: 12, length_m: 65, width_m: 28, heading_deg: 30}
"""
TWO_GATES = """schema: airrace/track/1
name: two gates
aircraft: edge540
origin: {latitude_deg: 45.0, longitude_deg: 13.0}
rules: {n_z_max: 10}
gates:
  a: {type: level, north_m: 0, east_m: 0, heading_deg: 0}
  b: {type: %s}
course: {start: a, lap: [b]}
"""

AIRCRAFT = (ROOT / "configs/edge540.yaml").read_text(encoding="utf-8")


def understood(
    track: str = TRACK, *, aircraft: str = AIRCRAFT, settings: str | None = None, overrides: tuple[str, ...] = ()
) -> Inputs:
    settings_file = None if settings is None else Document("s.yaml", settings)
    return inputs_from_documents(Document("t.yaml", track), Document("a.yaml", aircraft), settings_file, overrides)


def findings_of(
    track: str = TRACK, *, aircraft: str = AIRCRAFT, settings: str | None = None, overrides: tuple[str, ...] = ()
) -> list[Finding]:
    with pytest.raises(InputError) as raised:
        understood(track, aircraft=aircraft, settings=settings, overrides=overrides)
    return raised.value.findings


def edited(text: str, old: str, new: str) -> str:
    assert text.count(old) == 1, old
    return text.replace(old, new)


@dataclass(frozen=True)
class Refusal:
    """What is changed in the text of a document, and all that is found then.

    Attributes:
        base: the name of the text.
        changes: the parts that are replaced, each with what comes in its place.
        overrides: what is set besides, as `--set` takes it.
        findings: file, place, key and words of every finding.
    """

    base: str
    changes: list[tuple[str, str]]
    overrides: tuple[str, ...]
    findings: list[str]

    def __str__(self) -> str:
        return "; ".join((*(new for _, new in self.changes), *self.overrides))


def refusals(table: str) -> list[Refusal]:
    """The cases of a table, in which `# BASE: topic` begins those of a text.

    A case is lines of `old => new` and `--set key=value`, then a line `> line:column: key: words` for every finding
    in the text, or `> --set: key: words`, which goes on in lines that begin with `>   `.
    """
    cases: list[Refusal] = []
    base = ""
    for line in filter(None, table.splitlines()):
        if line.startswith("# "):
            base = line[2:].split(":")[0]
        elif line.startswith(">   "):
            cases[-1].findings[-1] += line[3:]
        elif line.startswith("> "):
            cases[-1].findings.append(f"t.yaml:{line[2:]}" if line[2].isdigit() else line[2:])
        else:
            if not cases or cases[-1].findings:
                cases.append(Refusal(base, [], (), []))
            if line.startswith("--set "):
                cases[-1] = replace(cases[-1], overrides=(*cases[-1].overrides, line.removeprefix("--set ")))
            else:
                old, new = line.replace("\\n", "\n").split(" =>")
                cases[-1].changes.append((old, new.removeprefix(" ")))
    return cases
