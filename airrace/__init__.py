"""Minimum-time air race trajectories, flyable by construction. This is the public API; nothing else happens here.

The names are looked up when they are first used, so that `import airrace` (and `airrace --help`) stays quick.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from airrace.aircraft.aircraft import Aircraft as Aircraft
    from airrace.checkpoint import Checkpoint as Checkpoint
    from airrace.checkpoint import read_checkpoint as read_checkpoint
    from airrace.checkpoint import write_checkpoint as write_checkpoint
    from airrace.documents import Inputs as Inputs
    from airrace.documents import load_inputs as load_inputs
    from airrace.environment.air import Air as Air
    from airrace.errors import AirraceError as AirraceError
    from airrace.optimal_control.certificate import Certificate as Certificate
    from airrace.planning.race import Race as Race
    from airrace.procedure.result import StageResult as StageResult
    from airrace.procedure.run import optimise as optimise
    from airrace.procedure.run import recertify as recertify
    from airrace.procedure.settings import Settings as Settings
    from airrace.procedure.stage import Stage as Stage
    from airrace.track.course import Course as Course
    from airrace.trajectory import Trajectory as Trajectory

_HOMES = {
    "Air": "airrace.environment.air",
    "Aircraft": "airrace.aircraft.aircraft",
    "AirraceError": "airrace.errors",
    "Certificate": "airrace.optimal_control.certificate",
    "Checkpoint": "airrace.checkpoint",
    "Course": "airrace.track.course",
    "Inputs": "airrace.documents",
    "Race": "airrace.planning.race",
    "Settings": "airrace.procedure.settings",
    "Stage": "airrace.procedure.stage",
    "StageResult": "airrace.procedure.result",
    "Trajectory": "airrace.trajectory",
    "load_inputs": "airrace.documents",
    "optimise": "airrace.procedure.run",
    "read_checkpoint": "airrace.checkpoint",
    "recertify": "airrace.procedure.run",
    "write_checkpoint": "airrace.checkpoint",
}


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module 'airrace' has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted(_HOMES)
