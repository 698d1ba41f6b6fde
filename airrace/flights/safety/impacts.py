"""Where closed-loop flights fall to: the impacts of falls from every tenth of a second of every one of them.

Falls are those of `falls_and_glides`, each between its impact in vacuum and that with the drag of the airframe, as wide
as the aircraft to either side. The wind is that of the day; errors of wind and density are in the flights alone.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from airrace.flights.safety.closed_loop import LOST, ClosedLoop, Flights
from airrace.flights.safety.falls_and_glides import AirColumn, States, fall_in_vacuum, fall_with_drag
from airrace.flights.safety.footprint import STRETCH_POINTS
from airrace.flights.safety.judge import Booleans, Thing, legs_at, things_of
from airrace.flights.safety.outlines import Outline, Raster
from airrace.flights.safety.plant import STATE
from airrace.model.environment import g0
from airrace.model.frames import rotation
from airrace.optimal_control.trajectory import Array
from airrace.procedure.planning.clearance import beside_border, beside_line, ground_distance
from airrace.race import Race

EVERY = 5
"""Of how many samples of a flight one is looked at: it moves by some 10 m meanwhile."""
STEP = 0.1
"""The step of the integration, s; falls from 200 m end within two centimetres of where they do with a tenth of it."""
CELLS = 400
"""The cells of the raster along its longer edge: some 4 m each."""
TARGETS = ("crowd", "safety line", "airspace")
"""The kinds of things that impacts are measured from."""

Stretches = tuple[Array, Array]
"""The impacts in vacuum and with drag of one flight, north and east, m, each of shape (k, 2)."""


@dataclass(frozen=True, eq=False)
class Fallen:
    """The impacts of some flights.

    Attributes:
        distances: least distance of an impact from people, or of one on the allowed side of a line or border, half the
            span taken off; m, shape (targets, n); zero where people are hit, negative beyond a line.
        stretches: what falls sweep over, flight by flight.
    """

    distances: Array
    stretches: tuple[Stretches, ...]


def fallen_together(parts: Sequence[Fallen]) -> Fallen:
    """Return the impacts of several batches, in their order; none of none."""
    if not parts:
        return Fallen(np.zeros((0, 0)), ())
    stretches = tuple(stretch for part in parts for stretch in part.stretches)
    return Fallen(np.concatenate([part.distances for part in parts], axis=1), stretches)


def targets_of(race: Race) -> tuple[Thing, ...]:
    """Return what impacts are measured from: people, lines, border."""
    return tuple(thing for thing in things_of(race.course) if thing.kind in TARGETS)


def fall(race: Race, loop: ClosedLoop, flights: Flights) -> Fallen:
    """Let flights fall from every tenth of a second between the first and the last passing.

    Args:
        race: course, aircraft and air.
        loop: whose flights they are.
        flights: n of them.
    """
    nominal, airframe = loop.nominal, race.aircraft.airframe
    samples = np.arange(0, len(flights.clock), EVERY)
    clock, state = flights.clock[samples], flights.state[samples]
    racing = (clock >= nominal.passing_times[0]) & (clock <= nominal.passing_times[-1])
    racing &= samples[:, None] < flights.lost
    of_flight, instant = np.nonzero(racing.T)  # flight by flight
    rows = state[instant, :, of_flight].T  # (states, instants)
    R, speed = rotation(list(rows[4:8])), rows[STATE["V_K"]]
    falling = States(
        np.stack([rows[0], rows[1], -rows[STATE["z"]]], axis=1),
        np.stack([speed * R[0][0], speed * R[1][0], -speed * R[2][0]], axis=1),
    )
    line = nominal.at(nominal.passing_times)
    top = float((-line[STATE["z"]] + line[STATE["V_K"]] ** 2 / (2.0 * g0)).max()) + LOST
    air = AirColumn.from_air(race.air, top)
    vacuum = fall_in_vacuum(falling).place
    drag = fall_with_drag(falling, air, mass=airframe.m, drag_area=race.aircraft.drag.C_D0 * airframe.S, h=STEP).place
    distances = np.full((len(targets_of(race)), flights.clock.shape[1]), np.inf)
    legs = legs_at(nominal, clock)[instant, of_flight]
    for row, distance in enumerate(_distances(race, vacuum, drag, legs)):
        np.minimum.at(distances[row], of_flight, distance)
    begins = np.flatnonzero(np.diff(of_flight)) + 1
    stretches = tuple(zip(np.split(vacuum, begins), np.split(drag, begins), strict=True))
    return Fallen(distances, stretches)


def _distances(race: Race, vacuum: Array, drag: Array, legs: NDArray[np.int64]) -> Sequence[Array]:
    """Return the distances of every fall from the targets, see `Fallen.distances`, each of shape (instants,).

    Those on the allowed side of a line, or inside of a convex border, are least at one end of the stretch between both
    impacts.
    """
    course, half = race.course, 0.5 * race.aircraft.airframe.b
    distances: list[Array] = []
    for crowd in course.crowd:
        least = np.full(len(vacuum), np.inf)
        for share in np.linspace(0.0, 1.0, STRETCH_POINTS).tolist():
            least = np.minimum(least, ground_distance(vacuum + share * (drag - vacuum), crowd))
        distances.append(np.maximum(least - half, 0.0))
    for line in course.safety_lines:
        beside = np.minimum(beside_line(vacuum, line), beside_line(drag, line)) - half
        counts: Booleans = np.isin(legs, course.passages_with_line(line))
        distances.append(np.where(counts, beside, np.inf))
    if course.airspace:
        distances.append(
            np.minimum(beside_border(vacuum, course.airspace), beside_border(drag, course.airspace)) - half
        )
    return distances


def outlines_of(race: Race, stretches: Sequence[Stretches]) -> tuple[Outline, ...]:
    """Return the outline of the ground that the falls of all flights meet."""
    return Raster.from_stretches(stretches, 0.5 * race.aircraft.airframe.b, CELLS).outlines()
