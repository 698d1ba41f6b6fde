"""A designer of a short course; its sessions solve nothing unless a test asks for real ones."""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from three_gates import COURSE

from airrace.design import designer
from airrace.design.designer import Designer
from airrace.errors import UsageError


class IdleSession:
    """A session that only notes its requests."""

    def __init__(self, aircraft: str | None, notify: Callable[[], None]) -> None:
        self.aircraft = aircraft
        self.requests: list[object] = []

    def submit(self, request: object) -> None:
        self.requests.append(request)

    def result(self) -> dict[str, object]:
        return {"aircraft": self.aircraft}

    def scene(self) -> str:
        raise UsageError("there is no flight yet")

    def close(self) -> None: ...


@pytest.fixture
def track(tmp_path: Path) -> Path:
    folder = tmp_path / "courses"
    folder.mkdir()
    (folder / "course.yaml").write_text(COURSE, encoding="utf-8")
    return folder / "course.yaml"


@pytest.fixture
def still(track: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Designer]:
    monkeypatch.setattr(designer, "AircraftSession", IdleSession)
    made = Designer(track)
    yield made
    made.close()
