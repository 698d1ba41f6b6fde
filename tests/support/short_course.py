"""A short course in wind, as a document, for tests that fly one course in many ways."""

from pathlib import Path

from airrace.files.inputs import Document

ROOT = Path(__file__).parents[2]
AIRCRAFT = Document("edge540.yaml", (ROOT / "configs" / "edge540.yaml").read_text(encoding="utf-8"))
FROM_PLAN = Document("settings.yaml", 'schema: airrace/settings/1\nguess: plan\nsearch: "off"\n')


def short_course(rules: str, wind_m_s: int) -> str:
    """Three gates and a pylon; `rules` are those beside the height of the floor and the speed at the start."""
    return f"""
schema: airrace/track/2
name: three gates and a pylon
rules: {{floor_m: 5, pilot: none, start_speed_max_kt: 200, {rules}}}
environment:
  wind: {{from_deg: 250, speed_m_s: {wind_m_s}}}
gate_defaults: {{height_m: 20, height_min_m: 15, height_max_m: 25, climb_min_deg: -10, climb_max_deg: 10}}
gates:
  first: {{type: level, north_m: 0, east_m: 0, heading_deg: 20}}
  side: {{type: pylon, north_m: 300, east_m: 60, pass_side_deg: 110}}
  last: {{type: level, north_m: 420, east_m: -260, heading_deg: 250}}
course: {{start: first, lap: [side, last]}}
"""
