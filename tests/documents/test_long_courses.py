"""Courses far longer than any race: read, checked and refused in a moment."""

import random
import time

import pytest
from language_texts import findings_of, understood

GATES = 5000


def long_course(*, unknown: int = 0) -> str:
    """Every gate flown once; the first names of the lap may be unknown ones."""
    choose = random.Random(1)
    gates: list[str] = []
    for index in range(GATES):
        place = f"north_m: {choose.uniform(-2e4, 2e4):.1f}, east_m: {choose.uniform(-2e4, 2e4):.1f}"
        level = f"{{type: level, {place}, heading_deg: {choose.randrange(360)}, width_m: 13, height_m: 20}}"
        pylon = f"{{type: pylon, {place}, pass_side_deg: {choose.randrange(360)}}}"
        gates.append(f"  g{index}: {level if index % 2 else pylon}")
    names = [f"g{index}x" if index <= unknown else f"g{index}" for index in range(1, GATES)]
    lap = [f"    - {{gate: {name}, direction: reverse}}" if index % 2 == 0 else f"    - {name}"
           for index, name in enumerate(names)]  # fmt: skip
    head = ["schema: airrace/track/1", "name: Long", "rules: rbar-2016", "gates:"]
    return "\n".join([*head, *gates, "course:", "  start: g0", "  lap:", *lap, ""])


def seconds_since(started: float) -> float:
    """Of work, not of waiting for other programs."""
    return time.process_time() - started


def test_five_thousand_gates_are_understood_within_a_second() -> None:
    track = long_course()
    started = time.process_time()
    inputs = understood(track)
    assert seconds_since(started) < 1.0
    assert len(inputs.race.course.passages) == GATES


@pytest.mark.parametrize(
    ("old", "new"),
    [("heading_deg", "headin_deg"), ("north_m", "noth_m"), ("{gate: g", "{gate: h")],
)
def test_thousands_of_faults_are_told_within_seconds(old: str, new: str) -> None:
    track = long_course().replace(old, new)
    started = time.process_time()
    found = findings_of(track)
    assert seconds_since(started) < 4.0
    assert all(finding.message for finding in found)


def test_thousands_of_unknown_names_among_thousands_are_told_within_seconds() -> None:
    track = long_course(unknown=4000)
    started = time.process_time()
    found = findings_of(track)
    assert seconds_since(started) < 4.0
    assert found[0].message.startswith("unknown gate `g1x`; did you mean `g1")
    assert found[-1].message == "and 3900 more findings from here on"
