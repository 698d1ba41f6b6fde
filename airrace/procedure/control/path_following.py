"""A flight to be followed, its histories over its own clock `s`, and the feedback of errors that leads back to it.

The outer loop asks for load factors and a roll rate. The reference is followed along its path, not its clock. With `t`
the direction of its velocity, `R = R_OKbar`, and `q_e` the rotation from the aircraft's attitude to the reference's,
its scalar part not negative:

    s'   = clip((v . t + k_t e_s) / V_ref)           e_s = (r - r_ref) . t
    f    = R^T [s'^2 a_ref - g0 e_z + K_p (r_ref - r)_across - K_v v_across] / g0
    e_t  = 2 atan2(q_e1, q_e0)
    e_mu = clip(e_t + clip(n_z,ref (f_y cos e_t + f_z sin e_t - n_y,ref) / (n_z,ref^2 + eps^2)))

`f` is the specific force that is wanted; errors along the path are left to the clock and the engine. What of it lies
across the reference's lift is reached by banking further (f_y to the right, f_z down), as far as there is lift to be
turned; near zero g the bank is the reference's own, and side force takes over:

    n_x,cmd = [s'^2 a_ref . t + K_V (V_ref - V_K)] / g0 - R31      n_z,cmd = -f_z      p_cmd = s' p_ref + K_mu e_mu
    n_y,cmd = n_y,ref + clip(eps^2 (f_y - n_y,ref) / (f_y^2 + f_z^2 + eps^2))

The reference's own part in `n_z,cmd` and `p_cmd` is taken without its corners (`soften`), for no inner loop can follow
them, and along with it goes its rate, for a loop with a lag to lead by.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from airrace.model.dynamics.flight_model import FlightModel
from airrace.model.dynamics.outer_loop import FlightPathState, LoadFactors, load_factors
from airrace.model.elementary import atan2, cos, maximum, minimum, sin, sqrt
from airrace.model.environment import g0
from airrace.model.frames import QUATERNION, normalise, product, rotation
from airrace.optimal_control.problem import Iterate, Problem
from airrace.optimal_control.quantities import Scalar, T, Vector, quantity, vector
from airrace.optimal_control.system import at_points
from airrace.optimal_control.trajectory import Array, Trajectory

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


@dataclass(frozen=True, eq=False)
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
    own = {
        quantity.name: row for quantity, row in zip((*system.states, *system.controls), [*state, *control], strict=True)
    }
    rate_of = {state.name: row for state, row in zip(system.states, rates, strict=True)}
    R: list[list[Array]] = rotation([own[name] for name in QUATERNION])
    specific = (load.n_x, load.n_y, -load.n_z)
    a_N, a_E, a_D = (g0 * sum_of_products(row, specific) for row in R)
    soft_n_z, soft_p = soften(s, load.n_z), soften(s, load.p_Kbar)
    zeros = np.zeros(len(s))
    counters = {name: own.get(name, zeros) for name in ("Phi", "gain", "Phi_reset", "gain_reset")}
    histories = ReferencePoint[Array](
        **{name: own[name] for name in ("x", "y", "z", *QUATERNION, "delta_T")},
        **counters,
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


def sum_of_products(left: Sequence[Scalar], right: Sequence[Scalar]) -> Scalar:
    """Return the scalar product of two vectors."""
    return sum(a * b for a, b in zip(left, right, strict=True))


@dataclass(frozen=True)
class PathGains:
    """The gains with which errors are fed back.

    `K_p` 1/s2; `K_v`, `K_mu`, `k_t`, `K_V` 1/s; `eps` g; `along` the least and largest path rate; `bank` (by which to
    bank further) and `bank_total` rad; `n_y` g.
    """

    K_p: float = 2.0
    K_v: float = 3.0
    K_mu: float = 5.0
    k_t: float = 1.0
    K_V: float = 1.0
    eps: float = 1.0
    along: tuple[float, float] = (0.5, 1.5)
    bank: float = 1.2
    bank_total: float = 1.5
    n_y: float = 0.3


@vector
class Commands(Vector[T]):
    """The commands of the outer loop to an inner loop.

    The rates are those at which the commands will continue.
    """

    n_x: T = quantity("1", text="load factor along the velocity")
    delta_T_dot: T = quantity("1/s", text="rate of the throttle")
    n_y: T = quantity("1", text="lateral load factor")
    n_z: T = quantity("1", text="load factor")
    n_z_dot: T = quantity("1/s", text="rate of the load factor")
    p: T = quantity("rad/s", text="roll rate about the velocity")
    p_dot: T = quantity("rad/s2", text="rate of the roll rate")


@vector
class Errors(Vector[T]):
    """The deviation of the flight from its reference."""

    distance: T = quantity("m", text="distance from where the reference is")
    roll: T = quantity("rad", text="roll angle to the reference's attitude")


def path_rate(state: FlightPathState[Scalar], point: ReferencePoint[Scalar], gains: PathGains) -> Scalar:
    """Return `s'` (1), the rate of the reference's clock at which the aircraft stays abreast of the reference."""
    v = [state.V_K * row[0] for row in rotation(state.q)]
    V_ref = sqrt(sum_of_products(point.velocity, point.velocity))
    offset = _difference((state.x, state.y, state.z), point.position)
    forward = sum_of_products(v, point.velocity) / V_ref
    ahead = sum_of_products(offset, point.velocity) / V_ref
    return clip((forward + gains.k_t * ahead) / V_ref, *gains.along)


def errors(state: FlightPathState[Scalar], point: ReferencePoint[Scalar]) -> Errors[Scalar]:
    """Return distance (m) and roll angle (rad) between aircraft and reference."""
    offset = _difference((state.x, state.y, state.z), point.position)
    return Errors(distance=sqrt(sum_of_products(offset, offset)), roll=_roll_error(state.q, point.q))


def path_following(
    state: FlightPathState[Scalar], point: ReferencePoint[Scalar], gains: PathGains
) -> tuple[Commands[Scalar], Scalar]:
    """Return the commands that lead back to the reference, and the path rate `s'` (1).

    Args:
        state: of the aircraft.
        point: where the reference is at the aircraft's value of its clock.
        gains: see `PathGains`.
    """
    rate = path_rate(state, point, gains)
    force = _wanted_force(state, point, rate, gains)
    R = rotation(state.q)
    f_y, f_z = (sum_of_products([row[axis] for row in R], force) for axis in (1, 2))
    twist = _roll_error(state.q, point.q)
    n_ref = point.n_z
    across = f_y * cos(twist) + f_z * sin(twist)
    lean = clip(n_ref * (across - point.n_y) / (n_ref * n_ref + gains.eps**2), -gains.bank, gains.bank)
    e_mu = clip(twist + lean, -gains.bank_total, gains.bank_total)
    V_ref = sqrt(sum_of_products(point.velocity, point.velocity))
    faster = sum_of_products(point.velocity, point.acceleration) / V_ref
    sideways = gains.eps**2 * (f_y - point.n_y) / (f_y * f_y + f_z * f_z + gains.eps**2)
    commands = Commands(
        n_x=(rate * rate * faster + gains.K_V * (V_ref - state.V_K)) / g0 - R[2][0],
        delta_T_dot=rate * point.delta_T_dot,
        n_y=point.n_y + clip(sideways, -gains.n_y, gains.n_y),
        n_z=point.soft_n_z - point.n_z - f_z,
        n_z_dot=rate * point.soft_n_z_dot,
        p=rate * point.soft_p + gains.K_mu * e_mu,
        p_dot=rate * rate * point.soft_p_dot,
    )
    return commands, rate


def _wanted_force(
    state: FlightPathState[Scalar], point: ReferencePoint[Scalar], rate: Scalar, gains: PathGains
) -> list[Scalar]:
    """Return the wanted specific force `f_O`, g; three components."""
    beside = _across(_difference(point.position, (state.x, state.y, state.z)), point)
    drifting = _across([-state.V_K * row[0] for row in rotation(state.q)], point)
    force = [
        (rate * rate * a + gains.K_p * position + gains.K_v * velocity) / g0
        for a, position, velocity in zip(point.acceleration, beside, drifting, strict=True)
    ]
    return [force[0], force[1], force[2] - 1.0]


def _across(vector: Sequence[Scalar], point: ReferencePoint[Scalar]) -> list[Scalar]:
    """Return the part of a vector in O that lies across the reference's path."""
    v = point.velocity
    along = sum_of_products(vector, v) / sum_of_products(v, v)
    return [component - along * direction for component, direction in zip(vector, v, strict=True)]


def _roll_error(q: Sequence[Scalar], q_ref: Sequence[Scalar]) -> Scalar:
    """Return `e_t` (rad), the roll angle in the rotation from one attitude to another, the shorter way round."""
    q0, q1, q2, q3 = normalise(q)
    error = product((q0, -q1, -q2, -q3), normalise(q_ref))
    shorter = 2.0 * (error[0] >= 0.0) - 1.0
    return 2.0 * atan2(shorter * error[1], shorter * error[0])


def _difference(left: Sequence[Scalar], right: Sequence[Scalar]) -> list[Scalar]:
    return [a - b for a, b in zip(left, right, strict=True)]


def clip(value: Scalar, lower: Scalar, upper: Scalar) -> Scalar:
    """Return `value` within its limits."""
    return minimum(maximum(value, lower), upper)
