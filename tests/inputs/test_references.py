"""Names in the course: told whatever else is wrong, and in bearable number."""

import pytest
from language_texts import RICH, TRACK, edited, findings_of, understood

from airrace.errors import Finding
from airrace.inputs.inputs import FINDINGS_MAX, told

WRONG_ELSEWHERE = [
    ("name: Every element", "name: 7"),
    ("rules: rbar-2016", "rules: {n_z_max: 99}"),
    ("elevation_m: 12", "elevation_m: high"),
    ("heading_deg: 70, bank: either", "heading_deg: 70, bank: both"),
    ("type: high-turn", "type: hihg-turn"),
    ("  laps: 2\n", "  laps: two\n"),
    ("keep: left", "keep: up"),
]


@pytest.mark.parametrize(("old", "new"), WRONG_ELSEWHERE, ids=[new for _, new in WRONG_ELSEWHERE])
def test_wrong_names_are_told_together_with_what_is_wrong_elsewhere(old: str, new: str) -> None:
    track = edited(RICH, "top, roll, q, dive]", "topp, roll, roll, q, dive]")
    track = edited(track, "safety_lines: [beach]", "safety_lines: [beech]")
    keys = {finding.key for finding in findings_of(edited(track, old, new))}
    named = {"course.lap.2", "course.lap.4", "course.lap.1.safety_lines.0", "safety_lines.beach"}
    assert named < keys
    assert len(keys) == len(named) + 1


def test_what_cannot_be_read_as_a_name_is_left_to_the_schema() -> None:
    found = findings_of(edited(RICH, "lap: [g1,", "lap: [3, [g1], {direction: forward}, {gate: {}},"))
    assert [finding.key for finding in found] == [
        "course.lap.0",
        "course.lap.1",
        "course.lap.2.gate",
        "course.lap.3.gate",
    ]


@pytest.mark.parametrize(
    ("old", "new"), [("  lap: [g1, {", "  lap: g1 # [g1, {"), ("course:\n", "coarse:\n"), ("gates:\n", "gatse:\n")]
)
def test_a_course_that_cannot_be_read_is_told_as_such(old: str, new: str) -> None:
    found = findings_of(edited(RICH, old, new))
    assert all(finding.message for finding in found)
    assert not [finding for finding in found if "unknown gate" in finding.message]


def test_the_same_gate_across_the_end_of_a_lap_is_told_where_the_lap_begins() -> None:
    track = edited(TRACK, "lap: [g1,", "lap: [g0, g1,")
    keys = [finding.key for finding in findings_of(edited(track, "start: g0", "start: g1"))]
    assert keys == ["course.lap.0"]
    once = edited(edited(track, "start: g0", "start: g1"), "laps: 2", "laps: 1")
    assert understood(once).race.course.passages[0].name == "0:g1"


def test_at_most_a_hundred_findings_are_told_of_a_document() -> None:
    track = edited(TRACK, "lap: [g1,", "lap: [" + "".join(f"no{index}, " for index in range(250)) + "g1,")
    found = findings_of(track, settings="schema: airrace/settings/1\nguess: 1\n")
    assert [finding.file for finding in found] == ["s.yaml"] + ["t.yaml"] * (FINDINGS_MAX + 1)
    assert found[-1].message == f"and {250 - FINDINGS_MAX} more findings from here on"
    assert found[-1].key == f"course.lap.{FINDINGS_MAX}"


def test_few_findings_are_told_as_they_are() -> None:
    some = [Finding("t.yaml", line, 1, "", f"{line}") for line in range(FINDINGS_MAX, 0, -1)]
    assert told(some) == sorted(some)


def test_a_finding_quotes_no_more_of_a_file_than_can_be_read() -> None:
    (finding,) = findings_of(edited(TRACK, "schema: airrace/track/1", f"schema: {'x' * 5000}"))
    assert finding.message == f"expected `schema: airrace/track/1`, found `{'x' * 100}...`"
    wordy = Finding("t.yaml", 1, 1, "a", f"`b` {'is not what it was and ' * 20} `c`")
    assert told([wordy]) == [wordy]
