"""Mesh refinement, its error estimates, and stages on a single mesh."""

import functools
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np
import pytest
from races import PLAN, SMALL, prepared, solve_stages

from airrace.optimal_control.certificate import RACE_TIME_CHANGE, Item, RefinementReason
from airrace.optimal_control.constraint_check import ConstraintCheck
from airrace.optimal_control.evidence import Evidence
from airrace.optimal_control.mesh_proposals import (
    COARSEN_BELOW,
    PARTS_MAX,
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
from airrace.optimal_control.mesh_refinement import restrict
from airrace.optimal_control.problem import Boundary, Iterate, Objective, Phase, Problem, uniform
from airrace.optimal_control.quantities import Interval, Quantity
from airrace.optimal_control.replay import replay
from airrace.optimal_control.runge_kutta import RK4
from airrace.optimal_control.solvers.service import SolverService
from airrace.optimal_control.system import System
from airrace.procedure import mesh_loop
from airrace.procedure.certification import certify
from airrace.procedure.fidelity import iterate_of
from airrace.procedure.guess import first_mesh, guess
from airrace.procedure.result import Silent, StageResult
from airrace.procedure.settings import LONG_RACE, CertificateLimits
from airrace.procedure.solver_session import SolverSession
from airrace.procedure.stage_problem import mesh_of
from airrace.procedure.warm_start import InitialBarrier, Start

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
    return MeshSolution(problem, iterate, MeshProposal.first(problem, iterate), sum(durations), lambda: evidence)


def counts(proposal: MeshProposal) -> list[int]:
    return [len(phase) for phase in proposal.mesh]


def adapted(solution: MeshSolution, *, early: bool = True, joining: bool = True) -> MeshProposal:
    proposal = adapt(solution, LIMITS, early=early, joining=joining)
    assert proposal is not None
    return proposal


def mended(solution: MeshSolution) -> MeshProposal:
    proposal = refine_flagged(solution, LIMITS)
    assert proposal is not None
    return proposal


def parts(proposal: MeshProposal) -> np.ndarray:
    """Into how many each interval of the coarser mesh is cut."""
    return np.diff(np.flatnonzero(proposal.coarser))


def where(proposal: MeshProposal, why: RefinementReason) -> list[int]:
    return [index for index, one in enumerate(proposal.why.tolist()) if one == why]


def nodes(mesh: Sequence[Sequence[float]]) -> np.ndarray:
    return np.concatenate([[0.0], np.cumsum(np.concatenate(mesh))])


def on_mesh(problem: Problem, mesh: Sequence[Sequence[float]], **changes: Any) -> Problem:
    phases = tuple(replace(phase, fractions=each) for phase, each in zip(problem.phases, mesh, strict=True))
    return replace(problem, phases=phases, **changes)


def everywhere(value: float) -> Mapping[int, float]:
    return dict.fromkeys(range(sum(COUNTS)), value)


RESTLESS = everywhere(2.0 * COARSEN_BELOW * LIMITS.hamiltonian)
"""Too much for nodes to be dropped, too little for new ones."""


# the first mesh


def test_calm_mesh_loses_every_second_node_of_each_phase() -> None:
    proposal = adapted(flown())
    assert counts(proposal) == [6, 4]
    assert set(proposal.why.tolist()) == {RefinementReason.CALM}
    assert proposal.guess.control[0].tolist() == [0.5 + 2.0 * index for index in range(10)]
    for one in (bisect_all(flown(), LIMITS), proposal):
        N = sum(counts(one))
        assert (one.guess.state.shape, one.guess.control.shape) == ((2, N + 1), (1, N))
        assert (one.why.shape, one.coarser.shape) == ((N,), (N + 1,))
        assert all(sum(phase) == pytest.approx(1.0) for phase in one.mesh)
    # only where any length will do, and few dropped nodes are not worth a solve
    assert adapt(flown(), LIMITS, early=True, joining=False) is None
    busy = dict.fromkeys(range(16), 2.0 * COARSEN_BELOW * LIMITS.hamiltonian)
    assert adapt(flown({"drift": busy}), LIMITS, early=True, joining=True) is None


@pytest.mark.parametrize("marks", [{"drift": RESTLESS}, {"excess": everywhere(0.2)}, {"defect": everywhere(0.4e-6)}])
def test_mesh_with_something_going_on_is_left_alone(marks: Mapping[str, Mapping[int, float]]) -> None:
    assert adapt(flown(marks), LIMITS, early=True, joining=True) is None


def test_phase_keeps_a_few_intervals() -> None:
    solved = flown()
    for _ in range(5):
        proposal = adapt(solved, LIMITS, early=True, joining=True)
        if proposal is None:
            break
        assert min(counts(proposal)) >= 4
        problem = on_mesh(solved.problem, proposal.mesh)
        still = np.zeros(problem.intervals)
        evidence = Evidence(replay(problem, proposal.guess), ConstraintCheck((), still, still), still, still)
        solved = MeshSolution(
            problem, proposal.guess, proposal, solved.value, functools.partial(lambda one: one, evidence)
        )
    assert proposal is None


def test_mesh_far_from_the_hamiltonian_is_cut_there_and_beside() -> None:
    proposal = adapted(flown({"drift": {**RESTLESS, 5: 2.5 * LIMITS.hamiltonian}}))
    into = 4  # more than four times what is wanted of it
    assert counts(proposal) == [9 + 3 * into, 8]
    assert len(where(proposal, RefinementReason.HAMILTONIAN)) == 3 * into
    steps = np.concatenate(proposal.mesh)[: 9 + 3 * into] * 12
    assert steps[:4] == pytest.approx(np.ones(4))
    assert steps[4 : 4 + 3 * into] == pytest.approx(np.full(3 * into, 1 / into))
    # What is cut is not joined at the same time, nor is what lies beside it.
    shares = np.array(adapted(flown({"drift": {5: 2.5 * LIMITS.hamiltonian}})).mesh[0]) * 12
    cut = np.flatnonzero(shares < 0.9)
    assert shares[[cut[0] - 1, cut[-1] + 1]] == pytest.approx([1.0, 1.0])


def test_late_only_what_is_wrong_is_worth_another_solve() -> None:
    far_off = flown({"drift": {5: 0.5}})
    adapted(far_off, joining=False)
    assert adapt(far_off, LIMITS, early=False, joining=False) is None
    wrong = adapted(flown({"defect": {5: 0.02}}), early=False, joining=False)
    assert counts(wrong) == [9 + 3 * 4, 8]
    assert len(where(wrong, RefinementReason.INTEGRATION)) == 12


@pytest.mark.parametrize(("durations", "left"), [((12.0, 1.0), [12, 4]), ((2.0, 12.0), [6, 8])])
def test_no_interval_is_joined_beyond_a_length(durations: tuple[float, float], left: list[int]) -> None:
    """Intervals of a second or more stay as they are."""
    assert counts(adapted(flown(durations=durations))) == left


# the halved one


def test_all_intervals_are_halved_and_the_nodes_before_are_remembered() -> None:
    proposal = bisect_all(flown(), LIMITS)
    assert counts(proposal) == [24, 16]
    assert proposal.coarser.tolist() == [True, False] * 20 + [True]
    assert set(proposal.why.tolist()) == {RefinementReason.FIRST}


@pytest.mark.parametrize(
    ("name", "value", "count", "why"),
    [
        ("defect", 1.1e-6, 2, RefinementReason.INTEGRATION),
        ("defect", 1e-4, 3, RefinementReason.INTEGRATION),
        ("defect", 1.0, PARTS_MAX, RefinementReason.INTEGRATION),
        ("defect", np.nan, PARTS_MAX, RefinementReason.INTEGRATION),
        ("excess", 1.1, 2, RefinementReason.LIMITS),
        ("excess", 5.0, 4, RefinementReason.LIMITS),
        ("drift", 0.03, 4, RefinementReason.HAMILTONIAN),
        ("drift", 0.1, 4, RefinementReason.HAMILTONIAN),
    ],
)
def test_interval_is_cut_into_what_it_needs(name: str, value: float, count: int, why: RefinementReason) -> None:
    proposal = bisect_all(flown({name: {5: value}}), LIMITS)
    first, last = np.flatnonzero(proposal.coarser)[5:7]
    into = parts(proposal)
    assert into[5] == count
    assert into.min() == 2
    assert set(proposal.why[first:last].tolist()) == {why}
    # What is wrong in an interval may move into the next; an integration error does so less than in full.
    assert set(np.flatnonzero(into > 2).tolist()) <= {4, 5, 6}
    assert into[[4, 6]].max() <= count


def test_more_accurate_integrator_needs_fewer_parts() -> None:
    """The prediction takes the order from the scheme: of order 4, an error of 1e-4 takes one part more."""
    solved = flown({"defect": {5: 1e-4}})
    less = replace(solved, problem=replace(solved.problem, scheme=RK4))
    assert sum(counts(bisect_all(less, LIMITS))) > sum(counts(bisect_all(solved, LIMITS)))


# halved where it is not yet


def test_everywhere_is_as_fine_as_if_the_coarser_mesh_were_halved_once() -> None:
    """A mesh that was mended here and there: what was cut stays, all else is cut in two."""
    good = mended(flown({"excess": {4: 5.0}, "defect": {15: 1e-4}}))
    fine = bisect_coarse(good)
    assert parts(fine).tolist() == np.maximum(parts(good), 2).tolist()
    assert sum(counts(fine)) == np.maximum(parts(good), 2).sum()
    assert fine.guess.durations.tolist() == good.guess.durations.tolist()
    assert fine.guess.control[0, fine.coarser[:-1]].tolist() == good.guess.control[0, good.coarser[:-1]].tolist()
    once = bisect_coarse(flown().proposal)
    twice = bisect_coarse(once)
    assert twice.mesh == once.mesh == bisect_all(flown(), LIMITS).mesh
    np.testing.assert_array_equal(twice.guess.state, once.guess.state)
    np.testing.assert_array_equal(twice.coarser, once.coarser)


# mending


def test_drift_is_cut_where_it_begins_as_well_as_where_it_is_too_large() -> None:
    limit, last = LIMITS.hamiltonian, sum(COUNTS) - 1
    drift = {**dict.fromkeys(range(5, last), 0.98 * limit), last: 1.02 * limit}
    cut = parts(mended(flown({"drift": drift})))
    assert np.flatnonzero(cut > 1).tolist() == [4, 5, last - 1, last]


@pytest.mark.parametrize(
    ("name", "value", "why"),
    [("defect", 1.01 * LIMITS.replay, RefinementReason.INTEGRATION), ("excess", 1.01, RefinementReason.LIMITS)],
)
def test_a_leg_that_is_cut_again_for_the_same_reason_becomes_as_fine_everywhere(
    name: str, value: float, why: RefinementReason
) -> None:
    """A roll that is indifferent to its place on a leg would else move to where the leg is not yet fine."""
    solved = flown({name: {4: value}})
    assert np.flatnonzero(parts(mended(solved)) > 1).tolist() == [3, 4, 5]
    for interval, expected in ((9, [2 * COUNTS[0], COUNTS[1]]), (16, [COUNTS[0] + 3, COUNTS[1]])):  # the other leg
        before = solved.proposal.why.copy()
        before[interval] = why
        again = mended(replace(solved, proposal=replace(solved.proposal, why=before)))
        assert counts(again) == expected


def test_mended_mesh_remembers_the_coarser_one() -> None:
    assert refine_flagged(flown(), LIMITS) is None
    solved = flown({"excess": {4: 1.5}})
    first = solved.proposal.coarser.copy()
    first[1::2] = False
    proposal = mended(replace(solved, proposal=replace(solved.proposal, coarser=first)))
    assert counts(proposal) == [15, 8]
    assert proposal.coarser.sum() == first.sum()
    assert nodes(proposal.mesh)[proposal.coarser] == pytest.approx(nodes(solved.problem.mesh)[first])


@pytest.mark.parametrize(
    ("name", "limit", "near", "calm", "why"),
    [
        ("defect", LIMITS.replay, 0.9, 0.1, RefinementReason.INTEGRATION),
        ("drift", LIMITS.hamiltonian, 0.9, 0.05, RefinementReason.HAMILTONIAN),
    ],
)
def test_what_nearly_misses_a_limit_is_halved_with_what_misses_one(
    name: str, limit: float, near: float, calm: float, why: RefinementReason
) -> None:
    """Being near to a limit is no reason for another mesh, only for a finer one where another is solved on anyway."""
    assert refine_predicted(flown({name: {12: near * limit}}), LIMITS) is None
    wrong = flown({"excess": {4: 1.5}, name: {12: near * limit}})
    mend, ahead = mended(wrong), refine_predicted(wrong, LIMITS)
    assert ahead is not None
    more = parts(ahead) > parts(mend)
    assert np.flatnonzero(more).tolist() == [11, 12, 13]
    assert parts(ahead)[11:14].tolist() == [2, 2, 2]
    assert set(ahead.why[np.repeat(more, parts(ahead))].tolist()) == {why}
    still = flown({"excess": {4: 1.5}, name: {12: calm * limit}})
    ahead = refine_predicted(still, LIMITS)
    assert ahead is not None
    assert ahead.mesh == mended(still).mesh


# a guess whose errors are foreseen


def test_intervals_are_cut_where_a_guess_lets_foresee_errors_and_the_coarser_mesh_is_remembered() -> None:
    """At rest under the force of its interval nothing errs; one interval is left to swing by 200 m."""
    solved = flown()
    x = np.append(solved.iterate.control[0], 0.0)
    force = solved.iterate.control.copy()
    force[0, 4] += 100.0
    guess = replace(solved.iterate, state=np.stack([x, 0.0 * x]), control=force)
    first = solved.proposal.coarser.copy()
    first[1::2] = False
    proposal = refine_guess(replace(solved.proposal, guess=guess, coarser=first), solved.problem, LIMITS)
    assert counts(proposal) == [13, 8]
    assert np.flatnonzero(proposal.why == RefinementReason.INTEGRATION).tolist() == [4, 5]
    assert proposal.guess.control[0].tolist() == np.insert(force[0], 4, force[0, 4]).tolist()
    assert proposal.guess.state[0, 4:7].tolist() == [4.0, 4.5, 5.0]
    assert nodes(proposal.mesh)[proposal.coarser] == pytest.approx(nodes(solved.problem.mesh)[first])


def test_only_errors_of_the_integrator_are_foreseen() -> None:
    still = replace(flown().proposal, guess=replace(flown().iterate, control=np.zeros((1, sum(COUNTS)))))
    assert counts(refine_guess(still, flown().problem, LIMITS)) == list(COUNTS)
    swung = replace(flown().proposal, guess=replace(flown().iterate, control=np.full((1, sum(COUNTS)), 1000.0)))
    assert counts(refine_guess(swung, flown().problem, LIMITS)) == [2 * count for count in COUNTS]


# a race time that changed


def finer(before: MeshSolution, gained: float, **varied: float) -> MeshSolution:
    """The halved mesh, on which the controls differ within some intervals of the mesh before: `i5=2.0` by two."""
    proposal = bisect_all(before, LIMITS)
    problem = on_mesh(before.problem, proposal.mesh, objective=Objective(regularisation={"f": 1.0}))
    control = np.zeros((1, problem.intervals))
    for name, difference in varied.items():
        control[0, 2 * int(name[1:])] = difference
    iterate = replace(proposal.guess, durations=proposal.guess.durations * (1.0 - gained / 3.0), control=control)
    return MeshSolution(problem, iterate, proposal, float(iterate.durations.sum()), before.measure)


def test_intervals_that_gained_stay_fine_with_their_neighbours_and_the_others_go_back() -> None:
    before = flown()
    again = refine_changed(finer(before, 0.02, i5=2.0, i17=0.1), before, LIMITS)
    assert counts(again) == [12 + 3, 8]
    assert where(again, RefinementReason.RACE_TIME) == list(range(4, 10))
    assert again.coarser.all()
    # a gain without a known cause is spread over all intervals
    assert sum(counts(refine_changed(finer(before, 0.02), before, LIMITS))) > 1.8 * sum(COUNTS)


def test_so_many_intervals_stay_fine_that_the_others_gain_half_of_what_is_allowed() -> None:
    """Of 20 ms all but 2.5 ms: seven of eight that gain alike, with their neighbours."""
    alike = {f"i{index}": 1.0 for index in (1, 3, 5, 7, 9, 11)} | {f"i{index}": np.sqrt(1.5) for index in (13, 17)}
    before = flown()
    again = refine_changed(finer(before, 0.02, **alike), before, LIMITS)
    assert sum(counts(again)) - sum(COUNTS) < sum(COUNTS)
    slight = refine_changed(finer(before, 0.0051, **alike), before, LIMITS)
    assert sum(counts(slight)) < sum(counts(again))


@pytest.mark.parametrize(
    ("cause", "marks", "lost", "rows", "left"),
    [
        ("excess", {3: 0.5, 4: 0.5, 15: 0.001}, 0.006, range(2, 10), [16, 8]),
        ("integration", {2: 0.004, 16: 0.0005}, 0.0055, range(1, 7), [15, 8]),
    ],
)
def test_time_lost_to_limits_kept_at_more_nodes_or_to_the_integrator_makes_fine_where_they_erred(
    cause: str, marks: Mapping[int, float], lost: float, rows: range, left: list[int]
) -> None:
    before = flown({cause: marks})
    again = refine_changed(finer(before, -lost), before, LIMITS)
    assert where(again, RefinementReason.RACE_TIME) == list(rows)
    assert counts(again) == left


def test_errors_of_the_integrator_that_add_up_are_cut_before_all_is_halved() -> None:
    assert counts(adapted(flown({"drift": RESTLESS, "integration": {3: 0.004, 12: 0.002}}))) == [13, 8]
    cancelling = flown({"drift": RESTLESS, "integration": {3: 0.004, 12: -0.002}})
    assert adapt(cancelling, LIMITS, early=True, joining=True) is None


@pytest.mark.parametrize(("minutes", "cut"), [(1.0, True), (2.0, True), (4.0, False)])
def test_long_race_is_cut_for_the_race_time_that_its_own_tolerance_allows(minutes: float, cut: bool) -> None:
    durations = (40.0 * minutes, 20.0 * minutes)
    erring = {3: 0.8 * LIMITS.race_time, 12: 0.4 * LIMITS.race_time}
    proposal = adapt(flown({"drift": RESTLESS, "integration": erring}, durations), LIMITS, early=True, joining=True)
    assert (proposal is not None) is cut


def test_short_race_is_cut_for_a_race_time_that_a_long_one_may_change_by() -> None:
    busy = {"drift": {3: 3.0 * LIMITS.hamiltonian}, "excess": everywhere(0.2)}  # another mesh comes in any case
    marks = {**busy, "integration": everywhere(0.4 * LIMITS.race_time)}  # 8 times what a short race may change by
    assert RefinementReason.RACE_TIME in adapted(flown(marks), joining=False).why
    long = adapted(flown(marks, (20.0 * LONG_RACE, 10.0 * LONG_RACE)), joining=False)
    assert RefinementReason.RACE_TIME not in long.why


WEIGHT = 0.25


def held(*controls: float, seconds: float = 2.0) -> tuple[Problem, Iterate]:
    phase = Phase("all", uniform(len(controls)), Interval(0.1, 9.0))
    problem = Problem(SYSTEM, (), Boundary(), (phase,), objective=Objective(regularisation={"f": WEIGHT}))
    return problem, Iterate(np.array([seconds]), np.zeros((2, len(controls) + 1)), np.array([controls]))


def test_price_of_held_controls_is_their_regularised_variance_within_the_coarser_interval() -> None:
    coarser = np.array([True, False, True, False, True])
    constant = held(3.0, 3.0, 3.0, 3.0)
    assert (predict_hold_cost(*constant) == 0.0).all()
    assert (measure_hold_cost(*constant, coarser) == 0.0).all()
    assert measure_hold_cost(*held(1.0, 5.0, 2.0, 2.0), coarser) == pytest.approx([1.0 * WEIGHT * 2.0**2, 0.0])
    usual, longer, higher = held(0.0, 1.0), held(0.0, 1.0, seconds=4.0), held(0.0, 3.0)
    assert predict_hold_cost(*longer) == pytest.approx(2.0 * predict_hold_cost(*usual))
    assert predict_hold_cost(*higher) == pytest.approx(9.0 * predict_hold_cost(*usual))
    # Where the finer mesh has the same slope, as foreseen: halves differ by half of what neighbours do.
    coarse, fine = held(0.0, 1.0, 2.0, 3.0), held(*(0.5 * np.arange(8) - 0.25))
    assert predict_hold_cost(*coarse) == pytest.approx(measure_hold_cost(*fine, np.arange(9) % 2 == 0))


def test_price_is_of_the_size_of_what_a_finer_mesh_gains() -> None:
    result, stage_problem = solve_stages(SMALL)[0], prepared(SMALL)
    problem, iterate = stage_problem.problem(mesh_of(result.trajectory)), iterate_of(result.trajectory)
    mesh, guess = restrict(problem.mesh, iterate, result.mesh.coarser)
    with SolverService() as service:
        solution = SolverSession(service, PLAN, Silent()).solve(
            stage_problem.problem(mesh), guess, "", barrier=InitialBarrier.COARSER_MESH
        )
    assert solution is not None
    objective = result.trajectory.race_time + result.provenance.regularisation
    gained = solution.objective - objective
    assert 0.1 * gained < measure_hold_cost(problem, iterate, result.mesh.coarser).sum() < 1.5 * gained


@pytest.mark.parametrize(("growth", "refined"), [(0.5, False), (6.0, True)])
def test_a_mesh_that_has_grown_too_much_is_refined_no_more(
    growth: float, refined: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(mesh_loop, "GROWTH_MAX", growth)
    monkeypatch.setattr(mesh_loop, "GROWTH_FROM", 0)
    stage_problem, mesh = prepared(SMALL), first_mesh(prepared(SMALL).plan, PLAN.mesh)
    start = Start(stage_problem, stage_problem.problem(mesh), guess(stage_problem.plan, mesh), InitialBarrier.COLD)
    with SolverService() as service:
        found = mesh_loop.solve_certified(SolverSession(service, PLAN, Silent()), start, "interior-point")
    assert isinstance(found, StageResult)
    assert found.certified is refined


@pytest.mark.parametrize(("race_time_max", "refined"), [(1.0, False), (100.0, True)])
def test_an_optimum_too_slow_to_be_of_use_is_refined_no_more(race_time_max: float, refined: bool) -> None:
    stage_problem, mesh = prepared(SMALL), first_mesh(prepared(SMALL).plan, PLAN.mesh)
    start = Start(stage_problem, stage_problem.problem(mesh), guess(stage_problem.plan, mesh), InitialBarrier.COLD)
    with SolverService() as service:
        session = SolverSession(service, PLAN, Silent())
        found = mesh_loop.solve_certified(session, replace(start, race_time_max=race_time_max), "interior-point")
    assert isinstance(found, StageResult)
    assert found.certified is refined
    assert (len(session.attempts) > 1) is refined


def test_the_first_solve_has_the_iterations_of_its_start() -> None:
    stage_problem, mesh = prepared(SMALL), first_mesh(prepared(SMALL).plan, PLAN.mesh)
    start = Start(
        stage_problem,
        stage_problem.problem(mesh),
        guess(stage_problem.plan, mesh),
        InitialBarrier.COLD,
        iterations_max=3,
    )
    with SolverService() as service:
        session = SolverSession(service, PLAN, Silent())
        assert isinstance(mesh_loop.solve_certified(session, start, "interior-point"), mesh_loop.Failure)
    assert [one.iterations <= 4 for one in session.attempts] == [True]


def test_limit_of_a_long_race_grows_with_its_duration() -> None:
    for duration in (1.0, 55.0, 80.0, LONG_RACE):
        assert LIMITS.change_of(duration) == LIMITS.race_time
    for races in (2, 64):
        assert LIMITS.change_of(races * LONG_RACE) == pytest.approx(races * LIMITS.race_time, rel=1e-15)
    assert replace(LIMITS, race_time=0.002).change_of(3.0 * LONG_RACE) == pytest.approx(0.006, rel=1e-15)


@pytest.mark.parametrize(("share", "holds"), [(0.9, True), (1.1, False)])
@pytest.mark.parametrize("races", [0.5, 4.0])
def test_certificate_measures_with_the_limit_of_its_race(races: float, share: float, holds: bool) -> None:
    duration = races * LONG_RACE
    optimum = flown(durations=(0.75 * duration, 0.25 * duration))
    audited = replace(optimum.evidence.check, items=(Item("replay_defect", 0.0, 1.0),))
    limit = LIMITS.race_time * max(1.0, races)
    certificate = certify(
        optimum.problem,
        optimum.iterate,
        replace(optimum.evidence, check=audited),
        LIMITS,
        claim=Item("solver", 0.0, 0.0),
        status="solved",
        kkt_error=0.0,
        second_order=None,
        coarser_race_time=duration + share * limit,
    )
    (item,) = (one for one in certificate.items if one.name == RACE_TIME_CHANGE)
    assert item.limit == pytest.approx(limit, rel=1e-12)
    assert item.value == pytest.approx(share * limit, rel=1e-9)
    assert item.holds is holds
