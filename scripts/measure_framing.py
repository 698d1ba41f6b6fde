"""Count the pictures of films that break a rule of framing, and those that show the other flights.

Every 0.04 s of reports up to the last finish, in the three formats; needs Chromium.

    python scripts/measure_framing.py REPORT.html ...
"""

import argparse
import json
from collections import Counter
from pathlib import Path

from airrace.pages.report.browser import SOFTWARE, page_in_browser
from airrace.pages.report.film import SIZES

PROGRAM = """(() => {
  const view = airrace.scene.views.get("tv"), counts = {};
  const [width, height] = %s, add = (name) => { counts[name] = (counts[name] ?? 0) + 1; };
  for (let time = 0; time <= airrace.film.end; time += 0.04) {
    const [lead, ...others] = view.directorAt(time).flights;
    const { broken, hidden } = view.framing(width, height, time);
    add("pictures");
    broken.forEach(add);
    if (hidden && lead.passings.some((passing) => Math.abs(passing.time - time) <= 0.1)) add("hidden");
    for (const other of others) {
      const place = other.position(time), away = place.distanceTo(lead.position(time));
      const { x, y, z } = place.project(view.camera);
      const range = away < 150 ? "up to 150 m" : away < 400 ? "up to 400 m" : "farther";
      add(`others ${range}`);
      if (z < 1 && Math.abs(x) < 1 && Math.abs(y) < 1) add(`in the picture ${range}`);
    }
  }
  const across = (time) => view.framing(width, height, time).across;
  for (const { from } of view.director.shots(width / height).slice(1)) {
    const [before, after] = [across(from - 1e-6), across(from)];
    if (before * after < 0 && Math.min(Math.abs(before), Math.abs(after)) > 0.25) add("jumps");
  }
  return JSON.stringify(counts);
})()"""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("reports", type=Path, nargs="+")
    total: Counter[str] = Counter()
    for report in parser.parse_args().reports:
        with page_in_browser(report.read_text(encoding="utf-8"), "pictures are drawn", SOFTWARE) as page:
            for name, size in SIZES.items():
                counts = Counter[str](json.loads(page.value(PROGRAM % list(size))))
                total += counts
                print(report.stem, name, dict(counts))
    print("all", dict(total))


if __name__ == "__main__":
    main()
