"""A run as Python and notebooks have it: with the commands as methods."""

import math
import time
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Self, Unpack

from airrace.api import optimize
from airrace.api.safety import SafetyOptions
from airrace.errors import UsageError
from airrace.files.checkpoint.atomic import replace_file
from airrace.flights.results.comparison import Comparison
from airrace.flights.safety.disturbances import ChosenDisturbances
from airrace.pages.report.film import card_of, ensure_card, film_of, film_settings, language_named
from airrace.pages.views.count_view import counting
from airrace.pages.views.drawing import ensure_drawable, save_figure
from airrace.pages.views.progress_view import watching
from airrace.pages.views.tables import units_named
from airrace.procedure.result import Progress, Silent
from airrace.procedure.stage import Stage
from airrace.runs.execute import Execution, ensure_executable
from airrace.runs.execution_plan import ExecutionPlan, chosen_texts
from airrace.runs.flight_sources import report_page, write_flights
from airrace.runs.output import write_text
from airrace.runs.run_state import RunState, compare_stages
from airrace.runs.stage_data import Brief, Sensitivities
from airrace.runs.verification import StageVerification, verify_run

if TYPE_CHECKING:
    from airrace.flights.safety.footprint import Footprint
    from airrace.runs.reserve_search import ReserveCase
    from airrace.runs.safety_case import SafetyCase
    from airrace.runs.safety_rose import SafetyRose


Watch = Callable[[Execution], AbstractContextManager[Progress]]
"""Provides who watches an execution; it keeps the execution, and with it what is finished when an error ends that."""


def fly(
    plan: ExecutionPlan,
    *,
    threads: int,
    timeout: float | None = None,
    progress: bool | Progress | Watch = False,
    dry_run: bool = False,
) -> "Run":
    """Fly all stages of a plan, or only find out that they could be flown; return the run as it is then."""
    execution = Execution(plan)
    if isinstance(progress, Progress):
        watched: AbstractContextManager[Progress] = nullcontext(progress)
    elif callable(progress):
        watched = progress(execution)
    elif progress:
        watched = watching(plan.run.race.course.name, plan.stages, quiet=False)
    else:
        watched = nullcontext(Silent())
    if dry_run:
        ensure_executable(plan, timeout=timeout)
        return Run.of(plan.run)
    with watched as watcher:
        for _ in execution.steps(threads=threads, timeout=timeout, progress=watcher):
            pass
    return Run.of(execution.run)


def _flies_again(threads: int | None, *, progress: bool) -> Callable[[RunState, Sequence[str]], "Run"]:
    """Return what flies a run again with some values set."""
    return lambda run, values: optimize.resume(run, set=values, threads=threads, progress=progress)


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
        return cls(**{field.name: getattr(state, field.name) for field in fields(RunState)})

    resume = optimize.resume

    def verify(self) -> tuple[StageVerification, ...]:
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
        self, stage: str | Stage | None = None, *, output: str | Path | None = None, **options: Unpack[SafetyOptions]
    ) -> "SafetyCase":
        """Fly a stage's optimum many times with a pilot in the loop; see `StageView.safety` for the options.

        A file `output` is written as `airrace safety` does: `.json`, `.csv`, `.html`, `.pdf`, `.png` or `.svg`.
        """
        from airrace.runs.safety_files import fly_into_file  # takes what flies

        return fly_into_file(self, self.stage(stage), None if output is None else Path(output), options)

    def reserve(
        self,
        probability: float,
        *,
        load_factor: bool | None = None,
        threads: int | None = None,
        progress: bool = False,
        **disturbances: Unpack[ChosenDisturbances],
    ) -> "ReserveCase":
        """Fly the race again with margins so large that flights in disturbances break no limit so probably.

        Args:
            probability: that a race breaks no limit.
            load_factor: whether a pull that counts by the penalties of the season breaks one.
            threads, progress: see `resume`.
            disturbances: in which that is asked for.

        What is None is as `rules.reserve` has it by default.

        Raises:
            InputError: an option is not valid.
            UsageError: the run is not certified up to six-dof, or the pilot cannot hold it.
        """
        from airrace.runs.reserve_search import fly_reserve, reserve_named  # takes what flies

        texts = chosen_texts("rules.reserve", probability=probability, load_factor=load_factor, **disturbances)
        request, fly_again = reserve_named(self, texts), _flies_again(threads, progress=progress)
        with counting(shown=progress) as count:

            def show(text: str, done: int, total: int) -> None:
                count.show(text)

            return fly_reserve(self, request, fly_again, threads=threads, tell=count.remark, show=show)

    def safety_in_winds(
        self, winds: str, *, progress: bool = False, timeout: float | None = None, **options: Unpack[SafetyOptions]
    ) -> "SafetyRose":
        """Fly the course in each wind of a rose, started from this run, and each optimum many times; see `safety`.

        Args:
            winds: e.g. `0,5,10kt@8`: these speeds from eight directions.
            progress: whether it is shown on stderr how far it is.
            timeout: the longest wall time, s; what is finished by then is returned.
            options: of `StageView.safety`; `threads` solve the runs, too.

        Raises:
            UsageError: it is no rose, or an argument is out of range.
        """
        from airrace.runs.safety_rose import fly_rose  # takes what flies

        until = math.inf if timeout is None else time.monotonic() + timeout

        def fly_again(run: RunState, values: Sequence[str]) -> Run:
            left = None if timeout is None else max(until - time.monotonic(), 1e-3)
            return optimize.resume(run, set=values, threads=options.get("threads"), timeout=left, progress=progress)

        with counting(shown=progress) as count:
            return fly_rose(self, winds, fly_again, {**options, "watch": count.watch}, count=count, until=until)

    def brief(self, stage: str | Stage | None = None, *, lateness: bool = False) -> Brief:
        """Return what the pilot does in a stage, by default the last one, leg by leg; see `StageView.cues`."""
        return self.stage(stage).cues(lateness=lateness)

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
            UsageError: an argument is out of range, there is no such stage, or it found no flight.
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
        self,
        path: str | Path,
        stage: str | Stage | None = None,
        *,
        kneeboard: bool = False,
        units: str = "kt-m",
        paper: str = "a5",
        lateness: bool = False,
    ) -> Path:
        """Draw a flight into a file, as `airrace plot` does: plan and profile by load factor, histories with limits.

        A file that exists is replaced as a whole.

        Args:
            path: the drawing, `.png`, `.svg` or `.pdf`.
            stage: which stage; None for the last one.
            kneeboard: whether it is pages for the knee, lap by lap: map, gates, and cues.
            units: of the kneeboard: `kt-m`, `kt-ft` or `kmh-m`.
            paper: of the kneeboard: `a5`, or `a4` with two pages on a sheet.
            lateness: whether the kneeboard tells the price of lateness of every cue; each is solved twice.

        Returns:
            The path.

        Raises:
            UsageError: matplotlib is not installed, there are no such units, no such paper or no such stage, or it
                found no flight.
            StorageError: the system refused.
        """
        ensure_drawable(Path(path))
        from airrace.pages.views.flight_figures import flight_figure
        from airrace.pages.views.kneeboard import save_kneeboard

        chosen, flight = units_named(units), self.flight(stage)
        if kneeboard:
            prices = self.brief(stage, lateness=True).prices if lateness else ()
            save_kneeboard(flight, Path(path), chosen, paper=paper, prices=prices)
        else:
            save_figure(flight_figure(flight), Path(path))
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
            UsageError: there is no such format or stage, an argument is out of range, the course has no origin
                where the format needs one, or a library that it needs is not installed.
            StorageError: the system refused.
        """
        target, open_flight = Path(path), lambda: [self.flight(stage)]
        write_flights(format_name, open_flight, target, rate=rate, origin=origin, start=start, model=model)
        return target

    def report(
        self,
        path: str | Path,
        *others: str,
        stage: str | Stage | None = None,
        sensitivities: bool = False,
        verify: bool = True,
        envelope: int = 0,
        units: str = "kt-m",
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
            units: of speeds and lengths, as of `plot`.

        Returns:
            The path.

        Raises:
            UsageError: there is no such stage, or it found no flight, or another flight is of other passings.
            NotCertified: sensitivities were asked for, and the stage is no certified optimum.
            StorageError: the system refused.
        """
        page = report_page(
            self,
            stage,
            others,
            sensitivities=sensitivities,
            verify=verify,
            envelope=envelope,
            units=units_named(units),
        )
        write_text(Path(path), page)
        return Path(path)

    def film(
        self,
        path: str | Path,
        *others: str,
        view: str = "tv",
        format: str = "16:9",
        size: str | None = None,
        fps: float | None = None,
        from_: float | None = None,
        to: float | None = None,
        seconds: float | None = None,
        graphics_only: bool = False,
        language: str = "en",
        stage: str | Stage | None = None,
        verify: bool = True,
    ) -> Path:
        """Film a flight with others, as `airrace film` does; a file that exists is replaced.

        Args:
            path, others, stage, verify: see `report`; the film is `.mp4`, `.mov`, `.zip` or `.gif`.
            view, format, size, fps, from_, to, seconds, graphics_only, language: as those of the command, see
                `airrace.api.flights.film`.

        Raises:
            UsageError: an argument is out of range, or Chromium or ffmpeg is not found.
            StorageError: one of them fails, or the system refused.
        """
        settings = film_settings(
            Path(path),
            view=view,
            format=format,
            size=size,
            fps=fps,
            from_=from_,
            to=to,
            seconds=seconds,
            graphics_only=graphics_only,
        )
        page = report_page(self, stage, others, verify=verify, language=language_named(language))
        replace_file(Path(path), film_of(page, settings, Path(path).suffix))
        return Path(path)

    def card(
        self,
        path: str | Path,
        *others: str,
        language: str = "en",
        stage: str | Stage | None = None,
        verify: bool = True,
    ) -> Path:
        """Draw a card of a flight, or of a duel with another one, as `airrace card` does: a PNG of 1200 x 630 pixels.

        A file that exists is replaced.

        Raises:
            UsageError: there is no such stage or language, or Chromium is not found.
            StorageError: it fails, or the system refused.
        """
        ensure_card(Path(path))
        page = report_page(self, stage, others, verify=verify, language=language_named(language))
        replace_file(Path(path), card_of(page))
        return Path(path)
