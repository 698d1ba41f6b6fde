"""What is claimed of an optimum: a minimum only where its curvature tells so, and nothing of a saddle."""

import math
from dataclasses import replace

import pytest
from fake_optimizer import solve_single_mesh, stage_result

from airrace.optimal_control.certificate import Curvature, SecondOrder
from airrace.procedure.certification import negative_curvature
from airrace.procedure.result import StageResult
from airrace.procedure.stage import Stage
from airrace.views.stage_tables import claim


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


def test_of_a_saddle_nothing_is_claimed() -> None:
    saddle = flown(told(Curvature.INDEFINITE, -0.02))
    assert claim([saddle]) == ""
    assert saddle.certificate is not None
    (item,) = saddle.certificate.failed
    assert (item.name, item.value, item.limit) == ("negative_curvature", 0.02, 1e-2)
    assert item.where == "1:g1 -> 1:finish, commanded throttle"


def test_a_curvature_that_could_not_be_measured_never_holds() -> None:
    assert not negative_curvature(None).holds
