"""The reach without power: the closed form against flights that are integrated on their own."""

import functools
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from airrace.files.inputs import load_inputs
from airrace.flights.safety.falls_and_glides import AirColumn, Glide, States, best_glide, reach
from airrace.model.aircraft import Aircraft
from airrace.model.environment import RHO_ISA, g0
from airrace.optimal_control.trajectory import Array

CALM = AirColumn(np.array([0.0, 3000.0]), np.zeros(2), np.zeros(2), np.full(2, RHO_ISA))


@functools.cache
def edge() -> Aircraft:
    return load_inputs("rovinj_2014").race.aircraft


def glide() -> Glide:
    return best_glide(edge(), RHO_ISA)


def one(height: float, speed: float) -> States:
    """Level flight to the north above the origin."""
    return States(np.array([[0.0, 0.0, height]]), np.array([[speed, 0.0, 0.0]]))


def coefficient_of_drag(C_L: Array) -> Array:
    drag = edge().drag
    return drag.C_D0 + drag.k * (C_L - drag.C_L_minD) ** 2


def flown(height: float, speed: float, climb: float, bank: float, until: float = math.inf) -> Array:
    """Integrate a glide at the lift of the best one, banked until the course `until`: where it touches down."""
    drag, m, S = edge().drag, edge().airframe.m, edge().airframe.S
    C_L = math.sqrt(drag.C_D0 / drag.k + drag.C_L_minD**2)

    def rates(_: float, y: Array) -> list[float]:
        V, gamma, chi = y[3:]
        L = 0.5 * RHO_ISA * V**2 * S * C_L
        D = L * float(coefficient_of_drag(np.array(C_L))) / C_L
        mu = bank if chi < until else 0.0
        level = V * math.cos(gamma)
        turning = L * math.sin(mu) / (m * level)
        pitching = (L * math.cos(mu) - m * g0 * math.cos(gamma)) / (m * V)
        slowing = -D / m - g0 * math.sin(gamma)
        return [level * math.cos(chi), level * math.sin(chi), V * math.sin(gamma), slowing, pitching, turning]

    def ground(_: float, y: Array) -> float:
        return y[2]

    ground.terminal = True  # type: ignore[attr-defined]
    start = [0.0, 0.0, height, speed, climb, 0.0]
    return solve_ivp(rates, (0.0, 600.0), start, events=ground, rtol=1e-7).y_events[0][0]


def test_no_lift_glides_flatter_than_that_of_the_best_glide() -> None:
    C_L = np.linspace(0.05, edge().lift.C_L_max, 4000)
    ratios = C_L / coefficient_of_drag(C_L)
    assert glide().ratio == pytest.approx(ratios.max(), rel=1e-6)
    C_L_best = C_L[ratios.argmax()]
    weight = 0.5 * RHO_ISA * glide().speed ** 2 * edge().airframe.S * C_L_best
    assert weight == pytest.approx(edge().airframe.m * g0, rel=1e-3)


def test_from_the_best_speed_a_glide_goes_as_far_as_an_integrated_one() -> None:
    found = reach(one(300.0, glide().speed), CALM, glide())
    assert found.distance[0] == pytest.approx(glide().ratio * 300.0)
    assert found.straight[0] == pytest.approx([found.distance[0], 0.0])
    angle = -math.atan(1.0 / glide().ratio)
    assert flown(300.0, glide().speed * math.sqrt(math.cos(angle)), angle, 0.0)[0] == pytest.approx(
        found.distance[0], rel=0.002
    )


def test_no_flight_at_one_g_comes_farther_than_the_energy_says() -> None:
    """Slowed down at a constant height to the best speed, and glided from there."""
    m, S, speed = edge().airframe.m, edge().airframe.S, glide().speed
    V = np.linspace(speed, 100.0, 2000)
    q = 0.5 * RHO_ISA * V**2 * S
    slowing = np.trapezoid(m * V / (q * coefficient_of_drag(m * g0 / q)), V)
    level = slowing + glide().ratio * 50.0
    bound = reach(one(50.0, 100.0), CALM, glide()).distance[0]
    assert 0.5 * bound < level < bound


@pytest.mark.parametrize("turn", [math.pi / 3, math.pi])
def test_behind_a_turn_a_glide_ends_near_an_integrated_one(turn: float) -> None:
    found = reach(one(600.0, glide().speed), CALM, glide())
    column = int(np.argmin(np.abs(np.linspace(-math.pi, math.pi, 37) - turn)))
    end = flown(600.0, glide().speed * 2.0**0.25, -math.atan(math.sqrt(2.0) / glide().ratio), math.pi / 4, turn)
    gained = glide().ratio * (math.sqrt(2.0) - 1.0) * glide().speed ** 2 / (2.0 * g0)  # it begins faster
    way = np.linalg.norm(found.turned[0, column] - end[:2] + gained * np.array([math.cos(turn), math.sin(turn)]))
    assert way < 0.02 * found.distance[0]


def test_the_reach_is_symmetric_and_where_height_ends_so_does_the_turn() -> None:
    found = reach(one(600.0, 80.0), CALM, glide())
    assert found.turned[0, ::-1] == pytest.approx(found.turned[0] * [1.0, -1.0])
    low = reach(one(1.0, glide().speed), CALM, glide())
    assert np.linalg.norm(low.turned, axis=-1).max() <= 1.001 * low.distance[0]


def test_wind_displaces_the_whole_reach_by_the_time_that_it_lasts() -> None:
    wind = AirColumn(CALM.height, np.full(2, -6.0), np.full(2, 2.0), CALM.density)
    states = one(300.0, 60.0)
    blown = States(states.place, states.velocity + np.array([-6.0, 2.0, 0.0]))
    seconds = reach(states, CALM, glide()).distance[0] / glide().speed
    moved = reach(blown, wind, glide()).straight - reach(states, CALM, glide()).straight
    assert moved[0] == pytest.approx(seconds * np.array([-6.0, 2.0]))


def test_an_aircraft_that_is_too_slow_to_glide_reaches_nothing() -> None:
    assert reach(one(1.0, 20.0), CALM, glide()).turned[0] == pytest.approx(0.0)
