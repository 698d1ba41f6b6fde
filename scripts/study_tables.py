"""What a study prints: Markdown tables, and claims that hold or do not."""

from collections.abc import Sequence
from dataclasses import dataclass

from study_jobs import Record, race_time

SLOWER = 0.005  # s, by which two certified race times of the same optimum may differ
WORDS = ("course", "limit", "tighter limit", "wind", "gates", "best way", "ways", "outcome", "message")


@dataclass(frozen=True)
class Claim:
    """Something that must show, and whether it does."""

    text: str
    holds: bool


def table(title: str, headings: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print a table under a title; without rows, say that there is nothing in it."""
    print(f"\n**{title}**\n")
    if not rows:
        print("none")
        return
    rule = ["---" if heading in WORDS else "---:" for heading in headings]
    for line in (headings, rule, *rows):
        print(f"| {' | '.join(' '.join(cell.replace('|', '/').split()) for cell in line)} |")


def verdict(claims: Sequence[Claim]) -> int:
    """Print all claims; the exit code, 0 if all of them hold."""
    print()
    for claim in claims:
        print(f"- {'holds' if claim.holds else 'FAILS'}: {claim.text}")
    return 0 if all(claim.holds for claim in claims) else 1


def seconds(value: float | None, digits: int = 3) -> str:
    """A race time, a dash where there is none."""
    return "-" if value is None else f"{value:.{digits}f}"


def difference(value: float | None, base: float | None) -> str:
    """Of two race times, signed."""
    return "-" if value is None or base is None else f"{value - base:+.3f}"


def time_or_outcome(record: Record) -> str:
    """The race time of a certified flight, else how it ended."""
    time = race_time(record)
    return record["outcome"] if time is None else seconds(time)
