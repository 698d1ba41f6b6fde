"""The report: page, contents, differences of flights, command and libraries."""

import base64
import hashlib
import json
import math
import re
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest
from example_flights import circling, half_cuban, windy
from hypothesis import given
from hypothesis import strategies as st
from report_pages import HOSTILE, circle, dense, everything_flown, labelled, read, renamed, unpack, whole_page
from typer.testing import CliRunner, Result

import airrace
from airrace.cli.main import app
from airrace.errors import UsageError
from airrace.files.inputs import load_inputs
from airrace.flights.results import Flight, ReserveState, Verification
from airrace.flights.results.comparison import compare_flights
from airrace.flights.results.flight_facts import leg_facts
from airrace.flights.safety.monte_carlo import SafetyResult
from airrace.optimal_control.quantities import KNOT
from airrace.optimal_control.trajectory import Array
from airrace.pages.report.contents import FORMAT, STRIPS, as_json, contents_of, pack, short_labels, time_lost
from airrace.pages.report.flight_page import flight_page
from airrace.pages.report.script import FOLDER, LIBRARIES, join_modules, page_script
from airrace.pages.report.sections import claim_section, number, search_section
from airrace.pages.views.comparison_tables import difference_text
from airrace.pages.views.map_model import map_model
from airrace.pages.views.tables import Cell, Column, Table
from airrace.procedure.result import OPTIMUM, Route, SearchReport, Status
from airrace.runs.command_result import ExitCode
from airrace.runs.flight_sources import report_of_flights, report_page, stage_sections

LOADING = ("src", "href", "action", "srcset", "data", "poster", "background")


def test_nothing_in_the_page_is_loaded_and_nothing_runs_but_its_own_script() -> None:
    parsed = read(whole_page())
    names = [name for _, attributes in parsed.elements for name in attributes]
    assert [name for name in names if name in LOADING or name.startswith("on")] == []
    script, style = parsed.texts["script"][1], parsed.texts["style"][0]
    assert not re.search(r"@import|url\(", style)
    (policy,) = [one["content"] for one in parsed.named("meta") if one.get("http-equiv") == "Content-Security-Policy"]
    assert policy is not None
    rules = dict(rule.split(" ", 1) for rule in policy.split("; "))
    assert rules["default-src"] == "'none'"
    assert rules["script-src"] == f"'sha256-{digest(script)}'"
    assert rules["style-src-elem"] == f"'sha256-{digest(style)}'"
    assert rules["img-src"] == "data:"
    assert not re.search(r"https?:|\*|unsafe-eval", policy)


def test_the_envelope_is_of_the_first_flight_on_its_clock_and_nothing_where_it_is_not_known() -> None:
    first, second = circle(), labelled(circle(25.0), "slower")
    scatter = Mock(spec=SafetyResult, clock=first.time + 0.0, envelope=np.full((5, 4, len(first.time)), np.nan))
    scatter.envelope[1], scatter.envelope[3] = -1.0, 2.0
    scatter.envelope[3, 1, 0] = np.nan
    lead, ghost = read(flight_page([first, second], envelope=scatter)).contents["flights"]
    assert ghost["envelope"] is None
    own = {name: unpack(text) for name, text in lead["envelope"].items()}
    assert own["time"] == pytest.approx(unpack(lead["time"]), abs=1e-5)
    assert set(own["left"]) == {-1.0}
    assert own["above"][0] == 0.0
    assert set(own["above"][1:]) == {2.0}


def digest(text: str) -> str:
    return base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_names_are_shown_as_they_are_and_make_no_elements(name: str) -> None:
    plain, parsed = read(flight_page([renamed("plain")])), read(flight_page([renamed(name)]))
    assert [tag for tag, _ in parsed.elements] == [tag for tag, _ in plain.elements]
    assert parsed.texts["title"][0] == name
    assert parsed.texts["h1"] == [name]
    assert f"3:{name}" in parsed.texts["button"]
    beside = read(flight_page([circle(), labelled(circle(25.0), name)]))
    assert any(name in text for text in beside.texts["td"])
    assert len(beside.named("script")) == 2


def test_names_of_any_letters_change_nothing_beside_them() -> None:
    page = flight_page([renamed("\u05de\u05e8\u05d5\u05e5\u202e 2014")], [])
    shown = "\u05de\u05e8\u05d5\u05e5\ufffd 2014"
    assert f'<h1 class="long"><bdi>{shown}</bdi></h1>' in page
    assert f"<title>{shown}</title>" in page
    assert "\u202e" not in page
    assert read(flight_page([renamed("$script ${style} $$")])).texts["h1"] == ["$script ${style} $$"]


def test_a_race_of_one_minute_takes_less_than_four_megabytes() -> None:
    flights = [
        dense(half_cuban().flight(), 60.0),
        *(labelled(dense(windy().flight(), 60.0), str(i)) for i in range(3)),
    ]
    assert len(flight_page(flights).encode()) < 4_000_000
    assert len(json.dumps(contents(*flights[:2]))) < 1_500_000


def test_every_leg_can_be_jumped_to() -> None:
    flight = circle()
    parsed = read(flight_page([flight]))
    times = [float(one["data-time"] or "nan") for one in parsed.named("button") if "data-time" in one]
    begins = times[: len(flight.crossings) - 1]  # the legs come first; cues can be jumped to as well
    assert begins == pytest.approx([one.time for one in flight.crossings[:-1]])
    assert [row["data-passing"] for row in parsed.named("tr") if "data-passing" in row] == [
        str(number) for number in range(len(flight.crossings) - 1)
    ]


def test_flights_beside_it_are_listed_with_their_difference() -> None:
    cells = read(whole_page()).texts["td"]
    assert {"20.000", "25.000", "+5.000"} <= set(cells)
    assert "+5.000" not in read(flight_page([circle()])).texts["td"]


def test_the_page_says_what_the_flight_is_in_its_head_and_to_cards_and_films() -> None:
    asked = replace(circle().source, status=Status.CERTIFIED, pilot="race", reserve=ReserveState(0.9))
    page = flight_page([replace(circle(), source=asked)])
    head = page[page.index('<header class="mast">') : page.index("</header>")]
    assert "limits: race; reserve: 0.9 asked, not reached yet: this is the line without" in head
    assert read(page).contents["flights"][0]["stamp"].startswith("as flown, certified; ")


def test_only_a_flight_whose_reserve_was_measured_is_not_said_to_have_none() -> None:
    stamp = replace(circle().stamp, status=Status.CERTIFIED)
    measured = ReserveState(0.9, 0.93, 1000, reached=True)
    for reserve, told in (
        (None, True),
        (ReserveState(0.9), True),
        (measured, False),
        (replace(measured, source="calm.h5"), True),
        (replace(measured, reached=False), True),
    ):
        section = claim_section("certified", Verification(True), replace(stamp, reserve=reserve))
        assert ("the flight has no reserve" in section) is told


def test_a_run_adds_certificate_and_inputs_and_on_request_sensitivities() -> None:
    run = half_cuban()
    stage = run.stage()
    parsed = read(flight_page([stage.flight()], stage_sections(stage)))
    assert stage.certificate is not None
    assert {item.name for item in stage.certificate.items} <= set(parsed.texts["td"])
    assert run.inputs.track.text in parsed.texts["pre"]
    assert run.inputs.aircraft.text in parsed.texts["pre"]
    assert not any("rules.n_z_max" in section for section in stage_sections(stage))
    assert next(iter(stage.sensitivities())) in read("".join(stage_sections(stage, sensitivities=True))).texts["td"]


def test_a_later_stage_lists_the_routes_that_were_tried_before_it(tmp_path: Path) -> None:
    run = half_cuban()
    route = Route("over the top <left>", 9.25, 0.75, "joint")
    first, *later = run.checkpoint.stages
    tried = replace(first, result=replace(first.result, search=SearchReport((route,))))
    explored = replace(run, checkpoint=replace(run.checkpoint, stages=(tried, *later)))
    assert len(explored.stages) > 1
    assert route.text in read(report_page(explored)).texts["td"]
    explored.save(tmp_path / "explored.h5")
    assert route.text in read(report_of_flights([str(tmp_path / "explored.h5")])[0]).texts["td"]
    assert "Routes that were tried" not in report_page(run)


@pytest.mark.parametrize(("evaluated", "words"), [("joint", "on a rough mesh"), (OPTIMUM, "optima of the point-mass")])
def test_race_times_of_routes_are_called_what_they_are(evaluated: str, words: str) -> None:
    result = half_cuban().stage("point-mass").result
    shown = search_section(replace(result, search=SearchReport((Route("flat", 9.25, 0.0, evaluated),))))
    assert words in shown
    assert ("rough" in shown) is (evaluated != OPTIMUM)


def test_a_table_shows_numbers_as_people_write_them() -> None:
    assert [number(one, 1) for one in (-1.25, -0.001, float("nan"))] == ["\N{MINUS SIGN}1.2", "0.0", "\N{EN DASH}"]
    table = Table("caption <", (Column("a", "m", ".1f"), Column("b")), [("<1>", Cell("&", bad=True))])
    assert "caption &lt;" in table.html()
    assert "&lt;1&gt;" in table.html(inline=False)
    assert '<td data-head="b" class="text no">&amp;</td>' in table.html(inline=False)


def test_the_legs_come_with_what_differs_and_what_they_come_near_to() -> None:
    comparison = compare_flights(half_cuban().flight(), windy().flight(label="windy"))
    page = flight_page([comparison.reference, comparison.flight])
    cells = set(read(page).texts["td"])
    assert {", ".join(map(difference_text, leg.differences)) for leg in comparison.legs} <= cells
    assert "Wind: 20 kt from 70 deg against none." in page
    for facts in leg_facts(comparison.reference):
        assert {facts.clearances[0].text, number(facts.clearances[0].distance, 1)} <= cells


def contents(*flights: Flight) -> Any:
    """What the script reads. Any: it is JSON."""
    return json.loads(text_of(*flights))


def text_of(*flights: Flight) -> str:
    comparisons = [compare_flights(flights[0], other) for other in flights[1:]]
    return as_json(contents_of(flights, comparisons, map_model(flights[0].race)))


@given(st.lists(st.floats(width=32)))
def test_numbers_survive_to_the_last_bit_of_32(values: list[float]) -> None:
    assert np.array_equal(unpack(pack(np.array(values))), np.array(values, np.float32), equal_nan=True)


def test_the_format_is_as_its_documentation_has_it() -> None:
    page = contents(circle(), labelled(circle(25.0), "slower"))
    assert page["format"] == FORMAT
    assert list(page) == ["format", "units", "course", "flights", "strips", "colours", "differences", "broadcast"]
    assert list(page["broadcast"]) == ["decimal", "texts"]
    assert list(page["course"]) == [
        "elements",
        "crowd",
        "obstacles",
        "lines",
        "airspace",
        "latitude",
        "elevation",
        "frame",
    ]
    assert list(page["flights"][0]) == [
        "label",
        "named",
        "nation",
        "number",
        "colour",
        "aircraft",
        "race_time",
        "passings",
        "penalties",
        "time",
        "histories",
        "stamp",
        "envelope",
    ]
    assert list(page["strips"][0]) == ["title", "unit", "digits", "lines", "limits", "wraps", "least"]
    assert list(page["colours"][0]) == ["title", "history", "digits", "signed", "unit"]
    assert list(page["differences"][0]) == ["flight", "time", "difference", "legs", "common"]
    assert list(page["differences"][0]["legs"][0]) == ["passing", "lost", "reasons"]


@pytest.mark.parametrize("seconds", [20.0, 31.0])
def test_every_history_has_a_value_per_time(seconds: float) -> None:
    (flight,) = contents(circle(seconds))["flights"]
    assert len(unpack(flight["time"])) == 401
    assert {len(unpack(text)) for text in flight["histories"].values()} == {401}


def test_the_pose_is_that_of_the_flight() -> None:
    flight = half_cuban().flight()
    histories = {name: unpack(text) for name, text in contents(flight)["flights"][0]["histories"].items()}
    pose = {"north": "x", "east": "y", "up": "height", "q0": "b0", "q1": "b1", "q2": "b2", "q3": "b3"}
    for name, history in pose.items():
        np.testing.assert_allclose(histories[name], flight[history], atol=1e-4)
    np.testing.assert_allclose(histories["V_K"] * KNOT, flight["V_K"], rtol=1e-6)


def test_limits_are_drawn_in_the_unit_of_their_strip() -> None:
    run = half_cuban()
    strips = {strip["title"]: strip for strip in contents(run.flight())["strips"]}
    rules, aircraft = run.race.course.rules, run.race.aircraft
    allowed = rules.n_z_allowed.intersect(aircraft.envelope.n_z)
    assert {limit["value"] for limit in strips["Load factor"]["limits"]} == {allowed.lower, allowed.upper}
    fastest = math.degrees(min(rules.p, aircraft.point_mass.p))
    assert max(limit["value"] for limit in strips["Roll rate"]["limits"]) == pytest.approx(fastest)


def test_a_strip_of_which_nothing_is_known_is_left_out() -> None:
    assert {strip["title"] for strip in contents(circle())["strips"]} == {
        "Speed", "Height", "Load factor", "Bank", "Climb", "Energy height"
    }  # fmt: skip
    assert "Surfaces" in {strip.title for strip in STRIPS}


def test_the_clock_starts_at_the_first_passing() -> None:
    late = circle()
    shifted = replace(
        late, time=late.time + 100.0, crossings=tuple(replace(one, time=one.time + 100.0) for one in late.crossings)
    )
    assert contents(shifted)["flights"] == contents(late)["flights"]
    (difference,) = contents(late, shifted)["differences"]
    np.testing.assert_allclose(unpack(difference["difference"]), 0.0, atol=1e-9)


def test_a_flight_that_misses_its_last_passing_has_no_race_time() -> None:
    whole = circle()
    lost = replace(whole, crossings=(*whole.crossings[:-1], replace(whole.crossings[-1], time=math.nan)))
    (flight,) = contents(lost)["flights"]
    assert flight["race_time"] is None
    assert len(flight["passings"]) == len(whole.crossings) - 1


def test_labels_are_as_short_as_tells_flights_of_one_file_apart() -> None:
    one, two = labelled(circle(), "a:six-dof"), labelled(circle(), "a:point-mass")
    assert short_labels([one, two]) == ["six-dof", "point-mass"]
    assert short_labels([one, labelled(two, "b:point-mass")]) == ["a:six-dof", "b:point-mass"]
    assert short_labels([labelled(circle(), "a")]) == ["a"]


@pytest.mark.parametrize("name", HOSTILE)
def test_names_survive_and_hold_nothing_that_could_end_a_script(name: str) -> None:
    flight = renamed(name)
    text = text_of(flight, labelled(flight, f"{flight.label} again"))
    assert not set("<>&") & set(text)
    assert text.isascii()
    page = json.loads(text)
    assert page["flights"][0]["aircraft"]["name"] == name
    assert name in {element["name"] for element in page["course"]["elements"]}


def test_numbers_that_json_does_not_know_are_refused() -> None:
    with pytest.raises(ValueError, match="not JSON compliant"):
        as_json({"frame": [math.inf]})


def test_a_course_with_everything_is_complete(tmp_path: Path) -> None:
    flight = everything_flown(tmp_path)
    assert read(flight_page([flight])).texts["h1"] == ["Everything at once"]
    course = contents(flight)["course"]
    elements = {element["name"]: element for element in course["elements"]}
    assert set(elements) == {passage.element.name for passage in flight.course.passages}
    assert (elements["q/1"]["label"], elements["q/2"]["label"], elements["roll"]["label"]) == ("q", "", "roll")
    assert [len(elements[name]["posts"]) for name in ("start", "corner", "roll")] == [2, 1, 0]
    assert elements["corner"]["reach"] is not None
    crowd = [(crowd["name"], len(crowd["corners"]), crowd["closed"]) for crowd in course["crowd"]]
    assert crowd == [("stands", 2, False), ("tower", 1, False), ("village", 3, True)]
    assert [line["name"] for line in course["lines"]] == ["beach"]
    assert len(course["airspace"]) == 4


def test_pylons_of_a_gate_stand_its_width_apart_and_rise_above_its_heights() -> None:
    flight = circle()
    gates = {passage.element.name: passage.element for passage in flight.course.passages}
    for element in contents(flight)["course"]["elements"]:
        gate = gates[element["name"]]
        if len(element["posts"]) == 2:
            assert math.dist(*element["posts"]) == pytest.approx(gate.width)  # type: ignore[attr-defined]
            assert element["top"] > element["heights"][1] >= element["place"][2] - 20.0


def test_what_stands_nowhere_is_where_the_flight_passed_it() -> None:
    flight = half_cuban().flight()
    places = {element["name"]: element["place"] for element in contents(flight)["course"]["elements"]}
    vertical = next(one for one in flight.crossings if one.name == "1:vertical")
    np.testing.assert_allclose(places["vertical"], [vertical.value(name) for name in ("x", "y", "height")])


def lost_to(first: Flight, other: Flight) -> tuple[Array, Array]:
    return time_lost(compare_flights(first, other))


def test_a_slowed_flight_is_behind_in_proportion_to_the_time() -> None:
    fast = circle()
    for factor in (1.0, 1.25):
        crossings = tuple(replace(one, time=factor * one.time) for one in fast.crossings)
        time, lost = lost_to(fast, replace(fast, time=factor * fast.time, crossings=crossings))
        np.testing.assert_allclose(lost, (factor - 1.0) * time, atol=1e-9)


def test_at_the_passings_it_is_the_difference_of_their_times() -> None:
    first, other = half_cuban().flight(), windy().flight()
    time, lost = lost_to(first, other)
    assert (time[0], time[-1]) == pytest.approx((0.0, first.race_time))
    assert np.all(np.diff(time) > 0.0)
    expected = [two.time - one.time for one, two in zip(first.crossings, other.crossings, strict=True)]
    np.testing.assert_allclose(np.interp([one.time for one in first.crossings], time, lost), expected, atol=1e-9)


def test_legs_that_one_flight_lacks_are_unknown_and_the_others_are_not() -> None:
    whole = circle()
    crossings = [replace(one, time=np.nan) if i == 4 else one for i, one in enumerate(whole.crossings)]
    missed = replace(whole, crossings=tuple(crossings))
    time, lost = lost_to(whole, missed)
    before, after = whole.crossings[3].time, whole.crossings[5].time
    assert np.array_equal(np.isnan(lost), (time > before + 1e-9) & (time <= after + 1e-9))
    assert np.isfinite(lost_to(missed, whole)[1]).all()


def test_flights_of_other_passings_are_refused() -> None:
    other = circling(load_inputs("half_cuban_eight").race, label="elsewhere")
    with pytest.raises(UsageError, match="elsewhere and circle cannot be compared"):
        flight_page([circle(), other])


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two runs of one course."""
    place = tmp_path_factory.mktemp("runs")
    half_cuban().save(place / "still.h5")
    windy().save(place / "windy.h5")
    return place


def run_report(*words: object) -> Result:
    return CliRunner().invoke(app, ["report", *map(str, words)])


def test_a_run_becomes_a_page_and_replaces_a_file_only_by_force(folder: Path, tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    ran = run_report(folder / "still.h5", "--output", page)
    said = f"{page} is written; any browser opens it\n\nstill.h5: verified\n"
    assert (ran.exit_code, ran.output) == (ExitCode.DONE, said)
    parsed = read(page.read_text(encoding="utf-8"))
    assert parsed.texts["h1"] == ["Half Cuban Eight"]
    assert parsed.contents["flights"][0]["race_time"] == pytest.approx(half_cuban().race_time)
    page.write_text("mine", encoding="utf-8")
    assert run_report(folder / "still.h5", "--output", page).exit_code == ExitCode.USAGE
    assert page.read_text(encoding="utf-8") == "mine"
    assert run_report(folder / "still.h5", "--output", page, "--force").exit_code == ExitCode.DONE
    assert page.read_text(encoding="utf-8") != "mine"


def test_stages_and_runs_fly_beside_it(folder: Path, tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    others = (f"{folder / 'still.h5'}:homotopy", folder / "windy.h5")
    assert run_report(folder / "still.h5", *others, "--output", page).exit_code == ExitCode.DONE
    flights = read(page.read_text(encoding="utf-8")).contents["flights"]
    stages = [half_cuban(), half_cuban().stage("homotopy"), windy()]
    assert [one["race_time"] for one in flights] == pytest.approx([stage.race_time for stage in stages])
    assert len({one["label"] for one in flights}) == 3
    page.unlink()
    assert run_report(folder / "still.h5", "--stage", "homotopy", "--output", page).exit_code == ExitCode.DONE
    (flight,) = read(page.read_text(encoding="utf-8")).contents["flights"]
    assert flight["race_time"] == pytest.approx(stages[1].race_time)


def test_sensitivities_are_listed_on_request_unless_it_is_a_guess(folder: Path, tmp_path: Path) -> None:
    still, plain, costly = folder / "still.h5", tmp_path / "plain.html", tmp_path / "costly.html"
    assert run_report(still, "--output", plain).exit_code == ExitCode.DONE
    assert run_report(still, "--output", costly, "--sensitivities").exit_code == ExitCode.DONE
    key = next(iter(half_cuban().sensitivities()))
    assert key in read(costly.read_text(encoding="utf-8")).texts["td"]
    assert key not in read(plain.read_text(encoding="utf-8")).texts["td"]
    ran = run_report(still, "--stage", "homotopy", "--sensitivities", "--output", tmp_path / "guess.html")
    assert ran.exit_code == ExitCode.NOT_CERTIFIED


def test_flights_of_another_course_are_refused_with_a_sentence(folder: Path, tmp_path: Path) -> None:
    still, same, other = folder / "still.h5", tmp_path / "same.h5", tmp_path / "other.h5"
    airrace.optimize("half_cuban_eight", until="homotopy", set={"gates.exit.climb_deg": 1}, search="off").save(same)
    text = half_cuban().inputs.track.text.replace("upright", "level_again")
    (tmp_path / "other.yaml").write_text(text, encoding="utf-8")
    airrace.optimize(tmp_path / "other.yaml", until="homotopy", search="off").save(other)
    assert run_report(still, same, "--output", tmp_path / "a.html").exit_code == ExitCode.DONE
    ran = run_report(still, other, "--output", tmp_path / "b.html")
    assert ran.exit_code == ExitCode.USAGE
    assert re.search(r"other\.h5 and \S*still\.h5 cannot be compared", " ".join(ran.output.split()))
    assert not (tmp_path / "b.html").exists()


@pytest.mark.parametrize(
    ("flight", "code"), [("none.h5", ExitCode.BAD_CHECKPOINT), ("still.h5:five-dof", ExitCode.USAGE)]
)
def test_flights_that_do_not_exist_are_refused(folder: Path, tmp_path: Path, flight: str, code: ExitCode) -> None:
    ran = run_report(folder / "still.h5", folder / flight, "--output", tmp_path / "page.html")
    assert ran.exit_code == code
    assert not (tmp_path / "page.html").exists()


def test_in_python_a_run_writes_its_report(folder: Path, tmp_path: Path) -> None:
    page = half_cuban().report(tmp_path / "page.html", str(folder / "windy.h5"))
    flights = read(page.read_text(encoding="utf-8")).contents["flights"]
    assert [one["race_time"] for one in flights] == pytest.approx([half_cuban().race_time, windy().race_time])
    with pytest.raises(UsageError, match="no stage 'five-dof'"):
        half_cuban().report(tmp_path / "page.html", stage="five-dof")


def test_libraries_are_the_files_that_were_published_under_their_licences() -> None:
    known = json.loads((LIBRARIES / "libraries.json").read_text(encoding="utf-8"))
    assert {path.name for path in LIBRARIES.iterdir() if path.is_dir()} == set(known)
    for name, library in known.items():
        files = {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in (LIBRARIES / name).iterdir()}
        assert files == library["files"]
        assert library["licence"] in (LIBRARIES / name / "LICENSE").read_text(encoding="utf-8")
        assert f"{name}@{library['version']}" in library["source"]


MODULES = sorted((FOLDER / "script").glob("*.js"))
OVERLAY = FOLDER / "script" / "overlay.js"
"""The main module of the live graphic, a page of its own."""


def write_modules(folder: Path, **modules: str) -> Path:
    for name, text in modules.items():
        (folder / f"{name}.js").write_text(text, encoding="utf-8")
    return folder / "main.js"


def test_a_module_stands_behind_what_it_imports(tmp_path: Path) -> None:
    main = write_modules(
        tmp_path,
        main='import { far } from "./a.js";\nimport { near } from "./b.js";\nfar(near);\n',
        a='import { near } from "./b.js";\nexport function far() { return near; }\n',
        b="export const near = 1;\n",
    )
    assert re.findall(r"^// (\w+)\.js", join_modules(main), re.MULTILINE) == ["b", "a", "main"]


def test_both_forms_of_imports_and_exports_become_plain_objects(tmp_path: Path) -> None:
    main = write_modules(
        tmp_path,
        main='import {\n  One,\n  two as second,\n} from "./small.js";import { four } from "./on.js";\nnew One(four);',
        small='/* minified */\nimport{three as t}from"./core.js";class O{}const w=t;export{O as One,w as two};',
        core="export class Other {}\nexport const three = 3;",
        on='export{three as four}from"./core.js";',
    )
    script = join_modules(main)
    assert "const {three: t} = modules[0];" in script
    assert "return {One: O, two: w};" in script
    assert "const {One, two: second} = modules[1];" in script
    assert "return {Other, three};" in script
    assert "return {four: modules[0].three};" in script
    assert not re.search(r"\b(import|export)\b", script)


def test_modules_in_a_circle_are_refused(tmp_path: Path) -> None:
    main = write_modules(tmp_path, main='import { a } from "./a.js";', a='import { b } from "./main.js";')
    with pytest.raises(ValueError, match=r"main\.js imports itself"):
        join_modules(main)


@pytest.mark.parametrize(
    ("line", "problem"),
    [
        ('import "./a.js";', "has a form that is not known"),
        ('import * as a from "./a.js";', "has a form that is not known"),
        ("export default 1;", "has a form that is not known"),
        ("export let a = 1;", "has a form that is not known"),
        ('const text = "</script>";', "end the script"),
        ('const text = "</SCRIPT >";', "end the script"),
        ('const text = "<!--";', "end the script"),
    ],
)
def test_other_forms_and_what_would_end_the_script_in_a_page_are_refused(
    tmp_path: Path, line: str, problem: str
) -> None:
    with pytest.raises(ValueError, match=problem):
        join_modules(write_modules(tmp_path, main=line, a=""))


def test_every_module_is_part_of_a_page_and_says_what_it_is_for() -> None:
    script = page_script()
    both = script + join_modules(OVERLAY)
    assert [path.name for path in MODULES if f"// {path.name}\n" not in both] == []
    assert f"// {OVERLAY.name}\n" not in script
    page_script.cache_clear()
    assert page_script() == script
    for path in [*MODULES, *sorted((FOLDER / "style").glob("*.css"))]:
        assert path.read_text(encoding="utf-8").startswith(("// ", "/* ")), path.name


def test_no_module_writes_html_or_asks_a_network() -> None:
    """Texts reach a page as texts; nothing is evaluated or stored, and nothing fetched but what the live page shows."""
    forbidden = (
        r"innerHTML|outerHTML|insertAdjacentHTML|document\.write|\beval\b|new Function"
        r"|fetch\(|XMLHttp|WebSocket|import\(|localStorage"
    )
    texts = {path.name: path.read_text(encoding="utf-8") for path in MODULES}
    assert texts[OVERLAY.name].count("fetch(") == 1
    texts[OVERLAY.name] = texts[OVERLAY.name].replace('fetch("state"', "")
    assert [name for name, text in texts.items() if re.search(forbidden, text)] == []


def test_the_modules_are_in_the_wheel_with_the_package() -> None:
    """Nothing of the page is left out by git, and so by whoever builds from it."""
    ignored = subprocess.run(
        ["git", "check-ignore", *map(str, FOLDER.rglob("*.*"))], cwd=FOLDER, capture_output=True, text=True, check=False
    )
    assert [line for line in ignored.stdout.splitlines() if "__pycache__" not in line] == []
