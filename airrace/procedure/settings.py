"""The settings of a run: its stages, and everything that can change its result besides the course and the aircraft."""

import math
import re
from collections.abc import Sequence
from dataclasses import field
from enum import Enum
from typing import Any, ClassVar, overload

from airrace.extensions import load_extensions
from airrace.records import record

NAME = re.compile(r"[a-z][a-z0-9]*(-[a-z0-9]+)*")
"""The form of a stage's name: lower-case words, joined by hyphens."""


class Stage:
    """A stage; there is one object per name, so stages are compared with `is`.

    `HOMOTOPY` is the assembled guess of the point mass, stored so that an interrupted run resumes behind it; it is
    neither an optimum nor certified. The others are optima, one per fidelity.

    """

    HOMOTOPY: ClassVar["Stage"]
    POINT_MASS: ClassVar["Stage"]
    TRANSFER_FUNCTION: ClassVar["Stage"]
    STATE_SPACE_INVERSION: ClassVar["Stage"]
    STATE_SPACE: ClassVar["Stage"]
    SIX_DOF: ClassVar["Stage"]

    __slots__ = ("_value",)
    _value: str

    def __new__(cls, value: str) -> "Stage":
        """Return the stage of a name.

        Raises:
            ValueError: there is none.
        """
        for stage in STAGES:
            if stage.value == value:
                return stage
        raise ValueError(f"{value!r} is not the name of a stage")

    @classmethod
    def new(cls, value: str, *, after: "Stage") -> "Stage":
        """Declare and return a further stage, solved after another one and before what followed that until now.

        A stage that exists already stays where it is.

        Args:
            value: its name: lower-case words, joined by hyphens.
            after: a stage whose result it can be started from: the point mass or one that comes later.

        Raises:
            ValueError: the name is not of that form, or nothing can be started from `after`.
        """
        if not NAME.fullmatch(value):
            raise ValueError(f"{value!r} is no name for a stage: lower-case words, joined by hyphens")
        if after is cls.HOMOTOPY:
            raise ValueError("a stage is started from an optimum, and the homotopy is none")
        known = next((one for one in _order if one.value == value), None)
        return known or _insert_stage(value, _order.index(after) + 1)

    @property
    def value(self) -> str:
        """The user's name."""
        return self._value

    def __repr__(self) -> str:
        return f"<Stage {self.value}>"

    def __reduce__(self) -> tuple[Any, ...]:  # Any: as the base class has it
        return Stage, (self.value,)


_order: list[Stage] = []


def _insert_stage(value: str, position: int) -> Stage:
    stage = object.__new__(Stage)
    stage._value = value  # pyright: ignore[reportPrivateUsage]  # it is the constructor
    _order.insert(position, stage)
    return stage


class _StageSequence(Sequence[Stage]):
    """All stages in order, those of extensions included."""

    @overload
    def __getitem__(self, index: int) -> Stage: ...

    @overload
    def __getitem__(self, index: slice) -> tuple[Stage, ...]: ...

    def __getitem__(self, index: int | slice) -> Stage | tuple[Stage, ...]:
        load_extensions()
        return tuple(_order)[index]

    def __len__(self) -> int:
        load_extensions()
        return len(_order)


STAGES: Sequence[Stage] = _StageSequence()
"""The stages in their order."""

Stage.HOMOTOPY = _insert_stage("homotopy", 0)
Stage.POINT_MASS = _insert_stage("point-mass", 1)
Stage.TRANSFER_FUNCTION = _insert_stage("transfer-function", 2)
Stage.STATE_SPACE_INVERSION = _insert_stage("state-space-inversion", 3)
Stage.STATE_SPACE = _insert_stage("state-space", 4)
Stage.SIX_DOF = _insert_stage("six-dof", 5)


class GuessKind(Enum):
    """The start of the joint point-mass problem."""

    HOMOTOPY = "homotopy"
    PLAN = "plan"


class SearchEffort(Enum):
    """The effort of the search for the fastest route."""

    OFF = "off"
    QUICK = "quick"
    THOROUGH = "thorough"


class MeshCheck(Enum):
    """The stages whose race time a second mesh confirms.

    The stages that are not are solved on one mesh, and all else is measured of them as well.
    """

    LAST = "last"
    ALL = "all"


@record
class MeshSettings:
    """The settings of the meshes.

    The first mesh has intervals of about `interval` seconds, at least `intervals_min` in a phase. Up to
    `refinements_max` other meshes follow, coarser where nothing happens and finer until the certificate holds.
    """

    interval: float = 0.17
    intervals_min: int = 6
    refinements_max: int = 10


@record
class SolverSettings:
    """The settings of the solvers.

    `primary` is tried first, from every start; then `fallback`, from the same starts. `stall_seconds` is the longest
    time for an iteration, s.
    """

    primary: str = "fatrop"
    fallback: str = "ipopt"
    tolerance: float = 1e-7
    iterations_max: int = 500
    stall_seconds: float = 120.0


LONG_RACE = 120.0
"""The duration from which on the change of a race time may grow with it, s; races of the series take 50 to 80."""


@record
class CertificateLimits:
    """The largest values that a certified result may show; lengths in m, angles in rad, load factors in g.

    `replay` is of each interval, scaled, `replay_gate` of each leg at the gate that it ends in. `hamiltonian` is how
    far the Hamiltonian may be from -1, `race_time` how much the time of a race of up to two minutes may change when all
    intervals are halved, s.
    `variation` is what the controls may be moved on average, as a share of their fastest rate.
    """

    kkt_error: float = 1e-6
    load_factor: float = 0.02
    length: float = 0.1
    angle: float = math.radians(0.2)
    speed: float = 0.1
    gate_length: float = 0.01
    gate_angle: float = math.radians(0.1)
    replay: float = 1e-6
    replay_gate: float = 0.1
    hamiltonian: float = 0.02
    race_time: float = 0.005
    variation: float = 0.5

    def race_time_of(self, duration: float) -> float:
        """Return how much the race time of a race of this duration (s) may change when all intervals are halved, s.

        Beyond two minutes it grows with the duration: every part of a long race is solved as exactly as that of a
        short one, no more.
        """
        return self.race_time * max(1.0, duration / LONG_RACE)


@record
class Settings:
    """The settings of a run.

    `alternatives` is how many of the best routes are taken through all stages, None for the best one and one more if
    that is hardly slower; `regularisation` weighs the integral of squared, scaled control rates against seconds of race
    time; `mesh_check` is which stages of a run are solved on a second mesh as well.
    """

    guess: GuessKind = GuessKind.HOMOTOPY
    search: SearchEffort = SearchEffort.QUICK
    alternatives: int | None = None
    mesh_check: MeshCheck = MeshCheck.LAST
    regularisation: float = 1e-3
    mesh: MeshSettings = field(default_factory=MeshSettings)
    solver: SolverSettings = field(default_factory=SolverSettings)
    certificate: CertificateLimits = field(default_factory=CertificateLimits)
