"""Infeasible courses: certificates of conflict, diagnosis and suggested changes."""

import dataclasses
import math
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
from races import (
    DEGREE,
    EDGE_540,
    ROOT,
    RULES,
    SIXTEEN,
    SMALL,
    course,
    level,
    models_of,
    optimum,
    planned,
    prepared,
    settings,
)
from test_solving import STALLED, Canned, asked, session
from transformations import mirrored

from airrace.files.inputs import load_inputs
from airrace.files.inputs.variation import Variation
from airrace.model.environment import Air
from airrace.model.parameters import Parameter, attribute_parameter
from airrace.model.track.course import Course, Crowd, CrowdShape
from airrace.model.track.gates import Gate, Manoeuvre
from airrace.model.track.polygons import Point
from airrace.optimal_control.problem import Iterate, Problem
from airrace.optimal_control.quantities import Interval
from airrace.optimal_control.solvers.service import SolverService
from airrace.procedure import first_solutions as before_point_mass
from airrace.procedure import procedure
from airrace.procedure.first_solutions import FirstSolutions, solve_homotopy_and_plans
from airrace.procedure.guess import first_mesh, guess
from airrace.procedure.homotopy import INFEASIBILITY_TESTS_MAX, HomotopyOutcome, solve_homotopy
from airrace.procedure.infeasibility.conflicts import (
    RelaxedRace,
)
from airrace.procedure.infeasibility.diagnose import diagnose_infeasibility
from airrace.procedure.infeasibility.local_infeasibility import (
    WINDOWS_MAX,
    LocalInfeasibility,
    diagnose_window,
    find_local_infeasibility,
)
from airrace.procedure.mesh_loop import solve_certified
from airrace.procedure.planning.parameters import relaxable_parameters
from airrace.procedure.procedure import solve_point_mass
from airrace.procedure.result import Silent, StageResult, Status, SuggestedChange
from airrace.procedure.settings import GuessKind, SearchEffort, Settings
from airrace.procedure.solver_session import Budget, SolverSession
from airrace.procedure.stage import Stage
from airrace.race import Race

G = 9.80665
SPEED, RADIUS = 60.0, 150.0
LEAST = math.hypot(1.0, SPEED**2 / (G * RADIUS))  # the load factor of a level turn


def rectangle(south: float, west: float, north: float, east: float) -> tuple[Point, ...]:
    return Point(south, west), Point(south, east), Point(north, east), Point(north, west)


def level_turn(n_z_max: float) -> Race:
    """Half a circle, flown level and at one speed, in an airspace that ends where the circle does."""

    def at(name: str, east: float, heading: float) -> Manoeuvre:
        exactly = Interval.exactly
        north, height = exactly(0.0), exactly(20.0)
        return Manoeuvre(name, climb=0.0, heading=heading, north=north, east=exactly(east), height=height)

    rules = dataclasses.replace(RULES, n_z=Interval(-2.0, n_z_max), height=Interval(19.9, 20.1))
    flown = course("half a circle", at("a", 0.0, 0.0), at("b", 2.0 * RADIUS, math.pi), rules=rules)
    passages = tuple(dataclasses.replace(one, speed=Interval()) for one in flown.passages)
    airspace = rectangle(-50.0, -1.0, RADIUS, 2.0 * RADIUS + 1.0)
    envelope = dataclasses.replace(EDGE_540.envelope, V=Interval(SPEED - 0.05, SPEED + 0.05))
    aircraft = dataclasses.replace(EDGE_540, envelope=envelope)
    return Race(dataclasses.replace(flown, passages=passages, airspace=airspace), aircraft, Air())


def result_of(race: Race) -> StageResult:
    return optimum(race, settings(GuessKind.PLAN))


def suggested_changes(race: Race) -> dict[str, SuggestedChange]:
    """What is suggested for a race without a flight, by key."""
    result = result_of(race)
    assert result.outcome is Status.INFEASIBLE
    return {one.key: one for one in result.suggested_changes}


# The numbers that may be relaxed.


@pytest.mark.parametrize("path", sorted((ROOT / "tracks").glob("*.yaml")), ids=lambda path: path.stem)
def test_a_parameter_changes_what_set_changes_by_its_key(path: Path) -> None:
    inputs = load_inputs(path)
    variation = Variation(inputs)
    known = [one for one in relaxable_parameters(inputs.race) if one.bounds.lower <= one.milder]
    assert len(known) >= 10
    for parameter in known:
        changed, expected = (
            parameter.set(inputs.race, parameter.milder),
            variation.race(parameter.key, parameter.milder),
        )
        assert (changed.course, changed.aircraft) == (expected.course, expected.aircraft), parameter.key
        assert parameter.value == pytest.approx(variation.parameters[parameter.key].value, rel=1e-9), parameter.key


def test_parameters_are_relaxed_to_the_milder_side_and_rounded_to_it() -> None:
    race = level_turn(2.0)
    for parameter in relaxable_parameters(race):
        assert (parameter.at_steps(1.0) - parameter.value) * parameter.relaxing_step > 0.0
        assert parameter.at_steps(parameter.steps_max) == pytest.approx(parameter.limit)
        told = parameter.round_milder(parameter.at_steps(0.3))
        assert (told - parameter.at_steps(0.3)) * parameter.relaxing_step >= 0.0
    n_z = next(one for one in relaxable_parameters(race) if one.key == "rules.n_z_max")
    assert [n_z.round_milder(value) for value in (2.31, 2.3, 99.0)] == [2.4, 2.3, n_z.limit]


@dataclasses.dataclass(frozen=True)
class Hoop(Gate):
    """A kind of gate from outside."""

    def parameters(self) -> Sequence[Parameter[Any]]:
        return [attribute_parameter(self, "hoop_m", "width", label="hoop", relaxing_step=1.0, limit=30.0)]


def test_gate_kinds_from_outside_take_part_by_what_they_declare() -> None:
    gate = level("g", 250.0, 0.0, 0.0)
    hoop = Hoop(**{one.name: getattr(gate, one.name) for one in dataclasses.fields(gate)})
    race = Race(course("hoop", level("a", 0.0, 0.0, 0.0), hoop), EDGE_540, Air())
    wider = next(one for one in relaxable_parameters(race) if one.key == "gates.g.hoop_m")
    assert (wider.at, wider.label, wider.unit) == ("g", "hoop", "m")
    widths = [one.element.width for one in wider.set(race, 20.0).course.passages if isinstance(one.element, Gate)]
    assert widths == [gate.width, 20.0]


# What is told.


def test_the_least_load_factor_of_a_level_turn_follows_from_speed_and_radius() -> None:
    told = suggested_changes(level_turn(2.0))["rules.n_z_max"]
    assert (told.given, told.unit) == (2.0, "g")
    assert LEAST <= told.needed <= LEAST + 0.25 * (LEAST - 2.0) + 0.1


def test_what_is_suggested_flies_and_a_tenth_less_does_not() -> None:
    told = suggested_changes(level_turn(2.0))["rules.n_z_max"]
    assert result_of(level_turn(told.needed)).certified
    assert not result_of(level_turn(2.0 + 0.9 * (LEAST - 2.0))).certified


def test_the_sentence_says_where_and_which_limit_and_how_to_set_it() -> None:
    result = result_of(level_turn(2.0))
    told = suggested_changes(level_turn(2.0))["rules.n_z_max"]
    assert result.message.startswith("no flight was found: a -> b cannot be flown with ")
    assert f"(rules.n_z_max={told.needed:g})" in result.message


def test_suggestions_are_the_same_in_a_mirror() -> None:
    one, other = suggested_changes(level_turn(2.0)), suggested_changes(mirrored(level_turn(2.0)))
    assert one.keys() == other.keys()
    for key in one:
        assert one[key].needed == pytest.approx(other[key].needed, rel=1e-6), key


def test_little_is_flown_in_vain_where_limits_plainly_contradict_each_other() -> None:
    attempts = result_of(level_turn(2.0)).attempts
    assert [one.purpose for one in attempts].index("every limit giving way") <= 2  # after the plan, by both solvers
    alone = [one for one in attempts if one.purpose == "the legs around it alone"]
    assert len(alone) == 2  # from two guesses, of the first phase that the homotopy could not add
    assert {one.solver for one in alone} == {"interior-point"}


# Several conflicts.


def beside(name: str, north: float, distance: float) -> Crowd:
    return Crowd(name, CrowdShape.POINT, (Point(north, 40.0),), distance, slant=False)


def avenue(*crowd: Crowd) -> Course:
    """Gates in a row, in an airspace of 60 m to either side."""
    gates = [straight(level(f"g{place}", 250.0 * place, 0.0, 0.0)) for place in range(5)]
    rules = dataclasses.replace(RULES, height=Interval(10.0, 60.0))
    flown = course("avenue", *gates, rules=rules)
    return dataclasses.replace(flown, crowd=crowd, airspace=rectangle(-100.0, -60.0, 1200.0, 60.0))


def straight(gate: Gate) -> Gate:
    return dataclasses.replace(gate, tolerances=dataclasses.replace(gate.tolerances, crossing=40.0 * DEGREE))


@pytest.mark.slow
def test_independent_conflicts_are_all_told_and_the_first_suggestions_together_fly() -> None:
    race = Race(avenue(beside("west", 375.0, 106.0), beside("east", 875.0, 108.0)), EDGE_540, Air())
    result = result_of(race)
    first = {one.conflict: one for one in reversed(result.suggested_changes)}
    assert [first[number].key for number in sorted(first)] in (
        ["crowd.west.distance_m", "crowd.east.distance_m"],
        ["crowd.east.distance_m", "crowd.west.distance_m"],
    )
    assert {first[number].where for number in first} == {"g1 -> g2", "g3 -> g4"}
    assert "; and " in result.message
    needed = {one.key.split(".")[1]: one.needed for one in first.values()}
    milder = avenue(beside("west", 375.0, needed["west"]), beside("east", 875.0, needed["east"]))
    assert result_of(Race(milder, EDGE_540, Air())).certified


@pytest.mark.slow
def test_a_race_that_has_a_flight_after_all_is_flown() -> None:
    """Neither the plan nor the homotopy leads to one with this ceiling, nor does any solver from them."""
    race = load_inputs(ROOT / "tracks" / "abu_dhabi_2016.yaml", overrides=["rules.ceiling_m=60"]).race
    result = result_of(race)
    assert result.certified
    assert result.suggested_changes == ()


def test_a_race_in_which_nothing_has_to_give_way_is_flown_though_all_its_starts_have_failed() -> None:
    flown = result_of(SMALL)
    failed = dataclasses.replace(flown, outcome=Status.NOT_CONVERGED, certificate=None)
    chosen = settings(GuessKind.PLAN)
    with SolverService() as service, closing(SolverSession(service, chosen, Silent())) as used:
        result = diagnose_infeasibility(failed, SMALL, prepared(SMALL), used)
    assert result.certified
    assert result.suggested_changes == ()
    assert result.trajectory.race_time == pytest.approx(flown.trajectory.race_time, abs=5e-3)
    assert result.attempts[0].purpose == "every limit giving way"


FAILED_PHASE = 4


def sixteen() -> tuple[Problem, Iterate]:
    mesh = first_mesh(planned(SIXTEEN), Settings().mesh)
    return prepared(SIXTEEN).problem(mesh), guess(planned(SIXTEEN), mesh)


@pytest.mark.parametrize(
    ("verdicts", "found", "solvers"),
    [
        (["stuck", "stuck", "infeasible", "infeasible"], True, ["interior-point", "interior-point", "ipopt", "ipopt"]),
        (["stuck", "solved"], False, ["interior-point", "interior-point"]),
        (["stuck", "stuck", "stuck"], False, ["interior-point", "interior-point", "ipopt"]),
        (["stuck", "stuck", "infeasible", "solved"], False, ["interior-point", "interior-point", "ipopt", "ipopt"]),
        ([STALLED], False, ["interior-point"]),
    ],
)
def test_all_have_to_agree_that_there_is_no_flight(verdicts: list[str], found: bool, solvers: list[str]) -> None:
    used = session(*verdicts)
    problem, made = sixteen()
    result = find_local_infeasibility(used, problem, FAILED_PHASE, [made, made])
    assert (result is not None) is found
    assert [solver for solver, _, _ in asked(used)] == solvers
    assert all([phase.name for phase in one.phases] == list(names(problem, FAILED_PHASE)) for _, _, one in asked(used))


def names(problem: Problem, phase: int) -> Sequence[str]:
    return [phase.name for phase in problem.phases[phase - 2 : phase + 3]]


def test_limits_are_looked_at_around_other_gaps_where_the_legs_around_the_largest_are_feasible() -> None:
    problem, made = sixteen()
    end = Iterate(made.durations, made.state.copy(), made.control)
    for phase, gap in ((9, 2000.0), (10, 1500.0), (3, 1000.0)):
        end.state[0, problem.first_node[phase] + 1] += gap
    used = session("solved", "stuck", "solved")
    told = diagnose_window(used, problem, end, made, "")
    assert told is not None
    assert told.startswith(f"the limits contradict each other at {problem.phases[3].name}; without the limit of ")
    first, second = (one for _, _, one in asked(used)[:2])
    assert [phase.name for phase in first.phases] == names(problem, 9)
    assert [phase.name for phase in second.phases] == names(problem, 3)


def test_few_windows_are_looked_at_before_nothing_is_said() -> None:
    problem, made = sixteen()
    used = session("solved")
    assert diagnose_window(used, problem, made, made, "") is None
    assert len(asked(used)) == WINDOWS_MAX


def test_nobody_else_is_asked_where_limits_have_to_give_way_along_every_plan() -> None:
    problem, made = sixteen()
    used = session("stuck")
    assert find_local_infeasibility(used, problem, FAILED_PHASE, [made, made], lambda: True) is not None
    assert [solver for solver, _, _ in asked(used)] == ["interior-point", "interior-point"]
    feasible = session("stuck", "solved")
    assert find_local_infeasibility(feasible, problem, FAILED_PHASE, [made, made], lambda: True) is None


def test_a_single_solver_contradicts_nothing() -> None:
    used = session("infeasible")
    used.settings = dataclasses.replace(
        used.settings, solver=dataclasses.replace(used.settings.solver, fallback="interior-point")
    )
    problem, made = sixteen()
    assert find_local_infeasibility(used, problem, FAILED_PHASE, [made]) is None
    assert asked(used) == []
    assert find_local_infeasibility(used, problem, FAILED_PHASE, [made], lambda: False) is None
    assert find_local_infeasibility(used, problem, FAILED_PHASE, [made], lambda: True) is not None
    assert [solver for solver, _, _ in asked(used)] == ["interior-point", "interior-point"]


def test_nothing_is_infeasible_that_there_was_no_budget_to_try() -> None:
    used = session("infeasible")
    used.budget = Budget(work=1.0, spent=1)
    problem, made = sixteen()
    assert find_local_infeasibility(used, problem, FAILED_PHASE, [made], lambda: True) is None
    assert asked(used) == []


@pytest.mark.parametrize("answer", [True, False])
def test_a_homotopy_asks_of_the_first_phases_that_fail_and_ends_where_they_are_infeasible(answer: bool) -> None:
    used, tested_phases = session("stuck"), list[int]()

    def infeasibility(race: Problem, index: int, guesses: Sequence[Iterate]) -> LocalInfeasibility | None:
        tested_phases.append(index)
        assert all(one.state.shape == (len(race.system.states), race.intervals + 1) for one in guesses)
        return LocalInfeasibility(race, guesses[0], index, "") if answer else None

    outcome = solve_homotopy(prepared(SIXTEEN), used, infeasibility)
    result = outcome.result
    assert (outcome.infeasibility is not None) is answer
    assert tested_phases == ([0] if answer else list(range(INFEASIBILITY_TESTS_MAX)))
    assert result.outcome is Status.SOLVED  # it is a guess, whatever it is worth
    assert result.remarks == f"left as planned: {', '.join(result.trajectory.phases)}"
    assert (len(asked(used)) == 1) is answer


LEGS_FAIL = ["stuck", "stuck", "stuck"]  # the first piece, then its legs from either guess
RELAXED_FAILS = ["stuck"]  # the plan with all its limits relaxed
CLAIMED = ["infeasible", "infeasible"]


@pytest.mark.parametrize(
    ("kind", "before", "found_out", "search"),
    [
        (GuessKind.HOMOTOPY, [], [*LEGS_FAIL, *RELAXED_FAILS, *CLAIMED], SearchEffort.QUICK),
        (GuessKind.HOMOTOPY, [], [*LEGS_FAIL, *RELAXED_FAILS, *CLAIMED], SearchEffort.OFF),
        (GuessKind.PLAN, ["stuck", *RELAXED_FAILS], [*LEGS_FAIL, *CLAIMED], SearchEffort.OFF),
    ],
)
def test_a_race_that_contradicts_itself_is_infeasible_and_solved_no_more(
    kind: GuessKind, before: list[str], found_out: list[str], search: SearchEffort
) -> None:
    chosen = settings(kind, search=search)
    plans = 4 if search is SearchEffort.QUICK else 0  # solved beside the homotopy, which finds it out
    verdicts = (*before, *found_out, *["stuck"] * plans, "stuck", "solved")
    used = SolverSession(Canned(*verdicts), chosen, Silent())
    models, first_solutions = models_of(SMALL, chosen, Stage.HOMOTOPY), None
    if kind is GuessKind.HOMOTOPY:
        first_solutions = solve_homotopy_and_plans(models, used, searches=True)
        assert first_solutions.homotopy.result.outcome is Status.SOLVED
        used.reset_log()
    *_, result = solve_point_mass(models, used, solve_certified, first_solutions)
    assert result.outcome is Status.INFEASIBLE
    assert result.stage is Stage.POINT_MASS
    first = result.trajectory.phases[0]
    assert result.remarks.startswith(f"the limits contradict each other at {first}; without the limit of ")
    assert [one.purpose for one in result.attempts if one.purpose.startswith("all ")] == [
        f"all {len(result.trajectory.phases)} phases" for _ in before[1:]
    ]
    purposes = [one.purpose for one in result.attempts]
    explaining = next(place for place, one in enumerate(reversed(purposes), start=1) if "without" in one) - 1
    assert len(asked(used)) - explaining == len(before) + len(found_out) + 2 + plans  # two limits are taken away


def test_derivatives_of_all_that_is_solved_for_a_diagnosis_are_on_record() -> None:
    chosen = settings(GuessKind.PLAN)
    used = SolverSession(Canned("stuck"), chosen, Silent())
    *_, result = solve_point_mass(models_of(SMALL, chosen), used, solve_certified, None)
    assert not result.is_flight
    assert len(result.attempts) == len(asked(used))
    assert result.timings.derivatives == pytest.approx(0.25 * len(result.attempts))  # s, see `Canned`


@pytest.mark.parametrize("from_file", [False, True])
def test_a_homotopy_with_phases_that_fail_asks_for_conflicts_whether_or_not_it_was_solved_before(
    from_file: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The legs around the phases that fail are feasible alone."""

    def location(_: object) -> str:
        return "a -> b"

    for module in (before_point_mass, procedure):
        monkeypatch.setattr(module, "conflict_location", location)
    chosen = settings(GuessKind.HOMOTOPY, search=SearchEffort.OFF)
    used = SolverSession(Canned("stuck", "solved", "stuck"), chosen, Silent())
    models = models_of(SMALL, chosen, Stage.HOMOTOPY)
    first_solutions = solve_homotopy_and_plans(models, used, searches=True)
    pieces = first_solutions.homotopy.result
    assert pieces.remarks.startswith("left as planned: ")
    if from_file:
        relaxed = RelaxedRace(SMALL, models.problem(Stage.POINT_MASS), chosen.mesh)
        first_solutions = FirstSolutions(HomotopyOutcome(pieces), relaxed)
    used.reset_log()
    *_, result = solve_point_mass(models, used, solve_certified, first_solutions)
    assert result.outcome is Status.INFEASIBLE
    assert not [one.purpose for one in result.attempts if one.purpose.startswith("all ")]


class Told(Silent):
    """A progress that keeps what is done."""

    def __init__(self) -> None:
        self.texts: list[str] = []

    def activity(self, text: str, done: int, total: int) -> None:
        self.texts.append(text)


def test_the_search_for_conflicts_ends_with_its_budget_and_says_what_it_is() -> None:
    used = session("stuck")
    used.progress = watched = Told()
    routes = RelaxedRace(SMALL, prepared(SMALL), used.settings.mesh)
    routes.budget.work = 1.0
    assert set(routes.solve(used)) == {None}
    assert len(asked(used)) == 1
    assert all("searching for the limits in conflict (" in text for text in watched.texts)
    assert "0 % of the budget spent" in watched.texts[0]
    assert used.budget.spent == 0
