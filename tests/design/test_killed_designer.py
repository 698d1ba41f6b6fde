"""A designer that is killed while a hand is at work in a browser loses nothing that it has accepted."""

import hashlib
import random
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import pytest
from browser_pages import READY_MS, browser_path, gate_runs
from playwright.sync_api import Page, sync_playwright

pytestmark = pytest.mark.slow

RECORD = """() => {
  const { link } = window.designer;
  window.messages = [];
  const post = link.post.bind(link);
  link.post = async (action, message) => {
    const entry = { action, places: message?.places ?? [], digest: null, refused: false };
    window.messages.push(entry);
    const result = await post(action, message);
    if (result.done) entry.digest = link.digest;
    else entry.refused = true;
    return result;
  };
}"""
PLACE = """(path) => {
  const { plan } = window.designer;
  const spot = plan.pieces().find((piece) => piece.path.join(".") === path).spots[0];
  const [{ north, east, scale }, box] = [plan.view, plan.svg.getBoundingClientRect()];
  const [right, up] = [(spot.east - east) / scale, (spot.north - north) / scale];
  return [box.left + box.width / 2 + right, box.top + box.height / 2 - up];
}"""
PLACES = (
    """() => window.designer.plan.pieces().flatMap((piece) => piece.spots.map((spot) => [spot.north, spot.east]))"""
)
READY = """() => {
  const { link, plan } = window.designer;
  return link.state && plan.view && !link.lost && !link.pending.length && !plan.hand;
}"""
GATES = ("gates.start", "gates.corner", "gates.last")
DRAGS_MAX = 200
"""More than are made before the kill comes."""


@contextmanager
def running(track: Path) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """A designer of a track file, and its address."""
    command = [sys.executable, "-m", "airrace", "design", str(track), "--no-browser"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    try:
        yield process, process.stdout.readline().strip()
    finally:
        if process.poll() is None:
            end(process, signal.SIGTERM)


def end(process: subprocess.Popen[str], number: signal.Signals) -> None:
    """End a designer by a signal."""
    process.send_signal(number)
    process.communicate()


def edit_until(page: Page, killed: threading.Event, generator: random.Random) -> None:
    """Drag gates about, in steps, and undo now and then, until the designer is killed."""
    for _ in range(DRAGS_MAX):
        if killed.is_set():
            return
        x, y = page.evaluate(PLACE, generator.choice(GATES))
        page.mouse.move(x, y)
        page.mouse.down()
        for _ in range(generator.randint(1, 4)):
            x, y = x + generator.uniform(-9, 9), y + generator.uniform(-9, 9)
            page.mouse.move(x, y)
            page.wait_for_timeout(generator.choice((0, 60, 170)))
        page.mouse.up()
        if generator.random() < 0.2:
            page.keyboard.press("Control+z")


@pytest.fixture
def page() -> Iterator[Page]:
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=browser_path(), args=["--no-sandbox"])
        opened = browser.new_context(viewport={"width": 1400, "height": 850}).new_page()
        opened.set_default_timeout(READY_MS)
        yield opened
        browser.close()


def ensure_kept(on_disk: bytes, messages: list[dict[str, Any]]) -> int:
    """Compare the disk with what the page was told; return how many messages were accepted."""
    accepted = [entry["digest"] for entry in messages if entry["digest"]]
    if accepted and hashlib.sha256(on_disk).hexdigest() != accepted[-1]:
        unanswered = messages[-1]  # it came to the disk, and its answer not to the page
        assert unanswered["digest"] is None
        assert not unanswered["refused"]
        for place in unanswered["places"]:
            assert f"north_m: {round(place['north'], 2):.12g}" in on_disk.decode()
    return len(accepted)


@pytest.mark.parametrize("kills", gate_runs([2, 30], 2))
def test_a_kill_at_any_instant_loses_no_accepted_edit_and_the_page_hands_back_the_others(
    page: Page, track: Path, kills: int
) -> None:
    generator = random.Random(kills)
    beside = track.with_name("course.unsaved.yaml")
    accepted = 0
    with ExitStack() as stack:
        designer, address = stack.enter_context(running(track))
        page.goto(address)
        page.wait_for_function(READY)
        page.evaluate(RECORD)
        for _ in range(kills):
            killed = threading.Event()

            def kill(process: subprocess.Popen[str] = designer, event: threading.Event = killed) -> None:
                end(process, signal.SIGKILL)
                event.set()

            timer = threading.Timer(generator.uniform(0.2, 3.0), kill)
            timer.start()
            edit_until(page, killed, generator)
            timer.join()
            page.wait_for_function("() => window.designer.link.lost && !window.designer.link.sending")
            places = page.evaluate(PLACES)
            pending = page.evaluate("() => window.designer.link.pending.map((entry) => entry.action)")
            accepted = ensure_kept((beside if beside.exists() else track).read_bytes(), page.evaluate("() => messages"))
            designer, again = stack.enter_context(running(track))
            assert again == address
            page.wait_for_function(READY)
            if set(pending) <= {"move"}:
                for place, before in zip(page.evaluate(PLACES), places, strict=True):
                    assert place == pytest.approx(before, abs=0.011)
            text = (beside if beside.exists() else track).read_bytes()
            assert page.evaluate("() => window.designer.link.digest") == hashlib.sha256(text).hexdigest()
    assert accepted > kills
