"""Is the fastest route found? Five studies of point-mass races, each with tables in Markdown and claims to hold.

    python scripts/study_ways.py [--limits] [COURSE ...] [--generated 0-9] [--points 5] [--only n_z_max=7,8,9]
    python scripts/study_ways.py --case
    python scripts/study_ways.py --symmetry [COURSE ...] [--wind 8]
    python scripts/study_ways.py --random 60 [COURSE ...]
    python scripts/study_ways.py --seeds 50
    python scripts/study_ways.py --found [COURSE ...] --threads 2

- `--limits` sweeps limits from tight to loose: a looser one must not make a race slower by more than 5 ms.
- `--case` is Abu Dhabi 2016 with tight gates, where a wrong route costs 16 s and more.
- `--symmetry`: mirrored, rotated and moved courses take the same time within 5 ms.
- `--random N` holds exploring against the best of N random starts, the ten best of them refined and proved.
- `--seeds N` flies generated courses without exploring and with it: none may become slower.
- `--found` is a table of what exploring found on each course, and of the seconds that it took.

COURSE is the name of a shipped course or a track file; without one, all shipped courses are flown (by `--limits` also
the generated ones of seeds 0-9). Every flight is a process of its own, `--jobs` of them at a time, and a line of
`--output FILE`: what is there is not flown again, so that an interrupted study goes on where it was. A file belongs to
one version of the program: begin another one after a change. Ends with 1 if a claim does not hold.
"""

import argparse
import signal
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import study_comparisons
import study_limits
import study_random
from study_jobs import SHIPPED, Job, Log, Study
from study_tables import Claim, verdict
from survey_courses import numbers

from airrace.errors import InputError

GENERATED = range(10)
WIND_FROM = 200.0  # deg, unless given


def parsed(arguments: Sequence[str] | None) -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("courses", nargs="*", metavar="COURSE", help="names of shipped courses, or track files")
    mode = parser.add_mutually_exclusive_group()
    mode.add_argument("--limits", action="store_true", help="sweep limits from tight to loose; the default")
    mode.add_argument("--case", action="store_true", help="Abu Dhabi 2016 with tight gates")
    mode.add_argument("--symmetry", action="store_true", help="mirrored, rotated and moved courses")
    mode.add_argument("--random", type=int, metavar="N", help="hold exploring against N random starts")
    mode.add_argument("--seeds", type=int, metavar="N", help="generated courses, without exploring and with it")
    mode.add_argument("--found", action="store_true", help="what exploring found, and what it took")
    parser.add_argument("--generated", type=numbers, metavar="0-9", help="generated courses, by their seeds")
    parser.add_argument("--points", type=int, default=5, help="values of each limit; by default 5")
    parser.add_argument(
        "--only",
        action="append",
        default=[],
        metavar="LIMIT[=VALUE,...]",
        help=f"of {', '.join(study_limits.RANGES)}, with values from tight to loose (climb: -5:10,-45:45)",
    )
    parser.add_argument(
        "--wind",
        action="append",
        default=[],
        metavar="M_S[:FROM_DEG]",
        help="of --symmetry, besides the wind of the file; may be repeated",
    )
    parser.add_argument("--guess", choices=("plan", "homotopy"), default="plan", help="by default plan")
    parser.add_argument("--search", default="", metavar="HOW", help="settings.search of all flights; else its default")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="as of airrace optimize")
    parser.add_argument("--jobs", type=int, default=1, help="flights at the same time; by default 1")
    parser.add_argument("--threads", type=int, default=1, help="of each flight; by default 1")
    parser.add_argument("--timeout", type=float, default=900.0, metavar="SECONDS", help="for each flight")
    parser.add_argument("--output", type=Path, metavar="FILE", help="results as JSON lines, taken up again")
    chosen = parser.parse_args(arguments)
    least = {"points": 2, "random": 1, "seeds": 1, "jobs": 1, "threads": 1}
    for name, smallest in least.items():
        value = getattr(chosen, name)
        if value is not None and value < smallest:
            parser.error(f"--{name} must be at least {smallest}, not {value}")
    try:
        chosen.limit_list = study_limits.limits(chosen.points, chosen.only)
        chosen.winds = [wind(text) for text in chosen.wind]
    except ValueError as error:
        parser.error(str(error))
    unknown = [name for name in chosen.courses if name not in SHIPPED and not Path(name).is_file()]
    if unknown:
        parser.error(f"`{unknown[0]}` is neither a track file nor a shipped course; those are {', '.join(SHIPPED)}")
    return chosen


def wind(text: str) -> tuple[float, float]:
    """Speed (m/s) and where from (deg) of `8` or `8:200`.

    Raises:
        ValueError: one of them is not a number.
    """
    speed, _, origin = text.partition(":")
    return float(speed), float(origin) if origin else WIND_FROM


def courses_of(chosen: argparse.Namespace) -> list[str]:
    """The courses of a study."""
    if chosen.seeds is not None:
        return [f"seed {seed}" for seed in range(chosen.seeds)]
    generated = [f"seed {seed}" for seed in chosen.generated or ()]
    if chosen.courses or chosen.generated:
        return [*chosen.courses, *generated]
    others = chosen.symmetry or chosen.random is not None or chosen.found
    return [*SHIPPED, *(() if others else (f"seed {seed}" for seed in GENERATED))]


def studied(chosen: argparse.Namespace, study: Study) -> list[Claim]:
    """Fly and print one study; its claims."""
    either = Job("", tuple(chosen.set), chosen.search, threads=chosen.threads)
    if chosen.case:
        return study_limits.report_case(study_limits.case(study, either))
    base, courses = replace(either, overrides=(*chosen.set, f"settings.guess={chosen.guess}")), courses_of(chosen)
    if chosen.symmetry:
        found = study_comparisons.symmetries(study, courses, base, chosen.winds)
        return study_comparisons.report_symmetries(found)
    if chosen.random is not None:
        return study_random.report(study_random.yardsticks(study, courses, base, chosen.random))
    if chosen.seeds is not None:
        return study_comparisons.report_seeds(study_comparisons.comparisons(study, courses, base))
    if chosen.found:
        return study_comparisons.report_found(study_comparisons.comparisons(study, courses, base))
    return study_limits.report(study_limits.sweep(study, courses, chosen.limit_list, base))


def main(arguments: Sequence[str] | None = None) -> int:
    """Fly, print, judge; the exit code."""
    chosen = parsed(arguments)
    study = Study(Log(chosen.output), chosen.jobs, chosen.timeout)
    try:
        return verdict(studied(chosen, study))
    except InputError as error:
        print(error, file=sys.stderr)
        return 3
    except KeyboardInterrupt:
        return 130


if __name__ == "__main__":
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # told to stop, it stops its flights as at Ctrl-C
    sys.exit(main())
