"""The state of the scene in a browser: cameras, shadows, names, graphics, and controls in reach."""

from pathlib import Path

import numpy as np
import pytest
from browser_pages import Opened, gate_runs, opened
from example_flights import half_cuban, windy
from playwright.sync_api import Browser

pytestmark = pytest.mark.slow
CLEAR = 13.0
"""What a camera keeps from every way, m; as in cameras.js."""


SHAPES = {"16:9": (1280, 720), "9:16": (720, 1280), "1:1": (960, 960)}
"""Pixels of films, by format."""
SHORTEST = 2.5
"""The shortest shot, s."""
SIDEWAYS = 0.25
"""The share of the speed from which on a flight has a direction in the picture."""


@pytest.mark.parametrize("shape", SHAPES)
def test_shots_are_long_enough_and_no_cut_jumps_across_the_line_of_flight(laptop: Opened, shape: str) -> None:
    cuts, duration = laptop.run(
        """([width, height]) => {
          const view = airrace.scene.views.get("tv"), [lead] = airrace.flights;
          const times = view.director.shots(width / height).slice(1).map(({ from }) => from);
          const at = (time) => view.framing(width, height, time).across;
          return [times.map((time) => [time, at(time - 1e-6), at(time)]), lead.duration];
        }""",
        SHAPES[shape],
    )
    times = [0.0, *(time for time, _, _ in cuts), duration]
    assert np.diff(times).min() >= SHORTEST - 1e-9
    for _, before, after in cuts:
        assert before * after > 0.0 or min(abs(before), abs(after)) <= SIDEWAYS


@pytest.mark.representative
@pytest.mark.parametrize("shape", SHAPES)
def test_every_picture_of_the_director_keeps_the_rules_of_framing(laptop: Opened, shape: str) -> None:
    pictures = laptop.run(
        """([width, height]) => {
          const view = airrace.scene.views.get("tv"), [lead] = airrace.flights, pictures = [];
          for (let time = 0; time <= lead.duration; time += 0.04) {
            const near = lead.passings.some((passing) => Math.abs(passing.time - time) <= 0.1);
            const { size, inside, gate, horizon, hidden, eye } = view.framing(width, height, time);
            const away = Math.min(...airrace.flights.map((flight) => Math.hypot(
              ...flight.position(time).toArray().map((coordinate, axis) => coordinate - eye[axis]))));
            pictures.push([size, inside, gate || horizon, near && hidden, away, eye[1]]);
          }
          return pictures;
        }""",
        SHAPES[shape],
    )
    size, inside, oriented, hidden, away, height = np.array(pictures, float).T
    assert size.min() >= 0.06
    assert size.max() <= 0.25
    assert inside.all()
    assert oriented.all()
    assert not hidden.any()
    assert away.min() > 0.8 * CLEAR
    assert height.min() >= 1.5


def test_a_shadow_lies_on_the_ground_where_the_sun_puts_it(laptop: Opened) -> None:
    laptop.set(4.0)
    laptop.drawn()
    place, sun, shadow = laptop.run(
        """() => {
          const { actors: [{ model, shadow }], ground } = airrace.scene;
          const { elements } = shadow.children[0].matrix;
          return [model.position.toArray(), ground.sun.toArray(), elements.slice(12, 15)];
        }"""
    )
    expected = np.array(place) - np.array(sun) * place[1] / sun[1]
    assert shadow == pytest.approx(expected.tolist(), abs=1e-3)
    assert shadow[1] == 0.0


@pytest.mark.parametrize("view", gate_runs(["orbit", "above", "chase", "tv"], "above"))
def test_no_name_lies_on_another_and_both_aircraft_have_theirs(laptop: Opened, view: str) -> None:
    laptop.page.click(f"button[data-view={view}]")
    for seconds in (0.5, 3.0, 6.0):
        laptop.set(seconds)
        laptop.drawn()
        boxes = laptop.run(
            """() => [...document.querySelectorAll(".label:not(.hidden)")].map(one => {
              const { left, top, right, bottom } = one.getBoundingClientRect();
              return [left, top, right, bottom, one.classList.contains("tag")];
            })"""
        )
        for number, (left, top, right, bottom, _) in enumerate(boxes):
            for other in boxes[:number]:
                assert left >= other[2] or right <= other[0] or top >= other[3] or bottom <= other[1]
        if view in ("orbit", "above"):
            assert sum(one[4] for one in boxes) == 2
    laptop.page.click("button[data-view=orbit]")


def test_the_order_of_the_flights_and_their_gap_are_those_of_the_comparison(laptop: Opened) -> None:
    compared = half_cuban().compare(windy())
    state = laptop.run(
        """time => {
          const { clock, place, order } = airrace.graphics.state(time);
          return [clock, place, order.map(({ flight, gap }) => [flight.number, gap])];
        }""",
        half_cuban().race_time,
    )
    total = compared.legs[-1].cumulative
    first = 0 if total > 0.0 else 1
    assert state[0] == f"{half_cuban().race_time:.2f}"
    assert state[1] == "finish"
    assert [number for number, _ in state[2]] == [first, 1 - first]
    assert [gap for _, gap in state[2]] == pytest.approx([0.0, abs(total)], abs=2e-3)


def test_gaps_are_times_at_passings_and_agree_with_the_splits(laptop: Opened) -> None:
    """At any instant they are those of the last passing that all have made."""
    passings, states = laptop.run(
        """() => [airrace.flights.map((flight) => flight.passings.map(({ time }) => time)),
          Array.from({ length: 60 }, (_, i) => 0.15 * i).map((time) =>
            [time, airrace.graphics.order(time).map(({ flight, gap }) => [flight.number, gap])])]"""
    )
    for time, order in states:
        last = min(sum(passed <= time + 1e-4 for passed in passings[number]) for number, _ in order) - 1
        first = min(times[last] for times in passings)
        assert [gap for _, gap in order] == pytest.approx([passings[number][last] - first for number, _ in order])
        assert order[0][1] == 0.0


def test_sectors_have_the_colours_of_television(laptop: Opened) -> None:
    """Of all sectors that compare, one is the best; a slower one is the flight's own best where an earlier one of its
    own was slower still."""
    kinds, first, own = laptop.run(
        """() => {
          const { graphics, flights } = airrace;
          const lap = (times) => times.map((time, i) => ({ time, number: i, name: `g${i % 2}`, lap: 1 + (i >> 1) }));
          const flown = (times) => ({ visible: true, passings: lap(times) });
          const [fast, slow] = [flown([0, 10, 20, 31]), flown([0, 15, 25, 38])];
          const sectors = Object.assign(Object.create(graphics), { flights: [fast, slow] });
          const alone = Object.assign(Object.create(graphics), { flights: [slow] });
          return [
            flights.map((flight) => graphics.sectors(flight, Infinity)),
            [sectors.sectors(fast, 40), sectors.sectors(slow, 40), sectors.sectors(slow, 24)],
            alone.sectors(slow, 40),
          ];
        }"""
    )
    for pair in zip(*kinds, strict=True):
        assert sorted(pair) in (["best", "slower"], ["best", "best"])
    assert first == [["best", "best", "slower"], ["slower", "best", "own"], ["slower"]]
    assert own == ["slower", "best", "best"]


def test_what_cost_most_is_shown_again_with_both_aircraft_in_the_picture(laptop: Opened) -> None:
    replay, most, seen = laptop.run(
        """() => {
          const { film, scene, flights, graphics } = airrace, view = scene.views.get("replay");
          const { from, to, flight } = film.replay;
          const [{ at }] = airrace.strips.differences;
          const changes = Array.from({ length: 60 }, (_, i) => 0.1 * i)
            .filter((time) => time + 2.5 <= flights[0].duration)
            .map((time) => Math.abs(at(time + 2.5) - at(time)));
          const inside = [];
          for (let time = from; time <= to; time += 0.1) {
            view.place(1280, 720, time);
            view.camera.updateMatrixWorld(true);
            for (const one of flights) {
              const { x, y, z } = one.position(time).project(view.camera);
              inside.push(z < 1 && Math.abs(x) < 1 && Math.abs(y) < 1);
            }
          }
          return [[from, to, flight, graphics.replay.change], Math.max(...changes), inside];
        }"""
    )
    begin, end, number, change = replay
    assert end - begin == pytest.approx(2.5)
    assert number == 1
    assert abs(change) >= most - 1e-9
    assert all(seen)


def test_names_stand_beside_the_aircraft_and_never_on_one(laptop: Opened) -> None:
    laptop.page.click("button[data-view=tv]")
    for seconds in (0.5, 2.0, 4.0, 6.0):
        laptop.set(seconds)
        laptop.drawn()
        tags, aircraft = laptop.run(
            """() => {
              const { scene } = airrace, { camera } = scene.view, { clientWidth: w, clientHeight: h } = scene.element;
              const { left, top } = scene.element.getBoundingClientRect();
              const tags = [...document.querySelectorAll(".label.tag:not(.hidden)")].map((tag) => {
                const box = tag.getBoundingClientRect();
                return [box.left - left, box.top - top, box.right - left, box.bottom - top];
              });
              const points = scene.actors.map(({ tag }) => tag.extent().map((point) => {
                const { x, y } = point.project(camera);
                return [0.5 * (x + 1) * w, 0.5 * (1 - y) * h];
              }));
              return [tags, points];
            }"""
        )
        for left, top, right, bottom in tags:
            for points in aircraft:
                inside = [left < x < right and top < y < bottom for x, y in points]
                assert not any(inside)
                middle = np.mean(points, axis=0)
                assert not (left < middle[0] < right and top < middle[1] < bottom)
    laptop.page.click("button[data-view=orbit]")


@pytest.mark.parametrize(("view", "ahead"), [("tv", 0.0), ("chase", 0.3), ("orbit", 1.0)])
def test_television_shows_no_way_that_is_not_flown_yet(laptop: Opened, view: str, ahead: float) -> None:
    laptop.page.click(f"button[data-view={view}]")
    laptop.drawn()
    assert laptop.run("() => airrace.scene.actors[0].way.children[1].material.uniforms.ahead.value") == ahead
    laptop.page.click("button[data-view=orbit]")


def test_the_ground_is_grass_inland_until_water_is_chosen(laptop: Opened) -> None:
    assert laptop.run("() => airrace.scene.ground.kind") == "grass"
    laptop.page.select_option("[data-ground]", "water")
    assert laptop.run("() => airrace.scene.ground.kind") == "water"
    laptop.page.select_option("[data-ground]", "grass")


def test_a_picture_of_an_instant_is_the_same_whatever_was_shown_before(laptop: Opened) -> None:
    frame = "([time, view]) => airrace.film.frame(time, view, 320, 180)"
    for view in ("tv", "chase", "cockpit"):
        first = laptop.run(frame, [3.0, view])
        laptop.run(frame, [7.0, "tv"])
        assert laptop.run(frame, [3.0, view]) == first


def test_scene_and_controls_fill_a_phone_held_across(chromium: Browser, folder: Path) -> None:
    one = opened(chromium, folder / "report.html", "across", has_touch=True)
    one.run("() => document.querySelector('.watch').scrollIntoView()")
    for view in ("orbit", "tv", "cockpit"):
        one.page.click(f"button[data-view={view}]")
        one.drawn()
    boxes = one.run(
        """() => [".scene", "[data-play]", "[data-full]", "#transport input", "button[data-view=tv]"].map(name => {
          const { top, bottom, left, right } = document.querySelector(name).getBoundingClientRect();
          return [top, innerHeight - bottom, left, innerWidth - right];
        })"""
    )
    assert np.min(boxes) >= -1.0
    assert one.errors == []
    one.page.context.close()


def test_the_screen_is_filled_and_left_by_a_button(laptop: Opened) -> None:
    laptop.page.click("[data-full]")
    laptop.page.wait_for_function("() => document.fullscreenElement !== null")
    laptop.drawn()
    scene, transport, high = laptop.run(
        """() => [document.querySelector(".scene").clientHeight, document.querySelector("#transport").offsetHeight,
                  innerHeight]"""
    )
    assert scene + transport == pytest.approx(high, abs=2)
    laptop.page.wait_for_function("() => document.querySelector('#transport').offsetHeight === 0")
    hidden = "() => [...document.querySelectorAll('.hud')].every((one) => one.offsetHeight === 0)"
    assert laptop.run(hidden)  # a clean feed, until the pointer moves
    laptop.page.mouse.move(400, 300)
    laptop.page.mouse.move(420, 310)
    assert not laptop.run(hidden)
    laptop.page.keyboard.press("f")
    laptop.page.wait_for_function("() => document.fullscreenElement === null")


def test_while_pictures_come_late_fewer_pixels_are_drawn_until_the_race_stands(laptop: Opened) -> None:
    """The processor draws here, so they come late."""
    laptop.page.click("button[data-view=orbit]")
    laptop.set(0.0)
    laptop.run("() => airrace.clock.toggle()")
    laptop.page.wait_for_function("() => airrace.scene.sharpness < 0.9 && airrace.clock.running")
    laptop.run("() => airrace.clock.stop()")
    laptop.drawn()
    drawn, shown = laptop.run("() => [airrace.scene.canvas.width, airrace.scene.canvas.clientWidth * devicePixelRatio]")
    assert drawn == pytest.approx(shown, abs=1)
