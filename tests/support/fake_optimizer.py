"""A procedure that computes nothing: canned results, so that the command line can be tested without a solver.

Run as a script it is `airrace` with this procedure in the place of the real one; see `main` for its scenarios.
"""

import dataclasses
import math
import os
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from importlib import import_module
from typing import TYPE_CHECKING

import numpy as np

from airrace.errors import InputError, OutOfTime, SolverCrash
from airrace.optimal_control.certificate import Certificate, Curvature, Item, SecondOrder
from airrace.optimal_control.quantities import Quantity
from airrace.optimal_control.trajectory import Array, Trajectory
from airrace.procedure.result import (
    OUTCOMES,
    Attempt,
    GateSplit,
    Iteration,
    Progress,
    StageProvenance,
    StageResult,
    Status,
    Timings,
)
from airrace.procedure.settings import Settings
from airrace.procedure.stage import Stage
from airrace.procedure.stored_stages import Continuous
from airrace.race import Race

if TYPE_CHECKING:
    import pytest

STAGES = (Stage.HOMOTOPY, Stage.POINT_MASS)
REPLACED = {
    "STAGES": "airrace.procedure.procedure",
    "optimize": "airrace.procedure.procedure",
    "recompute": "airrace.procedure.procedure",
    "continuous": "airrace.procedure.stored_stages",
    "derived_quantities": "airrace.procedure.stored_stages",
    "ensure_matches_model": "airrace.procedure.stored_stages",
    "sampler": "airrace.procedure.stored_stages",
}
"""The names that this procedure takes the place of, each with the module in which they are looked up."""


def install(patch: "pytest.MonkeyPatch") -> None:
    """Let this procedure take the place of the real one."""
    for name, module in REPLACED.items():
        patch.setattr(f"{module}.{name}", globals()[name])


def certificate(*, kkt_error: float = 1e-9) -> Certificate:
    return Certificate(
        "Solve_Succeeded",
        (
            Item("kkt_error", kkt_error, 1e-6),
            Item("bank_between_nodes", 0.001, 0.0035, "rad", "phase 1"),
            Item("hamiltonian_drift", 0.001, 0.02, "1"),
            Item("race_time_change", 0.001, 0.005, "s"),
        ),
        SecondOrder(Curvature.POSITIVE, 1e-4, math.nan, "", "", 12, 3),
    )


STATES = (
    ("x", "m", 100.0, 0.0),
    ("y", "m", 100.0, 0.0),
    ("z", "m", 100.0, -20.0),
    ("V_K", "m/s", 50.0, 80.0),
    ("n_z", "1", 1.0, 1.0),
    ("p_Kbar", "rad/s", 1.0, 0.0),
)
"""Name, unit, scale and value of the states of a straight flight; `x` grows."""


def stage_result(
    stage: Stage,
    outcome: Status = Status.SOLVED,
    *,
    kkt_error: float = 1e-9,
    passings: Sequence[str] = ("1:start", "1:g1", "1:finish"),
) -> StageResult:
    """A straight flight, 10 s long, in phases of equal length and two intervals each."""
    legs = len(passings) - 1
    time_of = np.linspace(0.0, 10.0, 2 * legs + 1)
    trajectory = Trajectory(
        phases=tuple(passings[:-1]),
        first_node=2 * np.arange(legs + 1),
        durations=np.full(legs, 10.0 / legs),
        time=time_of,
        states=tuple(Quantity(name, unit, scale) for name, unit, scale, _ in STATES),
        state=np.stack([80.0 * time_of, *(np.full(len(time_of), value) for *_, value in STATES[1:])]),
        controls=(Quantity("n_z_dot", "1/s", 10.0),),
        control=np.zeros((1, 2 * legs)),
    )
    return StageResult(
        stage=stage,
        outcome=outcome,
        message="" if outcome is Status.SOLVED else "gate g1 cannot be reached",
        trajectory=trajectory,
        constraint_multipliers=np.zeros(3),
        bound_multipliers=np.zeros(2),
        certificate=None if stage is Stage.HOMOTOPY else certificate(kkt_error=kkt_error),
        splits=tuple(
            GateSplit(name, 10.0 * index / legs, 80.0, 20.0, 1.0, 0.0, 0.0, 0.0) for index, name in enumerate(passings)
        ),
        attempts=(Attempt("joint", "interior-point", "Solve_Succeeded", outcome is Status.SOLVED, 12, 0.5),),
        timings=Timings(solve=0.5, derivatives=0.4, wall=0.75),
        provenance=StageProvenance() if stage in STAGES else StageProvenance(source_stage=Stage.POINT_MASS.value),
    )


def solve_single_mesh(result: StageResult) -> StageResult:
    """The same stage without the comparison of its race time with that on a coarser mesh."""
    assert result.certificate is not None
    items = tuple(item for item in result.certificate.items if item.name != "race_time_change")
    return dataclasses.replace(result, certificate=dataclasses.replace(result.certificate, items=items))


def solve_roughly(result: StageResult) -> StageResult:
    """The same stage, solved only as closely as the next one needs."""
    assert result.certificate is not None
    items = tuple(
        item for item in result.certificate.items if item.name not in ("hamiltonian_drift", "race_time_change")
    )
    return dataclasses.replace(result, certificate=Certificate(result.certificate.solver_status, items))


def optimize(
    race: Race,
    settings: Settings,
    *,
    until: Stage,
    threads: int,
    finished: Sequence[StageResult] = (),
    start: Sequence[StageResult] = (),
    start_name: str = "",
    timeout: float | None = None,
    progress: Progress,
) -> Iterator[StageResult]:
    """The scenario named in FAKE_SCENARIO, stage by stage."""
    scenario = os.environ.get("FAKE_SCENARIO", "certified")
    skipped = {result.stage for result in finished}
    for stage in STAGES[: STAGES.index(until) + 1]:
        if stage in skipped:
            continue
        progress.stage_started(stage)
        progress.activity("phase 1 of 2: start -> g1", 0, 2)
        progress.iteration(Iteration(1, 10.5, 1e-3))
        if stage is Stage.POINT_MASS:
            _end(scenario, progress)
        result = _result(stage, scenario, [passage.name for passage in race.course.passages])
        yield result


def _end(scenario: str, progress: Progress) -> None:
    match scenario:
        case "slow":
            for number in range(2, 6000):
                time.sleep(0.1)
                progress.iteration(Iteration(number, 10.0, 1.0 / number))
        case "crash":
            raise SolverCrash("the solver process died")
        case "memory":
            raise MemoryError
        case "bug":
            raise ZeroDivisionError("a division\nby zero")
        case "interrupt":
            raise KeyboardInterrupt
        case "out of time":
            raise OutOfTime("there is no time left")
        case "invalid":
            raise InputError([])


def _result(stage: Stage, scenario: str, passings: Sequence[str]) -> StageResult:
    if stage is Stage.HOMOTOPY:
        return stage_result(stage, passings=passings)
    if scenario == "loose":
        return stage_result(stage, kkt_error=1e-3, passings=passings)
    outcomes = {outcome.value: outcome for outcome in OUTCOMES}
    return stage_result(stage, outcomes.get(scenario, Status.SOLVED), passings=passings)


def recompute(
    race: Race, settings: Settings, results: Sequence[StageResult]
) -> Iterator[tuple[StageResult, StageResult]]:
    for result in results:
        loose = os.environ.get("FAKE_SCENARIO") == "loose" and result.certificate is not None
        again = certificate(kkt_error=1e-3) if loose else result.certificate
        yield result, dataclasses.replace(result, certificate=again)


def ensure_matches_model(race: Race, result: StageResult) -> None:
    """Take any histories."""


def derived_quantities(race: Race, result: StageResult) -> Mapping[Quantity, object]:
    return {}


def continuous(race: Race, result: StageResult, longest_step: float) -> Continuous:
    """At the nodes alone."""
    flown = result.trajectory
    interval = np.minimum(np.arange(len(flown.time)), flown.control.shape[1] - 1)
    controls = dict(zip(flown.controls, flown.control[:, interval], strict=True))
    return Continuous(flown.time, dict(zip(flown.states, flown.state, strict=True)) | controls, {})


def sampler(race: Race, result: StageResult) -> "Sampler":
    return Sampler(result)


class Sampler:
    """Interpolates the nodes."""

    def __init__(self, result: StageResult) -> None:
        self._trajectory = result.trajectory

    def __call__(self, time_of: Array) -> Mapping[str, Array]:
        names = [one.name for one in self._trajectory.states]
        return {name: np.interp(time_of, self._trajectory.time, self._trajectory[name]) for name in names}


def main() -> None:
    """`airrace`, flown by this procedure."""
    from airrace.__main__ import main as airrace

    for name, module in REPLACED.items():
        setattr(import_module(module), name, globals()[name])
    airrace()


if __name__ == "__main__":
    sys.exit(main())
