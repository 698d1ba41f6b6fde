"""The options of the commands, each declared once: functions in Python and the command line are made of the same ones.

A public function is annotated with them, `force: options.Force = False`; the command line reads its signature. What is
positional in Python is an argument on the command line, what is keyword-only an option `--keyword`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, Union

from airrace.procedure.settings import GuessKind, MeshCheck, SearchEffort
from airrace.procedure.stage import Stage as StageName

if TYPE_CHECKING:
    from airrace.model.aircraft import Aircraft as AircraftObject
    from airrace.model.track.course import Course
    from airrace.race import Race


@dataclass(frozen=True)
class Option:
    """What is said of an argument or option, besides its name, type and default.

    Attributes:
        help: a sentence or two.
        metavar: what stands for the value in the help: its unit, or a kind of file; None for what its type says.
        flags: the words of the command line; empty for `--` and the name of the parameter.
        min, max: the least and the largest number.
        choices: the only texts; empty where its type says which.
        completion: the names that a shell offers besides files.
        written: whether it names a file that the command writes.
        required: whether the command line needs it though Python does not.
        optional: whether any number of arguments may be none, though they are the first ones.
    """

    help: str
    metavar: str | None = None
    flags: tuple[str, ...] = ()
    min: float | None = None
    max: float | None = None
    choices: tuple[str, ...] = ()
    completion: Literal["", "tracks", "configs", "stages"] = ""
    written: bool = False
    required: bool = False
    optional: bool = False


# What a course, an aircraft, settings and values may be given as.
TrackGiven = Union[str, Path, "Course", "Race"]
"""A course by name, its file, or an object: a course in calm standard air, or a race with aircraft and air."""
AircraftGiven = Union[str, Path, "AircraftObject"]
"""An aircraft by name, its file, or an object."""
SettingsGiven = str | Path
"""A settings file, by its path."""
Values = Mapping[str, str | int | float | bool] | Sequence[str]
"""Single values by their keys, `{"rules.n_z_max": 9}`, or texts, `["rules.n_z_max=9"]`."""

# The flight.
Track = Annotated[
    TrackGiven, Option("The course: a file, or a name that `airrace tracks` lists.", "TRACK", completion="tracks")
]
OtherTrack = Annotated[
    TrackGiven | None,
    Option("Fly this track instead of the stored one: a file or a name.", "TRACK", completion="tracks"),
]
Aircraft = Annotated[
    AircraftGiven | None,
    Option(
        "Fly this aircraft instead of the one the track names: a file, or a name that `airrace tracks` lists.",
        "FILE",
        completion="configs",
    ),
]
Settings = Annotated[SettingsGiven | None, Option("Settings other than the defaults.", "FILE")]
Set = Annotated[Values, Option("Change one value, e.g. rules.n_z_max=9; as often as you like.", "KEY=VALUE")]
Guess = Annotated[
    str | GuessKind | None, Option("Where the point mass starts from; the settings say homotopy by default.")
]
Search = Annotated[
    str | SearchEffort | None, Option("How much is tried to find the fastest route; the settings say quick by default.")
]
Gap = Annotated[
    float | None,
    Option(
        "Search thoroughly until any flight is faster by at most this share of the race time, as far as windows "
        "between gates tell; the settings say 0.01 by default.",
        "SHARE",
        min=0,
        max=1,
    ),
]
Alternatives = Annotated[
    int | None,
    Option(
        "Take the K best routes through all stages; by default the best, and another that is hardly slower.",
        "K",
        min=1,
        max=20,
    ),
]
MeshChecked = Annotated[
    str | MeshCheck | None,
    Option(
        "Which stages are certified, their race time confirmed on a second mesh; the settings say last by "
        "default. Those before it are then solved as closely as the next one needs."
    ),
]
Reserve = Annotated[
    float | None,
    Option("Keep margins so that a race in disturbances breaks no limit with this probability, e.g. 0.9.", "P"),
]

# Stages.
_STAGE = str | StageName | None
Until = Annotated[_STAGE, Option("Last stage to run; by default the last available one.", "STAGE", completion="stages")]
FromStage = Annotated[_STAGE, Option("Compute this stage and all after it again.", "STAGE", completion="stages")]
Stage = Annotated[_STAGE, Option("Which stage; by default the last one.", "STAGE", completion="stages")]
StageOfFlights = Annotated[
    _STAGE, Option("The stage of runs that name none; the last by default.", "STAGE", completion="stages")
]


def stage_text(stage: str | StageName | None) -> str | None:
    """Return the name of a stage that is given by it or as an object."""
    return stage.value if isinstance(stage, StageName) else stage


# Files of runs and flights.
RUN_FILE = Option("The checkpoint of a run.", "RUN.h5")
NoVerify = Annotated[bool, Option("Measure no stage again, which takes a second or more; it says so.")]
Columns = Annotated[
    Sequence[str],
    Option("One column, e.g. 'altitude=GPS alt [ft]'; as often as you like.", "NAME=HEADER", flags=("--column",)),
]
Origin = Annotated[str | None, Option("Where the course lies: degrees, metres above the sea.", "LAT,LON,ELEV")]

# The run, and what is written.
Force = Annotated[bool, Option("Overwrite an existing file.", flags=("--force", "-f"))]
DryRun = Annotated[bool, Option("Only say what would run, and why.", flags=("--dry-run", "-n"))]
Threads = Annotated[int | None, Option("Threads; by default all cores.", "N", min=1)]
Timeout = Annotated[
    float | None, Option("Stop after this time, with what is finished; `resume` goes on from there.", "SECONDS")
]


def output(metavar: str, help: str) -> Option:
    """Return the option that says where a command writes."""
    return Option(help, metavar, flags=("--output", "-o"), written=True)
