"""The solution of a problem, looked at by the names of its quantities.

Signs: a costate is by how much the objective grows with one unit more of its state there; a multiplier is positive at
an upper bound and negative at a lower one, so that raising an upper bound by one unit changes the objective by minus
the multiplier. Both are in the objective's unit per unit of the quantity.
"""

from collections.abc import Iterator
from dataclasses import dataclass, fields
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Self

import numpy as np

from airrace.optimal_control import solution_file, solution_views
from airrace.optimal_control.certificate import OBJECTIVE_CHANGE, Certificate, Curvature
from airrace.optimal_control.layout import Layout
from airrace.optimal_control.multipliers import multipliers_of
from airrace.optimal_control.optimality import costates, hamiltonian
from airrace.optimal_control.problem import Problem
from airrace.optimal_control.quantities import Quantity
from airrace.optimal_control.replay import interval_durations
from airrace.optimal_control.solvers.solver import ProgramSolution
from airrace.optimal_control.system import at_points
from airrace.optimal_control.trajectory import Array, Trajectory

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pandas import DataFrame
    from xarray import Dataset


VIOLATED = 1e-6
"""The scaled violation from which on a constraint is named where no optimum was found (1)."""


@dataclass(frozen=True)
class MeshStep:
    """A mesh that was solved on: its number of intervals, and the objective of its optimum."""

    intervals: int
    objective: float


@dataclass(frozen=True, kw_only=True)
class Solution(ProgramSolution):
    """The answer of a solver to a problem, an optimum or not, with all that belongs to it by name.

    N intervals have N + 1 nodes. Attributes besides those of `ProgramSolution`:

    Attributes:
        problem: that was solved, on the last mesh.
        certificate: what was measured of the optimum; None where there is none.
        meshes: that were solved on, in their order.
        remark: why no finer mesh confirms it, where one was tried in vain; else empty.
    """

    problem: Problem
    certificate: Certificate | None = None
    meshes: tuple[MeshStep, ...] = ()
    remark: str = ""

    @classmethod
    def of_program(cls, problem: Problem, program: ProgramSolution, certificate: Certificate | None = None) -> Self:
        """Return what a solver answered about a problem."""
        answer = {field.name: getattr(program, field.name) for field in fields(ProgramSolution)}
        step = MeshStep(problem.intervals, program.objective)
        return cls(**answer, problem=problem, certificate=certificate, meshes=(step,))

    # what it is

    @property
    def certified(self) -> bool:
        """Whether everything that was measured holds, on a second mesh as well."""
        return self.success and self.certificate is not None and self.certificate.certified

    @property
    def verdict(self) -> str:
        """What the solution is, in a sentence for people."""
        if not self.success:
            violated = self.iterations > 0 and self.kkt.primal > VIOLATED
            return f"no optimum: {self.status}{f'; most violated: {self.worst}' if violated else ''}"
        kind = "a local minimum"
        if self.second_order is None or self.second_order.curvature is Curvature.SINGULAR:
            kind = "an optimum of first order"
            if self.second_order is not None:
                kind = f"a local minimum but for changes that cost next to nothing, as of {self.second_order.where}"
        items = () if self.certificate is None else self.certificate.items
        if self.certified:
            change = next(item.value for item in items if item.name == OBJECTIVE_CHANGE)
            meshes = f"{self.problem.intervals} intervals and on at most half as many"
            return f"{kind}: the objectives on {meshes} differ by {100.0 * change:.2g} %"
        mesh = f"{kind} of this mesh of {self.problem.intervals} intervals"
        reasons: list[str] = []
        for item in items:
            if not item.holds:
                place = f" ({item.where})" if item.where else ""
                reasons.append(f"{item.name} {item.value:.2g} > {item.limit:.2g}{place}")
        reasons += [self.remark] if self.remark else []
        return f"{mesh}; not certified: {', '.join(reasons)}" if reasons else f"{mesh}; no second mesh confirms it"

    def __str__(self) -> str:
        return f"{self.problem.system.name}: objective {self.objective:.9g}, {self.verdict}"

    # histories

    @cached_property
    def trajectory(self) -> Trajectory:
        """The histories of all states and controls, with phases, meshes and units."""
        system = self.problem.system
        steps = interval_durations(self.problem, self.iterate.durations)
        return Trajectory(
            phases=self.phases,
            first_node=np.array(self.problem.first_node, dtype=np.int64),
            durations=self.iterate.durations,
            time=np.concatenate([[0.0], np.cumsum(steps)]),
            states=system.states,
            state=self.iterate.state,
            controls=system.controls,
            control=self.iterate.control,
        )

    @property
    def time(self) -> Array:
        """The time at the nodes, s from the start; shape (N + 1,)."""
        return self.trajectory.time

    @property
    def phases(self) -> tuple[str, ...]:
        """The names of the phases."""
        return tuple(phase.name for phase in self.problem.phases)

    @property
    def units(self) -> dict[str, str]:
        """The units of all states, controls and outputs by name."""
        return {quantity.name: quantity.unit for quantity in self.quantities()}

    @property
    def durations(self) -> dict[str, float]:
        """The durations of the phases by name, s."""
        return dict(zip(self.phases, self.iterate.durations.tolist(), strict=True))

    def state(self, name: str) -> Array:
        """Return a state at the nodes, after a jump where there is one; shape (N + 1,).

        Raises:
            KeyError: no state has this name.
        """
        return self.iterate.state[_row(self.problem.system.states, name, "state")]

    def control(self, name: str) -> Array:
        """Return a control on the intervals, over which it is constant; shape (N,).

        Raises:
            KeyError: no control has this name.
        """
        return self.iterate.control[_row(self.problem.system.controls, name, "control")]

    def output(self, name: str) -> Array:
        """Return a path quantity at the nodes, the last one with the last control; shape (N + 1,).

        Raises:
            KeyError: no path quantity has this name.
        """
        system, row = self.problem.system, _row(self.problem.system.path, name, "output")
        assert system.path_values is not None
        control = np.hstack([self.iterate.control, self.iterate.control[:, -1:]])
        return at_points(system.path_values, self.iterate.state, control, np.asarray(self.problem.parameters))[row]

    def parameter(self, name: str) -> float:
        """Return a parameter that was optimised, in its unit.

        Raises:
            KeyError: no state of this name is constant.
        """
        values = self.state(name)
        if np.ptp(values) > 1e-6 * (1.0 + np.abs(values).max()):
            raise KeyError(f"{name} is a state that changes, no parameter")
        return float(values[0])

    # what it would cost to change it

    def costate(self, name: str) -> Array:
        """Return the costate of a state at the ends of the intervals, before any jump; shape (N,).

        Raises:
            KeyError: no state has this name.
        """
        row = _row(self.problem.system.states, name, "state")
        return costates(self.layout, self.multipliers.constraints)[row]

    @cached_property
    def hamiltonian(self) -> Array:
        """The Hamiltonian at the ends of the intervals, in the objective's unit per s; shape (N,).

        Where the duration of a phase is free it is minus the weight of time.
        """
        return hamiltonian(self.problem, self.iterate, self.multipliers.constraints)

    def multiplier(self, name: str) -> Array:
        """Return the multipliers of all limits of a quantity: of bounds, and of conditions at the ends of phases.

        Each counts for the stretch of time that its node or interval stands for: a multiplier divided by that is
        the density along the path. Where several conditions limit the quantity at a node, theirs add up.

        Args:
            name: of a state, a path quantity or what an observation sees, at the nodes, zero where there is no limit,
                shape (N + 1,); of a control, on the intervals, shape (N,); or `"duration"`, of the phases, shape (n,).

        Raises:
            KeyError: nothing has this name.
        """
        return multipliers_of(self.layout, self.multipliers, name)

    @cached_property
    def layout(self) -> Layout:
        """Where everything is in the nonlinear program."""
        return Layout(self.problem)

    # for other programs

    def to_xarray(self) -> "Dataset":
        """Return everything by name as a dataset of xarray, with units, meanings and signs as attributes.

        States, outputs and multipliers lie over `time`, at the nodes; controls over `interval_time`, where an interval
        begins; costates and the Hamiltonian over `interval_end`.

        Raises:
            UsageError: xarray is not installed.
        """
        return solution_views.to_xarray(self)

    def to_dataframe(self) -> "DataFrame":
        """Return one row per node as a data frame of pandas: time, phase, states, controls, costates and Hamiltonian.

        Controls are those of the interval that begins at the node; costates those of the one that ends there. Units
        are in `attrs`.

        Raises:
            UsageError: pandas is not installed.
        """
        return solution_views.to_dataframe(self)

    def plot(self) -> "Figure":
        """Draw all states and controls over time, with their bounds and the ends of phases.

        Raises:
            UsageError: matplotlib is not installed.
        """
        return solution_views.plot(self)

    def save(self, path: str | Path) -> None:
        """Write the solution to a file of numpy's (`.npz`); the equations stay in the program that states them."""
        solution_file.save(self, Path(path))

    @classmethod
    def load(cls, path: str | Path, problem: Problem) -> Self:
        """Read a solution of a problem that `save` wrote; its mesh counts, and that of the problem does not.

        Raises:
            UsageError: there is no such file, or it belongs to another problem.
        """
        values = solution_file.load(Path(path), problem)
        return cls(**values)

    def quantities(self) -> Iterator[Quantity]:
        """Yield the declarations of all states, controls and outputs."""
        system = self.problem.system
        yield from (*system.states, *system.controls, *system.path)


def _row(declared: tuple[Quantity, ...], name: str, kind: str) -> int:
    names = [quantity.name for quantity in declared]
    if name not in names:
        raise KeyError(f"no {kind} is called {name!r}; there are {', '.join(names) or 'none'}")
    return names.index(name)
