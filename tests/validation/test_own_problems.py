"""Problems as users state them: solved to their digits in arcs, above them on held controls, and claimed honestly."""

import least_time_turn
import limited_rocket
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from airrace.optimal_control import Accuracy, Iterate, Problem, initial_guess, solve

ROCKET_TIME = 7.418990902


@pytest.mark.parametrize("guess_of", [initial_guess, least_time_turn.standing_guess], ids=["straight", "standing"])
@pytest.mark.parametrize("solver", ["interior-point", "ipopt"])
def test_turn_on_equal_intervals_is_just_slower_than_the_optimum(solver: str, guess_of: object) -> None:
    problem = least_time_turn.in_one_phase(40)
    assert callable(guess_of)
    guess = guess_of(problem)
    assert isinstance(guess, Iterate)
    solution = solve(problem, guess, solver=solver)
    assert solution.success, solution.status
    assert 0.0 < solution.objective - least_time_turn.LEAST_TIME < 1e-5
    assert "of this mesh of 40 intervals" in solution.verdict
    held = solution.time[1:] < least_time_turn.SWITCH
    assert solution.control("u")[held] == pytest.approx(2.0, abs=1e-5)
    # the intervals behind the switch make up for where it lies, ever less
    straight = solution.time[:-1] > least_time_turn.SWITCH + 1.5
    assert solution.control("u")[straight] == pytest.approx(0.0, abs=1e-5)


def test_turn_is_refined_towards_the_optimum_and_certified() -> None:
    solution = solve(least_time_turn.in_one_phase(40), refine=True, accuracy=Accuracy(change=1e-6))
    assert solution.certified, solution.verdict
    assert 0.0 < solution.objective - least_time_turn.LEAST_TIME < 4e-6
    assert "of this mesh" not in solution.verdict
    assert [step.intervals for step in solution.meshes][-1] == solution.problem.intervals


@pytest.mark.parametrize("duration_min", [5.0, 0.5])
def test_rocket_in_one_phase_keeps_its_limit_of_speed_between_nodes(duration_min: float) -> None:
    solution = solve(limited_rocket.in_one_phase(40, duration_min), refine=True)
    assert solution.certified, solution.verdict
    assert ROCKET_TIME < solution.objective < ROCKET_TIME + 2e-4
    assert solution.certificate is not None
    excess = {item.name: item.value for item in solution.certificate.items}["path_m/s"]
    assert excess < 1e-6
    assert solution.state("v").max() <= limited_rocket.SPEED_MAX + 1e-9
    at_limit = solution.state("v") > limited_rocket.SPEED_MAX - 1e-5
    held = solution.control("thrust")[at_limit[:-1] & at_limit[1:]]
    assert len(held) > 10
    assert held == pytest.approx(limited_rocket.HOLD, abs=1e-3)


@pytest.mark.parametrize("duration_min", [0.05, 0.5])
def test_bounds_of_durations_that_do_not_bind_do_not_change_the_arcs(duration_min: float) -> None:
    problem: Problem = limited_rocket.in_arcs(10, duration_min)
    solution = solve(problem, tolerance=1e-10)
    assert solution.objective == pytest.approx(ROCKET_TIME, abs=1e-9)


def test_the_arcs_of_the_rocket_integrated_give_the_digits() -> None:
    """By an integrator of its own, for the mass at which the hold ends."""
    m_hold = 0.01 * limited_rocket.HOLD**2

    def arc(thrust: float, begin: tuple[float, float, float], speed: float) -> tuple[float, list[float]]:
        def rates(_: float, x: list[float]) -> list[float]:
            return [x[1], (thrust - limited_rocket.DRAG * x[1] ** 2) / x[2], -0.01 * thrust**2]

        def reached(_: float, x: list[float]) -> float:
            return x[1] - speed

        reached.terminal = True  # pyright: ignore[reportFunctionMemberAccess]
        ran = solve_ivp(rates, (0.0, 9.0), begin, events=reached, rtol=1e-12, atol=1e-13)
        return float(ran.t_events[0][0]), [float(value) for value in ran.y_events[0][0]]

    push, (s_push, v_push, m_push) = arc(limited_rocket.THRUST_MAX, (0.0, 0.0, 1.0), limited_rocket.SPEED_MAX)

    def flown(hold: float) -> tuple[float, list[float]]:
        begin = (s_push + hold * v_push, v_push, m_push - hold * m_hold)
        return arc(-limited_rocket.THRUST_MAX, begin, 0.0)

    hold = float(brentq(lambda seconds: flown(seconds)[1][0] - 10.0, 3.0, 5.0, xtol=1e-13))
    brake, (_, _, m_end) = flown(hold)
    (answer,) = limited_rocket.known_answers()
    published = [float(value.published) for value in answer.values]
    assert [push + hold + brake, push, hold, brake, m_end] == pytest.approx(published, abs=1.5e-9)
