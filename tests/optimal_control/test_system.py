"""Systems written down with typed vectors, what they demand of their declarations, and observations side by side."""

import casadi as ca
import numpy as np
import pytest

from airrace.optimal_control.quantities import Quantity, T, Vector, quantity, vector
from airrace.optimal_control.system import NoQuantities, Observation, System, observation_of, side_by_side, system_of

x, a, b = ca.SX.sym("x", 2), ca.SX.sym("a"), ca.SX.sym("b", 2)
SUM = Observation("sum", (Quantity("s", "m"),), (Quantity("a", "m"),), ca.Function("sum", [x, a], [x[0] + x[1] + a]))
SCALED = Observation(
    "scaled",
    (Quantity("v", "m"), Quantity("w", "m")),
    (Quantity("b", "1"), Quantity("c", "1")),
    ca.Function("scaled", [x, b], [x * b]),
)


def test_side_by_side_every_observation_sees_with_its_own_parameters() -> None:
    both = side_by_side(SUM, SCALED)
    assert [one.name for one in both.quantities] == ["s", "v", "w"]
    assert len(both.parameters) == 3
    assert np.asarray(both.values([1.0, 2.0], [10.0, 3.0, 4.0])).ravel() == pytest.approx([13.0, 3.0, 8.0])


def test_side_by_side_no_name_means_two_quantities() -> None:
    with pytest.raises(ValueError, match="sum and sum both observe s"):
        side_by_side(SUM, SUM)


@pytest.mark.parametrize("moved", ["v", "rate"])
def test_system_refuses_the_rate_of_what_is_no_state(moved: str) -> None:
    u = ca.SX.sym("u")
    with pytest.raises(ValueError, match=f"rate is declared to be the rate of {moved}, which is no state"):
        System(
            name="lost",
            states=(Quantity("s", "m"),),
            controls=(Quantity("rate", "m/s", rate_of=moved),),
            parameters=(),
            rates=ca.Function("rates", [ca.SX.sym("x"), u, ca.SX(0, 1)], [u]),
        )


# written down with typed vectors


@vector
class State(Vector[T]):
    s: T = quantity("m", scale=100.0, text="distance")
    v: T = quantity("m/s", lower=0.0)


@vector
class Pull(Vector[T]):
    f: T = quantity("m/s2", scale=3.0, lower=-1.0, upper=1.0)


@vector
class Power(Vector[T]):
    w: T = quantity("W/kg", upper=5.0)


CAR = system_of(
    "car",
    State,
    Pull,
    lambda x, u: State(s=x.v, v=u.f - 0.1 * x.v**2),
    Path=Power,
    path=lambda x, u: Power(w=u.f * x.v),
    projection=lambda x: State(s=x.s, v=ca.fmax(x.v, 0.0)),
)


def test_a_system_of_vectors_has_their_declarations_and_their_equations() -> None:
    assert CAR.states == (Quantity("s", "m", 100.0, text="distance"), Quantity("v", "m/s", lower=0.0))
    assert CAR.controls == (Quantity("f", "m/s2", 3.0, -1.0, 1.0),)
    assert CAR.parameters == ()
    assert np.asarray(CAR.rates([7.0, 2.0], [0.5], [])).ravel() == pytest.approx([2.0, 0.1])
    assert CAR.path == (Quantity("w", "W/kg", upper=5.0),)
    assert float(CAR.path_values([7.0, 2.0], [0.5], [])) == pytest.approx(1.0)
    assert np.asarray(CAR.projection([7.0, -2.0])).ravel() == pytest.approx([7.0, 0.0])


def test_a_system_of_vectors_may_have_no_controls_and_constant_rates() -> None:
    fall = system_of("fall", State, NoQuantities, lambda x, _: State(s=x.v, v=9.81))
    assert fall.controls == fall.path == ()
    assert fall.path_values is None
    assert fall.projection is None
    assert np.asarray(fall.rates([7.0, 2.0], [], [])).ravel() == pytest.approx([2.0, 9.81])


def test_an_observation_of_vectors_sees_what_it_is_told_to() -> None:
    energy = observation_of("energy", State, Power, lambda x: Power(w=0.5 * x.v**2))
    assert energy.quantities == Power.quantities()
    assert energy.parameters == ()
    assert float(energy.values([7.0, 2.0], [])) == pytest.approx(2.0)
