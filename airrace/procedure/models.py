"""The equations of a stage, and a stored flight held against them or taken as unknowns; nothing here loads a solver."""

from collections.abc import Sequence

from airrace.dynamics.flight_model import FlightModel
from airrace.errors import CheckpointError
from airrace.optimal_control.problem import Iterate
from airrace.planning.race import Race
from airrace.procedure.fidelities import fidelity_of
from airrace.procedure.result import StageResult
from airrace.procedure.stage import Stage
from airrace.quantities import Quantity
from airrace.trajectory import Trajectory


def stage_model(stage: Stage, race: Race) -> FlightModel:
    """Return the equations of a stage, with the numbers and limits of a race.

    Raises:
        InputError: aircraft and rules leave no allowed value of some quantity.
    """
    course = race.course
    return fidelity_of(stage).build(race.aircraft, course.rules, race.air, counting=course.has_rolls)


def iterate_of(flown: Trajectory) -> Iterate:
    """Return the unknowns of a stored flight."""
    return Iterate(flown.durations, flown.state, flown.control)


def ensure_matches_model(race: Race, result: StageResult) -> None:
    """Refuse a stored stage whose histories are not those of its model, and its alternatives likewise.

    Names, their order and units decide, for whatever reads a flight goes by them. How a history is described, and
    which values are allowed, may differ.

    Args:
        race: what is flown.
        result: a stage as it was read from a file.

    Raises:
        CheckpointError: a state or a control is missing, unknown, in another place or in another unit; or the flight
            has another number of legs than the course.
        InputError: aircraft and rules leave no allowed value of some quantity.
    """
    system, legs = stage_model(result.stage, race).system, len(race.course.passages) - 1
    for one in (result, *result.alternatives):
        flown, name = one.trajectory, one.stage.value
        _ensure_same(name, "state", flown.states, system.states)
        _ensure_same(name, "control", flown.controls, system.controls)
        if len(flown.phases) != legs:
            raise CheckpointError(f"{name}: its flight has {len(flown.phases)} legs, and the course has {legs}")


def _ensure_same(stage: str, kind: str, stored: Sequence[Quantity], declared: Sequence[Quantity]) -> None:
    names, wanted = [one.name for one in stored], [one.name for one in declared]
    missing = [name for name in wanted if name not in names]
    unknown = [name for name in names if name not in wanted]
    if missing:
        raise CheckpointError(f"{stage}: the {kind} {missing[0]} is missing")
    if unknown:
        raise CheckpointError(f"{stage}: its model has no {kind} {unknown[0]}")
    if names != wanted:
        raise CheckpointError(f"{stage}: its {kind}s are {', '.join(names)}, in another order than its model's")
    for mine, other in zip(stored, declared, strict=True):
        if (mine.unit, mine.rate_of) != (other.unit, other.rate_of):
            raise CheckpointError(f"{stage}: the {kind} {mine.name} is declared as another quantity than its model's")
