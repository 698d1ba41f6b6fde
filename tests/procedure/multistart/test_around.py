"""A start from another run: a flight that goes the wrong route is overtaken, a good one is not."""

import dataclasses
import itertools
import threading

import numpy as np
import pytest
from races import blown, prepared
from search_races import OFF, QUICK, SLALOM, open_session, optimum

from airrace.procedure.fidelity_continuation import FidelityContinuation
from airrace.procedure.multistart.coarse_solution import planned_guess, solve_coarse
from airrace.procedure.multistart.local_search import find_faster_route
from airrace.procedure.multistart.solver_pool import SolverPool
from airrace.procedure.progress import Silent
from airrace.procedure.result import Outcome, Stage, StageResult
from airrace.procedure.run import optimize
from airrace.procedure.settings import Settings
from airrace.procedure.stage_problem import stage_flight
from airrace.procedure.start import InitialBarrier
from airrace.trajectory import Trajectory

WINDY = blown(SLALOM, 200.0, 2.0)


def found_around(optimum: StageResult) -> str:
    source = stage_flight(optimum.stage, SLALOM, QUICK, optimum.trajectory)
    with open_session() as session, session.pool() as pool:
        return find_faster_route(prepared(SLALOM), source, optimum, SLALOM.course, pool)


def test_wrong_way_round_is_told() -> None:
    told = found_around(optimum(SLALOM, OFF))
    assert told.endswith(" s")
    words, _, seconds = told.removesuffix(" s").partition(" saves about ")
    assert "->" in words
    assert float(seconds) > 5.0


def test_of_a_good_flight_nothing_is_told() -> None:
    assert found_around(optimum(SLALOM)) == ""


def started(start: StageResult, chosen: Settings, threads: int = 1) -> StageResult:
    (result,) = optimize(
        WINDY, chosen, until=Stage.POINT_MASS, threads=threads, start=[start], start_name="calm.h5", progress=Silent()
    )
    assert result.certified
    return result


def test_run_started_from_a_flight_the_wrong_way_round_is_flown_from_scratch_and_says_so() -> None:
    result = started(optimum(SLALOM, OFF), QUICK)
    assert result.remarks.startswith("calm.h5: from its point-mass an optimum of ")
    assert result.remarks.endswith("so the start is from scratch")
    assert result.trajectory.race_time < optimum(SLALOM, OFF).trajectory.race_time - 5.0


@pytest.mark.parametrize("threads", [1, 2])
def test_run_started_from_a_good_flight_keeps_its_way(threads: int) -> None:
    result = started(optimum(SLALOM), QUICK, threads)
    assert result.remarks == ""
    assert result.provenance.source == "point-mass of calm.h5"


def test_wrong_way_round_is_told_the_same_while_the_race_is_solved() -> None:
    one, two = (started(optimum(SLALOM, OFF), QUICK, threads) for threads in (1, 2))
    assert one.remarks == two.remarks
    assert np.array_equal(one.trajectory.state, two.trajectory.state)


def test_search_beside_is_given_up_with_what_it_stands_beside() -> None:
    with open_session(threads=2) as session:
        begun = threading.Event()

        def endless(pool: SolverPool) -> str:
            begun.set()
            while True:
                pool.work([planned_guess(prepared(SLALOM), prepared(SLALOM).plan, InitialBarrier.COLD)], solve_coarse)

        def interrupted() -> None:
            with session.aside(endless):
                assert begun.wait(60.0)
                raise KeyboardInterrupt

        with pytest.raises(KeyboardInterrupt):
            interrupted()


def test_error_of_a_search_beside_is_raised_where_it_is_asked_for() -> None:
    with open_session(threads=2) as session, session.aside(lambda _: 1 / 0) as search, pytest.raises(ZeroDivisionError):
        search.result()


def test_without_exploring_a_start_is_taken_as_it_is() -> None:
    result = started(optimum(SLALOM, OFF), OFF)
    assert result.remarks == ""
    assert result.trajectory.race_time > optimum(SLALOM).trajectory.race_time + 5.0


def test_certified_start_is_not_given_up_for_a_promise_that_is_not_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    """Another way seems faster when solved coarsely; from scratch it leads to nothing faster, or to nothing at all."""
    good = started(optimum(SLALOM), QUICK)
    promise = "left -> right, flat, saves about 0.03 s"
    monkeypatch.setattr(FidelityContinuation, "find_faster_route", lambda *_: lambda _: promise)
    for scratch in (slower(good), dataclasses.replace(good, outcome=Outcome.NOT_CERTIFIED)):
        monkeypatch.setattr(FidelityContinuation, "climb", lambda *_, found=scratch: found)
        result = started(optimum(SLALOM), QUICK)
        assert result.trajectory.race_time == good.trajectory.race_time
        assert result.remarks.endswith("so the start is from scratch, which led to nothing faster")


def test_spare_start_is_taken_once_where_a_later_stage_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    """From scratch the point mass becomes faster, but nothing leads on from it nor from the spare start."""
    good = started(optimum(SLALOM), QUICK)
    monkeypatch.setattr(
        FidelityContinuation, "find_faster_route", lambda *_: lambda _: "a route that saves about 0.03 s"
    )
    scratch = {
        Stage.POINT_MASS: dataclasses.replace(good, trajectory=scaled(good, 0.99)),
        Stage.TRANSFER_FUNCTION: dataclasses.replace(
            good, stage=Stage.TRANSFER_FUNCTION, outcome=Outcome.NOT_CERTIFIED, message="no"
        ),
    }
    monkeypatch.setattr(FidelityContinuation, "climb", lambda _, stage, session: scratch[stage])
    run = optimize(
        *(WINDY, QUICK),
        until=Stage.TRANSFER_FUNCTION,
        threads=1,
        start=[optimum(SLALOM)],
        start_name="calm.h5",
        progress=Silent(),
    )
    faster, spare, failed = itertools.islice(run, 4)
    assert faster.remarks.endswith("so the start is from scratch")
    assert spare.remarks == f"{faster.remarks}, which led to nothing faster"
    assert spare.trajectory.race_time == good.trajectory.race_time
    assert (failed.stage, failed.remarks) == (Stage.TRANSFER_FUNCTION, "no")


def slower(result: StageResult) -> StageResult:
    return dataclasses.replace(result, trajectory=scaled(result, 1.01))


def scaled(result: StageResult, factor: float) -> Trajectory:
    return dataclasses.replace(result.trajectory, durations=factor * result.trajectory.durations)
