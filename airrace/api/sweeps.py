"""Many optima: one stage under swept values, and what the air of a day costs."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Union

from airrace import options
from airrace.api.optimize import RunGiven
from airrace.flights.safety.disturbances import WIND_DIRECTION_ERROR_DEG, WIND_SPEED_ERROR_KT
from airrace.options import Option
from airrace.procedure.stage import Stage
from airrace.runs.batch import Sweeps, sweep_texts

if TYPE_CHECKING:
    from airrace.runs.batch.handicap import HandicapResult
    from airrace.runs.batch.sweep import SweepResult
    from airrace.runs.run_state import RunState


def sweep(
    run: Annotated[RunGiven, options.RUN_FILE],
    sweep: Annotated[
        Sweeps,
        Option(
            "Values of a key as --set takes it: a list 0,5,10, a range first:last:step, or a list of both; "
            "several multiply.",
            "KEY=VALUES",
            flags=("--sweep",),
        ),
    ],
    *,
    stage: Annotated[str | Stage | None, Option("Which stage.", "STAGE", completion="stages")] = "point-mass",
    set: options.Set = (),
    output: Annotated[
        str | Path | None, options.output("FILE", "Write all combinations, .csv or .parquet (extra: parquet).")
    ] = None,
    threads: options.Threads = None,
    tell: Callable[[int, int], None] | None = None,
) -> "SweepResult":
    """Solve one stage of a run under every combination of values, some a second.

    Each is solved from its neighbour and measured like a stage that is solved on one mesh. Routes stay those of the
    run; `airrace batch` flies every combination from scratch instead.

    Examples:
        >>> result = airrace.sweep(run, {"rules.n_z_max": "9:9.5:0.5"})
        >>> [f"{point.race_time - result.reference:.3f}" for point in result.points]
        ['0.074', '0.028']

    Args:
        sweep: the keys and their values: `{"rules.n_z_max": [9, 10]}`, or `"9:12:0.5"` for a range.
        set: values that are otherwise than in the run, for all combinations, see `optimize`.
        tell: called with how many are solved, and of how many.

    Raises:
        InputError: a sweep is not valid, or a value of one; it carries all findings.
        UsageError: nothing is swept, there are too many combinations, the passings change, settings or a reserve are
            to be others than the run's, or the run has no such optimum.
        SolverCrash: a solver process died.
    """
    from airrace.runs.batch.planning import parse_sweeps
    from airrace.runs.batch.sweep import ensure_sweep_file, solve_combinations
    from airrace.runs.execution_plan import value_texts
    from airrace.runs.run_state import RunState, open_run

    source = run if isinstance(run, RunState) else open_run(Path(run))
    path = None if output is None else Path(output)
    if path is not None:
        ensure_sweep_file(path)
    result = solve_combinations(source, stage, parse_sweeps(sweep_texts(sweep)), value_texts(set), threads, tell)
    if path is not None:
        result.write(path)
    return result


def handicap(
    run: Annotated[
        Union[str, Path, "RunState"],
        Option(
            "A run, from whose optimum all others are solved; or a course, a file or a name, which is solved first.",
            "RUN.h5|TRACK",
            completion="tracks",
        ),
    ],
    *,
    wind: Annotated[
        str | None, Option("The wind, e.g. 240/12: from 240 degrees with 12 kt; by default the course's.", "DEG/KT")
    ] = None,
    qnh: Annotated[float | None, Option("The pressure that an altimeter is set to.", "HPA")] = None,
    temperature: Annotated[float | None, Option("The temperature at the course.", "CELSIUS")] = None,
    wind_speed_error_kt: Annotated[
        float, Option("The error of its speed that 95 % of winds are within.", "KT", flags=("--wind-speed-error",))
    ] = WIND_SPEED_ERROR_KT,
    wind_direction_error_deg: Annotated[
        float,
        Option("The error of its direction that 95 % of winds are within.", "DEG", flags=("--wind-direction-error",)),
    ] = WIND_DIRECTION_ERROR_DEG,
    hours: Annotated[
        str | Path | None,
        Option("The weather of many hours: CSV of hour, from_deg, speed_kt, qnh_hPa, temperature_C.", "FILE"),
    ] = None,
    headings: Annotated[
        str | None, Option("Rotate the course clockwise by these angles, e.g. 0:360:15.", "FIRST:LAST:STEP")
    ] = None,
    aircraft: Annotated[
        Sequence[str | Path],
        Option("Another aircraft to compare, e.g. pc9; as often as you like.", "FILE", completion="configs"),
    ] = (),
    flights: Annotated[
        Sequence[str],
        Option("A run or a flight log to free of its handicap; as often as you like.", "FLIGHT", flags=("--flight",)),
    ] = (),
    stage: Annotated[
        str | Stage | None,
        Option(
            "Which stage; by default the point mass, or the last one of a run that has none.",
            "STAGE",
            completion="stages",
        ),
    ] = None,
    set: options.Set = (),
    output: Annotated[str | Path | None, options.output("FILE", "Write all handicaps as CSV.")] = None,
    force: options.Force = False,
    threads: options.Threads = None,
    tell: Callable[[str], None] = lambda _: None,
) -> "HandicapResult":
    """Tell what the day costs or gives, in seconds, against still standard air at the level of the sea.

    The interval of a handicap follows from the errors of the wind. With --hours and --headings it tells which hour is
    best, and which way the course should lie.

    Args:
        headings: degrees; the course is rotated with all that stands around it.
        aircraft: further ones; each is flown from the optimum of the run first.
        flights: runs and flight logs, `RUN.h5`, `RUN.h5:STAGE` or `LOG.h5`, each in its own air.
        set: values that are otherwise than in the run, see `optimize`; not of flights.
        tell: hears what is solved, in words.

    Raises:
        InputError: the inputs or the hours are not valid; it carries all findings.
        UsageError: an argument is out of range, two aircraft have one name, the run has no such optimum, settings or a
            reserve are to be others than the run's, or the file exists.
        CheckpointError: a file cannot be read.
        SolverCrash: the solver process died.
        StorageError: the system refused to write the file.
    """
    from airrace.files.inputs import load_inputs
    from airrace.files.inputs.weather import read_hours, weather_named
    from airrace.optimal_control.solvers import start_early
    from airrace.runs.batch.handicap import (
        HandicapSolver,
        WindError,
        find_handicaps,
        headings_of,
        plan_course,
        start_overrides,
    )
    from airrace.runs.execution_plan import stage_by_name, value_texts
    from airrace.runs.output import documents_of, ensure_free, write_text
    from airrace.runs.run_state import RunState, open_run
    from airrace.runtime.process import available_cores

    asked_stage, overrides = None if stage is None else stage_by_name(stage), value_texts(set)
    weather = weather_named(wind, qnh, temperature)
    weathers = [weather] if hours is None else read_hours(Path(hours), weather)
    angles = headings_of(headings)
    wind_error = WindError(wind_speed_error_kt, wind_direction_error_deg)
    solver = HandicapSolver(overrides, wind_error, threads or available_cores(), tell)
    start_early()
    if isinstance(run, RunState):
        source = run
    elif Path(run).suffix.lower() == ".h5":
        source = open_run(Path(run))
    else:
        source = plan_course(load_inputs(run, overrides=start_overrides(overrides, weathers)), asked_stage)
    if output is not None:
        inputs = source.inputs if isinstance(source, RunState) else source.run.inputs
        sources = [run, hours, *aircraft, *flights, *documents_of(inputs)]
        ensure_free(Path(output), force=force, sources=sources)
    result = find_handicaps(source, aircraft, weathers, angles, flights, asked_stage, solver)
    if output is not None:
        write_text(Path(output), result.table().csv(".10g"))
    return result
