"""Many optima: one stage under swept values, and what aircraft and air are worth on a course."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from airrace import options
from airrace.api.optimize import RunGiven
from airrace.options import Option
from airrace.procedure.stage import Stage
from airrace.runs.batch import Sweeps, sweep_texts

if TYPE_CHECKING:
    from airrace.runs.batch.fairness import Fairness
    from airrace.runs.batch.sweep import SweepResult


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


def fairness(
    track: Annotated[
        str | Path, Option("The course: a file, or a name that `airrace tracks` lists.", "TRACK", completion="tracks")
    ],
    *,
    aircraft: Annotated[
        Sequence[str | Path],
        Option("An aircraft: a file or a name, e.g. pc9; as often as you like.", "FILE", completion="configs"),
    ] = (),
    winds: Annotated[
        str | None, Option("Winds, e.g. 0,5,10kt@8: from eight directions; by default the course's.", "ROSE")
    ] = None,
    sweep: Annotated[Sweeps, Option("Values of another key of the air; as often as you like.", "KEY=VALUES")] = (),
    flights: Annotated[
        Sequence[str],
        Option("A run or a flight log to normalise; as often as you like.", "FLIGHT", flags=("--flight",)),
    ] = (),
    settings: Annotated[str | Path | None, Option("Settings other than the defaults.", "FILE")] = None,
    set: options.Set = (),
    until: options.Until = None,
    cold: Annotated[bool, Option("Find every optimum from the course alone as well, and take the faster one.")] = False,
    output: Annotated[
        str | Path | None,
        Option("Keep the runs here; a second call takes up what is there.", "DIR", flags=("--output", "-o")),
    ] = None,
    threads: options.Threads = None,
    tell: Callable[[str], None] = lambda _: None,
) -> "Fairness":
    """Tell what aircraft and air are worth on a course: handicaps, spreads, and times as of still standard air.

    Args:
        sweep: keys of the air, such as `environment.temperature_offset_K`, and their values.
        flights: runs and flight logs, `RUN.h5`, `RUN.h5:STAGE` or `LOG.h5`, whose times are normalised.
        set: values of all optima but those of flights, see `optimize`.
        cold: slower, but no route is missed for the start.
        tell: hears of every optimum, in words.

    Raises:
        InputError: the inputs are not valid; it carries all findings.
        UsageError: an argument is out of range, or two aircraft have one name.
        CheckpointError: a flight cannot be read.
        StorageError: the folder cannot be written to.
    """
    from airrace.errors import UsageError
    from airrace.files.inputs import Inputs, load_inputs
    from airrace.runs.batch.fairness import OptimumSolver, airs_of, find_fairness, open_flight
    from airrace.runs.batch.planning import parse_sweeps
    from airrace.runs.batch.record import make_folder
    from airrace.runs.execution_plan import stage_by_name, value_texts
    from airrace.runtime.process import available_cores
    from airrace.runtime.standard_streams import stem_of

    last_stage, overrides = stage_by_name(until), value_texts(set)
    airs = airs_of(winds, parse_sweeps(sweep_texts(sweep)))
    inputs_of: dict[str, Inputs] = {}
    for name in aircraft:
        inputs = load_inputs(track, aircraft=name, settings=settings, overrides=overrides)
        inputs_of[stem_of(Path(name))] = inputs
    if len(inputs_of) < len(aircraft):
        raise UsageError("two aircraft have one name; rename a file")
    if not inputs_of:
        inputs = load_inputs(track, settings=settings, overrides=overrides)
        inputs_of[stem_of(Path(inputs.aircraft.path))] = inputs
    recorded_flights = [open_flight(text) for text in flights]
    folder = None if output is None else Path(output)
    if folder is not None:
        make_folder(folder)
    solver = OptimumSolver(last_stage, folder, threads or available_cores(), cold, tell)
    return find_fairness(stem_of(Path(track)), inputs_of, airs, recorded_flights, solver)
