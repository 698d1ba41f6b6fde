"""The live graphic in a browser: what lies over the picture, through silence and a server that ends."""

import io
import time
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from example_flights import half_cuban, windy
from PIL import Image
from playwright.sync_api import Browser, Page

from airrace.flights.results import Entrant
from airrace.pages.report.film import Language
from airrace.runs.overlay import Overlay, served

pytestmark = pytest.mark.slow
WIDTH, HEIGHT = 960, 540
SETTLED = """([clock, old]) => {
  const { shown, received } = airrace;
  return Math.abs(shown?.clock - clock) < 1e-6 && (shown.age + (performance.now() - received) / 1000 > 2) === old;
}"""

ADA = Entrant("Ada Bee", "SUI", "7")


class Flown:
    """The second example as it is heard, at a clock that is set."""

    def __init__(self, language: Language = Language.EN, entrant: Entrant = ADA) -> None:
        self.now = 1000.0
        self.flight = windy().flight()
        self.overlay = Overlay([half_cuban().flight()], entrant, language, 0.0, lambda: self.now)

    def fly(self, clock: float) -> None:
        """Hear the state at a clock, and no more."""
        self.now += 1000.0
        state = self.flight.at([clock])
        values = {name: float(state[name][0]) for name in ("x", "y", "z", "V_K", "q0", "q1", "q2", "q3", "n_z")}
        passings = [crossing.time for crossing in self.flight.crossings if crossing.time <= clock]
        self.overlay.hear(clock, clock, values, passings)


@pytest.fixture
def page(chromium: Browser) -> Iterator[Page]:
    one = chromium.new_page(viewport={"width": WIDTH, "height": HEIGHT})
    errors: list[str] = []
    one.on("pageerror", lambda error: errors.append(str(error)))
    yield one
    assert errors == []
    one.close()


def pixels(page: Page) -> Any:  # Any: an array of bytes
    """Red, green, blue and alpha of what is shown."""
    with Image.open(io.BytesIO(page.screenshot(omit_background=True))) as picture:
        return np.asarray(picture.convert("RGBA"))


def settle(page: Page, clock: float, *, old: bool = False) -> Any:  # Any: as above
    page.wait_for_function(SETTLED, arg=[clock, old])
    time.sleep(0.2)  # it is drawn after it is known
    return pixels(page)


def shown(page: Page, flown: Flown, clock: float, query: str = "") -> Any:  # Any: as above
    flown.fly(clock)
    with served(flown.overlay, 0) as address:
        page.goto(address + query)
        return settle(page, clock)


TOWER = np.s_[20:160, 20:200]
CORNER = np.s_[20:55, 780:940]
"""The upper right, where it is told that nothing is heard."""


def test_there_is_nothing_but_the_graphics_and_they_are_those_of_a_film(page: Page) -> None:
    flown = Flown()
    seen = shown(page, flown, 3.0)
    alpha = seen[..., 3]
    assert (alpha[200:350] == 0).all()  # between the graphics above and below
    assert (alpha == 0).mean() > 0.7
    assert 0.05 < (alpha > 180).mean() < 0.3
    assert (alpha[TOWER] == 255).mean() > 0.01  # letters
    assert page.evaluate("() => airrace.contents.live.label") == "Ada Bee"
    made = page.evaluate("() => airrace.shown.passings.filter(({ time }) => time !== null).length")
    assert made == sum(crossing.time <= 3.0 for crossing in flown.flight.crossings)


def test_over_a_key_colour_nothing_takes_it_on(page: Page) -> None:
    key = np.array([0, 255, 0], float)
    seen = shown(page, Flown(), 3.0, "?key=00ff00")
    assert (seen[..., 3] == 255).all()
    colours = seen[..., :3].astype(float)
    assert (np.abs(colours - key).max(axis=-1) <= 2).mean() > 0.7
    greenish = (colours[..., 1] > colours[..., 0] + 60) & (colours[..., 1] > colours[..., 2] + 60)
    assert (greenish & (np.abs(colours - key).max(axis=-1) > 2)).mean() < 5e-3  # the bar of the load factor alone


def test_silence_is_told_and_ends_by_itself(page: Page) -> None:
    flown = Flown()
    flown.fly(3.0)
    with served(flown.overlay, 0) as address:
        page.goto(address)
        fresh = settle(page, 3.0)
        assert (fresh[CORNER][..., 3] == 0).all()
        flown.now += 60.0
        old = settle(page, 3.5, old=True)
        assert (old[CORNER][..., 3] > 0).mean() > 0.5
        assert (old[TOWER][..., 3] == fresh[TOWER][..., 3]).mean() > 0.95  # what is known stays
        flown.fly(4.0)
        assert (settle(page, 4.0)[CORNER][..., 3] == 0).all()


def test_a_page_outlives_its_server_and_shows_the_state_at_once_when_it_is_loaded_again(page: Page) -> None:
    flown = Flown()
    flown.fly(3.0)
    with served(flown.overlay, 0) as address:
        page.goto(address)
        settle(page, 3.0)
        page.reload()
        settle(page, 3.0)
    port = int(address.split(":")[-1].strip("/"))
    settle(page, 3.0, old=True)
    with served(flown.overlay, port):
        flown.fly(5.0)
        assert (settle(page, 5.0)[CORNER][..., 3] == 0).all()
    anew = Flown()
    with served(anew.overlay, port):  # one that has not seen the start
        settle(page, 5.0, old=True)
        anew.fly(1.0)
        settle(page, 1.0)
    other = Flown(Language.DE, Entrant("Bo"))
    other.fly(6.0)
    with served(other.overlay, port):  # it shows others
        page.wait_for_function("() => airrace.contents.live.label === 'Bo'")
        settle(page, 6.0)
        assert page.evaluate("() => airrace.contents.broadcast.decimal") == ","


def test_after_the_finish_the_result_stands_without_getting_old(page: Page) -> None:
    flown = Flown()
    flown.fly(float(flown.flight.race_time))
    flown.now += 60.0
    with served(flown.overlay, 0) as address:
        page.goto(address)
        seen = settle(page, flown.flight.race_time + 0.5, old=True)
    assert (seen[CORNER][..., 3] == 0).all()
    assert page.evaluate("() => airrace.shown.race_time") == pytest.approx(flown.flight.race_time)
