"""Smooth stand-ins keep the order and the limits of what they replace."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from airrace.environment.elementary import power, smooth_clip, smooth_maximum

number = st.floats(-100.0, 100.0)


@given(number, number, st.floats(1e-3, 10.0))
def test_smooth_maximum_lies_above_the_maximum_by_half_its_width_at_most(a: float, b: float, width: float) -> None:
    excess = smooth_maximum(a, b, width) - max(a, b)
    assert -1e-12 <= excess <= 0.5 * width + 1e-12


@given(number, st.floats(0.0, 10.0), st.floats(1e-2, 1.0))
def test_smooth_clip_rises_and_stays_within_its_limits(x: float, step: float, width: float) -> None:
    assert -2.0 <= smooth_clip(x, -2.0, 3.0, width) <= 3.0
    assert smooth_clip(x + step, -2.0, 3.0, width) >= smooth_clip(x, -2.0, 3.0, width) - 1e-12


def test_smooth_clip_leaves_the_middle_alone_and_closes_in_on_its_limits() -> None:
    assert smooth_clip(0.0, -1.0, 1.0, 0.1) == pytest.approx(0.0, abs=1e-15)
    assert smooth_clip(100.0, -1.0, 1.0, 0.1) == pytest.approx(1.0, abs=1e-5)
    assert smooth_clip(-100.0, -1.0, 1.0, 0.1) == pytest.approx(-1.0, abs=1e-5)


@given(st.floats(1e-3, 100.0), st.floats(-5.0, 5.0))
def test_power_is_the_power(x: float, exponent: float) -> None:
    assert power(x, exponent) == pytest.approx(x**exponent, rel=1e-12)
