"""The safety of a course in many winds: an optimum of its own in each, and closed-loop flights along that."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from airrace.errors import InputError, UsageError
from airrace.runs.run import RunState
from airrace.runs.safety_case import SafetyCase
from airrace.runs.winds import Wind, overrides_of, winds_named
from airrace.safety.result import LOAD, Count
from airrace.views.tables import Column, Table, Value

ROSE = (
    Column("wind", key="wind"),
    Column(key="speed_kt"),
    Column(key="from_deg"),
    Column("race time", "s", ".3f", key="race_time_s"),
    Column("touch, miss or lose", "%", ".1f", key="contact_percent"),
    Column("from", "%", ".1f", key="contact_lower_percent"),
    Column("to", "%", ".1f", key="contact_upper_percent"),
    Column("break a rule", "%", ".1f", key="outside_percent"),
    Column("load factor", "%", ".1f", key="load_factor_percent"),
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
            ROSE,
            list(map(_rose_row, *zip(*self.cases.items(), strict=True))),
        )

    @property
    def messages(self) -> tuple[str, ...]:
        """The winds without a flight, and those whose optimum is not certified."""
        cases = ((wind, case if isinstance(case, str) else case.uncertified) for wind, case in self.cases.items())
        return tuple(f"{wind.text}: {why}" for wind, why in cases if why)

    def as_object(self) -> dict[str, object]:
        """Return the object that `airrace safety --winds --json` prints."""
        cases = {wind.text: case if isinstance(case, str) else case.as_object() for wind, case in self.cases.items()}
        return {"flight": self.label, "winds": self.table().objects(), "cases": cases}

    def __repr__(self) -> str:
        return self.table().text()

    def _repr_html_(self) -> str:
        return self.table().html()


def _rose_row(wind: Wind, case: SafetyCase | str) -> list[Value]:
    """Return the row of a wind."""
    named: list[Value] = [wind.text, wind.speed_kt, wind.from_deg]
    if isinstance(case, str):
        return [*named, *[None] * (len(ROSE) - len(named) - 1), case]
    result = case.result
    name, (worst, _) = max(
        result.pylons.items(), key=lambda one: one[1][0].flights, default=("-", (Count.among(0, 1), 0.0))
    )
    name, contact = name if worst.flights else "-", result.contact
    remark = "; ".join(one for one in (case.uncertified, result.note) if one)
    shares = (contact.share, contact.lower, contact.upper, result.outside.share, result.counts[LOAD].share)
    return [*named, result.race_time, *(100.0 * one for one in shares), name, 100.0 * worst.share, remark]


def fly_rose(
    run: RunState, winds: str, fly_again: Callable[[Sequence[str]], RunState], options: Mapping[str, Any]
) -> SafetyRose:
    """Fly the course of a run in each wind of a rose, and its optimum there many times.

    Args:
        run: whose last stage is flown.
        winds: e.g. `0,5,10kt@8`.
        fly_again: flies the run again with some values set, as `key=value`.
        options: of `StageView.safety`; any of them.

    Raises:
        UsageError: it is no rose, an argument says nothing sensible, or the run is not six-dof.
    """
    rose = winds_named(winds)

    def case_in(wind: Wind) -> SafetyCase | str:
        try:
            last = fly_again([f"{key}={value}" for key, value in overrides_of(wind)]).stages[-1]
            if last.name != run.stages[-1].name or not last.result.is_flight:
                return f"no flight was found: {last.message or last.status}"
            named: dict[str, Any] = {**options, "label": wind.text}
            return last.safety(**named)
        except (InputError, UsageError) as error:
            return str(error)

    return SafetyRose(run.name, {wind: case_in(wind) for wind in rose})
