"""The wind field: structure apart from numbers, superposition, zero cost when absent."""

import math

import casadi as ca
import numpy as np
import pytest

from airrace.environment.air import Air, Profile, StaticWind, Thermal
from airrace.environment.wind import WindField

STATIC = StaticWind(origin=math.radians(30.0), speed=8.0, profile=Profile.POWER)
ONE, TWO = Thermal(0.0, 0.0, 2.5, 1400.0), Thermal(60.0, -40.0, 1.5, 900.0)


def velocity(air: Air, x: float, y: float, z: float) -> np.ndarray:
    field = WindField.of(air)
    return np.array(field.velocity(x, y, z, field.values(air)))


def test_still_air_has_no_parameters_and_exactly_no_wind() -> None:
    field = WindField.of(Air())
    x = ca.SX.sym("x")
    assert not field.present
    assert field.parameters == ()
    assert field.values(Air()) == []
    assert field.velocity(x, x, x, []) == [0.0, 0.0, 0.0]
    assert all(isinstance(component, float) for component in field.velocity(x, x, x, []))


@pytest.mark.parametrize(
    "air", [Air(wind=STATIC), Air(thermals=(ONE,)), Air(wind=STATIC, thermals=(ONE, TWO))], ids=lambda air: str(air)
)
def test_every_parameter_has_a_value_and_a_name_of_its_own(air: Air) -> None:
    field = WindField.of(air)
    names = [one.name for one in field.parameters]
    assert field.present
    assert len(field.values(air)) == len(names) == len(set(names))


def test_winds_add_up() -> None:
    together = velocity(Air(wind=STATIC, thermals=(ONE, TWO)), 20.0, 10.0, -60.0)
    alone = [velocity(one, 20.0, 10.0, -60.0) for one in (Air(wind=STATIC), Air(thermals=(ONE,)), Air(thermals=(TWO,)))]
    assert together == pytest.approx(sum(alone), rel=1e-14)


def test_thermals_lift_and_static_wind_is_level() -> None:
    assert velocity(Air(thermals=(ONE,)), 0.0, 0.0, -100.0)[2] < -1.0
    assert velocity(Air(wind=STATIC), 0.0, 0.0, -100.0)[2] == 0.0


def test_static_wind_strengthens_upward_that_is_towards_negative_z() -> None:
    low, high = velocity(Air(wind=STATIC), 0.0, 0.0, -10.0), velocity(Air(wind=STATIC), 0.0, 0.0, -80.0)
    assert np.linalg.norm(low) == pytest.approx(8.0)
    assert np.linalg.norm(high) == pytest.approx(8.0 * 8.0 ** (1.0 / 7.0), rel=2e-3)


def test_airs_of_one_structure_share_field_and_expressions() -> None:
    breeze, gale = Air(wind=StaticWind(1.0, 2.0)), Air(wind=StaticWind(-2.0, 14.0))
    assert WindField.of(breeze) == WindField.of(gale)
    assert WindField.of(breeze).values(breeze) != WindField.of(gale).values(gale)


def test_label_names_the_structure() -> None:
    assert WindField.of(Air()).label == ""
    assert WindField.of(Air(wind=STATIC, thermals=(ONE, TWO))).label == "wind(power)+thermals(2)"
    assert WindField.of(Air(thermals=(ONE,))).label == "thermals(1)"


def test_numbers_of_another_structure_are_refused() -> None:
    with pytest.raises(ValueError, match="thermals=1"):
        WindField.of(Air(wind=STATIC)).values(Air(thermals=(ONE,)))


def test_symbols_give_the_same_wind_as_numbers() -> None:
    air = Air(wind=STATIC, thermals=(ONE, TWO))
    field = WindField.of(air)
    r, p = ca.SX.sym("r", 3), ca.SX.sym("p", len(field.parameters))
    function = ca.Function("W", [r, p], [ca.vertcat(*field.velocity(r[0], r[1], r[2], ca.vertsplit(p)))])
    place = (12.0, -7.0, -35.0)
    assert np.array(function(place, field.values(air))).ravel() == pytest.approx(velocity(air, *place), rel=1e-13)
