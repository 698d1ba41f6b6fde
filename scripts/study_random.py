"""Exploring held against the best of many random starts, the best of them refined and proved."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from study_jobs import OFF, Job, Record, Study, inputs_of, race_time
from study_tables import SLOWER, Claim, difference, seconds, table, time_or_outcome

BEST = 10  # rough optima that are refined
AT_ONCE = 10  # random starts in a process
QUICK, THOROUGH = "quick", "thorough"
QUICK_BEHIND = 0.030  # s
GATES = {"as in the file": (), "crossing 15°": ("gate_defaults.crossing_max_deg=15",)}


@dataclass(frozen=True)
class Yardstick:
    """A course with random starts, those refined, and flights by how much they search.

    Attributes:
        starts: race time (s, None where not solved) and seconds of every random start.
    """

    course: str
    gates: str
    starts: tuple[Record, ...]
    refined: tuple[Record, ...]
    flights: dict[str, Record]

    @property
    def solved(self) -> list[float]:
        return sorted(one["race_time_s"] for one in self.starts if one["race_time_s"] is not None)

    @property
    def best(self) -> float | None:
        """The fastest that is certified, s."""
        times = [time for time in map(race_time, self.refined) if time is not None]
        return min(times, default=None)

    @property
    def seconds(self) -> float:
        """What rough solves and refinements took together."""
        return sum(one["seconds"] for one in (*self.starts, *self.refined))

    def behind(self, search: str) -> float | None:
        """How much slower than the best random start exploring ends, s."""
        time = race_time(self.flights[search])
        return None if time is None or self.best is None else time - self.best

    def within(self, search: str, slower: float) -> bool:
        """Whether exploring ends at most so much slower (s); also where no random start leads anywhere."""
        if self.best is None:
            return True
        behind = self.behind(search)
        return behind is not None and behind <= slower


def yardsticks(study: Study, courses: Sequence[str], base: Job, count: int) -> list[Yardstick]:
    """Draw, solve roughly, refine the best, and fly with exploring."""
    variants: list[tuple[str, str, Job]] = []
    for course in courses:
        for gates, overrides in GATES.items():
            job = replace(base, course=course, overrides=(*base.overrides, *overrides))
            if overrides and inputs_of(course, job.overrides).race == inputs_of(course, base.overrides).race:
                print(f"skipped: {gates} on {course}: changes nothing there")
                continue
            variants.append((course, gates, job))
    chunks = [tuple(range(first, min(first + AT_ONCE, count))) for first in range(0, count, AT_ONCE)]
    rough = iter(
        study.fly(replace(job, starts=chunk, search=OFF, threads=1) for _, _, job in variants for chunk in chunks)
    )
    starts = [[one for _ in chunks for one in next(rough).get("starts", ())] for _ in variants]
    numbers = [fastest(some) for some in starts]
    refined = iter(
        study.fly(
            replace(job, refine=number, search=OFF, threads=1)
            for (_, _, job), some in zip(variants, numbers, strict=True)
            for number in some
        )
    )
    proved = [[next(refined) for _ in some] for some in numbers]
    kinds = (OFF, QUICK, THOROUGH)
    explored = iter(study.fly(replace(job, search=kind) for _, _, job in variants for kind in kinds))
    flights = [{kind: next(explored) for kind in kinds} for _ in variants]
    return [
        Yardstick(course, gates, tuple(some), tuple(best), flown)
        for (course, gates, _), some, best, flown in zip(variants, starts, proved, flights, strict=True)
    ]


def fastest(starts: Sequence[Record]) -> list[int]:
    """The numbers of the best rough optima, the best first."""
    solved = [one for one in starts if one["race_time_s"] is not None]
    return [one["number"] for one in sorted(solved, key=lambda one: one["race_time_s"])[:BEST]]


def report(found: Sequence[Yardstick]) -> list[Claim]:
    """Print random starts and exploring side by side; that exploring keeps up."""
    headings = ("course", "gates", "best random, rough s", "best random, certified s", "solved", "takes s")
    headings += ("off s", "quick s", "thorough s", "quick behind s", "thorough behind s", "quick takes s")
    headings += ("thorough takes s",)
    table("The best of random starts, and exploring", headings, [_row(one) for one in found])
    quick = [one for one in found if one.within(QUICK, QUICK_BEHIND)]
    thorough = [one for one in found if one.within(THOROUGH, SLOWER)]
    return [
        Claim(
            f"quick is at most 30 ms behind the best random start: {len(quick)} of {len(found)}",
            bool(found) and len(quick) == len(found),
        ),
        Claim(
            f"thorough is not slower than the best random start (by more than 5 ms): {len(thorough)} of {len(found)}",
            bool(found) and len(thorough) == len(found),
        ),
    ]


def _row(one: Yardstick) -> tuple[str, ...]:
    rough = one.solved[0] if one.solved else None
    return (
        one.course,
        one.gates,
        seconds(rough),
        seconds(one.best),
        f"{len(one.solved)} of {len(one.starts)}",
        seconds(one.seconds, 0),
        *(time_or_outcome(one.flights[kind]) for kind in (OFF, QUICK, THOROUGH)),
        *(difference(race_time(one.flights[kind]), one.best) for kind in (QUICK, THOROUGH)),
        *(seconds(one.flights[kind]["seconds"], 0) for kind in (QUICK, THOROUGH)),
    )
