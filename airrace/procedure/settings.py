"""The settings of a run: everything that can change its result besides the course and the aircraft."""

import math
from dataclasses import dataclass, field
from enum import Enum

from airrace.optimal_control.solvers import INTERIOR_POINT, IPOPT


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

    Of the others, the point mass is solved on one mesh, and all else is measured of it as well; those above it are
    solved on one mesh as closely as the next stage needs.
    """

    LAST = "last"
    ALL = "all"


@dataclass(frozen=True)
class MeshSettings:
    """The settings of the meshes.

    The first mesh has intervals of about `interval` seconds, at least `intervals_min` in a phase. Up to
    `refinements_max` other meshes follow, coarser where nothing happens and finer until the certificate holds.
    """

    interval: float = 0.17
    intervals_min: int = 6
    refinements_max: int = 10


@dataclass(frozen=True)
class SolverSettings:
    """The settings of the solvers.

    `primary` is tried first, from every start; then `fallback`, from the same starts. `stall_seconds` is the longest
    time for an iteration, s.
    """

    primary: str = INTERIOR_POINT
    fallback: str = IPOPT
    tolerance: float = 1e-7
    iterations_max: int = 500
    stall_seconds: float = 120.0


LONG_RACE = 120.0
"""The duration from which on the change of a race time may grow with it, s; races of the series take 50 to 80."""


@dataclass(frozen=True)
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

    def change_of(self, duration: float) -> float:
        """Return how much the race time of a race of this duration (s) may change when all intervals are halved, s.

        Beyond two minutes it grows with the duration: every part of a long race is solved as exactly as that of a
        short one, no more.
        """
        return self.race_time * max(1.0, duration / LONG_RACE)


@dataclass(frozen=True)
class Settings:
    """The settings of a run.

    `gap` is the share of the race time within which a thorough search seeks a lower bound of it;
    `alternatives` is how many of the best routes are taken through all stages, None for the best one and one more if
    that is hardly slower; `regularisation` weighs the integrals of squared, scaled control rates and of flight upside
    down against seconds of race time; `mesh_check` is which stages of a run are solved on a second mesh as well.
    """

    guess: GuessKind = GuessKind.HOMOTOPY
    search: SearchEffort = SearchEffort.QUICK
    gap: float = 0.01
    alternatives: int | None = None
    mesh_check: MeshCheck = MeshCheck.LAST
    regularisation: float = 1e-3
    mesh: MeshSettings = field(default_factory=MeshSettings)
    solver: SolverSettings = field(default_factory=SolverSettings)
    certificate: CertificateLimits = field(default_factory=CertificateLimits)
