"""Guesses, pieces of them, and what is prepared for a stage."""

import dataclasses
import itertools
import math

import numpy as np
import pytest
from races import RACES, SIXTEEN, SMALL, models_of, planned, prepared, settings
from transformations import mirrored

from airrace.model.dynamics.flight_model import FlightModel
from airrace.model.dynamics.point_mass import PointMassControl, PointMassState
from airrace.model.frames import angles, rotation
from airrace.optimal_control.problem import Iterate, Problem
from airrace.optimal_control.trajectory import Array
from airrace.procedure import stage_models as module
from airrace.procedure.control.dynamic_inversion import InnerLoopInverse
from airrace.procedure.control.simulation import TrackingSimulator, tracking_simulator
from airrace.procedure.guess import (
    FIRST_MESH,
    QUATERNION_ROWS,
    SHORTEST_SHARE,
    concatenate,
    counts_of,
    first_mesh,
    guess,
    leg_seconds,
    phase_piece,
    shift,
)
from airrace.procedure.settings import GuessKind, MeshSettings
from airrace.procedure.stage import Stage

MESH = MeshSettings()
every_race = pytest.mark.parametrize("name", RACES)
MIRRORED_STATES = ("y", "q1", "q3", "n_y", "p_Kbar")
MIRRORED_CONTROLS = ("n_y_dot", "p_Kbar_dot")


def guessed(name: str) -> Iterate:
    plan = planned(RACES[name])
    return guess(plan, first_mesh(plan, MESH))


def ends(name: str) -> list[int]:
    """Nodes at the waypoints."""
    return np.cumsum([0, *(len(fractions) for fractions in first_mesh(planned(RACES[name]), MESH))]).tolist()


@every_race
def test_mesh_divides_every_phase_into_enough_equal_intervals(name: str) -> None:
    plan = planned(RACES[name])
    for fractions, seconds in zip(first_mesh(plan, MESH), leg_seconds(plan), strict=True):
        assert sum(fractions) == pytest.approx(1.0)
        assert len(set(fractions)) == 1
        assert len(fractions) >= MESH.intervals_min
        assert seconds / len(fractions) <= MESH.interval
        assert len(fractions) % FIRST_MESH.count_step == 0


def test_first_intervals_are_longer_in_long_races_alone() -> None:
    plan = planned(SIXTEEN)
    seconds = leg_seconds(plan)
    times = math.ceil(FIRST_MESH.stretch_max * FIRST_MESH.long_race / sum(seconds))
    waypoints = (*plan.waypoints[:-1] * times, plan.waypoints[-1])
    longer = dataclasses.replace(plan, legs=plan.legs * times, waypoints=waypoints)
    lap = [len(fractions) for fractions in first_mesh(plan, MESH)]
    stretched = [len(fractions) for fractions in first_mesh(longer, MESH)]
    assert stretched == counts_of(seconds, MESH, FIRST_MESH.stretch_max) * times
    assert FIRST_MESH.stretch_max * sum(stretched) < 1.2 * sum(lap) * times  # counts are rounded up
    assert max(np.array(seconds * times) / np.array(stretched)) <= FIRST_MESH.stretch_max * MESH.interval


@every_race
def test_guess_fits_its_problem_with_unit_quaternions_without_jumps_of_sign(name: str) -> None:
    made, problem = guessed(name), prepared(RACES[name]).problem(first_mesh(planned(RACES[name]), MESH))
    assert made.durations.shape == (len(problem.phases),)
    assert made.state.shape == (len(problem.system.states), problem.intervals + 1)
    assert made.control.shape == (len(problem.system.controls), problem.intervals)
    assert all(np.isfinite(values).all() for values in (made.durations, made.state, made.control))
    assert (made.durations > 0.0).all()
    q = np.array(PointMassState[Array].split(made.state).q)
    assert np.allclose((q * q).sum(axis=0), 1.0, atol=1e-9)
    assert ((q[:, 1:] * q[:, :-1]).sum(axis=0) > 0.5).all()


@every_race
def test_flight_leads_through_the_waypoints_in_their_attitude(name: str) -> None:
    state = PointMassState[Array].split(guessed(name).state)
    for waypoint, node in zip(planned(RACES[name]).waypoints, ends(name), strict=True):
        if waypoint.position is not None:
            north, east, height = waypoint.position
            assert [state.x[node], state.y[node], -state.z[node]] == pytest.approx([north, east, height], abs=1e-6)
        R, expected = np.array(rotation([float(one[node]) for one in state.q])), np.array(rotation(waypoint.q))
        assert np.allclose(R[:, 0], expected[:, 0], atol=1e-6)
        assert waypoint.bank is None or np.allclose(R, expected, atol=1e-6)


@every_race
def test_path_moves_in_the_direction_of_its_attitude_and_controls_are_the_rates_of_the_commands(name: str) -> None:
    """Between two nodes the flight goes where the attitudes at both ends point, at about the planned speed."""
    made, plan = guessed(name), planned(RACES[name])
    state, control = PointMassState[Array].split(made.state), PointMassControl[Array].split(made.control)
    R = rotation([np.asarray(one) for one in state.q])
    direction = np.array([R[0][0], R[1][0], R[2][0]])
    moved = np.diff(np.array([state.x, state.y, state.z]), axis=1)
    for leg, first, last in zip(plan.legs, ends(name), ends(name)[1:], strict=False):
        middle = direction[:, first:last] + direction[:, first + 1 : last + 1]
        cosine = (middle * moved[:, first:last]).sum(axis=0)
        cosine /= np.linalg.norm(middle, axis=0) * np.linalg.norm(moved[:, first:last], axis=0)
        # Between free positions the path is sheared so that it ends where it must: up to 30 degrees off at its worst.
        assert cosine.min() > (0.999 if leg.path is not None else 0.85)
    parts = zip(first_mesh(plan, MESH), made.durations, strict=True)
    steps = np.concatenate([np.asarray(part) * T for part, T in parts])
    for command in ("n_z", "n_y", "p_Kbar"):
        values, rate = getattr(state, command), getattr(control, f"{command}_dot")
        assert np.allclose(values[:-1] + rate * steps, values[1:], atol=1e-9)
    assert (control.delta_T_cmd == 1.0).all()


@every_race
def test_load_factor_bends_the_path_as_much_as_it_turns(name: str) -> None:
    """On level legs the bank and load factor are those of a coordinated turn: n_z cos(mu) = 1 away from gates."""
    made, plan = guessed(name), planned(RACES[name])
    state = PointMassState[Array].split(made.state)
    for leg, first, last in zip(plan.legs, ends(name), ends(name)[1:], strict=False):
        if leg.path is None:
            continue
        reach = math.ceil(0.35 * (last - first))  # the prescribed bank of a gate holds at both ends
        for node in range(first + reach, last - reach):
            bank = angles(rotation([float(one[node]) for one in state.q]))[2]
            assert state.n_z[node] * math.cos(bank) == pytest.approx(1.0, abs=0.05)


@every_race
def test_mirrored_course_has_the_mirrored_guess(name: str) -> None:
    made = guessed(name)
    plan = planned(mirrored(RACES[name]))
    image = guess(plan, first_mesh(plan, MESH))
    assert np.allclose(image.durations, made.durations, rtol=1e-12)
    assert np.allclose(in_mirror(image.state, PointMassState.names(), MIRRORED_STATES), made.state, atol=1e-6)
    assert np.allclose(in_mirror(image.control, PointMassControl.names(), MIRRORED_CONTROLS), made.control, atol=1e-5)


def in_mirror(histories: Array, names: tuple[str, ...], turned: tuple[str, ...]) -> Array:
    """Histories with the rows named in `turned` negated."""
    return histories * np.array([-1.0 if name in turned else 1.0 for name in names])[:, None]


@pytest.mark.parametrize("name", ["rovinj_2014", "sixteen_phases", "four_gates"])
def test_mesh_of_another_density_samples_the_same_path(name: str) -> None:
    plan = planned(RACES[name])
    coarse = first_mesh(plan, MESH)
    fine = [tuple(part / 2 for part in fractions for _ in range(2)) for fractions in coarse]
    sparse, dense = guess(plan, coarse), guess(plan, fine)
    assert np.allclose(dense.durations, sparse.durations)
    path = [PointMassState.names().index(one) for one in ("x", "y", "z", "V_K", "q0", "q1", "q2", "q3", "n_z")]
    assert np.allclose(dense.state[path, ::2], sparse.state[path], atol=1e-6)


def test_free_manoeuvres_follow_one_another_without_gaps() -> None:
    name = "half_cuban_eight"
    made, plan = guessed(name), planned(RACES[name])
    assert any(waypoint.position is None for waypoint in plan.waypoints)
    state = PointMassState[Array].split(made.state)
    step = np.linalg.norm(np.diff(np.array([state.x, state.y, state.z]), axis=1), axis=0)
    counts = [len(part) for part in first_mesh(plan, MESH)]
    flown = np.concatenate([[T / n * plan.cruise.V] * n for T, n in zip(made.durations.tolist(), counts, strict=True)])
    assert (step < 2.0 * flown).all()


@pytest.mark.parametrize(
    ("stage", "simulations"),
    [
        (Stage.POINT_MASS, 0),
        (Stage.TRANSFER_FUNCTION, 1),
        (Stage.STATE_SPACE, 0),  # it flies the equations of the stage below
        (Stage.SIX_DOF, 1),
    ],
)
def test_models_that_are_simulated_are_put_under_their_controllers_once(
    stage: Stage, simulations: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    made: list[FlightModel] = []

    def watched(model: FlightModel, inverse: InnerLoopInverse) -> TrackingSimulator:
        made.append(model)
        return tracking_simulator(model, inverse)

    monkeypatch.setattr(module, "tracking_simulator", watched)
    models = models_of(SMALL, settings(GuessKind.PLAN), stage)
    assert len(made) == simulations
    assert all(model is models.problem(stage).model for model in made)


def flight(name: str) -> tuple[Problem, Iterate]:
    """The guess of a race, with numbers in its controls that differ from interval to interval."""
    mesh = first_mesh(planned(RACES[name]), MeshSettings())
    made = guess(planned(RACES[name]), mesh)
    made.control[-1] = np.linspace(0.0, 1.0, made.control.shape[1])
    return prepared(RACES[name]).problem(mesh), made


def pieces_of(problem: Problem, whole: Iterate) -> list[Iterate]:
    return [phase_piece(whole, problem, index) for index in range(len(problem.phases))]


@every_race
def test_pieces_share_the_node_at_their_gate_join_again_and_move_from_plan_to_plan(name: str) -> None:
    problem, whole = flight(name)
    pieces = pieces_of(problem, whole)
    again = concatenate(pieces)
    assert (again.durations == whole.durations).all()
    assert (again.control == whole.control).all()
    assert (again.state == whole.state).all()
    for piece, phase in zip(pieces, problem.phases, strict=True):
        assert piece.state.shape[1] == len(phase.fractions) + 1 == piece.control.shape[1] + 1
    for one, next_one in itertools.pairwise(pieces):
        assert (one.state[:, -1] == next_one.state[:, 0]).all()
    before = pieces[0]
    after = Iterate(before.durations + 0.3, before.state + 2.0, before.control - 0.1)
    after.state[QUATERNION_ROWS] = before.state[QUATERNION_ROWS][:, ::-1]
    shifted = shift(before, before, after)
    assert np.allclose(shifted.state, after.state, atol=1e-9)
    assert np.allclose(shifted.control, after.control)
    assert np.allclose(shifted.durations, after.durations)


def test_joining_keeps_the_later_of_two_states_at_a_gate_and_aligns_the_signs_of_attitudes() -> None:
    problem, whole = flight("four_gates")
    first, second, third = pieces_of(problem, whole)
    later = concatenate([first, Iterate(second.durations, second.state + 5.0, second.control), third])
    node = problem.first_node[1]
    assert later.state[0, node] == whole.state[0, node] + 5.0
    assert later.state[0, node - 1] == whole.state[0, node - 1]
    flipped = second.state.copy()
    flipped[QUATERNION_ROWS] *= -1.0
    again = concatenate([first, Iterate(second.durations, flipped, second.control), third])
    assert np.allclose(again.state, whole.state, atol=1e-12)


def test_moving_by_no_difference_changes_nothing_and_keeps_a_positive_duration() -> None:
    problem, whole = flight("four_gates")
    piece, reference = phase_piece(whole, problem, 0), phase_piece(whole, problem, 0)
    shifted = shift(piece, reference, reference)
    assert np.allclose(shifted.state, piece.state, atol=1e-12)
    assert (shifted.durations == piece.durations).all()
    long = Iterate(piece.durations * 10.0, piece.state, piece.control)
    assert shift(piece, long, piece).durations == pytest.approx(SHORTEST_SHARE * piece.durations)
