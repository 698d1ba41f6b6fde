"""A designer of a short course; its lanes answer nothing unless a test asks for real ones."""

import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from airrace.design import designer
from airrace.design.designer import Designer

sys.path.append(str(Path(__file__).parents[1] / "report"))  # how pages are opened in a browser

COURSE = """\
# A course to be moved about.
schema: airrace/track/1
name: Three gates
aircraft: edge540
rules: {n_z_max: 10, floor_m: 10, start_speed_max_kt: 200}
gate_defaults: {height_m: 20, passing: window}
gates:
  start:  {type: level, north_m: 0, east_m: 0, heading_deg: 0}
  corner: {type: pylon, north_m: 420, east_m: 60, pass_side_deg: 270}   # the western side
  last:   {type: level, pylons: [{north_m: 700, east_m: 314}, {north_m: 688, east_m: 316}]}
course:
  start: start
  lap:
    - corner  # only once
    - last
"""


class StillLane:
    """A lane that only notes what it is asked."""

    def __init__(self, aircraft: str | None, tell: Callable[[], None]) -> None:
        self.aircraft = aircraft
        self.shown = {"aircraft": aircraft}
        self.asked: list[object] = []

    def ask(self, question: object) -> None:
        self.asked.append(question)

    def close(self) -> None: ...


@pytest.fixture
def track(tmp_path: Path) -> Path:
    folder = tmp_path / "courses"
    folder.mkdir()
    (folder / "course.yaml").write_text(COURSE, encoding="utf-8")
    return folder / "course.yaml"


@pytest.fixture
def still(track: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Designer]:
    monkeypatch.setattr(designer, "Lane", StillLane)
    made = Designer(track)
    yield made
    made.close()
