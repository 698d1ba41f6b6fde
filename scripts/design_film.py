"""Record a session of the designer on the course that `airrace init` writes: a film and a picture for its guide.

    python scripts/design_film.py [FOLDER]

Needs the extra `design`, Chromium, playwright and Pillow. A pylon and a gate are dragged, a gate is turned, and the
wind rises; the page is photographed on the way, so that it moves as fast as the machine solves.
"""

import io
import sys
import tempfile
import threading
from pathlib import Path

from PIL import Image
from playwright.sync_api import Page, sync_playwright

import airrace
from airrace.design.designer import Designer
from airrace.design.server import DesignServer
from airrace.pages.report.browser import browser_path

PICTURES = Path(__file__).resolve().parents[1] / "docs" / "figures"
SIZE = {"width": 1240, "height": 720}
FILM_WIDTH, FRAME_MS, COLOURS = 880, 120, 96
STEPS = 8
"""Photographs of a movement of the hand."""
AT = """([path, turn]) => {
  const { plan } = window.designer;
  const one = plan.pieces().find((piece) => piece.path.join(".") === path).spots[0];
  const box = plan.svg.getBoundingClientRect();
  const [{ north, east, scale }, handle] = [plan.view, turn && document.querySelector("[data-turn]")];
  if (handle) {
    const round = handle.getBoundingClientRect();
    return [round.left + round.width / 2, round.top + round.height / 2, scale];
  }
  return [box.left + box.width / 2 + (one.east - east) / scale, box.top + box.height / 2 - (one.north - north) / scale,
    scale];
}"""
SETTLED = """() => {
  const { state } = window.designer.link;
  const [session] = state?.sessions ?? [{}];
  return state && session.answered === state.request && session.slope_time === session.time
    && !window.designer.plan.hand;
}"""


class Film:
    """The photographs of a page."""

    def __init__(self, page: Page) -> None:
        self.page = page
        self.frames: list[Image.Image] = []

    def shoot(self, times: int = 1) -> None:
        picture = Image.open(io.BytesIO(self.page.screenshot())).convert("RGB")
        height = round(FILM_WIDTH * picture.height / picture.width)
        self.frames += [picture.resize((FILM_WIDTH, height), Image.Resampling.LANCZOS)] * times

    def drag(self, piece: str, right: float, up: float, *, turn: bool = False) -> None:
        """Drag a piece, or the handle that turns it, by metres; wait for the answer."""
        x, y, scale = self.page.evaluate(AT, [f"gates.{piece}", turn])
        self.page.mouse.move(x, y)
        self.page.mouse.down()
        for step in range(1, STEPS + 1):
            share = step / STEPS / scale
            self.page.mouse.move(x + share * right, y - share * up)
            self.shoot()
        self.page.mouse.up()
        self.page.wait_for_function(SETTLED)
        self.shoot(6)

    def save(self, path: Path) -> None:
        palette = [frame.quantize(COLOURS, method=Image.Quantize.MAXCOVERAGE) for frame in self.frames]
        palette[0].save(path, save_all=True, append_images=palette[1:], duration=FRAME_MS, loop=0, optimize=True)


def main() -> int:
    """Record, and say what was written."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else PICTURES
    with tempfile.TemporaryDirectory() as place:
        designer = Designer(airrace.init(Path(place) / "sprint"))
        server = DesignServer(designer)
        thread = threading.Thread(target=lambda: server.run(browser=False))
        thread.start()
        with sync_playwright() as playwright:
            browser = playwright.chromium.launch(executable_path=browser_path("a film is made"), args=["--no-sandbox"])
            page = browser.new_page(viewport=SIZE)
            page.goto(server.address)
            page.wait_for_function(SETTLED, timeout=300_000)
            page.click("#fit")
            film = Film(page)
            film.shoot(6)
            film.drag("corner", -70.0, -40.0)
            page.screenshot(path=folder / "design.png")
            film.drag("edge", 90.0, 20.0)
            film.drag("edge", 60.0, -60.0, turn=True)
            for speed in (4, 8, 12, 16, 20):
                page.locator("[name='environment.wind.speed_kt']").fill(str(speed))
                page.wait_for_timeout(600)
                film.shoot(2)
            page.wait_for_timeout(3000)
            film.shoot(12)
            film.save(folder / "design.gif")
            browser.close()
        server.stop()
        thread.join()
        designer.close()
    for name in ("design.png", "design.gif"):
        print(f"{folder / name}: {(folder / name).stat().st_size / 1024:.0f} kB")
    return 0


if __name__ == "__main__":
    sys.exit(main())
