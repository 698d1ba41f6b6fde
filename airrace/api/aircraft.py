"""Aircraft of one's own: from the figures of a flight manual, and from flight logs."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from airrace import options
from airrace.options import Option

if TYPE_CHECKING:
    from airrace.procedure.result import Progress
    from airrace.runs.aircraft_file import ComparedAircraft
    from airrace.runs.fit import FittedAircraft


def _figure(help: str, *flags: str) -> Option:
    return Option(help, "FIGURE", flags=flags)


def estimate_aircraft(
    name: Annotated[
        str, Option("Name of the new aircraft, of one that exists, or JSBSim's XML.", "NAME", completion="configs")
    ],
    *,
    from_: Annotated[
        str | Path | None, Option("Take what is not given from this aircraft.", "FILE", completion="configs")
    ] = None,
    mass: Annotated[str | None, _figure("Mass that flies, with pilot and fuel, e.g. 730kg or 1610lb.")] = None,
    span: Annotated[str | None, _figure("Wing span, e.g. 7.5m or 24.6ft.")] = None,
    area: Annotated[str | None, _figure("Wing area, e.g. 10.4m2 or 112ft2.")] = None,
    power: Annotated[str | None, _figure("Power of the engine, e.g. 315hp, 235kW or 320PS.")] = None,
    speed_max: Annotated[str | None, _figure("Top speed of level flight at sea level, e.g. 185kt or 343km/h.")] = None,
    stall: Annotated[str | None, _figure("Stall speed without flaps, e.g. 55kt.")] = None,
    roll_rate: Annotated[str | None, _figure("Roll rate of full ailerons, deg/s.")] = None,
    roll_speed: Annotated[str | None, _figure("Speed of that; by default V_A, the stall's times sqrt(n_z).")] = None,
    climb: Annotated[str | None, _figure("Best rate of climb at sea level, e.g. 3200ft/min or 16m/s.")] = None,
    n_z: Annotated[str | None, _figure("Largest load factor, g.")] = None,
    n_z_min: Annotated[str | None, _figure("Least load factor, g; by default in proportion.")] = None,
    speed_limit: Annotated[str | None, _figure("Speed that is never exceeded, V_NE, e.g. 220kt.")] = None,
    turn: Annotated[str | None, _figure("Tightest level turn that is held, g; it is only compared.")] = None,
    manual_mass: Annotated[str | None, _figure("Mass at which the figures hold, if not --mass.")] = None,
    manual_power: Annotated[str | None, _figure("Power at which the figures hold, if not --power.")] = None,
    output: Annotated[
        str | Path | None, options.output("FILE.yaml", "Write the aircraft here; by default NAME.yaml.")
    ] = None,
    force: options.Force = False,
) -> "ComparedAircraft":
    """Estimate an aircraft from its flight manual, and compare it with that.

    Figures have units. What they leave open stays as in the aircraft of --from, and is marked so in the file. Without
    --from an aircraft that exists is compared with what its file gives as `published`. A file `.xml` of JSBSim makes an
    aircraft of its coefficients; limits of speed and load factor are those of --from.

    Raises:
        UsageError: a figure is no measure, or no aircraft has these figures; or the file exists.
        InputError: there is no such aircraft.
        StorageError: the folder does not exist or takes no files.
    """
    figures = dict(locals())
    from airrace.runs.aircraft_file import compare_with_manual

    for name_of_option in ("name", "from_", "output", "force"):
        del figures[name_of_option]
    figure_texts = {key: text for key, text in figures.items() if text is not None}
    return compare_with_manual(name, figure_texts, template=from_, output=output, force=force)


def fit(
    logs: Annotated[
        str | Path | Sequence[str | Path], Option("Logs of one aircraft: CSV, GPX, IGC or ACMI.", "LOG...")
    ],
    track: Annotated[
        options.TrackGiven,
        Option(
            "The course that they pass, with the wind as far as it is known.",
            "TRACK",
            flags=("--course",),
            completion="tracks",
        ),
    ],
    *,
    aircraft: Annotated[
        options.AircraftGiven, Option("Start from this aircraft: a file or a name.", "FILE", completion="configs")
    ],
    output: Annotated[
        str | Path | None,
        replace(options.output("FILE.yaml", "Write the fitted aircraft here."), required=True),
    ] = None,
    mapping: Annotated[str | Path | None, Option("What the columns of CSV files mean.", "FILE.yaml")] = None,
    columns: options.Columns = (),
    set: options.Set = (),
    force: options.Force = False,
    progress: "Progress | None" = None,
) -> "FittedAircraft":
    """Fit drag polar, power and roll rate of an aircraft to logs of races at full power; each log has its own wind.

    The roll rate is found where the roll is recorded. What logs do not show stays as in the aircraft of --aircraft, and
    is marked so in the file. Bias and scatter are measured on the optimum of the fitted aircraft: a minute or two.

    Args:
        set: single values of the course that are otherwise.
        progress: who watches the optimum with which bias and scatter are measured.

    Raises:
        InputError: course, aircraft, mapping or a log are not valid, or the logs tell too little.
        UsageError: no log is given, or the file exists.
        StorageError: the folder does not exist or takes no files.
    """
    from airrace.errors import UsageError
    from airrace.files.inputs.log_columns import read_layout, with_columns
    from airrace.flights.logs.csv_log import ColumnLayout
    from airrace.procedure.result import Silent
    from airrace.runs.aircraft_file import read_aircraft_file
    from airrace.runs.execution_plan import document_or_path, read_inputs, value_texts
    from airrace.runs.fit import fit_logs
    from airrace.runs.output import documents_of, ensure_free, write_text

    paths = [Path(log) for log in ([logs] if isinstance(logs, str | Path) else logs)]
    if not paths:
        raise UsageError("a fit needs a log")
    if any(text.startswith("aircraft.") for text in value_texts(set)):
        raise UsageError("numbers of the aircraft are changed in its file, from which the fit starts")
    target = None if output is None else Path(output)
    source = document_or_path(aircraft)
    assert source is not None  # for an aircraft is given
    if target is not None:
        ensure_free(target, force=force, sources=[*paths, track, source, mapping])
    inputs, template = read_inputs(track, aircraft, set=set), read_aircraft_file(source)
    if target is not None:
        ensure_free(target, force=True, sources=documents_of(inputs))
    layout = with_columns(ColumnLayout() if mapping is None else read_layout(Path(mapping))[0], columns)
    fitted = fit_logs(paths, inputs.race, layout, progress or Silent())
    if target is not None:
        name = Path(source).stem if isinstance(source, str | Path) else inputs.race.aircraft.name
        write_text(target, fitted.file_text(template, name))
    return replace(fitted, path=target)
