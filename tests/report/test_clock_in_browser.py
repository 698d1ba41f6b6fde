"""The clock of the report in a browser: all of the page shows one instant, whoever sets it."""

import numpy as np
import pytest
from browser_pages import READY_MS, VIEWS, Opened
from example_flights import half_cuban, windy

pytestmark = pytest.mark.slow


def test_the_ghost_is_behind_by_what_the_comparison_says(laptop: Opened) -> None:
    compared = half_cuban().compare(windy())
    times = [0.0, *np.cumsum([leg.before for leg in compared.legs])]
    expected = [0.0, *(leg.cumulative for leg in compared.legs)]
    read = laptop.run(
        """times => times.map(time => {
          airrace.clock.set(time);
          return Number(airrace.strips.strips[0].values[0].textContent.replace('\\u2212', '-'));
        })""",
        times,
    )
    assert laptop.run("() => airrace.strips.strips[0].told.title") == "Difference of time"
    # The strip shows milliseconds, at the sample before.
    assert read == pytest.approx(expected, abs=0.01)


def test_two_flights_are_on_one_clock(laptop: Opened) -> None:
    laptop.set(4.0)
    laptop.drawn()
    ghost = laptop.run("() => airrace.scene.actors[1].model.position.toArray()")
    flight = windy().flight().at([4.0])
    assert ghost == pytest.approx([flight["y"][0], flight["height"][0], -flight["x"][0]], abs=0.01)


def test_keys_play_step_jump_and_change_the_view(laptop: Opened) -> None:
    laptop.page.locator("body").click(position={"x": 3, "y": 3})
    laptop.set(1.0)
    press = laptop.page.keyboard.press
    press("ArrowRight")
    assert laptop.seconds == pytest.approx(1.1)
    press("Shift+ArrowLeft")
    assert laptop.seconds == pytest.approx(0.1)
    press("End")
    assert laptop.seconds == pytest.approx(half_cuban().race_time, abs=1e-4)
    press("Home")
    assert laptop.seconds == 0.0
    for number, view in enumerate(VIEWS, start=1):
        press(str(number))
        assert laptop.page.get_attribute(f"button[data-view={view}]", "aria-pressed") == "true"
    laptop.page.focus("canvas")
    press("ArrowDown")
    assert laptop.seconds == pytest.approx(half_cuban().splits[1].time, abs=1e-4)
    press("ArrowUp")
    assert laptop.seconds == 0.0


def test_the_space_bar_plays_after_a_button_was_clicked(laptop: Opened) -> None:
    laptop.set(1.0)
    laptop.page.click("button[data-view=orbit]")
    laptop.page.keyboard.press("Space")
    assert laptop.run("() => airrace.clock.running") is True
    laptop.page.keyboard.press("Space")
    assert laptop.run("() => airrace.clock.running") is False


def test_play_runs_at_the_speed_that_is_chosen_and_stops_at_the_end(laptop: Opened) -> None:
    laptop.page.locator("body").click(position={"x": 3, "y": 3})
    laptop.page.select_option("#transport select", "0.5")
    laptop.page.evaluate("() => document.activeElement.blur()")
    laptop.set(0.0)
    laptop.run("() => { window.began = performance.now(); }")
    laptop.page.keyboard.press("Space")
    laptop.page.wait_for_function("() => airrace.clock.time > 0.2", timeout=READY_MS)
    laptop.page.keyboard.press("Space")
    reached, took = laptop.seconds, 1e-3 * laptop.run("() => performance.now() - window.began")
    assert laptop.run("() => airrace.clock.running") is False
    # Frames that come late are cut off, so a busy machine plays slower, never faster.
    assert reached <= 0.5 * took + 0.1
    laptop.page.select_option("#transport select", "4")
    laptop.set(half_cuban().race_time - 0.2)
    laptop.page.click("[data-play]")
    laptop.page.wait_for_function("() => !airrace.clock.running", timeout=READY_MS)
    assert laptop.seconds == pytest.approx(laptop.run("() => airrace.clock.duration"))
    laptop.page.select_option("#transport select", "1")


def test_a_leg_is_jumped_to_and_marked(laptop: Opened) -> None:
    laptop.page.click("tr[data-passing='2'] button")
    assert laptop.seconds == pytest.approx(half_cuban().splits[2].time, abs=1e-3)
    assert laptop.page.get_attribute("tr[data-passing='2']", "aria-current") == "true"
    assert laptop.page.locator("tr[aria-current]").count() == 1


def test_a_click_on_a_strip_sets_the_clock(laptop: Opened) -> None:
    plot = laptop.page.locator("#strips .u-over").nth(2)
    plot.scroll_into_view_if_needed()
    box = plot.bounding_box()
    assert box is not None
    laptop.page.mouse.click(box["x"] + 0.5 * box["width"], box["y"] + 20.0)
    assert laptop.seconds == pytest.approx(0.5 * laptop.run("() => airrace.strips.duration"), abs=0.1)


def test_a_leg_alone_is_shown_in_the_strips(laptop: Opened) -> None:
    laptop.set(4.0)
    laptop.page.select_option("[data-window]", "leg")
    low, high = laptop.run("() => ['min', 'max'].map(end => airrace.strips.strips[1].plot.scales.x[end])")
    splits = half_cuban().splits
    assert (low, high) == pytest.approx((splits[1].time - 0.4, splits[2].time + 0.4), abs=1e-3)
    laptop.page.select_option("[data-window]", "race")


def test_every_strip_has_three_numbers_along_its_axis(laptop: Opened) -> None:
    """With fewer it cannot be read."""
    numbers = laptop.run(
        "() => airrace.strips.strips.map(({ told, plot }) => [told.title, plot.axes[1]._values.length])"
    )
    assert [title for title, count in numbers if count < 3] == []


def test_numbers_over_the_scene_are_those_of_the_instant(laptop: Opened) -> None:
    laptop.set(3.0)
    flight = half_cuban().flight().at([3.0])
    height = laptop.page.inner_text("[data-history=height]")
    assert float(height) == pytest.approx(float(flight["height"][0]), abs=0.51)
