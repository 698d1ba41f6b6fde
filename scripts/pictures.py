"""Draw the pictures of the documentation with the commands themselves.

Needs the extra `plot`; those of the report, its scene, the card and the printed case need Chromium, the last pdftoppm
as well.

    python scripts/pictures.py [--runs FOLDER] [--only NAME ...]

Flights are kept in the folder of `--runs`; those that lie there already are not flown again.
"""

import argparse
import base64
import io
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PICTURES = ROOT / "docs" / "figures"
COMMAND = (sys.executable, "-P", "-m", "airrace")
PLAN = ("--guess", "plan")
POINT_MASS = ("--until", "point-mass", *PLAN)
WIND = ("--set", "environment.wind.speed_kt=15", "--set")
WEST_WIND = ("--set", "environment.wind.speed_kt=20", "--set", "environment.wind.from_deg=270")
NO_FLOOR = ("--set", "rules.floor_m=10")
NO_LINE = ("--set", "course.lap.4.safety_lines=null", "--set", "safety_lines=null")

DAY = ("--aircraft", "my_extra.yaml", "--set", "environment.wind.from_deg=320", "--set", "environment.wind.speed_kt=8")
TODAY = ("harbour.yaml", *DAY, "--until", "point-mass")
SIMPLE = ("--search", "off")
MANUAL = (
    *("--mass", "730kg", "--span", "7.5m", "--area", "10.44m2", "--power", "315hp", "--stall", "55kt"),
    *("--speed-max", "343km/h", "--climb", "3300ft/min", "--roll-rate", "400", "--n-z", "10", "--speed-limit", "220kt"),
    *("--manual-mass", "820kg", "--manual-power", "300hp"),
)
"""The aircraft, the day and the runs of the page on a Saturday at the race."""

FLIGHTS: dict[str, tuple[str, ...]] = {
    "rovinj": ("rovinj_2014", *PLAN),
    "reserve": ("rovinj_2014", *PLAN, "--reserve", "0.9"),
    "pc9": ("rovinj_2014", "--aircraft", "pc9", *POINT_MASS),
    "extra": ("rovinj_2014", "--aircraft", "extra330sc", *POINT_MASS),
    "flown_ada": ("rovinj_2014", "--set", "rules.n_z_max=7.5", "--set", "rules.start_speed_max_kt=195", *POINT_MASS),
    "flown_bo": ("rovinj_2014", "--set", "rules.start_speed_max_kt=180", *POINT_MASS),
    "wind_240": ("rovinj_2014", *WIND, "environment.wind.from_deg=240", *POINT_MASS),
    "wind_280": ("rovinj_2014", *WIND, "environment.wind.from_deg=280", *POINT_MASS),
    "over_the_top": ("abu_dhabi_2016", *POINT_MASS),
    "flat": ("abu_dhabi_2016", *NO_LINE, *POINT_MASS),
    "half_cuban_eight": ("half_cuban_eight",),
    "half_cuban_eight_west": ("half_cuban_eight", *WEST_WIND),
    "no_limits": ("half_cuban_eight", "--set", "rules.pilot=none", *NO_FLOOR),
    "race_pilot": ("half_cuban_eight", "--set", "rules.pilot=race", *NO_FLOOR),
    "sprint": ("sprint.yaml", *POINT_MASS),
    "stands": ("stands.yaml", *POINT_MASS),
    "harbour": ("harbour.yaml",),
    "today": TODAY,
    "run1": (*TODAY, *SIMPLE, "--set", "rules.n_z_max=7.5"),
    "run2": (*TODAY, *SIMPLE, "--set", "rules.start_speed_max_kt=185"),
    "run3": (*TODAY, *SIMPLE, "--set", "rules.n_z_max=8.5", "--set", "rules.start_speed_max_kt=193"),
}
"""What `airrace optimize` is given, by the name of the checkpoint; the sprint is the course that `init` writes, and
the harbour what it makes of the placemarks among the examples.

The stands of the sprint are those of the page on what falls where.
"""
STANDS = """
crowd:
  stands:
    polygon:
      - {north_m: 200, east_m: 860}
      - {north_m: 400, east_m: 860}
      - {north_m: 400, east_m: 900}
      - {north_m: 200, east_m: 900}
    distance_m: 300
"""

ERRORS = ("--power-error", "0", "--density-error", "0", "--roll-timing", "0")

CALLS: dict[str, tuple[str, ...]] = {
    "rovinj_2014": ("plot", "rovinj.h5", "--output"),
    "kneeboard": ("plot", "rovinj.h5", "--kneeboard", "--output"),
    "half_cuban_eight": ("plot", "half_cuban_eight.h5", "--output"),
    "sprint_flight": ("plot", "sprint.h5", "--output"),
    "sprint": ("check", "sprint.yaml", "--plot"),
    "abu_dhabi_2016": ("check", "abu_dhabi_2016", "--plot"),
    "sixteen_phases": ("check", "sixteen_phases", "--plot"),
    "aircraft": ("compare", "rovinj.h5:point-mass", "pc9.h5", "--plot"),
    "own_aircraft": ("compare", "rovinj.h5:point-mass", "extra.h5", "--plot"),
    "wind": ("compare", "wind_240.h5", "wind_280.h5", "--plot"),
    "fidelity": ("compare", "rovinj.h5:point-mass", "rovinj.h5:six-dof", "--plot"),
    "pilot_limits": ("compare", "no_limits.h5", "race_pilot.h5", "--plot"),
    "harbour": ("check", "harbour.yaml", "--plot"),
    "envelope": ("safety", "rovinj.h5", "--output"),
    "envelope_reserve": ("safety", "reserve.h5", *("--wind-error", "0", "--mass-error", "0"), *ERRORS, "--output"),
    "footprint": ("footprint", "stands.h5", "--output"),
    "routes": ("compare", "over_the_top.h5", "flat.h5", "--plot"),
}
"""The command that draws a picture, up to the name of its file."""


def call(runs: Path, *arguments: str) -> None:
    """Run a command in the folder of the flights."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    subprocess.run([*COMMAND, *arguments], cwd=runs, env=environment, check=True, stdout=subprocess.DEVNULL)


def draw(name: str, runs: Path) -> None:
    """Draw a picture."""
    for word in CALLS[name]:
        flight = word.partition(":")[0].removesuffix(".h5")
        if word.partition(":")[0].endswith(".h5") and not (runs / f"{flight}.h5").exists():
            call(runs, "optimize", *FLIGHTS[flight], "--output", f"{flight}.h5", "--quiet")
    path = PICTURES / f"{name}.png"
    path.unlink(missing_ok=True)
    call(runs, *CALLS[name], str(path))
    shrink(path)


def shrink(path: Path) -> None:
    """Shrink a picture to a palette of 128 colours."""
    from PIL import Image

    with Image.open(path) as image:
        width = min(image.width, 1200)
        small = image.convert("RGB").resize((width, image.height * width // image.width), Image.Resampling.LANCZOS)
        small.quantize(128, dither=Image.Dither.NONE).save(path, optimize=True)


def photograph_report(runs: Path) -> None:
    """The first screen of the report of Rovinj 2014 as a browser shows it."""
    from playwright.sync_api import sync_playwright

    report = runs / "rovinj.html"
    call(runs, "report", "rovinj.h5", "rovinj.h5:point-mass", "--force", "--output", str(report))
    options = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"]
    with sync_playwright() as playwright:
        path = shutil.which("chromium") or shutil.which("google-chrome")
        browser = playwright.chromium.launch(executable_path=path, args=options)
        page = browser.new_context(viewport={"width": 1480, "height": 900}, offline=True).new_page()
        page.goto(report.resolve().as_uri())
        page.wait_for_selector("html.ready", state="attached", timeout=120_000)
        page.click("button[data-view=orbit]")
        page.select_option("[data-size]", "5")
        page.evaluate("airrace.clock.set(27.2); document.activeElement.blur()")
        page.wait_for_timeout(2_000)
        page.screenshot(path=PICTURES / "report.jpg", type="jpeg", quality=84)
        browser.close()


VIEWS = ((10.0, "orbit"), (27.2, "above"), (27.2, "side"), (7.5, "chase"), (12.0, "cockpit"), (21.0, "tv"))
FILM = (*((time, "tv") for time in (1.0, 9.0, 18.5, 58.0)), (54.5, "replay 1"), (60.2, "result"))
"""Instants (s) and views of the pictures of a sheet."""


def photograph_scene(runs: Path, name: str, shots: Sequence[tuple[float, str]]) -> None:
    """Pictures of the scene of Rovinj 2014 with two ghosts on one sheet, two beside one another."""
    from PIL import Image

    from airrace.pages.report.browser import SOFTWARE, page_in_browser

    flights = ("rovinj", "extra", "wind_240")
    for flight in flights:
        if not (runs / f"{flight}.h5").exists():
            call(runs, "optimize", *FLIGHTS[flight], "--output", f"{flight}.h5", "--quiet")
    call(runs, "report", *(f"{flight}.h5" for flight in flights), "--no-verify", "--force", "--output", "scene.html")
    with page_in_browser((runs / "scene.html").read_text(encoding="utf-8"), "pictures are drawn", SOFTWARE) as page:
        frames = [base64.b64decode(page.value(f"airrace.film.frame({t}, '{view}', 960, 540)")) for t, view in shots]
    pictures = [Image.open(io.BytesIO(one)).resize((600, 338), Image.Resampling.LANCZOS) for one in frames]
    sheet = Image.new("RGB", (1200, 338 * ((len(pictures) + 1) // 2)))
    for number, picture in enumerate(pictures):
        sheet.paste(picture, (600 * (number % 2), 338 * (number // 2)))
    sheet.save(PICTURES / f"{name}.jpg", quality=84, optimize=True)


def draw_card(runs: Path) -> None:
    """The card of Rovinj 2014."""
    from PIL import Image

    call(runs, "card", "rovinj.h5", "--force", "--output", "card.png")
    with Image.open(runs / "card.png") as card:
        card.convert("RGB").save(PICTURES / "card.jpg", quality=84, optimize=True)


def draw_lost_time(runs: Path) -> None:
    """Two flights of Rovinj 2014, recorded at 10 Hz and imported again, in the colours of the time lost."""
    for flight in ("rovinj", "flown_ada", "flown_bo"):
        if not (runs / f"{flight}.h5").exists():
            call(runs, "optimize", *FLIGHTS[flight], "--output", f"{flight}.h5", "--quiet")
    for pilot in ("ada", "bo"):
        call(runs, "export", "csv", f"flown_{pilot}.h5", "--rate", "10", "--output", f"{pilot}.csv", "--force")
        call(runs, "import", f"{pilot}.csv", "--course", "rovinj_2014", "--output", f"{pilot}.h5", "--force")
    path = PICTURES / "lost_time.png"
    call(runs, "compare", "rovinj.h5", "ada.h5", "bo.h5", "--map", str(path), "--force")
    shrink(path)


def draw_saturday(runs: Path) -> None:
    """The debrief of a day, the maps of what was lost, and the card of a duel: three runs recorded at 10 Hz."""
    from PIL import Image
    from playwright.sync_api import sync_playwright

    call(runs, "aircraft", "My Extra", "--from", "edge540", *MANUAL, "--output", "my_extra.yaml", "--force")
    logs = ("run1", "run2", "run3")
    for flight in ("today", *logs):
        optimum = "today.h5" if flight == "today" else f"{flight}_optimum.h5"
        if not (runs / optimum).exists():
            call(runs, "optimize", *FLIGHTS[flight], "--output", optimum, "--quiet")
    for log in logs:
        call(runs, "export", "csv", f"{log}_optimum.h5", "--rate", "10", "--output", f"{log}.csv", "--force")
        call(runs, "import", f"{log}.csv", "--course", "harbour.yaml", *DAY, "--output", f"{log}.h5", "--force")
    path = PICTURES / "debrief_losses.png"
    call(runs, "compare", "today.h5", "run1.h5", "run2.h5", "--map", str(path), "--force")
    shrink(path)
    call(runs, "card", "run1.h5", "run3.h5", "--output", "duel.png", "--force")
    with Image.open(runs / "duel.png") as duel:
        duel.convert("RGB").save(PICTURES / "duel.jpg", quality=84, optimize=True)
    call(runs, "report", "today.h5", *(f"{log}.h5" for log in logs), "--force", "--output", "debrief.html")
    options = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"]
    with sync_playwright() as playwright:
        chromium = shutil.which("chromium") or shutil.which("google-chrome")
        browser = playwright.chromium.launch(executable_path=chromium, args=options)
        page = browser.new_context(viewport={"width": 1480, "height": 900}, offline=True).new_page()
        page.goto((runs / "debrief.html").resolve().as_uri())
        page.wait_for_selector("html.ready", state="attached", timeout=120_000)
        page.select_option("[data-size]", "5")
        page.select_option("[data-axis]", "distance")
        page.evaluate("airrace.clock.set(11.5); document.activeElement.blur()")
        page.wait_for_timeout(2_000)
        page.screenshot(path=PICTURES / "debrief.jpg", type="jpeg", quality=84)
        browser.close()


def draw_figure_4(runs: Path) -> None:
    """The Half Cuban Eight in still air and in wind from the west, as in figure 4 of the paper."""
    import matplotlib.pyplot as plt

    import airrace

    figure = plt.figure(figsize=(10.0, 4.6), layout="constrained")
    in_space, along = figure.add_subplot(1, 2, 1, projection="3d"), figure.add_subplot(1, 2, 2)
    for name, label, colour in (
        ("half_cuban_eight", "still air", "tab:blue"),
        ("half_cuban_eight_west", "20 kt from the west", "0.5"),
    ):
        if not (runs / f"{name}.h5").exists():
            call(runs, "optimize", *FLIGHTS[name], "--output", f"{name}.h5", "--quiet")
        flight = airrace.open(runs / f"{name}.h5")["six-dof"].to_dataframe()
        in_space.plot(flight["y_m"], flight["x_m"], flight["height_m"], color=colour, label=label)
        along.plot(flight["y_m"], flight["height_m"], color=colour, label=label)
    in_space.set(xlabel="east m", ylabel="north m", zlabel="height m", xlim=(-150, 150))
    in_space.view_init(elev=18.0, azim=-50.0)
    along.set(xlabel="east m (the wind blows from the left)", ylabel="height m", aspect="equal", xlim=(-80, 80))
    in_space.legend(loc="upper left")
    path = PICTURES / "half_cuban_eight_wind.png"
    figure.savefig(path, dpi=120)
    shrink(path)


def print_case(runs: Path) -> None:
    """The first pages of the printed case of the harbour, side by side."""
    from PIL import Image

    for page in runs.glob("case-*.png"):
        page.unlink()
    for name in ("edge540", "mxs_r"):
        call(runs, "optimize", *FLIGHTS["harbour"], "--aircraft", name, "--output", f"{name}.h5", "--force", "--quiet")
    stated = ("--for", "Civil Aviation Authority", "--valid", "2026-12-05", "--revision", "2")
    signing = ("--sign-for", "Race director", "--sign-for", "Authority")
    call(
        runs,
        "safety",
        "edge540.h5",
        "mxs_r.h5",
        "--winds",
        "0,5kt@2",
        *stated,
        *signing,
        "--output",
        "case.pdf",
        "--force",
    )
    subprocess.run(["pdftoppm", "-png", "-r", "72", "-l", "2", "case.pdf", "case"], cwd=runs, check=True)
    pages = [Image.open(path) for path in sorted(runs.glob("case-*.png"))]
    sheet = Image.new("RGB", (sum(page.width + 12 for page in pages) - 12, pages[0].height), "#888888")
    for number, page in enumerate(pages):
        sheet.paste(page, (number * (page.width + 12), 0))
    sheet.save(PICTURES / "case.png")
    shrink(PICTURES / "case.png")


PRINTED: dict[str, Callable[[Path], None]] = {
    "card": draw_card,
    "case": print_case,
    "half_cuban_eight_wind": draw_figure_4,
    "lost_time": draw_lost_time,
    "saturday": draw_saturday,
    "report": photograph_report,
    "views": lambda runs: photograph_scene(runs, "views", VIEWS),
    "film": lambda runs: photograph_scene(runs, "film", FILM),
}
"""What makes the pictures that no command draws."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=Path, default=Path("runs"), help="folder of the flights")
    parser.add_argument("--only", nargs="+", choices=[*CALLS, *PRINTED], default=[*CALLS, *PRINTED], metavar="NAME")
    chosen = parser.parse_args()
    runs = chosen.runs.resolve()
    runs.mkdir(parents=True, exist_ok=True)
    if not (runs / "sprint.yaml").exists():
        call(runs, "init", "sprint")
    sprint = (runs / "sprint.yaml").read_text(encoding="utf-8")
    (runs / "stands.yaml").write_text(sprint + STANDS, encoding="utf-8")
    if not (runs / "harbour.yaml").exists():
        call(runs, "init", "harbour", "--from", str(ROOT / "docs" / "examples" / "harbour.kml"))
    for name in chosen.only:
        PRINTED[name](runs) if name in PRINTED else draw(name, runs)


if __name__ == "__main__":
    main()
