"""A race that cannot be flown, or not in time, is an answer: an outcome, a sentence, and no exception."""

import dataclasses

import pytest
from races import DIVING_EIGHT, RACES, ROOT, SMALL, optimum, prepared, settings, solve_point_mass

from airrace.errors import InputError, OutOfTime
from airrace.files.inputs import load_inputs
from airrace.model.track.course import ClearanceRule
from airrace.optimal_control.quantities import Interval
from airrace.procedure.guess import first_mesh, guess
from airrace.procedure.infeasibility import conflicts
from airrace.procedure.procedure import optimize
from airrace.procedure.result import Iteration, Progress, Silent, StageResult, Status
from airrace.procedure.settings import GuessKind, Settings, SolverSettings
from airrace.procedure.solver_session import CONTINUATIONS_MAX
from airrace.procedure.stage import Stage
from airrace.race import Race

every_guess = pytest.mark.parametrize(
    "guess_kind", [GuessKind.PLAN, pytest.param(GuessKind.HOMOTOPY, marks=pytest.mark.slow)]
)


def limited(race: Race, **limits: Interval | ClearanceRule) -> Race:
    """The race under other rules."""
    return dataclasses.replace(
        race, course=dataclasses.replace(race.course, rules=dataclasses.replace(race.course.rules, **limits))
    )


# No half Cuban eight can be flown below a ceiling 20 m above its entry, by whatever pilot.
BELOW = Interval(10.0, 100.0)
CEILING = limited(DIVING_EIGHT, height=BELOW)
RACED_CEILING = limited(RACES["half_cuban_eight"], height=BELOW)


@pytest.mark.slow
@every_guess
def test_impossible_course_is_infeasible_and_the_message_names_where_and_which_limit(guess_kind: GuessKind) -> None:
    result = optimum(CEILING, settings(guess_kind))
    assert result.outcome is Status.INFEASIBLE
    assert not result.certified
    assert result.certificate is None
    assert any(phase in result.message for phase in result.trajectory.phases)
    assert "the ceiling of 100 m" in result.message
    assert "rules.ceiling_m" in {one.key for one in result.suggested_changes}


@pytest.mark.slow
def test_a_pilot_s_limits_leave_the_search_for_the_limit_in_conflict_as_good_as_it_is_without_them() -> None:
    free, raced = (optimum(race, settings(GuessKind.PLAN)) for race in (CEILING, RACED_CEILING))
    assert raced.outcome is Status.INFEASIBLE
    assert "pilot" not in raced.message
    change, other = (result.suggested_changes[0] for result in (free, raced))
    assert other.certified
    assert (other.key, other.where) == (change.key, change.where)
    assert other.needed == pytest.approx(change.needed, abs=5.0)
    relaxed = [one.success for one in raced.attempts if one.purpose == "every limit giving way"]
    assert relaxed == [True] * 4  # on both routes without the pilot's limits, then with them


@pytest.mark.slow
def test_a_pilot_s_limits_are_not_blamed_where_others_contradict_each_other_without_them(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(conflicts, "CONFLICTS_MAX", 0)
    (result,) = optimize(RACED_CEILING, settings(GuessKind.PLAN), until=Stage.POINT_MASS, threads=1, progress=Silent())
    assert result.outcome is Status.INFEASIBLE
    assert not result.suggested_changes
    assert "without the limit of height between floor and ceiling (10 to 100 m) there is a flight" in result.message
    assert "pilot" not in result.message


@pytest.mark.slow
def test_limits_had_to_give_way_on_two_ways_round_before_a_course_is_called_infeasible() -> None:
    attempts = optimum(CEILING, settings(GuessKind.PLAN)).attempts
    assert [one.purpose for one in attempts[:3]] == ["all 4 phases", *["every limit giving way"] * 2]
    assert [one.success for one in attempts[:3]] == [False, True, True]


@pytest.mark.slow
def test_a_race_that_only_the_homotopy_flies_is_not_called_infeasible() -> None:
    race = load_inputs(ROOT / "tests" / "courses" / "random_32.yaml").race
    # Wings that cross its quad in the middle hit the quad's other pylons.
    tight = limited(race, n_z=Interval(race.course.rules.n_z.lower, 6.0), clearance=ClearanceRule.CROSSING)
    result = optimum(tight, settings(GuessKind.PLAN))
    begun = ["all 19 phases", "all 19 phases", "every limit giving way"]  # in vain
    assert [one.purpose for one in result.attempts[:3]] == begun
    assert not any(one.success for one in result.attempts[:3])
    assert result.certified


@pytest.mark.parametrize("n_z_max", [1.5, pytest.param(2.5, marks=pytest.mark.slow)])
def test_tight_load_factor_makes_a_slower_race_not_an_impossible_one(n_z_max: float) -> None:
    result = optimum(limited(SMALL, n_z=Interval(-1.0, n_z_max)), settings(GuessKind.PLAN))
    assert result.certified
    assert result.trajectory.race_time > optimum(SMALL, settings(GuessKind.PLAN)).trajectory.race_time


def hurried(**changes: float) -> Settings:
    """From the plan, with other settings of the solver."""
    return dataclasses.replace(settings(GuessKind.PLAN), solver=dataclasses.replace(SolverSettings(), **changes))


def test_too_few_iterations_are_not_converged() -> None:
    result = optimum(SMALL, hurried(iterations_max=4))
    assert result.outcome is Status.NOT_CONVERGED
    assert result.certificate is None
    joint = [one for one in result.attempts if one.purpose.startswith("all")]
    from_starts = [one.solver for one in joint if "farther down" not in one.purpose]
    assert from_starts == ["interior-point", "interior-point", "ipopt", "ipopt"]
    assert len(joint) <= len(from_starts) + 2 * CONTINUATIONS_MAX
    assert all(one.iterations <= 6 for one in joint)


def test_solver_that_never_comes_back_is_a_timeout_that_still_shows_a_flight() -> None:
    result = optimum(SMALL, hurried(stall_seconds=0.02))
    assert result.outcome is Status.TIMEOUT
    assert "no iteration finished within" in result.message
    assert [one.status for one in result.attempts] == ["no iteration finished within 0.02 s"] * 2
    stage_problem = prepared(SMALL)
    made = guess(stage_problem.plan, first_mesh(stage_problem.plan, Settings().mesh))
    assert (result.trajectory.state == made.state).all()
    assert len(result.splits) == len(SMALL.course.passages)


def test_run_out_of_time_is_an_error_and_one_finished_in_time_the_same_as_without_a_limit() -> None:
    chosen = settings(GuessKind.PLAN)
    with pytest.raises(OutOfTime, match="there is no time left"):
        next(optimize(SMALL, chosen, until=Stage.POINT_MASS, threads=1, timeout=1e-3, progress=Silent()))
    (result,) = optimize(SMALL, chosen, until=Stage.POINT_MASS, threads=1, timeout=1e4, progress=Silent())
    (other,) = optimize(SMALL, chosen, until=Stage.POINT_MASS, threads=2, progress=Silent())
    assert (result.trajectory.state == optimum(SMALL, chosen).trajectory.state).all()
    assert (other.trajectory.state == result.trajectory.state).all()


def test_rules_that_contradict_the_aircraft_are_invalid_input() -> None:
    with pytest.raises(InputError, match="n_z"):
        solve_point_mass(limited(SMALL, n_z=Interval(13.0, 14.0)), settings(GuessKind.PLAN))


# the run itself


class Recorder(Progress):
    """Writes down what it is told."""

    def __init__(self) -> None:
        self.told: list[str] = []
        self.iterations: list[Iteration] = []

    def stage_started(self, stage: Stage) -> None:
        self.told.append(f"start {stage.value}")

    def activity(self, text: str, done: int, total: int) -> None:
        self.told.append(text)

    def iteration(self, iteration: Iteration) -> None:
        self.iterations.append(iteration)

    def stage_finished(self, result: StageResult) -> None:
        self.told.append(f"finish {result.stage.value}")


def test_watcher_is_told_of_stages_phases_and_iterations() -> None:
    watcher = Recorder()
    list(optimize(SMALL, settings(GuessKind.HOMOTOPY), until=Stage.POINT_MASS, threads=1, progress=watcher))
    assert [text for text in watcher.told if text.startswith("start ")] == ["start homotopy", "start point-mass"]
    for a, b in (("first", "pylon"), ("pylon", "edge"), ("edge", "last")):
        assert any(f"{a} -> {b}" in text for text in watcher.told)
    assert len(watcher.iterations) > 10
    assert watcher.iterations[-1].objective == pytest.approx(8.89, abs=0.1)


def test_run_until_the_homotopy_ends_there() -> None:
    until = optimize(SMALL, settings(GuessKind.HOMOTOPY), until=Stage.HOMOTOPY, threads=1, progress=Silent())
    assert [result.stage for result in until] == [Stage.HOMOTOPY]


def test_finished_stages_are_not_run_again_and_lead_to_the_same_optimum() -> None:
    chosen = settings(GuessKind.HOMOTOPY)
    pieces, joint = solve_point_mass(SMALL, chosen)
    (again,) = optimize(SMALL, chosen, until=Stage.POINT_MASS, threads=1, finished=(pieces,), progress=Silent())
    assert again.stage is Stage.POINT_MASS
    assert again.trajectory.race_time == pytest.approx(joint.trajectory.race_time, rel=1e-9)
    done = (pieces, joint)
    assert list(optimize(SMALL, chosen, until=Stage.POINT_MASS, threads=1, finished=done, progress=Silent())) == []
