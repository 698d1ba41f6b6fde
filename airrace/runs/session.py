"""A warm run: the optimum under other inputs in a fraction of a second, certified in the background."""

import math
from collections.abc import Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import Self

from airrace.errors import UsageError
from airrace.files.inputs import Document, Inputs
from airrace.procedure.cost_to_go import PLACE_NAMES, Continuation
from airrace.procedure.stage import Stage
from airrace.procedure.warm_stage import WarmStage
from airrace.runs.execution_plan import Changes, Values, value_texts
from airrace.runs.run_state import RunState, open_run
from airrace.runs.stage_view import StageView
from airrace.runs.stored_inputs import current_versions
from airrace.runtime.process import available_cores

BY_OTHER_COMMANDS = "`airrace batch --sweep` and `airrace resume --set` solve with others"


def ensure_of_one_stage(run: RunState, inputs: Inputs) -> None:
    """Refuse inputs that differ from those of a run in what no stage that is solved again by itself takes up.

    Raises:
        UsageError: naming the keys.
    """
    changed = [text.partition("=")[0].strip() for text in inputs.overrides if text not in run.inputs.overrides]
    for part, same, why in (
        ("settings", inputs.settings == run.inputs.settings, "the settings stay those of the run"),
        ("rules.reserve", inputs.reserve == run.inputs.reserve, "a reserve takes closed-loop flights"),
    ):
        if not same:
            keys = [key for key in changed if key == part or key.startswith(f"{part}.")] or [part]
            raise UsageError(
                f"{', '.join(keys)}: where one stage of {run.label} is solved again, {why}; {BY_OTHER_COMMANDS}"
            )


def optimum_of(run: RunState, stage: str | Stage | None) -> StageView:
    """Return the stage of a run that others are solved from; None for its last one.

    Raises:
        UsageError: the run has no such stage, or it is no optimum.
    """
    view = run.stage(stage)
    if not view.result.holds:
        why = view.stale or view.status
        raise UsageError(f"{view.name} of {run.label}: there is no optimum to start from: {why}")
    return view


class Session:
    """One stage of a run, solved again whenever a number changes: models, solver process and optimum stay.

    It is a context manager. An answer keeps the route of the run, and its passings: what has other passings needs a run
    of its own, and where another route may have become faster `airrace.resume` looks for it.

    Examples:
        >>> with airrace.Session(run, "point-mass") as session:
        ...     slower = session.solve({"rules.n_z_max": 9})
        ...     print(f"{slower.race_time - session.optimum.race_time:.3f} s, {slower.status}")
        0.074 s, solved

    Attributes:
        optimum: the stage of the run, solved on the mesh of all answers.

    Args:
        run: the run, or its file.
        stage: which stage; None for the last one.
        threads: threads that evaluate derivatives; None for all cores.

    Raises:
        CheckpointError, InputError: the file cannot be opened, see `airrace.open`.
        UsageError: the run has no such stage, or it is no optimum.
        SolverCrash: the solver process died.
    """

    def __init__(
        self, run: RunState | str | Path, stage: str | Stage | None = None, *, threads: int | None = None
    ) -> None:
        self._run = run if isinstance(run, RunState) else open_run(Path(run))
        view = optimum_of(self._run, stage)
        self._warm = WarmStage(
            self._run.race, self._run.inputs.settings, view.result, threads=threads or available_cores()
        )
        self.optimum = StageView(self._run.inputs, self._warm.optimum, current_versions())
        self._background = ThreadPoolExecutor(1, thread_name_prefix="mesh check")
        self._check: Future[StageView] | None = None
        self._closed = False

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """End the solver processes; a check under way is given up, and its future has an error."""
        self._closed = True
        self._warm.close()
        self._background.shutdown(cancel_futures=True)

    def solve(
        self,
        set: Values = (),
        *,
        track: str | Path | Document | None = None,
        aircraft: str | Path | Document | None = None,
        start: StageView | None = None,
    ) -> StageView:
        """Return the optimum under other inputs, measured but for mesh convergence.

        Args:
            set: values that are otherwise than in the run, see `airrace.optimize`.
            track, aircraft: other documents than those of the run.
            start: an answer of this session that is nearer; None for the run's own optimum. Its result depends on where
                it starts from, though by less than is certified.

        Returns:
            The stage; `status` tells where there is no such flight, and `message` why.

        Raises:
            InputError: the inputs are not valid; it carries all findings.
            UsageError: they fly other passings, or ask for other settings or another reserve than the run's.
            SolverCrash: the solver process died.
        """
        inputs = Changes(track, aircraft, None, value_texts(set)).inputs(self._run)
        ensure_of_one_stage(self._run, inputs)
        result = self._warm.solve(inputs.race, None if start is None else start.result)
        return StageView(inputs, result, self.optimum.versions)

    def from_state(
        self,
        state: Mapping[str, float],
        leg: int | str,
        *,
        deviations: Mapping[str, float] | None = None,
        gates: int | None = None,
    ) -> Continuation:
        """Return the fastest flight of the run's race from any state on: its cost to go, its prices, its trajectory.

        From a state that no flight leads on from, as where the next gate cannot be made any more, it begins in the
        nearest one from which there is a flight, which `text` tells.

        Args:
            state: by name, SI: `x, y, z, V_K, q0, q1, q2, q3` at least; of what is missing of others the
                optimum's at its place is taken.
            leg: on which the state is: its number from 0, or the name of the passing in which it ends.
            deviations: how well the states are known, by name; None for a metre, half a metre per second, a degree.
            gates: the flight ends at the so many-th gate ahead, in the optimum's state but for its speed, and the cost
                behind it is that of the optimum to first order; None for the finish.

        Raises:
            UsageError: the state lacks a value, or has one that is no number, or there is no such leg.
            SolverCrash: the solver process died.
        """
        passages = self.optimum.inputs.race.course.passages
        numbers = {passage.name: number for number, passage in enumerate(passages[1:])}
        number = numbers.get(leg) if isinstance(leg, str) else leg
        if number is None or not 0 <= number < len(numbers):
            raise UsageError(f"there is no leg {leg!r}; the legs are 0 to {len(numbers) - 1}: {', '.join(numbers)}")
        if missing := [name for name in PLACE_NAMES if not math.isfinite(state.get(name, math.nan))]:
            raise UsageError(f"the state has no {missing[0]}, or it is no number; it needs {', '.join(PLACE_NAMES)}")
        if gates is not None and gates < 1:
            raise UsageError(f"{gates} gates ahead: it must be 1 or more")
        return self._warm.from_state(state, number, deviations=deviations, gates=gates)

    def certify(self, solved: StageView) -> Future[StageView]:
        """Check the mesh of an answer in the background, in a process of its own; the latest answer alone counts.

        Returns:
            The future of the stage, certified; as it was where its race time could not be confirmed. It is cancelled if
            another answer is to be certified before this one's turn.

        Raises:
            UsageError: the session is closed.
        """
        if self._closed:
            raise UsageError("the session is closed")
        check = self._warm.mesh_check(solved.inputs.race, solved.result)
        if self._check is not None:
            self._check.cancel()
        self._check = self._background.submit(lambda: replace(solved, result=check()))
        return self._check
