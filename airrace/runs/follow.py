"""A flight followed while it is flown: gap, cost to go, the next cues and the best line from every state on."""

import contextlib
import json
import math
import queue
import socket
import sys
import threading
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass

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
START_ASIDE = 60.0
"""The distance from where the optimum starts beyond which a crossing is not one of the start, m."""
START_SLANT = math.cos(math.radians(60.0))
"""The cosine of the largest angle between the path and the optimum's at the start."""

Answer = dict[str, object]
"""An answer, or a remark, as a JSON object."""


@dataclass
class Follower:
    """What is known of the flight so far.

    Attributes:
        rest: solves what is left of the race.
        cues: of the optimum.
        gates: so many gates ahead the line leads.
        begins: the time of the stream at which the start was crossed, s; NaN before.
        place: the last place, s on the optimum's clock.
        placed: the time of the stream of that, s.
        again: the time of the stream from which on a crossing of the start begins the flight, s.
        last: the time of the last state, s.
    """

    rest: CostToGo
    cues: Sequence[Cue]
    gates: int
    begins: float = math.nan
    place: float = math.nan
    placed: float = math.nan
    again: float = -math.inf
    last: float = math.nan

    def observe(self, at: float, state: Mapping[str, float]) -> None:
        """Start the clock where a state, at a time of the stream (s), comes just behind the start."""
        if at < self.last:  # the stream has started anew
            self.begins, self.again = math.nan, -math.inf
        self.last = at
        crossed = self._start_before(at, state)
        if crossed > self.again:
            self.begins = self.placed = crossed
            self.place, self.again = 0.0, math.inf

    def _start_before(self, at: float, state: Mapping[str, float]) -> float:
        """Return when the start was crossed, at most `BACK` before a state; NaN if it was not."""
        start = self.rest.state_at(0.0)
        ahead, heading = (np.array(rotation([values[name] for name in QUATERNION]))[:, 0] for values in (start, state))
        offset = np.array([state[name] - start[name] for name in "xyz"])
        slant = float(ahead @ heading)
        if slant < START_SLANT:
            return math.nan
        passed = float(ahead @ offset) / (state["V_K"] * slant)
        aside = float(np.linalg.norm(offset - passed * state["V_K"] * heading))
        return at - passed if 0.0 <= passed <= BACK and aside < START_ASIDE else math.nan

    def answer(self, session: SolverSession, at: float, state: Mapping[str, float]) -> Answer:
        """Return the answer to a state at a time of the stream, s."""
        if math.isnan(self.begins):
            return {"time_s": at, "remark": "before the start"}
        low = self.place - BACK
        high = min(self.place + at - self.placed, at - self.begins) + AHEAD
        place, leg = self._nearest(state, low, high)
        reference = self.rest.state_at(place)
        away = math.dist([state[name] for name in "xyz"], [reference[name] for name in "xyz"])
        if away > OFF_COURSE:
            self.again = min(self.again, at)
            return {"time_s": at, "remark": f"{away:.0f} m from the line: off the course"}
        self.place, self.placed = place, at
        if place >= self.rest.optimum.race_time - ROUNDING:
            self.again = min(self.again, at + BACK)  # the finish may be where the start is
            return {"time_s": at, "remark": "behind the finish"}
        rest = self.rest.solve(session, state, leg, deviations=DEVIATIONS, gates=self.gates)
        return self._answer_of(rest, at, leg, away)

    def _answer_of(self, rest: Continuation, at: float, leg: int, away: float) -> Answer:
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
            "leg_to": optimum.phases[leg].split(" -> ")[-1],
            "gap_s": round(clock - rest.time, 3),
            "away_m": round(away, 1),
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


def follow_stream(view: StageView, batches: Iterable[Sequence[bytes]], *, gates: int, every: float) -> Iterator[Answer]:
    """Yield an answer for every state that is due, and a remark for whatever is no state.

    Of messages that have waited together all are read, for derivatives and the start, and the last one is answered.

    Args:
        view: the stage by whose optimum is flown, best a point mass.
        batches: the messages of the stream that wait at a time; none where it has been silent.
        gates: so many gates ahead the line leads.
        every: the least time of the stream between two answers, s.

    Raises:
        UsageError: the stage is no optimum.
        SolverCrash: the solver process died.
    """
    rest, reader = cost_to_go_of(view), StreamReader(view.inputs.race)
    follower = Follower(rest, cues_of(view.flight()), gates)
    threads, due = available_cores(), -math.inf
    with (
        new_service(threads) as service,
        closing(SolverSession(service, view.inputs.settings, Silent(), threads)) as session,
    ):
        number = 0
        for messages in batches:
            if not messages:
                yield {"remark": f"no message for {SILENCE:g} s"}
            newest: tuple[float, dict[str, float]] | None = None
            for message in messages:
                number += 1
                try:
                    state = reader.state(message)
                except StreamError as error:
                    yield {"message": number, "remark": str(error)}
                    continue
                if state is not None:
                    follower.observe(*state)
                    newest = state
            if newest is not None and (newest[0] >= due or newest[0] < due - every):
                due = newest[0] + every
                yield follower.answer(session, *newest)


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
