"""A lane answers the latest question alone."""

import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from airrace.design import solving
from airrace.design.designer import TrackFile
from airrace.design.solving import Lane, Question
from airrace.procedure.result import Progress
from airrace.procedure.stage import Stage


def test_a_run_from_scratch_is_broken_off_by_a_newer_question(track: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    begun, given_up, finished = threading.Semaphore(0), threading.Event(), list[object]()

    def execute(plan: object, *, threads: int, progress: Progress) -> Iterator[None]:
        progress.stage_started(Stage.POINT_MASS)
        begun.release()
        while not given_up.wait(0.01):
            progress.activity("a phase", 0, 0)
        finished.append(plan)
        yield

    monkeypatch.setattr(solving, "execute", execute)
    lane, document = Lane(None, lambda: None), TrackFile(track).document
    for revision in range(3):
        lane.ask(Question(revision, document, ()))
        assert begun.acquire(timeout=20.0)
    lane.close()
    given_up.set()
    assert not finished
    assert "problem" not in lane.shown or not lane.shown["problem"]
