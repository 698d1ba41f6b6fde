"""Flights side by side: mirrored, turned and moved courses, exploring and not exploring, what exploring found."""

import itertools
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

from study_jobs import OFF, Job, Record, Study, race_time
from study_tables import SLOWER, Claim, difference, table, time_or_outcome

CHANGES = ("", "mirrored", "rotated", "moved")
QUICK = "quick"
SHARE_OF_RACE = 0.3  # of the race time, that exploring may take
OTHER_SIDE = {"left": "right", "right": "left"}


def best_way(record: Record) -> str:
    """The fastest of the routes that were tried, in words; empty where a record holds none."""
    timed = [one for one in record.get("ways") or [] if one.get("race_time_s") is not None]
    return str(min(timed, key=lambda one: one["race_time_s"]).get("way", "")) if timed else ""


def exchanged(words: str) -> str:
    """A way in words, with left for right and right for left."""
    return re.sub(r"\b(left|right)\b", lambda found: OTHER_SIDE[found[1]], words)


@dataclass(frozen=True)
class Symmetry:
    """A course in a wind, as it is and transformed: records by the name of the change."""

    course: str
    wind: str
    records: dict[str, Record]

    @property
    def spread(self) -> float | None:
        """Largest difference of race times, s; None where one of them is not certified."""
        times = [race_time(record) for record in self.records.values()]
        known = [time for time in times if time is not None]
        return max(known) - min(known) if len(known) == len(times) else None

    @property
    def same_ways(self) -> bool | None:
        """Whether the best way is the same everywhere, in the mirror the mirrored one; None where none is known."""
        ways = {change: best_way(record) for change, record in self.records.items()}
        if not all(ways.values()):
            return None
        return all(way == (exchanged(ways[""]) if change == "mirrored" else ways[""]) for change, way in ways.items())


def symmetries(study: Study, courses: Sequence[str], base: Job, winds: Sequence[tuple[float, float]]) -> list[Symmetry]:
    """Fly courses and their images, in the wind of their files and in others: speed (m/s) and where from (deg)."""
    airs = [("as in the file", ())]
    for speed, origin in winds:
        keys = (f"environment.wind.speed_m_s={speed:g}", f"environment.wind.from_deg={origin:g}")
        airs.append((f"{speed:g} m/s from {origin:g}°", keys))
    flown = list(itertools.product(courses, airs, CHANGES))
    records = study.fly(
        replace(base, course=course, overrides=(*base.overrides, *air[1]), change=change)
        for course, air, change in flown
    )
    found: dict[tuple[str, str], dict[str, Record]] = {}
    for (course, air, change), record in zip(flown, records, strict=True):
        found.setdefault((course, air[0]), {})[change] = record
    return [Symmetry(course, air, some) for (course, air), some in found.items()]


def report_symmetries(found: Sequence[Symmetry]) -> list[Claim]:
    """Print race times side by side; that they are the same."""
    words = {True: "same", False: "differ", None: "not told"}
    rows = [
        (
            one.course,
            one.wind,
            *(time_or_outcome(one.records[change]) for change in CHANGES),
            "-" if one.spread is None else f"{1e3 * one.spread:.1f}",
            words[one.same_ways],
        )
        for one in found
    ]
    headings = ("course", "wind", *(f"{change or 'as it is'} s" for change in CHANGES), "spread ms", "ways")
    table("Mirrored (east and west), rotated by 37°, moved by 1234 m north and 567 m west", headings, rows)
    apart = [one for one in found if one.spread is None or one.spread > SLOWER]
    told = [one for one in found if one.same_ways is not None]
    claims = [Claim(f"the same race time within 5 ms: {len(found) - len(apart)} of {len(found)}", not apart)]
    if told:
        same = sum(one.same_ways is True for one in told)
        claims.append(
            Claim(f"the same ways, in the mirror the mirrored ones: {same} of {len(told)}", same == len(told))
        )
    return claims


@dataclass(frozen=True)
class Comparison:
    """A course flown without exploring and with it."""

    course: str
    before: Record
    after: Record

    @property
    def slower(self) -> bool:
        """Whether exploring made it slower, or lost the certificate."""
        before, after = race_time(self.before), race_time(self.after)
        return before is not None and (after is None or after - before > SLOWER)

    @property
    def cost(self) -> float:
        """Seconds more that the flight took with exploring."""
        return self.after["seconds"] - self.before["seconds"]

    @property
    def share(self) -> float | None:
        """The cost as a share of the race time; None where nothing was certified."""
        race = race_time(self.after)
        return None if race is None else self.cost / race


def comparisons(study: Study, courses: Sequence[str], base: Job) -> list[Comparison]:
    """Fly courses without exploring and with it (`base` says how much; quick, where it does not)."""
    both = (OFF, base.search or QUICK)
    records = iter(study.fly(replace(base, course=course, search=search) for course in courses for search in both))
    return [Comparison(course, next(records), next(records)) for course in courses]


def report_seeds(found: Sequence[Comparison]) -> list[Claim]:
    """Print generated courses side by side; that none became slower."""
    headings = ("course", "off s", "explored s", "difference s", "off takes s", "explored takes s")
    table("Without exploring and with it", headings, [(one.course, *_compared(one)) for one in found])
    worse = [one.course for one in found if one.slower]
    faster = sum(_gain(one) > SLOWER for one in found)
    text = "none is slower than before by more than 5 ms" + (f", but {', '.join(worse)}" if worse else "")
    return [Claim(f"{text}; {faster} of {len(found)} are faster", bool(found) and not worse and _any_certified(found))]


def report_found(found: Sequence[Comparison]) -> list[Claim]:
    """Print what exploring found and took, for the documentation; that no course became slower or took too long."""
    rows = [
        (
            one.course,
            *_compared(one)[:3],
            best_way(one.after) or "-",
            f"{one.cost:.1f}",
            "-" if one.share is None else f"{one.share:.2f}",
        )
        for one in found
    ]
    headings = ("course", "before s", "after s", "difference s", "best way", "exploring takes s", "share of race time")
    table("What exploring found", headings, rows)
    worse = [one.course for one in found if one.slower]
    long = [one.course for one in found if one.share is None or one.share > SHARE_OF_RACE]
    listed = f", but {', '.join(worse)}" if worse else ""
    return [
        Claim(f"none is slower than before by more than 5 ms{listed}", not worse and _any_certified(found)),
        Claim(f"exploring takes at most {SHARE_OF_RACE:g} of the race time: all but {len(long)}", not long),
    ]


def _any_certified(found: Sequence[Comparison]) -> bool:
    """Whether anything was certified with exploring."""
    return any(race_time(one.after) is not None for one in found)


def _gain(one: Comparison) -> float:
    before, after = race_time(one.before), race_time(one.after)
    return 0.0 if before is None or after is None else before - after


def _compared(one: Comparison) -> tuple[str, ...]:
    return (
        time_or_outcome(one.before),
        time_or_outcome(one.after),
        difference(race_time(one.after), race_time(one.before)),
        f"{one.before['seconds']:.1f}",
        f"{one.after['seconds']:.1f}",
    )
