"""The languages `airrace/settings/1` and `airrace/batch/1`: how a race is solved, and of which races a batch consists.

Every key of the settings is optional; the defaults are the procedure's own.
"""

import dataclasses
from typing import Annotated, ClassVar, Literal

from annotated_types import Ge, Gt, Le
from pydantic import Field

from airrace.files.inputs.nodes import Reporter
from airrace.files.inputs.schema import Schema, optional
from airrace.procedure.settings import (
    CertificateLimits,
    GuessKind,
    MeshCheck,
    MeshSettings,
    SearchEffort,
    Settings,
    SolverSettings,
)

SolverName = Literal["interior-point", "ipopt"]
Count = Annotated[int, Ge(1), Le(1000)]
Limit = Annotated[float, Gt(0)] | None


class MeshEntry(Schema):
    what: ClassVar[str] = "the mesh"
    interval: Annotated[float, Ge(0.005), Le(5)] | None = optional(
        "about this long is an interval of the point mass's first mesh", alias="interval_s"
    )
    intervals_min: Count | None = optional("at least so many intervals in a leg")
    refinements_max: Annotated[int, Ge(0), Le(20)] | None = optional(
        "how many other meshes may be tried until the certificate holds"
    )


class SolverEntry(Schema):
    what: ClassVar[str] = "the solver"
    primary: SolverName | None = optional("the solver that is tried first, from either start")
    fallback: SolverName | None = optional("the solver that is tried on the same problem where the first one fails")
    tolerance: Annotated[float, Ge(1e-12), Le(1e-3)] | None = optional(
        "of the solver, on the scaled problem; where `kkt_error` fails it goes on to a hundredth of it"
    )
    iterations_max: Annotated[int, Ge(1), Le(100_000)] | None = optional(
        "per attempt; all attempts of a stage that find no optimum take 5,000 together"
    )
    stall_seconds: Annotated[float, Ge(1), Le(86_400)] | None = optional(
        "a solver that finishes no iteration for so long is stopped", alias="stall_s"
    )


class CertificateEntry(Schema):
    """The limits of the certificate; they can be tightened, never loosened."""

    what: ClassVar[str] = "the certificate"
    kkt_error: Limit = optional("largest error of the conditions of optimality, scaled")
    load_factor: Limit = optional(
        "largest excess of load factors, lift coefficient and throttle between the mesh points"
    )
    length: Limit = optional("largest excess of floor and ceiling between the mesh points", alias="length_m")
    angle: Limit = optional(
        "largest excess of the sideslip between the mesh points, and per second of the roll rate", alias="angle_deg"
    )
    speed: Limit = optional("largest excess of speeds, between the mesh points and at gates", alias="speed_m_s")
    gate_length: Limit = optional("largest excess of positions at a gate", alias="gate_length_m")
    gate_angle: Limit = optional("largest excess of bank, climb and crossing angle at a gate", alias="gate_angle_deg")
    replay: Limit = optional("largest deviation of the controls integrated again, interval by interval, scaled")
    replay_gate: Limit = optional(
        "largest deviation of the controls integrated again at the end of each leg", alias="replay_gate_m"
    )
    hamiltonian: Limit = optional("how far the Hamiltonian may be from -1")
    race_time: Limit = optional("how much the race time may change when all intervals are halved", alias="race_time_s")
    variation: Limit = optional("how much the controls may be moved on average, as a share of their fastest rate")

    def build(self, reporter: Reporter) -> CertificateLimits:
        """Return the limits; one that is looser than the default is reported."""
        defaults, tightened = CertificateLimits(), self.arguments()
        for name, value in tightened.items():
            loosest, number = getattr(defaults, name), getattr(self, name)
            if value > loosest * (1.0 + 1e-12):  # the default itself, written in degrees, is allowed
                key = type(self).model_fields[name].alias or name
                limit = loosest * number / value  # in the unit of the key
                reporter.value(
                    ("certificate", key), f"limits can only be tightened: must be at most {limit:g}, not {number:g}"
                )
        return dataclasses.replace(defaults, **tightened)


class SettingsEntry(Schema):
    """A whole settings file."""

    what: ClassVar[str] = "the settings"
    schema_: Literal["airrace/settings/1"] = Field(
        alias="schema", description="the language of this file and its version"
    )
    notes: str = Field(default="", description="whatever a reader should know")
    guess: Literal["homotopy", "plan"] | None = optional(
        "whether the race is solved phase by phase first, as one of the starts, or the plan is the guess"
    )
    search: Literal["off", "quick", "thorough"] | None = optional("how much is tried to find the fastest route")
    gap: Annotated[float, Ge(0), Le(1)] | None = optional(
        "share of the race time within which a thorough search seeks a lower bound of it"
    )
    alternatives: Annotated[int, Ge(1), Le(20)] | None = optional(
        "how many of the best routes are taken through all stages; else the best and one hardly slower"
    )
    mesh_check: Literal["last", "all"] | None = optional(
        "which stages are certified, their race time confirmed on a second mesh: the last one of a run, or all"
    )
    regularisation: Annotated[float, Ge(0), Le(1)] | None = optional(
        "weight, against seconds, of squared control rates, measured by half of their limits, and of flight upside down"
    )
    mesh: MeshEntry = Field(default=MeshEntry(), description="how finely a flight is cut into intervals")
    solver: SolverEntry = Field(default=SolverEntry(), description="which solvers, and how long they may try")
    certificate: CertificateEntry = Field(
        default=CertificateEntry(), description="limits of the certificate; they can be tightened, not loosened"
    )


def build_settings(entry: SettingsEntry, reporter: Reporter) -> Settings:
    """Return the settings of a run; valid only if nothing was reported."""
    arguments = entry.arguments()
    choices = {"guess": GuessKind, "search": SearchEffort, "mesh_check": MeshCheck}
    return Settings(
        **{name: kind(arguments[name]) for name, kind in choices.items() if name in arguments},
        **{name: arguments[name] for name in ("gap", "alternatives", "regularisation") if name in arguments},
        mesh=MeshSettings(**entry.mesh.arguments()),
        solver=SolverSettings(**entry.solver.arguments()),
        certificate=entry.certificate.build(reporter),
    )


Value = str | int | float | bool
Files = Annotated[list[str], Field(min_length=1, max_length=100_000)]


class BatchEntry(Schema):
    """A whole batch file. Paths are relative to it."""

    what: ClassVar[str] = "a batch"
    schema_: Literal["airrace/batch/1"] = Field(alias="schema", description="the language of this file and its version")
    notes: str = Field(default="", description="whatever a reader should know")
    courses: Files = Field(description="track files, patterns such as `tracks/*.yaml`, or names of shipped courses")
    aircraft: Files | None = optional("aircraft files, each of which flies every course; without them the tracks' own")
    settings: str | None = optional("a settings file")
    set: dict[str, Value] = Field(default_factory=dict[str, Value], description="single values, as `--set` gives them")
    sweep: dict[str, str | list[Value]] = Field(
        default_factory=dict[str, str | list[Value]],
        description="values that are tried in turn, as `--sweep` gives them: a list, or a range `first:last:step`",
    )
    until: str | None = optional("the last stage")
