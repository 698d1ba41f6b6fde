"""Print a course drawn by lot.

    python scripts/generate_course.py SEED [--output FILE] [--aircraft-folder FOLDER]

The same seed gives the same course everywhere; `scripts/random_courses.py` says what is drawn from. The track names
its aircraft in a folder relative to itself: `../configs` unless told otherwise, as for a file in `tracks/`.
"""

import argparse
from pathlib import Path

from random_courses import random_course


def seed(text: str) -> int:
    """A seed: a whole number from 0 on (a negative one would repeat the course of its magnitude)."""
    number = int(text)
    if number < 0:
        raise argparse.ArgumentTypeError(f"{number} is negative; seeds count from 0")
    return number


def main() -> None:
    parser = argparse.ArgumentParser(description="Print a course drawn by lot.")
    parser.add_argument("seed", type=seed)
    parser.add_argument("--output", type=Path, metavar="FILE", help="write to a file instead")
    parser.add_argument("--aircraft-folder", default="../configs", metavar="FOLDER", help="as seen from the track")
    arguments = parser.parse_args()
    text = random_course(arguments.seed, arguments.aircraft_folder)
    if arguments.output is None:
        print(text, end="")
    else:
        arguments.output.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
