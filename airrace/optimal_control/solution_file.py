"""Solutions in files of numpy's (`.npz`), without pickled objects: arrays, and a text in JSON that describes them.

The equations are not in the file, so nothing of it is ever executed: it is read together with the problem.
"""

import dataclasses
import json
import zipfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from airrace.errors import UsageError
from airrace.optimal_control.certificate import Certificate, Curvature, Item, SecondOrder
from airrace.optimal_control.layout import Layout
from airrace.optimal_control.optimality import KktError
from airrace.optimal_control.problem import Iterate, Problem
from airrace.optimal_control.solvers.interface import Ending, Multipliers

if TYPE_CHECKING:
    from airrace.optimal_control.solution import Solution

VERSION = 1
"""The version of this layout."""
PLAIN = (
    *("solver", "status", "success", "objective", "worst", "iterations", "seconds", "derivative_seconds"),
    *("replay_error", "remark"),
)
"""The attributes of a solution that are texts and numbers."""


def save(solution: "Solution", path: Path) -> None:
    """Write a solution to a file."""
    certificate = solution.certificate
    about = {
        "version": VERSION,
        "names": _names(solution.problem),
        "scheme": solution.problem.scheme.name,
        **{name: getattr(solution, name) for name in PLAIN},
        "ending": solution.ending.name,
        "kkt": dataclasses.asdict(solution.kkt),
        "second_order": _second_order_as_plain(solution.second_order),
        "certificate": None
        if certificate is None
        else [certificate.solver_status, [dataclasses.asdict(item) for item in certificate.items]],
        "meshes": [dataclasses.asdict(step) for step in solution.meshes],
    }
    arrays = {
        "durations": solution.iterate.durations,
        "state": solution.iterate.state,
        "control": solution.iterate.control,
        "constraint_multipliers": solution.multipliers.constraints,
        "bound_multipliers": solution.multipliers.bounds,
        "fractions": np.concatenate([np.asarray(phase.fractions) for phase in solution.problem.phases]),
        "first_node": np.array(solution.problem.first_node),
    }
    with path.open("wb") as file:
        np.savez(file, about=np.array(json.dumps(about)), **arrays)  # pyright: ignore[reportArgumentType]  of `allow_pickle`, which none of them is called


def load(path: Path, problem: Problem) -> dict[str, Any]:  # Any: the values are the solution's attributes
    """Return the attributes of a solution that `save` wrote.

    Raises:
        UsageError: there is no such file, or it belongs to another problem.
    """
    from airrace.optimal_control.solution import MeshStep  # which imports this module

    try:
        with np.load(path, allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
        about = json.loads(str(arrays["about"]))
        if about["version"] != VERSION:
            raise UsageError(f"{path} has version {about['version']} of the layout of solutions; this reads {VERSION}")
        if about["names"] != _names(problem):
            raise UsageError(f"{path} is a solution of another problem: {_difference(about['names'], _names(problem))}")
        first, fractions = arrays["first_node"].tolist(), arrays["fractions"].tolist()
        phases = [
            dataclasses.replace(phase, fractions=tuple(fractions[begin:end]))
            for phase, begin, end in zip(problem.phases, first[:-1], first[1:], strict=True)
        ]
        solved = dataclasses.replace(problem, phases=tuple(phases))
        iterate = Iterate(arrays["durations"], arrays["state"], arrays["control"])
        layout = Layout(solved)
        layout.pack(iterate)
        sizes = len(arrays["constraint_multipliers"]), len(arrays["bound_multipliers"])
        if sizes != (layout.constraints, layout.unknowns):
            raise ValueError(f"it has multipliers of {sizes[0]} constraints, and the problem has {layout.constraints}")
        certificate, second_order = about["certificate"], _second_order_of_plain(about["second_order"])
        if certificate is not None:
            status, items = certificate
            certificate = Certificate(status, tuple(Item(**item) for item in items), second_order)
        return {
            **{name: about[name] for name in PLAIN},
            "ending": Ending[about["ending"]],
            "kkt": KktError(**about["kkt"]),
            "second_order": second_order,
            "certificate": certificate,
            "meshes": tuple(MeshStep(**step) for step in about["meshes"]),
            "problem": solved,
            "iterate": iterate,
            "multipliers": Multipliers(arrays["constraint_multipliers"], arrays["bound_multipliers"]),
        }
    except (OSError, KeyError, ValueError, TypeError, zipfile.BadZipFile) as error:
        raise UsageError(f"{path} holds no solution that can be read: {error}") from error


def _names(problem: Problem) -> dict[str, list[str]]:
    """Return the names by which a problem is told from others."""
    system = problem.system
    return {
        "system": [system.name],
        "states": [quantity.name for quantity in system.states],
        "controls": [quantity.name for quantity in system.controls],
        "outputs": [quantity.name for quantity in system.path],
        "phases": [phase.name for phase in problem.phases],
    }


def _difference(stored: dict[str, list[str]], own: dict[str, list[str]]) -> str:
    """Return the first kind of names that differs, for people."""
    kind = next(kind for kind in own if stored.get(kind) != own[kind])
    return f"{kind} {', '.join(stored.get(kind, []))} instead of {', '.join(own[kind])}"


def _second_order_as_plain(verdict: SecondOrder | None) -> dict[str, Any] | None:  # Any: texts and numbers
    return None if verdict is None else {**dataclasses.asdict(verdict), "curvature": verdict.curvature.value}


def _second_order_of_plain(plain: dict[str, Any] | None) -> SecondOrder | None:  # Any: texts and numbers
    if plain is None:
        return None
    curvature = Curvature(plain.pop("curvature"))
    return SecondOrder(curvature=curvature, **plain)
