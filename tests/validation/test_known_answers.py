"""The engine finds what is known of textbook problems, by a formula or from others."""

import delta_iii
import double_integrator
import level_turn
import numpy as np
import pytest
import reorientation
from statement import KnownAnswer, objective
from textbook import known_answers

from airrace.optimal_control.problem import interpolate
from airrace.optimal_control.solve import solve

both_solvers = pytest.mark.parametrize("solver", ["fatrop", "ipopt"])


@both_solvers
@pytest.mark.parametrize("answer", known_answers(), ids=lambda answer: answer.name)
def test_optimum_has_the_known_values(answer: KnownAnswer, solver: str) -> None:
    solution = answer.solve(solver)
    assert solution.success, solution.status
    for value in answer.values:
        assert value.of(solution) == pytest.approx(float(value.published), abs=value.tolerance), value.name


@both_solvers
def test_a_free_switch_between_two_phases_finds_its_place(solver: str) -> None:
    (answer,) = double_integrator.known_answers()
    solution = answer.solve(solver)
    assert solution.iterate.durations == pytest.approx([1.0, 1.0], abs=1e-6)
    assert solution.iterate.control.ravel() == pytest.approx([-1.0, 1.0], abs=1e-6)


@both_solvers
def test_turn_rolls_in_and_out_as_long_as_the_closed_form_says(solver: str) -> None:
    (answer,) = level_turn.known_answers()
    solution = answer.solve(solver)
    assert solution.iterate.durations[[0, 2]] == pytest.approx(level_turn.phi_m / level_turn.p, abs=1e-5)


def test_closed_forms_give_the_numbers_that_are_quoted() -> None:
    closed = {answer.name: float(value.published) for answer in known_answers() for value in answer.values}
    assert closed["level turn, limited roll"] == pytest.approx(4.4127867, abs=5e-8)
    assert closed["sliding mass, 4 phases"] == pytest.approx(0.4472136, abs=5e-8)


@both_solvers
def test_body_switching_freely_turns_with_all_its_torque(solver: str) -> None:
    (answer,) = reorientation.known_answers()
    assert np.abs(answer.solve(solver).iterate.control) == pytest.approx(50.0, abs=1e-3)


@both_solvers
def test_body_on_a_uniform_mesh_takes_little_longer_than_the_published_time(solver: str) -> None:
    problem, guess = reorientation.on_a_uniform_mesh(60)
    solution = KnownAnswer("uniform", problem, guess, ()).solve(solver)
    assert solution.success, solution.status
    assert 28.6304 < objective(solution) < 28.6304 + 0.01
    middle_of_arc = [5, 20, 28, 35, 48, 57]
    signs = np.sign(solution.iterate.control[:, middle_of_arc]).T.tolist()
    assert signs == [list(arc) for arc in reorientation.SIGNS]


def test_an_ascent_through_the_earth_is_given_up_in_time() -> None:
    """Air at a depth of 200 km makes derivatives from which fatrop never comes back."""
    problem, guess = delta_iii.ascent((2, 2, 2, 2))
    begin = guess.state[:, 0]
    share = np.linspace(0.0, 1.0, 5)
    states = np.repeat(begin[:, None], 5, axis=1)
    above, east = begin[:3] / np.linalg.norm(begin[:3]), np.array([0.0, 1.0, 0.0])
    orbit = 6.55e6 * (np.cos(0.55) * above + np.sin(0.55) * east)
    states[:3] = np.outer(begin[:3], 1 - share) + np.outer(orbit, share)
    states[3:6] = np.outer([-7000.0, 7000.0, -2000.0], share)
    states[6] = begin[6] * (1 - share) + 7600.0 * share
    straight = interpolate(problem, guess.durations, states, [0.0, 0.0])
    solution = solve(problem, straight, stall_seconds=4.0)
    assert not solution.success
    assert solution.status == "no iteration finished within 4 s"
