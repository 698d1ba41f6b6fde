"""Time the pictures of a report's scene: milliseconds per picture of each view, and what draws them.

Needs Chromium. Without `--hardware` the processor draws.

    python scripts/benchmark_scene.py REPORT.html [--size 1280x720] [--hardware]
"""

import argparse
from pathlib import Path

from airrace.pages.report.browser import HARDWARE, SOFTWARE, page_in_browser
from airrace.pages.report.film import FilmView

PICTURES = 20
PROGRAM = """(() => {
  const { film, scene, clock, flights } = airrace, gl = scene.renderer.getContext(), pixel = new Uint8Array(4);
  const view = scene.views.get("%s");
  const draw = (i) => {
    clock.time = (i / %d) * flights[0].duration;
    scene.draw(%d, %d, 1, view, [0, 0]);
    gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel); // waits until it is drawn
  };
  draw(0);
  const begun = performance.now();
  for (let i = 0; i < %d; i += 1) draw(i);
  return (performance.now() - begun) / %d;
})()"""
NAME = """(() => {
  const gl = airrace.scene.renderer.getContext(), known = gl.getExtension("WEBGL_debug_renderer_info");
  return gl.getParameter(known ? known.UNMASKED_RENDERER_WEBGL : gl.RENDERER);
})()"""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("report", type=Path)
    parser.add_argument("--size", default="1280x720")
    parser.add_argument("--hardware", action="store_true", help="let the graphics card draw")
    chosen = parser.parse_args()
    width, height = map(int, chosen.size.split("x"))
    page = chosen.report.read_text(encoding="utf-8")
    with page_in_browser(page, "pictures are drawn", HARDWARE if chosen.hardware else SOFTWARE) as shown:
        print(shown.value(NAME))
        for view in FilmView:
            took = shown.value(PROGRAM % (view, PICTURES, width, height, PICTURES, PICTURES))
            print(f"{view:8} {took:6.0f} ms {1e3 / took:6.1f} pictures/s")


if __name__ == "__main__":
    main()
