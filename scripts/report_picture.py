"""A picture of a report as a browser shows it, for the documentation.

    python scripts/report_picture.py report.html docs/figures/report.png --at 27.2 --view orbit

It takes playwright (which the extra `test` brings along) and a Chromium that is installed.
"""

import argparse
import shutil
from pathlib import Path

from playwright.sync_api import sync_playwright

SOFTWARE = ("--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist")


def report_picture(report: Path, path: Path, *, at: float, view: str, width: int, height: int, enlarged: str) -> None:
    """Write the picture of the first screen.

    Args:
        report: the page.
        path: of the picture.
        at: the time that its clock shows, s.
        view: from where the scene is seen.
        width, height: of the screen, pixels.
        enlarged: how many times as large as it is the aircraft is drawn.
    """
    browser_path = shutil.which("chromium") or shutil.which("google-chrome")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=browser_path, args=["--no-sandbox", *SOFTWARE])
        page = browser.new_context(viewport={"width": width, "height": height}, offline=True).new_page()
        page.goto(report.resolve().as_uri())
        page.wait_for_selector("html.ready", state="attached", timeout=120_000)
        page.click(f"button[data-view={view}]")
        page.select_option("[data-size]", enlarged)
        page.evaluate("time => { airrace.clock.set(time); document.activeElement.blur(); }", at)
        page.wait_for_timeout(2_000)
        page.screenshot(path=path)
        browser.close()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("report", type=Path)
    parser.add_argument("picture", type=Path)
    parser.add_argument("--at", type=float, default=0.0, help="time on the clock, s")
    parser.add_argument("--view", default="orbit", choices=("orbit", "above", "side", "chase", "cockpit"))
    parser.add_argument("--size", type=int, nargs=2, default=(1480, 900), metavar=("WIDTH", "HEIGHT"))
    parser.add_argument("--enlarged", default="5", choices=("1", "5", "15"), help="size of the aircraft")
    given = parser.parse_args()
    width, height = given.size
    report_picture(
        given.report, given.picture, at=given.at, view=given.view, width=width, height=height, enlarged=given.enlarged
    )


if __name__ == "__main__":
    main()
