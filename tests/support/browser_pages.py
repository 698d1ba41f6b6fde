"""Pages opened in headless Chromium without a network, and what is asked of them there."""

import os
import shutil
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser, Page

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
SOFTWARE = ("--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist")
"""Pictures in space are drawn by the processor: a test machine need not have a graphics card."""
SIZES = {"laptop": (1500, 950), "tablet": (820, 1180), "phone": (390, 844)}
VIEWS = ("orbit", "above", "side", "chase", "cockpit", "tv")
TIMES = (0.0, 1.7, 3.338, 5.9, 8.6)
READY_MS = 120_000


def browser_path() -> str:
    """A browser's path; without one the test is skipped, or fails where `AIRRACE_TEST_BROWSER` is `required`."""
    found = next((path for name in BROWSERS if (path := shutil.which(name))), None)
    if found is None:
        missing = f"no browser is installed that could open the page; looked for {', '.join(BROWSERS)}"
        (pytest.fail if os.environ.get("AIRRACE_TEST_BROWSER") == "required" else pytest.skip)(missing)
    return found


def gate_runs(values: Iterable[object], chosen: object) -> list[Any]:
    """Values of a parameter, of which the fast tests run the chosen one alone. Any: as pytest has them."""
    return [pytest.param(one, marks=pytest.mark.representative) if one == chosen else one for one in values]


@dataclass
class Opened:
    """A page in the browser, and all that went wrong in it.

    Attributes:
        errors: what its console said of errors, exceptions, violations of its policy.
        asked: addresses that it asked for, itself aside.
    """

    page: Page
    errors: list[str] = field(default_factory=list)
    asked: list[str] = field(default_factory=list)

    def run(self, program: str, argument: object = None) -> Any:
        """The value of a program in the page. Any: it is whatever the program returns."""
        return self.page.evaluate(program, argument)

    def set(self, seconds: float) -> None:
        self.run("t => airrace.clock.set(t)", seconds)

    @property
    def seconds(self) -> float:
        return float(self.run("() => airrace.clock.time"))

    def drawn(self) -> None:
        """Wait until the scene has drawn what was asked of it."""
        self.run("() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")


ACROSS = {"across": (844, 390)}
"""A phone held across."""


def opened(browser: Browser, file: Path, size: str = "laptop", **options: Any) -> Opened:
    """A page with its network cut. Any: the options are playwright's."""
    width, height = {**SIZES, **ACROSS}[size]
    context = browser.new_context(viewport={"width": width, "height": height}, offline=True, **options)
    one = Opened(context.new_page())
    one.page.set_default_timeout(READY_MS)
    one.page.on("console", lambda said: one.errors.append(said.text) if said.type == "error" else None)
    one.page.on("pageerror", lambda error: one.errors.append(str(error)))
    address = f"file://{file}"
    one.page.on("request", lambda asked: None if asked.url == address else one.asked.append(asked.url))
    one.page.goto(address)
    one.page.wait_for_selector("html.ready", state="attached")
    return one
