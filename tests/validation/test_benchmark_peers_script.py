"""The race of `scripts/benchmark_peers.py` is airrace's own point mass, and its errors are zero for exact flights."""

import dataclasses
import importlib
import math
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from airrace.optimal_control.reference_integration import integrate

SCRIPTS = Path(__file__).parents[2] / "scripts"


@pytest.fixture(scope="module")
def script() -> Iterator[ModuleType]:
    """`scripts/benchmark_peers.py`, imported as it imports what lies beside it."""
    sys.path.insert(0, str(SCRIPTS))
    yield importlib.import_module("benchmark_peers")
    sys.path.remove(str(SCRIPTS))
    for name in [name for name in sys.modules if name.split(".")[0] in ("peers", "benchmark_peers")]:
        del sys.modules[name]


@pytest.fixture(scope="module")
def race(script: ModuleType) -> Any:
    return script.the_race(1)


def points(count: int) -> tuple[np.ndarray, np.ndarray]:
    """States and controls of flight, with attitudes of any length."""
    random = np.random.default_rng(0)
    centre = np.array([0.0, 0.0, -60.0, 80.0, 0.0, 0.0, 0.0, 0.0, 0.5, 3.0, 0.0, 0.0])
    spread = np.array([300.0, 300.0, 40.0, 20.0, 1.0, 1.0, 1.0, 1.0, 0.3, 3.0, 0.5, 3.0])
    x = centre[:, None] + spread[:, None] * random.uniform(-1.0, 1.0, (12, count))
    return x, random.uniform(-10.0, 10.0, (4, count))


def exact_flight(script: ModuleType, race: Any) -> Any:
    """A flight of two phases with two segments each, flown by the reference integrator."""
    measured = sys.modules[script.position_error.__module__]
    durations = np.array([1.0, 2.0])
    controls = np.random.default_rng(1).uniform(-0.5, 0.5, (4, 2, 2))
    start = race.start.copy()
    starts, ends = [], []
    for phase in range(2):
        starts.append(start)
        for segment in range(2):
            u = controls[:, phase, segment]

            def rates(_: float, x: np.ndarray, u: np.ndarray = u) -> np.ndarray:
                return np.array(race.rates(list(x), list(u)))

            span = np.array([0.0, durations[phase] / 2])
            start = integrate(rates, start, span, relative=1e-13, absolute=1e-12)[:, -1]
        ends.append(start)
    return measured.Flight(durations, np.array(starts).T, np.array(ends).T, controls)


def test_the_equations_are_those_of_the_point_mass(race: Any) -> None:
    x, u = points(50)
    system, p = race.model.system, race.model.parameter_values
    for column in range(50):
        expected = np.asarray(system.rates(x[:, column], u[:, column], p)).ravel()
        np.testing.assert_allclose(race.rates(list(x[:, column]), list(u[:, column])), expected, rtol=1e-12, atol=1e-12)


def test_the_limited_quantities_are_those_of_the_point_mass(race: Any) -> None:
    x, u = points(50)
    for column in range(50):
        expected = np.asarray(race.model.system.path_values(x[:, column], u[:, column], race.model.parameter_values))
        np.testing.assert_allclose(race.coefficients(list(x[:, column])), expected.ravel(), rtol=1e-12, atol=1e-14)


def test_the_order_of_the_states_is_that_of_the_point_mass(race: Any) -> None:
    names = [one.name for one in race.model.system.states]
    assert names == ["x", "y", "z", "V_K", "q0", "q1", "q2", "q3", "delta_T", "n_z", "n_y", "p_Kbar"]
    assert [one.rate_of for one in race.model.system.controls] == ["n_z", "n_y", "p_Kbar", ""]


@pytest.mark.parametrize("laps", [1, 2])
def test_the_guess_passes_all_gates_in_one_piece_with_continuous_attitude(script: ModuleType, laps: int) -> None:
    race = script.the_race(laps)
    guess = race.guess(20)
    for gate, states in zip(race.gates, guess.states, strict=True):
        np.testing.assert_allclose(states[:3, -1], gate.position, atol=1e-9)
    nodes = np.hstack(list(guess.states))
    np.testing.assert_allclose(nodes[:3, 20:-1:21], nodes[:3, 21::21], atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(nodes[4:8], axis=0), 1.0, atol=1e-12)
    assert (np.einsum("ij,ij->j", nodes[4:8, 1:], nodes[4:8, :-1]) > 0.0).all()


def test_a_gate_with_a_direction_is_crossed_level_on_its_heading(race: Any) -> None:
    crossing = sys.modules[type(race).__module__].crossing
    level = math.radians(250.0)
    q = (math.cos(level / 2), 0.0, 0.0, math.sin(level / 2))
    assert crossing(q, math.cos(level), math.sin(level)) == pytest.approx((0.0, 0.0), abs=1e-15)
    across, down = crossing(q, math.cos(level - 0.1), math.sin(level - 0.1))
    assert (across, down) == pytest.approx((math.sin(0.1), 0.0), abs=1e-15)


def test_an_exact_flight_has_no_position_error(script: ModuleType, race: Any) -> None:
    assert script.position_error(race, exact_flight(script, race)) < 1e-8


def test_the_position_error_is_how_far_the_worst_phase_ends_from_where_it_should(script: ModuleType, race: Any) -> None:
    flight = exact_flight(script, race)
    flight.ends[1, 0] += 0.003
    flight.ends[2, 1] -= 0.004
    assert script.position_error(race, flight) == pytest.approx(0.004, abs=1e-8)


def test_a_tool_that_is_not_installed_is_told_and_left_out(
    script: ModuleType, race: Any, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    absent = script.Tool("nothing", script.TOOLS[0].solve, "no_such_package", "no-such-package")
    flight = exact_flight(script, race)
    answer = sys.modules[script.position_error.__module__].Answer(flight, "solved", 7, 0.5, 1.0, 0.25, 0.125)
    present = script.Tool("present", lambda *_: answer)
    monkeypatch.setattr(script, "TOOLS", (absent, present))
    monkeypatch.setattr(script, "SCHEMES", ())
    monkeypatch.setattr(script, "with_scheme", lambda _: present.solve)
    assert script.main(["--segments", "2", "--repeats", "1", "--markdown"]) == 0
    told = capsys.readouterr()
    assert "nothing is left out, for no-such-package is not installed (extra `peers`).\n" in told.err
    (row,) = told.out.splitlines()[2:]
    assert row.startswith("| present | 2 | 7 | ")
    assert row.endswith(" | 3.0000 | +0.0 | 0.50 | 1.00 | 0.25 | 0.12 |")


def test_the_race_has_sixteen_phases_and_two_equal_laps(script: ModuleType) -> None:
    first, second = np.split(np.array([gate.position for gate in script.the_race().gates]), 2)
    assert first.shape == (8, 3)
    np.testing.assert_array_equal(first, second)


@pytest.mark.parametrize(("arguments", "solved"), [([], [8, 8, 8, 9]), (["--segments", "2", "--repeats", "1"], [2, 2])])
def test_a_tool_is_measured_on_its_own_meshes_as_often_as_it_says_unless_told(
    script: ModuleType, race: Any, monkeypatch: pytest.MonkeyPatch, arguments: list[str], solved: list[int]
) -> None:
    asked: list[int] = []
    answer = sys.modules[script.position_error.__module__].Answer(exact_flight(script, race), "solved", 7, 0, 0, 0, 0)

    def solve(_race: Any, segments: int, _tolerance: float) -> Any:
        asked.append(segments)
        return answer

    tools = (script.Tool("thrice", solve, segments=(8,)), script.Tool("once", solve, segments=(9,), repeats=1))
    monkeypatch.setattr(script, "TOOLS", tools)
    monkeypatch.setattr(script, "SCHEMES", ())
    monkeypatch.setattr(script, "with_scheme", lambda _: lambda *_: answer)
    assert script.main(arguments) == 0
    assert asked == solved


def test_a_tool_that_does_not_converge_is_not_asked_again_but_its_seconds_count(script: ModuleType, race: Any) -> None:
    answer = sys.modules[script.position_error.__module__].Answer(None, "Maximum_Iterations_Exceeded", 99, 1, 2, 3, 4)
    row = script.measure(race, script.Tool("lost", lambda *_: answer), 2, 3, 1e-6)
    assert len(row.answers) == 1
    assert row.cells(33.0) == ("lost", "2", "99", "not converged", "", "", "1.00", "2.00", "3.00", "4.00")


@pytest.mark.slow
def test_the_tools_that_are_installed_find_the_same_flight_through_two_gates(script: ModuleType, race: Any) -> None:
    short = dataclasses.replace(race, gates=race.gates[:2])
    times: dict[str, float] = {}
    for tool in script.TOOLS:
        if not tool.missing:
            flight = tool.solve(short, 10, 1e-6).flight
            assert script.position_error(short, flight) < 0.2, tool.name
            times[tool.name] = flight.race_time
    assert times == pytest.approx(dict.fromkeys(times, times["airrace, v7"]), abs=1e-3)
