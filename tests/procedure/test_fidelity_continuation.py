"""The fidelity continuation from the point mass to six degrees of freedom: what stages share and hand on."""

import copy
import dataclasses
import itertools
import math
import pickle
from collections.abc import Sequence

import casadi as ca
import numpy as np
import pytest
from races import (
    EDGE_540,
    OPTIMA,
    PLAN,
    QUICK,
    RACES,
    SHIPPED,
    SMALL,
    WITHOUT_ANGLES,
    assert_certified,
    models_of,
    motion,
    optimum_of,
    prepared,
    seconds,
    solve_stages,
)

from airrace.errors import Finding, InputError
from airrace.model.dynamics import flight_model, state_space_inversion
from airrace.model.dynamics.flight_model import FlightModel
from airrace.model.dynamics.outer_loop import LoadFactors, load_factors
from airrace.model.dynamics.point_mass import build_point_mass
from airrace.model.dynamics.state_space import Surrounding
from airrace.model.environment import g0
from airrace.model.frames import QUATERNION, angles, rotation
from airrace.optimal_control.layout import Layout
from airrace.optimal_control.problem import Problem
from airrace.optimal_control.replay import interval_durations
from airrace.optimal_control.runge_kutta import RungeKutta
from airrace.optimal_control.solvers.service import SolverService
from airrace.optimal_control.system import Observation, System
from airrace.optimal_control.trajectory import Array
from airrace.procedure import fidelity
from airrace.procedure.control.path_following import from_optimum
from airrace.procedure.control.simulation import at
from airrace.procedure.fidelity import Fidelity, fidelity_of, register
from airrace.procedure.guess import first_mesh
from airrace.procedure.procedure import optimize
from airrace.procedure.result import Silent, StageResult, Status
from airrace.procedure.settings import Settings
from airrace.procedure.stage import STAGES, Stage
from airrace.procedure.stage_problem import history, mesh_of
from airrace.procedure.stored_stages import derived_quantities
from airrace.procedure.warm_start import FEWEST, first_nodes, map_controls, trimmed_start

each_race = pytest.mark.parametrize("name", QUICK)
each_stage = pytest.mark.parametrize("stage", OPTIMA, ids=lambda stage: stage.value)
LIMITS = PLAN.certificate
SURFACES = (Stage.STATE_SPACE, Stage.SIX_DOF)
FASTER = 0.02
"""s, that a higher fidelity may gain on a lower one."""


def test_a_stage_that_aircraft_and_rules_leave_no_model_is_refused_before_any_is_solved(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def contradictory(*_: object, **__: object) -> FlightModel:
        raise InputError([Finding("course.yaml", 3, 5, "rules.extra", "no value is allowed")])

    refused = dataclasses.replace(fidelity_of(Stage.SIX_DOF), build=contradictory)
    monkeypatch.setitem(fidelity._fidelities, Stage.SIX_DOF, refused)  # pyright: ignore[reportPrivateUsage]  # registered once
    started: list[Stage] = []

    class Watching(Silent):
        def stage_started(self, stage: Stage) -> None:
            started.append(stage)

    with pytest.raises(InputError, match=r"rules\.extra"):
        next(optimize(SMALL, PLAN, until=Stage.SIX_DOF, threads=1, progress=Watching()))
    assert not started


@pytest.mark.parametrize("stage", STAGES, ids=lambda stage: stage.value)
def test_all_that_a_stage_observes_is_loaded_before_it_is_solved(stage: Stage) -> None:
    loaded: set[ca.Function] = set()

    class Service(SolverService):
        def __init__(self) -> None: ...

        def preload(
            self, system: System, scheme: RungeKutta = Problem.scheme, observed: Sequence[Observation] = ()
        ) -> None:
            loaded.update(one.values for one in observed)

    models = models_of(SHIPPED["half_cuban_eight"], PLAN, stage)
    models.preload(stage, Service())
    stage_problem = models.problem(stage)
    layout = Layout(stage_problem.problem(first_mesh(stage_problem.plan, PLAN.mesh)))
    assert len(loaded) > 1
    assert loaded == {sample.observation.values for sample in layout.output_samples}


@each_race
def test_every_stage_is_certified(name: str) -> None:
    assert_certified(RACES[name])


@each_race
@pytest.mark.parametrize(
    ("lower", "higher"), list(itertools.combinations(OPTIMA, 2)), ids=lambda stage: stage.value.replace("-", "_")
)
def test_higher_fidelity_is_not_faster(name: str, lower: Stage, higher: Stage) -> None:
    """The largest gain is that of the linear state space over the transfer functions on the four gates, 8 ms."""
    assert seconds(name, higher) > seconds(name, lower) - FASTER


@pytest.mark.slow
def test_what_the_linear_state_space_gains_is_the_thrust_that_carries_the_aircraft(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Its thrust carries `T alpha`, for it is tilted by the angle of attack, which transfer functions do not know.

    Without that term nothing is gained: not 8 ms, but 0.1 ms.
    """
    true, finished = state_space_inversion.surrounding, solve_stages(SMALL)[:2]  # solve_stages with the true equations

    def without_pull(*args: object, **named: object) -> Surrounding:
        return dataclasses.replace(true(*args, **named), pull=0.0)

    monkeypatch.setattr(state_space_inversion, "surrounding", without_pull)
    monkeypatch.setattr(
        flight_model, "functions", flight_model.functions.__wrapped__
    )  # what is kept knows nothing of patches
    (level,) = optimize(
        SMALL,
        PLAN,
        until=Stage.STATE_SPACE_INVERSION,
        threads=1,
        finished=finished,
        progress=Silent(),
    )
    assert level.certified
    tilted, without_angles = (
        seconds("four_gates", stage) for stage in (Stage.STATE_SPACE_INVERSION, Stage.TRANSFER_FUNCTION)
    )
    assert tilted < without_angles - 0.004
    assert level.trajectory.race_time > without_angles - 0.001


# limits


@each_race
@each_stage
def test_loads_roll_rate_lift_and_sideslip_have_the_same_limits_in_all_stages(name: str, stage: Stage) -> None:
    """Measured from the path that is flown, not from what the models say of it.

    The lift is what the propeller leaves to carry; the limits of coefficients count as load factors.
    """
    seen, rules, pilot, lift = motion(name, stage), RACES[name].course.rules, EDGE_540.point_mass, EDGE_540.lift
    assert rules.n_z.lower - LIMITS.load_factor < seen.n_z.min()
    assert seen.n_z.max() < rules.n_z.upper + LIMITS.load_factor
    assert name != "four_gates" or seen.n_z.max() == pytest.approx(10.0, abs=LIMITS.load_factor)  # it binds
    assert np.abs(seen.n_y).max() < pilot.n_y + LIMITS.load_factor
    assert np.abs(seen.p_Kbar).max() < pilot.p + LIMITS.angle
    assert lift.C_L_min - LIMITS.load_factor < seen.C_L.min()
    assert seen.C_L.max() < lift.C_L_max + LIMITS.load_factor
    assert np.abs(seen.beta_A).max() < EDGE_540.drag.beta_A_max + LIMITS.angle


@each_race
@pytest.mark.parametrize("stage", SURFACES, ids=lambda stage: stage.value)
def test_surfaces_keep_their_travels_and_rates(name: str, stage: Stage) -> None:
    flown, surfaces = optimum_of(name, stage).trajectory, EDGE_540.surfaces
    for surface, travel in (("eta", surfaces.eta), ("xi", surfaces.xi), ("zeta", surfaces.zeta)):
        deflection = flown[surface]
        rates = np.diff(deflection) / np.diff(flown.time)
        assert travel.lower - 1e-6 < deflection.min()
        assert deflection.max() < travel.upper + 1e-6
        assert np.abs(rates).max() < surfaces.rate + 1e-4


# what a stage hands to the next


@each_race
def test_state_space_begins_with_the_recorded_flight(name: str) -> None:
    source, stage_problem = prepared(RACES[name], Stage.STATE_SPACE_INVERSION), prepared(RACES[name], Stage.STATE_SPACE)
    optimum = optimum_of(name, Stage.STATE_SPACE_INVERSION)
    start = map_controls(stage_problem, source, optimum)
    flown, steps = optimum.trajectory, interval_durations(start.problem, start.guess.durations)
    nodes = np.concatenate([[0.0], np.cumsum(steps)])
    assert steps.max() <= stage_problem.longest_interval + 1e-9
    for row, one in zip(start.guess.state, stage_problem.model.system.states, strict=True):
        assert np.allclose(row, np.interp(nodes, flown.time, history(source, flown, one.name)), rtol=0.0, atol=1e-9)
    assert (start.guess.durations == flown.durations).all()
    names = [one.name for one in stage_problem.model.system.states]
    for row, one in zip(start.guess.control, stage_problem.model.system.controls, strict=True):
        assert one.lower <= row.min()
        assert row.max() <= one.upper
        if one.rate_of:  # straight from deflection to deflection, as fast as surfaces go
            moved = np.diff(start.guess.state[names.index(one.rate_of)])
            within = np.abs(moved / steps) <= one.upper
            assert np.allclose((row * steps)[within], moved[within], atol=1e-9)
        else:  # the lever: as much in every interval as was pulled in it
            held = np.clip(flown[one.name], one.lower, one.upper) @ np.diff(flown.time)
            assert row @ steps == pytest.approx(held, rel=1e-6)


@each_race
def test_flights_between_the_stages_say_and_stay_near_what_they_follow(name: str) -> None:
    """Only where the very same flight is told anew does nothing stray; the half Cuban eight, slow at its top, most."""
    results = solve_stages(RACES[name])
    assert results[0].provenance.source == ""
    for before, result in itertools.pairwise(results):
        start = result.provenance
        assert start.source == before.stage.value
        if result.stage is Stage.STATE_SPACE:
            assert (start.tracking_error, start.tracking_error_time, start.terminal_miss) == (0.0, 0.0, 0.0)
        else:
            assert 0.0 < start.terminal_miss <= start.tracking_error < 10.0
            assert 0.0 < start.tracking_error_time < 1.05 * before.trajectory.race_time


@pytest.mark.parametrize("longest", [0.03, 0.07, 0.1, 1.0])
def test_first_mesh_is_as_dense_as_the_one_before_and_no_coarser_than_allowed(longest: float) -> None:
    optimum = solve_stages(SMALL)[0]
    nodes, first_node = first_nodes(optimum, longest)
    steps, flown = np.diff(nodes), optimum.trajectory
    before = flown.time[optimum.coarser_nodes]
    assert (nodes[first_node] == flown.time[flown.first_node]).all()
    assert steps.min() > 0.0
    assert steps.max() <= longest + 1e-9
    for a, b in itertools.pairwise(nodes):  # nowhere coarser than the mesh it was taken from
        touched = (before[1:] > a + 1e-9) & (before[:-1] < b - 1e-9)
        assert b - a <= np.diff(before)[touched].max() + 1e-9
    assert len(steps) <= np.ceil(np.maximum(1.0, np.diff(before) / longest)).sum() + FEWEST * len(flown.phases)


@pytest.mark.parametrize("stage", OPTIMA[1:], ids=lambda stage: stage.value)
def test_settled_flight_pulls_and_rolls_as_the_point_mass_does(stage: Stage) -> None:
    """Without its corners, which no aircraft that rotates can follow."""
    source, stage_problem, optimum = prepared(SMALL), prepared(SMALL, stage), solve_stages(SMALL)[0]
    start = trimmed_start(stage_problem, source, optimum)
    reference = from_optimum(source.model, source.problem(mesh_of(optimum.trajectory)), optimum.trajectory)
    wanted = at(reference, first_nodes(optimum, stage_problem.longest_interval)[0])
    x, u = start.guess.state, np.hstack([start.guess.control, start.guess.control[:, -1:]])
    p = np.repeat(stage_problem.model.parameter_values[:, None], x.shape[1], axis=1)
    done = LoadFactors[Array].split(np.asarray(load_factors(stage_problem.model.system).map(x.shape[1])(x, u, p)))
    assert np.allclose(done.n_z, wanted.soft_n_z, atol=1e-3)
    assert np.allclose(done.n_y, wanted.n_y, atol=1e-3)
    assert np.allclose(done.p_Kbar, wanted.soft_p, atol=1e-3)
    assert start.provenance.source == "point-mass"


# resumed, and failed


@pytest.mark.parametrize(
    ("kept", "until"),
    [(kept, OPTIMA[kept]) for kept in range(1, len(OPTIMA))]
    + [pytest.param(kept, Stage.SIX_DOF, marks=pytest.mark.slow) for kept in range(1, len(OPTIMA) - 1)],
)
def test_run_resumed_behind_any_stage_goes_on_in_every_bit_as_before(kept: int, until: Stage) -> None:
    """One stage more is enough: where it has the same bits, so has the one behind it, which is resumed likewise."""
    whole = solve_stages(SMALL)
    rest = list(optimize(SMALL, PLAN, until=until, threads=1, finished=whole[:kept], progress=Silent()))
    before = whole[kept : OPTIMA.index(until) + 1]
    assert [result.stage for result in rest] == [result.stage for result in before]
    for again, first in zip(rest, before, strict=True):
        np.testing.assert_array_equal(again.trajectory.state, first.trajectory.state)


def test_run_ends_with_the_stage_that_fails() -> None:
    hurried = dataclasses.replace(PLAN, solver=dataclasses.replace(PLAN.solver, iterations_max=2))
    rest = list(
        optimize(SMALL, hurried, until=Stage.SIX_DOF, threads=1, finished=solve_stages(SMALL)[:1], progress=Silent())
    )
    assert [(result.stage, result.outcome) for result in rest] == [(Stage.TRANSFER_FUNCTION, Status.NOT_CONVERGED)]


# derived quantities


def named_histories(result: StageResult) -> dict[str, Array]:
    """All states and controls at the nodes; the last node has the controls of the last interval."""
    flown = result.trajectory
    held = np.hstack([flown.control, flown.control[:, -1:]])
    rows = zip((*flown.states, *flown.controls), (*flown.state, *held), strict=True)
    return {one.name: row for one, row in rows}


@each_race
@each_stage
def test_derived_quantities_are_the_models_own_and_forces_are_load_factors_times_the_weight(
    name: str, stage: Stage
) -> None:
    """Load factors as they are told, and as they are seen from the path."""
    race, result = RACES[name], optimum_of(name, stage)
    stage_problem, histories = prepared(race, stage), named_histories(result)
    told = histories | {one.name: of(histories) for one, of in derived_quantities(race, result).items()}
    for one in stage_problem.model.system.path:
        assert np.allclose(told[one.name], history(stage_problem, result.trajectory, one.name), rtol=0.0, atol=1e-12), (
            one.name
        )
    assert {"n_x", "n_y", "n_z", "C_L", "beta_A", "F_x", "F_y", "F_z"} <= set(told)
    assert stage in WITHOUT_ANGLES or "alpha_A" in told
    weight, seen = EDGE_540.airframe.m * g0, motion(name, stage)
    for axis, sign in (("x", 1.0), ("y", 1.0), ("z", -1.0)):
        assert np.allclose(told[f"F_{axis}"], sign * weight * told[f"n_{axis}"])
    for load in ("n_x", "n_y", "n_z", "p_Kbar" if "p_Kbar" in told else "p_s"):
        measured = getattr(seen, "p_Kbar" if load == "p_s" else load)[:, 0]
        assert np.allclose(told[load][:-1], measured, atol=1e-3), load


# what a pilot could fly


@pytest.mark.parametrize("name", ["four_gates", pytest.param("half_cuban_eight", marks=pytest.mark.slow)])
def test_smooth_controls_cost_next_to_no_time(name: str) -> None:
    """Halving their weight gains 0.2 ms over the four gates and 1 ms in the half Cuban eight; meshes may differ."""
    half = dataclasses.replace(PLAN, regularisation=0.5 * PLAN.regularisation)
    race, whole = RACES[name], solve_stages(RACES[name])
    (result,) = optimize(race, half, until=Stage.SIX_DOF, threads=1, start=whole, start_name="whole", progress=Silent())
    assert (result.stage, result.remarks, result.certified) == (Stage.SIX_DOF, "", True)
    gained = seconds(name, Stage.SIX_DOF) - result.trajectory.race_time
    assert -0.002 < gained < 0.02, f"halving the regularisation gains {1e3 * gained:.2f} ms"


@each_race
@each_stage
def test_certificate_holds_the_total_variation_of_all_that_is_moved(name: str, stage: Stage) -> None:
    result = optimum_of(name, stage)
    assert result.certificate is not None
    moved = {
        item.name.removeprefix("variation_"): item.value
        for item in result.certificate.items
        if item.name.startswith("variation_")
    }
    expected = {
        Stage.POINT_MASS: {"n_z", "n_y", "p_Kbar"},
        Stage.STATE_SPACE: {"eta", "xi", "zeta"},
        Stage.SIX_DOF: {"eta", "xi", "zeta"},
    }.get(stage, {"n_z_cmd", "n_y_cmd", "p_cmd"})
    assert set(moved) == expected
    flown = result.trajectory
    for one, value in moved.items():
        assert value == pytest.approx(np.abs(np.diff(flown[one])).sum() / flown.race_time, rel=1e-4)
        assert value > 0.0


def test_regularisation_is_reported_as_its_share_of_the_objective() -> None:
    result = optimum_of("four_gates", Stage.SIX_DOF)
    flown = result.trajectory
    steps = np.diff(flown.time)
    rates = {one.name: row / one.upper for one, row in zip(flown.controls, flown.control, strict=True)}
    brisk = {"eta_dot": 0.5, "xi_dot": 0.5, "zeta_dot": 0.25}
    weighed = sum(((rates[name] / share) ** 2 * steps).sum() for name, share in brisk.items())
    attitudes = zip(*(flown[name][:-1] for name in QUATERNION), strict=True)
    climbs_and_banks = [angles(rotation(q))[1:] for q in attitudes]
    upside_down = [0.5 * (1.0 - math.cos(climb) * math.cos(bank)) for climb, bank in climbs_and_banks]
    expected = Settings().regularisation * (weighed + upside_down @ steps)
    assert result.provenance.regularisation == pytest.approx(expected, rel=1e-6)


NAMES = ["homotopy", "point-mass", "transfer-function", "state-space-inversion", "state-space", "six-dof"]


def test_every_stage_is_one_object_however_it_is_come_by_and_flown_by_a_fidelity_of_its_own() -> None:
    assert [stage.value for stage in STAGES] == NAMES
    assert [fidelity_of(stage).stage for stage in STAGES] == list(STAGES)
    for stage in STAGES:
        assert copy.deepcopy(stage) is stage
        assert pickle.loads(pickle.dumps(stage)) is stage
        assert Stage(stage.value) is Stage.new(stage.value, after=Stage.SIX_DOF) is stage


def test_stage_needs_a_name_that_can_be_typed_and_stored_and_an_optimum_before_it() -> None:
    with pytest.raises(ValueError, match="'seven-dof' is not the name of a stage"):
        Stage("seven-dof")
    for name in ("", "Six-dof", "six dof", "six_dof", "-six", "../six"):
        with pytest.raises(ValueError, match="is no name for a stage"):
            Stage.new(name, after=Stage.SIX_DOF)
    with pytest.raises(ValueError, match="started from an optimum"):
        Stage.new("early", after=Stage.HOMOTOPY)


def test_stage_is_flown_by_one_fidelity_with_a_controller(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(ValueError, match="a fidelity for the stage six-dof already"):
        register(fidelity_of(Stage.SIX_DOF))
    monkeypatch.setattr("airrace.procedure.stage._order", list(STAGES))
    with pytest.raises(ValueError, match="seven-dof has no inner loop"):
        register(Fidelity(Stage.new("seven-dof", after=Stage.SIX_DOF), build_point_mass))
    assert len(STAGES) == len(NAMES) + 1
