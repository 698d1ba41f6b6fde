"""References: their rates are the rates of their histories, and an optimum is sampled as it was flown."""

import numpy as np
import pytest
from manoeuvres import SCRIPTS, flown

from airrace.control.reference import SOFTENING, from_optimum, softened
from airrace.optimal_control.problem import Boundary, Phase, Problem, uniform
from airrace.quantities import Interval
from airrace.trajectory import Trajectory


@pytest.mark.parametrize("name", SCRIPTS)
def test_velocity_and_acceleration_are_the_derivatives_of_the_path(name: str) -> None:
    reference = flown(name).reference
    inside = slice(2, -2)
    for lower, upper in (("position", "velocity"), ("velocity", "acceleration")):
        histories, rates = (np.array(getattr(reference.histories, one)) for one in (lower, upper))
        differences = np.gradient(histories, reference.s, axis=1)
        # a central difference is wrong by h^2/6 of the third derivative, at a corner by h/2 of the change of slope;
        # load factors change by 30 g/s at most
        assert np.abs(differences - rates)[:, inside].max() < (0.02 if upper == "velocity" else 1.5)


@pytest.mark.parametrize("name", SCRIPTS)
def test_speed_is_the_length_of_the_velocity(name: str) -> None:
    flight = flown(name)
    speed = np.linalg.norm(np.array(flight.reference.histories.velocity), axis=0)
    assert speed == pytest.approx(flight.state[3])


def test_softening_leaves_straight_histories_alone() -> None:
    s = np.linspace(0.0, 3.0, 400)
    inside = (s > SOFTENING + 0.01) & (s < 2.99 - SOFTENING)
    assert softened(s, 2.0 - 3.0 * s)[inside] == pytest.approx((2.0 - 3.0 * s)[inside])
    assert softened(s, np.full(400, 4.0)) == pytest.approx(np.full(400, 4.0))


def test_softening_is_neither_early_nor_late_and_keeps_the_integral() -> None:
    s = np.linspace(0.0, 2.0, 2001)
    ramp = np.interp(s, (0.9, 1.1), (0.0, 1.0))
    soft = softened(s, ramp)
    assert soft + soft[::-1] == pytest.approx(np.ones(2001), abs=1e-3)
    assert np.trapezoid(soft, s) == pytest.approx(np.trapezoid(ramp, s), abs=1e-4)
    assert np.all(np.diff(soft) >= -1e-12)
    assert soft[s < 0.89 - SOFTENING].max() < 1e-9


def test_optimum_is_sampled_as_it_was_flown() -> None:
    flight = flown("barrel roll")
    system, intervals = flight.model.system, len(flight.s) - 1
    first = intervals // 3
    lengths = np.array([first, intervals - first]) * (flight.s[-1] / intervals)
    phases = tuple(
        Phase(name, uniform(count), Interval(0.1, 9.0)) for name, count in (("a", first), ("b", intervals - first))
    )
    problem = Problem(system, tuple(flight.model.parameter_values.tolist()), Boundary(), phases)
    trajectory = Trajectory(
        phases=("a", "b"),
        first_node=np.array([0, first, intervals]),
        durations=lengths,
        time=flight.s,
        states=system.states,
        state=flight.state,
        controls=system.controls,
        control=flight.control[:, :-1],
    )
    sampled, grid = from_optimum(flight.model, problem, trajectory), flight.reference
    assert np.all(np.diff(sampled.s) > 0.0)
    assert sampled.boundaries == pytest.approx([0.0, flight.s[first], flight.s[-1]])
    for name in ("position", "velocity", "acceleration", "q"):
        expected = np.array(getattr(grid.histories, name))
        assert np.array(getattr(sampled.histories, name))[:, ::10] == pytest.approx(expected, abs=1e-6)
