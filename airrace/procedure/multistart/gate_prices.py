"""Prices of the state at a gate: what a window of a race pays for the state in which it ends, s.

The window that begins there is paid the same. Whatever the prices are, they cancel in a flight of the whole race, so
that the least priced times of windows that make up the race add up to a lower bound of its race time:
docs/theory/lower_bound.md has the derivation. The bound is close where prices grow with the state as the time to go
does.

A price is a weighted sum of features of the state. The attitude enters by its direction cosines: a price linear in the
quaternion would tell q from -q, which are one attitude, and would misjudge the other side of a knife edge.
"""

import functools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import casadi as ca
import numpy as np

from airrace.model.dynamics.flight_model import RollCounter
from airrace.model.frames import QUATERNION, rotation
from airrace.optimal_control.quantities import Quantity
from airrace.optimal_control.system import SYMBOLS, Observation
from airrace.optimal_control.trajectory import Array

PRICE = "price"
"""The quantity that an observation of prices sees, s."""
COUNTERS = RollCounter.names()
"""The states that count rolls: they begin anew where they matter, so they have no price."""
SCALES = {"x": 60.0, "y": 60.0, "z": 40.0, "V_K": 30.0, "n_z": 10.0, "n_y": 1.0, "p_Kbar": 7.0}
"""The changes of states that their weights belong to, in their own units; of any other state its scale."""


@dataclass(frozen=True, eq=False)
class Features:
    """What prices are made of.

    Attributes:
        values: casadi function of the state, shape (n_x,) -> (n_f,).
        jacobian: its derivatives, shape (n_f, n_x).
        observation: sees the price; its parameters are the weights.
    """

    values: ca.Function
    jacobian: ca.Function
    observation: Observation

    def at(self, state: Array) -> Array:
        """Return the features of a state (n_x,), shape (n_f,)."""
        return np.array(self.values(state)).ravel()


@functools.lru_cache(maxsize=8)
def features_of(states: tuple[Quantity, ...]) -> Features:
    """Return the features of the states of a point mass."""
    with SYMBOLS:
        x = ca.SX.sym("x", len(states))
        by_name = {quantity.name: x[row] for row, quantity in enumerate(states)}
        features: list[ca.SX] = []
        for quantity in states:
            if quantity.name not in (*QUATERNION, *COUNTERS):
                features.append(by_name[quantity.name] / SCALES.get(quantity.name, quantity.scale))
        for row in rotation([by_name[name] for name in QUATERNION]):
            features += row
        column = ca.vertcat(*features)
        weights = ca.SX.sym("w", column.numel())
        price = ca.Function("price", [x, weights], [ca.dot(weights, column)], {"cse": True})
        values = ca.Function("features", [x], [column], {"cse": True})
        jacobian = ca.Function("jacobian", [x], [ca.jacobian(column, x)], {"cse": True})
    parameters = tuple(Quantity(f"weight_{number}", "s") for number in range(column.numel()))
    return Features(values, jacobian, Observation(PRICE, (Quantity(PRICE, "s"),), parameters, price))


@dataclass(frozen=True, eq=False)
class GatePrice:
    """The price of the state at one gate: weights of features (n_f,), s."""

    features: Features
    weights: Array

    @classmethod
    def from_costate(cls, states: Sequence[Quantity], state: Array, costate: Array) -> Self:
        """Return the price that grows as the time to go of an optimum does, to first order.

        Args:
            states: of the point mass.
            state: of the optimum at the gate, shape (n_x,).
            costate: likewise, s per unit of each state.
        """
        names = [quantity.name for quantity in states]
        rows = [names.index(name) for name in QUATERNION]
        tangent = np.eye(len(names))  # of the states whose quaternion has length 1
        tangent[np.ix_(rows, rows)] -= np.outer(state[rows], state[rows])
        features = features_of(tuple(states))
        slopes = np.array(features.jacobian(state)) @ tangent
        # the smallest weights that have these slopes
        weights: Array = np.linalg.lstsq(slopes.T, tangent @ costate, rcond=1e-9)[0].astype(np.float64)
        return cls(features, weights)
