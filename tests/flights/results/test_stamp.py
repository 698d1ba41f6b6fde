"""The stamp of a flight says what it is, in one line and as names and values."""

import io
import math
import zipfile
from dataclasses import replace

import pytest
from example_flights import circling, half_cuban, rovinj
from scipy.io import loadmat

from airrace.files.export.formats import formats
from airrace.files.export.globe import BEGIN, on_globe
from airrace.files.inputs import load_inputs
from airrace.flights.results import Verification
from airrace.flights.results.stamp import ReserveState, Stamp, air_text
from airrace.model.environment import Air, StaticWind, Thermal
from airrace.optimal_control.certificate import Certificate, Item
from airrace.optimal_control.quantities import KNOT
from airrace.procedure.planning.parameters import with_margins
from airrace.procedure.result import Status
from airrace.runs.json_objects import stamp_object
from airrace.runs.reserve_attempts import reserve_state
from airrace.runs.stage_view import StageView
from airrace.runs.verdict import downgrade_stale

OPTIMUM = Stamp("six-dof", Status.CERTIFIED, (), "Edge 540", "still air, 15 C, 1.225 kg/m3", "race")


FOUND = tuple(
    f"rules.reserve.{line}"
    for line in ("probability=0.9", "found.measured=0.93", "found.lower=0.91", "found.reached=true")
)


def view(*overrides: str) -> StageView:
    """The point mass of a run whose inputs have these values, though it was flown without."""
    return replace(half_cuban().stage(), inputs=load_inputs("half_cuban_eight", overrides=overrides))


def test_all_of_it_stands_in_one_line_and_as_names_and_values() -> None:
    assert OPTIMUM.text == (
        "six-dof, certified; Edge 540; still air, 15 C, 1.225 kg/m3; pilot's limits: race; reserve: none"
    )
    assert list(OPTIMUM.entries()) == ["stage", "certificate", "aircraft", "air", "pilot's limits", "reserve"]
    assert all(value in OPTIMUM.text for value in OPTIMUM.entries().values())


@pytest.mark.parametrize(
    ("status", "failed", "verdict"),
    [
        (Status.CERTIFIED, (), "certified"),
        (Status.SOLVED, (), "not certified: solved on one mesh"),
        (Status.GUESS, (), "not certified: a guess"),
        (Status.NOT_CERTIFIED, ("clearance", "kkt_error"), "not certified: clearance, kkt_error"),
        (Status.TIMEOUT, (), "not certified: timeout"),
    ],
)
def test_what_is_not_certified_says_why(status: Status, failed: tuple[str, ...], verdict: str) -> None:
    stamp = replace(OPTIMUM, status=status, failed=failed)
    assert stamp.verdict == verdict
    assert stamp.certified is (status is Status.CERTIFIED)


def test_the_items_that_fail_are_named_and_so_is_what_else_speaks_against_a_stage() -> None:
    one = half_cuban().stage()
    assert one.certificate is not None
    broken = replace(one.certificate, items=(*one.certificate.items, Item("clearance", 2.0, 1.0)))
    assert isinstance(broken, Certificate)
    assert replace(one, result=replace(one.result, certificate=broken)).stamp.verdict == "not certified: clearance"
    stale = replace(one, stale="its course changed", result=downgrade_stale(one.result, "its course changed"))
    assert stale.stamp.verdict == "not certified: it no longer stands"
    refuted = Verification(False, "kkt_error is another")
    shown = replace(one, verification=refuted, result=downgrade_stale(one.result, "", refuted.refutation))
    assert shown.stamp.verdict == "not certified: verification failed"


def test_a_recorded_flight_has_neither_certificate_nor_limits_of_a_pilot() -> None:
    stamp = circling(rovinj(StaticWind(math.radians(315.0), 10.0 * KNOT))).stamp
    assert list(stamp.entries()) == ["stage", "aircraft", "air"]
    assert stamp.text.startswith("as flown; ")
    assert "wind 10 kt from 315 degrees" in stamp.text


def test_the_air_is_that_at_the_height_of_the_origin() -> None:
    assert air_text(Air()) == "still air, 15 C, 1.225 kg/m3"
    assert air_text(Air(temperature_offset=20.0, elevation=1000.0)) == "still air, 28 C, 1.046 kg/m3"
    thermal = Thermal(0.0, 0.0, 2.0, 1000.0)
    assert air_text(Air(thermals=(thermal,))).endswith(", 1 thermal")
    assert air_text(Air(thermals=(thermal, thermal))).endswith(", 2 thermals")


@pytest.mark.parametrize(
    ("overrides", "name"),
    [
        (["rules.pilot=none"], "none"),
        (["rules.pilot=race"], "race"),
        (["rules.pilot.preset=race", "rules.pilot.n_z_min_low=0"], "race"),
        (["rules.pilot.preset=race", "rules.pilot.n_z_min_low=0.5"], "race, changed"),
        (["rules.pilot.preset=none", "rules.pilot.n_z_min_low=0.5"], "own"),
    ],
)
def test_limits_of_a_pilot_are_named_by_what_they_are(overrides: list[str], name: str) -> None:
    one = view(*overrides)
    assert one.stamp.pilot == name
    assert one.flight().stamp == one.stamp


def test_margins_are_not_taken_for_other_limits_of_a_pilot() -> None:
    assert view("rules.pilot=race", "margins.rules.floor_m=0.05").stamp.pilot == "race"


def test_a_reserve_is_reported_as_asked_as_reached_and_as_missed() -> None:
    wanted = ("rules.reserve.probability=0.9",)
    found = (*wanted, "rules.reserve.found.measured=0.93", "rules.reserve.found.lower=0.91")
    assert view().stamp.reserve_text == "none"
    assert view(*wanted).stamp.reserve_text == "0.9 asked, not reached yet: this is the line without"
    reached = view(*found, "rules.reserve.found.reached=true").stamp.reserve_text
    assert reached == "0.93 of 1,000 measured, 0.9 asked"
    missed = view(*found, "rules.reserve.found.reached=false", "rules.reserve.found.flights=400").stamp.reserve_text
    assert missed == "0.9 asked, not reached: 0.93 of 400 measured"
    assert view("margins.rules.floor_m=0.05").stamp.reserve_text == "none asked, margins of the inputs"
    assert reserve_state(None) is None


def test_margins_of_another_run_are_not_called_measured() -> None:
    text = replace(OPTIMUM, reserve=ReserveState(0.9, 0.93, 1000, reached=True, source="calm.h5")).reserve_text
    assert text == "0.9 asked, margins of calm.h5: 0.93 of 1,000 measured there, not of this flight"


def test_margins_by_hand_are_seen_in_the_race_itself() -> None:
    race = with_margins(rovinj(), {"rules.floor_m": 1.0})
    assert circling(race).stamp.by_hand
    assert not circling(rovinj()).stamp.by_hand


@pytest.mark.parametrize(
    ("overrides", "by_hand"),
    [
        ((), False),
        (("margins.rules.floor_m=0.05",), True),
        (("rules.reserve.probability=0.9",), False),
        ((*FOUND, "margins.rules.floor_m=0.05"), False),
    ],
)
def test_programs_are_told_of_margins_by_hand_and_not_of_those_that_a_search_found(
    overrides: tuple[str, ...], by_hand: bool
) -> None:
    assert stamp_object(view(*overrides).stamp)["margins_by_hand"] is by_hand


def test_margins_are_no_question_of_a_recorded_flight() -> None:
    assert stamp_object(circling(with_margins(rovinj(), {"rules.floor_m": 1.0})).stamp)["margins_by_hand"] is None


def readable(name: str, content: bytes) -> str:
    """All texts of a file, as plain as its format has them."""
    match name:
        case "kmz":
            with zipfile.ZipFile(io.BytesIO(content)) as zipped:
                return zipped.read("doc.kml").decode()
        case "mat":
            return str(loadmat(io.BytesIO(content), simplify_cells=True))
        case _:
            return content.decode("utf-8", "replace")


@pytest.mark.parametrize("name", sorted(formats()))
def test_every_format_says_what_the_flight_is(name: str) -> None:
    if name == "parquet":
        pytest.importorskip("pyarrow")
    one = on_globe(circling(rovinj()), None).at_rate(20.0)
    asked = replace(
        one.source, stage="six-dof", status=Status.NOT_CERTIFIED, failed=("clearance",), pilot="race, changed"
    )
    told = readable(
        name, formats()[name].write([replace(one, source=replace(asked, reserve=ReserveState(0.9)))], BEGIN)
    )
    for text in ("not certified: clearance", "1.225 kg/m3", "not reached yet: this is the line without"):
        assert text in told, name
    assert "race, changed" in told.replace("\\,", ",").replace("race;", "race,")
