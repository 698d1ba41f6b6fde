"""The ladder: every stage's flight, and where its joint problem is started from."""

import dataclasses
import functools
from collections.abc import Callable, Iterator, Sequence

from airrace.optimal_control.fatrop_interrupt import interrupts_held_back
from airrace.procedure.flight import Flight, iterate_of, mesh_of, stage_flight
from airrace.procedure.guess import first_mesh, guess
from airrace.procedure.handover import followed, recorded, settled
from airrace.procedure.homotopy import fly_homotopy
from airrace.procedure.joint import COLD_BARRIER, PIECED_BARRIER, Start, optimise_jointly
from airrace.procedure.models import BUILDERS
from airrace.procedure.race import Race
from airrace.procedure.result import Stage, StageResult
from airrace.procedure.settings import GuessKind, Settings
from airrace.procedure.solving import Workbench

STAGES = tuple(stage for stage in Stage if stage in BUILDERS)
"""The stages that can be run, in order."""


def wanted_stages(settings: Settings, until: Stage) -> list[Stage]:
    """The stages of a run: with a guess from the plan there is no homotopy."""
    first = STAGES.index(Stage.HOMOTOPY if settings.guess is GuessKind.HOMOTOPY else Stage.POINT_MASS)
    return list(STAGES[first : STAGES.index(until) + 1])


class Ladder:
    """The stages of one race, climbed one after the other; `done` holds those that are finished.

    Args:
        first: the stage whose model is made at once.

    Raises:
        InputError: aircraft and rules leave no allowed value of some quantity.
    """

    def __init__(
        self, race: Race, settings: Settings, finished: Sequence[StageResult], first: Stage = Stage.POINT_MASS
    ) -> None:
        self._race = race
        self._settings = settings
        self._flights: dict[Stage, Flight] = {}
        self.done = {result.stage: result for result in finished}
        self.flight(first)  # inputs that contradict each other are told before anything is solved

    def flight(self, stage: Stage) -> Flight:
        """The model of a stage, made when it is first asked for.

        Raises:
            InputError: aircraft and rules leave no allowed value of some quantity.
        """
        if stage is Stage.HOMOTOPY:
            return dataclasses.replace(self.flight(Stage.POINT_MASS), stage=stage)
        if stage not in self._flights:
            with interrupts_held_back():
                self._flights[stage] = stage_flight(stage, self._race, self._settings)
        return self._flights[stage]

    def climb(self, stage: Stage, bench: Workbench) -> StageResult:
        """Run one stage; those before it are done."""
        flight = self.flight(stage)
        if stage is Stage.HOMOTOPY:
            result = fly_homotopy(flight, bench)
        elif stage is Stage.POINT_MASS:
            result = optimise_jointly(flight, bench, self._first_starts(flight, bench))
        else:
            result = optimise_jointly(flight, bench, list(self._handovers(flight, bench)))
        self.done[stage] = result
        return result

    def _first_starts(self, flight: Flight, bench: Workbench) -> Sequence[Callable[[], Start]]:
        """Of the point mass: the homotopy and the plan, the one the user wants first."""
        flown = self.done.get(Stage.HOMOTOPY)

        def planned() -> Start:
            mesh = first_mesh(flight.plan, bench.settings.mesh)
            return Start(flight.problem(mesh), guess(flight.plan, mesh), COLD_BARRIER)

        def pieced() -> Start:
            pieces = (flown or fly_homotopy(self.flight(Stage.HOMOTOPY), bench)).trajectory
            return Start(flight.problem(mesh_of(pieces)), iterate_of(pieces), PIECED_BARRIER)

        return (pieced, planned) if flown else (planned, pieced)

    def _handovers(self, flight: Flight, bench: Workbench) -> Iterator[Callable[[], Start]]:
        """Of a higher fidelity: flown along the stage before, at rest in it, at rest in the point mass."""
        below = STAGES[STAGES.index(flight.stage) - 1]
        yield functools.partial(self._handed_over, flight, below, bench)
        for stage in dict.fromkeys((below, Stage.POINT_MASS)):
            if stage in self.done:  # a run that was started from another one may lack the point mass
                yield functools.partial(self._at_rest, flight, stage)

    def _at_rest(self, flight: Flight, stage: Stage) -> Start:
        with interrupts_held_back():
            return settled(flight, self.flight(stage), self.done[stage])

    def _handed_over(self, flight: Flight, stage: Stage, bench: Workbench) -> Start:
        source, optimum = self.flight(stage), self.done[stage]
        if flight.stage is Stage.STATE_SPACE and stage is Stage.STATE_SPACE_INVERSION:
            return recorded(flight, source, optimum)
        bench.progress.activity(f"flying along the optimum of {stage.value} by error feedback", 0, 0)
        with interrupts_held_back():
            return followed(flight, source, optimum)
