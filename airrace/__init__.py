"""Minimum-time air races: the fastest flight through a course, certified.

    import airrace

    run = airrace.optimize("rovinj_2014", until="point-mass")
    run.race_time, run.splits, run["point-mass"].to_dataframe(), run.save("rovinj.h5")

The functions are the commands, their keyword arguments the commands' options. The names are looked up when they are
first used, so that `import airrace` (and `airrace --help`) stays quick.
"""

from importlib import import_module

TYPE_CHECKING = False  # as type checkers take it; `typing` would be loaded before anybody listens to Ctrl-C
if TYPE_CHECKING:
    from airrace.aircraft import Aircraft
    from airrace.api.aircraft import estimate_aircraft
    from airrace.api.courses import check, schema, tracks
    from airrace.api.flights import import_log
    from airrace.api.run import Run
    from airrace.api.runs import open, optimize, resume
    from airrace.batch import optimize_many
    from airrace.batch.fairness import fairness
    from airrace.batch.reports import BatchResult
    from airrace.batch.sweep import SweepResult, sweep
    from airrace.environment import Air, Profile, StaticWind, Thermal
    from airrace.errors import AirraceError
    from airrace.inputs import Inputs, load_inputs
    from airrace.optimal_control.certificate import Certificate
    from airrace.procedure.result import Progress, StageResult, Status
    from airrace.procedure.settings import Settings
    from airrace.procedure.stage import Stage
    from airrace.quantities import Interval
    from airrace.race import Race
    from airrace.runs.aircraft import ComparedAircraft
    from airrace.runs.courses import CourseCheck, init
    from airrace.runs.fit import FittedAircraft, fit
    from airrace.runs.log_view import LogView
    from airrace.runs.session import Session
    from airrace.runs.stage_view import StageView
    from airrace.track.course import (
        Course,
        Crowd,
        CrowdShape,
        Direction,
        EndState,
        Origin,
        Passage,
        Roll,
        Rules,
        SafetyLine,
        Turning,
    )
    from airrace.track.gates import Gate, Manoeuvre, Passing, Pylon, Tolerances
    from airrace.track.polygons import Point
    from airrace.trajectory import Trajectory

__all__ = [
    "Air",
    "Aircraft",
    "AirraceError",
    "BatchResult",
    "Certificate",
    "ComparedAircraft",
    "Course",
    "CourseCheck",
    "Crowd",
    "CrowdShape",
    "Direction",
    "EndState",
    "FittedAircraft",
    "Gate",
    "Inputs",
    "Interval",
    "LogView",
    "Manoeuvre",
    "Origin",
    "Passage",
    "Passing",
    "Point",
    "Profile",
    "Progress",
    "Pylon",
    "Race",
    "Roll",
    "Rules",
    "Run",
    "SafetyLine",
    "Session",
    "Settings",
    "Stage",
    "StageResult",
    "StageView",
    "StaticWind",
    "Status",
    "SweepResult",
    "Thermal",
    "Tolerances",
    "Trajectory",
    "Turning",
    "check",
    "estimate_aircraft",
    "fairness",
    "fit",
    "import_log",
    "init",
    "load_inputs",
    "open",
    "optimize",
    "optimize_many",
    "resume",
    "schema",
    "sweep",
    "tracks",
]

_HOMES = {
    "airrace.aircraft": ("Aircraft",),
    "airrace.inputs": ("Inputs", "load_inputs"),
    "airrace.batch": ("optimize_many",),
    "airrace.batch.fairness": ("fairness",),
    "airrace.batch.reports": ("BatchResult",),
    "airrace.batch.sweep": ("SweepResult", "sweep"),
    "airrace.environment": ("Air", "Profile", "StaticWind", "Thermal"),
    "airrace.errors": ("AirraceError",),
    "airrace.optimal_control.certificate": ("Certificate",),
    "airrace.race": ("Race",),
    "airrace.procedure.result": ("Progress", "StageResult", "Status"),
    "airrace.procedure.settings": ("Settings",),
    "airrace.procedure.stage": ("Stage",),
    "airrace.quantities": ("Interval",),
    "airrace.runs.aircraft": ("ComparedAircraft",),
    "airrace.runs.fit": ("FittedAircraft", "fit"),
    "airrace.runs.courses": ("CourseCheck", "init"),
    "airrace.api.aircraft": ("estimate_aircraft",),
    "airrace.api.courses": ("check", "schema", "tracks"),
    "airrace.api.flights": ("import_log",),
    "airrace.api.run": ("Run",),
    "airrace.api.runs": ("open", "optimize", "resume"),
    "airrace.runs.log_view": ("LogView",),
    "airrace.runs.session": ("Session",),
    "airrace.runs.stage_view": ("StageView",),
    "airrace.track.course": (
        "Course",
        "Crowd",
        "CrowdShape",
        "Direction",
        "EndState",
        "Origin",
        "Passage",
        "Roll",
        "Rules",
        "SafetyLine",
        "Turning",
    ),
    "airrace.track.gates": ("Gate", "Manoeuvre", "Passing", "Pylon", "Tolerances"),
    "airrace.track.polygons": ("Point",),
    "airrace.trajectory": ("Trajectory",),
}
_HOME = {name: home for home, names in _HOMES.items() for name in names}


def __getattr__(name: str) -> object:
    if name not in _HOME:
        raise AttributeError(f"module 'airrace' has no attribute {name!r}")
    return getattr(import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)
