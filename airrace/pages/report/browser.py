"""A Chromium that is installed: pages printed to PDF, and a page asked by the DevTools protocol over two pipes.

https://chromedevtools.github.io/devtools-protocol: messages are JSON, each ended by a null byte; the browser reads them
from descriptor 3 and answers on descriptor 4.
"""

import contextlib
import json
import os
import queue
import shutil
import signal
import subprocess
import tempfile
import time
from collections import deque
from collections.abc import Generator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

from airrace.errors import StorageError, UsageError
from airrace.runtime.process import available_cores

BROWSERS = (
    *("chromium", "chromium-browser", "google-chrome", "google-chrome-stable"),
    *("chrome", "microsoft-edge", "microsoft-edge-stable", "msedge"),
)
"""The names under which Chromium and its relatives lie on the path."""
PATIENCE = 120.0
"""The time that a browser has for one answer, s: the first picture takes seconds where the processor draws it."""
PRINTING = 180.0
"""The time that it has to print, s."""
BROWSERS_MAX = 4
"""The largest number of browsers that share the work: each takes some hundred megabytes."""
WORTH_A_BROWSER = 20
"""The number of pictures from which on a browser is worth its start."""
SOFTWARE = ("--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist")
"""Pictures are drawn by the processor: their bits are then the same on every machine with this browser."""
HARDWARE = ("--enable-unsafe-swiftshader", "--ignore-gpu-blocklist")
"""They are drawn by the graphics card, where there is one."""
ABOVE_STANDARD = 10
"""A descriptor above those that the browser is given."""


def browser_path(what: str = "a PDF is printed", instead: str = "write .html and print that from any browser") -> str:
    """Return the path of a browser that prints and draws.

    Args:
        what, instead: what is done by it, and what there is to do without it, clauses; the latter may be empty.

    Raises:
        UsageError: there is none.
    """
    browser = next((path for name in BROWSERS if (path := shutil.which(name))), None)
    if browser is None:
        raise UsageError(
            f"{what} by Chromium, which is not found on the path (chromium, google-chrome, msedge): install it"
            + f", or {instead}" * bool(instead)
        )
    return browser


def switches(folder: Path) -> list[str]:
    """Return the switches that a browser without a window needs; `folder` takes its profile."""
    root = getattr(os, "geteuid", lambda: 1)() == 0  # has to do without the sandbox; pages run no script but their own
    return ["--headless", "--no-first-run", f"--user-data-dir={folder / 'profile'}", *["--no-sandbox"] * root]


class Page:
    """A page of airrace in a browser."""

    def __init__(self, requests: int, answers: int) -> None:
        self._requests = requests
        self._answers = answers
        self._received = b""
        self._number = 0
        self._session: dict[str, str] = {}

    def open(self, address: str) -> None:
        """Open a page, and wait until its script has begun.

        Raises:
            StorageError: the browser does not answer, or cannot draw in space.
        """
        target = self._call("Target.createTarget", url="about:blank")["targetId"]
        self._session = {"sessionId": self._call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]}
        self._call("Page.enable")
        self._call("Page.navigate", url=address)
        begun, state = time.monotonic(), ""
        while "ready" not in state and time.monotonic() - begun < PATIENCE:
            time.sleep(0.05)
            state = str(self.value("document.documentElement ? document.documentElement.className : ''"))
        if "ready" not in state or "flat" in state:
            raise StorageError("Chromium draws nothing in space (no WebGL), so there are no pictures of the scene")

    def value(self, expression: str) -> Any:  # Any: whatever the program returns, as JSON
        """Return the value of a program in the page.

        Raises:
            StorageError: the browser does not answer, or the program fails.
        """
        answer = self._call("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in answer:
            raise StorageError(f"the page fails: {answer['exceptionDetails'].get('exception', {}).get('description')}")
        return answer["result"].get("value")

    def _call(self, method: str, **arguments: object) -> Any:  # Any: as above
        self._number += 1
        message = {"id": self._number, "method": method, "params": arguments, **self._session}
        try:
            os.write(self._requests, json.dumps(message).encode() + b"\0")
            while True:
                answer = json.loads(self._message())
                if answer.get("id") == self._number:
                    break
        except OSError as error:
            raise StorageError(f"Chromium has ended: {error}") from error
        if "error" in answer:
            raise StorageError(f"Chromium refuses {method}: {answer['error'].get('message')}")
        return answer["result"]

    def _message(self) -> bytes:
        while b"\0" not in self._received:
            import select  # which Windows has for sockets alone

            if not select.select([self._answers], [], [], PATIENCE)[0]:
                raise StorageError(f"Chromium has not answered for {PATIENCE:g} s")
            part = os.read(self._answers, 1 << 20)
            if not part:
                raise StorageError("Chromium has ended")
            self._received += part
        message, _, self._received = self._received.partition(b"\0")
        return message


@contextlib.contextmanager
def page_in_browser(page: str, what: str, drawn_by: tuple[str, ...]) -> Generator[Page]:
    """Open a page of HTML in a browser without a window, which ends with the context.

    Args:
        page, what, drawn_by: the HTML; what is done by the browser, a clause; `SOFTWARE` or `HARDWARE`.

    Raises:
        UsageError: there is no browser, or the system has no pipes for it.
        StorageError: it does not answer, or draws nothing in space.
    """
    browser = browser_path(what, "")
    if not hasattr(os, "posix_spawn"):
        raise UsageError(f"{what} by Chromium over pipes, which this system does not have (Windows); use WSL")
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as name:
        folder = Path(name)
        html = folder / "page.html"
        html.write_text(page, encoding="utf-8", errors="replace")
        command = [browser, "--remote-debugging-pipe", "--force-device-scale-factor=1", *switches(folder), *drawn_by]
        theirs, requests = _pipe()
        answers, their_answers = _pipe()
        environment = {**os.environ, "TMPDIR": name}  # where it leaves folders of its own when it is killed
        nowhere = [(os.POSIX_SPAWN_OPEN, number, os.devnull, os.O_RDWR, 0) for number in (0, 1, 2)]
        file_actions = [(os.POSIX_SPAWN_DUP2, theirs, 3), (os.POSIX_SPAWN_DUP2, their_answers, 4)]
        try:
            process = os.posix_spawn(browser, command, environment, file_actions=[*nowhere, *file_actions], setpgroup=0)
        except OSError as error:
            raise StorageError(f"{browser} does not start: {error.strerror}") from error
        finally:
            os.close(theirs)
            os.close(their_answers)
        try:
            browser_page = Page(requests, answers)
            browser_page.open(html.as_uri())
            yield browser_page
        finally:
            os.close(requests)
            os.close(answers)
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process, signal.SIGKILL)
            os.waitpid(process, 0)


def values_in_browsers(
    first: Page, page: str, expressions: Sequence[str], what: str, drawn_by: tuple[str, ...]
) -> Generator[Any]:  # Any: as of `Page.value`
    """Yield the values of programs in a page, in their order; several browsers share the work.

    Args:
        first: a browser in which the page is open.
        page, what, drawn_by: as of `page_in_browser`, for the other ones.
        expressions: the programs, none of which depends on another.

    Raises:
        UsageError, StorageError: as of `page_in_browser` and `Page.value`.
    """
    count = max(1, min(available_cores(), BROWSERS_MAX, len(expressions) // WORTH_A_BROWSER))
    idle = queue.SimpleQueue[Page]()

    def value(expression: str) -> Any:  # Any: as above
        browser = idle.get()
        try:
            return browser.value(expression)
        finally:
            idle.put(browser)

    def open_another() -> None:
        idle.put(browsers.enter_context(page_in_browser(page, what, drawn_by)))

    with contextlib.ExitStack() as browsers, ThreadPoolExecutor(count) as threads:
        idle.put(first)
        opening = [threads.submit(open_another) for _ in range(count - 1)]  # while the first one draws already
        waiting = deque[Future[Any]]()
        try:
            for expression in expressions:
                waiting.append(threads.submit(value, expression))
                if len(waiting) > 2 * count:  # no picture is drawn long before it is taken
                    yield waiting.popleft().result()
            while waiting:
                yield waiting.popleft().result()
            for opened in opening:
                opened.result()
        finally:
            threads.shutdown(cancel_futures=True)


def _pipe() -> tuple[int, int]:
    """Return a pipe's end to read from and its end to write to, clear of the descriptors that are given on."""
    import fcntl

    ends = os.pipe()
    moved = [fcntl.fcntl(end, fcntl.F_DUPFD_CLOEXEC, ABOVE_STANDARD) for end in ends]
    for end in ends:
        os.close(end)
    return moved[0], moved[1]


def print_pdf(page: str) -> bytes:
    """Return a page of HTML as PDF.

    Raises:
        UsageError: there is no browser.
        StorageError: it did not print.
    """
    browser = browser_path()
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as name:
        folder = Path(name)
        html, pdf = folder / "page.html", folder / "page.pdf"
        html.write_text(page, encoding="utf-8", errors="replace")
        command = [browser, *switches(folder), "--disable-gpu"]
        command += ["--no-pdf-header-footer", f"--print-to-pdf={pdf}", html.as_uri()]
        try:
            environment = {**os.environ, "TMPDIR": name}  # where it leaves folders of its own when it is killed
            ran = subprocess.run(command, capture_output=True, timeout=PRINTING, check=False, env=environment)
            lines = ran.stderr.decode(errors="replace").strip().splitlines()[-1:]
        except (OSError, subprocess.TimeoutExpired) as error:
            lines = [str(error)]
        if not pdf.exists():
            raise StorageError(
                f"{browser} did not print ({' '.join(lines)}); write .html and print that from a browser"
            )
        return pdf.read_bytes()
