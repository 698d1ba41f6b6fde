"""The cost to go along flights, by the stored optimum of a stage."""

import functools
import math
from collections.abc import Mapping, Sequence
from contextlib import closing
from pathlib import Path

from airrace.errors import UsageError
from airrace.flights.logs.violations import StandardDeviations
from airrace.flights.results import Flight
from airrace.flights.results.comparison import ensure_comparable
from airrace.flights.results.cost_to_go import BANK, PATH, CostToGoLoss, Moment, losses_of, moments_of
from airrace.procedure.cost_to_go import Continuation, CostToGo, new_service, usual_deviations
from airrace.procedure.result import Silent
from airrace.procedure.solver_session import SolverSession
from airrace.procedure.stage import Stage
from airrace.runs.flight_sources import open_file, open_flights, open_sources
from airrace.runs.log_view import LogView
from airrace.runs.output import FlightName
from airrace.runs.run_state import RunState
from airrace.runs.stage_view import StageView
from airrace.runs.verification import flight_again
from airrace.runtime.process import available_cores
from airrace.runtime.standard_streams import stem_of

JOBS = 4
"""The parts into which the states of a flight are divided, to be solved side by side."""


def cost_to_go_of(view: StageView) -> CostToGo:
    """Return what solves the rest of a race by the optimum of a stage.

    Raises:
        UsageError: the stage is no optimum.
    """
    if not view.result.holds:
        raise UsageError(f"{view.name} is {view.status}: without an optimum there is no cost to go")
    return CostToGo.of_result(view.inputs.race, view.inputs.settings, view.result)


def cost_to_go_loss(
    view: StageView, flight: Flight, log: LogView | None = None, *, label: str = "", threads: int | None = None
) -> CostToGoLoss:
    """Return what a flight lost at every moment, by the cost to go of a stage.

    Args:
        view: the stage, an optimum.
        flight: of the same passings.
        log: that the flight comes from; None for an optimum, whose states are exact.
        label: of the stage, for people.
        threads: None for all cores.

    Raises:
        UsageError: the stage is no optimum, or the flight lacks a passing.
        SolverCrash: a solver process died.
    """
    rest = cost_to_go_of(view)
    moments = moments_of(flight, [state.name for state in rest.states])
    accuracies: Mapping[str, StandardDeviations] = {} if log is None else flight_again(log).known
    known = [_known(accuracies, flight, moment) for moment in moments]
    cores = threads or available_cores()
    with (
        new_service(1) as service,
        closing(SolverSession(service, view.inputs.settings, Silent(), cores)) as session,
    ):
        usual = usual_deviations(rest.states)
        jobs = [
            functools.partial(
                _solve_some, rest, moments[first::JOBS], [_box(usual, deviations) for deviations in known[first::JOBS]]
            )
            for first in range(JOBS)
        ]
        parts = session.side_by_side(jobs)
    continuations = [parts[row % JOBS][row // JOBS] for row in range(len(moments))]
    return losses_of(flight, moments, continuations, known, view.result, label or view.name)


def losses_by_name(names: Sequence[str], *, stage: str | None = None) -> list[CostToGoLoss]:
    """Return what all flights but the first lost, by the cost to go of the first one's run.

    A flight of the same stage is judged by that, any other by the run's point mass: of a log its states are known.

    Args:
        names: of the flights, see `airrace.runs.flight_sources`.
        stage: for runs whose names say none.

    Raises:
        UsageError: the first is no optimum of a run that has a point mass, or a flight lacks a passing.
        SolverCrash: a solver process died.
    """
    first, *others = open_sources(names, stage=stage)
    run = open_file(FlightName.of(names[0]).path) if isinstance(first, StageView) else None
    if not isinstance(first, StageView) or not isinstance(run, RunState):
        raise UsageError(f"{names[0]} is a flight log: the cost to go takes the optimum of a run, which stands first")
    flights, losses = open_flights(names, stage=stage), list[CostToGoLoss]()
    for source, flight in zip(others, flights[1:], strict=True):
        own = isinstance(source, StageView) and source.stage is first.stage
        view = first if own else run.stage(Stage.POINT_MASS)
        log = source if isinstance(source, LogView) else None
        losses.append(cost_to_go_loss(view, flight, log, label=f"{stem_of(Path(names[0]))}:{view.name}"))
    return losses


def log_loss(run: Path, log: LogView) -> CostToGoLoss:
    """Return what a log's flight lost by the cost to go of a run's point mass; errors as of `losses_by_name`."""
    opened = open_file(run)
    if not isinstance(opened, RunState):
        raise UsageError(f"{run} is a flight log: the cost to go takes the optimum of a run")
    view, flight = opened.stage(Stage.POINT_MASS), log.flight()
    own_flight = view.flight()
    ensure_comparable((own_flight.label, own_flight.course), (flight.label, flight.course))
    return cost_to_go_loss(view, flight, log, label=f"{stem_of(run)}:{view.name}")


def _solve_some(
    rest: CostToGo, moments: Sequence[Moment], boxes: Sequence[Mapping[str, float]], session: SolverSession
) -> list[Continuation]:
    """Return the fastest flights from some moments on."""
    continuations: list[Continuation] = []
    for moment, box in zip(moments, boxes, strict=True):
        continuations.append(rest.solve(session, moment.state, moment.leg, deviations=box))
    return continuations


def _box(usual: Mapping[str, float], known: Mapping[str, float]) -> dict[str, float]:
    """Return the deviations by which a start gives way: what is known less well gives way more easily."""
    box = dict(usual)
    for name, deviation in known.items():
        if name in box and math.isfinite(deviation):
            box[name] = max(box[name], deviation)
    attitude = 0.5 * max(known.get(BANK, 0.0), known.get(PATH, 0.0))
    for name in ("q0", "q1", "q2", "q3"):
        box[name] = max(box[name], attitude if math.isfinite(attitude) else 0.0)
    return box


def _known(accuracies: Mapping[str, StandardDeviations], flight: Flight, moment: Moment) -> dict[str, float]:
    """Return how well a recorded state is known: as at the nearest passing; nothing for an optimum, which is exact."""
    crossing = min(flight.crossings, key=lambda crossing: abs(crossing.time - moment.time))
    at = accuracies.get(crossing.name)
    if at is None:
        return {}
    known = {"x": at.across, "y": at.across, "z": at.up, "V_K": at.speed, "n_z": at.load, BANK: at.bank, PATH: at.path}
    return {name: deviation for name, deviation in known.items() if math.isfinite(deviation)}
