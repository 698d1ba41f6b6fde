"""The cost of the final state (a Mayer term): weighted quantities of an observation, and their derivatives."""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from airrace.optimal_control.kernels import Kernel, observation_kernel
from airrace.optimal_control.problem import Problem
from airrace.trajectory import Array

_NOTHING = ca.MX(0, 1)  # an observation shares nothing between its calls


@dataclass(frozen=True)
class FinalCost:
    """The cost `sum_i weights_i c_i(y)` of the final state y.

    Attributes:
        kernel: what is observed, c.
        weights: of its values, in the objective's unit per unit of the quantity; shape (n_c,).
        y: the final state in SI, shape (n_x,).
        own: the observation's parameters, shape (n_b,).
    """

    kernel: Kernel
    weights: Array
    y: ca.MX
    own: ca.MX

    def value(self) -> ca.MX:
        """Return the cost, a scalar."""
        seen: ca.MX = self.kernel.value(self.y, self.own, _NOTHING)
        return ca.dot(ca.DM(self.weights), seen)

    def gradient(self) -> ca.MX:
        """Return the gradient of the cost in y, dense; shape (n_x,)."""
        gradient: ca.MX = self.kernel.hessian(self.y, self.own, _NOTHING, ca.DM(self.weights))[0]
        return gradient

    def hessian(self, factor: ca.MX) -> ca.MX:
        """Return the upper triangle of the Hessian of the cost in y times a factor, sparse; shape (n_x, n_x)."""
        hessian: ca.MX = self.kernel.hessian(self.y, self.own, _NOTHING, factor * ca.DM(self.weights))[1]
        return hessian


def final_cost(problem: Problem, y: ca.MX, own: ca.MX) -> FinalCost | None:
    """Return the cost of the final state that a problem's objective observes; None if it observes nothing."""
    observation = problem.objective.observation
    if observation is None:
        return None
    weights = np.array([problem.objective.terminal.get(one.name, 0.0) for one in observation.quantities])
    return FinalCost(observation_kernel(observation, len(problem.system.states)), weights, y, own)
