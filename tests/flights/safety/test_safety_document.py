"""Several runs in one call, the envelope on the map, and the document for an authority."""

import hashlib
import re
from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from command import run as command
from lxml import html
from safety_courses import COURSE, inputs, optimum
from short_course import AIRCRAFT, FROM_PLAN

import airrace
from airrace.errors import StorageError, UsageError
from airrace.files.inputs import Document, inputs_from_documents, load_inputs
from airrace.files.inputs.air import Wind
from airrace.files.inputs.inputs import sources_of
from airrace.flights.safety.monte_carlo import SafetyResult
from airrace.optimal_control.trajectory import Array
from airrace.pages.report import browser
from airrace.pages.report.browser import browser_path, print_pdf
from airrace.pages.report.document import document_page
from airrace.pages.views.drawing import figure_address
from airrace.pages.views.safety_views import BANDS, envelope_figure
from airrace.runs.run_state import RunState, new_run
from airrace.runs.safety_case import ReplannedFlights, SafetyCase
from airrace.runs.safety_files import NO_CROWD, ensure_safety_file, safety_document
from airrace.runs.safety_rose import SafetyRose, fly_runs

CROWD = "crowd: {stands: {polygon: [{north_m: 500, east_m: 400}, {north_m: 600, east_m: 400}, \
{north_m: 600, east_m: 450}], distance_m: 100}}\n"
FLIGHTS = 40
"""The fewest of an envelope of 95 %."""


@cache
def flown(crowd: str = "") -> RunState:
    """A run with the six-dof optimum, with people beside the course or without."""
    given = inputs_from_documents(Document("folder/course.yaml", COURSE + crowd), AIRCRAFT, FROM_PLAN, ())
    return new_run(given if crowd else inputs(), None).with_stage(optimum())


@cache
def case(crowd: str = "") -> SafetyCase:
    """Few closed-loop flights of it."""
    return flown(crowd).stage().safety(flights=FLIGHTS, threads=1, label="course.h5")


@pytest.fixture(scope="module")
def stored(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The file of a run."""
    return flown().save(tmp_path_factory.mktemp("runs") / "course.h5")


def page_of(crowd: str = "", rose: SafetyRose | None = None, names: tuple[str, ...] = ()) -> html.HtmlElement:
    one = flown(crowd)
    return html.document_fromstring(safety_document(one, one.stage(), case(crowd), rose, names))


def chapters(page: html.HtmlElement) -> Mapping[str, str]:
    """The text of every chapter by its heading."""
    return {one.findtext("h2") or "": one.text_content() for one in page.iter("section")}


def first_page(page: html.HtmlElement) -> str:
    """All text before the first chapter."""
    texts: list[str] = []
    for one in page.find("body"):
        if one.tag == "section":
            break
        texts.append(one.text_content())
    return " ".join(texts)


def test_page_holds_all_chapters_and_nothing_that_is_loaded() -> None:
    page = page_of()
    assert not [one for one in page.iter() if one.tag in ("script", "link", "iframe")]
    addresses = [value for one in page.iter() for name, value in one.items() if name in ("src", "href")]
    assert [address.split(",")[0] for address in addresses] == ["data:image/svg+xml;base64"] * 2
    assert list(chapters(page)) == [
        *("Envelope", "What falls where", "Closed-loop flights", "Distances of the optimum", "Loads of the optimum"),
        *("Falls and glides", "The optimum", "Pilot and disturbances", "What was not considered", "Inputs"),
        "Files as they were read",
    ]
    assert all(len(text) > 30 or title in ("Envelope", "What falls where") for title, text in chapters(page).items())


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
    assert "m from stands, required 100 m" in first_page(page)
    assert "stands" in chapters(page)["Falls and glides"]


def test_what_is_not_certified_is_said_first() -> None:
    one = flown()
    doubtful = replace(case(), uncertified="the optimum is not certified: six-dof: it may be better")
    page = html.document_fromstring(safety_document(one, one.stage(), doubtful))
    (known,) = page.find_class("known")
    assert "not certified: six-dof: it may be better" in known.text_content()


def test_flights_along_replanned_lines_have_a_chapter() -> None:
    run, both = flown(), replace(case(), replanned=ReplannedFlights(0.5, case().result))
    written = chapters(html.document_fromstring(safety_document(run, run.stage(), both)))
    assert "replanned every 0.5 s" in written["The line replanned"]
    assert "The line replanned" not in chapters(page_of())


def test_a_line_with_reserve_says_so() -> None:
    found = ("measured=0.52", "lower=0.49", "reached=true")
    reserve = ("probability=0.5", *(f"found.{text}" for text in found))
    overrides = ("margins.rules.floor_m=1", *(f"rules.reserve.{text}" for text in reserve))
    given = inputs_from_documents(Document("course.yaml", COURSE), AIRCRAFT, FROM_PLAN, overrides)
    one = new_run(given, None).with_stage(optimum())
    page = html.document_fromstring(safety_document(one, one.stage(), case()))
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
    told = chapters(page_of(rose=rose))["In many winds"]
    assert "90 kt from 180" in told
    assert "no flight was found: too much wind" in told


def test_a_mark_that_css_would_not_take_is_refused() -> None:
    with pytest.raises(ValueError, match="escaped"):
        document_page("title", [], 'run"; }')


def test_sources_are_those_of_the_files() -> None:
    found = {what: source for what, _, source in sources_of(load_inputs("rovinj_2014"))}
    assert "FlightGear" in found["track"]
    assert "Red Bull Air Race" in found["rules rbar-2014"]
    assert set(found) == {"track", "rules rbar-2014", "aircraft"}


def with_envelope(lower: float, upper: float) -> SafetyResult:
    """The flights as if all strayed to either side as far all along."""
    result = case().result
    envelope = np.zeros_like(result.envelope)
    envelope[:, 0] = np.array([lower, lower, 0.5 * (lower + upper), upper, upper])[:, None]
    return replace(result, envelope=envelope)


def bands(result: SafetyResult) -> tuple[list[Array], float]:
    """The pieces of both bands on the map, east and north, and how many times as far off they are drawn."""
    figure = envelope_figure(result, flown().flight())
    axes = figure.axes[0]
    drawn = [one for one in axes.collections if type(one).__name__ == "PolyCollection"]
    widening = float(re.search(r"drawn ([\d.]+) times", axes.get_title(loc="left"))[1])  # pyright: ignore[reportOptionalSubscript] it is there
    return [np.array([path.vertices[:4] for path in one.get_paths()]) for one in drawn], widening


def test_bands_lie_beside_the_line_to_the_side_and_as_far_as_is_said() -> None:
    flight = flown().flight()
    for low, high in ((-1.0, 1.0), (0.0, 2.0)):
        (outer, inner), widening = bands(with_envelope(low, high))
        assert len(outer) == len(inner) == len(case().result.clock) - 1
        line = np.stack([np.interp(case().result.clock, flight.time, flight[name]) for name in ("y", "x")], axis=1)
        chi = np.interp(case().result.clock, flight.time, np.unwrap(flight["chi"]))
        right = np.stack([np.cos(chi), -np.sin(chi)], axis=1)
        for corner, at, quantile in ((0, slice(None, -1), low), (2, slice(1, None), high)):
            off = np.einsum("ij,ij->i", outer[:, corner] - line[at], right[at])
            assert off == pytest.approx(np.full(len(off), widening * quantile), abs=0.05 * widening)


def test_a_band_that_is_not_known_is_not_drawn() -> None:
    result = case().result  # too few flights for 99.7 %
    (only,), _ = bands(result)
    assert len(only) == len(result.clock) - 1
    labels = envelope_figure(result, flown().flight()).axes[0].get_legend_handles_labels()[1]
    assert f"{BANDS[1][2]} of the flights" in labels
    assert f"{BANDS[0][2]} of the flights" not in labels


def test_the_same_drawing_has_the_same_address() -> None:
    first, second = (figure_address(envelope_figure(case().result, flown().flight())) for _ in range(2))
    assert first == second


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
    assert written == safety_document(run, run.stage(), found)


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
        (("--output", "case.html", "OTHER"), "of one run; 2 runs are given"),
        (("--sign-for", "me"), "--sign-for leaves a place in a document"),
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
    printed = print_pdf(safety_document(one, one.stage(), case()))
    assert printed.startswith(b"%PDF-")
    assert 8 <= len(re.findall(rb"/Type /Page\b", printed)) <= 14
    assert set(re.findall(rb"/MediaBox \[([^]]*)\]", printed)) == {b"0 0 594.95996 841.91998"}
