"""One aircraft on a layout: its optimum, solved again whenever the course changes, by a warm session.

Questions are answered in a thread of their own, the latest alone. What takes longer has a second thread: the mesh of an
answer is checked, other routes are looked for, and six degrees of freedom follow on demand.
"""

import contextlib
import logging
import math
import threading
import time
from collections.abc import Callable
from concurrent.futures import CancelledError
from dataclasses import dataclass
from queue import SimpleQueue
from typing import Any

import numpy as np

from airrace.design.pieces import EditableCourse, layout_of
from airrace.errors import AirraceError, SolverCrash, UsageError
from airrace.inputs import Document, load_inputs
from airrace.inputs.nodes import KeyPath, dotted
from airrace.inputs.places import GEODETIC, METRIC
from airrace.inputs.variation import Variation
from airrace.procedure.formulation import passings_of
from airrace.procedure.result import Iteration, Silent
from airrace.procedure.stage import Stage
from airrace.process import available_cores
from airrace.quantities import KNOT
from airrace.report.flight_page import SCENE_ALONE, flight_page
from airrace.results.clearances import least_distances
from airrace.results.flight import Flight
from airrace.runs.courses import check_course
from airrace.runs.execute import execute
from airrace.runs.plan import Changes, ExecutionPlan, plan_changed_run, plan_new_run
from airrace.runs.run import RunState
from airrace.runs.session import Session
from airrace.runs.stage_view import StageView
from airrace.sensitivity.lagrangian import sensitivities_to

logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class SolvingSettings:
    """The numbers of a lane.

    Attributes:
        rest: the time without a question after which other routes are looked for, s; they take a processor for
            seconds.
        faster: by which another route is taken, s; less is within the errors of the mesh.
        points: of the line that is drawn, at most.
        distances: that are listed, the tightest first.
        degree: length of a degree of latitude, m, to turn sensitivities by degrees into those by metres; good to 0.6 %.
    """

    rest: float = 1.0
    faster: float = 0.005
    points: int = 600
    distances: int = 12
    degree: float = 111_200.0


SETTINGS = SolvingSettings()
STAGE, LAST = Stage.POINT_MASS, Stage.SIX_DOF
WIND = ("environment.wind.speed_kt", "environment.wind.from_deg", "environment.wind.speed_m_s")
SLIDERS = (*WIND, "rules.n_z_max", "aircraft.point_mass.roll_rate_max_deg_s")
"""The numbers that sliders change, as what-ifs: the file stays as it is."""


@dataclass(frozen=True)
class Question:
    """A layout to be solved: the revision of the track file, its text, and values that are otherwise."""

    revision: int
    track: Document
    values: tuple[str, ...]


class Lane:
    """One aircraft on the layout: what it is asked, and what it has answered.

    Args:
        aircraft: another one than the track names; None for that.
        tell: called whenever there is something new to see.

    Attributes:
        shown: what there is to see, for JSON.
    """

    def __init__(self, aircraft: str | None, tell: Callable[[], None]) -> None:
        self.aircraft, self._tell = aircraft, tell
        self.shown: dict[str, object] = {"aircraft": aircraft, "busy": "solving"}
        self._question: Question | None = None
        self._run: RunState | None = None
        self._session: Session | None = None
        self._known: StageView | None = None
        self._solving = threading.Lock()  # of the session, which one thread uses at a time
        self._answers, self._explorations = SimpleQueue[Callable[[], None]](), SimpleQueue[Callable[[], None]]()
        for queue in (self._answers, self._explorations):
            threading.Thread(target=self._work, args=(queue,), daemon=True).start()

    def ask(self, question: Question) -> None:
        """Put a question; those before it that are not begun are dropped."""
        self._question = question
        self._answers.put(lambda: self._answer(question))

    def fly_six_dof(self) -> None:
        """Solve the layout with six degrees of freedom, in the background."""
        self._explorations.put(self._fly_six_dof)

    def scene(self) -> str:
        """Return a page with the scene of the last flight; `UsageError` if there is none yet."""
        if self._known is None:
            raise UsageError("there is no flight yet")
        return flight_page([self._known.flight()], style=SCENE_ALONE)

    def close(self) -> None:
        """End the solvers."""
        self._question = None
        if self._session is not None:
            self._session.close()

    def _work(self, queue: SimpleQueue[Callable[[], None]]) -> None:
        """Do one thing after another; whatever goes wrong is shown, and the next is done all the same."""
        while True:
            work, problem = queue.get(), ""
            try:
                work()
            except (AirraceError, CancelledError) as error:
                problem = str(error)
            except Exception as error:
                logger.exception("the layout cannot be solved")
                problem = f"{type(error).__name__}: {error}"
            if problem and self._question is not None:
                self._show(busy="", problem=problem)

    def _show(self, **what: object) -> None:
        self.shown = {**self.shown, **what}
        self._tell()

    def _answer(self, question: Question) -> None:
        """Answer a question; where the solver process dies, once more by a new one."""
        with self._solving:
            if self._question is not question:
                return
            self._show(busy="solving", problem="")
            try:
                view = self._solve(question)
            except SolverCrash:
                if self._question is None:
                    return
                self._show(busy="the solver has ended and is started again")
                if self._run is not None:
                    self._open(self._run, Session(self._run, STAGE))
                view = self._solve(question)
            except AirraceError as error:  # such as values that the inputs do not allow
                self._show(holds=False, time=None, status="", message=str(error), answered=question.revision, busy="")
                return
            self._take(question, view)
        self._explorations.put(lambda: self._explore(question))

    def _solve(self, question: Question) -> StageView:
        """Return the optimum of a layout: warm, from scratch where its passings are others."""
        inputs = load_inputs(question.track, aircraft=self.aircraft, overrides=question.values)
        session, run = self._session, self._run
        if session and run and passings_of(inputs.race.course) == passings_of(run.race.course):
            return session.solve(question.values, track=question.track, start=self._known)
        plan = plan_new_run(inputs, until=STAGE)
        run = self._fly(plan, available_cores(), "", lambda: self._question is not question)
        if run.stage().result.holds:
            self._open(run, Session(run, STAGE))
        return run.stage()

    def _take(self, question: Question, view: StageView, note: str = "") -> None:
        """Show an answer, and what follows from it."""
        self._show(**_view_fields(view), answered=question.revision, note=note, busy="")
        if view.result.holds:
            self._known = view
            self._show(**_drawing_of(view.flight()))
            self._show(**_slopes_of(view, layout_of(view.inputs)))
        self._show(warnings=[one.text for one in check_course(view.inputs).warnings])

    def _fly(self, plan: ExecutionPlan, threads: int, what: str, dropped: Callable[[], bool]) -> RunState:
        """Return the run of a plan; `CancelledError` as soon as it is dropped, as for a newer question."""
        *_, run = execute(plan, threads=threads, progress=_ProgressLine(self._show, what, dropped))
        return run

    def _open(self, run: RunState, session: Session) -> None:
        """Keep a run warm in the place of the one there is."""
        before, self._run, self._session, self._known = self._session, run, session, None
        if before is not None:
            before.close()

    def _explore(self, question: Question) -> None:
        """Check the mesh of an answer, and look for other routes, as soon as no hand moves."""
        time.sleep(SETTINGS.rest if self._question is question else 0.0)
        run, known, session = self._run, self._known, self._session
        if self._question is not question or run is None or session is None:
            return
        holds = known is not None and self.shown.get("holds")
        if known is not None and holds:
            self._show(busy="mesh check")
            with contextlib.suppress(CancelledError):
                checked = session.certify(known).result()
                if self._known is known:
                    self._show(status=checked.status)
        plan = plan_changed_run(run, Changes(question.track, None, None, question.values), until=STAGE)
        view = (found := self._fly(plan, 1, "other routes: ", lambda: self._question is not question)).stage()
        before = known.race_time if known is not None and holds else math.inf
        opened = None
        if view.result.holds and view.race_time < before - SETTINGS.faster:
            opened = Session(found, STAGE)
        with self._solving:
            if self._question is not question:
                if opened is not None:
                    opened.close()
            elif opened is not None:
                self._open(found, opened)
                gained = f"another route is {before - view.race_time:.3f} s faster"
                self._take(question, view, gained if holds else "found on another route")
            else:
                self._show(busy="", **({} if holds else {"message": view.message}))

    def _fly_six_dof(self) -> None:
        run, question = self._run, self._question
        if run is None or question is None:
            return
        plan = plan_changed_run(run, Changes(question.track, None, None, question.values), until=LAST)
        view = self._fly(plan, available_cores(), "", lambda: self._question is None).stage()
        drawn = _drawing_of(view.flight()) if view.result.is_flight else {"line": ()}
        self._show(busy="", six_dof={**_view_fields(view), **drawn, "revision": question.revision})


class _ProgressLine(Silent):
    """A view of a run under way that shows one line, and breaks the run off once nobody waits for it any more."""

    def __init__(self, show: Callable[..., None], what: str, dropped: Callable[[], bool]) -> None:
        self._show, self._what, self._dropped = show, what, dropped

    def stage_started(self, stage: Stage) -> None:
        self._stage = stage.value
        self._show(busy=f"{self._what}{self._stage}")

    def iteration(self, iteration: Iteration) -> None:
        if self._dropped():
            raise CancelledError

    def activity(self, text: str, done: int, total: int) -> None:
        if self._dropped():
            raise CancelledError
        self._show(busy=f"{self._what}{self._stage}: {text}")


def _view_fields(view: StageView) -> dict[str, object]:
    """Return the race time of an answer and what is to be said about it."""
    numbers = Variation(view.inputs).parameters
    return {
        "title": view.inputs.race.aircraft.name,
        "time": view.race_time if view.result.holds else None,
        "holds": view.result.holds,
        "status": view.status,
        "message": view.message,
        "limits": {key: numbers[key].value for key in SLIDERS if key in numbers},
    }


def _drawing_of(flight: Flight) -> dict[str, Any]:
    """Return line, passings and distances of a flight."""
    rows = np.unique(np.linspace(0, len(flight.time) - 1, SETTINGS.points).round().astype(int))
    n_z = flight["n_z"]
    clearances = sorted(least_distances(flight), key=lambda one: one.margin)[: SETTINGS.distances]
    return {
        "line": np.stack([flight["x"], flight["y"], n_z], axis=1)[rows].round(3).tolist(),
        "n_z_range": [round(float(one), 2) for one in (n_z.min(), n_z.max())],
        "splits": [
            (one.name, round(one.time, 3), round(one.value("V_K") / KNOT, 1), round(one.value("n_z"), 2))
            for one in flight.crossings
        ],
        "distances": [(one.text, round(one.distance, 2), one.required) for one in clearances],
    }


def _slopes_of(view: StageView, layout: EditableCourse) -> dict[str, object]:
    """Return how the race time changes with every place (s/m) and every turn (s/deg), and at which values."""
    numbers, race = Variation(view.inputs).parameters, view.inputs.race
    wanted = dict[str, tuple[KeyPath, str, float]]()
    latitude = race.course.origin.latitude or 0.0
    per = (1.0, 1.0, 1.0 / SETTINGS.degree, 1.0 / (SETTINGS.degree * math.cos(latitude)))
    for piece in layout.pieces:
        if piece.turn is not None:
            wanted[dotted((*piece.path, piece.turn[0]))] = (piece.path, "turn", 1.0)
        for spot in piece.spots:
            for key, axis, factor in zip((*METRIC, *GEODETIC), ("north", "east") * 2, per, strict=True):
                wanted[dotted((*spot.path, key))] = (spot.path, axis, factor)
    slopes = dict[str, dict[str, object]]()
    chosen = [numbers[key] for key in wanted if key in numbers]
    for one in sensitivities_to(chosen, race, view.inputs.settings, view.result):
        path, axis, factor = wanted[one.key]
        both = [each * factor if math.isfinite(each) else 0.0 for each in (one.upward, one.downward)]
        slopes.setdefault(dotted(path), {})[axis] = both
    places = {dotted(spot.path): (spot.north, spot.east) for piece in layout.pieces for spot in piece.spots}
    turns = {dotted(piece.path): piece.turn[1] for piece in layout.pieces if piece.turn is not None}
    return {"slopes": slopes, "slope_time": view.race_time, "slope_places": places, "slope_turns": turns}
