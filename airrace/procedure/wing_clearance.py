"""The wing's distance from all pylons of a course on the replay of an optimum, and the item of the certificate on it.

The wing is the line from tip to tip: the body's in models that have a body, the path's in the others. In the frame
Kbar the right wing of a body at kinematic angles is `(sin(beta_K), cos(beta_K), 0)`, whatever its angle of attack.
"""

import math
from collections.abc import Sequence

import numpy as np

from airrace.frames import rotation
from airrace.optimal_control.certificate import Item
from airrace.optimal_control.problem import Iterate, Problem
from airrace.optimal_control.replay import Replay, interval_durations
from airrace.planning.wing_clearance import ClosestApproach, Wing, closest_approaches, pylons_of
from airrace.procedure.result import CLEARANCE
from airrace.procedure.settings import CertificateLimits
from airrace.procedure.stage_problem import StageProblem
from airrace.track.course import ClearanceRule
from airrace.trajectory import Array


def replayed_wing(flight: StageProblem, problem: Problem, iterate: Iterate, replay: Replay) -> tuple[Wing, list[int]]:
    """Return the way of the wing on a replay, and the numbers of its times at which legs begin and, last, it ends."""
    parts = replay.state.shape[2] - 1
    steps = interval_durations(problem, iterate.durations)
    ends = np.cumsum(steps)
    inside: Array = (ends - steps)[:, None] + steps[:, None] * np.linspace(0.0, 1.0, parts, endpoint=False)
    time: Array = np.append(inside.ravel(), ends[-1])
    rows = np.concatenate([replay.state[:, :, :-1].reshape(len(replay.state), -1), replay.state[:, -1:, -1]], axis=1)
    x = dict(zip((one.name for one in problem.system.states), rows, strict=True))
    R = np.array(rotation([x[name] for name in ("q0", "q1", "q2", "q3")]))
    beta = x.get("beta_K", np.zeros_like(time))
    right = np.sin(beta) * R[:, 0] + np.cos(beta) * R[:, 1]
    half = 0.5 * flight.aircraft.airframe.b * right * np.array([[1.0], [1.0], [-1.0]])
    centre = np.stack([x["x"], x["y"], -x["z"]])
    return Wing(time, centre, half), [parts * node for node in problem.first_node]


def approaches(flight: StageProblem, problem: Problem, iterate: Iterate, replay: Replay) -> list[ClosestApproach]:
    """Return the least distance of the wing from every pylon of the course on every leg."""
    wing, legs = replayed_wing(flight, problem, iterate, replay)
    return list(closest_approaches(wing, pylons_of(flight.course), legs))


def clearance_item(
    flight: StageProblem, problem: Problem, found: Sequence[ClosestApproach], limits: CertificateLimits
) -> Item:
    """Return the item on the length by which the wing misses its clearance from a pylon at any time, at worst.

    By the rule `crossing` it is only measured where no obstacle is too near: then nothing is too much.

    Args:
        found: all approaches, see `approaches`.
    """
    always = flight.course.rules.clearance is ClearanceRule.FLIGHT
    missed = [one for one in found if one.shortfall > 0.0]
    binding = [one for one in missed if always or (one.pylon.is_obstacle and one.shortfall > limits.gate_length)]
    limit = limits.gate_length if always or binding else math.inf
    if not missed:
        return Item(CLEARANCE, 0.0, limit, "m", "")
    worst = max(binding or missed, key=lambda one: one.shortfall)
    where = f"{problem.phases[worst.leg].name}, {worst.pylon.text}, {worst.time:.2f} s"
    return Item(CLEARANCE, worst.shortfall, limit, "m", where)
