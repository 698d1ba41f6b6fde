"""The equations of a stage, and a stored flight as the unknowns of its problem; nothing here loads a solver."""

from airrace.dynamics.flight_model import FlightModel
from airrace.optimal_control.problem import Iterate
from airrace.planning.race import Race
from airrace.procedure.fidelities import fidelity_of
from airrace.procedure.stage import Stage
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
