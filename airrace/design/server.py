"""The server of the designer: one page and its state, for users of this machine with the token.

A request is refused unless it names this server as its host, the token in its path and, where it changes something,
this server as its origin: no page of another origin, nor a name that leads here, reaches the state.
"""

import asyncio
import json
import secrets
import socket
import webbrowser
from collections.abc import Callable
from pathlib import Path

import uvicorn
from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route
from starlette.types import ASGIApp, Receive, Scope, Send

from airrace.design.designer import PICTURE_MAX, Designer
from airrace.design.pieces import GROUPS
from airrace.design.track_file import ChangedOnDisk, StaleRevision
from airrace.errors import AirraceError, Finding, InputError

FOLDER = Path(__file__).parent
LOOPBACK = "127.0.0.1"
KINDS = {".js": "text/javascript", ".css": "text/css", ".html": "text/html"}
HEADERS = {
    "Content-Security-Policy": "default-src 'self'; img-src 'self' data:; style-src 'self' 'unsafe-inline'; "
    "frame-ancestors 'none'; base-uri 'none'; form-action 'none'",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "Cache-Control": "no-store",
    "Cross-Origin-Resource-Policy": "same-origin",
}
SCENE_POLICY = "frame-ancestors 'self'"
"""Of the page of the scene, which states by itself that it loads nothing."""


MESSAGE_MAX = 256 * 1024
"""The largest message of a page, bytes; a layout of hundreds of corners has a tenth of it."""
STATE_TIMEOUT, STATE_POLL_INTERVAL = 20.0, 0.02
"""The time for which a page waits for another state, and between two looks for it, s."""
FILE_PATH, FILE_KIND = "file", "application/octet-stream"
"""Where a file for the ground below the course is sent, and as what: no other site may without being asked."""
TOKEN_BYTES = 24
REASON_MAX = 1000
"""The longest reason of a refusal, characters."""


class _Guard:
    """What stands before all routes: host, token, origin, kind and size of what is sent."""

    def __init__(self, app: ASGIApp, hosts: tuple[str, ...], token: str) -> None:
        self._app, self._hosts, self._token = app, hosts, token

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        refusal = self._refusal(Request(scope))
        await (refusal or self._app)(scope, receive, send)

    def _refusal(self, request: Request) -> Response | None:
        """Return the answer to a request that is refused; None if it may pass."""
        headers = request.headers
        if headers.get("host", "") not in self._hosts:
            return _refusal(421, "this is another host than the designer's")
        token = request.url.path.split("/")[1]
        if not secrets.compare_digest(token.encode(), self._token.encode()):
            return _refusal(403, "the token in the address is missing or wrong; take the address that was printed")
        origin = headers.get("origin")
        if origin is not None and origin not in {f"http://{host}" for host in self._hosts}:
            return _refusal(403, "another origin may not use the designer")
        if headers.get("sec-fetch-site", "none") not in ("same-origin", "none"):
            return _refusal(403, "another site may not use the designer")
        if request.method == "POST":
            if origin is None:
                return _refusal(403, "a change needs an origin")
            is_file = request.url.path == f"/{self._token}/{FILE_PATH}"
            kind, size_max = (FILE_KIND, PICTURE_MAX) if is_file else ("application/json", MESSAGE_MAX)
            if headers.get("content-type", "").partition(";")[0] != kind:
                return _refusal(415, f"what is sent here is {kind}")
            length = headers.get("content-length", "")
            if not length.isdecimal():
                return _refusal(411, "a message needs its length (Content-Length)")
            if int(length) > size_max:
                return _refusal(413, f"at most {size_max} bytes are taken here")
        return None


def _reason(finding: Finding) -> str:
    """Return a fault of the course, with pieces named as they are drawn: without the group of the file."""
    group, _, name = finding.key.partition(".")
    key = name if group in GROUPS and name else finding.key
    return f"{key}: {finding.message}" if key else finding.message


def _refusal(status: int, text: str) -> Response:
    text = f"{text:.{REASON_MAX}}".encode(
        errors="replace"
    ).decode()  # it may quote what was sent, half a character even
    return JSONResponse({"error": text}, status, headers=HEADERS)


def application(designer: Designer, hosts: tuple[str, ...], token: str, is_stopping: Callable[[], bool]) -> ASGIApp:
    """Return the application that serves a designer to requests with one of the hosts and the token."""

    async def asset(request: Request) -> Response:
        path = FOLDER / (request.path_params["path"] or "page.html")
        if path not in {FOLDER / "page.html", *FOLDER.glob("script/*.js"), *FOLDER.glob("style/*.css")}:
            return _refusal(404, "there is no such file")
        return Response(path.read_bytes(), media_type=KINDS[path.suffix], headers=HEADERS)

    async def state(request: Request) -> Response:
        """Answer as soon as the state is not of the version that the page has."""
        since, left = request.query_params.get("since", ""), STATE_TIMEOUT
        while str(designer.version) == since and left > 0.0 and not is_stopping():
            await asyncio.sleep(STATE_POLL_INTERVAL)
            left -= STATE_POLL_INTERVAL
        return JSONResponse(await run_in_threadpool(designer.state), headers=HEADERS)

    async def act(request: Request) -> Response:
        try:
            answer = await run_in_threadpool(
                designer.do, request.path_params["action"], json.loads(await request.body())
            )
        except (ValueError, RecursionError):
            return _refusal(400, "the message is no JSON")
        except ChangedOnDisk as error:
            return JSONResponse({"error": str(error), "digest": error.digest}, 409, headers=HEADERS)
        except StaleRevision as error:
            return _refusal(409, str(error))
        except InputError as error:
            findings = error.findings[:5]
            return _refusal(422, "; ".join(map(_reason, findings)))
        except AirraceError as error:
            return _refusal(422, str(error))
        return JSONResponse(answer, headers=HEADERS)

    async def add_file(request: Request) -> Response:
        try:
            await run_in_threadpool(designer.add_file, request.query_params.get("name", ""), await request.body())
        except InputError as error:
            return _refusal(422, "; ".join(map(_reason, error.findings[:5])))
        except AirraceError as error:
            return _refusal(422, str(error))
        return JSONResponse({"version": designer.version}, headers=HEADERS)

    async def picture(request: Request) -> Response:
        try:
            content, kind = await run_in_threadpool(designer.picture)
        except (AirraceError, OSError) as error:
            return _refusal(404, str(error))
        return Response(content, media_type=kind, headers=HEADERS)

    async def scene(request: Request) -> Response:
        try:
            page = await run_in_threadpool(designer.scene)
        except AirraceError as error:
            return _refusal(404, str(error))
        return Response(page, media_type="text/html", headers=HEADERS | {"Content-Security-Policy": SCENE_POLICY})

    routes = [
        Route(f"/{token}/state", state),
        Route(f"/{token}/picture", picture),
        Route(f"/{token}/{FILE_PATH}", add_file, methods=["POST"]),
        Route(f"/{token}/scene", scene),
        Route(f"/{token}/do/{{action}}", act, methods=["POST"]),
        Route(f"/{token}/{{path:path}}", asset),
    ]
    return _Guard(Starlette(routes=routes), hosts, token)


class DesignServer:
    """A server on the loopback address, listening from the start.

    Attributes:
        address: of the page, with its token.
    """

    def __init__(self, designer: Designer, port: int = 0) -> None:
        """Take a port; 0 for that of a designer that was killed, with its token, or for one that is free.

        Raises:
            OSError: the port is taken.
        """
        left = designer.address_file
        token = secrets.token_urlsafe(TOKEN_BYTES)
        try:
            self._socket = socket.create_server((LOOPBACK, port or left.port))
        except OSError:
            if port or not left.port:
                raise
            self._socket = socket.create_server((LOOPBACK, 0))
        port = self._socket.getsockname()[1]
        if port == left.port:
            token = left.token
        left.write(port, token)
        self.address = f"http://{LOOPBACK}:{port}/{token}/"
        hosts = (f"{LOOPBACK}:{port}", f"localhost:{port}")
        app = application(designer, hosts, token, lambda: self._server.should_exit)
        config = uvicorn.Config(
            app, log_config=None, access_log=False, lifespan="off", ws="none", timeout_graceful_shutdown=1
        )
        self._server = uvicorn.Server(config)

    def run(self, *, browser: bool) -> None:
        """Serve until Ctrl-C or `stop`; open the page in a browser if that is wanted."""
        if browser:
            webbrowser.open(self.address)
        self._server.run(sockets=[self._socket])

    def stop(self) -> None:
        """End the server, from any thread."""
        self._server.should_exit = True
