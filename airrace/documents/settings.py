"""The settings language `airrace/settings/1`: every key optional; silent ones keep the procedure's own defaults."""

import dataclasses
import math
from typing import Annotated, Any, ClassVar, Literal, TypeVar

from annotated_types import Ge, Gt, Le
from pydantic import Field

from airrace.documents.nodes import Reporter
from airrace.documents.schema import Schema
from airrace.procedure.settings import CertificateLimits, GuessKind, MeshSettings, Settings, SolverSettings

SETTINGS_SCHEMA = "airrace/settings/1"

SolverName = Literal["fatrop", "ipopt"]
Count = Annotated[int, Ge(1), Le(1000)]
Positive = Annotated[float, Gt(0)]


class MeshEntry(Schema):
    what: ClassVar[str] = "the mesh"
    interval_s: Annotated[float, Ge(0.005), Le(5)] | None = None
    intervals_min: Count | None = None
    refinements_max: Annotated[int, Ge(0), Le(20)] | None = None


class SolverEntry(Schema):
    what: ClassVar[str] = "the solver"
    primary: SolverName | None = None
    fallback: SolverName | None = None
    tolerance: Annotated[float, Ge(1e-12), Le(1e-3)] | None = None
    iterations_max: Annotated[int, Ge(1), Le(100_000)] | None = None
    stall_s: Annotated[float, Ge(1), Le(86_400)] | None = None
    compile_kernels: bool | None = None


class CertificateEntry(Schema):
    """Limits of the certificate; they can be tightened, never loosened."""

    what: ClassVar[str] = "the certificate"
    kkt_error: Positive | None = None
    load_factor: Positive | None = None
    length_m: Positive | None = None
    angle_deg: Positive | None = None
    speed_m_s: Positive | None = None
    gate_length_m: Positive | None = None
    gate_angle_deg: Positive | None = None
    replay: Positive | None = None


class SettingsEntry(Schema):
    """A whole settings file."""

    what: ClassVar[str] = "the settings"
    schema_: Literal["airrace/settings/1"] = Field(alias="schema")
    notes: str = ""
    guess: Literal["homotopy", "plan"] | None = None
    regularisation: Annotated[float, Ge(0), Le(1)] | None = None
    mesh: MeshEntry = MeshEntry()
    solver: SolverEntry = SolverEntry()
    certificate: CertificateEntry = CertificateEntry()


Part = TypeVar("Part", Settings, MeshSettings, SolverSettings, CertificateLimits)


def build_settings(entry: SettingsEntry, reporter: Reporter) -> Settings:
    """The settings of a run; they are only of use if nothing was reported."""
    silent = Settings()
    return _given(
        silent,
        guess=None if entry.guess is None else GuessKind(entry.guess),
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
            compile_kernels=entry.solver.compile_kernels,
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
    """The defaults with what was given in their place."""
    return dataclasses.replace(silent, **{name: value for name, value in values.items() if value is not None})
