"""A flight followed while it is flown: gap, cost to go, the next cues and the best line from every state on."""

import contextlib
import json
import math
import queue
import socket
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import closing
from copy import copy
from dataclasses import dataclass, field, replace

import numpy as np

from airrace.errors import UsageError
from airrace.flights.logs.stream import StreamError, StreamReader
from airrace.flights.results import Flight
from airrace.flights.results.cues import Cue, cues_of
from airrace.model.frames import QUATERNION, rotation
from airrace.pages.views.cue_tables import cue_text
from airrace.procedure.cost_to_go import Continuation, CostToGo, new_service
from airrace.procedure.result import Silent
from airrace.procedure.solver_session import SolverSession
from airrace.runs.cost_to_go import cost_to_go_of
from airrace.runs.stage_view import StageView
from airrace.runtime.process import available_cores

LOOPBACK = "127.0.0.1"
MESSAGE_MAX = 65536
"""The largest datagram, bytes."""
LINES_MAX = 1000
"""The lines that wait, then whoever sends them waits, too; and the datagrams that are read at a time."""
WAITING_MAX = 2**20
"""The memory for datagrams that wait while a flight is solved, bytes; the system may allow less."""
SILENCE = 2.0
"""The time without a message after which a remark says so, s."""
DEVIATIONS = {"x": 2.0, "y": 2.0, "z": 2.0, "V_K": 1.0, "q0": 0.03, "q1": 0.03, "q2": 0.03, "q3": 0.03, "n_z": 0.3}
"""How well states of a stream are known: that of a receiver with derived velocities."""
BACK, AHEAD = 1.0, 4.0
"""The times on the optimum's clock, behind and beyond where an aircraft would be, between which it is looked for, s."""
LINE_STEP = 0.25
"""The time between two places of the line, s."""
CUES_MAX = 2
"""The number of cues ahead that an answer holds."""
OFF_COURSE = 300.0
"""The distance from the optimum beyond which no guidance is given, m."""
ROUNDING = 1e-6
"""The time by which the last place may miss the race time, s."""
GATE_ASIDE = 60.0
"""The distance from where the optimum passes a gate beyond which a crossing is not one of the gate, m."""
GATE_SLANT = math.cos(math.radians(75.0))
"""The cosine of the largest angle between the path and the axis of a gate, or the optimum's path there."""
MISSED_MAX = 2
"""The largest number of gates in a row that may be missed."""
QUICKEST = 0.5
"""The share of the optimum's time from gate to gate below which a passing is one of another lap."""

Answer = dict[str, object]
"""An answer, or a remark, as a JSON object."""


@dataclass
class Follower:
    """What is known of the flight so far.

    Attributes:
        rest: solves what is left of the race.
        cues: of the optimum.
        gates: so many gates ahead the line leads.
        courses: of the axes along which the gates are passed, rad; None where a gate has none, empty for all of them.
        begins: the time of the stream at which the start was crossed, s; NaN before.
        place: the last place, s on the optimum's clock.
        placed: the time of the stream of that, s.
        leg: the leg of that, from 0.
        away: the distance of the last state from the optimum, m.
        remark: why the last state gets no guidance; empty where it gets some.
        passings: when the gates so far were passed, the start first, s on the clock of the race, NaN where one was
            missed; another list for another flight.
        again: the time of the stream from which on a crossing of the start begins the flight, s.
        last: the time of the last state, s.
    """

    rest: CostToGo
    cues: Sequence[Cue]
    gates: int
    courses: Sequence[float | None] = ()
    begins: float = math.nan
    place: float = math.nan
    placed: float = math.nan
    leg: int = 0
    away: float = math.nan
    remark: str = ""
    passings: list[float] = field(default_factory=list[float])
    again: float = -math.inf
    last: float = math.nan

    def observe(self, at: float, state: Mapping[str, float]) -> None:
        """Start the clock where a state, at a time of the stream (s), comes just behind the start; find its place."""
        if at < self.last:  # the stream has started anew
            self.begins, self.again = math.nan, -math.inf
        self.last = at
        crossed = self._crossed_before(at, state, 0)
        if crossed > self.again:
            self.begins = self.placed = crossed
            self.place, self.again, self.passings = 0.0, math.inf, [0.0]
        if self.passings:
            self._note_passing(at, state)
        self.remark = self._locate(at, state)

    def _crossed_before(self, at: float, state: Mapping[str, float], gate: int) -> float:
        """Return when a gate, counted from the start as 0, was crossed, at most `BACK` before a state; NaN if not."""
        optimum = self.rest.state_at(self._gates[gate])
        ahead, heading = (
            np.array(rotation([values[name] for name in QUATERNION]))[:, 0] for values in (optimum, state)
        )
        if self.courses and (course := self.courses[gate]) is not None:
            ahead = np.array([math.cos(course), math.sin(course), 0.0])
        offset = np.array([state[name] - optimum[name] for name in "xyz"])
        slant = float(ahead @ heading)
        if slant < GATE_SLANT:
            return math.nan
        passed = float(ahead @ offset) / (state["V_K"] * slant)
        aside = float(np.linalg.norm(offset - passed * state["V_K"] * heading))
        return at - passed if 0.0 <= passed <= BACK and aside < GATE_ASIDE else math.nan

    def _locate(self, at: float, state: Mapping[str, float]) -> str:
        """Find the place of a state; return the remark on it."""
        if math.isnan(self.begins):
            return "before the start"
        low = max(self.place, self._last_passing[1]) - BACK
        high = min(self.place + at - self.placed, at - self.begins) + AHEAD
        place, leg = self._nearest(state, low, high)
        reference = self.rest.state_at(place)
        self.away = math.dist([state[name] for name in "xyz"], [reference[name] for name in "xyz"])
        if self.away > OFF_COURSE:
            self.again = min(self.again, at)
            return f"{self.away:.0f} m from the line: off the course"
        is_behind = place >= self.rest.optimum.race_time - ROUNDING or len(self.passings) == len(self._gates)
        if is_behind:
            self.again = min(self.again, at + BACK)  # the finish may be where the start is
        self.place, self.placed, self.leg = place, at, leg
        return "behind the finish" if is_behind else ""

    def _note_passing(self, at: float, state: Mapping[str, float]) -> None:
        """Note the passing of the next gate that a state comes just behind; those before it may have been missed."""
        number, (before, place) = len(self.passings), self._last_passing
        for gate in range(number, min(number + 1 + MISSED_MAX, len(self._gates))):
            clock = self._crossed_before(at, state, gate) - self.begins
            if clock - before > QUICKEST * (self._gates[gate] - place):
                self.passings += [*[math.nan] * (gate - number), clock]
                return

    @property
    def _gates(self) -> list[float]:
        """The passings of the optimum, s."""
        optimum = self.rest.optimum
        return optimum.time[optimum.first_node].tolist()

    @property
    def _last_passing(self) -> tuple[float, float]:
        """The clock at the last passing that was not missed, and that of the optimum there, s."""
        return next(
            pair for pair in reversed([*zip(self.passings, self._gates, strict=False)]) if math.isfinite(pair[0])
        )

    def answer(self, session: SolverSession, at: float, state: Mapping[str, float]) -> Answer:
        """Return the answer to the state that was observed last, at a time of the stream, s."""
        if self.remark:
            return {"time_s": at, "remark": self.remark}
        rest = self.rest.solve(session, state, self.leg, deviations=DEVIATIONS, gates=self.gates)
        return self._answer_of(rest, at)

    def _answer_of(self, rest: Continuation, at: float) -> Answer:
        optimum, clock = self.rest.optimum, at - self.begins
        ahead = [cue for cue in self.cues if cue.time > rest.time][:CUES_MAX]
        line = rest.trajectory
        times = np.append(np.arange(0.0, float(line.time[-1]), LINE_STEP), line.time[-1])
        x, y, z = (np.interp(times, line.time, line[name]) for name in "xyz")
        places = np.round(np.stack([times, x, y, -z], axis=1), 2).tolist()
        cues = [{"do": cue_text(cue), "in_s": round(cue.time - rest.time, 2)} for cue in ahead]
        return {
            "time_s": at,
            "race_clock_s": round(clock, 3),
            "leg_to": optimum.phases[self.leg].split(" -> ")[-1],
            "gap_s": round(clock - rest.time, 3),
            "away_m": round(self.away, 1),
            "cost_to_go_s": round(rest.cost, 3),
            "best_race_time_s": round(clock + rest.cost, 3),
            "lost_s": round(clock + rest.cost - optimum.race_time, 3),
            "cues": cues,
            "line": places,
            "remark": rest.text or None,
        }

    def _nearest(self, state: Mapping[str, float], low: float, high: float) -> tuple[float, int]:
        """Return the place on the optimum's clock that is nearest to a state, within a range, and its leg."""
        optimum = self.rest.optimum
        ends = optimum.time[optimum.first_node]
        best = (math.inf, 0.0, 0)
        for leg in range(len(ends) - 1):
            if ends[leg + 1] < low or ends[leg] > high:
                continue
            place = min(max(self.rest.time_of(state, leg), low), high)
            reference = self.rest.state_at(place)
            apart = math.dist([state[name] for name in "xyz"], [reference[name] for name in "xyz"])
            best = min(best, (apart, place, leg))
        return best[1], best[2]


Heard = Callable[[float, float, Mapping[str, float], Sequence[float]], None]
"""What is called with a time of the stream, that of the race (s, NaN before the start), the state and `passings`."""


@dataclass(frozen=True)
class Observed:
    """What messages say that have waited together: remarks, and the last state with its time and what is known then."""

    remarks: Sequence[Answer]
    last: tuple[Follower, float, Mapping[str, float]] | None


def follow_stream(
    view: StageView, batches: Iterable[Sequence[bytes]], *, gates: int, every: float, heard: Heard | None = None
) -> Iterator[Answer]:
    """Yield an answer for every state that is due, and a remark for whatever is no state.

    Of messages that have waited together all are read, for derivatives and the start, and the last one is answered.

    Args:
        view: the stage by whose optimum is flown, best a point mass.
        batches: the messages of the stream that wait at a time; none where it has been silent.
        gates: so many gates ahead the line leads.
        every: the least time of the stream between two answers, s.
        heard: is called with every state, in a thread that reads on while an answer is solved.

    Raises:
        UsageError: the stage is no optimum.
        SolverCrash: the solver process died.
    """
    passages = [crossing.passage for crossing in view.flight().crossings]
    courses = [passage.element.course(passage.direction) if passage.element.directed else None for passage in passages]
    follower = Follower(cost_to_go_of(view), cues_of(view.flight()), gates, courses)
    observed = _observed(follower, StreamReader(view.inputs.race), batches, heard)
    threads, due = available_cores(), -math.inf
    with (
        new_service(threads) as service,
        closing(SolverSession(service, view.inputs.settings, Silent(), threads)) as session,
    ):
        for batch in observed if heard is None else _observed_meanwhile(observed):
            yield from batch.remarks
            if batch.last is not None:
                known, at, state = batch.last
                if at >= due or at < due - every:
                    due = at + every
                    yield known.answer(session, at, state)


def _observed(
    follower: Follower, reader: StreamReader, batches: Iterable[Sequence[bytes]], heard: Heard | None
) -> Iterator[Observed]:
    number = 0
    for messages in batches:
        remarks: list[Answer] = [] if messages else [{"remark": f"no message for {SILENCE:g} s"}]
        last = None
        for message in messages:
            number += 1
            try:
                state = reader.state(message)
            except StreamError as error:
                remarks.append({"message": number, "remark": str(error)})
                continue
            if state is not None:
                follower.observe(*state)
                last = (copy(follower), *state)
                if heard is not None:
                    heard(state[0], state[0] - follower.begins, state[1], follower.passings)
        yield Observed(remarks, last)


def _observed_meanwhile(observed: Iterator[Observed]) -> Iterator[Observed]:
    """Yield what is observed in a thread that waits for nobody; of states that wait only the last one is left."""
    waiting, ended = queue.SimpleQueue[Observed | BaseException | None](), threading.Event()

    def observe() -> None:
        try:
            for batch in observed:
                waiting.put(batch)
                if ended.is_set():
                    return
            waiting.put(None)
        except BaseException as error:  # raised where it is read
            waiting.put(error)

    threading.Thread(target=observe, daemon=True).start()
    try:
        while (batch := waiting.get()) is not None:
            if isinstance(batch, BaseException):
                raise batch
            yield batch if waiting.empty() else replace(batch, last=None)
    finally:
        ended.set()


def standard_input() -> Iterator[list[bytes]]:
    """Yield the lines of standard input one by one, and nothing in a list whenever it has been silent."""
    lines: queue.Queue[bytes] = queue.Queue(LINES_MAX)

    def read() -> None:
        for line in iter(lambda: sys.stdin.buffer.readline(MESSAGE_MAX), b""):
            lines.put(line)
        lines.put(b"")

    threading.Thread(target=read, daemon=True).start()
    while True:
        try:
            line = lines.get(timeout=SILENCE)
        except queue.Empty:
            yield []
            continue
        if not line:
            return
        yield [line]


def udp_port(port: int) -> Iterator[list[bytes]]:
    """Yield the datagrams that wait at a port of the loopback address, the oldest first; none after a silence.

    Raises:
        UsageError: the port is taken.
    """
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, WAITING_MAX)
        try:
            receiver.bind((LOOPBACK, port))
        except OSError as error:
            raise UsageError(f"port {port} of {LOOPBACK} cannot be read: {error.strerror}; choose another") from None
        while True:
            receiver.settimeout(SILENCE)
            messages: list[bytes] = []
            with contextlib.suppress(TimeoutError, BlockingIOError):
                messages.append(receiver.recv(MESSAGE_MAX))
                receiver.setblocking(False)
                while len(messages) < LINES_MAX:
                    messages.append(receiver.recv(MESSAGE_MAX))
            yield messages


def replayed(flight: Flight, *, every: float, speed: float) -> Iterator[list[bytes]]:
    """Yield the states of a flight as JSON lines, one by one.

    Args:
        flight: that is replayed.
        every: time between two states, s.
        speed: as many times as fast as it was flown; 0 for without a pause.
    """
    begun = time.monotonic()
    sampled = flight.at(np.arange(float(flight.time[0]), float(flight.time[-1]), every))
    ahead, bank = rotation([sampled[name] for name in QUATERNION]), np.degrees(sampled["mu"])
    for row, at in enumerate(sampled.time.tolist()):
        if speed > 0.0:
            time.sleep(max(0.0, begun + (at - float(flight.time[0])) / speed - time.monotonic()))
        velocity = [float(sampled["V_K"][row] * component[0][row]) for component in ahead]
        state = {
            "time_s": at,
            **{name: float(sampled[key][row]) for name, key in (("x_m", "x"), ("y_m", "y"), ("height_m", "height"))},
            "north_m_s": velocity[0],
            "east_m_s": velocity[1],
            "up_m_s": -velocity[2],
            "bank_deg": float(bank[row]),
            "n_z": float(sampled.values("n_z")[row]),
        }
        yield [json.dumps(state).encode()]
