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
from airrace.report.browser import HARDWARE, SOFTWARE, browser_path, page_in_browser
from airrace.resources import extra
from airrace.standard_streams import STANDARD


@dataclass(frozen=True)
class FilmDefaults:
    """Sizes and times of films.

    Attributes:
        card: pixels of a card: what messengers and social media show of a link in full width (Open Graph).
        hold: the time that the last picture of a whole race is held, s.
        gif_share: of that, those of a GIF, which would be too large for a message.
        rates: the least and the largest rate of pictures, 1/s.
    """

    card: tuple[int, int] = (1200, 630)
    hold: float = 1.5
    gif_share: float = 0.5
    rates: tuple[float, float] = (1.0, 120.0)


FILM = FilmDefaults()
SIZES = {"16:9": (1280, 720), "9:16": (720, 1280), "1:1": (960, 960)}
"""Pixels of a film by its format."""
FILMS, CARDS = "films are drawn", "cards are drawn"
SMALLEST, LARGEST = 160, 3840
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
        begin, last = 0.0 if self.begin is None else self.begin, duration + FILM.hold
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
    """Return the settings of a film by the words of its user, when all that it needs is installed.

    Args:
        path, view, format: the film, `.mp4` or `.gif`; one of `FilmView`; one of `SIZES`.
        size: `WIDTHxHEIGHT` in pixels, instead of a format.
        fps: pictures per second; None for 30, of a GIF 15.
        from_, to, seconds: the piece, on the clock of the race, s; None for all of it. A length excludes an end.

    Raises:
        UsageError: an argument says nothing sensible, or Chromium or ffmpeg is not found.
    """
    suffix = path.suffix.lower()
    if suffix not in ENCODERS:
        raise UsageError(f"{path}: the name of a film must end in {' or '.join(ENCODERS)}")
    if view not in list(FilmView):
        raise UsageError(f"there is no view {view!r}; known are {', '.join(FilmView)}")
    if format not in SIZES:
        raise UsageError(f"there is no format {format!r}; known are {', '.join(SIZES)}, or a size such as 1920x1080")
    share = FILM.gif_share if suffix == ".gif" else 1.0
    width, height = (2 * round(share * pixels / 2) for pixels in SIZES[format])
    if size is not None:
        found = re.fullmatch(r"(\d{1,5})x(\d{1,5})", size)
        width, height = map(int, found.groups()) if found else (0, 0)
        if not all(SMALLEST <= pixels <= LARGEST and pixels % 2 == 0 for pixels in (width, height)):
            raise UsageError(f"{size} is no size: expected even numbers, {SMALLEST} to {LARGEST}, such as 1920x1080")
    rate = fps if fps is not None else (15.0 if suffix == ".gif" else 30.0)
    if not FILM.rates[0] <= rate <= FILM.rates[1]:
        raise UsageError(
            f"{rate:g} pictures per second: the rate must lie between {FILM.rates[0]:g} and {FILM.rates[1]:g}"
        )
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
    """Return a film of the scene of a report.

    Args:
        page, settings, suffix: the report, see `film_settings`, `.mp4` or `.gif`.
        watch: called after every picture with the share that is done.

    Raises:
        UsageError: nothing lies between begin and end, or Chromium or ffmpeg is not found.
        StorageError: one of them fails.
    """
    with (
        tempfile.TemporaryDirectory() as folder,
        page_in_browser(page, FILMS, HARDWARE) as shown,
    ):
        times = settings.times(float(shown.value("airrace.flights[0].duration")))
        file = Path(folder) / f"film{suffix.lower()}"
        command = [ffmpeg_path(), "-loglevel", "error", "-f", "image2pipe", "-c:v", "mjpeg"]
        command += ["-framerate", f"{settings.fps:g}", "-i", "-", *ENCODERS[suffix.lower()]]
        command += ["-fflags", "+bitexact", "-flags:v", "+bitexact", str(file)]
        complaints = Path(folder) / "complaints"
        try:
            with (
                complaints.open("wb") as said,
                subprocess.Popen(command, stdin=subprocess.PIPE, stdout=said, stderr=said) as ffmpeg,
            ):
                assert ffmpeg.stdin is not None
                for number, time in enumerate(times, start=1):
                    frame = json.dumps([time, settings.view, settings.width, settings.height])
                    _ = ffmpeg.stdin.write(base64.b64decode(shown.value(f"airrace.film.frame(...{frame})")))
                    watch(number / len(times))
            if ffmpeg.returncode == 0:
                return file.read_bytes()
        except OSError as error:
            raise StorageError(f"ffmpeg fails: {_last_line(complaints) or error}") from error
        raise StorageError(f"ffmpeg fails: {_last_line(complaints) or f'exit code {ffmpeg.returncode}'}")


def ensure_card(path: Path) -> None:
    """Find out now whether a card can be drawn into a file of this name; stdout takes PNG.

    Raises:
        UsageError: the name says no PNG, or Chromium is not found.
    """
    if path != STANDARD and path.suffix.lower() != ".png":
        raise UsageError(f"{path}: the name of a card must end in .png")
    browser_path(CARDS, "")


def card_of(page: str) -> bytes:
    """Return a card of the first flight of a report as PNG, of `FILM.card` pixels; the same bits for the same report.

    Raises:
        UsageError: Chromium is not found.
        StorageError: it fails.
    """
    with page_in_browser(page, CARDS, SOFTWARE) as shown:
        return base64.b64decode(shown.value(f"airrace.film.card({FILM.card[0]}, {FILM.card[1]})"))


def _last_line(path: Path) -> str:
    return (path.read_text(errors="replace").strip().splitlines() or [""])[-1] if path.exists() else ""
