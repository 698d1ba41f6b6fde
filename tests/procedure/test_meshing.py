"""Mesh refinement, its error estimates, and stages on a single mesh."""

import dataclasses
import functools
from collections.abc import Mapping
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from races import PLAN, SMALL, prepared, solve_stages

from airrace.optimal_control.certificate import RACE_TIME_CHANGE, Item
from airrace.optimal_control.constraint_check import ConstraintCheck
from airrace.optimal_control.problem import Boundary, Iterate, Objective, Phase, Problem, uniform
from airrace.optimal_control.refinement import restrict
from airrace.optimal_control.replay import replay
from airrace.optimal_control.runge_kutta import RK4
from airrace.optimal_control.solvers.process.service import SolverService
from airrace.procedure.certification import Evidence, certify
from airrace.procedure.models import iterate_of
from airrace.procedure.progress import Silent
from airrace.procedure.refinement import (
    SETTINGS,
    MeshProposal,
    MeshSolution,
    adapt,
    bisect_all,
    bisect_coarse,
    measure_hold_cost,
    predict_hold_cost,
    refine_changed,
    refine_flagged,
    refine_guess,
    refine_predicted,
)
from airrace.procedure.result import RefinementReason
from airrace.procedure.settings import LONG_RACE, CertificateLimits
from airrace.procedure.solver_session import SolverSession
from airrace.procedure.stage_problem import mesh_of
from airrace.procedure.start import InitialBarrier
from airrace.quantities import Interval, Quantity
from airrace.system import System

LIMITS = CertificateLimits()
COUNTS = (12, 8)


def oscillator() -> System:
    x, u, p = ca.SX.sym("x", 2), ca.SX.sym("u", 1), ca.SX.sym("p", 0)
    return System(
        name="oscillator",
        states=(Quantity("x", "m"), Quantity("v", "m/s")),
        controls=(Quantity("f", "N/kg"),),
        parameters=(),
        rates=ca.Function("rates", [x, u, p], [ca.vertcat(x[1], u - x[0])]),
        path=(),
        path_values=None,
    )


SYSTEM = oscillator()


def flown(
    marks: Mapping[str, Mapping[int, float]] | None = None, durations: tuple[float, float] = (2.0, 1.0)
) -> MeshSolution:
    """A flight in two phases, calm but for marks: values of `drift`, `defect` or `excess` by interval."""
    phases = tuple(
        Phase(name, uniform(count), Interval(0.1, 9.0)) for name, count in zip(("out", "back"), COUNTS, strict=True)
    )
    problem = Problem(SYSTEM, (), Boundary("start"), phases)
    N = problem.intervals
    iterate = Iterate(np.array(durations), np.zeros((2, N + 1)), np.arange(float(N))[None, :])
    measured = {name: np.zeros(N) for name in ("drift", "defect", "excess", "integration")}
    for name, values in (marks or {}).items():
        measured[name][list(values)] = list(values.values())
    audited = ConstraintCheck((), measured["defect"], measured["excess"])
    evidence = Evidence(replay(problem, iterate), audited, measured["drift"], measured["integration"])
    return MeshSolution(problem, iterate, MeshProposal.first(problem, iterate), lambda: evidence)


def counts(draft: MeshProposal) -> list[int]:
    return [len(phase) for phase in draft.mesh]


def everywhere(value: float) -> Mapping[int, float]:
    return dict.fromkeys(range(sum(COUNTS)), value)


RESTLESS = everywhere(2.0 * SETTINGS.coarsen_below * LIMITS.hamiltonian)
"""Too much for nodes to be dropped, too little for new ones."""


def test_draft_fits_its_guess() -> None:
    for draft in (bisect_all(flown(), LIMITS), adapt(flown(), LIMITS, early=True, joining=True)):
        assert draft is not None
        N = sum(counts(draft))
        assert draft.guess.state.shape == (2, N + 1)
        assert draft.guess.control.shape == (1, N)
        assert draft.why.shape == (N,)
        assert draft.coarser.shape == (N + 1,)
        assert all(sum(phase) == pytest.approx(1.0) for phase in draft.mesh)


# the first mesh


def test_calm_mesh_loses_every_second_node_of_each_phase() -> None:
    draft = adapt(flown(), LIMITS, early=True, joining=True)
    assert draft is not None
    assert counts(draft) == [6, 4]
    assert set(draft.why.tolist()) == {RefinementReason.CALM}
    assert draft.guess.control[0].tolist() == [0.5 + 2.0 * index for index in range(10)]


def test_nodes_are_dropped_only_where_any_length_will_do() -> None:
    assert adapt(flown(), LIMITS, early=True, joining=False) is None


@pytest.mark.parametrize("marks", [{"drift": RESTLESS}, {"excess": everywhere(0.2)}, {"defect": everywhere(0.4e-6)}])
def test_mesh_with_something_going_on_is_left_alone(marks: Mapping[str, Mapping[int, float]]) -> None:
    assert adapt(flown(marks), LIMITS, early=True, joining=True) is None


def test_few_dropped_nodes_are_not_worth_a_solve() -> None:
    busy = dict.fromkeys(range(16), 2.0 * SETTINGS.coarsen_below * LIMITS.hamiltonian)
    assert adapt(flown({"drift": busy}), LIMITS, early=True, joining=True) is None


def test_phase_keeps_a_few_intervals() -> None:
    solved = flown()
    for _ in range(5):
        draft = adapt(solved, LIMITS, early=True, joining=True)
        if draft is None:
            break
        assert min(counts(draft)) >= 4
        problem = replace(
            solved.problem,
            phases=tuple(
                replace(phase, fractions=fractions)
                for phase, fractions in zip(solved.problem.phases, draft.mesh, strict=True)
            ),
        )
        still = np.zeros(problem.intervals)
        evidence = Evidence(replay(problem, draft.guess), ConstraintCheck((), still, still), still, still)
        solved = MeshSolution(problem, draft.guess, draft, functools.partial(lambda one: one, evidence))
    assert draft is None


def test_mesh_far_from_the_hamiltonian_is_cut_there_and_beside() -> None:
    draft = adapt(flown({"drift": {**RESTLESS, 5: 2.5 * LIMITS.hamiltonian}}), LIMITS, early=True, joining=True)
    assert draft is not None
    parts = 4  # more than four times what is wanted of it
    assert counts(draft) == [9 + 3 * parts, 8]
    assert (draft.why == RefinementReason.HAMILTONIAN).sum() == 3 * parts
    steps = np.concatenate(draft.mesh)[: 9 + 3 * parts] * 12
    assert steps[:4] == pytest.approx(np.ones(4))
    assert steps[4 : 4 + 3 * parts] == pytest.approx(np.full(3 * parts, 1 / parts))


def test_one_look_at_the_neighbours_does_not_cross_a_busy_place() -> None:
    """What is cut is not joined at the same time, nor is what lies beside it."""
    draft = adapt(flown({"drift": {5: 2.5 * LIMITS.hamiltonian}}), LIMITS, early=True, joining=True)
    assert draft is not None
    shares = np.concatenate(draft.mesh[:1]) * 12
    cut = np.flatnonzero(shares < 0.9)
    assert shares[cut[0] - 1] == pytest.approx(1.0)
    assert shares[cut[-1] + 1] == pytest.approx(1.0)


def test_late_only_what_is_wrong_is_worth_another_solve() -> None:
    far_off = flown({"drift": {5: 0.5}})
    assert adapt(far_off, LIMITS, early=True, joining=False) is not None
    assert adapt(far_off, LIMITS, early=False, joining=False) is None
    wrong = adapt(flown({"defect": {5: 0.02}}), LIMITS, early=False, joining=False)
    assert wrong is not None
    assert counts(wrong) == [9 + 3 * 4, 8]
    assert (wrong.why == RefinementReason.INTEGRATION).sum() == 12


@pytest.mark.parametrize(("durations", "left"), [((12.0, 1.0), [12, 4]), ((2.0, 12.0), [6, 8])])
def test_no_interval_is_joined_beyond_a_length(durations: tuple[float, float], left: list[int]) -> None:
    """Intervals of a second or more stay as they are."""
    draft = adapt(flown(durations=durations), LIMITS, early=True, joining=True)
    assert draft is not None
    assert counts(draft) == left


# the halved one


def test_all_intervals_are_halved_and_the_nodes_before_are_remembered() -> None:
    draft = bisect_all(flown(), LIMITS)
    assert counts(draft) == [24, 16]
    assert draft.coarser.tolist() == [True, False] * 20 + [True]
    assert set(draft.why.tolist()) == {RefinementReason.FIRST}


@pytest.mark.parametrize(
    ("name", "value", "parts", "why"),
    [
        ("defect", 1.1e-6, 2, RefinementReason.INTEGRATION),
        ("defect", 1e-4, 3, RefinementReason.INTEGRATION),
        ("defect", 1.0, SETTINGS.parts_max, RefinementReason.INTEGRATION),
        ("defect", np.nan, SETTINGS.parts_max, RefinementReason.INTEGRATION),
        ("excess", 1.1, 2, RefinementReason.LIMITS),
        ("excess", 5.0, 4, RefinementReason.LIMITS),
        ("drift", 0.03, 4, RefinementReason.HAMILTONIAN),
        ("drift", 0.1, 4, RefinementReason.HAMILTONIAN),
    ],
)
def test_interval_is_cut_into_what_it_needs(name: str, value: float, parts: int, why: RefinementReason) -> None:
    draft = bisect_all(flown({name: {5: value}}), LIMITS)
    nodes = np.flatnonzero(draft.coarser)
    into = np.diff(nodes)
    assert into[5] == parts
    assert into.min() == 2
    assert set(draft.why[nodes[5] : nodes[6]].tolist()) == {why}
    # What is wrong in an interval may move into the next; an integration error does so less than in full.
    assert set(np.flatnonzero(into > 2).tolist()) <= {4, 5, 6}
    assert into[[4, 6]].max() <= parts


def test_more_accurate_integrator_needs_fewer_parts() -> None:
    """The prediction takes the order from the scheme: of order 4, an error of 1e-4 takes one part more."""
    solved = flown({"defect": {5: 1e-4}})
    less = replace(solved, problem=replace(solved.problem, scheme=RK4))
    assert sum(counts(bisect_all(less, LIMITS))) > sum(counts(bisect_all(solved, LIMITS)))


# halved where it is not yet


def test_everywhere_is_as_fine_as_if_the_coarser_mesh_were_halved() -> None:
    """A mesh that was mended here and there: what was cut stays, all else is cut in two."""
    solved = flown({"excess": {4: 5.0}, "defect": {15: 1e-4}})
    good = refine_flagged(solved, LIMITS)
    assert good is not None
    before = np.diff(np.flatnonzero(good.coarser))
    fine = bisect_coarse(good)
    assert np.diff(np.flatnonzero(fine.coarser)).tolist() == np.maximum(before, 2).tolist()
    assert sum(counts(fine)) == np.maximum(before, 2).sum()
    assert fine.guess.durations.tolist() == good.guess.durations.tolist()
    assert fine.guess.control[0, fine.coarser[:-1]].tolist() == good.guess.control[0, good.coarser[:-1]].tolist()


def test_halving_twice_is_halving_once() -> None:
    once = bisect_coarse(flown().draft)
    twice = bisect_coarse(once)
    assert once.mesh == bisect_all(flown(), LIMITS).mesh
    assert twice.mesh == once.mesh
    np.testing.assert_array_equal(twice.guess.state, once.guess.state)
    np.testing.assert_array_equal(twice.coarser, once.coarser)


# mending


def test_nothing_wrong_is_not_mended() -> None:
    assert refine_flagged(flown(), LIMITS) is None


def test_mended_mesh_remembers_the_coarser_one() -> None:
    solved = flown({"excess": {4: 1.5}})
    first = solved.draft.coarser.copy()
    first[1::2] = False
    solved = replace(solved, draft=replace(solved.draft, coarser=first))
    draft = refine_flagged(solved, LIMITS)
    assert draft is not None
    assert counts(draft) == [15, 8]
    assert draft.coarser.sum() == first.sum()
    shares = np.concatenate([[0.0], np.cumsum(np.concatenate(draft.mesh))])
    before = np.concatenate([[0.0], np.cumsum(np.concatenate(solved.problem.mesh))])
    assert shares[draft.coarser] == pytest.approx(before[first])


def test_nothing_is_mended_ahead_where_nothing_is_wrong() -> None:
    """Being near to a limit is no reason for another mesh, only for a finer one where another is solved on anyway."""
    assert (
        refine_predicted(flown({"defect": {4: 0.9 * LIMITS.replay}, "drift": {15: 0.9 * LIMITS.hamiltonian}}), LIMITS)
        is None
    )


@pytest.mark.parametrize(
    ("name", "near", "why"),
    [
        ("defect", 0.9 * LIMITS.replay, RefinementReason.INTEGRATION),
        ("drift", 0.9 * LIMITS.hamiltonian, RefinementReason.HAMILTONIAN),
    ],
)
def test_what_nearly_misses_a_limit_is_halved_with_what_misses_one(
    name: str, near: float, why: RefinementReason
) -> None:
    wrong = {"excess": {4: 1.5}}
    mend, ahead = (cut(flown({**wrong, name: {12: near}}), LIMITS) for cut in (refine_flagged, refine_predicted))
    assert mend is not None
    assert ahead is not None
    parts, more = (np.diff(np.flatnonzero(draft.coarser)) for draft in (mend, ahead))
    assert np.flatnonzero(more > parts).tolist() == [11, 12, 13]
    assert more[11:14].tolist() == [2, 2, 2]
    assert set(ahead.why[np.repeat(more > parts, more)].tolist()) == {why}


def test_calm_intervals_are_not_halved_ahead() -> None:
    wrong = flown({"excess": {4: 1.5}, "defect": {12: 0.1 * LIMITS.replay}, "drift": {15: 0.05 * LIMITS.hamiltonian}})
    mend, ahead = refine_flagged(wrong, LIMITS), refine_predicted(wrong, LIMITS)
    assert mend is not None
    assert ahead is not None
    assert ahead.mesh == mend.mesh


# a guess whose errors are foreseen


def test_intervals_are_cut_where_a_guess_lets_foresee_errors_and_the_coarser_mesh_is_remembered() -> None:
    """At rest under the force of its interval nothing errs; one interval is left to swing by 200 m."""
    solved = flown()
    x = np.append(solved.iterate.control[0], 0.0)
    force = solved.iterate.control.copy()
    force[0, 4] += 100.0
    guess = replace(solved.iterate, state=np.stack([x, 0.0 * x]), control=force)
    first = solved.draft.coarser.copy()
    first[1::2] = False
    draft = refine_guess(replace(solved.draft, guess=guess, coarser=first), solved.problem, LIMITS)
    assert counts(draft) == [13, 8]
    assert np.flatnonzero(draft.why == RefinementReason.INTEGRATION).tolist() == [4, 5]
    assert draft.guess.control[0].tolist() == np.insert(force[0], 4, force[0, 4]).tolist()
    assert draft.guess.state[0, 4:7].tolist() == [4.0, 4.5, 5.0]
    shares = np.concatenate([[0.0], np.cumsum(np.concatenate(draft.mesh))])
    before = np.concatenate([[0.0], np.cumsum(np.concatenate(solved.problem.mesh))])
    assert shares[draft.coarser] == pytest.approx(before[first])


def test_only_errors_of_the_integrator_are_foreseen() -> None:
    still = replace(flown().draft, guess=replace(flown().iterate, control=np.zeros((1, sum(COUNTS)))))
    assert counts(refine_guess(still, flown().problem, LIMITS)) == list(COUNTS)
    swung = replace(flown().draft, guess=replace(flown().iterate, control=np.full((1, sum(COUNTS)), 1000.0)))
    assert counts(refine_guess(swung, flown().problem, LIMITS)) == [2 * count for count in COUNTS]


# a race time that changed


def finer(before: MeshSolution, gained: float, **varied: float) -> MeshSolution:
    """The halved mesh, on which the controls differ within some intervals of the mesh before: `i5=2.0` by two."""
    draft = bisect_all(before, LIMITS)
    phases = tuple(
        replace(phase, fractions=fractions) for phase, fractions in zip(before.problem.phases, draft.mesh, strict=True)
    )
    objective = Objective(regularisation={"f": 1.0})
    problem = replace(before.problem, phases=phases, objective=objective)
    control = np.zeros((1, problem.intervals))
    for name, difference in varied.items():
        control[0, 2 * int(name[1:])] = difference
    iterate = replace(draft.guess, durations=draft.guess.durations * (1.0 - gained / 3.0), control=control)
    return MeshSolution(problem, iterate, draft, before.measure)


def test_intervals_that_gained_stay_fine_with_their_neighbours_and_the_others_go_back() -> None:
    before = flown()
    again = refine_changed(finer(before, 0.02, i5=2.0, i17=0.1), before, LIMITS)
    assert counts(again) == [12 + 3, 8]
    assert [index for index, why in enumerate(again.why.tolist()) if why == RefinementReason.RACE_TIME] == list(
        range(4, 10)
    )
    assert again.coarser.all()


def test_so_many_intervals_stay_fine_that_the_others_gain_half_of_what_is_allowed() -> None:
    """Of 20 ms all but 2.5 ms: seven of eight that gain alike, with their neighbours."""
    alike = {f"i{index}": 1.0 for index in (1, 3, 5, 7, 9, 11)} | {f"i{index}": np.sqrt(1.5) for index in (13, 17)}
    before = flown()
    again = refine_changed(finer(before, 0.02, **alike), before, LIMITS)
    cut = sum(counts(again)) - sum(COUNTS)
    assert cut < sum(COUNTS)
    slight = refine_changed(finer(before, 0.0051, **alike), before, LIMITS)
    assert sum(counts(slight)) < sum(counts(again))


def test_time_lost_to_limits_kept_at_more_nodes_makes_fine_where_they_were_left() -> None:
    left = flown({"excess": {3: 0.5, 4: 0.5, 15: 0.001}})
    again = refine_changed(finer(left, -0.006), left, LIMITS)
    assert [index for index, why in enumerate(again.why.tolist()) if why == RefinementReason.RACE_TIME] == list(
        range(2, 10)
    )
    assert counts(again) == [16, 8]


def test_time_lost_to_the_integrator_makes_fine_where_it_erred() -> None:
    erring = flown({"integration": {2: 0.004, 16: 0.0005}})
    again = refine_changed(finer(erring, -0.0055), erring, LIMITS)
    assert [index for index, why in enumerate(again.why.tolist()) if why == RefinementReason.RACE_TIME] == list(
        range(1, 7)
    )
    assert counts(again) == [15, 8]


def test_errors_of_the_integrator_that_add_up_are_cut_before_all_is_halved() -> None:
    erring = {3: 0.004, 12: 0.002}
    draft = adapt(flown({"drift": RESTLESS, "integration": erring}), LIMITS, early=True, joining=True)
    assert draft is not None
    assert counts(draft) == [13, 8]
    cancelling = {3: 0.004, 12: -0.002}
    assert adapt(flown({"drift": RESTLESS, "integration": cancelling}), LIMITS, early=True, joining=True) is None


def test_long_race_is_cut_for_the_race_time_that_its_own_tolerance_allows() -> None:
    busy = {"drift": {3: 3.0 * LIMITS.hamiltonian}, "excess": everywhere(0.2)}  # another mesh comes in any case
    marks = {**busy, "integration": everywhere(0.4 * LIMITS.race_time)}  # 8 times what a short race may change by
    short = adapt(flown(marks), LIMITS, early=True, joining=False)
    long = adapt(flown(marks, (20.0 * LONG_RACE, 10.0 * LONG_RACE)), LIMITS, early=True, joining=False)
    assert short is not None
    assert long is not None
    assert RefinementReason.RACE_TIME in short.why
    assert RefinementReason.RACE_TIME not in long.why


def test_gain_without_a_known_cause_is_spread_over_all_intervals() -> None:
    before = flown()
    again = refine_changed(finer(before, 0.02), before, LIMITS)
    assert sum(counts(again)) > 1.8 * sum(COUNTS)


WEIGHT = 0.25


def held(*controls: float, seconds: float = 2.0) -> tuple[Problem, Iterate]:
    phase = Phase("all", uniform(len(controls)), Interval(0.1, 9.0))
    problem = Problem(SYSTEM, (), Boundary(), (phase,), objective=Objective(regularisation={"f": WEIGHT}))
    return problem, Iterate(np.array([seconds]), np.zeros((2, len(controls) + 1)), np.array([controls]))


def test_constant_controls_cost_nothing() -> None:
    problem, iterate = held(3.0, 3.0, 3.0, 3.0)
    assert (predict_hold_cost(problem, iterate) == 0.0).all()
    assert (measure_hold_cost(problem, iterate, np.array([True, False, True, False, True])) == 0.0).all()


def test_price_is_the_regularised_variance_within_the_coarser_interval() -> None:
    problem, iterate = held(1.0, 5.0, 2.0, 2.0)
    price = measure_hold_cost(problem, iterate, np.array([True, False, True, False, True]))
    assert price == pytest.approx([1.0 * WEIGHT * 2.0**2, 0.0])


def test_controls_that_vary_evenly_are_foreseen_as_they_will_be_measured() -> None:
    """Where the finer mesh has the same slope: halves differ by half of what neighbours do."""
    coarse, fine = held(0.0, 1.0, 2.0, 3.0), held(*(0.5 * np.arange(8) - 0.25))
    kept = np.arange(9) % 2 == 0
    assert predict_hold_cost(*coarse) == pytest.approx(measure_hold_cost(*fine, kept))


def test_price_grows_with_time_weight_and_jump_squared() -> None:
    usual, longer, higher = held(0.0, 1.0), held(0.0, 1.0, seconds=4.0), held(0.0, 3.0)
    assert predict_hold_cost(*longer) == pytest.approx(2.0 * predict_hold_cost(*usual))
    assert predict_hold_cost(*higher) == pytest.approx(9.0 * predict_hold_cost(*usual))


def test_price_is_of_the_size_of_what_a_finer_mesh_gains() -> None:
    result, flight = solve_stages(SMALL)[0], prepared(SMALL)
    problem, iterate = flight.problem(mesh_of(result.trajectory)), iterate_of(result.trajectory)
    mesh, guess = restrict(problem.mesh, iterate, result.mesh.coarser)
    with SolverService() as service:
        solution = SolverSession(service, PLAN, Silent()).solve(
            flight.problem(mesh), guess, "", barrier=InitialBarrier.COARSER_MESH
        )
    assert solution is not None
    objective = result.trajectory.race_time + result.provenance.regularisation
    gained = solution.objective - objective
    assert 0.1 * gained < measure_hold_cost(problem, iterate, result.mesh.coarser).sum() < 1.5 * gained


@pytest.mark.parametrize("duration", [1.0, 55.0, 80.0, LONG_RACE])
def test_short_races_share_one_limit(duration: float) -> None:
    assert LIMITS.race_time_of(duration) == LIMITS.race_time


@pytest.mark.parametrize("races", [2, 64])
def test_limit_of_a_long_race_grows_with_its_duration(races: int) -> None:
    assert LIMITS.race_time_of(races * LONG_RACE) == pytest.approx(races * LIMITS.race_time, rel=1e-15)


def test_tightened_limit_grows_likewise() -> None:
    tight = dataclasses.replace(LIMITS, race_time=0.002)
    assert tight.race_time_of(3.0 * LONG_RACE) == pytest.approx(0.006, rel=1e-15)


@pytest.mark.parametrize(("share", "holds"), [(0.9, True), (1.1, False)])
@pytest.mark.parametrize("races", [0.5, 4.0])
def test_certificate_measures_with_the_limit_of_its_race(races: float, share: float, holds: bool) -> None:
    duration = races * LONG_RACE
    optimum = flown(durations=(0.75 * duration, 0.25 * duration))
    audited = dataclasses.replace(optimum.evidence.check, items=(Item("replay_defect", 0.0, 1.0),))
    limit = LIMITS.race_time * max(1.0, races)
    certificate = certify(
        optimum.problem,
        optimum.iterate,
        dataclasses.replace(optimum.evidence, check=audited),
        LIMITS,
        claim=Item("solver", 0.0, 0.0),
        status="solved",
        kkt_error=0.0,
        coarser_race_time=duration + share * limit,
    )
    (item,) = (one for one in certificate.items if one.name == RACE_TIME_CHANGE)
    assert item.limit == pytest.approx(limit, rel=1e-12)
    assert item.value == pytest.approx(share * limit, rel=1e-9)
    assert item.holds is holds


@pytest.mark.parametrize(("minutes", "cut"), [(1.0, True), (2.0, True), (4.0, False)])
def test_error_that_is_too_large_for_a_short_race_needs_no_finer_mesh_in_a_long_one(minutes: float, cut: bool) -> None:
    erring = {3: 0.8 * LIMITS.race_time, 12: 0.4 * LIMITS.race_time}
    optimum = flown({"drift": RESTLESS, "integration": erring}, (40.0 * minutes, 20.0 * minutes))
    assert (adapt(optimum, LIMITS, early=True, joining=True) is not None) is cut
