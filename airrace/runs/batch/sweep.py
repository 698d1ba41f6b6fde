"""One stage of a run under many values: every combination is solved warm, and measured but for mesh convergence.

Combinations are solved in chunks, each from its neighbour before, so that no answer depends on how many are solved at
once.
"""

import io
import math
import queue
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from airrace.errors import InputError, UsageError
from airrace.files.checkpoint.atomic import replace_file
from airrace.model.track.course import Origin
from airrace.pages.views.tables import Column, Table, Value
from airrace.procedure.result import Status
from airrace.procedure.stage import Stage
from airrace.runs.batch.jobs import Combination, Sweep, combinations, cover
from airrace.runs.execution_plan import Changes
from airrace.runs.output import write_text
from airrace.runs.run_state import RunState
from airrace.runs.session import Session, ensure_of_one_stage
from airrace.runs.stage_view import StageView
from airrace.runtime.process import available_cores
from airrace.runtime.resources import extra

FILES = (".csv", ".parquet")
CHUNK = 20
"""The number of combinations that are solved from one another; results depend on it, not on the threads."""
POINTS_MAX = 100_000
"""The largest number of combinations."""


@dataclass(frozen=True)
class SweepPoint:
    """The optimum under one combination of values.

    Attributes:
        values: of the swept keys, as texts, in their order.
        race_time: s; NaN where there is none.
        status: `SOLVED` where all holds that is measured.
        message: why there is no optimum, a sentence; else empty.
    """

    values: tuple[str, ...]
    race_time: float
    status: Status
    message: str = ""


@dataclass(frozen=True)
class SweepResult:
    """A stage under all combinations of swept values.

    Attributes:
        stage: which one.
        keys: the swept keys.
        reference: race time of the run's own optimum on the same mesh, s.
        points: in the order of the combinations, the last key varying fastest.
        without_effect: the swept keys of which all values ask for the same flight.
    """

    stage: str
    keys: tuple[str, ...]
    reference: float
    points: tuple[SweepPoint, ...]
    without_effect: tuple[str, ...] = ()

    @property
    def solved(self) -> int:
        """How many combinations have an optimum."""
        return sum(point.status is Status.SOLVED for point in self.points)

    def table(self) -> Table:
        """Return a row per combination: values, race time, its difference from the run's, status and message."""
        numeric = [all(_is_number(point.values[place]) for point in self.points) for place in range(len(self.keys))]
        columns = (
            *(Column(key, form="g" if number else "", key=key) for key, number in zip(self.keys, numeric, strict=True)),
            Column("race time", "s", ".3f", "race_time_s"),
            Column("change", "s", "+z.3f", "change_s"),
            Column("status", key="status"),
            Column("", key="message"),
        )
        rows: list[Sequence[Value]] = []
        for point in self.points:
            cells = (float(value) if number else value for value, number in zip(point.values, numeric, strict=True))
            change = point.race_time - self.reference
            rows.append((*cells, point.race_time, change, point.status.value, point.message))
        notes = [f"{key} affects no flight: all of its values ask for the same one" for key in self.without_effect]
        return Table(f"{self.stage}, {self.reference:.3f} s as it is", columns, rows, notes)

    def as_object(self) -> dict[str, object]:
        """Return the object that `airrace sweep --json` prints."""
        return {
            "stage": self.stage,
            "keys": list(self.keys),
            "race_time_s": self.reference,
            "without_effect": list(self.without_effect),
            "solved": self.solved,
            "points": self.table().objects(),
        }

    def write(self, path: Path) -> None:
        """Write all combinations, `.csv` or `.parquet`, replacing the file as a whole.

        Raises:
            UsageError: pyarrow is not installed.
            StorageError: the system refused.
        """
        if path.suffix.lower() == ".csv":
            write_text(path, self.table().csv())
            return
        pyarrow: Any = extra("pyarrow", "a Parquet file", "parquet")  # Any: without pyarrow there are no types
        files: Any = extra("pyarrow.parquet", "a Parquet file", "parquet")
        buffer = io.BytesIO()
        files.write_table(pyarrow.Table.from_pylist(self.table().objects()), buffer)
        replace_file(path, buffer.getvalue())


def _is_number(text: str) -> bool:
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False


def ensure_sweep_file(path: Path) -> None:
    """Find out now whether a sweep can be written into a file of this name.

    Raises:
        UsageError: the name says no known format, or it needs pyarrow.
    """
    if path.suffix.lower() not in FILES:
        raise UsageError(f"{path}: the file must end in {' or '.join(FILES)}")
    if path.suffix.lower() == ".parquet":
        extra("pyarrow", "a Parquet file", "parquet")


def solve_combinations(
    run: RunState,
    stage: str | Stage | None,
    sweeps: Sequence[Sweep],
    overrides: Sequence[str],
    threads: int | None,
    tell: Callable[[int, int], None] | None,
) -> SweepResult:
    """Solve one stage of a run under all combinations of values; see `airrace.sweep`.

    Results do not depend on the number of threads.
    """
    number = math.prod(len(values.values) for values in sweeps)
    if not sweeps or number > POINTS_MAX:
        raise UsageError("nothing is swept" if not sweeps else f"{number} combinations: at most {POINTS_MAX} are swept")
    for combination in cover(sweeps):
        ensure_of_one_stage(run, Changes(overrides=_texts(overrides, combination)).inputs(run))
    every = list(combinations(sweeps))
    chunks = [every[first : first + CHUNK] for first in range(0, number, CHUNK)]
    result = _solve_chunks(run, stage, overrides, chunks, threads or available_cores(), tell)
    return replace(result, without_effect=tuple(_without_effect(run, overrides, sweeps)))


def _without_effect(run: RunState, overrides: Sequence[str], sweeps: Sequence[Sweep]) -> Iterator[str]:
    """Yield the keys of which all values ask for the same flight, the other keys at their first values."""

    def flight(key: str, value: str) -> object:
        combination = tuple((sweep.key, value if sweep.key == key else sweep.values[0]) for sweep in sweeps)
        race = Changes(overrides=_texts(overrides, combination)).inputs(run).race
        course = replace(race.course, name="", origin=Origin())  # the air has the elevation, too
        return course, replace(race.aircraft, name=""), race.air

    for sweep in sweeps:
        first, *rest = sweep.values
        with suppress(InputError):  # values that do not go together matter
            if rest and all(flight(sweep.key, value) == flight(sweep.key, first) for value in rest):
                yield sweep.key


def _solve_chunks(
    run: RunState,
    stage: str | Stage | None,
    overrides: Sequence[str],
    chunks: Sequence[Sequence[Combination]],
    threads: int,
    tell: Callable[[int, int], None] | None,
) -> SweepResult:
    """Solve chunks of combinations, as many at a time as there are threads, each by a session of its own."""
    most, points = min(threads, len(chunks)), list[SweepPoint]()
    with ExitStack() as stack:
        pool = stack.enter_context(ThreadPoolExecutor(most, thread_name_prefix="sweep"))
        sessions = [stack.enter_context(Session(run, stage, threads=max(1, threads // most))) for _ in range(most)]
        free: queue.SimpleQueue[Session] = queue.SimpleQueue()
        for session in sessions:
            free.put(session)

        def solve(chunk: Sequence[Combination]) -> list[SweepPoint]:
            session = free.get()
            try:
                return _solve_chunk(session, overrides, chunk)
            finally:
                free.put(session)

        for chunk_points in pool.map(solve, chunks):
            points += chunk_points
            if tell is not None:
                tell(len(points), sum(map(len, chunks)))
        optimum = sessions[0].optimum
        return SweepResult(optimum.name, tuple(key for key, _ in chunks[0][0]), optimum.race_time, tuple(points))


def _solve_chunk(session: Session, overrides: Sequence[str], chunk: Sequence[Combination]) -> list[SweepPoint]:
    """Solve combinations in turn, each from the one before, and where that leads nowhere from the run's optimum."""
    points: list[SweepPoint] = []
    near: StageView | None = None
    for combination in chunk:
        values, texts = tuple(value for _, value in combination), _texts(overrides, combination)
        try:
            view = session.solve(texts, start=near)
            if near is not None and not view.result.holds:
                view = session.solve(texts)
        except InputError as error:
            points.append(SweepPoint(values, math.nan, Status.INFEASIBLE, error.findings[0].message))
            continue
        near = view if view.result.holds else near
        points.append(SweepPoint(values, view.race_time, view.result.status, view.message))
    return points


def _texts(overrides: Sequence[str], combination: Combination) -> list[str]:
    return [*overrides, *(f"{key}={value}" for key, value in combination)]
