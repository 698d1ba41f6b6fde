"""Arguments and options that commands share, their completion in the shell, and their environment variables."""

import os
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperCommand

from airrace.procedure.settings import MeshCheck
from airrace.procedure.stage import STAGES
from airrace.resources import shipped_folder


class Command(TyperCommand):
    """A command whose option `--dry-run`, say, is also read from `AIRRACE_COMMAND_DRY_RUN`."""

    # Any: contexts and parameters belong to click, whose place depends on typer's version.
    def make_context(self, info_name: str | None, args: list[str], parent: Any = None, **extra: Any) -> Any:
        words = [info_name or ""]
        group = parent
        while group is not None and group.parent is not None:  # up to the program's own
            words.insert(0, group.info_name)
            group = group.parent
        for parameter in self.params:
            one: Any = parameter
            option = max(one.opts, key=len)
            if option.startswith("--") and option != "--help":
                one.envvar = "_".join(["AIRRACE", *words, option[2:]]).replace("-", "_").upper()
                one.show_envvar = False
        return super().make_context(info_name, args, parent, **extra)


def complete_track(incomplete: str) -> list[str]:
    """Return the courses that come along, track files and folders whose names begin like this."""
    return _complete("tracks", incomplete)


def complete_aircraft(incomplete: str) -> list[str]:
    """Return the aircraft that come along, files and folders whose names begin like this."""
    return _complete("configs", incomplete)


def complete_stage(incomplete: str) -> list[str]:
    """Return the stages whose names begin like this, those of extensions among them."""
    return [stage.value for stage in STAGES if stage.value.startswith(incomplete)]


def _complete(shipped: str, incomplete: str) -> list[str]:
    names = [name for file in shipped_folder(shipped).glob("*.yaml") if (name := file.stem).startswith(incomplete)]
    folder, begin = os.path.split(incomplete)
    typed = incomplete.removesuffix(begin)
    try:
        entries = sorted(Path(folder or ".").iterdir())
    except OSError:
        entries = []
    return sorted(names) + [
        f"{typed}{entry.name}{os.sep if entry.is_dir() else ''}"
        for entry in entries
        if entry.name.startswith(begin) and not entry.name.startswith(".")
        if entry.is_dir() or entry.suffix == ".yaml"
    ]


# Any: as of `typer.Option`, here and below.
def file_option(metavar: str, help: str, *names: str, complete: Callable[[str], list[str]] | None = None) -> Any:
    """Return an option that names a file to be read; whether it can be read is found out by who reads it."""
    return typer.Option(*names, metavar=metavar, readable=False, autocompletion=complete, help=help)


def output_option(metavar: str, help: str) -> Any:
    """Return the option that says where a command writes."""
    return typer.Option("--output", "-o", metavar=metavar, help=help)


def stage_option(help: str, *names: str) -> Any:
    """Return an option that names a stage."""
    return typer.Option(*names, metavar="STAGE", autocompletion=complete_stage, help=help)


def track_option(help: str) -> Any:
    """Return an option that names a course."""
    return file_option("TRACK", help, complete=complete_track)


# Arguments.
TrackFile = Annotated[
    Path,
    typer.Argument(
        metavar="TRACK",
        readable=False,
        autocompletion=complete_track,
        help="The course: a file, or a name that `airrace tracks` lists.",
    ),
]
RunFile = Annotated[Path, typer.Argument(metavar="RUN.h5", readable=False, help="The checkpoint of a run.")]
AnyFlight = Annotated[
    str, typer.Argument(metavar="FLIGHT", help="RUN.h5 for its last stage, or RUN.h5:STAGE, or a flight log.")
]
FlightNames = Annotated[
    list[str],
    typer.Argument(metavar="FLIGHT...", help="RUN.h5 for its last stage, or RUN.h5:STAGE, e.g. rovinj.h5:point-mass."),
]

# The flight.
AircraftFile = Annotated[
    Path | None,
    file_option(
        "FILE",
        "Fly this aircraft instead of the one the track names: a file, or a name that `airrace tracks` lists.",
        complete=complete_aircraft,
    ),
]
SettingsFile = Annotated[Path | None, file_option("FILE", "Settings other than the defaults.")]
Overrides = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Change one value, e.g. rules.n_z_max=9; as often as you like."),
]
LastStage = Annotated[str | None, stage_option("Last stage to run; by default the last available one.")]
StageOfFlights = Annotated[str | None, stage_option("The stage of runs that name none; the last by default.")]
StageOfRun = Annotated[str | None, stage_option("Which stage; by default the last one.")]
MeshChecked = Annotated[
    MeshCheck | None,
    typer.Option(
        "--mesh-check",
        help="Which stages are certified, their race time confirmed on a second mesh; the settings say last by "
        "default. Those before it are then solved as closely as the next one needs.",
    ),
]
Threads = Annotated[int | None, typer.Option(min=1, metavar="N", help="Threads; by default all cores.")]
Timeout = Annotated[
    float | None,
    typer.Option(metavar="SECONDS", help="Stop after this time, with what is finished; `resume` goes on from there."),
]

# Flight logs.
CsvColumns = Annotated[
    list[str] | None,
    typer.Option(metavar="NAME=HEADER", help="One column, e.g. 'altitude=GPS alt [ft]'; as often as you like."),
]

# What is written, and how.
NoVerify = Annotated[
    bool, typer.Option("--no-verify", help="Measure no stage again, which takes a second or more; it says so.")
]
ShowStages = Annotated[bool, typer.Option("--stages", help="Also list the stages with their race times and costs.")]
ShowRoutes = Annotated[bool, typer.Option("--routes", help="Also list the routes that were tried.")]
ShowCertificate = Annotated[
    bool, typer.Option("--certificate", help="Also list every item of the certificate, and what is claimed.")
]
ShowAll = Annotated[bool, typer.Option("--all", help="Show all there is, of every stage.")]
Verbose = Annotated[bool, typer.Option("--verbose", "-v", help="Tell on stderr what is read, written and begun.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but what goes wrong.")]
Force = Annotated[bool, typer.Option("--force", "-f", help="Overwrite an existing file.")]
DryRun = Annotated[bool, typer.Option("--dry-run", "-n", help="Only say what would run, and why.")]
