"""Commands around an aircraft: `aircraft`, from the figures of its flight manual, and `fit`, from flight logs."""

from pathlib import Path
from typing import Annotated, Any

import typer

from airrace.cli.answer import answer_with_files, answering, ensure_room, render
from airrace.cli.options import (
    AsJson,
    CsvColumns,
    Force,
    Overrides,
    Quiet,
    Verbose,
    complete_aircraft,
    file_option,
    output_option,
    track_option,
)
from airrace.standard_streams import STANDARD


def _figure(help: str) -> Any:  # Any: as of `typer.Option`
    return typer.Option(metavar="FIGURE", help=help)


def aircraft(
    name: Annotated[
        str,
        typer.Argument(
            metavar="NAME", autocompletion=complete_aircraft, help="Name of the new aircraft, or of one that exists."
        ),
    ],
    from_: Annotated[
        Path | None,
        file_option("FILE", "Take what is not given from this aircraft.", "--from", complete=complete_aircraft),
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
    output: Annotated[Path | None, output_option("FILE.yaml", "Write the aircraft here; by default NAME.yaml.")] = None,
    force: Force = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Estimate an aircraft from its flight manual, and compare it with that.

    Figures have units. What they leave open stays as in the aircraft of --from, and is marked so in the file. Without
    --from an aircraft that exists is compared with what its file gives as `published`.
    """
    arguments = dict(locals())
    with answering(as_json=as_json, verbose=verbose) as answer:
        from airrace.runs.aircraft import MEASURES, estimate_aircraft

        ensure_room(output, as_json=as_json)
        figures = {key: arguments[key] for key in MEASURES}
        compared = estimate_aircraft(name, from_=from_, output=output, force=force, **figures)
        answer.fields.update(name=compared.aircraft.name, compared=compared.table.objects())
        if compared.path is not None:
            remark = f"; fly it with `airrace optimize rovinj_2014 --aircraft {compared.path}`"
            answer_with_files(answer, [compared.path], quiet=quiet, remark=remark)
        if compared.path != STANDARD and not quiet:
            answer.texts.append(render(compared.table))


def fit(
    logs: Annotated[
        list[Path],
        typer.Argument(metavar="LOG...", readable=False, help="Logs of one aircraft: CSV, GPX, IGC or ACMI."),
    ],
    course: Annotated[Path, track_option("The course that they pass, with the wind as far as it is known.")],
    aircraft: Annotated[
        Path,
        file_option("FILE", "Start from this aircraft: a file or a name.", "--aircraft", complete=complete_aircraft),
    ],
    output: Annotated[Path, output_option("FILE.yaml", "Write the fitted aircraft here.")],
    mapping: Annotated[Path | None, file_option("FILE.yaml", "What the columns of CSV files mean.")] = None,
    column: CsvColumns = None,
    overrides: Overrides = None,
    force: Force = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Fit drag polar, power and roll rate of an aircraft to logs of races at full power; each log has its own wind.

    The roll rate is found where the roll is recorded. What logs do not show stays as in the aircraft of --aircraft, and
    is marked so in the file. Bias and scatter are measured on the optimum of the fitted aircraft: a minute or two.
    """
    with answering(as_json=as_json, verbose=verbose) as answer:
        from airrace.procedure.stage import STAGES
        from airrace.runs.fit import fit as fit_aircraft
        from airrace.standard_streams import stem_of
        from airrace.views.progress_view import watching

        ensure_room(output, as_json=as_json)
        with watching(stem_of(course), STAGES, quiet=quiet) as progress:
            fitted = fit_aircraft(
                logs,
                course,
                aircraft=aircraft,
                output=output,
                force=force,
                set=overrides or (),
                mapping=mapping,
                columns=column or (),
                progress=progress,
            )
        answer.fields.update(
            name=fitted.aircraft.name,
            fitted=fitted.table.objects(),
            correlations=fitted.correlations.tolist(),
            winds_m_s=fitted.estimate.winds.tolist(),
            bias=fitted.bias.tolist(),
        )
        answer_with_files(answer, [output], quiet=quiet)
        if output != STANDARD and not quiet:
            answer.texts.append(render(fitted.table))
