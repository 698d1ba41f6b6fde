"""Free fall: closed forms, an independent integration, symmetry, and the wind."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from airrace.flights.safety.falls_and_glides import (
    AirColumn,
    States,
    fall_in_vacuum,
    fall_with_drag,
    level_fall_distance,
)
from airrace.model.environment import RHO_ISA, Air, Profile, StaticWind, g0
from airrace.optimal_control.trajectory import Array

MASS, DRAG_AREA = 698.0, 1.5


def one(height: float, *velocity: float) -> States:
    """A single instant above the origin."""
    return States(np.array([[0.0, 0.0, height]]), np.array([velocity]))


def uniform(north: float = 0.0, east: float = 0.0) -> AirColumn:
    """Air of one density with one wind."""
    ends = np.ones(2)
    return AirColumn(np.array([0.0, 5000.0]), north * ends, east * ends, RHO_ISA * ends)


def many() -> States:
    """Instants of every kind: level, climbing, diving, near the ground and high above it."""
    random = np.random.default_rng(3)
    place = random.uniform((-500.0, -500.0, 0.5), (500.0, 500.0, 250.0), (40, 3))
    direction = random.normal(size=(40, 3))
    return States(place, 95.0 * direction / np.linalg.norm(direction, axis=1, keepdims=True))


def drag(states: States, air: AirColumn, area: float = DRAG_AREA, step: float = 0.05) -> Array:
    return fall_with_drag(states, air, mass=MASS, drag_area=area, h=step).place


def test_the_check_of_level_flight_gives_237_m_at_105_m_s_and_25_m() -> None:
    assert level_fall_distance(np.array([105.0]), np.array([25.0]))[0] == pytest.approx(237.09, abs=0.01)
    fall = fall_in_vacuum(one(25.0, 105.0, 0.0, 0.0))
    assert fall.place[0] == pytest.approx([105.0 * math.sqrt(50.0 / g0), 0.0])


def test_a_fall_in_vacuum_keeps_its_energy_and_lasts_as_long_as_a_parabola() -> None:
    states = many()
    fall, up = fall_in_vacuum(states), states.velocity[:, 2]
    assert states.place[:, 2] + up * fall.time - 0.5 * g0 * fall.time**2 == pytest.approx(0.0, abs=1e-9)
    assert fall.speed**2 == pytest.approx(states.speed**2 + 2.0 * g0 * states.place[:, 2])


def test_without_drag_the_integration_gives_the_parabola() -> None:
    states = many()
    fall = fall_with_drag(states, uniform(30.0, 10.0), mass=MASS, drag_area=0.0)
    vacuum = fall_in_vacuum(states)
    assert fall.place == pytest.approx(vacuum.place, abs=1e-6)
    assert fall.time == pytest.approx(vacuum.time, abs=1e-8)


def test_a_vertical_fall_with_constant_drag_takes_the_time_of_the_closed_form() -> None:
    """From rest `h = v_t^2/g ln cosh(g t / v_t)` and `v = v_t tanh(g t / v_t)`, with the terminal speed `v_t`."""
    height, area = 400.0, 12.0
    fall = fall_with_drag(one(height, 0.0, 0.0, 0.0), uniform(), mass=MASS, drag_area=area)
    terminal = math.sqrt(2.0 * MASS * g0 / (RHO_ISA * area))
    time = terminal / g0 * math.acosh(math.exp(g0 * height / terminal**2))
    assert fall.time[0] == pytest.approx(time, rel=1e-6)
    assert fall.speed[0] == pytest.approx(terminal * math.tanh(g0 * time / terminal), rel=1e-6)


def test_falls_in_a_sheared_wind_are_those_of_an_independent_integration() -> None:
    states = many()
    air = AirColumn.from_air(Air(wind=StaticWind(math.radians(240.0), 9.0, Profile.POWER)), 800.0)
    fall = fall_with_drag(states, air, mass=MASS, drag_area=DRAG_AREA)

    def rates(_: float, y: Array) -> Array:
        wind = [*air.wind(y[2:3])[0], 0.0]
        flow, rho = y[3:] - wind, float(np.interp(y[2], air.height, air.density))
        return np.concatenate([y[3:], -0.5 * rho * DRAG_AREA / MASS * np.linalg.norm(flow) * flow - [0.0, 0.0, g0]])

    def ground(_: float, y: Array) -> float:
        return y[2]

    ground.terminal = True  # type: ignore[attr-defined]
    exactly = {"method": "DOP853", "rtol": 1e-8, "atol": 1e-8}
    for place, velocity, found in zip(states.place[:12], states.velocity[:12], fall.place[:12], strict=True):
        solved = solve_ivp(rates, (0.0, 60.0), [*place, *velocity], events=ground, **exactly)
        assert found == pytest.approx(solved.y_events[0][0][:2], abs=0.005)


def test_the_integration_converges_and_its_step_is_fine_enough() -> None:
    states, air = many(), uniform(5.0)
    exact = drag(states, air, step=0.0125)
    coarse, usual = (np.abs(drag(states, air, step=step) - exact).max() for step in (0.1, 0.05))
    assert usual < 1e-3
    assert usual < 0.3 * coarse


def test_drag_shortens_the_fall_and_more_of_it_shortens_it_more() -> None:
    states = one(80.0, 90.0, 0.0, 10.0)
    ways = [drag(states, uniform(), area)[0, 0] for area in (0.0, 0.2, 1.0, 5.0)]
    assert ways == sorted(ways, reverse=True)
    assert ways[0] == pytest.approx(fall_in_vacuum(states).place[0, 0])


def test_wind_displaces_a_fall_by_itself_times_the_time_if_the_flow_is_the_same() -> None:
    """Seen from the air, flights with equal velocities through it fall alike."""
    states = many()
    windy = States(states.place, states.velocity + np.array([7.0, -3.0, 0.0]))
    still = fall_with_drag(states, uniform(), mass=MASS, drag_area=DRAG_AREA)
    blown = fall_with_drag(windy, uniform(7.0, -3.0), mass=MASS, drag_area=DRAG_AREA)
    assert blown.time == pytest.approx(still.time)
    assert blown.place == pytest.approx(still.place + np.outer(still.time, [7.0, -3.0]))


def test_a_heavy_parachute_drifts_with_the_wind() -> None:
    fall = fall_with_drag(one(100.0, 0.0, 0.0, 0.0), uniform(0.0, 8.0), mass=MASS, drag_area=500.0)
    assert fall.place[0] == pytest.approx([0.0, 8.0 * fall.time[0]], rel=0.03)


def test_turned_mirrored_and_moved_states_fall_to_turned_mirrored_and_moved_places() -> None:
    states, angle = many(), 0.7
    turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    before = drag(states, uniform(6.0, 2.0))
    for change in (turn, np.diag([1.0, -1.0])):
        whole = np.eye(3)
        whole[:2, :2] = change
        changed = States(states.place @ whole.T + [300.0, -20.0, 0.0], states.velocity @ whole.T)
        assert drag(changed, uniform(*change @ [6.0, 2.0])) == pytest.approx(before @ change.T + [300.0, -20.0])


def test_what_is_below_the_ground_falls_no_farther() -> None:
    states = one(-2.0, 90.0, 5.0, 3.0)
    assert fall_in_vacuum(states).time[0] == 0.0
    assert drag(states, uniform())[0] == pytest.approx([0.0, 0.0])
