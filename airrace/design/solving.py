"""One aircraft on a layout: its optimum, solved again whenever the course changes, by a warm session.

The latest request alone is solved, in a thread of its own. What takes longer has a second thread: the mesh of a result
is checked, other routes are searched, and six degrees of freedom follow on demand.
"""

import logging
import math
import threading
from collections.abc import Callable
from concurrent.futures import CancelledError, ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np

from airrace.design.pieces import EditableCourse, layout_of
from airrace.errors import AirraceError, SolverCrash, UsageError
from airrace.files.inputs import Document, load_inputs
from airrace.files.inputs.nodes import KeyPath, dotted
from airrace.files.inputs.places import GEODETIC, METRIC
from airrace.files.inputs.variation import Variation
from airrace.flights.results.clearances import least_distances
from airrace.flights.results.flight import Flight
from airrace.flights.sensitivity.lagrangian import sensitivities
from airrace.optimal_control.quantities import KNOT
from airrace.pages.report.flight_page import SCENE_ALONE, flight_page
from airrace.procedure.formulation import passings_of
from airrace.procedure.result import Iteration, Silent
from airrace.procedure.stage import Stage
from airrace.runs.courses import check_course
from airrace.runs.execute import execute
from airrace.runs.execution_plan import Changes, ExecutionPlan, plan_changed_run, plan_new_run
from airrace.runs.run_state import RunState
from airrace.runs.session import Session
from airrace.runs.stage_view import StageView
from airrace.runtime.process import available_cores

logger = logging.getLogger(__name__)

SEARCH_DELAY = 1.0
"""The time without a request after which other routes are searched, s; the search takes a processor for seconds."""
MIN_GAIN = 0.005
"""The gain for which another route is taken, s; less is within the errors of the mesh."""
LINE_POINTS_MAX = 600
"""The points of the line that is drawn."""
CLEARANCES_MAX = 12
"""The clearances that are listed, the tightest first."""
LATITUDE_DEGREE = 111_200.0
"""The length of a degree of latitude, m, to turn sensitivities per metre into those per degree; good to 0.6 %."""
STAGE, LAST = Stage.POINT_MASS, Stage.SIX_DOF
WIND = ("environment.wind.speed_kt", "environment.wind.from_deg", "environment.wind.speed_m_s")
SLIDERS = (*WIND, "rules.n_z_max", "aircraft.point_mass.roll_rate_max_deg_s")
"""The numbers that sliders change, as what-ifs: the file stays as it is."""


@dataclass(frozen=True)
class LayoutRequest:
    """A layout to be solved: the number of the request, the text of the track file, and overrides of its values."""

    number: int
    track: Document
    values: tuple[str, ...]


class AircraftSession:
    """One aircraft on the layout: the latest request, and its result. It may be called from any thread.

    Args:
        aircraft: another one than the track names; None for that.
        notify: called, from any thread, whenever there is something new to see.
    """

    def __init__(self, aircraft: str | None, notify: Callable[[], None]) -> None:
        self.aircraft, self._notify = aircraft, notify
        self._lock = threading.Condition()  # of the six fields below, never held for long; tells of other requests
        self._result: dict[str, object] = {"aircraft": aircraft, "busy": "solving"}
        self._request: LayoutRequest | None = None  # None after the end, too
        self._closed = False
        self._run: RunState | None = None
        self._session: Session | None = None
        self._optimum: StageView | None = None  # the last one of the session, from which the next one starts
        self._solving = threading.Lock()  # the warm session is used by one thread at a time
        self._solver = ThreadPoolExecutor(1, thread_name_prefix="layout")
        self._background = ThreadPoolExecutor(1, thread_name_prefix="layout in the background")

    def submit(self, request: LayoutRequest) -> None:
        """Ask for a layout to be solved; a request before it is dropped."""
        with self._lock:
            if self._closed:
                return
            self._request = request
            self._lock.notify_all()
            self._solver.submit(self._guard, self._solve, request)

    def submit_six_dof(self) -> None:
        """Ask for the layout with six degrees of freedom, in the background."""
        with self._lock:
            if not self._closed:
                self._background.submit(self._guard, self._fly_six_dof)

    def result(self) -> dict[str, object]:
        """Return what there is to see, for JSON."""
        with self._lock:
            return self._result

    def scene(self) -> str:
        """Return a page with the scene of the last flight; `UsageError` if there is none yet."""
        with self._lock:
            optimum = self._optimum
        if optimum is None:
            raise UsageError("there is no flight yet")
        return flight_page([optimum.flight()], style=SCENE_ALONE)

    def close(self) -> None:
        """End the solvers and the threads; what is under way is broken off at its next iteration."""
        with self._lock:
            self._request, self._closed = None, True
            self._lock.notify_all()
            session = self._session
            for executor in (self._solver, self._background):
                executor.shutdown(wait=False, cancel_futures=True)
        if session is not None:
            session.close()

    def _guard(self, work: Callable[..., None], *arguments: object) -> None:
        """Do a piece of work; an error is shown, and the next one is done all the same."""
        try:
            work(*arguments)
            return
        except (AirraceError, CancelledError) as error:
            problem = str(error)
        except Exception as error:
            if self._closed:  # pools that end with the program refuse what this thread still asks of them
                return
            logger.exception("the layout cannot be solved")
            problem = f"{type(error).__name__}: {error}"
        if problem:
            self._show(busy="", problem=problem)

    def _show(self, **fields: object) -> None:
        with self._lock:
            if self._request is None:
                return
            self._result = {**self._result, **fields}
        self._notify()

    def _is_latest(self, request: LayoutRequest) -> bool:
        with self._lock:
            return self._request is request

    def _solve(self, request: LayoutRequest) -> None:
        """Solve a layout; where the solver process dies, once more by a new one."""
        with self._solving:
            if not self._is_latest(request):
                return
            self._show(busy="solving", problem="")
            try:
                view = self._optimum_of(request)
            except SolverCrash:
                if self._request is None:  # it was ended
                    return
                self._show(busy="the solver has ended and is started again")
                if self._run is not None:
                    self._open(self._run)
                view = self._optimum_of(request)
            except AirraceError as error:  # such as values that the inputs do not allow
                self._show(holds=False, time=None, status="", message=str(error), answered=request.number, busy="")
                return
            self._show_optimum(request, view)
        with self._lock:
            if self._request is request:
                self._background.submit(self._guard, self._search, request)

    def _optimum_of(self, request: LayoutRequest) -> StageView:
        """Return the optimum of a layout: warm, or from scratch where its passings differ."""
        inputs = load_inputs(request.track, aircraft=self.aircraft, overrides=request.values)
        session, run = self._session, self._run
        if session and run and passings_of(inputs.race.course) == passings_of(run.race.course):
            return session.solve(request.values, track=request.track, start=self._optimum)
        plan = plan_new_run(inputs, until=STAGE)
        run = self._execute(plan, available_cores(), "", lambda: not self._is_latest(request))
        if run.stage().result.holds:
            self._open(run)
        return run.stage()

    def _show_optimum(self, request: LayoutRequest, view: StageView, note: str = "") -> None:
        self._show(**_view_fields(view), answered=request.number, note=note, busy="")
        if view.result.holds:
            with self._lock:
                self._optimum = view
            self._show(**_drawing_of(view.flight()))
            self._show(**_slopes_of(view, layout_of(view.inputs)))
        self._show(warnings=[warning.text for warning in check_course(view.inputs).warnings])

    def _execute(self, plan: ExecutionPlan, threads: int, prefix: str, is_dropped: Callable[[], bool]) -> RunState:
        """Return the run of a plan; `CancelledError` as soon as it is dropped, as for a newer request."""
        *_, run = execute(plan, threads=threads, progress=_ProgressLine(self._show, prefix, is_dropped))
        return run

    def _open(self, run: RunState) -> None:
        """Keep a run warm in place of the one there is; `CancelledError` after the end."""
        session = Session(run, STAGE)
        with self._lock:
            ended = self._request is None
            before = session if ended else self._session
            if not ended:
                self._run, self._session, self._optimum = run, session, None
        if before is not None:
            before.close()
        if ended:
            raise CancelledError

    def _search(self, request: LayoutRequest) -> None:
        """Check the mesh of a result, and search for other routes, as soon as no request has come for a while."""
        with self._lock:
            is_dropped = self._lock.wait_for(lambda: self._request is not request, SEARCH_DELAY)
            run, optimum, session = self._run, self._optimum, self._session
            holds = optimum is not None and self._result.get("holds")
        if is_dropped or run is None or session is None:
            return
        if optimum is not None and holds:
            self._show(busy="mesh check")
            with suppress(CancelledError, UsageError):  # another answer, or session, has come meanwhile
                checked = session.certify(optimum).result()
                with self._solving:  # another optimum must not be shown meanwhile
                    if self._optimum is optimum:
                        self._show(status=checked.status)
        plan = plan_changed_run(run, Changes(request.track, None, None, request.values), until=STAGE)
        searched = self._execute(plan, 1, "other routes: ", lambda: not self._is_latest(request))
        view = searched.stage()
        gain = (optimum.race_time if optimum is not None and holds else math.inf) - view.race_time
        with self._solving:
            if not self._is_latest(request):
                return
            if view.result.holds and gain > MIN_GAIN:
                self._open(searched)
                note = f"another route is {gain:.3f} s faster" if holds else "found on another route"
                self._show_optimum(request, view, note)
            elif holds:
                self._show(busy="")
            else:
                self._show(busy="", message=view.message)

    def _fly_six_dof(self) -> None:
        with self._lock:
            run, request = self._run, self._request
        if run is None or request is None:
            return
        plan = plan_changed_run(run, Changes(request.track, None, None, request.values), until=LAST)
        view = self._execute(plan, available_cores(), "", lambda: self._request is None).stage()
        drawing = _drawing_of(view.flight()) if view.result.is_flight else {"line": ()}
        self._show(busy="", six_dof={**_view_fields(view), **drawing, "answered": request.number})


class _ProgressLine(Silent):
    """A view of a run under way that shows one line, and breaks the run off once its request is dropped."""

    def __init__(self, show: Callable[..., None], prefix: str, is_dropped: Callable[[], bool]) -> None:
        self._show, self._prefix, self._is_dropped = show, prefix, is_dropped

    def stage_started(self, stage: Stage) -> None:
        self._stage = stage.value
        self._show(busy=f"{self._prefix}{self._stage}")

    def iteration(self, iteration: Iteration) -> None:
        if self._is_dropped():
            raise CancelledError

    def activity(self, text: str, done: int, total: int) -> None:
        if self._is_dropped():
            raise CancelledError
        self._show(busy=f"{self._prefix}{self._stage}: {text}")


def _view_fields(view: StageView) -> dict[str, object]:
    """Return race time, status and limits of a result."""
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
    rows = np.unique(np.linspace(0, len(flight.time) - 1, LINE_POINTS_MAX).round().astype(int))
    n_z = flight["n_z"]
    clearances = sorted(least_distances(flight), key=lambda clearance: clearance.margin)[:CLEARANCES_MAX]
    splits: list[tuple[object, ...]] = []
    for crossing in flight.crossings:
        speed, load_factor = crossing.value("V_K") / KNOT, crossing.value("n_z")
        splits.append((crossing.name, round(crossing.time, 3), round(speed, 1), round(load_factor, 2)))
    return {
        "line": np.stack([flight["x"], flight["y"], n_z], axis=1)[rows].round(3).tolist(),
        "n_z_range": [round(float(n_z.min()), 2), round(float(n_z.max()), 2)],
        "splits": splits,
        "distances": [(line.text, round(line.distance, 2), line.required) for line in clearances],
    }


def _slopes_of(view: StageView, layout: EditableCourse) -> dict[str, object]:
    """Return how the race time changes with every place (s/m) and every turn (s/deg), and at which values."""
    numbers, race = Variation(view.inputs).parameters, view.inputs.race
    targets = dict[str, tuple[KeyPath, str, float]]()  # piece or place, axis, and unit of every number
    longitude_degree = LATITUDE_DEGREE * math.cos(race.course.origin.latitude or 0.0)
    factors = (1.0, 1.0, 1.0 / LATITUDE_DEGREE, 1.0 / longitude_degree)
    places, turns = dict[str, tuple[float, float]](), dict[str, float]()
    for piece in layout.pieces:
        if piece.turn is not None:
            targets[dotted((*piece.path, piece.turn[0]))] = (piece.path, "turn", 1.0)
            turns[dotted(piece.path)] = piece.turn[1]
        for spot in piece.spots:
            places[dotted(spot.path)] = (spot.north, spot.east)
            for key, axis, factor in zip((*METRIC, *GEODETIC), ("north", "east") * 2, factors, strict=True):
                targets[dotted((*spot.path, key))] = (spot.path, axis, factor)
    slopes = dict[str, dict[str, object]]()
    parameters = [numbers[key] for key in targets if key in numbers]
    for sensitivity in sensitivities(parameters, race, view.inputs.settings, view.result):
        path, axis, factor = targets[sensitivity.key]
        sides = (sensitivity.upward, sensitivity.downward)
        slopes.setdefault(dotted(path), {})[axis] = [side * factor if math.isfinite(side) else 0.0 for side in sides]
    return {"slopes": slopes, "slope_time": view.race_time, "slope_places": places, "slope_turns": turns}
