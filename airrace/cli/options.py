"""Arguments and options that several commands share."""

from pathlib import Path
from typing import Annotated, Any

import typer

from airrace.cli import completion
from airrace.procedure.settings import MeshCheck


def output_option(metavar: str, help: str) -> Any:  # Any: as of `typer.Option`
    """Return the option that says where a command writes."""
    return typer.Option("--output", "-o", metavar=metavar, help=help)


TrackFile = Annotated[
    Path,
    typer.Argument(
        metavar="TRACK",
        readable=False,
        autocompletion=completion.tracks,
        help="The course: a file, or a name that `airrace tracks` lists.",
    ),
]
RunFile = Annotated[Path, typer.Argument(metavar="RUN.h5", readable=False, help="The checkpoint of a run.")]
FlightNames = Annotated[
    list[str],
    typer.Argument(metavar="FLIGHT...", help="RUN.h5 for its last stage, or RUN.h5:STAGE, e.g. rovinj.h5:point-mass."),
]
StageOfFlights = Annotated[
    str | None,
    typer.Option(
        metavar="STAGE", autocompletion=completion.stages, help="The stage of runs that name none; the last by default."
    ),
]
StageOfRun = Annotated[
    str | None,
    typer.Option(metavar="STAGE", autocompletion=completion.stages, help="Which stage; by default the last one."),
]
AircraftFile = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE",
        readable=False,
        autocompletion=completion.aircraft,
        help="Fly this aircraft instead of the one the track names: a file, edge540 or pc9.",
    ),
]
SettingsFile = Annotated[
    Path | None, typer.Option(metavar="FILE", readable=False, help="Settings other than the defaults.")
]
Overrides = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Change one value, e.g. rules.n_z_max=9; as often as you like."),
]
LastStage = Annotated[
    str | None,
    typer.Option(
        metavar="STAGE", autocompletion=completion.stages, help="Last stage to run; by default the last available one."
    ),
]
MeshChecked = Annotated[
    MeshCheck | None,
    typer.Option(
        "--mesh-check",
        help="Which stages are also solved on a second mesh, which confirms their race time; the settings say last by "
        "default.",
    ),
]
Threads = Annotated[int | None, typer.Option(min=1, metavar="N", help="Threads; by default all cores.")]
Timeout = Annotated[
    float | None,
    typer.Option(
        "--timeout", metavar="SECONDS", help="Stop after this time, with what is finished; `resume` goes on from there."
    ),
]
SigningKey = Annotated[
    Path | None,
    typer.Option(
        "--sign", metavar="KEY", readable=False, help="Sign the file with this private key of Ed25519 (extra: sign)."
    ),
]
TrustedKey = Annotated[
    Path | None,
    typer.Option(
        "--trust",
        metavar="KEY.pub",
        readable=False,
        help="Only take a file that is signed with this public key of Ed25519 (extra: sign).",
    ),
]
Verbose = Annotated[bool, typer.Option("--verbose", "-v", help="Tell on stderr what is read, written and begun.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but what goes wrong.")]
Force = Annotated[bool, typer.Option("--force", "-f", help="Overwrite an existing file.")]
DryRun = Annotated[bool, typer.Option("--dry-run", "-n", help="Only say what would run, and why.")]
