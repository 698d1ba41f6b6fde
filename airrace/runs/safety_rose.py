"""The safety of a course in many winds, each with an optimum of its own and closed-loop flights along it; of runs."""

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

from airrace.errors import InputError, OutOfTime, UsageError
from airrace.files.inputs.air import Wind, overrides_of, winds_named
from airrace.flights.safety.monte_carlo import OVER_G, Count
from airrace.model.frames import angle_between
from airrace.optimal_control.quantities import KNOT
from airrace.pages.views.count_view import CountView
from airrace.pages.views.tables import Cell, Column, Table, Value
from airrace.runs.run_state import RunState
from airrace.runs.safety_case import SafetyCase
from airrace.runs.stage_view import StageView

R = TypeVar("R", bound=RunState)
NO_TIME = "not flown: the time was over"
"""Stands for a wind before which the time was over."""

WIND = (Column("wind", key="wind"), Column(key="speed_kt"), Column(key="from_deg"))
OUTCOME = (
    Column("race time", "s", ".3f", key="race_time_s"),
    Column("touch, miss or lose", "%", ".1f", key="contact_percent"),
    Column("from", "%", ".1f", key="contact_lower_percent"),
    Column("to", "%", ".1f", key="contact_upper_percent"),
    Column("break a rule", "%", ".1f", key="broken_percent"),
    Column("over-g", "%", ".1f", key="over_g_percent"),
    Column("worst pylon", key="worst_pylon"),
    Column("touched", "%", ".1f", key="worst_pylon_percent"),
    Column("remark", key="remark", wraps=True),
)


@dataclass(frozen=True, repr=False)
class SafetyRose:
    """The same course in many winds: each with its own optimum, and closed-loop flights along that.

    Attributes:
        label: what people call the run.
        cases: by wind; a text says why there is none.
    """

    label: str
    cases: Mapping[Wind, SafetyCase | str]

    def table(self) -> Table:
        """Return one row per wind."""
        return Table(
            f"{self.label}: closed-loop flights in many winds",
            (*WIND, *OUTCOME),
            [[wind.text, wind.speed_kt, wind.from_deg, *_outcome(case)] for wind, case in self.cases.items()],
        )

    @property
    def messages(self) -> tuple[str, ...]:
        """The winds without a flight, and those whose optimum is not certified."""
        cases = ((wind, _uncertain_text(case)) for wind, case in self.cases.items())
        return tuple(f"{wind.text}: {why}" for wind, why in cases if why)

    def as_object(self) -> dict[str, object]:
        """Return the object that `airrace safety --winds --json` prints."""
        cases = {wind.text: case if isinstance(case, str) else case.as_object() for wind, case in self.cases.items()}
        return {"flight": self.label, "winds": self.table().objects(), "cases": cases}

    def __repr__(self) -> str:
        return self.table().text()

    def _repr_html_(self) -> str:
        return self.table().html()


@dataclass(frozen=True, repr=False)
class SafetyRuns:
    """Several runs, such as those of several aircraft, and what came of their closed-loop flights.

    Attributes:
        aircraft: by the name of the run.
        cases: likewise, of one wind or of many; a text says why there is none.
    """

    aircraft: Mapping[str, str]
    cases: Mapping[str, SafetyCase | SafetyRose | str]

    def table(self) -> Table:
        """Return one row per run, or one per wind of it."""
        wind = WIND if any(isinstance(case, SafetyRose) for case in self.cases.values()) else ()
        rows: list[list[Cell | Value]] = []
        for name, case in self.cases.items():
            own = [[*[None] * len(wind), *_outcome(case)]] if not isinstance(case, SafetyRose) else case.table().rows
            rows += [[name, self.aircraft[name], *row] for row in own]
        run = (Column("run", key="run"), Column("aircraft", key="aircraft", wraps=True))
        return Table("closed-loop flights of several runs", (*run, *wind, *OUTCOME), rows)

    @property
    def messages(self) -> tuple[str, ...]:
        """The runs without flights, and those whose optimum is not certified."""
        findings: list[str] = []
        for name, case in self.cases.items():
            messages = case.messages if isinstance(case, SafetyRose) else [_uncertain_text(case)]
            findings += [f"{name}: {why}" for why in messages if why]
        return tuple(findings)

    def as_object(self) -> dict[str, object]:
        """Return the object that `airrace safety --json` prints of several runs."""
        cases = {name: case if isinstance(case, str) else case.as_object() for name, case in self.cases.items()}
        return {"runs": self.table().objects(), "cases": cases}


def _uncertain_text(case: SafetyCase | str) -> str:
    """Return why there is no case, or none of a certified optimum; empty where there is."""
    return case if isinstance(case, str) else case.uncertified


def _outcome(case: SafetyCase | str) -> list[Value]:
    """Return what stands behind the name of a case."""
    if isinstance(case, str):
        return [*[None] * (len(OUTCOME) - 1), case]
    result = case.result
    name, (worst, _) = max(
        result.pylons.items(), key=lambda item: item[1][0].flights, default=("-", (Count.with_interval(0, 1), 0.0))
    )
    name, contact = name if worst.flights else "-", result.contact
    remark = "; ".join(case.remarks[: -1 if case.no_crowd else None])
    shares = (contact.share, contact.lower, contact.upper, result.broken.share, result.counts[OVER_G].share)
    return [result.race_time, *(100.0 * share for share in shares), name, 100.0 * worst.share, remark]


def cases_by_name(every: SafetyCase | SafetyRose | SafetyRuns) -> dict[str, SafetyCase | str]:
    """Return all cases of runs and winds, by what they are called."""
    if isinstance(every, SafetyCase):
        return {every.label: every}
    if isinstance(every, SafetyRose):
        return {wind.text: case for wind, case in every.cases.items()}
    cases: dict[str, SafetyCase | str] = {}
    for name, case in every.cases.items():
        if isinstance(case, SafetyRose):
            cases |= {f"{name}, {wind}": of_wind for wind, of_wind in cases_by_name(case).items()}
        else:
            cases[name] = case
    return cases


def is_cut(every: SafetyCase | SafetyRose | SafetyRuns) -> bool:
    """Return whether the time was over before all was flown."""
    return any(case == NO_TIME if isinstance(case, str) else case.is_cut for case in cases_by_name(every).values())


def own_case(run: RunState, case: SafetyCase | SafetyRose | str) -> SafetyCase | None:
    """Return the flights of a run in its own wind; None where they were not flown."""
    if isinstance(case, SafetyRose):
        case = next((of_wind for wind, of_wind in case.cases.items() if is_own(wind, run)), "")
    return None if isinstance(case, str) else case


def is_own(wind: Wind, run: RunState) -> bool:
    """Return whether a wind is that in which a run was flown."""
    own = run.race.air.wind
    if own is None or not own.speed:
        return not wind.speed_kt
    turned = abs(angle_between(own.origin, math.radians(wind.from_deg)))
    return math.isclose(own.speed, wind.speed_kt * KNOT, rel_tol=1e-6) and turned < 1e-6


def fly_rose(
    run: RunState,
    winds: str,
    fly_again: Callable[[RunState, Sequence[str]], RunState],
    options: Mapping[str, Any],
    *,
    count: CountView | None = None,
    until: float = math.inf,
) -> SafetyRose:
    """Fly the course of a run in each wind of a rose, and its optimum there many times.

    The wind in which the run was flown already is not solved again.

    Args:
        run: whose last stage is simulated.
        winds: e.g. `0,5,10kt@8`.
        fly_again: flies a run again with some values set, as `key=value`.
        options: of `StageView.safety`; any of them.
        count: shows how far it is; None for nobody.
        until: the time of the monotonic clock, s, after which no further wind is begun.

    Raises:
        UsageError: it is no rose, an argument is out of range, or the run is not six-dof.
    """
    rose = winds_named(winds)
    if options.get("replan_s") is not None:
        raise UsageError("a rose of winds is flown along optima alone; leave the replanned line to a run in one wind")

    def last_stage(wind: Wind) -> StageView | str:
        """Return the optimum in a wind, or why there is none."""
        if is_own(wind, run):
            return run.stages[-1]
        values = [f"{key}={value}" for key, value in overrides_of(wind)]
        last = fly_again(run, ["rules.reserve=null", *values]).stages[-1]  # the margins stay
        if last.name != run.stages[-1].name or not last.result.is_flight:
            return f"no flight was found: {last.message or last.status}"
        return last

    def case_in(wind: Wind) -> SafetyCase | str:
        if time.monotonic() > until:
            return NO_TIME
        try:
            last = last_stage(wind)
            if isinstance(last, str):
                return last
            keywords: dict[str, Any] = {**options, "label": wind.text, "until": until}
            return last.safety(**keywords)
        except OutOfTime:
            return NO_TIME
        except (InputError, UsageError) as error:
            return str(error)

    cases: dict[Wind, SafetyCase | str] = {}
    for number, wind in enumerate(rose):
        if count is not None and time.monotonic() <= until:
            count.begin(f"{run.label}: wind {number + 1} of {len(rose)}, {wind.text}", number, len(rose))
        cases[wind] = case_in(wind)
    return SafetyRose(run.name, cases)


def fly_runs(runs: Mapping[str, R], fly: Callable[[R], SafetyCase | SafetyRose]) -> SafetyRuns:
    """Fly the optima of several runs; one that fails costs no other.

    Args:
        runs: by their names.
        fly: flies that of one.

    Raises:
        UsageError: none of them can be simulated.
    """

    def case_of(run: R) -> SafetyCase | SafetyRose | str:
        try:
            return fly(run)
        except UsageError as error:
            return str(error)

    aircraft = {name: run.race.aircraft.name for name, run in runs.items()}
    cases = {name: case_of(run) for name, run in runs.items()}
    if all(isinstance(case, str) for case in cases.values()):
        whys = set(map(str, cases.values()))
        raise UsageError(
            whys.pop() if len(whys) == 1 else "; ".join(f"{name}: {message}" for name, message in cases.items())
        )
    return SafetyRuns(aircraft, cases)
