"""A hand on a gate in a browser: the time that the page shows is that of the file that it saves."""

import threading
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import psutil
import pytest
from browser_pages import READY_MS, browser_path
from playwright.sync_api import Browser, Page, sync_playwright

import airrace
from airrace.design.designer import Designer
from airrace.design.server import DesignServer

pytestmark = pytest.mark.slow

WITHIN = """(path) => {
  const { plan } = window.designer;
  const one = plan.pieces().find((piece) => piece.path.join(".") === path).spots[0];
  const [{ north, east, scale }, box] = [plan.view, plan.svg.getBoundingClientRect()];
  const [right, up] = [(one.east - east) / scale, (one.north - north) / scale];
  return [box.left + box.width / 2 + right, box.top + box.height / 2 - up, scale];
}"""
SETTLED = """() => {
  const { state } = window.designer.link;
  if (!state) return false;
  const [session] = state.sessions;
  return session.answered === state.request && session.slope_time === session.time && !window.designer.plan.hand;
}"""


@dataclass
class Desk:
    page: Page
    designer: Designer

    def settle(self) -> float:
        """Wait for the answer to what is shown, and its sensitivities; return its race time, s."""
        self.page.wait_for_function(SETTLED)
        return float(self.page.locator(".time").get_attribute("data-time") or "nan")

    def drag(self, piece: str, north: float, east: float) -> float:
        """Drag a piece by metres, and let go; return the race time that was predicted in the hand, s."""
        x, y, scale = self.page.evaluate(WITHIN, piece)
        self.page.mouse.move(x, y)
        self.page.mouse.down()
        self.page.mouse.move(x + east / scale, y - north / scale)
        predicted = float(self.page.locator(".time.guess").get_attribute("data-time") or "nan")
        self.page.mouse.up()
        return predicted


@pytest.fixture(scope="module")
def chromium() -> Iterator[Browser]:
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=browser_path(), args=["--no-sandbox"])
        yield browser
        browser.close()


@pytest.fixture
def desk(chromium: Browser, track: Path) -> Iterator[Desk]:
    designer = Designer(track)
    server = DesignServer(designer)
    thread = threading.Thread(target=lambda: server.run(browser=False))
    thread.start()
    page = chromium.new_context(viewport={"width": 1400, "height": 850}).new_page()
    page.set_default_timeout(READY_MS)
    said: list[Any] = []
    page.on("console", lambda one: said.append(one.text) if one.type == "error" else None)
    page.on("pageerror", lambda error: said.append(str(error)))
    page.goto(server.address)
    yield Desk(page, designer)
    page.context.close()
    server.stop()
    thread.join()
    designer.close()
    expected = ("net::ERR", "status of 422")  # a lost link, a refusal
    assert [text for text in said if not any(part in text for part in expected)] == []


@pytest.mark.representative
def test_a_dragged_gate_has_the_race_time_of_the_saved_file(desk: Desk, track: Path) -> None:
    before = desk.settle()
    predicted = desk.drag("gates.corner", 4.0, -3.0)
    after = desk.settle()
    assert desk.designer.track.document.text != track.read_text()
    assert predicted - before == pytest.approx(after - before, rel=0.2)
    desk.page.keyboard.press("Control+s")
    desk.page.wait_for_selector("#save:disabled")
    flown = airrace.optimize(track, until="point-mass")
    assert after < flown.race_time + 0.005
    desk.page.keyboard.press("Control+z")
    desk.page.wait_for_function("() => window.designer.link.state.revision === 2")
    assert desk.settle() == pytest.approx(before, abs=1e-4)


def test_the_scene_stands_beside_the_plan_and_follows_it(desk: Desk) -> None:
    desk.settle()
    desk.page.check("#beside")
    scene = desk.page.frame_locator("#scene")
    scene.locator("#scene canvas").first.wait_for()
    assert scene.locator(".mast").is_hidden()
    before = desk.page.locator("#scene").get_attribute("data-key")
    desk.drag("gates.corner", 4.0, -3.0)
    desk.settle()
    desk.page.wait_for_function("(key) => document.getElementById('scene').dataset.key !== key", arg=before)
    scene.locator("#scene canvas").first.wait_for()


@pytest.mark.representative
def test_gates_of_two_names_that_are_one_pylon_move_together(desk: Desk) -> None:
    found = desk.page.evaluate("""async () => {
      const { together } = await import("./script/plan.js");
      const piece = (name, north, group = "gates") => (
        { path: [group, name], spots: [{ path: [group, name], north, east: 2 }] });
      const all = [piece("a", 1), piece("b", 1.001), piece("c", 1.1), piece("d", 1, "obstacles")];
      return together(all[0], all).map((one) => one.path[1]);
    }""")
    assert found == ["b"]


@pytest.mark.representative
def test_a_refused_drag_goes_back_with_its_reason_and_forms_change_the_file(desk: Desk, track: Path) -> None:
    page, file = desk.page, desk.designer.track
    page.wait_for_function("() => window.designer.plan.view")
    page.evaluate("() => { window.designer.plan.view.scale = 1e4; window.designer.plan.draw(); }")
    desk.drag("gates.last", 3e6, 0.0)  # which lies above the others there
    page.wait_for_selector("#told:not([hidden])")
    page.wait_for_function("() => !window.designer.plan.hand")
    assert page.locator("#told").inner_text().startswith("last stays where it was: last.pylons.0.north_m")
    norths = [piece["spots"][0]["north"] for piece in page.evaluate("() => window.designer.plan.pieces()")]
    assert (norths, file.document.text) == ([0.0, 420.0, 700.0], track.read_text())
    page.evaluate("() => { for (const details of document.querySelectorAll('details')) details.open = true; }")
    for name, value in (("rules.floor_m", "12"), ("course.laps", "2"), ("rules.floor_m", "")):
        revision = file.revision
        page.fill(f'#race [name="{name}"]', value)
        page.keyboard.press("Enter")
        page.wait_for_function("(before) => window.designer.link.state.revision > before", arg=revision)
    page.click("#order tr:nth-child(2) button[title=later]")
    page.wait_for_function("() => window.designer.link.state.passings[1].gate === 'last'")
    page.evaluate("() => window.designer.plan.choose(['gates', 'last'])")
    page.fill('#piece [name="pylons.1.east_m"]', "318")
    page.keyboard.press("Enter")
    page.wait_for_function("() => !window.designer.link.pending.length && window.designer.link.state.revision === 5")
    names = [passage.name for passage in file.layout.inputs.race.course.passages]
    assert names == ["0:start", "1:last", "1:corner", "2:last", "2:corner"]
    assert "floor_m" not in file.document.text
    assert file.layout.piece(("gates", "last")).spots[1].east == 318.0


def test_a_killed_solver_a_limit_that_is_refused_and_a_lost_link_lose_nothing(desk: Desk) -> None:
    before = desk.settle()
    for process in psutil.Process().children(recursive=True):
        if any("airrace" in word for word in process.cmdline()):
            process.kill()
    desk.drag("gates.corner", 4.0, -3.0)
    dragged = desk.settle()
    assert dragged > before
    # The old line stays, grey, and the page says what is wrong.
    desk.page.evaluate("() => window.designer.link.ask('values', { values: { 'rules.n_z_max': 0.2 } })")
    desk.page.wait_for_selector("g.old .line")
    assert "n_z_max: must be above 1" in desk.page.locator(".problem").first.inner_text()
    desk.page.evaluate("() => window.designer.link.ask('values', { values: { 'rules.n_z_max': null } })")
    desk.page.wait_for_selector("g:not(.old) > .line")
    desk.page.context.set_offline(True)
    desk.drag("gates.corner", -4.0, 3.0)
    desk.page.wait_for_selector("#link.lost")
    assert desk.designer.track.revision == 1
    desk.page.context.set_offline(False)  # what was dragged meanwhile is handed back
    desk.page.wait_for_function("() => window.designer.link.state.revision === 2")
    assert desk.settle() == pytest.approx(before, abs=1e-3)
    other = desk.page.context.new_page()
    other.goto(desk.page.url)
    other.wait_for_function(SETTLED)
    other.evaluate("() => window.designer.link.ask('undo')")
    desk.page.wait_for_function("() => window.designer.link.state.revision === 3")
    assert desk.settle() == pytest.approx(dragged, abs=1e-4)


def test_a_picture_that_is_dropped_on_the_plan_lies_below_the_course(desk: Desk, track: Path, tmp_path: Path) -> None:
    desk.page.wait_for_function("() => window.designer.plan.view")
    desk.page.evaluate("""async () => {
      const canvas = Object.assign(document.createElement("canvas"), { width: 40, height: 30 });
      const blob = await new Promise((done) => canvas.toBlob(done));
      const dataTransfer = new DataTransfer();
      dataTransfer.items.add(new File([blob], "map.png"));
      window.designer.plan.svg.dispatchEvent(new DragEvent("drop", { dataTransfer, bubbles: true, cancelable: true }));
    }""")
    desk.page.wait_for_selector("#plan image")
    assert track.with_name("map.png").is_file()
    (tmp_path / "sketch.kml").write_text("no placemarks")
    desk.page.set_input_files("#upload", tmp_path / "sketch.kml")
    desk.page.wait_for_selector("#told:not([hidden])")
    assert not track.with_name("sketch.kml").exists()


HAND_BACK = """async (edited) => {
  const link = window.designer.link, posted = [], { post } = link;
  link.post = async (action) => posted.push(action);
  const offer = { file: "course.unsaved.yaml", differences: [] };
  const digest = edited ? "another" : link.state.digest_of_file;
  await link.handBack({ ...link.state, designer: "the next", digest_of_file: digest, offer });
  link.post = post;
  return posted;
}"""
"""Ends in what the page asks of a designer that was started anew, whose file was edited meanwhile or was not."""


def test_a_page_takes_no_offer_over_a_file_that_was_edited_meanwhile(desk: Desk) -> None:
    desk.settle()
    assert desk.page.evaluate(HAND_BACK, False) == ["take"]
    assert desk.page.evaluate(HAND_BACK, True) == []
