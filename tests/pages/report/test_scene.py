"""The state of the scene in a browser: cameras, shadows, names, graphics, and controls in reach."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from browser_pages import Opened, gate_runs, opened
from example_flights import circling, half_cuban, rovinj, windy
from playwright.sync_api import Browser

from airrace.pages.report.flight_page import flight_page

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
        max(half_cuban().race_time, windy().race_time),
    )
    total = compared.legs[-1].cumulative
    first = 0 if total > 0.0 else 1
    assert state[0] == f"{max(half_cuban().race_time, windy().race_time):.2f}"
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


def test_the_leg_that_cost_most_is_shown_again_until_both_have_made_it(laptop: Opened) -> None:
    """With the number that the splits say, and both aircraft in the picture, level where the leg begins."""
    swings, seen = laptop.run(
        """() => {
          const { scene, flights: [lead, other], graphics } = airrace;
          const seen = graphics.swings.map(({ from, to }, number) => {
            const view = scene.views.get(`replay ${number + 1}`), inside = [];
            for (let time = from; time <= to; time += 0.1) {
              view.place(1280, 720, time);
              view.camera.updateMatrixWorld(true);
              for (const flight of [lead, other]) {
                const { x, y, z } = flight.position(time + view.shiftOf(flight)).project(view.camera);
                inside.push(z < 1 && Math.abs(x) < 1 && Math.abs(y) < 1);
              }
            }
            return inside;
          });
          return [graphics.swings, seen];
        }"""
    )
    compared = half_cuban().compare(windy())
    largest = max(compared.legs, key=lambda leg: abs(leg.difference))
    assert largest.name.partition(":")[2] in [swing["leg"]["after"]["name"] for swing in swings]
    for swing in swings:
        leg = compared.legs[swing["leg"]["after"]["number"] - 1]
        assert swing["lost"] == pytest.approx(abs(leg.difference), abs=1e-3)
        assert swing["loser"] == (1 if leg.difference > 0.0 else 0)
        assert swing["reasons"]
        begin = swing["leg"]["before"]["time"]
        assert swing["from"] <= begin
        assert swing["to"] >= begin + max(leg.reference.time, leg.flight.time)
        assert swing["to"] - swing["from"] <= swing["seconds"] <= 12.0
    assert all(all(pictures) for pictures in seen)


SWINGS = """([lost, flights]) => {
  const made = Array.from({ length: flights }, (_, number) => ({
    number, passing: (i) => ({ number: i, time: 5 * i + 0.1 * number, name: `g${i}` }),
  }));
  const legs = lost.map((one, i) => ({ passing: i + 1, lost: one, reasons: [] }));
  return new airrace.graphics.constructor(made, "", {}, {}, [{ flight: 1, legs }]).swings
    .map(({ leg, lost, loser }) => [leg.after.number, lost, loser]);
}"""


@pytest.mark.parametrize(
    ("lost", "shown"),
    [
        ([0.1, -0.4, 1.3, 0.2], [[2, 0.4, 0], [3, 1.3, 1]]),
        ([0.1, -0.2, 1.3, 0.9], [[3, 1.3, 1]]),
        ([-2.5, 0.3, 1.3], [[1, 2.5, 0], [3, 1.3, 1]]),
        ([0.004, -0.003], []),
        ([], []),
    ],
)
def test_a_second_leg_is_shown_again_that_wins_back_enough(
    laptop: Opened, lost: list[float], shown: list[list[float]]
) -> None:
    assert laptop.run(SWINGS, [lost, 2]) == shown


def test_a_replay_shows_how_far_apart_both_are_and_counts_the_gap_up_to_the_loss(laptop: Opened) -> None:
    """Most of the distance lies across the picture, rather than along the line of sight."""
    seen = laptop.run(
        """() => airrace.graphics.swings.map((swing, number) => {
          const { scene, graphics, flights } = airrace, view = scene.views.get(`replay ${number + 1}`);
          let [apart, across] = [0, 0];
          const { before, after } = swing.leg;
          for (let time = before.time; time <= after.time; time += 0.1) {
            view.place(1280, 720, time);
            const lead = flights[0].position(time), other = flights[swing.flight].position(time + swing.shift);
            const sight = lead.clone().sub(view.camera.position).normalize();
            const gap = other.sub(lead);
            apart += gap.length();
            across += gap.cross(sight).length();
          }
          const times = [before.time - 0.2, before.time, after.time, swing.to];
          const lost = times.map((time) => graphics.runningGap(swing, time).lost);
          return [across / apart, lost, swing.lost];
        })"""
    )
    assert seen
    for across, gaps, lost in seen:
        assert across > 0.8
        assert gaps == pytest.approx([0.0, 0.0, lost, lost], abs=2e-3)


@pytest.mark.parametrize(
    ("finishes", "followed"),
    [
        ([50.0, 49.0], []),
        ([50.0, 50.6], []),
        ([50.0, 54.5], [[1, 50.0, 54.5]]),
        ([50.0, 71.0], [[1, 50.0, 62.0]]),
        ([50.0, None], []),
        ([50.0, 58.0, 53.0], [[2, 50.0, 53.0], [1, 53.0, 58.0]]),
        ([50.0, 53.0, 54.0], [[2, 50.0, 54.0]]),
        ([50.0, 51.5, 56.0], [[2, 50.0, 56.0]]),
    ],
)
def test_television_follows_who_finishes_later_in_shots_that_are_long_enough(
    laptop: Opened, finishes: list[float | None], followed: list[list[float]]
) -> None:
    pursuits = laptop.run(
        """(finishes) => {
          const made = finishes.map((raceTime, number) => ({ number, raceTime, duration: raceTime ?? 90 }));
          const pairs = made.slice(1).map(({ number }) => ({ flight: number, legs: [] }));
          const { pursuits } = new airrace.graphics.constructor(made, "", {}, {}, pairs);
          return pursuits.map(({ flight, from, to }) => [flight.number, from, to]);
        }""",
        finishes,
    )
    assert pursuits == followed


@pytest.fixture(scope="module")
def circles(chromium: Browser, folder: Path) -> Iterator[Opened]:
    """A flight beside a slower one of more drag."""
    race = rovinj()
    drag = replace(race.aircraft.drag, C_D0=4.0 * race.aircraft.drag.C_D0)
    draggy = replace(race, aircraft=replace(race.aircraft, drag=drag))
    flights = [circling(race, label="fast"), circling(draggy, speed=64.0, seconds=25.0, label="slow")]
    (folder / "circles.html").write_text(flight_page(flights), encoding="utf-8")
    page = opened(chromium, folder / "circles.html")
    yield page
    assert page.errors == []
    page.page.context.close()


def test_the_race_goes_on_until_the_last_flight_has_finished(circles: Opened) -> None:
    """The camera goes to it by the rules of framing, the first one is gone, and no final gap is shown before."""
    end, states = circles.run(
        """() => {
          const { scene, graphics, film } = airrace, view = scene.views.get("tv");
          const states = [19.9, 20.5, 22.7, 24.9, film.end].map((time) => {
            const { clock, order, gapAt, done } = graphics.state(time);
            const { inside, size } = view.framing(1280, 720, time);
            const shown = airrace.flights.filter((flight) => view.shows(flight, time)).map(({ number }) => number);
            return [time, clock, order[1].gap, gapAt, done, inside, size, graphics.subject(time).number, shown];
          });
          return [film.end, states];
        }"""
    )
    assert end == pytest.approx(25.0)
    for time, clock, gap, gap_at, done, inside, size, subject, shown in states:
        assert clock == f"{time:.2f}"
        assert done is (time == end)
        assert (gap == pytest.approx(5.0, abs=2e-3)) is done
        assert gap_at.startswith("gap at ")
        assert inside
        assert 0.06 <= size <= 0.25
        assert (subject, shown) == ((0, [0, 1]) if time < 20.0 else (1, [1]))


def test_the_box_of_speed_and_height_names_whom_the_camera_follows(circles: Opened) -> None:
    named = circles.run(
        """() => [10, 22].map((time) => {
          const named = [], spy = Object.create(airrace.graphics);
          spy.named = ({ label }) => named.push(label);
          const context = document.createElement("canvas").getContext("2d");
          spy.draw(context, 1280, 720, time, { name: "tv", follows: true }, { whole: true });
          return named.at(-1);
        })"""
    )
    assert named == ["fast", "slow"]


def test_the_map_of_the_result_has_the_names_of_gates_alone(laptop: Opened) -> None:
    hidden = laptop.run(
        """() => ["result", "orbit"].map((view) => {
          airrace.film.frame(4, view, 320, 180);
          return airrace.scene.actors.map(({ tag }) => tag.hidden());
        })"""
    )
    assert hidden == [[True, True], [False, False]]


def test_losses_spread_over_all_legs_are_told_so_and_their_common_cause_once(circles: Opened) -> None:
    lines, told = circles.run(
        """() => {
          const { lines, told } = airrace.graphics.outcome();
          return [lines, told.map(({ lost, reasons, leg }) => [lost, reasons, Boolean(leg)])];
        }"""
    )
    legs = len(rovinj().course.passages) - 1
    assert lines == [
        f"slow loses a little on {legs} of {legs} legs; the largest losses",
        "slow, on every leg: aircraft with more drag",
    ]
    losses = [lost for lost, _, is_leg in told if is_leg]
    assert losses == sorted(losses, reverse=True)
    assert told[-1][2] is False
    assert not any("aircraft with more drag" in reason for _, reasons, _ in told for reason in reasons)


def test_the_result_accounts_for_all_of_the_gap_leg_by_leg_and_counts_penalties(laptop: Opened) -> None:
    plain, penalised = laptop.run(
        """() => {
          const { graphics, flights } = airrace;
          const told = () => {
            const { rows, told } = graphics.outcome();
            const numbered = (values) => values.map(({ flight, total, lost }) => [flight.number, total ?? lost]);
            return [numbered(rows), numbered(told)];
          };
          const plain = told(), [first] = graphics.outcome().rows;
          first.flight.penalties = [{ time: 1, rule: "bank", gate: "", seconds: 2 }];
          const penalised = told();
          first.flight.penalties = [];
          return [plain, penalised];
        }"""
    )
    (winner, time), (loser, later) = plain[0]
    assert time < later
    assert [number for number, _ in penalised[0]] == [loser, winner]
    for rows, told in (plain, penalised):
        second = rows[1][0]
        account = sum(lost if number == second else -lost for number, lost in told)
        assert account == pytest.approx(rows[1][1] - rows[0][1], abs=0.02)


def test_the_verdict_tells_wins_ties_and_races_that_nobody_finished(laptop: Opened) -> None:
    verdicts = laptop.run(
        """() => {
          const row = (label, total) => ({ flight: { label }, total });
          return [[10, 11.25], [10, 10.0001], [10, Infinity], [Infinity, Infinity]].map(([ada, bo]) =>
            airrace.graphics.verdict([row("Ada", ada), row("Bo", bo)]));
        }"""
    )
    assert verdicts == ["Ada wins by 1.250 s", "a tie", "Ada wins", "not finished"]


def test_gaps_stand_once_and_name_the_gate_of_the_board(laptop: Opened) -> None:
    """The leg that is flown and the gate of the gap carry the course's names; the marker of a flight out of the picture
    says the same gap."""
    states = laptop.run(
        """() => {
          const { graphics, flights: [lead, other] } = airrace;
          const written = [], spy = Object.assign(Object.create(graphics), {
            panels: [], unit: 1, write: (text) => written.push(text), marker: (box, flight, text) => written.push(text),
          });
          const view = airrace.scene.views.get("chase");
          view.place(1280, 720, 4);
          const far = Object.assign(Object.create(other), { position: () => lead.position(4).set(9e4, 0, 9e4) });
          spy.flights = [lead, far];
          const times = [0.5, 4, 7.5];
          return times.map((time) => {
            written.length = 0;
            spy.outside(1280, 720, time, view);
            const { place, gapAt, order } = graphics.state(time);
            return [place, gapAt, order.map(({ gap }) => gap), [...written], graphics.last(time)];
          });
        }"""
    )
    names = laptop.run("() => airrace.flights[0].passings.map(({ name }) => name)")
    for place, gap_at, gaps, (marked,), last in states:
        assert all(name in names for name in place.split(" → "))
        assert gap_at == (f"gap at {names[last]}" if last else "")
        assert marked == "" or marked[1:] == f"{max(gaps):.3f} at {names[last]}"
        assert bool(marked) == bool(last)


@pytest.mark.parametrize("shape", SHAPES)
def test_a_flight_nearby_is_in_most_pictures_of_the_director(laptop: Opened, shape: str) -> None:
    seen = laptop.run(
        """([width, height]) => {
          const view = airrace.scene.views.get("tv"), [lead, other] = airrace.flights, seen = [];
          for (let time = 0; time <= lead.duration; time += 0.1) {
            if (other.position(time).distanceTo(lead.position(time)) > 120) continue;
            view.place(width, height, time);
            view.camera.updateMatrixWorld(true);
            const { x, y, z } = other.position(time).project(view.camera);
            seen.push(z < 1 && Math.abs(x) < 1 && Math.abs(y) < 1);
          }
          return seen;
        }""",
        SHAPES[shape],
    )
    assert np.mean(seen) > 0.9


def test_no_name_lies_on_a_box_of_the_graphics_in_a_film(laptop: Opened) -> None:
    for view in ("tv", "replay 1", "result"):
        boxes, panels = laptop.run(
            """(name) => {
              const { film, scene, graphics } = airrace, boxes = [];
              const { fillRect } = CanvasRenderingContext2D.prototype, { draw } = graphics;
              graphics.draw = (...words) => {
                draw.apply(graphics, words);
                CanvasRenderingContext2D.prototype.fillRect = function (...box) {
                  boxes.push(box);
                  fillRect.apply(this, box);
                };
              };
              film.frame(4, name, 640, 360);
              delete graphics.draw;
              CanvasRenderingContext2D.prototype.fillRect = fillRect;
              return [boxes, graphics.panels];
            }""",
            view,
        )
        assert len(panels) >= 1
        for left, top, wide, high in boxes:
            for x, y, w, h in panels:
                assert left >= x + w or x >= left + wide or top >= y + h or y >= top + high


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
