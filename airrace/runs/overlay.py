"""The live graphic of a followed flight: what was heard, told with a delay to a page on the loopback address."""

import contextlib
import json
import math
import sys
import threading
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from time import monotonic
from typing import Any

import numpy as np

from airrace.errors import UsageError
from airrace.flights.results import Flight
from airrace.flights.results.derivation import table_columns
from airrace.flights.results.flight import GLOSSARY, Entrant
from airrace.model.frames import QUATERNION
from airrace.pages.report.film import Language
from airrace.pages.report.overlay_page import overlay_page
from airrace.pages.views.tables import RACE
from airrace.runs.follow import LOOPBACK, Answer, follow_stream
from airrace.runs.stage_view import StageView

LATE = 1.0
"""The time by which a state may be read late, as while a solver is busy, and still counts from when it was due, s."""
AHEAD = 0.5
"""The time by which the clock runs on beyond the last state, s."""
Clock = Callable[[], float]
_PLACE_AND_MOTION = ("x", "y", "z", "V_K", *QUATERNION)


@dataclass(frozen=True)
class Heard:
    """A state: when the aircraft was there by the clock of this machine and by that of the stream, s; what is shown.

    `clock` is that of the race, s, NaN before the start; `passings` are those of its flight, see `Follower`.
    """

    moment: float
    at: float
    clock: float
    values: Mapping[str, float]
    passings: Sequence[float]


_NOTHING = Heard(math.inf, math.nan, math.nan, {}, ())


class Overlay:
    """What was heard of a flight.

    Attributes:
        page: HTML, see `overlay_page`.
        delay: by which all is shown later than it was heard, s.
    """

    def __init__(
        self, flights: Sequence[Flight], entrant: Entrant, language: Language, delay: float, now: Clock = monotonic
    ) -> None:
        """Take flights as `overlay_page` does, the first that of the followed optimum, and a clock, s."""
        self.page, self._name = overlay_page(flights, entrant, language)
        self.delay = delay
        self._now = now
        self._indicated = table_columns(flights[0].race, _PLACE_AND_MOTION)[GLOSSARY["V_I"]]
        self._crossings = flights[0].crossings
        self._heard = deque[Heard]()
        self._lock = threading.Lock()

    def hear(self, at: float, clock: float, state: Mapping[str, float], passings: Sequence[float]) -> None:
        """Take a state as `follow_stream` calls it."""
        now = self._now()
        moment = now
        if self._heard:
            due = self._heard[-1].moment + at - self._heard[-1].at
            moment = due if now - LATE < due < now else now
        speed = float(self._indicated({name: np.array([state[name]]) for name in _PLACE_AND_MOTION})[0])
        values = {"V_I": speed * RACE.per_m_s, "height": -state["z"] * RACE.per_m, "n_z": state["n_z"]}
        with self._lock:
            self._heard.append(Heard(moment, at, clock, values, passings))
            self._forget(now)

    def _forget(self, now: float) -> None:
        while len(self._heard) > 1 and self._heard[1].moment <= now - self.delay:
            self._heard.popleft()

    def state(self) -> dict[str, object]:
        """Return what is shown now, as JSON; `age` is the time since what is shown was heard, s."""
        now = self._now()
        with self._lock:
            self._forget(now)
            last = self._heard[0] if self._heard else _NOTHING
        age = now - self.delay - last.moment
        if age < 0.0:
            last, age = _NOTHING, 0.0
        clock = last.clock + min(age, AHEAD)
        made = [passing if passing <= clock else None for passing in tuple(last.passings)]  # none where one was missed
        times = [*made, *[None] * (len(self._crossings) - len(made))]
        passings = [
            {"name": crossing.passage.element.name, "lap": crossing.lap, "number": number, "time": passed}
            for number, (crossing, passed) in enumerate(zip(self._crossings, times, strict=True))
        ]
        known = None if math.isnan(clock) else clock
        shown = {"page": self._name, "clock": known, "age": age, "values": last.values}
        return {**shown, "passings": passings, "race_time": times[-1]}


class _Server(ThreadingHTTPServer):
    daemon_threads = True
    overlay: Overlay

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Leave a page alone that has gone away."""
        if not isinstance(sys.exception(), ConnectionError):
            super().handle_error(request, client_address)


class _Handler(BaseHTTPRequestHandler):
    def do_GET(self) -> None:
        assert isinstance(self.server, _Server)
        port, path = self.server.server_port, self.path.partition("?")[0]
        status, kind, body = HTTPStatus.NOT_FOUND, "text/plain", "nothing here; the page is /"
        if self.headers.get("Host") not in (f"{LOOPBACK}:{port}", f"localhost:{port}"):
            status, body = HTTPStatus.MISDIRECTED_REQUEST, "another host than the overlay's"
        elif path == "/":
            status, kind, body = HTTPStatus.OK, "text/html; charset=utf-8", self.server.overlay.page
        elif path == "/state":
            status, kind, body = HTTPStatus.OK, "application/json", json.dumps(self.server.overlay.state())
        content = body.encode()
        self.send_response(status)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(content)))
        self.send_header("Cache-Control", "no-store")
        self.end_headers()
        self.wfile.write(content)

    def log_message(self, format: str, *args: object) -> None:
        """Say nothing of requests."""


@contextlib.contextmanager
def served(overlay: Overlay, port: int) -> Generator[str]:
    """Serve an overlay at a port of the loopback address as long as the context lasts; give the address of its page.

    Args:
        overlay, port: what is served; 0 for a port that is free.

    Raises:
        UsageError: the port is taken.
    """
    try:
        server = _Server((LOOPBACK, port), _Handler)
    except OSError as error:
        raise UsageError(f"port {port} of {LOOPBACK} cannot be used: {error.strerror}; choose another") from None
    server.overlay = overlay
    threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.05}, daemon=True).start()
    try:
        yield f"http://{LOOPBACK}:{server.server_port}/"
    finally:
        server.shutdown()
        server.server_close()


def follow_with_overlay(
    overlay: Overlay, port: int, view: StageView, batches: Iterable[Sequence[bytes]], *, gates: int, every: float
) -> Iterator[Answer]:
    """Yield where the overlay is served, then the answers of `follow_stream`, whose errors and arguments these are."""
    with served(overlay, port) as address:
        yield {"remark": f"overlay at {address}"}
        yield from follow_stream(view, batches, gates=gates, every=every, heard=overlay.hear)
