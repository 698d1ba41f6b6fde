"""The commands as functions, for Python and notebooks: their options are the keyword arguments.

Nothing is printed unless it is asked for, and nothing is written but the files that are named.
"""

import logging
from collections.abc import Generator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

from airrace.aircraft.aircraft import Aircraft
from airrace.environment.air import Air
from airrace.errors import UsageError
from airrace.inputs import Document, load_inputs
from airrace.inputs.batch import set_texts
from airrace.inputs.objects import CourseAndAir, document_of_objects
from airrace.planning.race import Race
from airrace.procedure.progress import Progress, Silent
from airrace.procedure.result import Stage
from airrace.procedure.settings import GuessKind, MeshCheck, SearchEffort
from airrace.process import available_cores
from airrace.runs.courses import CourseCheck, ShippedTrack, catalogue, check_course
from airrace.runs.execute import execute
from airrace.runs.log_view import LogView, fly_log_through
from airrace.runs.output import ensure_free
from airrace.runs.plan import (
    Changes,
    ExecutionPlan,
    open_source_run,
    plan_changed_run,
    plan_new_run,
    plan_resumed_run,
    settings_texts,
)
from airrace.runs.run import Run, open_run
from airrace.track.course import Course
from airrace.views.progress_view import watching

TrackGiven = str | Path | Course | Race
"""A course by name, its file, or an object: a course in calm standard air, or a race with aircraft and air."""
AircraftGiven = str | Path | Aircraft
"""An aircraft by name, its file, or an object."""
SettingsGiven = str | Path
"""A settings file, by its path."""
Values = Mapping[str, str | int | float | bool] | Sequence[str]
"""Single values by their keys, or texts `key=value`."""


def document_or_path(given: TrackGiven | AircraftGiven | None) -> str | Path | Document | None:
    """Return a name or a path as it is, and an object as the document that holds it."""
    match given:
        case Race(course, _, air):
            return document_of_objects(CourseAndAir(course, air), _file_name(course.name))
        case Course():
            still = Air(elevation=given.origin.elevation)
            return document_of_objects(CourseAndAir(given, still), _file_name(given.name))
        case Aircraft():
            return document_of_objects(given, _file_name(given.name))
        case _:
            return given


def aircraft_of(track: TrackGiven | None, aircraft: AircraftGiven | None) -> AircraftGiven | None:
    """Return the aircraft that is asked for: the one that is named, else that of a race."""
    return track.aircraft if aircraft is None and isinstance(track, Race) else aircraft


def value_texts(values: Values) -> list[str]:
    """Return values as `key=value` texts, as `--set` takes them."""
    return set_texts(values) if isinstance(values, Mapping) else [values] if isinstance(values, str) else list(values)


def stage_name(stage: str | Stage | None) -> str | None:
    """Return the name of a stage."""
    return stage.value if isinstance(stage, Stage) else stage


def _file_name(name: str) -> str:
    """Return a name as a file could bear it: runs are called after it."""
    return "_".join("".join(letter if letter.isalnum() else " " for letter in name).lower().split()) or "course"


# Without a handler Python itself prints the warnings of a library.
logging.getLogger("airrace").addHandler(logging.NullHandler())


def optimize(
    track: TrackGiven,
    *,
    aircraft: AircraftGiven | None = None,
    settings: SettingsGiven | None = None,
    guess: str | GuessKind | None = None,
    search: str | SearchEffort | None = None,
    alternatives: int | None = None,
    mesh_check: str | MeshCheck | None = None,
    until: str | Stage | None = None,
    output: str | Path | None = None,
    force: bool = False,
    start: Run | str | Path | None = None,
    set: Values = (),
    threads: int | None = None,
    timeout: float | None = None,
    progress: bool | Progress = False,
) -> Run:
    """Fly a course as fast as can be, stage by stage; the last one is certified.

    Examples:
        >>> run = airrace.optimize("half_cuban_eight", until="point-mass", search="off")
        >>> print(f"{run.race_time:.3f} s, certified: {run.certified}")
        8.634 s, certified: True

    Args:
        track: a course that comes along, by name (see `airrace.tracks`); a file; or a `Course` or a `Race` that was
            built in Python.
        aircraft: another aircraft than the one that the track names: `edge540` or `pc9`, a file, or an `Aircraft`.
            A `Course` names none, so that one must be given.
        settings: a settings file; None for the defaults.
        guess: where the point mass starts from, `homotopy` or `plan`; None for what the settings say.
        search: how much is tried to find the fastest route: `off`, `quick` or `thorough`; None likewise.
        alternatives: how many of the best routes are taken through all stages; None likewise.
        mesh_check: which stages have their race time confirmed on a second mesh, `last` or `all`; None likewise. The
            others are solved on one mesh, and all but their race time is certified.
        until: the last stage, e.g. `point-mass`; None for the last one, `six-dof`.
        output: a file that is renewed after every stage, so that nothing is lost by an interruption; None for none.
        force: whether a file that exists may be overwritten.
        start: another run, or its file, to start from.
        set: single values by their keys, e.g. `{"rules.n_z_max": 9}`; or texts, e.g. `["rules.n_z_max=9"]`.
        threads: threads that evaluate derivatives; None for all cores. Results do not depend on it.
        timeout: the longest wall time, s; None for none. What is finished by then is in `output`.
        progress: whether a view of the run under way is shown on stderr; or who watches.

    Returns:
        The run. A stage that ends without a certified optimum is the last one, and no error: `Run.certified` tells, and
        `Run.message` says why.

    Raises:
        InputError: track, aircraft, settings or values are not valid; it carries all findings.
        UsageError: no such stage, a file that exists, or a run that cannot be started from.
        OutOfTime: the run is not finished within `timeout`.
        SolverCrash: the solver process died.
        StorageError: the system refused to write the file.
    """
    path = None if output is None else Path(output)
    if path is not None:
        ensure_free(path, force=force)
    aircraft = aircraft_of(track, aircraft)
    named = document_or_path(track)
    if named is None:
        raise UsageError("a course is needed: a name, a file or an object")
    plan = plan_new_run(
        named,
        aircraft=document_or_path(aircraft),
        settings=settings,
        overrides=[
            *value_texts(set),
            *settings_texts(guess=guess, search=search, alternatives=alternatives, mesh_check=mesh_check),
        ],
        until=stage_name(until),
        path=path,
        start=start,
    )
    return _fly(plan, threads, timeout, progress)


def resume(
    run: Run | str | Path,
    *,
    until: str | Stage | None = None,
    from_: str | Stage | None = None,
    mesh_check: str | MeshCheck | None = None,
    set: Values = (),
    track: TrackGiven | None = None,
    aircraft: AircraftGiven | None = None,
    settings: SettingsGiven | None = None,
    output: str | Path | None = None,
    force: bool = False,
    threads: int | None = None,
    timeout: float | None = None,
    progress: bool | Progress = False,
) -> Run:
    """Continue a run, or fly it again with something changed.

    Without changes it goes on after the last stage that still stands, in the file of the run if it has one. With `set`,
    `track`, `aircraft` or `settings` the changed run is a new one, started from the highest stage of this run that
    holds; this run stays as it is.

    Examples:
        >>> windy = airrace.resume(run, set={"environment.wind.from_deg": 90, "environment.wind.speed_kt": 10})
        >>> print(f"{windy.race_time - run.race_time:+.3f} s")
        -0.052 s

    Args:
        run: a run, or its file.
        until: the last stage; None for the last one there is, of a changed run for the last one of this run.
        from_: a stage that is computed again although it still stands, and all after it.
        mesh_check: which stages have a mesh check from now on, `last` or `all`; `all` completes that of those solved
            on one mesh. None for what the run was asked for.
        set: single values that are changed, by their keys, e.g. `{"rules.n_z_max": 9}`.
        track, aircraft, settings: what is flown instead: a name, a file or, but for settings, an object.
        output: the file to be written; None for the file of the run, of a changed run for none.
        force: whether a file that exists may be overwritten.
        threads: threads that evaluate derivatives; None for all cores.
        timeout: the longest wall time, s; None for none.
        progress: whether a view of the run under way is shown on stderr; or who watches.

    Returns:
        The run with all its stages.

    Raises:
        CheckpointError: the file cannot be read.
        InputError: the changed inputs are not valid.
        UsageError: no such stage, a file that exists, or nothing to start from.
        OutOfTime: the run is not finished within `timeout`.
        SolverCrash: the solver process died.
        StorageError: the system refused to write the file.
    """
    changes = Changes(
        document_or_path(track), document_or_path(aircraft_of(track, aircraft)), settings, value_texts(set)
    )

    path = None if output is None else Path(output)
    if path is not None:
        ensure_free(path, force=force)
    if not changes:
        before = run if isinstance(run, Run) else open_run(Path(run))
        before = before if path is None else before.moved(path)
        again = stage_name(from_)
        return _fly(
            plan_resumed_run(before, until=stage_name(until), from_stage=again, mesh_check=mesh_check),
            threads,
            timeout,
            progress,
        )
    changes = changes.with_overrides(settings_texts(mesh_check=mesh_check))
    if from_ is not None:
        raise UsageError("`from_` goes on in the same run; a changed run starts from the highest stage up to `until`")
    before = run if isinstance(run, Run) else open_source_run(Path(run))
    return _fly(plan_changed_run(before, changes, until=stage_name(until), out=path), threads, timeout, progress)


def open(path: str | Path) -> Run:
    """Open the run in a file that `airrace optimize` or `Run.save` has written.

    Args:
        path: the path of the file.

    Raises:
        CheckpointError: there is no such file, or it is not a whole, undamaged checkpoint.
        InputError: this version of airrace no longer accepts what the run was given.
    """
    return open_run(Path(path))


def check(
    track: TrackGiven,
    *,
    aircraft: AircraftGiven | None = None,
    settings: SettingsGiven | None = None,
    set: Values = (),
) -> CourseCheck:
    """Read a course, review it as a race director would, and show it; nothing is flown.

    Examples:
        >>> airrace.check("rovinj_2014")
        <CourseCheck Rovinj 2014: 17 passages, 0 warnings>

    Args:
        track: a course that comes along, by name; a file; or a `Course` or a `Race` that was built in Python.
        aircraft: another aircraft than the one that the track names, likewise.
        settings: a settings file; None for the defaults.
        set: single values by their keys, e.g. `{"rules.n_z_max": 9}`.

    Returns:
        Course, aircraft and air, with the warnings of the review. A notebook shows the course from above.

    Raises:
        InputError: the inputs are not valid; it carries all findings.
        UsageError: no course is given.
    """
    named = document_or_path(track)
    if named is None:
        raise UsageError("a course is needed: a name, a file or an object")
    flown_by = document_or_path(aircraft_of(track, aircraft))
    return check_course(named, aircraft=flown_by, settings=settings, overrides=value_texts(set))


def tracks() -> tuple[ShippedTrack, ...]:
    """Return the courses that come along; their names stand for files everywhere.

    Examples:
        >>> [track.name for track in airrace.tracks()][:3]
        ['abu_dhabi_2016', 'air_race_x_2024', 'chiba_2015']
    """
    return catalogue().tracks


def _fly(plan: ExecutionPlan, threads: int | None, timeout: float | None, progress: bool | Progress) -> Run:
    """Fly all stages of a plan."""
    with _watched(plan, progress) as watcher:
        steps = list(execute(plan, threads=threads or available_cores(), timeout=timeout, progress=watcher))
    return steps[-1] if steps else plan.run


@contextmanager
def _watched(plan: ExecutionPlan, progress: bool | Progress) -> Generator[Progress, None, None]:
    if isinstance(progress, Progress):
        yield progress
    elif progress:
        with watching(plan.run.race.course.name, plan.stages, quiet=False) as view:
            yield view
    else:
        yield Silent()


def import_log(
    log: str | Path,
    track: TrackGiven,
    *,
    aircraft: AircraftGiven | None = None,
    set: Values = (),
    mapping: str | Path | None = None,
    columns: Sequence[str] = (),
    time_zone: str | None = None,
    noise: float | None = None,
    run: int | None = None,
    name: str | None = None,
) -> LogView:
    """Read a log of a flight, and find, smooth and judge its run through a course.

    Args:
        log: a CSV, GPX, IGC or ACMI file; the last also zipped.
        track: see `airrace.optimize`.
        aircraft: see `airrace.optimize`.
        set: single values of course and aircraft that are otherwise, see `airrace.optimize`.
        mapping: a mapping of the columns, a file of the language `airrace/log/1`.
        columns: columns on top of those of the mapping, `NAME=HEADER [UNIT]` each.
        time_zone: of times that name none, `+02:00` or `Europe/Zagreb`; None for what the mapping says, else UTC.
        noise: standard deviation of the positions, m; None to estimate it from them.
        run: which of several runs through the course, counted from 1; None for the one that passes most closely.
        name: of the aircraft of an ACMI recording that holds several.

    Raises:
        InputError: course, mapping or log are not valid, or the log does not pass the course; it names file and line.
        UsageError: an argument says nothing sensible.
    """
    from airrace.inputs.log_layout import read_layout, with_columns, with_zone
    from airrace.logs.csv_log import ColumnLayout

    named = document_or_path(track)
    if named is None:
        raise UsageError("a course is needed: a name, a file or an object")
    flown_by = document_or_path(aircraft_of(track, aircraft))
    inputs = load_inputs(named, aircraft=flown_by, overrides=value_texts(set))
    layout, known_noise = (ColumnLayout(), None) if mapping is None else read_layout(Path(mapping))
    layout = with_columns(layout, columns)
    layout = layout if time_zone is None else with_zone(layout, time_zone)
    if noise is not None and not 0.0 < noise <= 100.0:
        raise UsageError(f"a noise of {noise:g} m makes no sense: it must lie above 0 and not above 100")
    return fly_log_through(
        Path(log), inputs, layout=layout, noise=known_noise if noise is None else noise, run=run, name=name
    )
