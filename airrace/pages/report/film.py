"""Films and cards: the scene of a report, drawn instant by instant by a browser; a film is put together by ffmpeg."""

import base64
import io
import itertools
import json
import math
import re
import shutil
import subprocess
import tempfile
import zipfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime
from enum import StrEnum
from fractions import Fraction
from importlib.util import find_spec
from pathlib import Path

from airrace.errors import StorageError, UsageError
from airrace.pages.report.browser import HARDWARE, SOFTWARE, browser_path, page_in_browser, values_in_browsers
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


@dataclass(frozen=True)
class FileKind:
    """How pictures become a file.

    Attributes:
        pictures: of the browser, `jpeg` or `png`; only the latter have an alpha channel.
        encoder: the arguments of ffmpeg; empty where the pictures themselves are kept.
        alpha: whether the file has an alpha channel.
        timed: whether it has a time code.
    """

    pictures: str
    encoder: tuple[str, ...]
    alpha: bool = False
    timed: bool = False


def _broadcast(pixels: str, scale: str = "") -> tuple[str, str]:
    """Return the arguments of ffmpeg for pixels of this form as television has them: BT.709 in the limited range.

    The browser's pictures are sRGB, whose primaries are the same, in the full range; their profile is left out.
    """
    labels = "setparams=range=tv:colorspace=bt709:color_primaries=bt709:color_trc=bt709"
    converted = f"scale={scale}in_range=pc:out_color_matrix=bt709:out_range=tv,format={pixels}"
    return "-vf", f"{converted},{labels},sidedata=delete:type=ICC_PROFILE"


# Two thirds of the time of `veryfast`, for 5 % more bytes and the same picture: what that looks ahead is kept.
_LOOK_AHEAD = ("-preset", "superfast", "-x264-params", "rc-lookahead=10:mbtree=1")
_H264 = ("-c:v", "libx264", *_LOOK_AHEAD, "-crf", "18", "-movflags", "+faststart")
_PRORES = ("-c:v", "prores_ks", "-profile:v", "4444", "-alpha_bits", "16", "-vendor", "apl0")
_GIF = ("-filter_complex", "split[a][b];[a]palettegen=stats_mode=diff[p];[b][p]paletteuse=dither=bayer")
KINDS = {
    ".mp4": FileKind("jpeg", (*_broadcast("yuv420p", "in_color_matrix=bt601:"), *_H264), timed=True),
    ".mov": FileKind("png", (*_broadcast("yuva444p10le"), *_PRORES), alpha=True, timed=True),
    ".zip": FileKind("png", (), alpha=True),
    ".gif": FileKind("jpeg", _GIF),
}
"""The kinds of files by their suffixes: H.264, ProRes 4444, a sequence of PNG in a ZIP archive, and GIF."""
TIME_CODE_RATES = (24, 25, 30, 48, 50, 60)
"""The pictures per second, rounded, that time codes count (SMPTE ST 12-1)."""


class FilmView(StrEnum):
    """Where a film is taken from: a view of the report."""

    TV = "tv"
    CHASE = "chase"
    COCKPIT = "cockpit"
    ORBIT = "orbit"
    ABOVE = "above"
    SIDE = "side"


class Language(StrEnum):
    """A language of films and cards, by its code in ISO 639-1."""

    EN = "en"
    DE = "de"
    FR = "fr"
    IT = "it"
    ES = "es"


def language_named(name: str) -> Language:
    """Return a language by its code.

    Raises:
        UsageError: there is none.
    """
    if name not in list(Language):
        raise UsageError(f"there is no language {name!r}; known are {', '.join(Language)}")
    return Language(name)


@dataclass(frozen=True)
class FilmSettings:
    """What a film shows.

    Attributes:
        width, height: pixels.
        fps: pictures per second.
        begin, end: of the first flight, s on its clock; None for the whole of it.
        view: where it is taken from.
        graphics_only: whether graphics are drawn alone, on nothing.
    """

    width: int
    height: int
    fps: float
    begin: float | None
    end: float | None
    view: FilmView
    graphics_only: bool = False

    @property
    def rate(self) -> Fraction:
        """Pictures per second; those of television, such as 59.94, are 1000/1001 of a whole number."""
        whole = round(self.fps)
        if abs(self.fps - whole / 1.001) < 5e-3 * (whole % 6 == 0):
            return Fraction(1000 * whole, 1001)
        return Fraction(self.fps).limit_denominator(1000)

    @property
    def tells_result(self) -> bool:
        """Whether legs are shown again and the result is told: in a film of the whole race as television shows it."""
        return self.begin is None and self.end is None and self.view is FilmView.TV

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
        count = max(math.ceil((end - begin) * self.rate - 1e-6), 1)
        return [min(begin + float(i / self.rate), duration) for i in range(count)]

    def sequel_times(self, begin: float, end: float, seconds: float) -> list[float]:
        """Return the instant of every picture of a stretch of the race that is shown again, for so many seconds."""
        count = math.ceil(seconds * self.rate - 1e-6)
        return [begin + (end - begin) * i / count for i in range(count)]


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
    graphics_only: bool = False,
) -> FilmSettings:
    """Return the settings of a film from the user's options.

    Args:
        path, view, format: the film, of a suffix in `KINDS`; one of `FilmView`; one of `SIZES`.
        size: `WIDTHxHEIGHT` in pixels, instead of a format.
        fps: pictures per second; None for 30, of a GIF 15.
        graphics_only: whether graphics are drawn alone, which takes a file with an alpha channel.
        from_, to, seconds: the piece, on the clock of the race, s; None for all of it. A length excludes an end.

    Raises:
        UsageError: an option is not valid, or Chromium or ffmpeg is not found.
    """
    suffix = path.suffix.lower()
    if suffix not in KINDS:
        raise UsageError(f"{path}: the name of a film must end in {', '.join(KINDS)}")
    if graphics_only and not KINDS[suffix].alpha:
        transparent = " or ".join(name for name, kind in KINDS.items() if kind.alpha)
        raise UsageError(f"{path}: graphics alone need a file with an alpha channel: {transparent}")
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
    if KINDS[suffix].encoder:
        ffmpeg_path()
    return FilmSettings(width, height, rate, from_, to, FilmView(view), graphics_only)


def ffmpeg_path() -> str:
    """Return the path of ffmpeg: that of `imageio-ffmpeg`, else one that is installed.

    Raises:
        UsageError: there is none.
    """
    installed = None if find_spec("imageio_ffmpeg") else shutil.which("ffmpeg")
    return installed or str(extra("imageio_ffmpeg", "a film", "film").get_ffmpeg_exe())


def film_of(
    page: str,
    settings: FilmSettings,
    suffix: str,
    watch: Callable[[int, int], None] = lambda done, total: None,
    begins: datetime | None = None,
) -> bytes:
    """Return a film, of a suffix in `KINDS`, of the scene of a report.

    Args:
        page: the report.
        settings, suffix: of the film and its file.
        watch: is called with the pictures that are drawn, and with all.
        begins: when the clock of the race starts, for the time code; None for midnight.

    Raises:
        UsageError: nothing lies between begin and end, or Chromium or ffmpeg is not found.
        StorageError: one of them fails.
    """
    kind = KINDS[suffix.lower()]
    with page_in_browser(page, FILMS, HARDWARE) as browser:
        duration, end, sequel = browser.value("[airrace.flights[0].duration, airrace.film.end, airrace.film.sequel]")
        filmed = float(end if settings.tells_result else duration)
        instants = [(time, str(settings.view)) for time in settings.times(filmed)]
        if settings.tells_result:
            for piece in sequel:
                times = settings.sequel_times(piece["from"], piece["to"], piece["seconds"])
                instants += [(time, piece["view"]) for time in times]
        size = [settings.width, settings.height, kind.pictures, settings.graphics_only]
        watch(0, len(instants))
        frames = [f"airrace.film.frame(...{json.dumps([time, view, *size])})" for time, view in instants]

        def pictures() -> Iterator[bytes]:
            held = [(frame, len(list(same))) for frame, same in itertools.groupby(frames)]
            drawn = values_in_browsers(browser, page, [frame for frame, _ in held], FILMS, HARDWARE)
            number = 0
            for text, (_, count) in zip(drawn, held, strict=True):
                yield from itertools.repeat(base64.b64decode(text), count)
                number += count
                watch(number, len(frames))

        if not kind.encoder:
            return _archive(pictures())
        arguments = list(kind.encoder)
        if kind.timed and (code := time_code(instants[0][0], settings.rate, begins)):
            arguments += ["-timecode", code]
        return _encoded(pictures(), suffix.lower(), kind.pictures, settings.rate, arguments)


def _encoded(pictures: Iterable[bytes], suffix: str, form: str, rate: Fraction, arguments: Sequence[str]) -> bytes:
    """Return pictures, `jpeg` or `png`, as ffmpeg makes a film of them."""
    with tempfile.TemporaryDirectory() as folder:
        file, output = Path(folder) / f"film{suffix}", Path(folder) / "output"
        command = [ffmpeg_path(), "-loglevel", "error", "-f", "image2pipe"]
        command += ["-c:v", {"jpeg": "mjpeg", "png": "png"}[form], "-framerate", str(rate), "-i", "-", *arguments]
        command += ["-fflags", "+bitexact", "-flags:v", "+bitexact", str(file)]
        try:
            with (
                output.open("wb") as stream,
                subprocess.Popen(command, stdin=subprocess.PIPE, stdout=stream, stderr=stream) as ffmpeg,
            ):
                assert ffmpeg.stdin is not None
                for picture in pictures:
                    _ = ffmpeg.stdin.write(picture)
            if ffmpeg.returncode == 0:
                return file.read_bytes()
        except OSError as error:
            raise StorageError(f"ffmpeg fails: {_last_line(output) or error}") from error
        raise StorageError(f"ffmpeg fails: {_last_line(output) or f'exit code {ffmpeg.returncode}'}")


def _archive(pictures: Iterable[bytes]) -> bytes:
    """Return pictures in PNG as a ZIP archive, numbered from 00000.png; the same pictures give the same bits."""
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_STORED) as archive:  # they are compressed already
        for number, picture in enumerate(pictures):
            archive.writestr(zipfile.ZipInfo(f"{number:05d}.png"), picture)
    return content.getvalue()


def time_code(time: float, rate: Fraction, begins: datetime | None = None) -> str:
    """Return the time code of a picture (SMPTE ST 12-1); empty where none counts so many pictures per second.

    It follows the clock: at 29.97 and 59.94 pictures per second numbers are dropped, which its last separator says.

    Args:
        time: on the clock of the race, s.
        rate: pictures per second.
        begins: when that clock starts; None for midnight.
    """
    nominal = round(rate)
    if nominal not in TIME_CODE_RATES or (rate != nominal and rate != Fraction(1000 * nominal, 1001)):
        return ""
    midnight = 0.0
    if begins is not None:
        midnight = (begins - begins.replace(hour=0, minute=0, second=0, microsecond=0)).total_seconds()
    number = round(Fraction(midnight + time) * rate)
    drops = rate != nominal and nominal % 30 == 0
    if drops:
        dropped = nominal // 15  # numbers at the beginning of every minute but each tenth
        tens, rest = divmod(number, 10 * (60 * nominal) - 9 * dropped)
        minutes = max(rest - dropped, 0) // (60 * nominal - dropped)
        number += dropped * (9 * tens + minutes)
    seconds, frame = divmod(number, nominal)
    hours, minutes, seconds = seconds // 3600 % 24, seconds // 60 % 60, seconds % 60
    return f"{hours:02d}:{minutes:02d}:{seconds:02d}{';' if drops else ':'}{frame:02d}"


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
