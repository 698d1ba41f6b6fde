"""The reference, a flight to be followed: histories over its own clock `s`."""

from collections.abc import Sequence

import numpy as np

from airrace.dynamics.flight_model import FlightModel
from airrace.dynamics.outer_loop import LoadFactors, load_factors
from airrace.environment import g0
from airrace.frames import Scalar, rotation
from airrace.optimal_control.problem import Iterate, Problem
from airrace.quantities import T, Vector, quantity, vector
from airrace.records import record
from airrace.system import at_points
from airrace.trajectory import Array, Trajectory

SOFTENING = 0.2
"""The time before a corner in load factor or roll rate at which it begins to be rounded off, s."""
HALF_WINDOW = 20
"""The number of samples on either side of the centre of the window that rounds corners off."""


@vector
class ReferencePoint(Vector[T]):
    """The quantities of the reference at one instant, or their whole histories, one row per quantity.

    Rates are with respect to `s`.
    """

    x: T = quantity("m", text="north of the origin")
    y: T = quantity("m", text="east of the origin")
    z: T = quantity("m", text="below the origin")
    v_N: T = quantity("m/s", text="velocity over the ground, north")
    v_E: T = quantity("m/s", text="velocity over the ground, east")
    v_D: T = quantity("m/s", text="velocity over the ground, down")
    a_N: T = quantity("m/s2", text="acceleration, north")
    a_E: T = quantity("m/s2", text="acceleration, east")
    a_D: T = quantity("m/s2", text="acceleration, down")
    q0: T = quantity("1", text="attitude of Kbar, scalar part")
    q1: T = quantity("1", text="attitude of Kbar, north part")
    q2: T = quantity("1", text="attitude of Kbar, east part")
    q3: T = quantity("1", text="attitude of Kbar, down part")
    n_y: T = quantity("1", text="lateral load factor")
    n_z: T = quantity("1", text="load factor")
    p_Kbar: T = quantity("rad/s", text="roll rate about the velocity")
    soft_n_z: T = quantity("1", text="load factor without its corners")
    soft_n_z_dot: T = quantity("1/s", text="rate of that")
    soft_p: T = quantity("rad/s", text="roll rate without its corners")
    soft_p_dot: T = quantity("rad/s2", text="rate of that")
    delta_T: T = quantity("1", text="throttle")
    delta_T_dot: T = quantity("1/s", text="rate of the throttle")
    Phi: T = quantity("rad", text="angle rolled, as counted; zero where nothing is")
    gain: T = quantity("m", text="height gained, as counted; zero where nothing is")
    Phi_reset: T = quantity("rad/s", text="winding back of the angle rolled")
    gain_reset: T = quantity("m/s", text="winding back of the height gained")

    @property
    def position(self) -> tuple[T, T, T]:
        """The position in O, m."""
        return self.x, self.y, self.z

    @property
    def velocity(self) -> tuple[T, T, T]:
        """The velocity in O, m/s."""
        return self.v_N, self.v_E, self.v_D

    @property
    def acceleration(self) -> tuple[T, T, T]:
        """The acceleration in O, m/s2."""
        return self.a_N, self.a_E, self.a_D

    @property
    def q(self) -> tuple[T, T, T, T]:
        """The quaternion of `R_OKbar`, scalar first."""
        return self.q0, self.q1, self.q2, self.q3


@record
class Reference:
    """A flight over its own clock.

    Attributes:
        s: the clock, s; increasing from zero, shape (M,).
        histories: one row of shape (M,) per quantity; attitudes next to each other have the same sign.
        boundaries: the clock where phases begin and, last, at the end of the flight; shape (n + 1,).
    """

    s: Array
    histories: ReferencePoint[Array]
    boundaries: Array

    @property
    def duration(self) -> float:
        """The duration of the flight, s."""
        return float(self.s[-1])


def from_histories(model: FlightModel, s: Array, state: Array, control: Array, boundaries: Array) -> Reference:
    """Return a flight of `model` as a reference.

    Args:
        model: the model that flew, with the numbers of its aircraft and air.
        s: instants, s; shape (M,).
        state: shape (n_x, M).
        control: held at these instants, shape (n_u, M).
        boundaries: see `Reference`.
    """
    system, p = model.system, model.parameter_values
    rates = at_points(system.rates, state, control, p)
    load = LoadFactors[Array].split(at_points(load_factors(system), state, control, p))
    own = {one.name: row for one, row in zip((*system.states, *system.controls), [*state, *control], strict=True)}
    rate_of = {one.name: row for one, row in zip(system.states, rates, strict=True)}
    R: list[list[Array]] = rotation([own[name] for name in ("q0", "q1", "q2", "q3")])
    specific = (load.n_x, load.n_y, -load.n_z)
    a_N, a_E, a_D = (g0 * sum_of_products(row, specific) for row in R)
    soft_n_z, soft_p = soften(s, load.n_z), soften(s, load.p_Kbar)
    nothing = np.zeros(len(s))
    counted = {name: own.get(name, nothing) for name in ("Phi", "gain", "Phi_reset", "gain_reset")}
    histories = ReferencePoint[Array](
        **{name: own[name] for name in ("x", "y", "z", "q0", "q1", "q2", "q3", "delta_T")},
        **counted,
        v_N=rate_of["x"],
        v_E=rate_of["y"],
        v_D=rate_of["z"],
        a_N=a_N,
        a_E=a_E,
        a_D=a_D + g0,
        n_y=load.n_y,
        n_z=load.n_z,
        p_Kbar=load.p_Kbar,
        soft_n_z=soft_n_z,
        soft_n_z_dot=np.gradient(soft_n_z, s),
        soft_p=soft_p,
        soft_p_dot=np.gradient(soft_p, s),
        delta_T_dot=rate_of["delta_T"],
    )
    return Reference(s, histories, boundaries)


def soften(s: Array, values: Array) -> Array:
    """Return a history without its corners: its mean under a triangle `SOFTENING` wide to either side.

    What happens in between is neither early nor late, and its integral is preserved; the ends hold their values.

    Args:
        s: instants, s; increasing, shape (M,).
        values: shape (M,).
    """
    spacing = SOFTENING / HALF_WINDOW
    grid = np.arange(s[0] - 2.0 * SOFTENING, s[-1] + 2.0 * SOFTENING, spacing)
    window: Array = np.bartlett(2 * HALF_WINDOW + 1)
    means = np.asarray(np.convolve(np.interp(grid, s, values), window / window.sum(), mode="same"), dtype=np.float64)
    return np.interp(s, grid, means)


def from_optimum(model: FlightModel, problem: Problem, trajectory: Trajectory) -> Reference:
    """Return a stage's optimum as a reference, sampled between its nodes as the certificate samples it.

    Args:
        model: whose system the problem is about.
        problem: the problem on the mesh of `trajectory`.
        trajectory: its solution.
    """
    # Imported here: models are read without whatever compiles them, and the guidance laws are part of their list.
    from airrace.optimal_control.replay import interval_durations, replay

    sampled = replay(problem, Iterate(trajectory.durations, trajectory.state, trajectory.control)).state
    n_x, _, samples = sampled.shape
    steps = interval_durations(problem, trajectory.durations)
    share = np.linspace(0.0, 1.0, samples)[:-1]
    s = np.append((trajectory.time[:-1, None] + steps[:, None] * share).ravel(), trajectory.time[-1])
    state = np.hstack([sampled[:, :, :-1].reshape(n_x, -1), sampled[:, -1, -1:]])
    control = np.hstack([np.repeat(trajectory.control, samples - 1, axis=1), trajectory.control[:, -1:]])
    return from_histories(model, s, state, control, trajectory.time[trajectory.first_node])


def sum_of_products(one: Sequence[Scalar], other: Sequence[Scalar]) -> Scalar:
    """Return the scalar product of two vectors."""
    return sum(a * b for a, b in zip(one, other, strict=True))
