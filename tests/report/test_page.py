"""A report is one file that loads nothing, says so to the browser, and shows every text as it is."""

import base64
import hashlib
import re
from dataclasses import replace
from pathlib import Path

import pytest
from example_flights import half_cuban, windy
from report_pages import HOSTILE, circle, dense, everything_flown, read, renamed, whole_page

from airrace.procedure.result import Route, SearchReport
from airrace.report.flight_page import flight_page
from airrace.report.sections import number
from airrace.results.comparison import compare_flights
from airrace.results.leg_facts import leg_facts
from airrace.runs.flight_sources import report_of_flights, report_page, stage_sections
from airrace.views.tables import Cell, Column, Table

LOADING = ("src", "href", "action", "srcset", "data", "poster", "background")


def test_nothing_in_the_page_is_loaded_from_anywhere() -> None:
    parsed = read(whole_page())
    assert [(tag, name) for tag, attributes in parsed.elements for name in attributes if name in LOADING] == []
    assert not re.search(r"@import|url\(", "".join(parsed.texts["style"]))


def test_the_policy_lets_the_very_script_and_style_of_the_page_run_and_nothing_else() -> None:
    parsed = read(whole_page())
    (policy,) = [one["content"] for one in parsed.named("meta") if one.get("http-equiv") == "Content-Security-Policy"]
    assert policy is not None
    rules = dict(rule.split(" ", 1) for rule in policy.split("; "))
    script, style = parsed.texts["script"][1], parsed.texts["style"][0]
    assert rules["default-src"] == "'none'"
    assert rules["script-src"] == f"'sha256-{digest(script)}'"
    assert rules["style-src-elem"] == f"'sha256-{digest(style)}'"
    assert rules["img-src"] == "data:"
    assert not re.search(r"https?:|\*|unsafe-eval", policy)


def digest(text: str) -> str:
    return base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()


def test_the_page_has_no_script_in_attributes() -> None:
    assert not [name for _, attributes in read(whole_page()).elements for name in attributes if name.startswith("on")]


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_names_are_shown_as_they_are_and_make_no_elements(name: str) -> None:
    plain, parsed = read(flight_page([renamed("plain")]).as_html()), read(flight_page([renamed(name)]).as_html())
    assert [tag for tag, _ in parsed.elements] == [tag for tag, _ in plain.elements]
    assert parsed.texts["title"][0] == name
    assert parsed.texts["h1"] == [name]
    assert f"3:{name}" in parsed.texts["button"]


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_labels_of_flights_beside_it_are_shown_as_they_are(name: str) -> None:
    parsed = read(flight_page([circle(), circle(25.0).labelled(name)]).as_html())
    assert any(name in text for text in parsed.texts["td"])
    assert len(parsed.named("script")) == 2


def test_names_that_are_read_from_the_right_turn_nothing_beside_them() -> None:
    name = "\u05de\u05e8\u05d5\u05e5\u202e 2014"
    page = flight_page([renamed(name)], []).as_html()
    shown = "\u05de\u05e8\u05d5\u05e5\ufffd 2014"
    assert f'<h1 class="long"><bdi>{shown}</bdi></h1>' in page
    assert f"<title>{shown}</title>" in page
    assert "\u202e" not in page


def test_a_dollar_in_a_name_is_a_dollar() -> None:
    assert read(flight_page([renamed("$script ${style} $$")]).as_html()).texts["h1"] == ["$script ${style} $$"]


def test_a_race_of_one_minute_takes_less_than_four_megabytes() -> None:
    flights = [dense(half_cuban().flight(), 60.0), *(dense(windy().flight(), 60.0).labelled(str(i)) for i in range(3))]
    assert len(flight_page(flights).as_html().encode()) < 4_000_000


def test_every_leg_can_be_jumped_to() -> None:
    flight = circle()
    parsed = read(flight_page([flight]).as_html())
    begins = [float(one["data-time"] or "nan") for one in parsed.named("button") if "data-time" in one]
    assert begins == pytest.approx([one.time for one in flight.crossings[:-1]])
    assert [row["data-passing"] for row in parsed.named("tr") if "data-passing" in row] == [
        str(number) for number in range(len(flight.crossings) - 1)
    ]


def test_flights_beside_it_are_told_with_their_difference() -> None:
    cells = read(whole_page()).texts["td"]
    assert {"20.000", "25.000", "+5.000"} <= set(cells)
    assert "+5.000" not in read(flight_page([circle()]).as_html()).texts["td"]


def test_a_run_tells_certificate_and_inputs() -> None:
    run = half_cuban()
    stage = run.stage()
    parsed = read(flight_page([stage.flight()], stage_sections(stage)).as_html())
    assert stage.certificate is not None
    assert {item.name for item in stage.certificate.items} <= set(parsed.texts["td"])
    assert run.inputs.track.text in parsed.texts["pre"]
    assert run.inputs.aircraft.text in parsed.texts["pre"]


def test_a_later_stage_tells_the_ways_that_were_tried_before_it(tmp_path: Path) -> None:
    run = half_cuban()
    way = Route("over the top <left>", 9.25, 0.75, "joint")
    first, *later = run.checkpoint.stages
    tried = replace(first, result=replace(first.result, search=SearchReport((way,))))
    explored = replace(run, checkpoint=replace(run.checkpoint, stages=(tried, *later)))
    assert len(explored.stages) > 1
    assert way.text in read(report_page(explored)).texts["td"]
    explored.save(tmp_path / "explored.h5")
    assert way.text in read(report_of_flights([str(tmp_path / "explored.h5")])).texts["td"]
    assert "Routes that were tried" not in report_page(run)


def test_prices_are_told_when_they_are_asked_for() -> None:
    stage = half_cuban().stage()
    cells = read("".join(stage_sections(stage, priced=True))).texts["td"]
    assert next(iter(stage.sensitivities())) in cells
    assert not any("rules.n_z_max" in section for section in stage_sections(stage))


def test_a_course_with_everything_makes_a_page(tmp_path: Path) -> None:
    assert read(flight_page([everything_flown(tmp_path)]).as_html()).texts["h1"] == ["Everything at once"]


def test_a_table_shows_numbers_as_people_write_them() -> None:
    assert (number(-1.25, 1), number(2.0, 1, signed=True), number(-0.001, 1), number(float("nan"), 1)) == (
        "\N{MINUS SIGN}1.2",
        "+2.0",
        "0.0",
        "\N{EN DASH}",
    )
    shown = Table("caption <", (Column("a", "m", ".1f"), Column("b")), [("<1>", Cell("&", bad=True))])
    assert "caption &lt;" in shown.html()
    shown = shown.html(inline=False)
    assert "&lt;1&gt;" in shown
    assert '<td class="text no">&amp;</td>' in shown


def test_the_legs_of_a_comparison_come_with_what_differs() -> None:
    comparison = compare_flights(half_cuban().flight(), windy().flight(label="windy"))
    page = flight_page([comparison.reference, comparison.other]).as_html()
    cells = read(page).texts["td"]
    for leg in comparison.legs:
        assert ", ".join(one.text for one in leg.differences) in cells
    assert "Wind: 20 kt from 70 deg against none." in page


def test_the_legs_tell_what_they_come_near_to() -> None:
    flight = half_cuban().flight()
    cells = read(flight_page([flight]).as_html()).texts["td"]
    for facts in leg_facts(flight):
        assert {facts.clearances[0].text, number(facts.clearances[0].distance, 1)} <= set(cells)
