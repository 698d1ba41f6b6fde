"""Flight states drawn by lot, all over what an aerobatic aircraft does and somewhat beyond."""

import math

import numpy as np

from airrace.dynamics.six_dof import SixDofState

DEGREE = math.pi / 180.0
RANGES = {
    "V_K": (45.0, 130.0),
    "alpha_K": (-10.0 * DEGREE, 20.0 * DEGREE),
    "beta_K": (-12.0 * DEGREE, 12.0 * DEGREE),
    "p_K": (-7.0, 7.0),
    "q_K": (-2.0, 2.0),
    "r_K": (-2.0, 2.0),
    "eta": (-25.0 * DEGREE, 25.0 * DEGREE),
    "xi": (-25.0 * DEGREE, 25.0 * DEGREE),
    "zeta": (-25.0 * DEGREE, 25.0 * DEGREE),
    "delta_T": (0.0, 1.0),
    "z": (-1000.0, 0.0),
}
"""The ranges from which the quantities are drawn evenly; SI and radians. Attitudes are drawn from all there are."""


def random_states(count: int, seed: int) -> list[SixDofState[float]]:
    """Return `count` random states; they are the same for the same seed."""
    generator = np.random.default_rng(seed)
    states: list[SixDofState[float]] = []
    for _ in range(count):
        drawn = {name: float(generator.uniform(low, high)) for name, (low, high) in RANGES.items()}
        q = generator.normal(size=4)
        q0, q1, q2, q3 = (q / np.linalg.norm(q)).tolist()
        states.append(SixDofState[float](x=0.0, y=0.0, q0=q0, q1=q1, q2=q2, q3=q3, **drawn))
    return states


def mirrored(state: SixDofState[float]) -> SixDofState[float]:
    """Return the state in a mirror that exchanges left and right."""
    odd = ("y", "q1", "q3", "beta_K", "p_K", "r_K", "xi", "zeta")
    return SixDofState[float](**{name: -value if name in odd else value for name, value in vars(state).items()})
