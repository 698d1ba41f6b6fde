"""The study of prices confirms what agrees with solving again, and says why the rest does not."""

import math
import runpy
from pathlib import Path
from typing import Any

import pytest

from airrace.sensitivity.sensitivity import Activity, ParameterGroup, Price

SCRIPT = Path(__file__).parents[2] / "scripts" / "study_prices.py"


@pytest.fixture(scope="module")
def study() -> dict[str, Any]:  # Any: whatever a script defines
    return runpy.run_path(str(SCRIPT))


def told(upward: float, downward: float, activity: Activity) -> Price:
    """A price in s per metre."""
    return Price("gates.g1.width_m", ParameterGroup.TRACK, "m", 13.0, upward, downward, 1.0, activity)


def test_a_price_is_confirmed_by_the_central_difference(study: dict[str, Any]) -> None:
    price = told(-0.1, -0.1, Activity.BOTH)
    assert study["Comparison"](price, -0.12, -0.08, -0.1).within(0.0)
    assert not study["Comparison"](price, -0.12, -0.12, -0.12).within(0.001)
    assert study["Comparison"](price, -0.12, -0.12, -0.12).within(0.021)


def test_a_one_sided_price_must_be_right_to_either_side(study: dict[str, Any]) -> None:
    price = told(0.0, -0.1, Activity.ONE_SIDED)
    assert study["Comparison"](price, 0.0, -0.1, -0.05).within(1e-6)
    assert not study["Comparison"](price, -0.05, -0.05, -0.05).within(1e-3)
    ends = told(0.1, math.nan, Activity.ONE_SIDED)
    assert study["Comparison"](ends, 0.1, math.nan, math.nan).within(1e-6)


def test_the_reason_tells_curvature_from_error(study: dict[str, Any]) -> None:
    price = told(-0.1, -0.1, Activity.BOTH)
    assert "come and go" in study["Comparison"](price, -0.3, -0.1, -0.2).reason
    assert study["Comparison"](price, -0.2, -0.2, -0.2).reason == "unexplained"
    assert study["Comparison"](price, math.nan, math.nan, math.nan).reason == "not solved again"


def test_a_price_that_could_not_be_solved_again_is_not_confirmed(study: dict[str, Any]) -> None:
    assert not study["Comparison"](told(-0.1, -0.1, Activity.BOTH), math.nan, math.nan, math.nan).within(1.0)


def test_the_row_counts_what_is_confirmed(study: dict[str, Any]) -> None:
    price = told(-0.1, -0.1, Activity.BOTH)
    right, wrong = (study["Comparison"](price, found, found, found) for found in (-0.1, -0.2))
    assert "| 2 | 1 (50.0 %) | 1 (50.0 %) |" in study["row"]("course", [right, wrong])
