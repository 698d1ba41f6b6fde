"""What is claimed of an optimum: a minimum only where its curvature tells so, and nothing of a saddle."""

import math
from dataclasses import replace

import pytest
from fake_optimizer import solve_roughly, solve_single_mesh, stage_result

from airrace.optimal_control.certificate import Curvature, SecondOrder
from airrace.pages.views.stage_tables import claim
from airrace.procedure.certification import negative_curvature
from airrace.procedure.result import Note, NoteKind, Route, SearchReport, StageResult
from airrace.procedure.stage import Stage


def told(curvature: Curvature, least: float) -> SecondOrder:
    return SecondOrder(curvature, 1e-4, least, "1:g1 -> 1:finish", "commanded throttle", 12, 3)


def flown(second_order: SecondOrder) -> StageResult:
    """A stage of which the curvature tells that."""
    result = stage_result(Stage.POINT_MASS)
    assert result.certificate is not None
    items = (*result.certificate.items, negative_curvature(second_order))
    return replace(result, certificate=replace(result.certificate, items=items, second_order=second_order))


@pytest.mark.parametrize(
    ("curvature", "least", "words"),
    [
        (Curvature.POSITIVE, math.nan, "certified: a local minimum, all limits"),
        (
            Curvature.SINGULAR,
            3e-8,
            "certified: a local minimum but for changes that cost next to nothing, as of the commanded throttle on "
            "1:g1 -> 1:finish, all limits",
        ),
        (
            Curvature.SINGULAR,
            -2e-2,
            "certified: a local optimum, a minimum as far as limits that are weakly active hold, all limits",
        ),
    ],
)
def test_a_minimum_is_claimed_only_where_the_curvature_tells_so(curvature: Curvature, least: float, words: str) -> None:
    result = flown(told(curvature, least))
    assert claim([result]).startswith(words)
    assert claim([solve_single_mesh(result)]).startswith(words.replace("certified", "solved"))


def test_of_a_rough_optimum_no_minimum_is_claimed() -> None:
    rough = claim([solve_roughly(flown(told(Curvature.POSITIVE, math.nan)))])
    assert rough == (
        "solved: on one mesh, as closely as the next stage needs; curvature and limits between nodes not measured"
    )


def test_of_a_saddle_nothing_is_claimed() -> None:
    saddle = flown(told(Curvature.INDEFINITE, -0.02))
    assert claim([saddle]) == ""
    assert saddle.certificate is not None
    (item,) = saddle.certificate.failed
    assert (item.name, item.value, item.limit) == ("negative_curvature", 0.02, 1e-2)
    assert item.where == "1:g1 -> 1:finish, commanded throttle"


def test_a_curvature_that_could_not_be_measured_never_holds() -> None:
    assert not negative_curvature(None).holds


LEFT = (Note(NoteKind.SIMPLER_ROUTE, "another one was left"),)
TRIED = SearchReport(tuple(Route(name, 10.0, 0.0, "joint") for name in "abc"))


def routes_claimed(*results: StageResult) -> str:
    return claim(results).rpartition("all limits measured, ")[2]


def test_the_best_is_claimed_only_where_no_faster_flight_was_left_for_a_simpler_one() -> None:
    searched = replace(stage_result(Stage.POINT_MASS), search=TRIED)
    assert routes_claimed(searched) == "the best of 3 routes"
    simpler = replace(searched, notes=LEFT)
    assert routes_claimed(simpler) == "the simplest within 10 ms of the best of 3 routes"
    alone = stage_result(Stage.POINT_MASS)
    assert routes_claimed(alone) == "no other route was evaluated"
    assert routes_claimed(replace(alone, notes=LEFT)) == "the simplest within 10 ms of the fastest flight"
    assert routes_claimed(replace(searched, notes=(Note(NoteKind.START, LEFT[0].text),))) == "the best of 3 routes"


def test_a_stage_above_has_the_choice_of_the_stage_below_unless_it_has_chosen_anew() -> None:
    below, above = replace(stage_result(Stage.POINT_MASS), search=TRIED, notes=LEFT), stage_result(Stage.SIX_DOF)
    assert routes_claimed(below, above) == "the simplest within 10 ms of the best of 3 routes"
    contested = replace(below, alternatives=(stage_result(Stage.POINT_MASS),))
    assert routes_claimed(contested, above) == "the best of 3 routes"
    assert routes_claimed(contested, replace(above, notes=LEFT)).startswith("the simplest within 10 ms")
