"""The mesh check: stages that are solved on one mesh, and those whose race time a second mesh confirms."""

import dataclasses
import functools

import numpy as np
import pytest
from races import SMALL, settings

from airrace.errors import NotCertified
from airrace.flights.sensitivity.lagrangian import sensitivities
from airrace.optimal_control.certificate import RACE_TIME_CHANGE, Item
from airrace.procedure.procedure import optimize, recertify
from airrace.procedure.result import NoteKind, Silent, StageResult, Status
from airrace.procedure.settings import GuessKind, MeshCheck, Settings
from airrace.procedure.stage import Stage
from airrace.runs.verification import discrepancies

ALL = settings(GuessKind.PLAN)
LAST = dataclasses.replace(ALL, mesh_check=MeshCheck.LAST)
UNREACHABLE = dataclasses.replace(
    ALL,
    certificate=dataclasses.replace(ALL.certificate, race_time=1e-9),
    mesh=dataclasses.replace(ALL.mesh, refinements_max=1),
)
"""Settings with which no mesh check ever succeeds."""


@functools.cache
def solve(
    chosen: Settings, until: Stage = Stage.TRANSFER_FUNCTION, finished: int = 0, start: int = 0
) -> tuple[StageResult, ...]:
    """A race up to a stage; the first so many stages of the run that proves the last one alone are finished, or where
    it starts from."""
    known = solve(LAST) if finished or start else ()
    return tuple(
        optimize(
            SMALL,
            chosen,
            until=until,
            threads=1,
            finished=known[:finished],
            start=known[:start],
            progress=Silent(),
        )
    )


def seconds(result: StageResult) -> float:
    return result.trajectory.race_time


def items_of(result: StageResult) -> list[str]:
    assert result.certificate is not None
    return [item.name for item in result.certificate.items]


def test_stages_below_the_last_are_solved_on_one_mesh_and_the_last_is_certified() -> None:
    """All that a certificate measures is measured but the second mesh, and nearly the same race time is found."""
    (below, last), (proved, other) = solve(LAST), solve(ALL)
    assert (below.status, last.status, proved.status) == (Status.SOLVED, Status.CERTIFIED, Status.CERTIFIED)
    assert below.holds
    assert not below.certified
    assert items_of(below) == [name for name in items_of(proved) if name != RACE_TIME_CHANGE]
    assert RACE_TIME_CHANGE in items_of(last)
    assert seconds(last) == pytest.approx(seconds(other), abs=2e-4)  # s; 3e-8 without needless centimetres
    assert len(below.attempts) < len(proved.attempts)
    assert seconds(below) == pytest.approx(seconds(proved), abs=2.0 * ALL.certificate.race_time)


def test_stages_between_the_point_mass_and_the_last_are_solved_as_closely_as_the_next_needs() -> None:
    """On one mesh, of which nothing is claimed; the last stage ends where it does from stages that are certified."""
    point_mass, between, last = solve(LAST, Stage.STATE_SPACE_INVERSION)
    assert (point_mass.is_rough, between.is_rough, last.is_rough) == (False, True, False)
    assert between.status is Status.SOLVED
    variations = [name for name in items_of(last) if name.startswith("variation")]
    assert items_of(between) == ["solver", "kkt_error", "replay_defect", *variations]
    assert between.coarser_nodes.all()
    assert len(between.attempts) == 1
    assert last.certified
    every = solve(ALL, Stage.STATE_SPACE_INVERSION)
    assert seconds(last) == pytest.approx(seconds(every[2]), abs=1e-3)
    assert 0.0 < seconds(between) - seconds(every[1]) < 0.03  # s; a barrier parameter that is left and held controls


def test_rough_stage_that_a_run_now_ends_with_is_certified() -> None:
    *below, between, _ = solve(LAST, Stage.STATE_SPACE_INVERSION)
    (completed,) = optimize(SMALL, LAST, until=between.stage, threads=1, finished=[*below, between], progress=Silent())
    assert completed.certified
    assert seconds(completed) == pytest.approx(seconds(solve(ALL)[1]), abs=1e-3)
    assert completed.attempts[: len(between.attempts)] == between.attempts
    assert recertify(SMALL, LAST, completed).certified


def test_rough_stage_is_measured_again_in_what_it_claims() -> None:
    between = solve(LAST, Stage.STATE_SPACE_INVERSION)[1]
    again = recertify(SMALL, LAST, between)
    assert again.holds
    assert again.is_rough
    assert discrepancies(between, dataclasses.replace(between, certificate=again)) == []
    gate, *rest = between.trajectory.state
    moved = dataclasses.replace(between.trajectory, state=np.vstack([gate * 1.01, *rest]))
    assert not recertify(SMALL, LAST, dataclasses.replace(between, trajectory=moved)).holds


def test_rough_stage_has_no_sensitivities_and_says_how_it_gets_some() -> None:
    between = solve(LAST, Stage.STATE_SPACE_INVERSION)[1]
    with pytest.raises(NotCertified, match="--mesh-check all"):
        list(sensitivities((), SMALL, LAST, between))


def test_only_stage_of_a_run_is_its_last_and_proved_as_ever() -> None:
    (one,), (other,) = solve(LAST, Stage.POINT_MASS), solve(ALL, Stage.POINT_MASS)
    assert one.certified
    np.testing.assert_array_equal(one.trajectory.state, other.trajectory.state)
    assert one.certificate == other.certificate


def test_mesh_check_completed_later_holds_and_leaves_the_stages_above_alone() -> None:
    (completed,) = solve(ALL, finished=2)
    assert completed.stage is Stage.POINT_MASS
    assert completed.certified
    assert seconds(completed) == pytest.approx(seconds(solve(ALL)[0]), abs=1e-3)  # the meshes differ a little
    assert completed.attempts[: len(solve(LAST)[0].attempts)] == solve(LAST)[0].attempts
    assert recertify(SMALL, ALL, completed).certified
    assert solve(LAST, finished=2) == ()  # nothing is checked that nobody asked for
    (last,) = solve(LAST, Stage.POINT_MASS, finished=1)
    assert last.certified


def test_run_goes_on_and_another_is_started_from_a_solved_stage() -> None:
    (higher,) = solve(LAST, finished=1)
    np.testing.assert_array_equal(higher.trajectory.state, solve(LAST)[-1].trajectory.state)
    (started,) = solve(LAST, Stage.POINT_MASS, start=1)
    assert started.certified
    assert started.remarks == ""
    assert seconds(started) == pytest.approx(seconds(solve(ALL)[0]), abs=1e-3)


def test_proof_that_fails_leaves_the_stage_as_it_was_and_says_why() -> None:
    (left,) = solve(UNREACHABLE, finished=1, until=Stage.POINT_MASS)
    solved = solve(LAST)[0]
    assert left.status is Status.SOLVED
    np.testing.assert_array_equal(left.trajectory.state, solved.trajectory.state)
    assert left.certificate == solved.certificate
    (note,) = left.notes
    assert note.kind is NoteKind.MESH_CHECK
    assert "on a second mesh: solved but not certified: " in note.text
    assert "race_time_change" in note.text


def test_solved_stage_is_measured_again_as_strictly_as_it_was_measured() -> None:
    solved = solve(LAST)[0]
    again = recertify(SMALL, LAST, solved)
    assert solved.certificate is not None
    assert again.holds
    assert not again.certified
    assert discrepancies(solved, dataclasses.replace(solved, certificate=again)) == []
    gate, *rest = solved.trajectory.state
    moved = dataclasses.replace(solved.trajectory, state=np.vstack([gate * 1.01, *rest]))
    assert not recertify(SMALL, LAST, dataclasses.replace(solved, trajectory=moved)).holds


def test_claim_to_be_certified_is_measured_on_a_second_mesh() -> None:
    """A solved stage to which somebody has added the missing item."""
    solved = solve(LAST)[0]
    assert solved.certificate is not None
    items = list(solved.certificate.items)
    place = 1 + [item.name for item in items].index("hamiltonian_drift")
    items.insert(place, Item(RACE_TIME_CHANGE, 1e-4, 5e-3, "s"))
    tampered = dataclasses.replace(solved, certificate=dataclasses.replace(solved.certificate, items=tuple(items)))
    assert tampered.certified
    again = recertify(SMALL, LAST, tampered)
    (measured,) = [item.value for item in again.items if item.name == RACE_TIME_CHANGE]
    assert 2e-4 < measured < 2e-3
    assert tampered.certificate is not None
    clauses = discrepancies(tampered, dataclasses.replace(tampered, certificate=again))
    assert any(clause.startswith("certificate, race_time_change: ") for clause in clauses)
