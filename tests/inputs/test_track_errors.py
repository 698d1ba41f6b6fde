"""Errors in tracks: where they stand, what is wrong, and what would be right."""

import pytest
from language_texts import AIRCRAFT, TRACK, edited, findings_of


def finding_in_track(old: str, new: str) -> str:
    (finding,) = findings_of(edited(TRACK, old, new))
    return str(finding)


def test_a_missing_gate_field_names_the_gate_and_its_line() -> None:
    message = finding_in_track("    heading_deg: 90\n", "")
    assert message == (
        "t.yaml:7:3: gates.g0.heading_deg: missing; a level gate needs `heading_deg`: its axis when flown forward; "
        "or its two `pylons`"
    )


def test_an_unknown_key_comes_with_a_suggestion() -> None:
    message = finding_in_track("heading_deg: 90\n", "heading_deg: 90\n    heigth_m: 20\n")
    assert message == "t.yaml:12:5: gates.g0.heigth_m: unknown key `heigth_m`; did you mean `height_m`?"


def test_a_duplicate_key_is_found() -> None:
    message = finding_in_track("    east_m: 0\n", "    east_m: 0\n    north_m: 5\n")
    assert message == "t.yaml:11:5: gates.g0.north_m: duplicate key; first in line 9"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "n_z_max: 10",
            "n_z_max: ten",
            "t.yaml:4:12: rules.n_z_max: must be a number above 1 and at most 25, not the text `ten`",
        ),
        ("n_z_max: 10", "n_z_max: 99", "t.yaml:4:12: rules.n_z_max: must be above 1 and at most 25, not 99"),
        (
            "n_z_max: 10",
            "n_z_max: yes",
            "t.yaml:4:12: rules.n_z_max: must be a number above 1 and at most 25, not the text `yes`",
        ),
        (
            "n_z_max: 10",
            "n_z_max: true",
            "t.yaml:4:12: rules.n_z_max: must be a number above 1 and at most 25, not `true`",
        ),
        ("n_z_max: 10", "n_z_max:", "t.yaml:4:11: rules.n_z_max: has no value; give one, or leave the key out"),
        (
            "  n_z_max: 10\n",
            "",
            "t.yaml:3:1: rules.n_z_max: missing; a rule book needs `n_z_max`: the largest load factor",
        ),
        ("name: Test", "name: 2014", "t.yaml:2:7: name: must be text, not 2014; quote it if it is meant as text"),
        ("type: level", "type: levle", "t.yaml:8:11: gates.g0.type: unknown type `levle`; did you mean `level`?"),
        (
            "    type: level\n",
            "",
            "t.yaml:7:3: gates.g0.type: missing; `type` is one of: level, knife-edge, quad, pylon, manoeuvre, "
            "high-turn, vertical-roll",
        ),
        (
            "bank: left",
            "bank: leftt",
            (
                "t.yaml:13:77: gates.g2.bank: must be one of right, left, either, not the text `leftt`; did you mean "
                "`left`?"
            ),
        ),
        (
            "laps: 2",
            "laps: 1.5",
            "t.yaml:18:9: course.laps: must be a whole number at least 1 and at most 100, not 1.5",
        ),
        ("laps: 2", "laps: 0", "t.yaml:18:9: course.laps: must be at least 1 and at most 100, not 0"),
        ("start: g0", "start: g00", "t.yaml:16:10: course.start: unknown gate `g00`; did you mean `g0`?"),
        ("lap: [g1,", "lap: [g11,", "t.yaml:17:9: course.lap.0: unknown gate `g11`; did you mean `g1`?"),
        (
            "lap: [g1,",
            "lap: [3,",
            "t.yaml:17:9: course.lap.0: must be the name of a gate or {gate: NAME, direction: reverse}, not 3",
        ),
        (
            "lap: [g1,",
            "lap: [g0, g1,",
            "t.yaml:17:9: course.lap.0: `g0` is passed twice in a row; another element must come between",
        ),
        (
            "lap: [g1,",
            "lap: [{gate: g1, direction: reverse},",
            "t.yaml:17:31: course.lap.0.direction: only two-pylon gates have a direction; `g1` is none, leave it out",
        ),
        (
            "heading_deg: 90",
            "heading_deg: 90\n    height_m: 30\n    height_max_m: 25",
            "t.yaml:12:15: gates.g0.height_m: must lie within the window's heights, 25 to 25 m, not 30",
        ),
        (
            "heading_deg: 90",
            "heading_deg: 90\n    width_m: 8",
            (
                "t.yaml:12:14: gates.g0.width_m: a width of 8 m less two clearances of 0.5 m leaves 7 m; the wing of "
                "Edge 540 class spans 7.43 m"
            ),
        ),
        (
            "heading_deg: 90",
            "heading_deg: 90\n    clearance_m: 7",
            "t.yaml:7:3: gates.g0.width_m: a width of 13 m leaves nothing between two clearances of 7 m",
        ),
        (
            "heading_deg: 90",
            "heading_deg: 90\n    crossing_max_deg: 90",
            "t.yaml:12:23: gates.g0.crossing_max_deg: must be above 0 and at most 85, not 90",
        ),
        (
            "  n_z_max: 10",
            "  n_z_max: 10\n  ceiling_m: 12",
            (
                "t.yaml:8:3: gates.g0.height_m: lies at 15 to 25 m, outside of the flown heights of 10 to 12 m "
                "(rules: floor, ceiling)"
            ),
        ),
        (
            "inverted: true, height_min_m: 100",
            "",
            (
                "t.yaml:14:3: gates.top: a manoeuvre needs at least one condition: climb_deg, bank_deg, inverted, "
                "heading_deg, ..."
            ),
        ),
        (
            "inverted: true,",
            "inverted: true, climb_deg: 90,",
            "t.yaml:14:36: gates.top.inverted: has no meaning on a vertical line; leave it out",
        ),
        (
            "inverted: true,",
            "inverted: true, bank_deg: 0,",
            "t.yaml:14:52: gates.top.bank_deg: not together with `inverted`, which says a bank of 180 degrees",
        ),
        (
            "height_min_m: 100",
            "height_min_m: 100, height_m: 120",
            "t.yaml:14:71: gates.top.height_m: is exact; not together with `height_min_m` or `height_max_m`",
        ),
        (
            "  start_speed_max_kt: 200",
            "  start_speed_max_kt: 60",
            "t.yaml:5:23: rules.start_speed_max_kt: must be above 68.03 kt, the least speed of Edge 540 class; is 60",
        ),
        (
            "schema: airrace/track/1",
            "schema: airrace/track/2",
            "t.yaml:1:9: schema: expected `schema: airrace/track/1`, found `airrace/track/2`",
        ),
        (
            "schema: airrace/track/1\n",
            "",
            "t.yaml:1:1: schema: missing; the file must begin with `schema: airrace/track/1`",
        ),
        (
            "course:\n",
            "environment: {wind: {from_deg: 0}}\ncourse:\n",
            "t.yaml:15:15: environment.wind: missing; a wind needs `speed_kt` or `speed_m_s`",
        ),
        (
            "course:\n",
            "environment: {wind: {from_deg: 0, speed_kt: 1, speed_m_s: 1}}\ncourse:\n",
            (
                "t.yaml:15:48: environment.wind.speed_m_s: the speed is given twice; keep one of `speed_kt` and "
                "`speed_m_s`"
            ),
        ),
    ],
)
def test_an_error_in_a_track_says_where_what_and_what_would_be_right(old: str, new: str, message: str) -> None:
    if "ceiling_m" in new:  # concerns every element; the first finding is enough
        assert str(findings_of(edited(TRACK, old, new))[0]) == message
    else:
        assert finding_in_track(old, new) == message


def test_a_race_does_not_start_at_a_free_position() -> None:
    (finding,) = findings_of(edited(TRACK, "start: g0", "start: top"))
    assert (finding.line, finding.column, finding.key) == (16, 10, "course.start")


def test_all_findings_come_at_once() -> None:
    track = edited(edited(TRACK, "n_z_max: 10", "n_z_max: 0"), "pass_side_deg: 180", "pass_side: 180")
    aircraft = edited(AIRCRAFT, "mass_kg: 698 ", "mass_kg: -1 ")
    keys = [(finding.file, finding.key) for finding in findings_of(track, aircraft=aircraft, overrides=("laps",))]
    assert keys == [
        ("--set", "laps"),
        ("a.yaml", "airframe.mass_kg"),
        ("t.yaml", "rules.n_z_max"),
        ("t.yaml", "gates.g1.pass_side_deg"),
        ("t.yaml", "gates.g1.pass_side"),
    ]


def test_a_document_that_is_no_mapping_is_refused() -> None:
    (finding,) = findings_of("- a\n- b\n")
    assert str(finding) == "t.yaml:1:1: must be a mapping that begins with `schema: airrace/track/1`"
