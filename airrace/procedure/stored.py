"""The evaluation of a stored result: its histories at any time."""

from collections.abc import Callable, Mapping

import numpy as np

from airrace.optimal_control.sampling import sample
from airrace.planning.race import Race
from airrace.procedure.models import iterate_of, stage_model
from airrace.procedure.result import StageResult
from airrace.trajectory import Array


def sampler(race: Race, result: StageResult) -> Callable[[Array], Mapping[str, Array]]:
    """Return the function that gives the states at any times: from times in s, shape (n,), to histories by name.

    They are integrated from the node before.
    """
    model, iterate = stage_model(result.stage, race), iterate_of(result.trajectory)
    names = [quantity.name for quantity in model.system.states]
    time = result.trajectory.time

    def at(times: Array) -> Mapping[str, Array]:
        values = sample(model.system, model.parameter_values, iterate, time=time, times=times)
        return dict(zip(names, np.asarray(values), strict=True))

    return at
