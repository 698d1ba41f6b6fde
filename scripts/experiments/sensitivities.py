"""Hold sensitivities against re-optimised differences.

Every number that is not free is moved by a twentieth of its usual step to either side, fifty times as far as for its
sensitivity, and the race is solved again from the stored optimum, on the same mesh, the same route. The differences of
the objective are what the sensitivities say, or they are listed.

    python scripts/experiments/sensitivities.py tracks/rovinj_2014.yaml tracks/abu_dhabi_2016.yaml --stage point-mass
"""

import argparse
import dataclasses
import math
import sys
from dataclasses import dataclass
from pathlib import Path

from airrace.files.checkpoint import read_checkpoint
from airrace.errors import InputError
from airrace.files.inputs import Inputs, load_inputs
from airrace.files.inputs.variation import Variation
from airrace.optimal_control.problem import Iterate
from airrace.optimal_control.solvers.service import SolverService
from airrace.race import Race
from airrace.procedure.fidelity import iterate_of
from airrace.procedure.result import StageResult
from airrace.procedure.result import Silent
from airrace.procedure.procedure import optimize
from airrace.procedure.settings import GuessKind, Settings
from airrace.procedure.stage import Stage
from airrace.procedure.solver_session import SolverSession
from airrace.procedure.stage_problem import PerturbedProblem
from airrace.runs.run_state import run_of_checkpoint
from airrace.flights.sensitivity.lagrangian import (sensitivities, CHANGE_SHARE)
from airrace.flights.sensitivity import Activity, Sensitivity

WIDER = 50.0  # than the step of a sensitivity
TOLERANCE = 1e-9
BARRIER = 1e-6
SOLVERS = ("ipopt",)
RELATIVE, ABSOLUTE = 0.05, 1e-3  # a sensitivity is confirmed within 5 %, or within 1 ms per usual step
STRICT = 1e-4  # s per usual step, also counted


@dataclass(frozen=True)
class Optimum:
    """Objective and race time of a race solved again, s."""

    objective: float
    race_time: float


@dataclass(frozen=True)
class Comparison:
    """A sensitivity and the re-optimised slopes to both sides, s per unit; NaN to a side that has none."""

    sensitivity: Sensitivity
    upward: float
    downward: float
    of_race_time: float

    @property
    def central(self) -> float:
        """The mean of the sides that there are."""
        sides = [side for side in (self.upward, self.downward) if math.isfinite(side)]
        return sum(sides) / len(sides) if sides else math.nan

    @property
    def errors(self) -> list[tuple[float, float]]:
        """(s per usual step, share) by which the sensitivity is wrong, to each side if it is one-sided."""
        one = self.sensitivity
        if one.activity is Activity.ONE_SIDED:
            pairs = [(one.upward, self.upward), (one.downward, self.downward)]
        else:
            pairs = [(one.per_unit, self.central)]
        known = [(told, found) for told, found in pairs if math.isfinite(told)]
        return [
            (abs(told - found) * one.usual_step, abs(told - found) / abs(found) if found else math.inf)
            for told, found in known
        ]

    def within(self, absolute: float) -> bool:
        """Whether the sensitivity is confirmed within 5 % or so many seconds per usual step."""
        return all(seconds <= absolute or share <= RELATIVE for seconds, share in self.errors)

    @property
    def reason(self) -> str:
        """Why a sensitivity is not confirmed."""
        if not math.isfinite(self.central):
            return "not solved again"
        up, down = (1e3 * side * self.sensitivity.usual_step for side in (self.upward, self.downward))
        if abs(up - down) > 0.1 * max(abs(up), abs(down)):
            return f"limits come and go within the step: {up:+.3f} ms above, {down:+.3f} ms below"
        return "unexplained"


class Study:
    """Solves one stage again with single numbers changed."""

    def __init__(self, inputs: Inputs, result: StageResult, service: SolverService) -> None:
        solver = dataclasses.replace(inputs.settings.solver, tolerance=TOLERANCE)
        self._session = SolverSession(service, dataclasses.replace(inputs.settings, solver=solver), Silent())
        self._variation = Variation(inputs)
        self._varied = PerturbedProblem.of_result(inputs.race, inputs.settings, result)
        self._guess: Iterate = iterate_of(result.trajectory)
        self.now = self._solved(inputs.race)

    def compare(self, one: Sensitivity) -> Comparison:
        """Move one number to both sides."""
        change = WIDER * CHANGE_SHARE * one.usual_step
        up, down = self._moved(one, change), self._moved(one, -change)

        def slope(to: Optimum | None, sign: float) -> float:
            solved = to is not None and self.now is not None
            return sign * (to.objective - self.now.objective) / change if solved else math.nan

        both = up is not None and down is not None
        of_time = (up.race_time - down.race_time) / (2.0 * change) if both else math.nan
        return Comparison(one, slope(up, 1.0), slope(down, -1.0), of_time)

    def _moved(self, one: Sensitivity, change: float) -> Optimum | None:
        try:
            return self._solved(self._variation.race(one.key, one.value + change))
        except InputError:
            return None

    def _solved(self, race: Race) -> Optimum | None:
        problem = self._varied.problem(race)
        solution = self._session.solve(problem, self._guess, "again", barrier=BARRIER, solvers=SOLVERS)
        if solution is None or not solution.success:
            return None
        return Optimum(solution.objective, float(solution.iterate.durations.sum()))


def flown(source: Path, stage: Stage, threads: int) -> tuple[str, Inputs, StageResult]:
    """Inputs and result of a checkpoint, or of a course that is flown now, from the plan."""
    if source.suffix == ".h5":
        run = run_of_checkpoint(read_checkpoint(source), source)
        stored = run.checkpoint.stage(stage)
        if stored is None:
            sys.exit(f"{source} has no stage {stage.value}")
        return run.name, run.inputs, stored.result
    inputs = load_inputs(source)
    inputs = dataclasses.replace(inputs, settings=Settings(guess=GuessKind.PLAN))
    *_, result = optimize(inputs.race, inputs.settings, until=stage, threads=threads, progress=Silent())
    return source.stem, inputs, result


def study(source: Path, stage: Stage, *, every: int, threads: int) -> tuple[str, list[Comparison]]:
    """All comparisons of one course: of every n-th number that is not free, the largest first."""
    name, inputs, result = flown(source, stage, threads)
    active = [one for one in sensitivities(inputs, result).values() if one.activity is not Activity.FREE]
    solver = inputs.settings.solver
    with SolverService(threads=threads, stall_seconds=solver.stall_seconds) as service:
        own = Study(inputs, result, service)
        compared: list[Comparison] = []
        for one in active[::every]:
            compared.append(own.compare(one))
            print(f"{name}: {len(compared)} of {len(active[::every])}, {one.key}", file=sys.stderr)
        return f"{name}, {stage.value}", compared


def row(title: str, compared: list[Comparison]) -> str:
    """One row of the table."""
    count = len(compared)
    confirmed, strict = (sum(one.within(limit) for one in compared) for limit in (ABSOLUTE, STRICT))
    solved = [one for one in compared if math.isfinite(one.central)]
    errors = sorted(max(seconds for seconds, _ in one.errors) for one in solved) or [math.nan]
    times = sorted(
        abs(one.sensitivity.per_unit - one.of_race_time) / abs(one.of_race_time)
        for one in compared
        if one.of_race_time and math.isfinite(one.of_race_time) and one.sensitivity.weight > ABSOLUTE
    )
    middle = f"{100.0 * times[len(times) // 2]:.1f} %" if times else "-"
    return (
        f"| {title} | {count} | {confirmed} ({100.0 * confirmed / count:.1f} %) | {strict} "
        f"({100.0 * strict / count:.1f} %) | {1e3 * errors[len(errors) // 2]:.4f} | {1e3 * errors[-1]:.3f} | "
        f"{middle} |"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sources", nargs="+", type=Path, help="course files, or checkpoints that have the stage")
    parser.add_argument("--stage", default="point-mass", help="the stage whose sensitivities are studied")
    parser.add_argument("--every", type=int, default=1, help="only every n-th of the numbers that are not free")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--all", action="store_true", help="list every comparison")
    options = parser.parse_args()
    stage = Stage(options.stage)
    print(
        "| course, stage | numbers | within 5 % or 1 ms | within 5 % or 0.1 ms | median error, ms per step | worst | "
        "race time alone, median |\n|---|---|---|---|---|---|---|"
    )
    listed: list[str] = []
    for source in options.sources:
        title, compared = study(source, stage, every=options.every, threads=options.threads)
        print(row(title, compared), flush=True)
        for one in compared:
            if options.all or not one.within(STRICT):
                told, found = (
                    1e3 * one.sensitivity.per_unit * one.sensitivity.usual_step,
                    1e3 * one.central * one.sensitivity.usual_step,
                )
                why = "" if one.within(STRICT) else one.reason
                mark = "" if one.within(ABSOLUTE) else "**no**"
                listed.append(f"| {title} | `{one.sensitivity.key}` | {told:+.4f} | {found:+.4f} | {mark} | {why} |")
    print("\n| course, stage | number | sensitivity, ms per step | re-optimised | confirmed | why it differs |")
    print("|---|---|---|---|---|---|")
    print("\n".join(listed))


if __name__ == "__main__":
    main()
