"""Solutions as datasets of xarray, data frames of pandas and figures of matplotlib, none of which is needed else."""

import math
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from airrace.optimal_control.layout import narrow_range
from airrace.optimal_control.multipliers import dual_variables
from airrace.optimal_control.quantities import Quantity
from airrace.optimal_control.trajectory import Array
from airrace.runtime.resources import extra

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pandas import DataFrame
    from xarray import Dataset

    from airrace.optimal_control.solution import Solution

DIMENSIONS = {"node": "time", "interval": "interval_time", "interval_end": "interval_end", "phase": "phase_number"}
"""The dimensions of a dataset by those of dual variables."""
COORDINATES = {"time", "interval_time", "interval_end", "phase", "phase_name", "phase_number", "duration"}
"""The names that a dataset has for itself."""
PANEL_HEIGHT = 1.7
"""The height of the panel of a quantity, inches."""


def to_xarray(solution: "Solution") -> "Dataset":
    """Return a solution as a dataset; see `Solution.to_xarray`."""
    xarray: Any = extra("xarray", "a dataset")  # Any: without xarray there are no types
    system, time = solution.problem.system, solution.time
    variables: dict[str, tuple[str, Array, dict[str, str]]] = {}

    def add(name: str, dimension: str, values: Array, unit: str, text: str, **more: str) -> None:
        name = f"own_{name}" if name in COORDINATES else name
        variables[name] = (dimension, values, {"units": unit, "long_name": text, **more})

    for quantity in system.states:
        add(quantity.name, "time", solution.state(quantity.name), quantity.unit, quantity.text or quantity.name)
    for quantity in system.controls:
        label = quantity.text or quantity.name
        add(quantity.name, "interval_time", solution.control(quantity.name), quantity.unit, label)
    for quantity in system.path:
        add(quantity.name, "time", solution.output(quantity.name), quantity.unit, quantity.text or quantity.name)
    for dual in dual_variables(solution.layout, solution.iterate, solution.multipliers, "1"):
        add(dual.name, DIMENSIONS[dual.dimension], dual.values, dual.unit, dual.text, sign=dual.sign)
    about = {"units": "s", "long_name": "duration of the phase"}
    variables["duration"] = ("phase_number", solution.iterate.durations, about)
    coordinates = {
        "time": ("time", time, {"units": "s", "long_name": "time at the nodes"}),
        "interval_time": ("interval_time", time[:-1], {"units": "s", "long_name": "beginning of the interval"}),
        "interval_end": ("interval_end", time[1:], {"units": "s", "long_name": "end of the interval"}),
        "phase_name": ("phase_number", np.array(solution.phases), {"long_name": "name of the phase"}),
        "phase": ("interval_time", phase_of_intervals(solution), {"long_name": "phase of the interval"}),
    }
    return xarray.Dataset(variables, coords=coordinates, attrs=attributes(solution))


def per(quantity: Quantity) -> str:
    """Return the unit of what the objective changes by per unit of a quantity."""
    return f"1/({quantity.unit})"


def phase_of_intervals(solution: "Solution") -> NDArray[np.str_]:
    """Return the name of the phase of every interval, shape (N,)."""
    return np.repeat(np.array(solution.phases), np.diff(solution.problem.first_node))


def attributes(solution: "Solution") -> dict[str, Any]:  # Any: texts and numbers
    """Return what a solution is, for a file's head."""
    return {
        "system": solution.problem.system.name,
        "objective": solution.objective,
        "verdict": solution.verdict,
        "certified": int(solution.certified),  # netCDF has no truth values, and a text is always true
        "solver": solution.solver,
        "scheme": solution.problem.scheme.name,
        "iterations": solution.iterations,
    }


def to_dataframe(solution: "Solution") -> "DataFrame":
    """Return a solution as a data frame; see `Solution.to_dataframe`."""
    pandas: Any = extra("pandas", "a data frame")  # Any: without pandas there are no types
    system, units = solution.problem.system, {"time": "s", **solution.units}
    phases = phase_of_intervals(solution)
    columns: dict[str, Any] = {"time": solution.time, "phase": np.append(phases, phases[-1])}
    for quantity in solution.quantities():
        if quantity in system.states:
            columns[quantity.name] = solution.state(quantity.name)
        elif quantity in system.controls:
            control = solution.control(quantity.name)
            columns[quantity.name] = np.append(control, control[-1])
        else:
            columns[quantity.name] = solution.output(quantity.name)
    for quantity in system.states:
        units[f"costate_{quantity.name}"] = per(quantity)
        columns[f"costate_{quantity.name}"] = np.append(math.nan, solution.costate(quantity.name))
    units["hamiltonian"] = "1/s"
    columns["hamiltonian"] = np.append(math.nan, solution.hamiltonian)
    frame = pandas.DataFrame(columns)
    frame.attrs.update(attributes(solution), units=units)
    return frame


def plot(solution: "Solution") -> "Figure":
    """Draw a solution; see `Solution.plot`."""
    figures: Any = extra("matplotlib.figure", "a figure", "plot")  # Any: matplotlib's types are partial
    system, time = solution.problem.system, solution.time
    quantities = (*system.states, *system.controls)
    rows = math.ceil(len(quantities) / 2)
    figure = figures.Figure(figsize=(9.0, 0.8 + PANEL_HEIGHT * rows), layout="constrained")
    panels = figure.subplots(rows, 2, sharex=True, squeeze=False).ravel()
    for panel, quantity in zip(panels, quantities, strict=False):
        if quantity in system.states:
            values = solution.state(quantity.name)
            panel.plot(time, values, color="tab:blue", linewidth=1.4)
        else:
            values = solution.control(quantity.name)
            panel.stairs(values, time, baseline=None, color="tab:red", linewidth=1.4)
        _bounds(panel, solution, quantity, values)
        for node in solution.problem.first_node[1:-1]:
            panel.axvline(time[node], color="0.8", linewidth=0.8, zorder=0)
        unit = "" if quantity.unit in ("1", "") else f" [{quantity.unit}]"
        panel.set_title(f"{quantity.text or quantity.name}{unit}", fontsize=9)
        panel.tick_params(labelsize=8)
        panel.margins(x=0.0)
    for panel in panels[len(quantities) :]:
        panel.set_axis_off()
    for panel in panels[max(len(quantities) - 2, 0) : len(quantities)]:
        panel.set_xlabel("time [s]", fontsize=9)
        panel.tick_params(labelbottom=True)
    figure.suptitle(str(solution), fontsize=9, wrap=True)
    return figure


def _bounds(panel: Any, solution: "Solution", quantity: Quantity, values: Array) -> None:  # Any: an axis
    """Draw the bounds of a quantity in every phase, where they are not far from its values."""
    reach = max(float(np.ptp(values)), 1e-9)
    for phase, (first, last) in zip(solution.problem.phases, pairwise(solution.problem.first_node), strict=True):
        bounds = narrow_range(quantity, phase.bounds)
        for bound in (bounds.lower, bounds.upper):
            if values.min() - 0.5 * reach <= bound <= values.max() + 0.5 * reach:
                ends = solution.time[[first, last]]
                panel.plot(ends, [bound, bound], color="0.5", linestyle=":", linewidth=1.0, zorder=0)
