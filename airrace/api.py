"""The commands as functions, for Python and notebooks: their options are the keyword arguments.

Nothing is printed unless it is asked for, and nothing is written but the files that are named.
"""

import logging
from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from airrace.checkpoint.atomic import replace_file
from airrace.errors import UsageError
from airrace.procedure.result import Progress, Silent
from airrace.procedure.settings import GuessKind, MeshCheck, SearchEffort
from airrace.procedure.stage import Stage
from airrace.process import available_cores
from airrace.report.film import card_of, ensure_card, film_of, film_settings
from airrace.results.comparison import Comparison
from airrace.runs.courses import CourseCheck, ShippedTrack, catalogue, check_course
from airrace.runs.execute import execute
from airrace.runs.flight_sources import report_page, write_flights
from airrace.runs.log_view import LogView, fly_log_through
from airrace.runs.output import ensure_free, write_text
from airrace.runs.plan import (
    AircraftGiven,
    Changes,
    ExecutionPlan,
    SettingsGiven,
    TrackGiven,
    Values,
    aircraft_of,
    chosen_texts,
    document_or_path,
    open_source_run,
    plan_changed_run,
    plan_new_run,
    plan_resumed_run,
    read_inputs,
    value_texts,
)
from airrace.runs.run import RunState, compare_stages, open_run
from airrace.runs.stage_data import Brief, Sensitivities
from airrace.runs.verification import Verification, verify_run
from airrace.views.drawing import ensure_drawable, save_figure
from airrace.views.progress_view import watching
from airrace.views.tables import units_named

if TYPE_CHECKING:
    from airrace.runs.reserve import ReserveCase
    from airrace.runs.safety_case import SafetyCase
    from airrace.runs.safety_rose import SafetyRose
    from airrace.safety.footprint import Footprint

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
    start: RunState | str | Path | None = None,
    set: Values = (),
    reserve: float | None = None,
    threads: int | None = None,
    timeout: float | None = None,
    progress: bool | Progress = False,
) -> "Run":
    """Fly a course as fast as can be, stage by stage; the last one is certified.

    Examples:
        >>> run = airrace.optimize("half_cuban_eight", until="point-mass", search="off")
        >>> print(f"{run.race_time:.3f} s, certified: {run.certified}")
        8.908 s, certified: True

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
            others are solved on one mesh, those above the point mass as closely as the next one needs.
        until: the last stage, e.g. `point-mass`; None for the last one, `six-dof`.
        output: a file that is renewed after every stage, so that nothing is lost by an interruption; None for none.
        force: whether a file that exists may be overwritten.
        start: another run, or its file, to start from.
        set: single values by their keys, e.g. `{"rules.n_z_max": 9}`; or texts, e.g. `["rules.n_z_max=9"]`.
        reserve: probability that a race in disturbances breaks no limit, see `Run.reserve`; None for that of the rules.
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
    inputs = read_inputs(
        track,
        aircraft,
        settings,
        [*value_texts(set), *chosen_texts("rules.reserve", probability=reserve)],
        guess=guess,
        search=search,
        alternatives=alternatives,
        mesh_check=mesh_check,
    )
    plan = plan_new_run(inputs, until=until, path=path, start=start)
    return _fly(plan, threads, timeout, progress)


def resume(
    run: RunState | str | Path,
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
) -> "Run":
    """Continue a run, or fly it again with something changed.

    Without changes it goes on after the last stage that still stands, in the file of the run if it has one. With `set`,
    `track`, `aircraft` or `settings` the changed run is a new one, started from the highest stage of this run that
    holds; this run stays as it is.

    Examples:
        >>> windy = airrace.resume(run, set={"environment.wind.from_deg": 90, "environment.wind.speed_kt": 10})
        >>> print(f"{windy.race_time - run.race_time:+.3f} s")
        -0.079 s

    Args:
        run: a run, or its file.
        until: the last stage; None for the last one there is, of a changed run for the last one of this run.
        from_: a stage that is computed again although it still stands, and all after it.
        mesh_check: which stages have a mesh check from now on, `last` or `all`; `all` completes that of those solved
            on one mesh. None for what the run was asked for.
        set: single values that are changed, by their keys, e.g. `{"rules.n_z_max": 9}`.
        track, aircraft, settings: what replaces them: a name, a file or, but for settings, an object.
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
    if changes:
        if from_ is not None:
            raise UsageError(
                "`from_` goes on in the same run; a changed run starts from the highest stage up to `until`"
            )
        before = run if isinstance(run, RunState) else open_source_run(Path(run))
        changes = changes.with_overrides(chosen_texts("settings", mesh_check=mesh_check))
        plan = plan_changed_run(before, changes, until=until, path=path)
    else:
        before = run if isinstance(run, RunState) else open_run(Path(run))
        before = before if path is None else before.moved(path)
        plan = plan_resumed_run(before, until=until, from_stage=from_, mesh_check=mesh_check)
    return _fly(plan, threads, timeout, progress)


def open(path: str | Path) -> "Run":
    """Open the run in a file that `airrace optimize` or `Run.save` has written.

    Args:
        path: the path of the file.

    Raises:
        CheckpointError: there is no such file, or it is not a whole, undamaged checkpoint.
        InputError: this version of airrace no longer accepts what the run was given.
    """
    return Run.of(open_run(Path(path)))


def check(
    track: TrackGiven,
    *,
    aircraft: AircraftGiven | None = None,
    settings: SettingsGiven | None = None,
    set: Values = (),
) -> CourseCheck:
    """Read a course, review it as a race director would, and show it; nothing is solved.

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
    return check_course(read_inputs(track, aircraft, settings, set))


def tracks() -> tuple[ShippedTrack, ...]:
    """Return the courses that come along; their names stand for files everywhere.

    Examples:
        >>> [track.name for track in airrace.tracks()][:3]
        ['abu_dhabi_2016', 'air_race_x_2024', 'chiba_2015']
    """
    return catalogue().tracks


def _fly(plan: ExecutionPlan, threads: int | None, timeout: float | None, progress: bool | Progress) -> "Run":
    """Fly all stages of a plan."""
    with _progress_view(plan, progress) as watcher:
        steps = list(execute(plan, threads=threads or available_cores(), timeout=timeout, progress=watcher))
    return Run.of(steps[-1] if steps else plan.run)


def _flies_again(**how: Any) -> Callable[[RunState, Sequence[str]], "Run"]:
    """Return what flies a run again with some values set."""
    return lambda run, values: resume(run, set=values, **how)


@contextmanager
def _progress_view(plan: ExecutionPlan, progress: bool | Progress) -> Generator[Progress, None, None]:
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

    inputs = read_inputs(track, aircraft, set=set)
    layout, known_noise = (ColumnLayout(), None) if mapping is None else read_layout(Path(mapping))
    layout = with_columns(layout, columns)
    layout = layout if time_zone is None else with_zone(layout, time_zone)
    if noise is not None and not 0.0 < noise <= 100.0:
        raise UsageError(f"a noise of {noise:g} m makes no sense: it must lie above 0 and not above 100")
    return fly_log_through(
        Path(log), inputs, layout=layout, noise=known_noise if noise is None else noise, run=run, name=name
    )


def schema(language: str) -> dict[str, object]:
    """Return the JSON Schema (draft-07) of an input file, for editors and validators.

    Args:
        language: `track`, `aircraft`, `settings`, `batch` or `log`.

    Raises:
        UsageError: there is no such language.
    """
    from airrace.inputs.json_schema import LANGUAGES, json_schema

    if language not in LANGUAGES:
        raise UsageError(f"there is no language {language!r}; known are {', '.join(LANGUAGES)}")
    return json_schema(language)


class Run(RunState):
    """A race that is solved stage by stage: what was asked for, and the stages that are finished.

    A run is a value: what continues or changes it returns another one. Its stages are found by their names, and the
    numbers of a run are those of its last stage:

    Examples:
        >>> run
        <Run half_cuban_eight: point-mass, 8.908 s, certified>
        >>> run["point-mass"].race_time == run.race_time
        True
        >>> [stage.name for stage in run]
        ['homotopy', 'point-mass']
    """

    @classmethod
    def of(cls, state: RunState) -> Self:
        """Return a run of its state."""
        return cls(state.inputs, state.checkpoint, state.path, state.confirmations)

    resume = resume

    def verify(self) -> tuple[Verification, ...]:
        """Measure every certificate again from the stored histories and multipliers alone.

        Returns:
            One verification per stage that carries a certificate; those with an `objection` do not hold.

        Raises:
            NotCertified: there is no certificate in this run.
        """
        return verify_run(self)

    def sensitivities(self, stage: str | Stage | None = None, by: str | None = None) -> Sensitivities:
        """Return the sensitivities of a stage's race time to the inputs; see `StageView.sensitivities`."""
        return self.stage(stage).sensitivities(by)

    def safety(
        self, stage: str | Stage | None = None, *, output: str | Path | None = None, **options: Any
    ) -> "SafetyCase":
        """Fly a stage's optimum many times with a pilot in the loop; see `StageView.safety` for the options.

        A file `output` is written as `airrace safety` does: `.json`, `.csv`, `.html`, `.pdf`, `.png` or `.svg`.
        """
        from airrace.runs.safety_files import fly_into_file  # takes what flies

        return fly_into_file(self, self.stage(stage), None if output is None else Path(output), options)

    def reserve(
        self, probability: float, *, threads: int | None = None, progress: bool = False, **options: Any
    ) -> "ReserveCase":
        """Fly the race again with margins so large that flights in disturbances break no limit so probably.

        Args:
            probability: that a race breaks no limit but perhaps that of the load factor.
            threads, progress: see `resume`.
            options: other keys of `rules.reserve`.

        Raises:
            InputError: an option says nothing sensible.
            UsageError: the run is not certified up to six-dof, or the pilot cannot hold it.
        """
        from airrace.runs.reserve import fly_reserve, reserve_named  # takes what flies

        texts = chosen_texts("rules.reserve", probability=probability, **options)
        fly_again = _flies_again(threads=threads, progress=progress)
        return fly_reserve(self, reserve_named(self, texts), fly_again, threads=threads)

    def safety_in_winds(
        self, winds: str, *, progress: bool = False, threads: int | None = None, **options: Any
    ) -> "SafetyRose":
        """Fly the course in each wind of a rose, started from this run, and each optimum many times; see `safety`.

        Args:
            winds: e.g. `0,5,10kt@8`: these speeds from eight directions.
            progress: whether a view of the runs under way is shown on stderr.
            threads: None for all cores.
            options: of `StageView.safety`.

        Raises:
            UsageError: it is no rose, or an argument says nothing sensible.
        """
        from airrace.runs.safety_rose import fly_rose  # takes what flies

        fly_again = _flies_again(threads=threads, progress=progress)
        return fly_rose(self, winds, fly_again, {**options, "threads": threads})

    def brief(self, stage: str | Stage | None = None) -> Brief:
        """Return what the pilot does in a stage, by default the last one, leg by leg; see `StageView.cues`."""
        return self.stage(stage).cues()

    def footprint(
        self,
        stage: str | Stage | None = None,
        *,
        drag_area: float | None = None,
        glide_ratio: float | None = None,
        output: str | Path | None = None,
    ) -> "Footprint":
        """Return what falls where from a stage's flight, as `airrace footprint` tells it: mechanics, no prediction.

        Args:
            stage: which stage; None for the last one.
            drag_area, glide_ratio: of the falling and of the gliding aircraft, see `footprint_of`.
            output: a file to be written, `.geojson`, `.kml`, `.csv`, `.png`, `.svg` or `.pdf`; None for none.

        Raises:
            UsageError: an argument says nothing sensible, there is no such stage, or it found no flight.
            StorageError: the system refused.
        """
        from airrace.runs.flight_sources import flight_footprint

        return flight_footprint(self.flight(stage), drag_area, glide_ratio, None if output is None else Path(output))

    def compare(self, other: RunState) -> Comparison:
        """Hold another run of the same passings against this one, as `airrace compare` does, at the highest stage that
        holds in both.

        Returns:
            The comparison leg by leg; `difference` (s) is positive where the other run is slower. `certified` tells
            whether the stage is certified in both: a race time that was solved on one mesh may be off by some
            hundredths of a second.

        Raises:
            UsageError: no stage is certified or solved in both, or the other run has other passings.
        """
        comparison = compare_stages(self.stages, other.stages, (self.label, other.label))
        if comparison is None:
            raise UsageError(f"no stage is certified or solved both in {self.label} and in {other.label}")
        return comparison

    def plot(
        self, path: str | Path, stage: str | Stage | None = None, *, kneeboard: bool = False, units: str = "kt-m"
    ) -> Path:
        """Draw a flight into a file, as `airrace plot` does: plan and profile by load factor, histories with limits.

        A file that exists is replaced as a whole.

        Args:
            path: the drawing, `.png`, `.svg` or `.pdf`.
            stage: which stage; None for the last one.
            kneeboard: whether it is one page to hold in the hand: map, table of the gates, and cues.
            units: of the kneeboard: `kt-m`, `kt-ft` or `kmh-m`.

        Returns:
            The path.

        Raises:
            UsageError: matplotlib is not installed, there are no such units, or no such stage, or it found no flight.
            StorageError: the system refused.
        """
        ensure_drawable(Path(path))
        from airrace.views.flight_figures import flight_figure
        from airrace.views.kneeboard import kneeboard_figure

        chosen, flight = units_named(units), self.flight(stage)
        save_figure(kneeboard_figure(flight, chosen) if kneeboard else flight_figure(flight), Path(path))
        return Path(path)

    def export(
        self,
        format_name: str,
        path: str | Path,
        stage: str | Stage | None = None,
        *,
        rate: float | None = None,
        origin: str | None = None,
        start: str | None = None,
        model: str | None = None,
    ) -> Path:
        """Write a flight into a file of another program, as `airrace export` does; return its path.

        A file that exists is replaced as a whole.

        Args:
            format_name: e.g. `kml`, `acmi`, `netcdf`; `airrace export --help` lists them.
            path: the file.
            stage: which stage; None for the last one.
            rate: samples per second; None for what suits the format.
            origin: where the course lies, `LAT,LON` or `LAT,LON,ELEV` (degrees, m); None for what it says.
            start: when the clock starts, ISO 8601, UTC unless it says otherwise.
            model: the aircraft that X-Plane shows, as `--aircraft-model`.

        Raises:
            UsageError: there is no such format or stage, an argument says nothing sensible, the course has no origin
                where the format needs one, or a library that it needs is not installed.
            StorageError: the system refused.
        """
        target, opened = Path(path), lambda: [self.flight(stage)]
        write_flights(format_name, opened, target, rate=rate, origin=origin, start=start, model=model)
        return target

    def report(
        self,
        path: str | Path,
        *others: str,
        stage: str | Stage | None = None,
        sensitivities: bool = False,
        verify: bool = True,
        envelope: int = 0,
    ) -> Path:
        """Write a page that shows a flight, as `airrace report` does; any browser opens it, without a network.

        A file that exists is replaced as a whole.

        Args:
            path: the page.
            others: flights that fly beside it, `RUN.h5` or `RUN.h5:STAGE`.
            stage: which stage; None for the last one.
            sensitivities: whether the sensitivities to the inputs' numbers are shown, which takes some seconds.
            verify: whether the stages are measured again, about a second each; the page tells the outcome.
            envelope: how many closed-loop flights show in the scene how far they stray, see `safety`; 0 for none.

        Returns:
            The path.

        Raises:
            UsageError: there is no such stage, or it found no flight, or another flight is of other passings.
            NotCertified: sensitivities were asked for, and the stage is no certified optimum.
            StorageError: the system refused.
        """
        page = report_page(self, stage, others, sensitivities=sensitivities, verify=verify, envelope=envelope)
        write_text(Path(path), page)
        return Path(path)

    # Any: words of many types, those of `film_settings`.
    def film(
        self, path: str | Path, *others: str, stage: str | Stage | None = None, verify: bool = True, **words: Any
    ) -> Path:
        """Film a flight with others, as `airrace film` does; a file that exists is replaced.

        Args:
            path, others, stage, verify: see `report`; the film is `.mp4` or `.gif`.
            words: `view`, `format`, `size`, `fps`, `from_`, `to`, `seconds`, as those of the command.

        Raises:
            UsageError: an argument says nothing sensible, or Chromium or ffmpeg is not found.
            StorageError: one of them fails, or the system refused.
        """
        settings = film_settings(Path(path), **words)
        page = report_page(self, stage, others, verify=verify)
        replace_file(Path(path), film_of(page, settings, Path(path).suffix))
        return Path(path)

    def card(self, path: str | Path, *, stage: str | Stage | None = None, verify: bool = True) -> Path:
        """Draw a card of a flight, as `airrace card` does: a PNG of 1200 x 630 pixels; a file that exists is replaced.

        Raises:
            UsageError: there is no such stage, or Chromium is not found.
            StorageError: it fails, or the system refused.
        """
        ensure_card(Path(path))
        replace_file(Path(path), card_of(report_page(self, stage, verify=verify)))
        return Path(path)
