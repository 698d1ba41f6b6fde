"""What belongs to an optimum besides its histories, as named variables for files: mesh, phases and duals."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airrace.errors import CheckpointError
from airrace.files.export.earth import EARTH
from airrace.flights.results import Flight
from airrace.optimal_control.certificate import RefinementReason


@dataclass(frozen=True, eq=False)
class FileVariable:
    """A variable of a file.

    Attributes:
        name: letters, digits and underscores.
        dimension: `node`, `interval`, `phase` or `limit`.
        values: numbers or texts, one-dimensional.
        attributes: unit, meaning and sign.
    """

    name: str
    dimension: str
    values: NDArray[Any]  # Any: numbers or texts
    attributes: Mapping[str, str]


def optimum_variables(flight: Flight) -> list[FileVariable]:
    """Return mesh, phases, costates, Hamiltonian and multipliers of a flight; nothing where it is no optimum, or where
    its histories are not those of its model, so that they have no duals."""
    stored = flight.source.optimum
    if stored is None:
        return []
    from airrace.flights.results.duals import optimum_arrays  # takes the problem, which other formats do not need

    try:
        arrays = optimum_arrays(stored)
    except CheckpointError:  # `show` and `verify` say what is wrong with it
        return []
    trajectory, mesh, limits = stored.result.trajectory, stored.result.mesh, arrays.limits
    names = {dual.name for dual in arrays.duals}
    variables = [
        _variable("node_time", "node", trajectory.time, "s", "time at the nodes of the mesh"),
        _variable("phase_name", "phase", np.array(trajectory.phases), "", "phases: legs, named after their passings"),
        _variable("phase_first_node", "phase", trajectory.first_node[:-1], "1", "first node of the phase, from 0"),
        _variable("phase_duration", "phase", trajectory.durations, "s", "duration of the phase"),
    ]
    if len(mesh.why):
        reasons = ", ".join(f"{reason.value} {reason.name.lower().replace('_', ' ')}" for reason in RefinementReason)
        text = f"what the interval was last made finer or coarser for: {reasons}"
        variables += [
            _variable("mesh_reason", "interval", mesh.why.astype(np.int32), "1", text),
            _variable("mesh_defect", "interval", mesh.defect, "scaled", "deviation of the replay from the next node"),
            _variable("hamiltonian_drift", "interval", mesh.drift, "1", "distance of the Hamiltonian from -1"),
        ]
    for dual in arrays.duals:
        quantity, sign, _ = EARTH.get(dual.quantity, (dual.quantity, 1.0, ""))
        name = dual.name.removesuffix(dual.quantity) + quantity
        if name in names and name != dual.name:
            name, sign = dual.name, 1.0
        dimension = "interval" if dual.dimension == "interval_end" else dual.dimension
        place = " at the ends of the intervals" if dual.dimension == "interval_end" else ""
        text = dual.text if name == dual.name else f"{name.partition('_')[0]} of {quantity}"
        variables.append(_variable(name, dimension, sign * dual.values, dual.unit, text + place, sign=dual.sign))
    variables += [
        _variable("limit_name", "limit", np.array(limits.names), "", "limits on path quantities and at passings"),
        _variable("limit_node", "limit", limits.node, "1", "node at which the limit holds, from 0"),
        _variable("limit_unit", "limit", np.array(limits.units), "", "unit of the limit's multiplier"),
        _variable("limit_multiplier", "limit", limits.values, "", "multiplier of the limit", sign=arrays.sign),
    ]
    return [variable for variable in variables if len(variable.values)]


def _variable(
    name: str, dimension: str, values: NDArray[Any], unit: str, text: str, sign: str = ""
) -> FileVariable:  # Any: numbers or texts
    about = {"units": unit, "long_name": text, "sign": sign}
    return FileVariable(
        re.sub(r"\W", "_", name, flags=re.ASCII),
        dimension,
        values,
        {key: value for key, value in about.items() if value},
    )
