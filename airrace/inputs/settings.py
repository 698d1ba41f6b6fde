"""The settings language `airrace/settings/1`. Every key is optional; the defaults are the procedure's own."""

import dataclasses
import math
from typing import Annotated, Any, ClassVar, Literal, TypeVar

from annotated_types import Ge, Gt, Le
from pydantic import Field

from airrace.inputs.nodes import Reporter
from airrace.inputs.schema import Schema
from airrace.procedure.settings import (
    CertificateLimits,
    GuessKind,
    MeshCheck,
    MeshSettings,
    SearchEffort,
    Settings,
    SolverSettings,
)

SETTINGS_SCHEMA = "airrace/settings/1"

SolverName = Literal["fatrop", "ipopt"]
Count = Annotated[int, Ge(1), Le(1000)]
Positive = Annotated[float, Gt(0)]


class MeshEntry(Schema):
    what: ClassVar[str] = "the mesh"
    interval_s: Annotated[float, Ge(0.005), Le(5)] | None = Field(
        default=None, description="about this long is an interval of the first mesh"
    )
    intervals_min: Count | None = Field(default=None, description="at least so many intervals in a leg")
    refinements_max: Annotated[int, Ge(0), Le(20)] | None = Field(
        default=None, description="how many other meshes may be tried until the certificate holds"
    )


class SolverEntry(Schema):
    what: ClassVar[str] = "the solver"
    primary: SolverName | None = Field(default=None, description="the solver that is tried first")
    fallback: SolverName | None = Field(
        default=None, description="the solver that is tried on the same problem where the first one fails"
    )
    tolerance: Annotated[float, Ge(1e-12), Le(1e-3)] | None = Field(
        default=None, description="of the solver, on the scaled problem"
    )
    iterations_max: Annotated[int, Ge(1), Le(100_000)] | None = Field(default=None, description="per attempt")
    stall_s: Annotated[float, Ge(1), Le(86_400)] | None = Field(
        default=None, description="a solver that finishes no iteration for so long is stopped"
    )


class CertificateEntry(Schema):
    """The limits of the certificate; they can be tightened, never loosened."""

    what: ClassVar[str] = "the certificate"
    kkt_error: Positive | None = Field(
        default=None, description="largest error of the conditions of optimality, scaled"
    )
    load_factor: Positive | None = Field(
        default=None,
        description="largest excess of load factors, lift coefficient and power lever between the mesh points",
    )
    length_m: Positive | None = Field(
        default=None, description="largest excess of floor and ceiling between the mesh points"
    )
    angle_deg: Positive | None = Field(
        default=None,
        description="largest excess of the sideslip between the mesh points, and per second of the roll rate",
    )
    speed_m_s: Positive | None = Field(
        default=None, description="largest excess of speeds, between the mesh points and at gates"
    )
    gate_length_m: Positive | None = Field(default=None, description="largest excess of positions at a gate")
    gate_angle_deg: Positive | None = Field(
        default=None, description="largest excess of bank, climb and crossing angle at a gate"
    )
    replay: Positive | None = Field(
        default=None, description="largest deviation of the controls flown again, interval by interval, scaled"
    )
    replay_gate_m: Positive | None = Field(
        default=None, description="largest deviation of the controls flown again at the end of each leg"
    )
    hamiltonian: Positive | None = Field(default=None, description="how far the Hamiltonian may be from -1")
    race_time_s: Positive | None = Field(
        default=None, description="how much the race time may change when all intervals are halved"
    )
    variation: Positive | None = Field(
        default=None, description="how much the controls may be moved on average, as a share of their fastest rate"
    )


class SettingsEntry(Schema):
    """A whole settings file."""

    what: ClassVar[str] = "the settings"
    schema_: Literal["airrace/settings/1"] = Field(
        alias="schema", description="the language of this file and its version"
    )
    notes: str = Field(default="", description="whatever a reader should know")
    guess: Literal["homotopy", "plan"] | None = Field(
        default=None, description="where the point mass starts from: phase by phase, or straight from the plan"
    )
    search: Literal["off", "quick", "thorough"] | None = Field(
        default=None,
        description="how much is tried to find the fastest route",
    )
    alternatives: Annotated[int, Ge(1), Le(20)] | None = Field(
        default=None,
        description="how many of the best routes are taken through all stages",
    )
    mesh_check: Literal["last", "all"] | None = Field(
        default=None,
        description="which stages have their race time confirmed on a second mesh: the last one of a run, or all",
    )
    regularisation: Annotated[float, Ge(0), Le(1)] | None = Field(
        default=None, description="weight of the squared, scaled control rates against seconds"
    )
    mesh: MeshEntry = Field(default=MeshEntry(), description="how finely a flight is cut into intervals")
    solver: SolverEntry = Field(default=SolverEntry(), description="which solvers, and how long they may try")
    certificate: CertificateEntry = Field(
        default=CertificateEntry(), description="limits of the certificate; they can be tightened, not loosened"
    )


Part = TypeVar("Part", Settings, MeshSettings, SolverSettings, CertificateLimits)


def build_settings(entry: SettingsEntry, reporter: Reporter) -> Settings:
    """Return the settings of a run; they are only of use if nothing was reported."""
    silent = Settings()
    return _given(
        silent,
        guess=None if entry.guess is None else GuessKind(entry.guess),
        search=None if entry.search is None else SearchEffort(entry.search),
        alternatives=entry.alternatives,
        mesh_check=None if entry.mesh_check is None else MeshCheck(entry.mesh_check),
        regularisation=entry.regularisation,
        mesh=_given(
            silent.mesh,
            interval=entry.mesh.interval_s,
            intervals_min=entry.mesh.intervals_min,
            refinements_max=entry.mesh.refinements_max,
        ),
        solver=_given(
            silent.solver,
            primary=entry.solver.primary,
            fallback=entry.solver.fallback,
            tolerance=entry.solver.tolerance,
            iterations_max=entry.solver.iterations_max,
            stall_seconds=entry.solver.stall_s,
        ),
        certificate=_limits(entry.certificate, silent.certificate, reporter),
    )


def _limits(entry: CertificateEntry, silent: CertificateLimits, reporter: Reporter) -> CertificateLimits:
    degree = math.radians(1.0)
    limits = silent
    for key, name, unit in (
        ("kkt_error", "kkt_error", 1.0),
        ("load_factor", "load_factor", 1.0),
        ("length_m", "length", 1.0),
        ("angle_deg", "angle", degree),
        ("speed_m_s", "speed", 1.0),
        ("gate_length_m", "gate_length", 1.0),
        ("gate_angle_deg", "gate_angle", degree),
        ("replay", "replay", 1.0),
        ("replay_gate_m", "replay_gate", 1.0),
        ("hamiltonian", "hamiltonian", 1.0),
        ("race_time_s", "race_time", 1.0),
        ("variation", "variation", 1.0),
    ):
        value: float | None = getattr(entry, key)
        if value is None:
            continue
        loosest: float = getattr(silent, name) / unit
        if value > loosest * (1.0 + 1e-12):  # the default itself, written in degrees, is allowed
            reporter.value(
                ("certificate", key), f"limits can only be tightened: must be at most {loosest:g}, not {value:g}"
            )
        limits = dataclasses.replace(limits, **{name: value * unit})
    return limits


# Any: fields of any type, checked by the schema before.
def _given(silent: Part, **values: Any) -> Part:
    """Return the defaults with what was given in their place."""
    return dataclasses.replace(silent, **{name: value for name, value in values.items() if value is not None})
