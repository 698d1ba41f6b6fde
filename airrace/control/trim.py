"""The settled states of a model along a reference: at every instant it does at rest what the reference does there.

Nothing is flown. The lag of the inner loop is missing, so the result is a guess and no flight. It needs no model that
can follow, and it is where the flight of those that can begins.
"""

import numpy as np

from airrace.control.inner_controller import InnerController, InnerLoopInverse
from airrace.control.outer_loop import Commands
from airrace.control.reference import Reference, ReferencePoint
from airrace.dynamics.flight_model import FlightModel, RollCounter
from airrace.dynamics.outer_loop import ATTITUDE, PoweredState
from airrace.frames import normalise
from airrace.points import at_points
from airrace.quantities import Quantity
from airrace.system import System
from airrace.trajectory import Array

SETTLING = 30
"""The number of steps of Newton's method towards the settled state."""
SHARED = (*PoweredState.names(), *RollCounter.names())
"""The names of the states that all models have in common."""


def settle(model: FlightModel, inverse: InnerLoopInverse, reference: Reference, *, nodes: Array) -> tuple[Array, Array]:
    """Return settled states at instants of the reference, and the controls between them.

    Args:
        model: with the numbers of its aircraft and air.
        inverse: builds the model's inner controller.
        reference: what is imitated.
        nodes: values of the reference's clock, s; shape (N + 1,).

    Returns:
        Shapes (n_x, N + 1) and (n_u, N); controls are within their bounds.
    """
    here = at(reference, nodes)
    state = settled_states(model.system, inverse(model), here)
    steps = np.diff(nodes)
    rates = {one.name: np.diff(row) / steps for one, row in zip(model.system.states, state, strict=True)}
    held = {"delta_T_cmd": here.delta_T, "Phi_reset": here.Phi_reset, "gain_reset": here.gain_reset}

    def control(one: Quantity) -> Array:
        values = rates[one.rate_of] if one.rate_of else 0.5 * (held[one.name][1:] + held[one.name][:-1])
        return np.clip(values, one.lower, one.upper)

    return state, np.stack([control(one) for one in model.system.controls])


def at(reference: Reference, nodes: Array) -> ReferencePoint[Array]:
    """Return the reference at values of its clock (s), linear between its samples."""
    here = {name: _read(reference, name, nodes) for name in ReferencePoint.names()}
    here |= zip(ATTITUDE, normalise([here[name] for name in ATTITUDE]), strict=True)
    return ReferencePoint[Array](**here)


def _read(reference: Reference, name: str, nodes: Array) -> Array:
    return np.asarray(np.interp(nodes, reference.s, getattr(reference.histories, name)), dtype=np.float64)


def settled_states(system: System, inner: InnerController, here: ReferencePoint[Array]) -> Array:
    """Return the states in which a model at rest does what the reference does, shape (n_x, N + 1)."""
    count = len(here.x)
    V_K = np.linalg.norm(np.stack(here.velocity), axis=0)
    known = {name: getattr(here, name) for name in ReferencePoint.names()} | {"V_K": V_K}
    x = np.stack([known[one.name] if one.name in SHARED else np.zeros(count) for one in system.states])
    commands = Commands[Array](
        n_x=np.zeros(count),
        delta_T_dot=np.zeros(count),
        n_y=here.n_y,
        n_z=here.soft_n_z,
        n_z_dot=here.soft_n_z_dot,
        p=here.soft_p,
        p_dot=here.soft_p_dot,
    )
    wanted = np.stack(list(commands.join()))
    for _ in range(SETTLING):
        x = at_points(inner.settled, x, wanted)
    return x
