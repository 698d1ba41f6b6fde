"""Closed-loop flights of a stage, from its optimum to the result: simulated and measured batch by batch, on threads."""

import math
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from airrace.errors import UsageError
from airrace.frames import rotation
from airrace.planning.plan import Race
from airrace.procedure.result import StageResult
from airrace.procedure.stage import Stage
from airrace.process import available_cores
from airrace.safety.closed_loop import SETTINGS, UNDISTURBED, ClosedLoop, Scatter, batches, fly
from airrace.safety.covariance import covariance
from airrace.safety.evaluation import FlightMeasurements, Judge, axis_of, grid_of, measure, onto_plane, together
from airrace.safety.nominal import ERRORS, NominalFlight, gradients
from airrace.safety.pilot import PilotModel
from airrace.safety.plant import CONTROLS, Plant
from airrace.safety.result import (
    CONTACT,
    LOAD,
    Count,
    SafetyResult,
    breaches_by_flight,
    envelope_of,
    gate_stretches,
    leg_stretches,
)
from airrace.trajectory import Array

MOST_FLIGHTS = 1_000_000
"""The largest number of flights; more take hours, and no model is as true as their interval would be narrow."""


def closed_loop_of(race: Race, result: StageResult, pilot: PilotModel) -> ClosedLoop:
    """Train a pilot for the optimum of a stage.

    Raises:
        UsageError: the stage is not six-dof or found no flight, the delay is none, or the pilot cannot hold the optimum
            even undisturbed.
    """
    if result.stage is not Stage.SIX_DOF or not result.is_flight:
        raise UsageError(
            f"closed-loop flights follow an optimum of six-dof; this is {result.stage.value}, {result.status.value}: "
            "airrace resume goes on to six-dof"
        )
    if not 0.0 <= pilot.delay <= 1.0:
        raise UsageError(
            f"a delay of {pilot.delay:g} s makes no sense: it must lie between 0 and 1 s; people have 0.1 to 0.3"
        )
    if abs(pilot.delay - pilot.waiting * pilot.sample) > 1e-9:
        below = math.floor(pilot.delay / pilot.sample)
        raise UsageError(
            f"a delay of {pilot.delay:g} s makes no sense: the pilot decides every {pilot.sample:g} s, so it must be "
            f"{below * pilot.sample:g} or {(below + 1) * pilot.sample:g} s"
        )
    plant = Plant.of(race)
    loop = ClosedLoop.of(plant, NominalFlight.of(race, result, plant), pilot)
    alone = fly(loop, UNDISTURBED, 0, [0])
    off = np.linalg.norm(alone.error[:, :3, 0], axis=1)
    astray = np.flatnonzero(off > SETTINGS.undisturbed_off)
    if not len(astray) and alone.lost[0] < len(alone.clock):
        raise UsageError(
            "this optimum cannot be followed in closed loop: even undisturbed the flight has no finite state at "
            f"{alone.sample * alone.lost[0]:.1f} s"
        )
    if len(astray):
        when = float(alone.clock[astray[0], 0])
        raise UsageError(
            f"a pilot with a delay of {pilot.delay:g} s cannot hold this optimum: even undisturbed the flight is more "
            f"than {SETTINGS.undisturbed_off:g} m off it at {when:.1f} s"
        )
    return loop


def fly_closed_loop(
    race: Race,
    result: StageResult,
    *,
    flights: int = 1000,
    scatter: Scatter | None = None,
    pilot: PilotModel | None = None,
    seed: int = 0,
    threads: int | None = None,
) -> SafetyResult:
    """Fly a stage's optimum many times, and tell how far the flights stray and what they break.

    Args:
        race: course, aircraft and air.
        result: its stage six-dof.
        flights: how many.
        scatter: the disturbances; None for the defaults.
        pilot: who flies; None for the defaults.
        seed: of all flights; flight k is the same however many there are.
        threads: None for one per processor.

    Raises:
        UsageError: the stage is not six-dof or found no flight, or an argument says nothing sensible.
    """
    if not 1 <= flights <= MOST_FLIGHTS:
        raise UsageError(f"{flights} flights make no sense: it must be 1 to {MOST_FLIGHTS}")
    race, scatter = race.by_rules, scatter or Scatter()
    loop = closed_loop_of(race, result, pilot or PilotModel())
    judge = Judge.of(race, result, loop)

    def one(numbers: range) -> FlightMeasurements:
        return measure(judge, loop, fly(loop, scatter, seed, numbers))

    with ThreadPoolExecutor(threads or available_cores()) as pool:
        measured = together(list(pool.map(one, batches(flights))))
    names = [passage.name for passage in race.course.passages]
    broken = breaches_by_flight(measured)
    contact = np.logical_or.reduce([broken[kind] for kind in CONTACT])
    outside = np.logical_or.reduce([one for kind, one in broken.items() if kind != LOAD])
    clock, passings = grid_of(loop.nominal), loop.nominal.passings
    return SafetyResult(
        scatter=scatter,
        pilot=loop.pilot,
        seed=seed,
        flights=flights,
        race_time=result.trajectory.race_time,
        counts={kind: Count.among(int(one.sum()), flights) for kind, one in broken.items()},
        contact=Count.among(int(contact.sum()), flights),
        outside=Count.among(int(outside.sum()), flights),
        gates=tuple(gate_stretches(names, measured, linear_at_passings(loop, judge, scatter))),
        legs=tuple(leg_stretches(names, passings, clock, measured)),
        pylons={
            f"{pylon.text}, {pylon.post + 1}": (Count.among(int(touched.sum()), flights), float(nearest.min()))
            for pylon, touched, nearest in zip(judge.pylons, measured.touched, measured.nearest, strict=True)
        },
        clock=clock,
        envelope=envelope_of(measured),
    )


def linear_at_passings(loop: ClosedLoop, judge: Judge, scatter: Scatter) -> Array:
    """Return standard deviations of lateral, height, bank, load factor and time at every passage, shape (n, 5).

    An error at the clock of the passage is carried along the flow to the plane of the gate; where none stands it is
    measured at that clock, and so are flights.
    """
    P, nominal, plant = covariance(loop, scatter), loop.nominal, loop.plant
    size, count, row = P.shape[1], len(ERRORS), plant.path_row("n_z")
    clock = np.minimum(np.rint(nominal.passings / loop.pilot.sample).astype(np.int64), len(P) - 1)
    found = np.zeros((len(clock), 5))

    def load(x: Array, d: Array) -> Array:
        return plant.path_of(np.concatenate([np.zeros((CONTROLS, x.shape[1])), d]))(x)[[row]]

    for number, (passing, k) in enumerate(zip(judge.passings, clock.tolist(), strict=True)):
        line = nominal.at(nominal.passings[number : number + 1])
        line[4:8] /= np.linalg.norm(line[4:8], axis=0)
        onto, sooner = onto_plane(nominal, passing, number, line)
        away = np.array(rotation([float(one) for one in line[4:8, 0]]))  # north, east, down per error of position
        axis = axis_of(passing, line)
        J = np.zeros((5, size))
        J[0, :count] = (axis[0] * away[1] - axis[1] * away[0]) @ onto[:3]
        J[1, :count] = -away[2] @ onto[:3]
        J[2, :count] = onto[4]
        J[3, :-1] = gradients(load, line)[0, 0]
        J[3, :count] = J[3, :count] @ onto
        J[4, -1] = 1.0
        J[4, :3] -= sooner
        found[number] = np.sqrt(np.maximum(np.diag(J @ P[k] @ J.T), 0.0))
    return found
