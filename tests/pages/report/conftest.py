"""Browsers and pages for the tests of reports, of the flights in `tests/support/example_flights.py`.

Pictures of every view are kept in the folder that the environment variable `AIRRACE_ARTEFACTS` names, for people.
"""

import os
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from browser_pages import SOFTWARE, Opened, browser_path, opened
from playwright.sync_api import Browser, sync_playwright


@pytest.fixture(scope="module")
def launch() -> Iterator[Callable[..., Browser]]:
    """Starts a browser with further switches. Without its sandbox it runs in containers, too; it opens nothing but the
    pages of these tests."""
    path = browser_path()
    with sync_playwright() as playwright:
        yield lambda *switches: playwright.chromium.launch(executable_path=path, args=["--no-sandbox", *switches])


@pytest.fixture(scope="module")
def chromium(launch: Callable[..., Browser]) -> Iterator[Browser]:
    browser = launch(*SOFTWARE)
    yield browser
    browser.close()


@pytest.fixture(scope="module")
def artefacts(tmp_path_factory: pytest.TempPathFactory) -> Path:
    named = os.environ.get("AIRRACE_ARTEFACTS")
    folder = Path(named) if named else tmp_path_factory.mktemp("artefacts")
    folder.mkdir(parents=True, exist_ok=True)
    return folder


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two runs, the second in a wind, and a report of both."""
    from example_flights import half_cuban, windy  # found only since its folder is on the path, see above

    place = tmp_path_factory.mktemp("report")
    half_cuban().save(place / "still.h5")
    windy().save(place / "windy.h5")
    half_cuban().report(place / "report.html", str(place / "windy.h5"))
    return place


@pytest.fixture(scope="module")
def laptop(chromium: Browser, folder: Path) -> Iterator[Opened]:
    """The report on a laptop, for tests that leave it as they find it."""
    one = opened(chromium, folder / "report.html")
    yield one
    assert one.errors == []
    assert [address for address in one.asked if not address.startswith("data:")] == []
    one.page.context.close()
