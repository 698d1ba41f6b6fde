"""The report opened in a browser: it fits any screen, and paper, and is harmless whatever it shows."""

import re
from collections.abc import Callable
from pathlib import Path

import pytest
from browser_pages import SIZES, opened
from playwright.sync_api import Browser
from report_pages import HOSTILE, renamed

from airrace.report.flight_page import flight_page

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("size", SIZES)
def test_the_page_fits_its_screen_without_errors_and_asks_for_nothing(
    chromium: Browser, folder: Path, artefacts: Path, size: str
) -> None:
    one = opened(chromium, folder / "report.html", size, has_touch=size != "laptop")
    one.drawn()
    one.page.screenshot(path=artefacts / f"page_{size}.png", full_page=True)
    across = one.run("() => [document.documentElement.scrollWidth, innerWidth]")
    assert across[0] <= across[1]
    assert one.errors == []
    assert [address for address in one.asked if not address.startswith("data:")] == []
    one.page.context.close()


def test_a_dark_system_gets_a_dark_page_and_the_button_changes_it(chromium: Browser, folder: Path) -> None:
    one = opened(chromium, folder / "report.html", color_scheme="dark")
    assert one.run("() => document.documentElement.dataset.theme") == "dark"
    one.page.click("#theme")
    assert one.run("() => document.documentElement.dataset.theme") == "light"
    assert one.errors == []
    one.page.context.close()


def test_on_paper_there_are_pictures_instead_of_the_scene(chromium: Browser, folder: Path, artefacts: Path) -> None:
    one = opened(chromium, folder / "report.html", color_scheme="dark")
    one.run("() => addEventListener('beforeprint', () => { window.theme = document.documentElement.dataset.theme; })")
    one.run(
        """() => addEventListener('beforeprint', () => {
          window.pictures = [...document.querySelectorAll('#pictures img')].map(one => one.src.length);
          window.told = document.querySelector('#pictures').innerText;
        })"""
    )
    one.page.pdf(path=artefacts / "printed.pdf", format="A4", print_background=True)
    assert (artefacts / "printed.pdf").stat().st_size > 100_000
    pictures = one.run("() => window.pictures")
    assert len(pictures) == 3
    assert min(pictures) > 10_000
    told = one.run("() => window.told")
    assert re.search(r"above, \d+ m wide; the aircraft at 0\.00 s", told)
    assert re.search(r"orbit, grid \d+ m; the aircraft at 0\.00 s", told)
    assert re.search(r"Load factor from .*\d to \d+\.\d g", told)
    assert one.run("() => window.theme") == "light"
    assert one.run("() => document.documentElement.dataset.theme") == "dark"
    assert one.page.locator("#pictures img").count() == 0
    one.page.emulate_media(media="print")
    assert not one.page.is_visible("#scene")
    assert not one.page.is_visible("#transport")
    assert one.page.is_visible("#tables")
    assert one.errors == []
    one.page.context.close()


@pytest.mark.parametrize("number", range(len(HOSTILE)))
def test_hostile_names_are_shown_and_nothing_is_executed(chromium: Browser, tmp_path: Path, number: int) -> None:
    flight = renamed(HOSTILE[number])
    page = tmp_path / "hostile.html"
    page.write_text(flight_page([flight, flight.labelled(f"{flight.label} too")]).as_html(), encoding="utf-8")
    one = opened(chromium, page, "tablet")
    assert one.run("() => document.querySelector('h1').textContent") == HOSTILE[number]
    assert one.run("() => document.title") == " ".join(HOSTILE[number].split())
    assert one.run("() => 'hacked' in window") is False
    assert one.run("() => [document.scripts.length, document.images.length]") == [2, 0]
    across = one.run("() => [document.documentElement.scrollWidth, innerWidth]")
    assert across[0] <= across[1]
    assert one.errors == []
    one.page.context.close()


def test_without_space_the_course_from_above_stands_in(launch: Callable[..., Browser], folder: Path) -> None:
    browser = launch("--disable-3d-apis")
    one = opened(browser, folder / "report.html")
    assert one.page.is_visible(".plan svg")
    assert not one.page.is_visible("#scene")
    one.set(3.0)
    assert one.page.inner_text("#transport .time") == "3.00"
    assert one.page.locator("#strips figure").count() > 8
    browser.close()
