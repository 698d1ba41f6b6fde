"""Drag gates in the designer, in a real browser, and hold what the page shows against the run of the saved file.

    python scripts/measure_drags.py [COURSE ...] [--drags 50]

Needs the extra `design`, Chromium and playwright. Drags go in turn over the courses, each from the shipped layout: a
gate or pylon by 5 m in one of eight directions. The prediction is that of the sensitivities, shown while the hand
moves, and held against the first answer; changes below a millisecond are not compared. The page then rests until it has
looked for other routes. `later` is by how much the saved file, optimised from scratch to
the point mass, is slower than the page, and `faster` by how much it is faster.
"""

import argparse
import math
import statistics
import sys
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from playwright.sync_api import Browser, Page, sync_playwright

import airrace
from airrace.design.designer import Designer
from airrace.design.server import DesignServer
from airrace.pages.report.browser import browser_path

COURSES = ("rovinj_2014", "chiba_2015", "air_race_x_2024")
STEP = 5.0  # m
LEAST = 1e-3  # s
SPOT = """(path) => {
  const { plan } = window.designer;
  const one = plan.pieces().find((piece) => piece.path.join(".") === path).spots[0];
  const [{ north, east, scale }, box] = [plan.view, plan.svg.getBoundingClientRect()];
  return [box.left + box.width / 2 + (one.east - east) / scale, box.top + box.height / 2 - (one.north - north) / scale,
    scale];
}"""
GATES = """() => window.designer.plan.pieces().filter((piece) => piece.path[0] === "gates" && piece.spots.length)
  .map((piece) => piece.path.join("."))"""
SETTLED = """(revision) => {
  const { state } = window.designer.link;
  const [session] = state?.sessions ?? [{}];
  const asked = state && state.revision >= revision && session.answered === state.request;
  const found = session.holds ? session.slope_time === session.time : session.busy === "";
  return asked && found && !window.designer.plan.hand;
}"""


def time_of(page: Page, shown: str = ".time") -> float:
    return float(page.locator(shown).get_attribute("data-time") or "nan")


def settle(page: Page, revision: int) -> float:
    page.wait_for_function(SETTLED, arg=revision, timeout=600_000)
    return time_of(page)


def rest(page: Page) -> float:
    """The time that the page shows once other routes were looked for."""
    page.wait_for_timeout(1500)
    page.wait_for_function("() => window.designer.link.state.sessions[0].busy === ''", timeout=600_000)
    return time_of(page)


@contextmanager
def desk(track: Path, browser: Browser) -> Iterator[Page]:
    """The page that shows a course."""
    designer = Designer(track)
    server = DesignServer(designer)
    thread = threading.Thread(target=lambda: server.run(browser=False))
    thread.start()
    page = browser.new_page(viewport={"width": 1400, "height": 850})
    page.goto(server.address)
    try:
        yield page
    finally:
        page.close()
        server.stop()
        thread.join()
        designer.close()


Drag = tuple[float, float, float, float, str, str]


def drags(course: str, number: int, first: int, browser: Browser) -> Iterator[Drag]:
    """Yield the times before, predicted, answered and after a rest, the saved text and the gate of each drag."""
    with tempfile.TemporaryDirectory() as folder:
        track = airrace.init(Path(folder) / "course", like=course)
        with desk(track, browser) as page:
            before, revision = settle(page, 0), 0
            page.click("#fit")
            gates = page.evaluate(GATES)
            for count in range(first, first + number):
                gate, angle = gates[count % len(gates)], math.tau * (count % 8) / 8
                x, y, scale = page.evaluate(SPOT, gate)
                page.mouse.move(x, y)
                page.mouse.down()
                page.mouse.move(x + STEP * math.sin(angle) / scale, y - STEP * math.cos(angle) / scale)
                predicted = time_of(page, ".time.guess")
                page.mouse.up()
                revision += 1
                after = settle(page, revision)
                rested = rest(page)
                page.keyboard.press("Control+s")
                page.wait_for_selector("#save:disabled")
                yield before, predicted, after, rested, track.read_text(encoding="utf-8"), gate
                page.keyboard.press("Control+z")
                revision += 1
                settle(page, revision)


def main() -> int:
    """Measure, print a table, and return 1 if a saved file is faster than the page by more than 5 ms."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("courses", nargs="*", default=COURSES)
    parser.add_argument("--drags", type=int, default=50)
    chosen = parser.parse_args()
    wide = 0
    print("| course | drags | prediction off by, median | at most | faster, ms, at most | later, ms, at most |")
    print("|---|---:|---:|---:|---:|---:|")
    with sync_playwright() as playwright, tempfile.TemporaryDirectory() as folder:
        browser = playwright.chromium.launch(executable_path=browser_path("gates are dragged"), args=["--no-sandbox"])
        number = len(chosen.courses)
        ends = [round(chosen.drags * (count + 1) / number) for count in range(number)]
        first = 0
        for course, last in zip(chosen.courses, ends, strict=True):
            off, gaps = list[float](), list[float]()
            for before, predicted, after, rested, text, gate in drags(course, last - first, first, browser):
                if abs(after - before) > LEAST:
                    off.append(abs(predicted - after) / abs(after - before))
                saved = Path(folder) / "saved.yaml"
                saved.write_text(text, encoding="utf-8")
                gaps.append(1e3 * (airrace.optimize(saved, until="point-mass").race_time - rested))
                times = f"{before:.4f} -> {predicted:.4f}, {after:.4f}"
                print(f"  {course} {gate}: {times}, {gaps[-1]:+.2f} ms", file=sys.stderr)
            wide += sum(gap < -5.0 for gap in gaps)
            shares = f"{statistics.median(off):.1%} | {max(off):.1%}"
            print(
                f"| {course} | {len(gaps)} | {shares} | {max(0.0, -min(gaps)):.1f} | {max(0.0, *gaps):.1f} |",
                flush=True,
            )
            first = last
        browser.close()
    return int(wide > 0)


if __name__ == "__main__":
    sys.exit(main())
