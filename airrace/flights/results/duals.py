"""The dual quantities of a stage: costates, Hamiltonian and multipliers, as named arrays with units.

Signs: a costate is by how much the race time grows with one unit more of its state there; the Hamiltonian
`H = p . f + regularisation` is -1 along an optimum in minimum time; a multiplier is positive at an upper bound and
negative at a lower one, so that raising an upper bound by one unit changes the race time by minus the multiplier
(seconds per unit). All of it follows from the stored multipliers.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from airrace.flights.results.flight import StoredOptimum
from airrace.optimal_control import optimality
from airrace.optimal_control.layout import Layout
from airrace.optimal_control.multipliers import MULTIPLIER_SIGN, DualVariable, dual_variables
from airrace.optimal_control.problem import Iterate, Problem
from airrace.optimal_control.quantities import Quantity
from airrace.optimal_control.solvers.interface import Multipliers
from airrace.optimal_control.trajectory import Array
from airrace.procedure.fidelity import ensure_matches_model, iterate_of
from airrace.procedure.result import StageResult
from airrace.procedure.settings import Settings
from airrace.procedure.stage_problem import formulate, mesh_of
from airrace.race import Race
from airrace.runtime.resources import extra

if TYPE_CHECKING:
    from pandas import DataFrame
    from xarray import Dataset


@dataclass(frozen=True, eq=False)
class NamedArray:
    """Histories over one time axis, each with its declaration.

    Attributes:
        time: s from the start, shape (N,).
        quantities: name, unit and meaning of each row.
        values: shape (n, N), in the declared units.
    """

    time: Array
    quantities: tuple[Quantity, ...]
    values: Array

    def __getitem__(self, name: str) -> Array:
        """Return one history by its name, shape (N,).

        Raises:
            KeyError: there is none of this name.
        """
        for quantity, row in zip(self.quantities, self.values, strict=True):
            if quantity.name == name:
                return row
        raise KeyError(name)

    def to_xarray(self) -> "Dataset":
        """Return the histories as a dataset of xarray over `time`, with units and meanings as attributes.

        Raises:
            UsageError: xarray is not installed.
        """
        xarray: Any = extra("xarray", "a dataset")  # Any: without xarray there are no types
        variables = {
            quantity.name: ("time", row, {"units": quantity.unit, "long_name": quantity.text})
            for quantity, row in zip(self.quantities, self.values, strict=True)
        }
        return xarray.Dataset(variables, coords={"time": ("time", self.time, {"units": "s"})})

    def __repr__(self) -> str:
        names = ", ".join(f"{quantity.name} [{quantity.unit}]" for quantity in self.quantities)
        return f"<NamedArray of {len(self.time)} times: {names}>"


@dataclass(frozen=True, eq=False)
class ConstraintMultipliers:
    """The multipliers of all limits that are no bounds of states and controls.

    Attributes:
        names: what is limited, and where: of a path limit its phase, else the passage.
        units: of the multipliers, `s/unit`.
        node: the node at which each limit holds, shape (m,), integers.
        time: of that node, s; shape (m,).
        values: shape (m,).
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    node: np.ndarray
    time: Array
    values: Array

    def to_dataframe(self) -> "DataFrame":
        """Return one row per limit as a data frame of pandas.

        Raises:
            UsageError: pandas is not installed.
        """
        pandas: Any = extra("pandas", "a data frame")  # Any: without pandas there are no types
        columns = {"name": self.names, "node": self.node, "time_s": self.time, "value": self.values, "unit": self.units}
        return pandas.DataFrame(columns)

    def __repr__(self) -> str:
        active = int(np.count_nonzero(np.abs(self.values) > 1e-9))
        return f"<ConstraintMultipliers of {len(self.names)} limits, {active} of them active>"


@dataclass(frozen=True, eq=False)
class OptimumArrays:
    """The duals of an optimum by name.

    Attributes:
        duals: costates, Hamiltonian, and the multipliers of everything that is limited, added up at every node.
        limits: the same of limits on path quantities and at passings, one by one.
        sign: what the sign of a multiplier means.
    """

    duals: tuple[DualVariable, ...]
    limits: "ConstraintMultipliers"
    sign: str = MULTIPLIER_SIGN


def optimum_arrays(stored: StoredOptimum) -> OptimumArrays:
    """Return the duals of a stored optimum, in seconds per unit."""
    result = stored.result
    problem, iterate = discretise(stored.race, stored.settings, result)
    solved = Multipliers(result.constraint_multipliers, result.bound_multipliers)
    duals = dual_variables(Layout(problem), iterate, solved, "s")
    return OptimumArrays(tuple(duals), multipliers(problem, result))


def discretise(race: Race, settings: Settings, result: StageResult) -> tuple[Problem, Iterate]:
    """Return the discretised problem of a stage on the mesh of its result, and the result as its iterate.

    Raises:
        CheckpointError: the histories are not those of the stage's model.
    """
    ensure_matches_model(race, result)
    stage_problem = formulate(result.stage, race, settings, result.trajectory, result.pylon_conditions)
    return stage_problem.problem(mesh_of(result.trajectory)), iterate_of(result.trajectory)


def costates(problem: Problem, result: StageResult) -> NamedArray:
    """Return the costates at the ends of the intervals, s per unit of the state; before a jump where one follows."""
    quantities = tuple(
        Quantity(state.name, f"s/({state.unit})", text=f"costate of {state.text or state.name}")
        for state in problem.system.states
    )
    values = optimality.costates(Layout(problem), result.constraint_multipliers)
    return NamedArray(result.trajectory.time[1:], quantities, values)


def hamiltonian(problem: Problem, iterate: Iterate, result: StageResult) -> NamedArray:
    """Return the Hamiltonian at the ends of the intervals, with the regularisation of the objective in it."""
    quantity = Quantity("H", "1", text="Hamiltonian, -1 along an optimum in minimum time")
    values = optimality.hamiltonian(problem, iterate, result.constraint_multipliers)
    return NamedArray(result.trajectory.time[1:], (quantity,), values[None, :])


def multipliers(problem: Problem, result: StageResult) -> ConstraintMultipliers:
    """Return the multipliers of the limits on path quantities and at passages, in seconds per unit of each."""
    layout = Layout(problem)
    places, node = layout.row_index, layout.rows.node
    units = tuple(f"s/({layout.rows.row(row).quantity.unit})" for row in range(len(node)))
    return ConstraintMultipliers(
        names=tuple(layout.describe(place) for place in places.tolist()),
        units=units,
        node=node,
        time=result.trajectory.time[node],
        values=result.constraint_multipliers[places] / layout.rows.scale,
    )
