"""States may jump between phases: what is asked of them on either side, and what measures a flight with jumps."""

from dataclasses import replace

import known_flights
import numpy as np
import pytest
from known_flights import LENS, exact, flight
from small_problems import random_iterate, rich_problem, staged_problem

from airrace.optimal_control.constraint_check import Tolerance, check_constraints
from airrace.optimal_control.kernels import casadi_kernels
from airrace.optimal_control.layout import Layout
from airrace.optimal_control.mesh_refinement import divide, resample
from airrace.optimal_control.optimality import costates, hamiltonian
from airrace.optimal_control.problem import Boundary, Iterate, Phase, Problem, corners, interpolate, uniform
from airrace.optimal_control.quantities import Interval, T, Vector, quantity, vector
from airrace.optimal_control.replay import estimate_defect, interval_durations, replay, replay_phases, sample
from airrace.optimal_control.solve_problem import solve
from airrace.optimal_control.solvers.interface import SolverOptions
from airrace.optimal_control.solvers.messages import SolveRequest
from airrace.optimal_control.solvers.solver import SOLVERS, PreparedProblem
from airrace.optimal_control.solvers.worker import SolveServer
from airrace.optimal_control.system import observation_of, system_of

exactly = Interval.exactly
EXACT = 1e-8
KICK = np.array([0.7, -1.3])


# what is asked on either side


def test_conditions_at_a_phases_end_look_before_its_jump_and_the_next_phase_looks_after_it() -> None:
    looks = {(one.name, one.node): one.jump for one in Layout(staged_problem()).output_samples}
    assert looks["start", 0] is None
    assert (looks["first", 3], looks["second", 5]) == (0, 1)
    assert looks["finish", 6] is None
    assert [looks["one, lasting", node] for node in range(4)] == [None, None, None, 0]
    assert [looks["two, lasting", node] for node in range(3, 6)] == [None, None, 1]  # it looks again after the jump
    assert ("three, lasting", 5) not in looks


def test_bounds_of_both_sides_hold_each_for_its_own_state() -> None:
    problem = staged_problem()
    layout = Layout(problem)
    lower, upper = (bound * layout.scale for bound in layout.unknown_bounds())
    a, b, _ = layout.state_index.T
    assert (lower[a[3]], upper[a[3]]) == pytest.approx((-9.0, 9.0 - 0.3))  # -9 <= a - jump, a <= 9
    # phase two keeps -2 <= b <= 2, its end -1.5 <= b <= 1.5 before a jump of 0.4, after which b is free
    assert (lower[b[5]], upper[b[5]]) == pytest.approx((-1.1, 1.9))
    assert (lower[b[4]], upper[b[4]]) == pytest.approx((-2.0, 2.0))


def test_path_limits_at_a_jump_are_those_of_the_phase_that_begins() -> None:
    rows = [row for row in Layout(staged_problem()).flat_rows if row.quantity.name == "load"]
    own, narrow = Interval(-3.0, 8.0), Interval(-1.0, 2.0)
    assert {row.node: row.bounds for row in rows} == {0: own, 1: own, 2: own, 3: narrow, 4: narrow, 5: own}


def test_arrivals_are_the_next_states_without_the_jumps() -> None:
    problem = staged_problem()
    state = random_iterate(problem, 3).state
    taken_off = np.zeros((3, problem.intervals))
    taken_off[:, 2], taken_off[:, 4] = [-0.3, 0.0, 0.2], [0.0, 0.4, 0.0]
    assert problem.states_before_jump(state) == pytest.approx(state[:, 1:] - taken_off)
    assert (rich_problem().states_before_jump(state) == state[:, 1:]).all()


def test_a_straight_guess_meets_its_corners_before_the_jumps() -> None:
    problem = staged_problem()
    at = np.array([[0.0, 1.0, 3.0, -1.0], [2.0, 2.0, 0.0, 5.0], [1.0, 0.0, 0.0, 4.0]])
    guess = interpolate(problem, [1.0, 2.0, 3.0], at, [0.1, 0.2])
    ends = np.array(problem.first_node[1:])
    assert problem.states_before_jump(guess.state)[:, ends - 1] == pytest.approx(at[:, 1:])
    assert guess.state[:, ends] == pytest.approx(at[:, 1:] + problem.jumps)
    assert guess.state[0, 3:6] == pytest.approx([0.7, 0.7 + 0.6 * 2.3, 3.0])


# what measures a flight


def kicked(bounded: bool = False) -> Problem:
    """The forced oscillator, kicked between its two phases."""
    plain = known_flights.problem()
    first, second = plain.phases
    ends = Boundary("kick", {"distance": Interval(-5.0, 5.0)}, LENS, (0.2,)) if bounded else Boundary("kick")
    names = [one.name for one in plain.system.states]
    return replace(plain, phases=(replace(first, end=ends, jump=dict(zip(names, KICK.tolist(), strict=True))), second))


def kicked_flight(problem: Problem) -> Iterate:
    """The exact flight on a problem's mesh."""
    smooth = flight(problem)
    states = [smooth.state[:, 0]]
    for k, step in enumerate(interval_durations(problem, smooth.durations)):
        end = exact(states[-1], float(smooth.control[0, k]), float(step))
        states.append(end + KICK if k + 1 == problem.first_node[1] else end)
    return replace(smooth, state=np.array(states).T)


def test_an_exact_flight_replays_onto_itself_and_a_jump_that_it_leaves_out_is_a_defect() -> None:
    stated, flown = kicked(), kicked_flight(kicked())
    assert np.abs(replay(stated, flown).defect).max() < EXACT
    assert np.abs(estimate_defect(stated, flown)).max() < 1e-5
    assert np.abs(replay_phases(stated, flown)).max() < 1e-6
    defect = replay(stated, flight(stated)).defect
    scale = np.array([one.scale for one in stated.system.states])
    assert defect[:, 2] == pytest.approx(KICK / scale, abs=EXACT)
    assert np.abs(np.delete(defect, 2, axis=1)).max() < EXACT


def test_a_boundary_is_audited_before_the_jump() -> None:
    stated = kicked(bounded=True)
    flown = kicked_flight(stated)
    before = float(stated.states_before_jump(flown.state)[0, 2])
    bounds = {"distance": Interval(upper=before - 0.2 - 0.125), "v": exactly(float(flown.state[1, 3]))}
    first, second = stated.phases
    strict = replace(stated, phases=(replace(first, end=replace(first.end, bounds=bounds)), second))
    tolerances = (Tolerance("place", ("m",), 1e-3, 1e-3), Tolerance("speed", ("m/s", "W/kg", "N/kg"), 1e-3, 1e-3))
    items = check_constraints(strict, flown, replay(strict, flown), tolerances=tolerances, defect_limit=1e-6).items
    measured = {item.name: item.value for item in items}
    assert measured["gate_place"] == pytest.approx(0.125)
    assert measured["gate_speed"] == pytest.approx(abs(KICK[1]))
    assert measured["replay_defect"] < EXACT


def test_samples_are_those_of_the_exact_flight_and_lie_after_the_jump_at_its_instant() -> None:
    stated = kicked()
    flown, time = kicked_flight(stated), known_flights.node_times(stated)
    wanted = np.array([time[3] - 0.1, time[3], time[3] + 0.1])
    seen = sample(stated.system, np.array(stated.parameters), flown, time=time, times=wanted)
    last, next_ = float(flown.control[0, 2]), float(flown.control[0, 3])
    assert seen[:, 0] == pytest.approx(exact(flown.state[:, 2], last, time[3] - time[2] - 0.1), abs=EXACT)
    assert seen[:, 1] == pytest.approx(flown.state[:, 3], abs=EXACT)
    assert seen[:, 2] == pytest.approx(exact(flown.state[:, 3], next_, 0.1), abs=EXACT)


def test_flights_on_other_meshes_keep_the_jump_and_are_straight_up_to_it_and_from_it() -> None:
    stated, flown = kicked(), kicked_flight(kicked())
    mesh, finer = divide(stated.mesh, flown, replay(stated, flown), np.full(5, 2))
    first, second = (replace(phase, fractions=parts) for phase, parts in zip(stated.phases, mesh, strict=True))
    assert np.abs(replay(replace(stated, phases=(first, second)), finer).defect).max() < EXACT
    _, iterate = resample(stated.mesh, flown, (6, 4), jumps=stated.jumps)
    assert iterate.state[:, [0, 6, 10]] == pytest.approx(flown.state[:, [0, 3, 5]])
    nodes = np.array([0.2, 0.7, 1.0])
    before = stated.states_before_jump(flown.state)
    expected = [np.interp(5 / 6, nodes, [flown.state[row, 1], flown.state[row, 2], before[row, 2]]) for row in (0, 1)]
    assert iterate.state[:, 5] == pytest.approx(expected)
    _, same = resample(stated.mesh, flown, (3, 2), jumps=stated.jumps)
    assert (same.state == flown.state).all()


# an optimum that is known


@vector
class Sled(Vector[T]):
    x: T = quantity("m", scale=0.5)
    v: T = quantity("m/s", scale=2.0)
    m: T = quantity("kg", scale=3.0)


@vector
class Push(Vector[T]):
    f: T = quantity("N", scale=10.0, lower=-20.0, upper=20.0)


@vector
class Place(Vector[T]):
    at: T = quantity("m")


PLACE = observation_of("place", Sled, Place, lambda x: Place(at=x.x + 0.0 * x.m))
SLED = system_of("sled", Sled, Push, lambda x, u: Sled(x=x.v, v=u.f / x.m, m=0.0))


def lightened(load: float = 3.0) -> tuple[Problem, Iterate]:
    """A sled of 4 kg gets from rest to rest over 1 m in the least time; half way it drops a load."""
    within = Interval(0.01, 5.0)
    half = Boundary("half way", {"x": exactly(0.5)})
    end = Boundary("end", {"x": exactly(1.0), "v": exactly(0.0)})
    phases = (
        Phase("loaded", uniform(3), within, half, jump={"m": -load}),
        Phase("empty", uniform(2), within),
        Phase("braking", uniform(2), within, end),
    )
    start = Boundary("start", {"x": exactly(0.0), "v": exactly(0.0), "m": exactly(4.0)})
    problem = Problem(SLED, (), start, phases)
    light = 4.0 - load
    states = (Sled(x=0.0, v=0.0, m=4.0), Sled(x=0.5, v=1.0, m=4.0), Sled(x=0.7, v=2.0, m=light))
    return problem, interpolate(problem, [0.5, 0.2, 0.2], corners(*states, Sled(x=1.0, v=0.0, m=light)), [0.0])


def least_time(load: float) -> float:
    """By the closed form: all the force forwards, then all of it backwards."""
    a, a_light = 20.0 / 4.0, 20.0 / (4.0 - load)
    v = np.sqrt(a)
    fastest = np.sqrt((a_light + v**2) / 2)
    return float(v / a + (fastest - v) / a_light + fastest / a_light)


@pytest.mark.parametrize("solver", SOLVERS)
def test_least_time_with_a_dropped_load_is_that_of_the_closed_form(solver: str) -> None:
    problem, guess = lightened()
    solution = solve(problem, guess, solver=solver, options=SolverOptions(tolerance=1e-9))
    assert solution.success, solution.status
    assert solution.objective == pytest.approx(least_time(3.0), abs=1e-7)
    assert solution.iterate.state[2] == pytest.approx([4.0] * 3 + [1.0] * 5)
    assert solution.kkt.largest < 1e-7
    assert np.abs(replay(problem, solution.iterate).defect).max() < EXACT
    multipliers = solution.multipliers.constraints  # costates and Hamiltonian go on through the jump
    assert hamiltonian(problem, solution.iterate, multipliers) == pytest.approx(-np.ones(7), abs=1e-6)
    p_x, p_v, p_m = costates(Layout(problem), multipliers)
    # the multiplier of the jump itself says what a kilogram less of load would cost
    cost = (least_time(3.0 - 1e-4) - least_time(3.0 + 1e-4)) / 2e-4
    assert p_m[2] == pytest.approx(cost, rel=1e-5)
    # between the jumps p_v falls by p_x per second
    lengths = solution.iterate.durations[0] / 3 * np.arange(3)
    assert p_v[:3] == pytest.approx(p_v[0] - p_x[0] * lengths, abs=1e-6)


def test_a_prepared_problem_takes_other_jumps() -> None:
    (problem, guess), (other, other_guess) = lightened(3.0), lightened(2.0)
    kernels = casadi_kernels(SLED, problem.scheme)
    prepared = PreparedProblem(Layout(problem), kernels, "interior-point", SolverOptions(tolerance=1e-9), threads=1)
    assert prepared.solve(Layout(problem), guess).objective == pytest.approx(least_time(3.0), abs=1e-7)
    assert prepared.solve(Layout(other), other_guess).objective == pytest.approx(least_time(2.0), abs=1e-7)


def test_a_worker_tells_problems_with_jumps_from_those_without() -> None:
    jumping, guess = lightened()
    seen = Boundary("half way", {"at": Interval.exactly(0.5), "m": exactly(4.0)}, PLACE)
    jumping = replace(jumping, phases=(replace(jumping.phases[0], end=seen), *jumping.phases[1:]))
    steady = replace(jumping, phases=(replace(jumping.phases[0], jump={}), *jumping.phases[1:]))
    server = SolveServer()
    for problem, load in ((jumping, 3.0), (steady, 0.0), (jumping, 3.0)):
        request = SolveRequest(problem, guess, None, "interior-point", SolverOptions(tolerance=1e-9), 1)
        assert server.solve(request).objective == pytest.approx(least_time(load), abs=1e-6)
