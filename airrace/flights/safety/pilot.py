"""The pilot: feedback along the optimum, sampled and late, by the optimal control model of the human operator.

Kleinman, Baron & Levison (1970, Automatica 6, 357-369) describe a trained pilot as an optimal regulator behind a time
delay, which a prediction by his own idea of the aircraft makes up for, with a cost on the rate of the stick that makes
muscles lag. So it is here. With the errors e of `nominal.py` on the clock of the line, and what the stick does besides
the optimum, v, one sample of the linearised aircraft is

    e[k+1] = F[k] e[k] + G[k] v[k]

The clock removes the error along the line, so F and G end with the projection along the flow. The Riccati recursion

    K = (R + G^T S G)^-1 G^T S F,   S = Q + F^T S (F - G K)

runs back from the finish. What is decided at k moves the stick d samples later, v[k+d] = -K[k+d] e^[k+d], where the
prediction takes e[k] through the d samples with the decisions that wait already. This is the optimum under the delay.
"""

from dataclasses import dataclass, field

import numpy as np

from airrace.flights.safety.disturbances import PILOT_DELAY
from airrace.flights.safety.nominal import ERRORS, TABLE_STEP, NominalFlight, displace, errors, instants
from airrace.flights.safety.plant import CONTROLS, DISTURBANCES, DisturbedPlant, advance
from airrace.optimal_control.trajectory import Array

SIZE = len(ERRORS)


@dataclass(frozen=True)
class PilotModel:
    """A pilot, by numbers.

    Attributes:
        sample: time between two samples, s; 50 Hz, ten times faster than any pilot corrects.
        delay: from what is seen to the stick that moves, s, a multiple of `sample`. McRuer & Jex (1967, IEEE HFE-8,
            231-249) find effective delays of 0.1 to 0.2 s, the muscles' lag among them; Kleinman, Baron & Levison
            0.15 to 0.25 s without it.
        allowed: errors that count alike, by name: m, m/s, rad (Bryson's rule). A judgement: a metre beside the line is
            as bad as 9 degrees of bank. Speed is not corrected: the throttle is full all along.
        brisk: rates of the surfaces (rad/s) and a step of the throttle that count like these errors. Surfaces then lag
            by 0.06 to 0.13 s, as muscles do (0.1 s by Kleinman, Baron & Levison); the throttle stays as in the optimum.
        urgent: distance from the line, m, beyond which it is not corrected any harder.
        end: time that errors count for at the end of the line, s.
        stall_margin: angle of attack short of the stall, rad, within which ever less is pulled to correct the path: the
            buffet warns. A judgement.
    """

    sample: float = 0.02
    delay: float = PILOT_DELAY
    allowed: dict[str, float] = field(
        default_factory=lambda: {
            "right": 1.0,
            "down": 1.0,
            "roll": 0.16,
            "pitch": 0.05,
            "yaw": 0.05,
            "beta_K": 0.05,
        }
    )
    brisk: tuple[float, ...] = (0.5, 0.5, 0.5, 1e-3)
    urgent: float = 5.0
    end: float = 1.0
    stall_margin: float = 0.05

    @property
    def waiting(self) -> int:
        """The number of samples that a decision waits."""
        return round(self.delay / self.sample)

    @property
    def state_cost(self) -> Array:
        """Q of one sample, shape (16, 16)."""
        # what is not listed may deviate by any amount
        return self.sample * np.diag([1.0 / self.allowed.get(name, np.inf) ** 2 for name in ERRORS])

    @property
    def control_cost(self) -> Array:
        """R of one sample, shape (4, 4)."""
        return self.sample * np.diag([1.0 / rate**2 for rate in self.brisk])


@dataclass(frozen=True, eq=False)
class LinearFlight:
    """An aircraft linearised along its line, sample by sample; N samples.

    Attributes:
        F: from errors to errors, shape (N, n, n).
        G: from the stick, shape (N, n, n_u).
        E: from disturbances that are held, shape (N, n, n_d).
        slip: time by which the clock gains on time, of (e, v, d), s; shape (N, n + n_u + n_d).
    """

    F: Array
    G: Array
    E: Array
    slip: Array

    @property
    def count(self) -> int:
        """The number of samples."""
        return len(self.F)


def linearise(plant: DisturbedPlant, nominal: NominalFlight, sample: float) -> LinearFlight:
    """Return the aircraft linearised by central differences of its own samples, and projected on its clock."""
    clock = instants(sample, int(nominal.end / sample))
    count, first = len(clock), clock[:-1]
    line = nominal.at(clock)
    line[4:8] /= np.linalg.norm(line[4:8], axis=0)
    begin, end = np.ascontiguousarray(line[:, :-1]), line[:, 1:]
    inputs = np.zeros((CONTROLS + DISTURBANCES, count - 1))
    rates, stick = plant.rates_of(inputs), nominal.stick(first, sample)
    widths = [*_WIDTHS, *[1e-3] * CONTROLS, *_DISTURBED]
    columns: list[Array] = []
    for place, width in enumerate(widths):
        ends: list[Array] = []
        for side in (width, -width):
            inputs[:CONTROLS], inputs[CONTROLS:], start = stick, 0.0, begin
            if place < SIZE:
                error = np.zeros((SIZE, count - 1))
                error[place] = side
                start = displace(begin, error)
            else:
                inputs[place - SIZE] += side
            ends.append(errors(advance(rates, start, sample), end))
        columns.append((ends[0] - ends[1]) / (2.0 * width))
    derivatives = np.moveaxis(np.stack(columns, axis=1), 2, 0)  # (N, 16, 16 + 4 + 6)
    flow = errors(nominal.at(clock[1:] + TABLE_STEP), end) - errors(nominal.at(clock[1:] - TABLE_STEP), end)
    flow /= 2.0 * TABLE_STEP
    slip = derivatives[:, 0] / flow[0][:, None]
    derivatives = derivatives - flow.T[:, :, None] * slip[:, None, :]
    F, G, E = np.split(derivatives, [SIZE, SIZE + CONTROLS], axis=2)
    return LinearFlight(F, G, E, slip)


_WIDTHS = (*[0.01] * 4, *[1e-4] * 3, 1e-3, *[1e-4] * 2, *[1e-3] * 3, *[1e-4] * 3)
"""The differences of errors: m, m/s, rad; rounding is 1e-10 of them or less, curvature 1e-4."""
_DISTURBED = (*[0.01] * 3, *[1e-4] * 3)


def regulator(F: Array, G: Array, Q: Array, R: Array, end: Array) -> Array:
    """Return the gains K of a finite horizon by the discrete Riccati recursion, shape (N, n_u, n).

    Args:
        F, G: of every sample, shapes (N, n, n), (N, n, n_u).
        Q, R: costs of a sample, shapes (n, n), (n_u, n_u).
        end: cost at the end, shape (n, n).
    """
    K, cost = np.empty((len(F), G.shape[2], F.shape[1])), end
    for k in range(len(F) - 1, -1, -1):
        weighed = G[k].T @ cost
        K[k] = np.linalg.solve(R + weighed @ G[k], weighed @ F[k])
        cost = Q + F[k].T @ cost @ (F[k] - G[k] @ K[k])
        cost = 0.5 * (cost + cost.T)
    return K


def predictors(F: Array, G: Array, waiting: int) -> Array:
    """Return what predicts the error `waiting` samples later from (e, the decisions that wait, the next one first).

    Shape (N, n, n + waiting n_u); behind the end nothing changes any more.
    """
    count, n = len(F), F.shape[1]
    later = np.zeros((count, n, n + waiting * G.shape[2]))
    later[:, :, :n] = np.eye(n)
    for j in range(waiting):
        rows = np.minimum(np.arange(count) + j, count - 1)
        later = np.einsum("kij,kjl->kil", F[rows], later)
        part = slice(n + j * G.shape[2], n + (j + 1) * G.shape[2])
        later[:, :, part] = later[:, :, part] + G[rows]
    return later


def delayed_gains(K: Array, later: Array, waiting: int) -> Array:
    """Return the gains L of v = L (e, what waits) that move the stick `waiting` samples later, (N, n_u, n + d n_u)."""
    rows = np.minimum(np.arange(len(K)) + waiting, len(K) - 1)
    return -K[rows] @ later


@dataclass(frozen=True, eq=False)
class PilotGains:
    """The feedback of a pilot along a line.

    Attributes:
        feedback: from errors and waiting decisions to the decision, and to the error of the angle of attack when it
            moves the stick, shape (N, 5, 16 + 4 d).
    """

    feedback: Array

    @property
    def L(self) -> Array:
        """From errors and waiting decisions to the decision, shape (N, 4, 16 + 4 d)."""
        return self.feedback[:, :CONTROLS]


def train(model: PilotModel, linear: LinearFlight) -> PilotGains:
    """Return the feedback of a pilot who knows the linearised aircraft and the line."""
    Q = model.state_cost
    K = regulator(linear.F, linear.G, Q, model.control_cost, Q * model.end / model.sample)
    later = predictors(linear.F, linear.G, model.waiting)
    alpha = later[:, [ERRORS.index("alpha_K")]]
    return PilotGains(np.concatenate([delayed_gains(K, later, model.waiting), alpha], axis=1))
