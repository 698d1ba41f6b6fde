"""Between metres and latitude and longitude."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from airrace.track.course import Origin
from airrace.track.geodetic import geodetic, metres, placed

ROVINJ = Origin(math.radians(45.08), math.radians(13.63), 10.0)


@given(st.floats(-2e4, 2e4), st.floats(-2e4, 2e4), st.floats(-60.0, 60.0))
def test_there_and_back_again(north: float, east: float, latitude: float) -> None:
    origin = Origin(math.radians(latitude), 0.3, 250.0)
    back = metres(*geodetic(np.array([north]), np.array([east]), origin), origin)
    assert float(back[0][0]) == pytest.approx(north, abs=1e-6)
    assert float(back[1][0]) == pytest.approx(east, abs=1e-6)


def test_a_minute_of_latitude_is_about_a_sea_mile() -> None:
    latitude, _ = geodetic(np.array([1852.0]), np.array([0.0]), ROVINJ)
    assert math.degrees(float(latitude[0]) - math.radians(45.08)) * 60.0 == pytest.approx(1.0, abs=2e-3)


def test_a_course_without_an_origin_lies_nowhere() -> None:
    assert not placed(Origin())
    with pytest.raises(ValueError, match="no latitude"):
        geodetic(np.zeros(1), np.zeros(1), Origin())
