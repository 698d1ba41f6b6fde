"""Courses for the tests of what `check` shows: one with everything the track language knows, and the shipped ones."""

from pathlib import Path

from airrace.files.inputs import load_inputs
from airrace.race import Race

ROOT = Path(__file__).parents[2]
AIRCRAFT = ROOT / "configs" / "edge540.yaml"
SHIPPED = sorted((ROOT / "tracks").glob("*.yaml"))

EVERYTHING = """
schema: airrace/track/2
name: Everything at once
environment: {wind: {from_deg: 320, speed_kt: 34}}
rules: {preset: rbar-2016, pilot: none, crowd_distance_m: 90, ceiling_m: 400}
gates:
  start: {type: level, north_m: 0, east_m: 0, heading_deg: 0}
  corner: {type: pylon, north_m: 420, east_m: 60, pass_side_deg: 270}
  edge: {type: knife-edge, north_m: 760, east_m: 220, heading_deg: 60, bank: either}
  q: {type: quad, north_m: 500, east_m: 600, heading_deg: 200, then: right}
  wide: {type: level, north_m: 100, east_m: 520, heading_deg: 180, width_m: 20}
  near: {type: level, north_m: 40, east_m: 560, heading_deg: 90}
  top: {type: high-turn, height_min_m: 152.4}
  roll: {type: vertical-roll, roll_deg: 315, height_min_m: 213.4}
safety_lines:
  beach: {from: {north_m: -50, east_m: 700}, to: {north_m: 700, east_m: 760}, keep: left, margin_m: 20}
crowd:
  stands: {line: [{north_m: 200, east_m: 200}, {north_m: 330, east_m: 230}]}
  tower: {point: {north_m: 620, east_m: -60}, distance_m: 60, measured: over-ground}
  village: {polygon: [{north_m: -150, east_m: 300}, {north_m: -100, east_m: 400}, {north_m: -190, east_m: 420}]}
airspace:
  - {north_m: -260, east_m: -160}
  - {north_m: 900, east_m: -160}
  - {north_m: 900, east_m: 900}
  - {north_m: -260, east_m: 820}
course:
  start: start
  lap: [corner, edge, {gate: q, safety_lines: [beach]}, wide, near, top, start, roll, start]
"""


def everything(folder: Path) -> Path:
    """The file of the course with everything."""
    path = folder / "everything.yaml"
    path.write_text(EVERYTHING, encoding="utf-8")
    return path


def many_gates(folder: Path, count: int) -> Path:
    """The file of a course of level gates in a zigzag."""
    gates = [
        f"  g{i}: {{type: level, north_m: {100 * (i % 2)}, east_m: {9 * i - 4.5 * count}, heading_deg: 90}}"
        for i in range(count)
    ]
    order = ", ".join(f"g{i}" for i in range(1, count))
    path = folder / "many.yaml"
    head = "schema: airrace/track/2\nname: Many\nrules: {preset: rbar-2016, pilot: none}\ngates:\n"
    path.write_text(head + "\n".join(gates) + f"\ncourse:\n  start: g0\n  lap: [{order}]\n", encoding="utf-8")
    return path


def race(path: Path) -> Race:
    return load_inputs(path, aircraft=AIRCRAFT).race
