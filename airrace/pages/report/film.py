"""Films and cards: the scene of a report, drawn instant by instant by a browser; a film is put together by ffmpeg."""

import base64
import json
import math
import re
import shutil
import subprocess
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from importlib.util import find_spec
from pathlib import Path

from airrace.errors import StorageError, UsageError
from airrace.pages.report.browser import HARDWARE, SOFTWARE, browser_path, page_in_browser
from airrace.runtime.resources import extra
from airrace.runtime.standard_streams import STANDARD

CARD_SIZE = (1200, 630)
"""Pixels of a card: what messengers and social media show of a link in full width (Open Graph)."""
FINISH_HOLD = 1.5
"""The time for which the last picture of a whole race is held, s."""
SIZES = {"16:9": (1280, 720), "9:16": (720, 1280), "1:1": (960, 960)}
"""Pixels of a film by its format; a GIF, which would be too large for a message, has half of them either way."""
PIXELS_MIN, PIXELS_MAX = 160, 3840
RATE_MIN, RATE_MAX = 1.0, 120.0
"""The range of pictures per second."""
FILMS, CARDS = "films are drawn", "cards are drawn"
ENCODERS = {
    ".mp4": ("-c:v", "libx264", "-crf", "23", "-pix_fmt", "yuv420p", "-movflags", "+faststart"),
    ".gif": ("-filter_complex", "split[a][b];[a]palettegen=stats_mode=diff[p];[b][p]paletteuse=dither=bayer"),
}
"""The arguments of ffmpeg by the kind of the file."""


class FilmView(StrEnum):
    """Where a film is taken from: a view of the report."""

    TV = "tv"
    CHASE = "chase"
    COCKPIT = "cockpit"
    ORBIT = "orbit"
    ABOVE = "above"
    SIDE = "side"


@dataclass(frozen=True)
class FilmSettings:
    """What a film shows.

    Attributes:
        width, height: pixels.
        fps: pictures per second.
        begin, end: of the first flight, s on its clock; None for the whole of it.
        view: where it is taken from.
    """

    width: int
    height: int
    fps: float
    begin: float | None
    end: float | None
    view: FilmView

    def times(self, duration: float) -> list[float]:
        """Return the instant of every picture of a flight of a duration (s); its finish is held for a moment.

        Raises:
            UsageError: nothing lies between begin and end, or the end lies beyond that moment.
        """
        begin, last = self.begin or 0.0, duration + FINISH_HOLD
        end = last if self.end is None else self.end
        if not 0.0 <= begin < min(end, duration):
            raise UsageError(
                f"from {begin:g} s to {end:.4g} s there is nothing to film of a flight of {duration:.3f} s"
            )
        if end > last + 1e-9:
            raise UsageError(
                f"a film up to {end:g} s is longer than the flight of {duration:.3f} s, "
                f"whose finish is held up to {last:.3f} s"
            )
        return [min(begin + i / self.fps, duration) for i in range(max(math.ceil((end - begin) * self.fps - 1e-6), 1))]


def film_settings(
    path: Path,
    *,
    view: str = "tv",
    format: str = "16:9",
    size: str | None = None,
    fps: float | None = None,
    from_: float | None = None,
    to: float | None = None,
    seconds: float | None = None,
) -> FilmSettings:
    """Return the settings of a film from the user's options.

    Args:
        path, view, format: the film, `.mp4` or `.gif`; one of `FilmView`; one of `SIZES`.
        size: `WIDTHxHEIGHT` in pixels, instead of a format.
        fps: pictures per second; None for 30, of a GIF 15.
        from_, to, seconds: the piece, on the clock of the race, s; None for all of it. A length excludes an end.

    Raises:
        UsageError: an option is not valid, or Chromium or ffmpeg is not found.
    """
    suffix = path.suffix.lower()
    if suffix not in ENCODERS:
        raise UsageError(f"{path}: the name of a film must end in {' or '.join(ENCODERS)}")
    if view not in list(FilmView):
        raise UsageError(f"there is no view {view!r}; known are {', '.join(FilmView)}")
    if format not in SIZES:
        raise UsageError(f"there is no format {format!r}; known are {', '.join(SIZES)}, or a size such as 1920x1080")
    width, height = SIZES[format]
    rate = 30.0
    if suffix == ".gif":
        width, height, rate = width // 2, height // 2, 15.0
    if size is not None:
        match = re.fullmatch(r"(\d{1,5})x(\d{1,5})", size)
        width, height = map(int, match.groups()) if match else (0, 0)
        if not all(PIXELS_MIN <= pixels <= PIXELS_MAX and pixels % 2 == 0 for pixels in (width, height)):
            raise UsageError(
                f"{size} is no size: expected even numbers, {PIXELS_MIN} to {PIXELS_MAX}, such as 1920x1080"
            )
    if fps is not None:
        rate = fps
    if not RATE_MIN <= rate <= RATE_MAX:
        raise UsageError(f"{rate:g} pictures per second: the rate must lie between {RATE_MIN:g} and {RATE_MAX:g}")
    if seconds is not None:
        if to is not None:
            raise UsageError("the end and the seconds of a film exclude each other")
        if not seconds > 0.0:
            raise UsageError(f"a film of {seconds:g} s shows nothing")
        to = (from_ or 0.0) + seconds
    browser_path(FILMS, "")
    ffmpeg_path()
    return FilmSettings(width, height, rate, from_, to, FilmView(view))


def ffmpeg_path() -> str:
    """Return the path of ffmpeg: that of `imageio-ffmpeg`, else one that is installed.

    Raises:
        UsageError: there is none.
    """
    installed = None if find_spec("imageio_ffmpeg") else shutil.which("ffmpeg")
    return installed or str(extra("imageio_ffmpeg", "a film", "film").get_ffmpeg_exe())


def film_of(page: str, settings: FilmSettings, suffix: str, watch: Callable[[float], None] = lambda _: None) -> bytes:
    """Return a film, `.mp4` or `.gif`, of the scene of a report; `watch` is called with the share that is done.

    Raises:
        UsageError: nothing lies between begin and end, or Chromium or ffmpeg is not found.
        StorageError: one of them fails.
    """
    with (
        tempfile.TemporaryDirectory() as folder,
        page_in_browser(page, FILMS, HARDWARE) as browser,
    ):
        times = settings.times(float(browser.value("airrace.flights[0].duration")))
        file = Path(folder) / f"film{suffix.lower()}"
        command = [ffmpeg_path(), "-loglevel", "error", "-f", "image2pipe", "-c:v", "mjpeg"]
        command += ["-framerate", f"{settings.fps:g}", "-i", "-", *ENCODERS[suffix.lower()]]
        command += ["-fflags", "+bitexact", "-flags:v", "+bitexact", str(file)]
        output = Path(folder) / "output"
        try:
            with (
                output.open("wb") as stream,
                subprocess.Popen(command, stdin=subprocess.PIPE, stdout=stream, stderr=stream) as ffmpeg,
            ):
                assert ffmpeg.stdin is not None
                for number, time in enumerate(times, start=1):
                    frame = json.dumps([time, settings.view, settings.width, settings.height])
                    _ = ffmpeg.stdin.write(base64.b64decode(browser.value(f"airrace.film.frame(...{frame})")))
                    watch(number / len(times))
            if ffmpeg.returncode == 0:
                return file.read_bytes()
        except OSError as error:
            raise StorageError(f"ffmpeg fails: {_last_line(output) or error}") from error
        raise StorageError(f"ffmpeg fails: {_last_line(output) or f'exit code {ffmpeg.returncode}'}")


def ensure_card(path: Path) -> None:
    """Check whether a card can be drawn into a file of this name; stdout takes PNG.

    Raises:
        UsageError: the name does not end in .png, or Chromium is not found.
    """
    if path != STANDARD and path.suffix.lower() != ".png":
        raise UsageError(f"{path}: the name of a card must end in .png")
    browser_path(CARDS, "")


def card_of(page: str) -> bytes:
    """Return a card of the flights of a report as PNG, bit by bit the same for the same report.

    Raises:
        UsageError: Chromium is not found.
        StorageError: it fails.
    """
    with page_in_browser(page, CARDS, SOFTWARE) as browser:
        return base64.b64decode(browser.value(f"airrace.film.card({CARD_SIZE[0]}, {CARD_SIZE[1]})"))


def _last_line(path: Path) -> str:
    return (path.read_text(errors="replace").strip().splitlines() or [""])[-1] if path.exists() else ""
