"""Errors that neighbouring samples share: offsets and slow drifts of a log, estimated from all its passings together.

The recorded position is off by `e(t)`, by axis a Gaussian process: what all samples share (a survey of the course, the
zero of the heights) and what wanders (a slow receiver, first-order Gauss-Markov),

    cov(e(t), e(u)) = o^2 + d(t) d(u) exp(-|t - u| / tau)

The pilot meant to fly through the gates. So every passing measures `e` along one direction: between `lower` and `upper`
it is legal, with a deviation of its own, and beyond costs the square of its deviations, but never more than a breach
does, for a pilot may miss a gate. With `a` for these `e`, of covariance `K`, and `r_j` for the deviations beyond,

    J(a) = a' K^-1 a / 2 + sum_j c (1 - exp(-r_j^2 / (2 c)))

Whether a passing is a breach is a likelihood ratio: by how much `J` of all others has to grow for it to be legal,

    D^2 = 2 (min J with the passing within its limits - min J without it)

With windows of no width and without breaches that is the usual test: the distance from what the others predict, over
the standard deviation of the prediction. Several logs of one course have errors of their own each, and share those of
the places of gates. `docs/flown_logs.md` derives it.
"""

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from airrace.flights.logs.quality import VERTICAL_RATIO, ReceiverAccuracy
from airrace.optimal_control.quantities import plain_number
from airrace.optimal_control.trajectory import Array

HEIGHT_OFFSET = 10.0
"""The standard deviation of an error that all heights share, where no accuracy is stated, m: geoid, QNH, the zero."""
PLACE_OFFSET = 10.0
"""That of all places, north and east, m: a course drawn on a map, or surveyed by another receiver."""
BAROMETER = 70.0
"""The standard deviation of heights by the standard atmosphere, m: of 8 hPa."""
DRIFT = 1.5
"""The standard deviation of what wanders where the log says nothing of its quality, m; heights by `VERTICAL_RATIO`."""
DRIFT_TIME = 20.0
"""The time constant of what wanders, s."""
BREACH_COST = 6.0
"""What a breach costs, the negative logarithm of its probability (1 in 400). Where one passing or another one has to be
a breach, these are 3.5 deviations, so that neither is certain; a second other one decides, by 4.9."""
GATE_DISPLACEMENT = 10.0
"""The standard deviation of the place of a gate that does not stand where the file has it, m."""
DISPLACEMENT_GAIN = 1.5 * BREACH_COST
"""The gain from which on a gate is taken to stand elsewhere: more than one breach."""
EDGE_COST = 0.25
"""What a passing along the edge of its gate costs in the mean, beyond which it is in every second log: a gate that
stands elsewhere gains as much for nothing."""
OBJECTION = 2.0
"""The number of deviations from which on a passing objects to the place of its gate; of a gate that stands elsewhere
two do."""
PLACES_EXTENT, PLACES_POINTS = 4.0, 161
"""The places of a gate that are tried, by `GATE_DISPLACEMENT`: up to so many, and their number by axis."""
OFFSET_REPORTED = 0.2
"""The offset from which on it is reported, m."""
DEVIATION_MIN = 1e-3
"""The least deviation of a passing, m."""
BREACH_SHARE = 0.1
"""The share of its weight below which a passing counts as a breach."""
STEPS, SETTLED = 50, 1e-3
"""The number of steps of an iteration at most, and the change of the cost at which it ends."""
STIFFNESS_MIN = 1e-12
"""The stiffness below which a window holds nothing, 1/m^2."""
GRID_EXTENT, GRID_POINTS = 4.0, (33, 129)
"""The offsets that are tried alone, by the deviation of the offset: up to so many, and their number by axis, of places
and of heights."""
_LIMITS = ("lower", "upper", "deviation")


@dataclass(frozen=True)
class Window:
    """What a passing measures of the errors, along one direction.

    Attributes:
        passing, gate: names of the passage and of what stands there.
        time: on the clock of the recording, s.
        direction: how the measure goes with the error, north, east and up; of a path that is slanted to the line at
            which it is measured an error along that moves the passing, too.
        lower, upper: the errors with which the passing is legal, m.
        deviation: by which it is known beside the common errors, m.
        log: of several ones that are judged together the number of its log, 0 for the log itself.
    """

    passing: str
    gate: str
    time: float
    direction: tuple[float, float, float]
    lower: float
    upper: float
    deviation: float
    log: int = 0

    @property
    def excess(self) -> float:
        """By how many deviations the passing is beyond its limits where there are no errors."""
        return max(self.lower, -self.upper, 0.0) / max(self.deviation, DEVIATION_MIN)

    @property
    def is_height(self) -> bool:
        """Whether it is one of heights, else one over ground."""
        return self.direction[2] != 0.0

    @property
    def informative(self) -> bool:
        """Whether it limits the errors at all."""
        return math.isfinite(self.deviation) and (math.isfinite(self.lower) or math.isfinite(self.upper))


@dataclass(frozen=True)
class Judgement:
    """How a passing is judged: the error at it as the others tell, m, and by how many deviations it is no legal one."""

    shift: float
    deviations: float


@dataclass(frozen=True, eq=False)
class _Fit:
    """The errors of the least cost, `K force`, and the share of its weight that every row has there."""

    cost: float
    force: Array
    share: Array


@dataclass(frozen=True)
class Displacement:
    """By how much a gate stands beside its place in the course's file.

    Attributes:
        north, east: m.
        deviation: standard deviation along that direction, m.
    """

    north: float
    east: float
    deviation: float


@dataclass(frozen=True, eq=False)
class Receiver:
    """What the errors of a log's positions are like.

    Attributes:
        time: of the samples, s, shape (n,).
        accuracy: of the receiver, at these times.
        stated: whether the user states the accuracy, which then includes offsets.
        barometric: whether heights are those of a barometer.
    """

    time: Array
    accuracy: ReceiverAccuracy
    stated: bool = False
    barometric: bool = False

    @property
    def offsets(self) -> tuple[float, float]:
        """The standard deviations of what all samples share, over ground and of heights, m."""
        place, height = (0.0, 0.0) if self.stated else (PLACE_OFFSET, HEIGHT_OFFSET)
        return place, math.hypot(height, BAROMETER if self.barometric else 0.0)

    def drift(self, time: float) -> tuple[float, float]:
        """Return the standard deviations of what wanders, over ground and of heights, m."""
        if not self.accuracy.source:
            return DRIFT, VERTICAL_RATIO * DRIFT
        across, up = (np.interp(time, self.time, values) for values in (self.accuracy.across, self.accuracy.up))
        return float(across), float(up)


class CommonErrors:
    """The errors that the samples of a log share.

    Args:
        receiver: of the log.
        windows: what the passings measure of the errors beyond the registration.
        registration: by which all samples are taken to be off, and have been moved, north, east and up, m, shape (3,).
        others: of logs over the same course, which tell with this one where its gates stand.
        displaced: the gates that stand elsewhere, by their names; None to find them.
    """

    def __init__(
        self,
        receiver: Receiver,
        windows: Sequence[Window] = (),
        registration: Array | None = None,
        *,
        others: Sequence["CommonErrors"] = (),
        displaced: Mapping[str, Displacement] | None = None,
    ) -> None:
        self._receivers: list[Receiver] = [receiver, *(other._receivers[0] for other in others)]
        self._beyond_registration = windows
        self.registration = np.zeros(3) if registration is None else registration
        self.windows = [self._in_all(window) for window in windows if window.informative]
        for number, other in enumerate(others, start=1):
            self.windows += [replace(window, log=number) for window in other.windows if window.log == 0]
        self.displaced: Mapping[str, Displacement] = {} if displaced is None else displaced
        self._evaluate()
        if displaced is None:
            self.displaced = self._displacements()

    def with_windows(self, windows: Sequence[Window], registration: Array) -> "CommonErrors":
        """Return the errors as the passings of the registered flight measure them."""
        return CommonErrors(self._receivers[0], windows, registration)

    def beside(
        self, others: Sequence["CommonErrors"], displaced: Mapping[str, Displacement] | None = None
    ) -> "CommonErrors":
        """Return the errors of this log as the passings of other logs over the same course tell them, too.

        Args:
            others: the errors of those logs.
            displaced: the gates that stand elsewhere; None to find them.
        """
        receiver, windows = self._receivers[0], self._beyond_registration
        return CommonErrors(receiver, windows, self.registration, others=others, displaced=displaced)

    def drift(self, time: float) -> tuple[float, float]:
        """Return the standard deviations of what wanders in the log, over ground and of heights, m."""
        return self._receivers[0].drift(time)

    def at(self, time: float) -> tuple[Array, Array]:
        """Return mean and covariance of the errors of the registered flight at a time, m and m^2.

        Where the limits leave the errors free an error is as likely anywhere between them; what pilots prefer, such as
        the lower edge of a gate, is common to passings.

        Returns:
            north, east and up, shapes (3,) and (3, 3).
        """
        axes = [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)]
        points = [Window("", "", time, axis, -math.inf, math.inf, 0.0) for axis in axes]
        towards = self._covariance(points, self.windows)
        gain = towards[:, self._limiting]
        covariance = self._covariance(points, points) - gain @ self._information @ gain.T
        return towards @ self._fit.force - self.registration, covariance

    @property
    def offset(self) -> Array:
        """The error in the mean over the passings, north, east and up, m, shape (3,)."""
        times = {window.time for window in self.windows if window.log == 0}
        return np.mean([self.at(time)[0] for time in times], axis=0) + self.registration if times else np.zeros(3)

    def judge(self, window: Window) -> Judgement:
        """Return how a passing, or an instant, of the registered flight is judged by all other passings."""
        if not math.isfinite(window.deviation):
            return Judgement(0.0, 0.0)
        judged, registered = self._in_all(window), float(self.registration @ window.direction)
        own = np.array(
            [(row.log, row.passing, row.is_height) == (0, window.passing, window.is_height) for row in self.windows],
            np.bool_,
        )
        rows = np.flatnonzero(~own).tolist()
        towards = self._covariance([judged], [self.windows[row] for row in rows])[0]
        without = _Fit(self._fit.cost, self._fit.force[rows], self._fit.share[rows])
        if self._fit.force[own].any():  # else the errors are the same without it
            without = self._least(rows, None, [without.share], thorough=False)
        starts, within = [without.share], without
        for thorough in (False, True):
            if thorough:
                # A search that ends too early would accuse: others may be breaches, each in turn, and all of them.
                without = min(without, self._least(rows, None, starts), key=lambda fit: fit.cost)
                pulling = np.flatnonzero(within.force[: len(rows)]).tolist()
                alone = [np.where(np.arange(len(rows)) == row, 0.0, without.share) for row in pulling]
                starts = [without.share, within.share[:-1], *alone, np.zeros(len(rows))]
            shift = float(towards @ without.force)
            if judged.lower <= shift <= judged.upper:
                return Judgement(shift - registered, 0.0)
            within = self._least(rows, judged, [np.append(share, 1.0) for share in starts], thorough=thorough)
            if within.cost < without.cost + BREACH_COST:  # no other breach explains it for less
                break
        return Judgement(shift - registered, math.sqrt(max(2.0 * (within.cost - without.cost), 0.0)))

    @property
    def remarks(self) -> tuple[str, ...]:
        """Sentences on the offsets and displacements that the passings show."""
        remarks: list[str] = []
        north, east, up = self.offset.tolist()
        if abs(up) > OFFSET_REPORTED:
            side = "high" if up > 0.0 else "low"
            remarks.append(
                f"almost all passings are about {plain_number(abs(up), 2)} m too {side}: are heights in another unit, "
                "or of another zero?"
            )
        if math.hypot(north, east) > OFFSET_REPORTED:
            remarks.append(
                f"almost all passings are about {_direction(north, east)} of the course: was it surveyed otherwise?"
            )
        if self.registration.any():
            remarks.append("the flight is moved by as much before it is judged")
        return (*remarks, *self.displacement_remarks)

    @property
    def displacement_remarks(self) -> tuple[str, ...]:
        """Sentences on the gates that seem to stand elsewhere."""
        remarks: list[str] = []
        for gate, place in self.displaced.items():
            logs = {window.log for window in self.windows if window.gate == gate}
            who = f"the passings of {len(logs)} logs" if len(logs) > 1 else "its passings"
            remarks.append(
                f"{gate} seems to stand {_direction(place.north, place.east, place.deviation)} of its place in the "
                f"course's file: so {who} agree, and so they are judged"
            )
        return tuple(remarks)

    def _in_all(self, window: Window) -> Window:
        """Return a window of the registered flight as one of all errors."""
        registered = float(self.registration @ window.direction)
        deviation = max(window.deviation, DEVIATION_MIN)
        return replace(window, lower=window.lower + registered, upper=window.upper + registered, deviation=deviation)

    def _covariance(self, rows: Sequence[Window], columns: Sequence[Window]) -> Array:
        """Return the covariance of the errors along the directions of windows, m^2."""
        (row_time, row_axes, row_drift), (column_time, column_axes, column_drift) = (
            (
                np.array([window.time for window in windows]),
                np.array([window.direction for window in windows]).reshape(-1, 3),
                np.array([self._receivers[window.log].drift(window.time) for window in windows]).reshape(-1, 2),
            )
            for windows in (rows, columns)
        )
        row_log, column_log = (np.array([window.log for window in windows], int) for windows in (rows, columns))
        same = row_log[:, None] == column_log
        offsets = np.array([receiver.offsets for receiver in self._receivers])[row_log]
        kept = np.exp(-np.abs(row_time[:, None] - column_time) / DRIFT_TIME)
        ground, height = row_axes[:, :2] @ column_axes[:, :2].T, row_axes[:, 2:] @ column_axes[:, 2:].T
        covariance = np.zeros_like(kept)
        for kind, along in enumerate((ground, height)):
            drift = row_drift[:, kind, None] * column_drift[:, kind] * kept
            covariance += along * same * (offsets[:, kind, None] ** 2 + drift)
        for gate in self.displaced:
            stands = [np.array([window.gate == gate for window in windows], float) for windows in (rows, columns)]
            covariance += GATE_DISPLACEMENT**2 * np.outer(*stands) * ground
        return covariance

    def _evaluate(self, *starts: Array) -> None:
        """Find the errors of the least cost, and what their covariance is made of; weights to start from, too."""
        self._K = self._covariance(self.windows, self.windows)
        everything = np.ones(len(self.windows))
        self._fit = self._least(list(range(len(self.windows))), None, [everything, *starts])
        self._limiting = [
            row
            for row, window in enumerate(self.windows)
            if self._fit.share[row] > BREACH_SHARE and math.isfinite(window.upper - window.lower)
        ]
        windows = [self.windows[row] for row in self._limiting]
        free = np.array([0.5 * max(window.upper - window.lower, 0.0) for window in windows])
        own = np.array([window.deviation for window in windows])
        scatter = np.diag(own**2 + free**2 / 3.0) + np.outer(free, free) / 3.0
        self._information = np.linalg.inv(self._K[np.ix_(self._limiting, self._limiting)] + scatter)

    def _displacements(self) -> dict[str, Displacement]:
        """Return by how much gates stand beside the file that several passings miss likewise, the clearest ones first.

        What a gate that stands elsewhere does to the errors of others is undone before these are looked at.
        """
        ground = [row for row, window in enumerate(self.windows) if not window.is_height]
        rows_of: dict[str, list[int]] = {}
        for row in ground:
            rows_of.setdefault(self.windows[row].gate, []).append(row)
        moved: dict[str, Displacement] = {}
        while True:
            plain, clearest = self._fit, (0.0, "", moved)
            for gate, rows in rows_of.items():
                if gate in moved or len(rows) < 2 or (plain.share[rows] == 1.0).all():
                    continue
                agreeing = plain.share.copy()
                agreeing[rows] = 1.0
                self.displaced = {**moved, gate: Displacement(0.0, 0.0, GATE_DISPLACEMENT)}
                self._evaluate(agreeing)
                gain = plain.cost - self._fit.cost - DISPLACEMENT_GAIN - EDGE_COST * len(rows)
                if gain > clearest[0] and self._objections(gate) > 1:
                    clearest = gain, gate, {**moved, gate: self._displacement(gate)}
            _, gate, moved = clearest
            self.displaced = moved
            share = plain.share.copy()
            share[rows_of.get(gate, [])] = 1.0
            self._evaluate(share)
            if not gate:
                return {name: self._displacement(name) for name in moved}

    def _objections(self, gate: str) -> int:
        """Return how many passings object to the place that a gate has in the file."""
        _, limits, mean, covariance = self._expected(gate)
        beyond = np.abs(mean - np.clip(mean, limits.lower, limits.upper))
        return int(np.count_nonzero(beyond > OBJECTION * np.sqrt(np.diag(covariance))))

    def _displacement(self, gate: str) -> Displacement:
        """Return where a gate stands: of the places from which no passing objects one is as likely as any other, but
        for what is known beforehand.
        """
        directions, limits, mean, covariance = self._expected(gate)
        line = GATE_DISPLACEMENT * np.linspace(-PLACES_EXTENT, PLACES_EXTENT, PLACES_POINTS)
        tried = np.stack([values.ravel() for values in np.meshgrid(line, line)], axis=1)
        errors = mean + tried @ directions.T
        beyond = errors - np.clip(errors, limits.lower, limits.upper)
        square = np.sum(beyond * np.linalg.solve(covariance, beyond.T).T, axis=1)
        square += np.sum((tried / GATE_DISPLACEMENT) ** 2, axis=1)
        weight = np.exp(-0.5 * (square - square.min()))
        weight /= weight.sum()
        place = weight @ tried
        along = (tried - place) @ (place / max(float(np.linalg.norm(place)), DEVIATION_MIN))
        return Displacement(float(place[0]), float(place[1]), math.sqrt(float(weight @ along**2)))

    def _expected(self, gate: str) -> tuple[Array, "_Limits", Array, Array]:
        """Return what the passings of all other gates tell of the errors at those of a gate that may stand elsewhere.

        Left out are its passings that are breaches wherever it stands.

        Returns:
            Directions over ground, shape (m, 2), limits, means, m, shape (m,), and covariance with what else they are
            known by, m^2, shape (m, m).
        """
        windows, K = self.windows, self._K
        of_gate = [row for row, window in enumerate(windows) if window.gate == gate and not window.is_height]
        rows = [row for row in of_gate if self._fit.share[row] > BREACH_SHARE] or of_gate
        others = [row for row, window in enumerate(windows) if window.gate != gate]
        limiting = [row for row in self._limiting if windows[row].gate != gate]
        places = [self._limiting.index(row) for row in limiting]
        directions = np.array([windows[row].direction[:2] for row in rows])
        limits = _Limits(*(np.array([getattr(windows[row], name) for row in rows]) for name in _LIMITS))
        mean = K[np.ix_(rows, others)] @ self._least(others, None, [self._fit.share[others]], thorough=False).force
        scatter = np.linalg.inv(self._information)[np.ix_(places, places)]
        towards = K[np.ix_(rows, limiting)]
        covariance = K[np.ix_(rows, rows)] - GATE_DISPLACEMENT**2 * directions @ directions.T
        covariance += np.diag(limits.deviation**2) - towards @ np.linalg.solve(scatter, towards.T)
        return directions, limits, mean, covariance

    def _least(
        self, rows: Sequence[int], legal: Window | None = None, starts: Sequence[Array] = (), *, thorough: bool = True
    ) -> _Fit:
        """Return the errors of the least cost that the search finds, with one more passing that is legal for certain.

        The cost of a passing is concave in the square of its deviations, so that its tangent there, weighted squares,
        is a majorant, whose minimum never costs more. The cost has many minima: the search begins with weights that
        are known, and with those of the offset that alone costs least.

        Args:
            rows: the windows that count.
            legal: the further passing, the last row of the result.
            starts: weights to start from.
            thorough: whether the weights by an offset alone are a start, too.
        """
        windows = [*(self.windows[row] for row in rows), *((legal,) if legal else ())]
        count = len(windows)
        if not count:
            return _Fit(0.0, np.zeros(0), np.zeros(0))
        K = np.empty((count, count))
        K[: len(rows), : len(rows)] = self._K[np.ix_(rows, rows)]
        if legal:
            K[-1] = K[:, -1] = self._covariance([legal], windows)[0]
        limits = _Limits(*(np.array([getattr(window, name) for window in windows]) for name in _LIMITS))
        hard = np.arange(count) == (count - 1 if legal else -1)
        best = _Fit(math.inf, np.zeros(count), np.ones(count))
        for weight in [*starts, *([self._offset_weights(windows, limits, hard)] if thorough else [])]:
            force, before = np.zeros(count), math.inf
            for _ in range(STEPS):
                force = limits.least_squares(K, weight, force)
                error = K @ force
                square = limits.square(error)
                weight = np.where(hard, 1.0, np.exp(-square / BREACH_COST))
                total = 0.5 * float(force @ error) + float(np.where(hard, square, BREACH_COST * (1.0 - weight)).sum())
                if total < best.cost:
                    best = _Fit(total, force, weight)
                if total > before - SETTLED:
                    break
                before = total
        return best

    def _offset_weights(self, windows: Sequence[Window], limits: "_Limits", hard: NDArray[np.bool_]) -> Array:
        """Return the weights with the offset that alone costs least, of all on a grid, heights and places apart."""
        axes = np.array([window.direction for window in windows])
        drift = np.array([self._receivers[window.log].drift(window.time)[int(window.is_height)] for window in windows])
        heights, logs = np.array([window.is_height for window in windows]), np.array([window.log for window in windows])
        loose, weight = replace(limits, deviation=np.hypot(limits.deviation, drift)), np.ones(len(windows))
        for (log, receiver), kind in itertools.product(enumerate(self._receivers), (0, 1)):
            of_kind = (logs == log) & (heights == bool(kind))
            deviation = math.hypot(receiver.offsets[kind], float(drift[of_kind].max(initial=0.0)))
            line = deviation * np.linspace(-GRID_EXTENT, GRID_EXTENT, GRID_POINTS[kind])
            if kind:
                offsets = np.stack([0.0 * line, 0.0 * line, line], axis=1)
            else:
                north, east = (values.ravel() for values in np.meshgrid(line, line))
                offsets = np.stack([north, east, 0.0 * north], axis=1)
            square = loose.square(offsets @ axes.T)[:, of_kind]
            paid = np.where(hard[of_kind], square, BREACH_COST * (1.0 - np.exp(-square / BREACH_COST))).sum(axis=1)
            least = int(np.argmin(paid + 0.5 * np.sum((offsets / max(deviation, DEVIATION_MIN)) ** 2, axis=1)))
            weight[of_kind] = np.where(hard[of_kind], 1.0, np.exp(-square[least] / BREACH_COST))
        return weight


@dataclass(frozen=True, eq=False)
class _Limits:
    """The limits of some windows, and their deviations, m, each of shape (n,)."""

    lower: Array
    upper: Array
    deviation: Array

    def square(self, error: Array) -> Array:
        """Return half the square of the deviations by which errors are beyond, shape (..., n)."""
        return 0.5 * ((error - np.clip(error, self.lower, self.upper)) / self.deviation) ** 2

    def least_squares(self, K: Array, weight: Array, force: Array) -> Array:
        """Return the force `f` of the least `f' K f / 2 + sum_j weight_j square_j(K f)`.

        That is convex and piecewise quadratic: Newton's method over the windows beyond whose limits the errors are,
        with exact line searches, ends after few steps.

        Args:
            K: covariance of the errors, m^2, shape (n, n).
            weight: of the windows, shape (n,).
            force: to start from, 1/m, shape (n,).
        """
        stiff = weight / self.deviation**2
        for _ in range(STEPS):
            error = K @ force
            nearest = np.clip(error, self.lower, self.upper)
            rows = np.flatnonzero((error != nearest) & (stiff > STIFFNESS_MIN))
            target = np.zeros_like(force)
            target[rows] = np.linalg.solve(K[np.ix_(rows, rows)] + np.diag(1.0 / stiff[rows]), nearest[rows])
            step = target - force
            moved = K @ step
            # The slope of the cost along the step is piecewise linear, with bends where an error meets a limit.
            with np.errstate(divide="ignore", invalid="ignore"):
                bends = np.concatenate([(self.lower - error) / moved, (self.upper - error) / moved])
            bends = np.unique([0.0, 1.0, *bends[(bends > 0.0) & (bends < 1.0)].tolist()])
            errors = error + bends[:, None] * moved
            beyond = errors - np.clip(errors, self.lower, self.upper)
            slopes = errors @ step + (stiff * beyond) @ moved
            behind = int(np.argmax(slopes >= 0.0)) if (slopes >= 0.0).any() else len(bends)
            share = 1.0
            if 0 < behind < len(bends):
                before, after = slopes[behind - 1], slopes[behind]
                share = bends[behind - 1] - before * (bends[behind] - bends[behind - 1]) / (after - before)
            elif behind == 0:
                return force
            force = force + share * step
            if share > 1.0 - 1e-9 and len(bends) == 2:  # no error has met a limit: it is the minimum
                return force
        return force


def _direction(north: float, east: float, deviation: float | None = None) -> str:
    """Return a distance in words, `6 m to the east`, or `6 +- 1 m to the east`."""
    names = ("north", "north-east", "east", "south-east", "south", "south-west", "west", "north-west")
    toward = names[round(math.atan2(east, north) / (0.25 * math.pi)) % 8]
    known = "" if deviation is None else f" +- {plain_number(deviation, 2)}"
    return f"{plain_number(math.hypot(north, east), 2)}{known} m to the {toward}"
