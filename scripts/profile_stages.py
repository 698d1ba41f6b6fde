"""Where the seconds of a run go: one command with the parts of its stages timed.

    python scripts/profile_stages.py FILE.json optimize COURSE [OPTION ...]

runs `airrace optimize COURSE ...` in this process, with clocks around the functions of `FUNCTIONS` and some more, and
writes to FILE.json, per stage, seconds by the wall clock, processor seconds of both processes, and the seconds of each
of the `PARTS`. Time before, between and behind the stages is told as that of a stage `-`; loading is what Python's
packages take. A part within another one is not counted in that one, with one exception: while this process waits for
the solver process, only the latter's work counts. That is divided, by what the solver tells of itself, into
derivatives, linear algebra (the rest of the solver) and putting together (all else: the program of a new mesh, its
kernels, and the messages).

`benchmark_stages.py --shares` prints the table. Only the main thread is timed, so nothing should be explored. The
clocks need Linux.
"""

import atexit
import contextlib
import functools
import json
import os
import sys
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from airrace.__main__ import main as command
from airrace.files.checkpoint import store
from airrace.optimal_control import replay
from airrace.optimal_control.solvers.service import SolverService
from airrace.procedure import procedure
from airrace.procedure.control import simulation
from airrace.procedure.fidelity import stage_model
from airrace.procedure.solver_session import SolverSession
from airrace.procedure.stage import Stage
from airrace.procedure.stage_models import StageModels

DERIVATIVES, ALGEBRA, TOGETHER = "derivatives", "linear algebra", "putting together"
REPLAY, SIMULATION, MODELS = "replay", "simulation", "models"
LOADING, FILES, OTHER = "loading", "input and output", "other"
PARTS = (DERIVATIVES, ALGEBRA, TOGETHER, REPLAY, SIMULATION, MODELS, LOADING, FILES, OTHER)
BETWEEN = "-"
"""The name under which the time between stages is kept."""
STAGE_OF = {"solve_homotopy_and_plans": Stage.HOMOTOPY, "solve_point_mass": Stage.POINT_MASS}
"""The stages of functions of the procedure that solve a single one."""

FUNCTIONS: dict[str, tuple[Callable[..., Any], ...]] = {  # Any: they are only passed through
    REPLAY: (replay.replay, replay.replay_phases, replay.estimate_defect, replay.estimate_error),
    SIMULATION: (simulation.follow, simulation.trim_along),
    MODELS: (stage_model,),
    FILES: (store.write_checkpoint, store.read_checkpoint, store.read_stored),
}


class Clocks:
    """The clocks of a command: seconds by stage and part, of which always one pair is running."""

    def __init__(self) -> None:
        self.parts: dict[str, dict[str, float]] = defaultdict(lambda: defaultdict(float))
        self.processor: dict[str, float] = defaultdict(float)
        self.waiting = False
        self._stage, self._running = BETWEEN, [OTHER]
        self._since, self._processor_since = time.perf_counter(), 0.0
        self.parts[BETWEEN][LOADING] = seconds_since_start()
        self._solver: int | None = None
        self._solver_used = 0.0

    def charge(self) -> None:
        """Charge the time since the last charge to the stage and the part that were running."""
        now = time.perf_counter()
        self.parts[self._stage][self._running[-1]] += now - self._since
        self._since = now

    def begin(self, part: str) -> None:
        """Let a part run within the one that was running."""
        self.charge()
        self._running.append(part)

    def end(self) -> None:
        """Let the part run on within which the running one was begun."""
        self.charge()
        self._running.pop()

    def enter(self, stage: str) -> None:
        """Let another stage run."""
        self.charge()
        used = time.process_time() + self._solver_seconds()
        self.processor[self._stage] += used - self._processor_since
        self._stage, self._processor_since = stage, used

    def served_by(self, process: int | None) -> None:
        """Learn which process solves."""
        self._solver = process

    def solved(self, waited: float, solver: float, derivatives: float) -> None:
        """Divide what was waited for a solution."""
        parts = self.parts[self._stage]
        parts[DERIVATIVES] += derivatives
        parts[ALGEBRA] += solver - derivatives
        parts[TOGETHER] += waited - solver
        self._since = time.perf_counter()

    def _solver_seconds(self) -> float:
        """Processor time of the solver process, s, by its clock's number as Linux has it; at last while it lived."""
        if self._solver is not None:
            with contextlib.suppress(OSError):
                self._solver_used = time.clock_gettime(((~self._solver) << 3) | 2)
        return self._solver_used

    def told(self) -> dict[str, dict[str, Any]]:  # Any: as written to JSON
        """All that was measured, by stage."""
        return {
            stage: {
                "wall": sum(parts.values()),
                "processor": self.processor[stage],
                "parts": {part: parts[part] for part in PARTS},
            }
            for stage, parts in self.parts.items()
        }


def seconds_since_start() -> float:
    """How long this process has been running, s, to a hundredth; as Linux tells it."""
    fields = Path("/proc/self/stat").read_text().rpartition(")")[2].split()
    return time.clock_gettime(time.CLOCK_BOOTTIME) - int(fields[19]) / os.sysconf("SC_CLK_TCK")


def timed(clocks: Clocks, part: str, function: Callable[..., Any]) -> Callable[..., Any]:
    """A function whose time is that of a part, unless the solver process is waited for meanwhile."""

    @functools.wraps(function)
    def within(*arguments: Any, **named: Any) -> Any:
        if clocks.waiting:
            return function(*arguments, **named)
        clocks.begin(part)
        try:
            return function(*arguments, **named)
        finally:
            clocks.end()

    return within


def replace_everywhere(function: Callable[..., Any], by: Callable[..., Any]) -> None:
    """Put another function into every module that has one under some name."""
    for module in list(sys.modules.values()):
        if getattr(module, "__name__", "").startswith("airrace"):
            for name, value in list(vars(module).items()):
                if value is function:
                    setattr(module, name, by)


def watch(clocks: Clocks) -> None:
    """Put clocks around all that is timed."""
    for part, functions in FUNCTIONS.items():
        for function in functions:
            replace_everywhere(function, timed(clocks, part, function))
    StageModels.problem = timed(clocks, MODELS, StageModels.problem)
    solve = SolverService.solve

    def of_stage(function: Callable[..., Any]) -> Callable[..., Any]:
        @functools.wraps(function)
        def within(models: StageModels, session: SolverSession, *arguments: Any, **named: Any) -> Any:
            stages = [one for one in arguments if isinstance(one, Stage)]
            clocks.enter((stages or [STAGE_OF[function.__name__]])[0].value)
            try:
                solved = function(models, session, *arguments, **named)
                return list(solved) if isinstance(solved, Iterator) else solved
            finally:
                clocks.enter(BETWEEN)

        return within

    for name in ("solve_homotopy_and_plans", "solve_point_mass", "solve_stage_above"):
        setattr(procedure, name, of_stage(getattr(procedure, name)))

    def waited(service: SolverService, *arguments: Any, **named: Any) -> Any:
        clocks.charge()
        clocks.waiting, begun = True, time.perf_counter()
        try:
            solution = solve(service, *arguments, **named)
        finally:
            clocks.waiting = False
        process = service._process  # pyright: ignore[reportPrivateUsage]  # nobody else asks for its clock
        clocks.served_by(process.pid if process else None)
        clocks.solved(time.perf_counter() - begun, solution.seconds, solution.derivative_seconds)
        return solution

    SolverService.solve = waited


def main() -> None:
    """Run the command, and write what it took at its end."""
    told = sys.argv.pop(1)
    clocks = Clocks()
    watch(clocks)

    def write() -> None:
        clocks.enter(BETWEEN)
        Path(told).write_text(json.dumps(clocks.told(), indent=1) + "\n")

    atexit.register(write)
    command()


if __name__ == "__main__":
    main()
