"""Several runs in one call, the envelope on the map, and the document for an authority."""

import hashlib
import json
import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command import run as command
from flown_safety_case import CROWD, FLIGHTS, case, flown
from lxml import html
from safety_courses import COURSE, optimum
from short_course import AIRCRAFT, FROM_PLAN

import airrace
from airrace.api.safety import safety
from airrace.errors import StorageError, UsageError
from airrace.files.inputs import Document, inputs_from_documents, load_inputs
from airrace.files.inputs.air import Wind
from airrace.files.inputs.inputs import sources_of
from airrace.flights.safety.disturbances import Gusts, Scatter
from airrace.flights.safety.monte_carlo import OVER_G, Count
from airrace.optimal_control.quantities import KNOT
from airrace.pages.report import browser
from airrace.pages.report.browser import browser_path, print_pdf
from airrace.pages.report.document import Document as Printed
from airrace.runs.run_state import RunState, new_run
from airrace.runs.safety_case import ReplannedFlights, SafetyCase
from airrace.runs.safety_document import IN_WINDS, NO_CROWD, CaseNotes, SimulatedRun, ensure_one_course, safety_document
from airrace.runs.safety_files import ensure_safety_file, write_safety_file
from airrace.runs.safety_rose import SafetyRose, SafetyRuns, fly_runs
from airrace.runs.stage_view import StageView


@pytest.fixture(scope="module")
def stored(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The file of a run."""
    return flown().save(tmp_path_factory.mktemp("runs") / "course.h5")


def simulated(crowd: str = "", every: SafetyCase | SafetyRose | None = None) -> SimulatedRun:
    one = flown(crowd)
    return SimulatedRun(one, one.stage(), case(crowd), every or case(crowd))


def page_of(
    crowd: str = "", rose: SafetyRose | None = None, names: tuple[str, ...] = (), *, drawn: bool = False
) -> html.HtmlElement:
    document = safety_document(simulated(crowd, rose), CaseNotes(sign_for=names), drawn=drawn)
    return html.document_fromstring(document.html())


def chapters(page: html.HtmlElement) -> Mapping[str, str]:
    """The text of every chapter by its heading."""
    return {(one.findtext("h2") or "").partition(" ")[2]: one.text_content() for one in page.iter("section")}


def first_page(page: html.HtmlElement) -> str:
    """All text before the second chapter; the first one holds the results in short."""
    texts: list[str] = []
    sections = 0
    for one in page.find("body"):
        sections += one.tag == "section"
        if sections == 2:
            break
        texts.append(one.text_content())
    return " ".join(texts)


def test_page_holds_all_chapters_and_nothing_that_is_loaded() -> None:
    page = page_of(drawn=True)
    assert not [one for one in page.iter() if one.tag in ("script", "link", "iframe")]
    addresses = [value for one in page.iter() for name, value in one.items() if name in ("src", "href")]
    loaded = [address.split(",")[0] for address in addresses if not address.startswith("#")]
    assert loaded == ["data:image/svg+xml;base64"] * 3
    headings = {one.get("id") for one in page.iter("h2")}
    assert headings == {address[1:] for address in addresses if address.startswith("#")}
    assert list(chapters(page)) == [
        *("Results in short", "Distances of all flights", "Envelope", "What falls where", "Closed-loop flights"),
        *("Loads of the optimum", "The optimum", "Pilot and disturbances", "What was not considered", "Inputs"),
        "Files as they were read",
    ]
    assert all(len(text) > 30 or title == "Envelope" for title, text in chapters(page).items())


def test_first_page_says_whose_race_it_is_what_was_counted_and_that_no_crowd_is_given() -> None:
    told = first_page(page_of())
    contact = case().result.contact
    assert all(
        text in told for text in ("three gates and a pylon", "Edge 540 class", "certified", "wind 8 kt from 250")
    )
    assert f"{contact.flights} of {FLIGHTS} flights" in told
    assert NO_CROWD in told
    assert "too near to the crowd" not in page_of().text_content()


def test_people_are_told_of_where_the_course_names_some() -> None:
    page = page_of(CROWD)
    assert NO_CROWD not in page.text_content()
    assert "crowd stands" in chapters(page)["Distances of all flights"]
    assert "crowd stands" in chapters(page)["What falls where"]


def test_what_is_not_certified_is_said_first() -> None:
    one = flown()
    doubtful = replace(case(), uncertified="the optimum is not certified: six-dof: it may be better")
    of = SimulatedRun(one, one.stage(), doubtful, doubtful)
    page = html.document_fromstring(safety_document(of, drawn=False).html())
    (known,) = page.find_class("known")
    assert "not certified: six-dof: it may be better" in known.text_content()


def test_flights_along_replanned_lines_have_a_chapter() -> None:
    run, both = flown(), replace(case(), replanned=ReplannedFlights(0.5, case().result))
    document = safety_document(SimulatedRun(run, run.stage(), both, both), drawn=False)
    written = chapters(html.document_fromstring(document.html()))
    assert "replanned every 0.5 s" in written["The line replanned"]
    assert "The line replanned" not in chapters(page_of())


def test_a_run_with_reserve_is_flown_in_the_disturbances_of_that_reserve_unless_others_are_named() -> None:
    overrides = ("rules.reserve.probability=0.5", "rules.reserve.gusts=none", "rules.reserve.mass_error_percent=3")
    inputs_ = inputs_from_documents(Document("course.yaml", COURSE), AIRCRAFT, FROM_PLAN, overrides)
    stage = new_run(inputs_, None).with_stage(optimum()).stage()
    scatter = stage.safety(flights=1, threads=1).result.scatter
    assert (scatter.gusts, scatter.wind, scatter.mass, scatter.timing) == ("none", 0.0, 0.03, 0.0)
    named = stage.safety(flights=1, threads=1, mass_error_percent=0.0, roll_timing_s=0.01).result.scatter
    assert (named.gusts, named.mass, named.timing) == ("none", 0.0, 0.01)
    without = flown().stage().safety(flights=1, threads=1).result
    assert (without.scatter, without.pilot.delay) == (Scatter(), 0.1)


def test_a_line_with_reserve_says_so() -> None:
    found = ("measured=0.52", "lower=0.49", "reached=true")
    reserve = ("probability=0.5", *(f"found.{text}" for text in found))
    overrides = ("margins.rules.floor_m=1", *(f"rules.reserve.{text}" for text in reserve))
    given = inputs_from_documents(Document("course.yaml", COURSE), AIRCRAFT, FROM_PLAN, overrides)
    one = new_run(given, None).with_stage(optimum())
    of = SimulatedRun(one, one.stage(), case(), case())
    page = html.document_fromstring(safety_document(of, CaseNotes(sign_for=("Authority",)), drawn=False).html())
    assert "the fastest line with a measured reserve" in first_page(page)
    assert "No reserve" not in page.text_content()
    assert "asked for in light gusts and nothing else" in first_page(page)
    assert "0.52 of 1,000 measured, 0.5 asked" in first_page(page)
    assert "from 1 of its limits" in first_page(page)
    assert "margins.rules.floor_m" in chapters(page)["Inputs"]
    assert "0.5 asked" not in first_page(page_of())


def test_hashes_are_those_of_the_texts_and_paths_of_machines_are_left_out() -> None:
    page = page_of(CROWD)
    told = chapters(page)["Inputs"]
    assert hashlib.sha256((COURSE + CROWD).encode()).hexdigest() in told
    assert hashlib.sha256(AIRCRAFT.text.encode()).hexdigest() in told
    assert "track course.yaml" in told
    assert "folder/" not in page.text_content()
    assert next(one.text_content().strip() for one in page.iter("pre")) == (COURSE + CROWD).strip()


def test_places_to_sign_are_for_whom_they_are_asked() -> None:
    assert not page_of().find_class("signature")
    signs = page_of(names=("Race <b>director</b>", "Authority")).find_class("signature")
    assert [one[0].text_content() for one in signs] == ["Race <b>director</b>", "Authority"]


def test_winds_are_reported_where_they_are_given() -> None:
    rose = SafetyRose("course", {Wind(0.0, 0.0): case(), Wind(90.0, 180.0): "no flight was found: too much wind"})
    told = chapters(page_of(rose=rose))["In every wind and of every aircraft"]
    assert "90 kt from 180" in told
    assert "no flight was found: too much wind" in told
    assert IN_WINDS in told
    runs = {"a.h5": flown(), "b.h5": flown()}
    of = of_runs(runs, dict.fromkeys(runs, case()))
    page = html.document_fromstring(safety_document(of, drawn=False).html())
    assert IN_WINDS not in chapters(page)["In every wind and of every aircraft"]


def numbers_in(content: object) -> tuple[set[str], list[float]]:
    """The number texts in all strings of an object, and all its numbers."""
    texts, numbers = set[str](), list[float]()
    if isinstance(content, str):
        texts.update(NUMBER.findall(content))
    elif isinstance(content, int | float):
        numbers.append(float(content))
    elif isinstance(content, Mapping | list):
        entries: Iterable[Any] = [*content.items()] if isinstance(content, Mapping) else content
        for entry in entries:
            for part in entry if isinstance(entry, tuple) else (entry,):
                more_texts, more_numbers = numbers_in(part)
                texts |= more_texts
                numbers += more_numbers
    return texts, numbers


NUMBER = re.compile(r"(?<![\w.])\d+(?:\.\d+)?(?:e[+-]\d+)?(?!\w)")
"""A number that is no part of a name or of a hash."""


@pytest.mark.parametrize("crowd", ["", CROWD])
def test_every_number_of_the_document_stands_in_its_json(crowd: str, tmp_path: Path) -> None:
    """As a text, or as a number that is rounded to it."""
    rose = SafetyRose(
        "course", {Wind(0.0, 0.0): case(crowd), Wind(5.0, 90.0): case(crowd), Wind(9.0, 0.0): "no flight"}
    )
    of = simulated(crowd, rose)
    page, written = html.document_fromstring(safety_document(of).html()), tmp_path / "case.json"
    write_safety_file(written, of)
    texts, numbers = numbers_in(json.loads(written.read_text(encoding="utf-8")))
    known = np.unique(np.abs(numbers))
    (nav,) = page.iter("nav")
    nav.drop_tree()
    cells = [" ".join(one.itertext()) for one in page.find("body").iter() if one.tag in LEAVES]
    missing: list[str] = []
    for cell in cells:
        for text in NUMBER.findall(cell.replace("\N{MINUS SIGN}", "-")):
            mantissa, _, exponent = text.partition("e")
            near = 0.5 * 10.0 ** (int(exponent or 0) - len(mantissa.partition(".")[2]))
            if text not in texts and not (np.abs(known - float(text)) <= near * (1.0 + 1e-9)).any():
                missing.append(f"{text} of {cell}")
    assert len(cells) > 300
    assert not missing


LEAVES = ("td", "th", "li", "dt", "dd", "p", "pre", "h1", "h3")


def test_least_distances_over_winds_are_the_least_of_each_and_say_where() -> None:
    near, far = case(CROWD), case(CROWD)
    closer = tuple(replace(one, least=one.least - 1.0) for one in near.result.distances)
    rose = SafetyRose(
        "c", {Wind(0.0, 0.0): far, Wind(5.0, 90.0): replace(near, result=replace(near.result, distances=closer))}
    )
    content = json.loads(json.dumps(safety_document(simulated(CROWD, rose), drawn=False).as_object()))
    (short,) = (one["parts"] for one in content["chapters"] if one["title"] == "Results in short")
    (table,) = (one for one in short if isinstance(one, dict) and one["title"].startswith("least distances"))
    for row, thing, own in zip(table["rows"], far.result.distances, closer, strict=True):
        assert (row[0], row[-1]) == (thing.thing.text, "5 kt from 090")
        assert row[2] == own.least
    (crowd, *_) = far.result.distances
    assert crowd.nearer.of == FLIGHTS


def test_who_signs_a_line_without_a_reserve_reads_that_above() -> None:
    page = page_of(names=("Authority",))
    body = page.text_content()
    assert body.index("No reserve") < body.index("Authority")
    assert f"{case().result.broken.flights} of {FLIGHTS} simulated flights break a rule" in body
    assert "No reserve" not in page_of().text_content()


def margined(*overrides: str) -> RunState:
    """A run with some values set, and the optimum of that without."""
    inputs_ = inputs_from_documents(Document("course.yaml", COURSE), AIRCRAFT, FROM_PLAN, overrides)
    return new_run(inputs_, None).with_stage(optimum())


@cache
def reserved() -> RunState:
    """A run whose line keeps a reserve that was measured, in gusts alone."""
    found = ("found.measured=0.52", "found.lower=0.49", "found.reached=true")
    return margined("margins.rules.floor_m=1", *(f"rules.reserve.{text}" for text in ("probability=0.5", *found)))


def of_runs(runs: Mapping[str, RunState], cases: Mapping[str, SafetyCase | SafetyRose | str]) -> SimulatedRun:
    """What was simulated of several runs, the first of which is told of."""
    first = next(iter(runs.values()))
    every = SafetyRuns({name: run.race.aircraft.name for name, run in runs.items()}, cases)
    own = next(flights for flights in cases.values() if isinstance(flights, SafetyCase))
    return SimulatedRun(first, first.stage(), own, every, runs)


def known(of: SimulatedRun, title: str = "No reserve") -> list[str]:
    """The sentences that stand in a frame of the document below this title."""
    page = html.document_fromstring(safety_document(of, CaseNotes(sign_for=("Authority",)), drawn=False).html())
    frames = [frame for frame in page.find_class("known") if title in frame.text_content()]
    return [sentence.text_content() for frame in frames for sentence in frame.iter("li", "p") if len(sentence) == 0]


def test_every_run_without_a_reserve_is_named_above_the_signatures() -> None:
    runs = {"safe.h5": reserved(), "fast.h5": flown()}
    of = of_runs(runs, dict.fromkeys(runs, case()))
    told = first_page(html.document_fromstring(safety_document(of, drawn=False).html()))
    assert "safe.h5: the fastest line with a measured reserve" in told
    assert "safe.h5: 0.52 of 1,000 measured" in told
    assert "fast.h5: none" in told
    (sentence,) = [text for text in known(of) if ".h5" in text]
    assert "The line of fast.h5 has no measured reserve" in sentence
    assert f"{case().result.broken.flights} of {FLIGHTS} simulated flights break a rule" in sentence


def test_a_reserve_holds_in_the_wind_in_which_it_was_measured() -> None:
    run, own = reserved(), reserved().race.air.wind
    assert own is not None
    own_wind = Wind(own.speed / KNOT, math.degrees(own.origin))
    rose = SafetyRose("course", {own_wind: case(), Wind(5.0, 90.0): case(), Wind(9.0, 0.0): "no flight"})
    sentences = " ".join(known(SimulatedRun(run, run.stage(), case(), rose)))
    assert "The line of 5 kt from 090 has no measured reserve, for that of its run was measured in another" in sentences
    assert "Nothing is known of a line of 9 kt from 000: no flight" in sentences
    assert own_wind.text not in sentences


def document_tables(of: SimulatedRun) -> dict[str, dict[str, Any]]:
    """The tables of a document by their titles, as in its JSON."""
    content: Any = safety_document(of, drawn=False).as_object()
    parts = [*content["first_page"], *(part for chapter in content["chapters"] for part in chapter["parts"])]
    return {part["title"]: part for part in parts if isinstance(part, dict) and "columns" in part}


def test_gates_and_distances_are_those_of_the_rules_and_margins_stand_apart() -> None:
    run = margined("margins.gates.last.height_min_m=2", "margins.rules.floor_m=1")
    with_margins, without = (
        document_tables(SimulatedRun(flown_run, flown_run.stage(), case(), case())) for flown_run in (run, flown())
    )
    assert with_margins["Gates"]["rows"] == without["Gates"]["rows"]
    assert with_margins["Of the optimum alone"]["rows"] == without["Of the optimum alone"]["rows"]
    (title,) = set(with_margins) - set(without)
    rows = {row[0]: row[1:] for row in with_margins[title]["rows"]}
    assert rows["rules.floor_m"] == [run.race.by_rules.course.rules.height.lower, 1.0, "m"]


def test_all_disturbances_are_told_and_where_they_are_not_those_of_the_reserve() -> None:
    page = html.document_fromstring(safety_document(simulated(), drawn=False).html())
    errors = "wind 2.5 kt, mass 2 %, power 2 %, density 1 %, rolls 20 ms"
    assert f"in light gusts and errors of {errors}, with a pilot's delay of 0.1 s" in first_page(page)
    run = reserved()
    result = replace(case().result, scatter=Scatter(Gusts.LIGHT, 0.0, 0.0, 0.0, 0.0, 0.0))
    as_asked = replace(case(), result=result)
    for flights, differs in ((case(), True), (as_asked, False)):
        of = SimulatedRun(run, run.stage(), flights, flights)
        text = first_page(html.document_fromstring(safety_document(of, drawn=False).html()))
        assert ("not the disturbances that the reserve was asked for in" in text) is differs
    both = of_runs({"safe.h5": run, "fast.h5": flown()}, {"safe.h5": as_asked, "fast.h5": case()})
    text = first_page(html.document_fromstring(safety_document(both, drawn=False).html()))
    assert "in light gusts and nothing else, with a pilot's delay of 0.1 s (safe.h5); in light gusts and errors" in text


def test_results_in_short_are_those_of_the_worst_case_with_its_name() -> None:
    none, most, result = Count.with_interval(0, FLIGHTS), Count.with_interval(FLIGHTS - 1, FLIGHTS), case().result
    counts = dict.fromkeys(result.counts, none)
    good = replace(case(), result=replace(result, contact=none, counts=counts))
    worse = replace(result, contact=most, counts={**counts, OVER_G: most})
    bad = replace(case(), result=worse, uncertified="the optimum is not certified")
    runs = {"good.h5": flown(), "bad.h5": flown()}
    of = of_runs(runs, {"good.h5": good, "bad.h5": bad})
    rows = document_tables(of)["Of all cases the worst"]["rows"]
    assert rows[0][1:] == [f"{FLIGHTS - 1} of {FLIGHTS} flights; 86.84 to 99.94 % (confidence 95 %)", "bad.h5"]
    assert rows[1][2] == "good.h5"  # as bad as the other
    assert rows[-1][2] == "bad.h5"
    assert "The optimum is not certified (bad.h5)." in known(of, "To be known first")


def test_files_hashes_and_aircraft_of_all_runs_are_inputs_and_their_mark(tmp_path: Path) -> None:
    heavy = Document("heavy.yaml", AIRCRAFT.text.replace("name: ", "name: heavy ", 1))
    inputs_ = inputs_from_documents(Document("course.yaml", COURSE), heavy, FROM_PLAN, ())
    runs = {
        "a.h5": flown().save(tmp_path / "a.h5"),
        "b.h5": new_run(inputs_, None).with_stage(optimum()).save(tmp_path / "b.h5"),
    }
    opened = {name: airrace.open(path) for name, path in runs.items()}
    printed = safety_document(of_runs(opened, dict.fromkeys(runs, case())), drawn=False)
    page = html.document_fromstring(printed.html())
    digests = [hashlib.sha256(path.read_bytes()).hexdigest() for path in runs.values()]
    assert all(digest in chapters(page)["Inputs"] for digest in digests)
    assert hashlib.sha256(heavy.text.encode()).hexdigest() in chapters(page)["Inputs"]
    assert "b.h5: aircraft heavy.yaml" in chapters(page)["Inputs"]
    texts = [text.text_content().strip() for text in page.iter("pre")]
    assert texts.count(COURSE.strip()) == 1
    assert heavy.text.strip() in texts
    assert printed.mark == f"runs {digests[0][:8]} {digests[1][:8]}"


def test_the_first_run_with_flights_is_told_of(stored: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    unsteady, written, fly = flown().save(tmp_path / "unsteady.h5"), tmp_path / "case.html", StageView.safety

    def fly_or_not(view: StageView, **options: Any) -> SafetyCase:
        if options["label"] == unsteady.name:
            raise UsageError("a pilot cannot hold this optimum")
        return fly(view, **options)

    monkeypatch.setattr(StageView, "safety", fly_or_not)
    arguments = ("--flights", str(FLIGHTS), "--threads", "1", "--output", written)
    assert command("safety", unsteady, stored, *arguments).code == 5
    told = html.document_fromstring(written.read_text(encoding="utf-8")).text_content()
    assert "a pilot cannot hold this optimum" in told
    assert f"{FLIGHTS} closed-loop flights, in light gusts" in told


def test_runs_of_different_courses_are_refused_before_they_are_flown(
    stored: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ensure_one_course({"a.h5": flown(), "b.h5": reserved(), "c.h5": margined("rules.pilot=race")})
    monkeypatch.setattr(StageView, "safety", lambda *_, **__: pytest.fail("it is flown"))
    wider = margined("gates.first.width_m=14", "name=another course").save(tmp_path / "wider.h5")
    for name in ("case.html", "case.json"):
        ran = command("safety", stored, wider, "--flights", str(FLIGHTS), "--output", tmp_path / name)
        assert ran.code == 2
        assert f"{stored} (three gates and a pylon) and {wider} (another course)" in ran.err


def test_the_first_page_says_for_whom_when_and_where() -> None:
    notes = CaseNotes(prepared_for="Authority of <b>air</b>", valid="2026-12-05", revision="3b")
    page = html.document_fromstring(safety_document(simulated(), notes, drawn=False).html())
    told = first_page(page)
    for text in ("Authority of <b>air</b>", "2026-12-05", "3b", "the fastest line that was found", "Contents"):
        assert text in told
    gates = next(iter(page.find("body").iter("table")))
    assert [row[0].text_content() for row in gates.find("tbody")] == ["first", "side", "last"]
    assert "not stated" in first_page(page_of())


def test_no_table_has_two_columns_of_one_name_or_one_without_values() -> None:
    document = safety_document(simulated(CROWD), drawn=False).as_object()
    tables = [part for chapter in document["chapters"] for part in chapter["parts"] if isinstance(part, dict)]  # pyright: ignore
    tables = [table for table in tables if "columns" in table]
    assert len(tables) > 8
    for table in tables:
        assert len(set(table["columns"])) == len(table["columns"]), table["columns"]
        for number, name in enumerate(table["columns"]):
            if table["rows"]:
                assert any(row[number] not in (None, "") for row in table["rows"]), name


def test_a_mark_that_css_would_not_take_is_refused() -> None:
    with pytest.raises(ValueError, match="escaped"):
        Printed("title", [], [], 'run"; }').html()


def test_sources_are_those_of_the_files() -> None:
    found = {what: source for what, _, source in sources_of(load_inputs("rovinj_2014"))}
    assert "FlightGear" in found["track"]
    assert "Red Bull Air Race" in found["rules rbar-2014"]
    assert set(found) == {"track", "rules rbar-2014", "aircraft"}


def test_runs_stand_below_one_another_and_one_that_fails_costs_no_other() -> None:
    def fly(one: RunState) -> SafetyCase:
        if one is flown(CROWD):
            raise UsageError("a pilot cannot hold this optimum")
        return case()

    found = fly_runs({"a.h5": flown(), "b.h5": flown(CROWD)}, fly)
    rows = found.table().objects()
    assert [(row["run"], row["aircraft"]) for row in rows] == [("a.h5", "Edge 540 class"), ("b.h5", "Edge 540 class")]
    assert rows[0]["contact_percent"] == 100.0 * case().result.contact.share
    assert rows[1]["remark"] == "a pilot cannot hold this optimum"
    assert found.messages == ("b.h5: a pilot cannot hold this optimum",)
    with pytest.raises(UsageError, match=r"^a pilot cannot hold this optimum$"):
        fly_runs({"b.h5": flown(CROWD), "c.h5": flown(CROWD)}, fly)


def test_winds_of_runs_stand_below_one_another() -> None:
    rose = SafetyRose("course", {Wind(0.0, 0.0): case(), Wind(5.0, 90.0): "no flight was found"})
    table = fly_runs({"a.h5": flown(), "b.h5": flown(CROWD)}, lambda _: rose).table()
    assert [(row["run"], row["wind"]) for row in table.objects()] == [
        (run, wind) for run in ("a.h5", "b.h5") for wind in ("calm", "5 kt from 090")
    ]
    assert len({len(row) for row in table.rows}) == 1


def test_command_writes_a_document_and_an_envelope(stored: Path, tmp_path: Path) -> None:
    written = tmp_path / "case.html"
    common = ("safety", stored, "--flights", str(FLIGHTS), "--threads", "1", "--quiet")
    assert command(*common, "--sign-for", "Authority", "--output", written).code == 0
    page = html.document_fromstring(written.read_text(encoding="utf-8"))
    assert hashlib.sha256(stored.read_bytes()).hexdigest() in chapters(page)["Inputs"]
    assert command(*common, "--output", tmp_path / "envelope.svg").code == 0
    assert (tmp_path / "envelope.svg").read_text(encoding="utf-8").startswith("<?xml")


def test_python_writes_the_same_document(stored: Path, tmp_path: Path) -> None:
    run = airrace.open(stored)
    found = run.safety(flights=FLIGHTS, threads=1, output=tmp_path / "case.html")
    assert found.result.contact == case().result.contact
    written = (tmp_path / "case.html").read_text(encoding="utf-8")
    assert written == safety_document(SimulatedRun(run, run.stage(), found, found)).html()


def test_nobody_who_signs_asks_for_no_document(stored: Path) -> None:
    nobody: list[str] = []
    assert isinstance(safety(stored, flights=1, threads=1, sign_for=nobody), SafetyCase)


def test_command_takes_several_runs(stored: Path, tmp_path: Path) -> None:
    other = flown(CROWD).save(tmp_path / "other.h5")
    ran = command("safety", stored, other, "--flights", "2", "--threads", "1", "--json")
    assert ran.code == 0
    assert [row["run"] for row in ran.answer["runs"]] == [str(stored), str(other)]
    assert ran.answer["cases"][str(other)]["flights"] == 2


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--output", "case.txt"), ".html or .pdf for documents"),
        (("--output", "case.html", "--flights", "39"), "an envelope needs 40 flights or more, not 39"),
        (("--output", "case.png", "OTHER"), "of one run; 2 runs are given"),
        (("--sign-for", "me"), "--sign-for is part of a document: name one with --output, .html, .pdf or .json"),
        (("--valid", "2026", "--output", "case.csv"), "--valid is part of a document"),
        (("--winds", "5"), "is no rose of winds"),
        (("--winds", "5kt", "--stage", "six-dof"), "exclude each other"),
        (("--winds", "5kt", "--replan", "1"), "name one run, without --winds"),
        (("--replan", "1", "OTHER"), "name one run, without --winds"),
        (("--replan", "0"), "it must be every 0.1 to 10 s"),
        (("--delay", "0.13", "OTHER"), "the pilot decides every 0.02 s"),
    ],
)
def test_what_is_impossible_is_reported_in_one_line(
    arguments: tuple[str, ...], message: str, stored: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    ran = command("safety", stored, *(str(stored) if one == "OTHER" else one for one in arguments))
    assert ran.code == 2
    assert message in ran.err
    assert ran.err.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_without_a_browser_there_is_another_way(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(UsageError, match=r"write \.html and print that"):
        ensure_safety_file(tmp_path / "case.pdf", FLIGHTS, 1)


def test_a_browser_that_does_not_print_is_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    broken = tmp_path / "chromium"
    broken.write_text("#!/bin/sh\necho no display >&2\n", encoding="utf-8")
    broken.chmod(0o755)
    monkeypatch.setattr(browser, "browser_path", lambda: str(broken))
    with pytest.raises(StorageError, match="did not print"):
        print_pdf("<p>words</p>")


@pytest.mark.slow
def test_a_document_is_printed_on_pages(tmp_path: Path) -> None:
    try:
        browser_path()
    except UsageError:
        pytest.skip("no browser is installed that prints")
    one = flown()
    printed = print_pdf(safety_document(SimulatedRun(one, one.stage(), case(), case())).html())
    assert printed.startswith(b"%PDF-")
    assert 8 <= len(re.findall(rb"/Type /Page\b", printed)) <= 14
    assert set(re.findall(rb"/MediaBox \[([^]]*)\]", printed)) == {b"0 0 594.95996 841.91998"}
