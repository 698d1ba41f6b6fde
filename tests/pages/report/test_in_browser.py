"""The report opened in a browser: it fits any screen, and paper, and is harmless whatever it shows."""

import re
from collections.abc import Callable
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest
from browser_pages import READY_MS, SIZES, TIMES, VIEWS, Opened, gate_runs, opened
from example_flights import half_cuban, windy
from playwright.sync_api import Browser
from report_pages import HOSTILE, everything_flown, labelled, renamed

import airrace
from airrace.flights.results.comparison import compare_flights
from airrace.model.frames import rotation
from airrace.pages.report.flight_page import flight_page

pytestmark = pytest.mark.slow

CUT_OFF = """() => [...document.querySelectorAll("main *, .mast *")]
  .filter((one) => !one.closest("svg, select, .scene") && one.clientWidth > 0)
  .filter((one) => getComputedStyle(one).overflowX !== "visible")
  .filter((one) => one.scrollWidth > one.clientWidth + 1 || one.scrollHeight > one.clientHeight + 1)
  .map((one) => `${one.tagName}.${one.className}`)"""
"""What hides a part of what it holds, or shows it only to whoever scrolls there."""


@pytest.mark.parametrize("size", gate_runs(SIZES, "phone"))
def test_the_page_fits_its_screen_without_errors_and_asks_for_nothing(
    chromium: Browser, folder: Path, artefacts: Path, size: str
) -> None:
    one = opened(chromium, folder / "report.html", size, has_touch=size != "laptop")
    one.drawn()
    one.page.screenshot(path=artefacts / f"page_{size}.png", full_page=True)
    across = one.run("() => [document.documentElement.scrollWidth, innerWidth]")
    assert across[0] <= across[1]
    assert one.run(CUT_OFF) == []
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


@pytest.mark.representative
def test_on_paper_there_are_pictures_instead_of_the_scene(chromium: Browser, folder: Path, artefacts: Path) -> None:
    one = opened(chromium, folder / "report.html", color_scheme="dark")
    one.run("() => addEventListener('beforeprint', () => { window.theme = document.documentElement.dataset.theme; })")
    one.run(
        """() => addEventListener('beforeprint', () => {
          window.pictures = [...document.querySelectorAll('#pictures img')].map(one => one.src.length);
          window.printed = document.querySelector('#pictures').innerText;
        })"""
    )
    one.page.pdf(path=artefacts / "printed.pdf", format="A4", print_background=True)
    assert (artefacts / "printed.pdf").stat().st_size > 100_000
    pictures = one.run("() => window.pictures")
    assert len(pictures) == 3
    assert min(pictures) > 10_000
    printed = one.run("() => window.printed")
    assert re.search(r"above, \d+ m wide; the aircraft at 0\.00 s", printed)
    assert re.search(r"orbit, grid \d+ m; the aircraft at 0\.00 s", printed)
    assert re.search(r"Load factor from .*\d to \d+\.\d g", printed)
    assert one.run("() => window.theme") == "light"
    assert one.run("() => document.documentElement.dataset.theme") == "dark"
    assert one.page.locator("#pictures img").count() == 0
    one.page.emulate_media(media="print")
    assert not one.page.is_visible("#scene")
    assert not one.page.is_visible("#transport")
    assert one.page.is_visible("#tables")
    assert one.errors == []
    one.page.context.close()


@pytest.mark.parametrize("number", gate_runs(range(len(HOSTILE)), 0))
def test_hostile_names_are_shown_and_nothing_is_executed(chromium: Browser, tmp_path: Path, number: int) -> None:
    flight = renamed(HOSTILE[number])
    page = tmp_path / "hostile.html"
    page.write_text(flight_page([flight, labelled(flight, f"{flight.label} too")]), encoding="utf-8")
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


@pytest.mark.representative
def test_the_ghost_is_behind_by_what_the_comparison_says(laptop: Opened) -> None:
    compared = half_cuban().compare(windy())
    times = [0.0, *np.cumsum([leg.reference.time for leg in compared.legs])]
    expected = [0.0, *(leg.cumulative for leg in compared.legs)]
    read = laptop.run(
        """times => times.map(time => {
          airrace.clock.set(time);
          return Number(airrace.strips.strips[0].values[0].textContent.replace('\\u2212', '-'));
        })""",
        times,
    )
    assert laptop.run("() => airrace.strips.strips[0].quantity.title") == "Difference of time"
    # The strip shows milliseconds, at the sample before.
    assert read == pytest.approx(expected, abs=0.01)


def test_two_flights_are_on_one_clock(laptop: Opened) -> None:
    laptop.set(4.0)
    laptop.drawn()
    ghost = laptop.run("() => airrace.scene.actors[1].model.position.toArray()")
    flight = windy().flight().at([4.0])
    assert ghost == pytest.approx([flight["y"][0], flight["height"][0], -flight["x"][0]], abs=0.01)


@pytest.mark.representative
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


@pytest.mark.representative
def test_a_leg_is_jumped_to_and_marked(laptop: Opened) -> None:
    laptop.page.click("tr[data-passing='2'] button")
    assert laptop.seconds == pytest.approx(half_cuban().splits[2].time, abs=1e-3)
    assert laptop.page.get_attribute("tr[data-passing='2']", "aria-current") == "true"
    assert laptop.page.locator("tr[aria-current]").count() == 1


@pytest.mark.representative
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


@pytest.mark.representative
def test_histories_over_distance_are_those_at_the_same_place(laptop: Opened) -> None:
    """At a gate of the first flight the other one is shown where it passes that gate, and the cursor stands there."""
    laptop.page.select_option("[data-axis]", "distance")
    compared = compare_flights(half_cuban().flight(), windy().flight())
    passing = compared.flight.crossings[2]
    laptop.set(half_cuban().splits[2].time)
    place, ends, shown = laptop.run(
        """() => {
          const { strips, axis } = airrace.strips;
          const strip = strips.find(({ quantity }) => quantity.title === "Height");
          const { min, max } = strip.plot.scales.x;
          return [axis.at(airrace.clock.time), [min, max], strip.values[1].textContent];
        }"""
    )
    assert place == pytest.approx(compared.progress.passings[2], rel=1e-4)
    assert ends == pytest.approx([0.0, compared.progress.passings[-1]], rel=1e-4, abs=0.01)
    assert float(shown) == pytest.approx(passing.value("height"), abs=0.6)
    plot = laptop.page.locator("#strips .u-over").nth(2)
    plot.scroll_into_view_if_needed()
    box = plot.bounding_box()
    assert box is not None
    laptop.page.mouse.click(box["x"] + 0.5 * box["width"], box["y"] + 20.0)
    assert laptop.run("() => airrace.strips.axis.at(airrace.clock.time)") == pytest.approx(0.5 * ends[1], rel=0.01)
    laptop.page.select_option("[data-axis]", "time")


@pytest.mark.representative
def test_a_zoom_is_that_of_strips_map_and_scene(laptop: Opened) -> None:
    laptop.set(5.0)
    seen = """() => {
      const norths = airrace.scene.views.get("above").points.map(({ z }) => z);
      return [Math.max(...norths) - Math.min(...norths), airrace.maps[0].svg.getAttribute("viewBox")];
    }"""
    extent, box = laptop.run(seen)
    laptop.page.click("[data-zoom='0.5']")
    low, high = laptop.run("() => ['min', 'max'].map(end => airrace.strips.strips[1].plot.scales.x[end])")
    assert high - low == pytest.approx(0.5 * laptop.run("() => airrace.clock.duration"), rel=1e-6)
    assert low < 5.0 < high
    assert laptop.page.input_value("[data-window]") == "free"
    smaller_extent, smaller_box = laptop.run(seen)
    assert smaller_extent < extent
    assert float(smaller_box.split()[2]) < float(box.split()[2])
    laptop.page.select_option("[data-window]", "race")
    assert laptop.run(seen) == [extent, box]


@pytest.mark.representative
def test_a_click_on_the_map_of_the_losses_leads_to_that_place(laptop: Opened) -> None:
    """There the first flight is as near to the click as the thickness of the line, wherever the other one flies."""
    laptop.page.locator(".map svg").scroll_into_view_if_needed()
    for share in (0.2, 0.6):
        x, y, expected = laptop.run(
            """share => {
              const [map] = airrace.maps, [coloured] = map.shown, flight = map.flights[coloured];
              const time = share * flight.duration, pair = map.pairs.get(coloured);
              const [x, y] = map.place(flight, time);
              const at = new DOMPoint(x, y).matrixTransform(map.svg.getScreenCTM());
              return [at.x, at.y, pair ? pair.back(time) : time];
            }""",
            share,
        )
        laptop.set(expected + 0.3)  # the course leads to the same places again
        laptop.page.mouse.click(x, y)
        assert laptop.seconds == pytest.approx(expected, abs=0.1)


def test_every_strip_has_three_numbers_along_its_axis(laptop: Opened) -> None:
    """With fewer it cannot be read."""
    numbers = laptop.run(
        "() => airrace.strips.strips.map(({ quantity, plot }) => [quantity.title, plot.axes[1]._values.length])"
    )
    assert [title for title, count in numbers if count < 3] == []


@pytest.mark.representative
def test_numbers_over_the_scene_are_those_of_the_instant(laptop: Opened) -> None:
    laptop.set(3.0)
    flight = half_cuban().flight().at([3.0])
    height = laptop.page.inner_text("[data-history=height]")
    assert float(height) == pytest.approx(float(flight["height"][0]), abs=0.51)


@pytest.mark.parametrize("seconds", gate_runs(TIMES, 3.338))
def test_the_aircraft_is_where_the_file_has_it_and_lies_as_the_file_has_it(
    laptop: Opened, folder: Path, seconds: float
) -> None:
    """At the node of the mesh nearest to each time; in calm air the angles of the flow turn the body from its path."""
    flown = airrace.open(folder / "still.h5").stage()
    histories, nodes = flown.trajectory, flown.trajectory.time
    node = int(np.abs(nodes - seconds).argmin())
    x, y, z, *q = (float(histories[name][node]) for name in ("x", "y", "z", "q0", "q1", "q2", "q3"))
    laptop.set(float(nodes[node]))
    laptop.drawn()
    place, nose, wing = laptop.run(
        """() => {
          const { model } = airrace.scene.actors[0];
          model.updateMatrixWorld(true);
          const { elements } = model.matrixWorld;
          const axis = column => elements.slice(4 * column, 4 * column + 3).map(e => e / model.scale.x);
          return [model.position.toArray(), axis(0), axis(1)];
        }"""
    )
    assert place == pytest.approx([y, -z, -x], abs=1e-3)
    flight = flown.flight().at([nodes[node]])
    alpha, beta = (float(flight[name][0]) for name in ("alpha_A", "beta_A"))
    nose_kbar = [np.cos(alpha) * np.cos(beta), -np.cos(alpha) * np.sin(beta), -np.sin(alpha)]
    wing_kbar = [np.sin(beta), np.cos(beta), 0.0]
    for seen, expected in ((nose, nose_kbar), (wing, wing_kbar)):
        north, east, down = np.array(rotation(q)) @ expected
        assert seen == pytest.approx([east, -down, -north], abs=1e-5)


def test_a_flight_is_hidden_and_shown_by_its_box(laptop: Opened) -> None:
    laptop.page.uncheck('input[data-flight="1"]')
    laptop.drawn()
    assert laptop.run("() => airrace.scene.actors[1].model.visible") is False
    laptop.page.check('input[data-flight="1"]')
    laptop.drawn()
    assert laptop.run("() => airrace.scene.actors[1].model.visible") is True


@pytest.mark.parametrize("view", gate_runs(VIEWS, "orbit"))
def test_every_view_shows_a_picture(laptop: Opened, artefacts: Path, view: str) -> None:
    """Kept for people to look at; a machine can say that it is no empty canvas."""
    laptop.set(5.0)
    laptop.page.click(f"button[data-view={view}]")
    laptop.drawn()
    path = artefacts / f"view_{view}.png"
    laptop.page.locator("#scene").screenshot(path=path)
    picture = matplotlib.image.imread(path)
    assert len(np.unique((picture[..., :3] * 255).astype(np.uint8).reshape(-1, 3), axis=0)) > 200
    assert laptop.page.get_attribute(f"button[data-view={view}]", "aria-pressed") == "true"


def test_views_from_behind_and_from_the_seat_follow_the_aircraft(laptop: Opened) -> None:
    for view, nearest, farthest in (("chase", 15.0, 40.0), ("cockpit", 0.0, 2.0)):
        laptop.page.click(f"button[data-view={view}]")
        for seconds in TIMES:
            laptop.set(seconds)
            laptop.drawn()
            away = laptop.run(
                "() => airrace.scene.view.camera.position.distanceTo(airrace.scene.actors[0].model.position)"
            )
            assert nearest < away < farthest


def test_the_cockpit_looks_along_the_nose_with_the_right_wing_to_the_right(laptop: Opened) -> None:
    laptop.page.click("button[data-view=cockpit]")
    laptop.set(2.5)
    laptop.drawn()
    along, across = laptop.run(
        """() => {
          const { camera } = airrace.scene.view, { model } = airrace.scene.actors[0];
          for (const one of [camera, model]) one.updateMatrixWorld(true);
          const [eye, body] = [camera, model].map(one => one.matrixWorld.elements);
          const product = (a, b) => i => (eye[4 * a + i] * body[4 * b + i]) / model.scale.x;
          const dot = (a, b) => [0, 1, 2].map(product(a, b)).reduce((sum, one) => sum + one);
          return [-dot(2, 0), dot(0, 1)];
        }"""
    )
    assert [along, across] == pytest.approx([1.0, 1.0], abs=1e-6)


@pytest.mark.representative
def test_north_is_up_from_above(laptop: Opened) -> None:
    laptop.page.click("button[data-view=above]")
    laptop.drawn()
    north = laptop.run(
        """() => {
          const { camera } = airrace.scene.view;
          const seen = north => camera.position.clone().set(0, 0, -north).project(camera);
          const [a, b] = [seen(0), seen(100)];
          return [b.x - a.x, b.y - a.y];
        }"""
    )
    assert north[0] == pytest.approx(0.0, abs=1e-6)
    assert north[1] > 0.0


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("view", ["orbit", "above", "side"])
def test_nothing_of_the_course_lies_below_what_is_written_over_it(
    chromium: Browser, folder: Path, artefacts: Path, view: str, size: str
) -> None:
    """The flight, and the legend, which is complete on every screen."""
    one = opened(chromium, folder / "report.html", size)
    one.page.click(f"button[data-view={view}]")
    one.drawn()
    one.page.locator("#scene").screenshot(path=artefacts / f"view_{view}_{size}.png")
    above, low, high, below = one.run(
        """() => {
          const { element, actors, view } = airrace.scene, { flight } = actors[0];
          const { top } = element.getBoundingClientRect();
          const boxes = [...element.querySelectorAll(".hud")].map(one => one.getBoundingClientRect());
          const ends = end => boxes.map(box => box[end] - top);
          const middle = 0.5 * element.clientHeight;
          const down = Array.from({ length: flight.count }, (_, i) => flight.positionOf(i).project(view.camera).y);
          const pixels = down.map(y => 0.5 * (1 - y) * element.clientHeight);
          const above = Math.max(...ends("bottom").filter(y => y < middle));
          return [above, Math.min(...pixels), Math.max(...pixels), Math.min(...ends("top").filter(y => y > middle))];
        }"""
    )
    assert above < low < high < below
    assert one.page.is_visible(".marks output:nth-child(1)")
    assert one.page.is_visible(".marks output:nth-child(3)")
    assert one.page.inner_text(".scalebar").endswith(" m")
    assert one.errors == []
    one.page.context.close()


@pytest.mark.parametrize(
    ("scale", "history", "digit"), [(0, "n_z", 0.1), (1, "V_I", 1.0), (2, "p_Kbar", 1.0), (3, "h_E", 1.0)]
)
def test_the_line_is_coloured_by_what_is_chosen(laptop: Opened, scale: int, history: str, digit: float) -> None:
    """The legend ends with the largest value; that of the roll rate, which has a sign, is symmetric."""
    laptop.page.select_option("[data-colour]", str(scale))
    laptop.drawn()
    values = laptop.run("name => [...airrace.flights[0].history(name)]", history)
    largest = np.abs(values).max() if history == "p_Kbar" else np.max(values)
    legend = laptop.page.inner_text(".marks output:nth-child(3)").replace("\N{MINUS SIGN}", "-")
    assert float(legend) == pytest.approx(largest, abs=0.51 * digit)


def test_fingers_turn_zoom_and_scrub(chromium: Browser, folder: Path) -> None:
    one = opened(chromium, folder / "report.html", "tablet", has_touch=True)
    fingers = one.page.context.new_cdp_session(one.page)

    def touch(kind: str, *places: tuple[float, float]) -> None:
        points = [{"x": x, "y": y, "id": number} for number, (x, y) in enumerate(places)]
        fingers.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})

    one.page.locator("canvas").first.scroll_into_view_if_needed()
    before = one.run("() => [airrace.scene.view.azimuth, airrace.scene.view.zoomed]")
    touch("touchStart", (300, 400))
    for step in range(1, 6):
        touch("touchMove", (300 + 20 * step, 400))
    touch("touchEnd")
    turned = one.run("() => [airrace.scene.view.azimuth, airrace.scene.view.zoomed]")
    assert turned[0] < before[0] - 0.2
    assert turned[1] == before[1]
    touch("touchStart", (300, 400), (400, 400))
    for step in range(1, 6):
        touch("touchMove", (300 - 15 * step, 400), (400 + 15 * step, 400))
    touch("touchEnd")
    assert one.run("() => airrace.scene.view.zoomed") < 0.7 * before[1]
    box = one.page.locator("#transport input[type=range]").bounding_box()
    assert box is not None
    one.page.touchscreen.tap(box["x"] + 0.25 * box["width"], box["y"] + 0.5 * box["height"])
    assert one.seconds == pytest.approx(0.25 * one.run("() => airrace.clock.duration"), abs=0.3)
    assert one.errors == []
    one.page.context.close()


def test_a_course_with_everything_is_drawn(chromium: Browser, tmp_path: Path, artefacts: Path) -> None:
    page = tmp_path / "everything.html"
    page.write_text(flight_page([everything_flown(tmp_path)]), encoding="utf-8")
    one = opened(chromium, page)
    one.drawn()
    one.page.locator("#scene").screenshot(path=artefacts / "everything.png")
    named = one.run("() => [...document.querySelectorAll('.label')].map(one => one.textContent)")
    assert {"N", "start", "corner", "beach", "stands, 90 m", "tower, 60 m", "airspace"} <= set(named)
    assert one.errors == []
    one.page.context.close()
