"""An aircraft's session solves the latest request alone, loses nothing that its threads write, and ends with them."""

import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from airrace.design import solving
from airrace.design.designer import Designer
from airrace.design.solving import AircraftSession, LayoutRequest
from airrace.design.track_file import TrackFile
from airrace.procedure.result import Progress
from airrace.procedure.stage import Stage


def test_a_run_from_scratch_is_broken_off_by_a_newer_request(track: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    begun, given_up, finished = threading.Semaphore(0), threading.Event(), list[object]()

    def execute(plan: object, *, threads: int, progress: Progress) -> Iterator[None]:
        progress.stage_started(Stage.POINT_MASS)
        begun.release()
        while not given_up.wait(0.01):
            progress.activity("a phase", 0, 0)
        finished.append(plan)
        yield

    monkeypatch.setattr(solving, "execute", execute)
    session, document = AircraftSession(None, lambda: None), TrackFile(track).document
    for revision in range(3):
        session.submit(LayoutRequest(revision, document, ()))
        assert begun.acquire(timeout=20.0)
    session.close()
    given_up.set()
    assert not finished
    assert not session.result().get("problem")


def test_the_threads_end_with_the_session(track: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    begun = threading.Event()

    def execute(plan: object, *, threads: int, progress: Progress) -> Iterator[None]:
        progress.stage_started(Stage.POINT_MASS)
        begun.set()
        while True:
            time.sleep(0.01)
            progress.activity("a phase", 0, 0)
        yield

    monkeypatch.setattr(solving, "execute", execute)
    before = set(threading.enumerate())
    session = AircraftSession(None, lambda: None)
    session.submit(LayoutRequest(0, TrackFile(track).document, ()))
    session.submit_six_dof()
    assert begun.wait(20.0)
    threads = set(threading.enumerate()) - before
    assert threads
    session.close()
    for thread in threads:
        thread.join(20.0)
        assert not thread.is_alive()


def test_a_session_that_is_closed_takes_no_more_requests(track: Path) -> None:
    session, document = AircraftSession(None, lambda: None), TrackFile(track).document
    before = set(threading.enumerate())
    session.close()
    session.submit(LayoutRequest(1, document, ()))
    session.submit_six_dof()
    assert set(threading.enumerate()) <= before
    assert session._request is None


def test_an_error_after_the_end_is_nobodys_concern(track: Path, caplog: pytest.LogCaptureFixture) -> None:
    session = AircraftSession(None, lambda: None)

    def fail() -> None:
        raise RuntimeError("cannot schedule new futures after interpreter shutdown")

    session._guard(fail)
    assert "the layout cannot be solved" in caplog.text
    caplog.clear()
    session.close()
    session._guard(fail)
    assert not caplog.text


def test_no_change_that_one_of_several_threads_shows_is_lost(still: Designer, track: Path) -> None:
    session = AircraftSession(None, still._raise_version)
    session._request = LayoutRequest(0, TrackFile(track).document, ())
    count, version = 2000, still.version

    def show(name: str) -> None:
        for number in range(count):
            session._show(**{name: number})

    threads = [threading.Thread(target=show, args=(name,)) for name in "abcd"]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert still.version == version + 4 * count
    assert [session.result()[name] for name in "abcd"] == 4 * [count - 1]
    session.close()
