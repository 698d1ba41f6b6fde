"""Whatever becomes of a job, it is accounted for: by an executor that says what it is told to say."""

from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import Self

import pytest
from batch_examples import Watched, ending, flown, job, plan_of, step

from airrace.batch import supervision
from airrace.batch.executor import Attempt, AttemptResult, Ended, Event, FailureKind, Started
from airrace.batch.plan import BatchPlan, JobResult
from airrace.batch.record import read_record
from airrace.batch.supervision import Policy, supervise
from airrace.errors import StorageError

CRASH = AttemptResult(8, "its process crashed (SIGSEGV)", 0.5, fault=FailureKind.CRASHED)
LOST = AttemptResult(8, "its worker is gone", 0.5, fault=FailureKind.LOST)


class Scripted:
    """Ends every job as its script says, one event at a time."""

    def __init__(self, script: dict[str, list[AttemptResult]], slots: int = 2) -> None:
        self.script = script
        self.slots = slots
        self.orders: list[Attempt] = []
        self.most = 0
        self._pending: list[Event] = []
        self._running: list[str] = []

    def submit(self, order: Attempt) -> None:
        self.orders.append(order)
        self._running.append(order.job.name)
        self.most = max(self.most, len(self._running))
        self._pending.append(Started(order.job.name))

    def events(self, patience: float) -> Sequence[Event]:
        if not self._pending and self._running:
            name = self._running.pop(0)
            answer = self.script.get(name, [ending()]).pop(0)
            order = next(one for one in self.orders if one.job.name == name)
            if answer.fault is FailureKind.NONE:
                order.checkpoint.write_bytes(b"flown")
            self._pending.append(Ended(name, answer))
        events, self._pending = self._pending, []
        return events

    def stop(self) -> None:
        stopped = AttemptResult(130, "interrupted", 0.5, fault=FailureKind.STOPPED)
        self._pending += [Ended(name, stopped) for name in self._running]
        self._running = []

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...


def test_results_come_in_the_order_of_the_plan_and_no_more_run_than_there_are_slots(tmp_path: Path) -> None:
    plan = plan_of(tmp_path, *(job(f"j{number}") for number in range(7)))
    executor = Scripted({"j3": [ending(4, None, "infeasible")]}, slots=3)
    results = flown(plan, executor=executor)
    assert [result.code for result in results] == [0, 0, 0, 4, 0, 0, 0]
    assert executor.most == 3


def test_a_crash_is_tried_again_and_its_reason_kept(tmp_path: Path) -> None:
    (result,) = flown(plan_of(tmp_path, job()), executor=Scripted({"oval": [CRASH, ending()]}))
    assert result.code == 0
    assert result.retries == (CRASH.message,)
    record = read_record(tmp_path, "oval")
    assert record is not None
    assert record.retries == (CRASH.message,)


@pytest.mark.parametrize("retries", [0, 1, 3])
def test_an_accident_is_tried_again_as_often_as_is_allowed(retries: int, tmp_path: Path) -> None:
    executor = Scripted({"oval": [LOST] * 9})
    (result,) = flown(plan_of(tmp_path, job()), Policy(retries=retries), executor)
    assert result.code == 8
    assert [order.attempt for order in executor.orders] == list(range(1, retries + 2))
    assert len(result.retries) == retries


@pytest.mark.parametrize(
    "answer",
    [
        ending(4, None, "infeasible"),
        ending(5, 10.0, "not certified"),
        ending(3, None, "not valid"),
        ending(1, None, "a bug"),
        AttemptResult(6, "stopped after 1 s", 1.0, fault=FailureKind.TIMED_OUT),
    ],
)
def test_an_honest_answer_is_not_asked_for_again(answer: AttemptResult, tmp_path: Path) -> None:
    executor = Scripted({"oval": [answer]})
    (result,) = flown(plan_of(tmp_path, job()), executor=executor)
    assert result.code == answer.code
    assert len(executor.orders) == 1


def test_a_solver_that_crashed_is_an_accident(tmp_path: Path) -> None:
    executor = Scripted({"oval": [ending(8, None, "the solver process died (status -9)"), ending()]})
    (result,) = flown(plan_of(tmp_path, job()), executor=executor)
    assert result.code == 0


def test_jobs_under_way_and_jobs_not_begun_are_interrupted_and_finished_ones_kept(tmp_path: Path) -> None:
    plan = plan_of(tmp_path, *(job(f"j{number}") for number in range(5)))
    watched = Watched()
    executor = Scripted({})
    results = supervise(
        plan, executor, Policy(), watched, stop_asked=lambda: sum("ended 0" in line for line in watched.lines) == 1
    )
    assert [result.code for result in results] == [0, 130, 130, 130, 130]
    assert len(executor.orders) <= 3
    records = [read_record(tmp_path, f"j{number}") for number in range(5)]
    assert records[0] is not None
    assert records[0].code == 0
    assert records[4] is None


def test_what_is_kept_is_not_flown(tmp_path: Path) -> None:
    executor = Scripted({})
    plan = BatchPlan(tmp_path, (step(job("old"), known=JobResult(0, race_time=9.0), reason=""), step(job("new"))))
    results = flown(plan, executor=executor)
    assert [order.job.name for order in executor.orders] == ["new"]
    assert results[0].race_time == 9.0


def test_an_executor_may_have_no_room_for_a_while(tmp_path: Path) -> None:
    class Later(Scripted):
        waited = 0

        def events(self, patience: float) -> Sequence[Event]:
            self.waited += 1
            self.slots = 1 if self.waited > 3 else 0
            return super().events(patience)

    (result,) = flown(plan_of(tmp_path, job()), executor=Later({}, slots=0))
    assert result.code == 0


def test_events_of_jobs_that_nobody_asked_for_are_ignored(tmp_path: Path) -> None:
    class Noisy(Scripted):
        def events(self, patience: float) -> Sequence[Event]:
            return [Ended("stranger", ending()), *super().events(patience)]

    assert [result.code for result in flown(plan_of(tmp_path, job()), executor=Noisy({}))] == [0]


def test_success_without_a_checkpoint_is_no_success(tmp_path: Path) -> None:
    class Forgetful(Scripted):
        def events(self, patience: float) -> Sequence[Event]:
            events = super().events(patience)
            (tmp_path / "oval.h5").unlink(missing_ok=True)
            return events

    (result,) = flown(plan_of(tmp_path, job()), executor=Forgetful({}))
    assert (result.code, result.message) == (8, "its checkpoint is missing")


def test_a_disk_that_takes_no_records_costs_no_other_job(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write = supervision.write_record

    def refuse_one(folder: Path, name: str, record: object) -> None:
        if name == "full":
            raise StorageError("cannot write full.json: No space left on device")
        write(folder, name, record)  # type: ignore[arg-type]

    monkeypatch.setattr(supervision, "write_record", refuse_one)
    results = flown(plan_of(tmp_path, job("full"), job("fine")), executor=Scripted({}))
    assert [result.code for result in results] == [8, 0]
    assert "No space left" in results[0].message
