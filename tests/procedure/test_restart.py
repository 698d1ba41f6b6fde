"""A run that is started from another one finds what a run from scratch finds, and says where it had to fall back."""

import dataclasses

import numpy as np
import pytest
from races import PLAN, ROOT, SHIPPED, SMALL, blown, optimum, solve_stages

from airrace.errors import UsageError
from airrace.files.inputs import load_inputs
from airrace.model.track.course import Direction
from airrace.optimal_control.quantities import Interval
from airrace.optimal_control.trajectory import Trajectory
from airrace.procedure import restart, solver_session
from airrace.procedure.formulation import ensure_same_passings, passings_of
from airrace.procedure.procedure import optimize
from airrace.procedure.result import Silent, StageResult, Status
from airrace.procedure.stage import Stage
from airrace.race import Race

WINDY = blown(SMALL, 200.0, 3.0)


def stored() -> StageResult:
    """The certified point mass of the small race."""
    return optimum(SMALL, PLAN)


def started(race: Race, *start: StageResult, until: Stage = Stage.POINT_MASS) -> list[StageResult]:
    """The stages of a race that is started from others."""
    return list(optimize(race, PLAN, until=until, threads=1, start=start, start_name="calm.h5", progress=Silent()))


def with_trajectory(result: StageResult, **changes: object) -> StageResult:
    flown: Trajectory = dataclasses.replace(result.trajectory, **changes)  # type: ignore[arg-type]
    return dataclasses.replace(result, trajectory=flown)


def with_limit(race: Race, n_z: float) -> Race:
    rules = dataclasses.replace(race.course.rules, n_z=Interval(-2.0, n_z))
    return dataclasses.replace(race, course=dataclasses.replace(race.course, rules=rules))


@pytest.mark.parametrize(
    "race", [pytest.param(WINDY, id="wind"), pytest.param(with_limit(SMALL, 9.0), id="tighter limit")]
)
def test_changed_race_has_the_optimum_that_it_has_from_scratch(race: Race) -> None:
    (result,) = started(race, stored())
    assert result.certified
    assert result.remarks == ""
    assert result.provenance.source == "point-mass of calm.h5"
    assert result.trajectory.race_time == pytest.approx(optimum(race, PLAN).trajectory.race_time, abs=5e-3)
    assert result.trajectory.race_time != pytest.approx(stored().trajectory.race_time, abs=5e-3)


def test_unchanged_race_keeps_its_mesh_and_its_race_time_in_whatever_order_states_are_stored() -> None:
    flown = stored().trajectory
    (result,) = started(SMALL, stored())
    assert result.trajectory.race_time == pytest.approx(flown.race_time, abs=1e-5)
    assert result.trajectory.time.shape == flown.time.shape
    assert np.array_equal(result.mesh.coarser, stored().mesh.coarser)
    turned = with_trajectory(stored(), states=flown.states[::-1], state=flown.state[::-1])
    (result,) = started(SMALL, turned)
    assert result.remarks == ""
    assert result.trajectory.race_time == pytest.approx(flown.race_time, abs=1e-5)


def test_highest_stage_is_the_start_and_those_below_are_left_out() -> None:
    whole = solve_stages(SMALL)
    (result,) = started(SMALL, *whole, until=Stage.TRANSFER_FUNCTION)
    assert (result.stage, result.certified) == (Stage.TRANSFER_FUNCTION, True)
    assert result.provenance.source == "transfer-function of calm.h5"
    assert result.trajectory.race_time == pytest.approx(whole[1].trajectory.race_time, abs=1e-3)


def test_other_equations_make_the_next_lower_stage_the_start_and_those_above_it_are_climbed() -> None:
    higher = solve_stages(SMALL)[1]
    first, *rest = higher.trajectory.states
    other = with_trajectory(higher, states=(dataclasses.replace(first, name="unheard_of"), *rest))
    results = started(WINDY, stored(), other, until=Stage.TRANSFER_FUNCTION)
    assert [result.stage for result in results] == [Stage.POINT_MASS, Stage.TRANSFER_FUNCTION]
    assert results[0].remarks.startswith("calm.h5: from its transfer-function, which flies other equations")
    assert results[0].remarks.endswith("so the start is its point-mass")
    assert results[1].remarks == ""
    assert [result.provenance.source for result in results] == ["point-mass of calm.h5", "point-mass"]
    assert all(result.certified for result in results)


def test_flight_that_leads_nowhere_is_followed_by_a_start_from_scratch_and_it_is_said(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(restart, "ITERATIONS_MAX", 1)  # not enough to lead anywhere
    results = started(WINDY, stored())
    assert results[-1].certified
    assert "so the start is from scratch" in results[0].remarks
    assert results[-1].trajectory.race_time == pytest.approx(optimum(WINDY, PLAN).trajectory.race_time, abs=1e-5)
    assert not results[0].attempts[0].success  # what led nowhere is on record


def test_flight_whose_multipliers_lead_nowhere_is_started_from_without_them(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(solver_session, "WARM_ITERATIONS_MAX", 1)
    (result,) = started(WINDY, stored())
    assert result.remarks == ""
    assert [one.success for one in result.attempts[:2]] == [False, True]
    assert result.attempts[0].purpose == result.attempts[1].purpose


def test_gate_that_is_planned_the_other_way_round_is_named() -> None:
    start, *rest = SMALL.course.passages
    turned = dataclasses.replace(rest[-1], direction=Direction.REVERSE)
    course = dataclasses.replace(SMALL.course, passages=(start, *rest[:-1], turned))
    point_mass, higher = solve_stages(SMALL)[:2]
    result, *_ = started(dataclasses.replace(SMALL, course=course), point_mass, higher, until=Stage.TRANSFER_FUNCTION)
    obstacle = "from its transfer-function, point-mass, which passes last the other way than is planned now"
    assert obstacle in result.remarks
    assert (result.stage, result.provenance.source) == (Stage.POINT_MASS, "")


def test_run_without_a_stage_that_holds_is_refused() -> None:
    failed = dataclasses.replace(stored(), outcome=Status.NOT_CERTIFIED)
    with pytest.raises(UsageError, match=r"calm\.h5 has no certified or solved stage up to point-mass"):
        started(SMALL, failed)


def test_first_passing_that_differs_by_name_kind_or_being_there_is_named() -> None:
    with pytest.raises(UsageError, match=r"number 1 is first there and 0:entry here"):
        started(SHIPPED["half_cuban_eight"], stored())
    mine = passings_of(SMALL.course)
    ensure_same_passings(mine, mine, "calm.h5")
    other = [(name, "pylon" if number == 2 else kind) for number, (name, kind) in enumerate(mine)]
    for ours, theirs, words in (
        (mine, other, r"number 3 is edge \(pylon\) there and edge \(gate\) here"),
        (mine, mine[:-1], "only this course has a passing number 4, last"),
        (mine[:-1], mine, r"only calm\.h5 has a passing number 4, last"),
    ):
        with pytest.raises(UsageError, match=words):
            ensure_same_passings(ours, theirs, "calm.h5")


def test_run_without_lower_stages_goes_on_upwards_and_not_below_what_is_finished() -> None:
    inversion, top = solve_stages(SMALL)[2], solve_stages(SMALL)[-1]
    rest = list(optimize(SMALL, PLAN, until=Stage.STATE_SPACE, threads=1, finished=[inversion], progress=Silent()))
    assert [result.stage for result in rest] == [Stage.STATE_SPACE]
    assert rest[0].certified
    assert list(optimize(SMALL, PLAN, until=Stage.SIX_DOF, threads=1, finished=[top], progress=Silent())) == []


# long courses


@pytest.mark.slow
@pytest.mark.parametrize("track", ["rovinj_2014", "abu_dhabi_2016"])
def test_long_course_has_the_optimum_that_it_has_from_scratch_in_a_quarter_of_the_iterations(track: str) -> None:
    calm = load_inputs(ROOT / "tracks" / f"{track}.yaml").race
    windy = blown(calm, 250.0, 2.5)
    scratch = solve_stages(windy)
    (result,) = started(windy, *solve_stages(calm), until=Stage.SIX_DOF)
    assert (result.stage, result.remarks, result.certified) == (Stage.SIX_DOF, "", True)
    assert result.trajectory.race_time == pytest.approx(scratch[-1].trajectory.race_time, abs=5e-3)
    assert result.iterations <= 0.25 * sum(one.iterations for one in scratch)
