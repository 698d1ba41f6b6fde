"""Every command of the command line, to be run in a folder that holds a course, a log and a run."""

import shutil
import tempfile
from pathlib import Path

from airrace_command import ALONG_THE_PLAN, HALF_CUBAN, POINT_MASS, ROOT, airrace
from disk_cache import cached_across_workers

COURSE = "course.yaml"
LOG = "log.csv"
RUN = "run.h5"
BATCH = ("batch", COURSE, *POINT_MASS, "--set", "settings.guess=plan", "--set", "settings.search=off")
OPTIMIZE = ("optimize", COURSE, *ALONG_THE_PLAN)

COMMANDS: tuple[tuple[str, ...], ...] = (
    (*OPTIMIZE, "--search", "quick", "--threads", "2"),
    ("resume", RUN, "--from", "point-mass", *POINT_MASS),
    BATCH,
    *(("export", form, RUN) for form in ("csv", "parquet", "netcdf", "mat", "hdf5")),
    *(("export", form, RUN, "--origin", "45,16,150") for form in ("kml", "acmi", "fdr", "czml", "gpx", "geojson")),
    ("import", LOG, "--course", "rovinj_2014", "--time-zone", "Europe/Zagreb"),
    ("report", RUN),
    ("report", RUN, "--sensitivities", "--output", "prices.html"),
    ("show", RUN),
    ("brief", RUN),
    ("compare", RUN, RUN),
    ("compare", RUN, RUN, "--plot", "compared.svg"),
    ("compare", RUN, RUN, "--cost-to-go"),
    ("follow", RUN, "--replay", RUN, "--speed", "0", "--every", "5"),
    ("plot", RUN),
    ("verify", RUN),
    ("sensitivity", RUN),
    ("handicap", RUN, "--wind", "240/12"),
    ("footprint", RUN),
    ("footprint", RUN, "--output", "fallen.csv"),
    ("check", COURSE),
    ("tracks",),
    ("init", "mine"),
    ("aircraft", "mine", "--from", "edge540", "--stall", "57kt"),
    ("schema", "track"),
    ("--help",),
)


def furnish(folder: Path) -> Path:
    """Put the course, the log and the run there."""
    put_inputs(folder)
    (folder / RUN).write_bytes(run_file())
    return folder


def put_inputs(folder: Path) -> None:
    shutil.copy(HALF_CUBAN, folder / COURSE)
    shutil.copy(ROOT / "tests" / "flights" / "logs" / "rovinj_2014.csv", folder / LOG)


@cached_across_workers
def run_file() -> bytes:
    """The run, flown once for all that read it."""
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        put_inputs(place)
        ran = airrace(*OPTIMIZE, "--output", RUN, cwd=place)
        assert ran.code == 0, ran.err
        return (place / RUN).read_bytes()
