"""Films and cards: what their words mean, what is missing, and that the same flight gives the same pictures."""

import base64
import contextlib
import importlib
import io
import itertools
import os
import re
import shutil
import struct
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Generator
from datetime import UTC, datetime
from fractions import Fraction
from pathlib import Path
from time import sleep
from typing import Any

import numpy as np
import pytest
from browser_pages import Opened, browser_path
from example_flights import half_cuban
from PIL import Image, ImageSequence

from airrace.cli.main import app
from airrace.errors import StorageError, UsageError
from airrace.pages.report import browser, film
from airrace.pages.report.browser import page_in_browser, print_pdf
from airrace.pages.report.film import (
    FINISH_HOLD,
    FilmSettings,
    FilmView,
    ensure_card,
    ffmpeg_path,
    film_settings,
    time_code,
)

MP4, GIF = Path("race.mp4"), Path("race.gif")


@pytest.fixture
def installed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Everything that a film needs, which is not touched."""
    monkeypatch.setattr(film, "browser_path", lambda *_: "chromium")
    monkeypatch.setattr(film, "ffmpeg_path", lambda: "ffmpeg")


@pytest.mark.usefixtures("installed")
def test_a_film_has_the_pixels_and_the_rate_of_its_format() -> None:
    def of(path: Path, **words: Any) -> tuple[int, int, float]:  # Any: words of many types
        one = film_settings(path, **words)
        return one.width, one.height, one.fps

    assert of(MP4) == (1280, 720, 30.0)
    assert of(MP4, format="9:16", fps=25.0) == (720, 1280, 25.0)
    assert of(GIF) == (640, 360, 15.0)
    assert of(Path("RACE.GIF"), size="320x240") == (320, 240, 15.0)


@pytest.mark.usefixtures("installed")
@pytest.mark.parametrize(
    ("path", "words", "told"),
    [
        ("race.avi", {}, r".mp4, .mov, .zip, .gif"),
        ("race", {}, r".mp4, .mov, .zip, .gif"),
        ("race.mp4", {"graphics_only": True}, r"alpha channel: .mov or .zip"),
        ("race.mp4", {"format": "4:3"}, "16:9, 9:16, 1:1"),
        ("race.mp4", {"view": "seat"}, "tv, chase, cockpit"),
        ("race.mp4", {"size": "1280"}, "1920x1080"),
        ("race.mp4", {"size": "1281x720"}, "even"),
        ("race.mp4", {"size": "99999x720"}, "even"),
        ("race.mp4", {"fps": 0.0}, "between 1 and 120"),
        ("race.mp4", {"fps": float("nan")}, "between 1 and 120"),
        ("race.mp4", {"to": 3.0, "seconds": 2.0}, "exclude"),
        ("race.mp4", {"seconds": 0.0}, "nothing"),
    ],
)
def test_words_that_make_no_film_are_refused_with_what_would_be_right(
    path: str, words: dict[str, Any], told: str
) -> None:
    with pytest.raises(UsageError, match=told):
        film_settings(Path(path), **words)


def settings(begin: float | None = None, end: float | None = None, fps: float = 30.0) -> FilmSettings:
    return FilmSettings(1280, 720, fps, begin, end, FilmView.TV)


@pytest.mark.parametrize("fps", [15.0, 24.0, 30.0, 59.94])
def test_pictures_lie_a_frame_apart_and_the_finish_is_held(fps: float) -> None:
    times = settings(fps=fps).times(10.0)
    flown = [time for time in times if time < 10.0]
    assert times[0] == 0.0
    assert np.diff(flown) == pytest.approx(float(1 / settings(fps=fps).rate))
    assert times[-1] == 10.0
    assert len(times) / fps == pytest.approx(10.0 + FINISH_HOLD, abs=1.0 / fps)


@pytest.mark.parametrize(
    ("fps", "rate"),
    [(59.94, Fraction(60000, 1001)), (29.97, Fraction(30000, 1001)), (23.976, Fraction(24000, 1001)), (50.0, 50)],
)
def test_rates_of_television_are_exact(fps: float, rate: Fraction) -> None:
    assert settings(fps=fps).rate == rate


@pytest.mark.parametrize("fps", [25.0, 59.94])
def test_a_stretch_is_shown_again_from_its_begin_to_its_end_for_as_long_as_was_asked_for(fps: float) -> None:
    times = settings(fps=fps).sequel_times(20.0, 22.5, 6.25)
    assert times[0] == 20.0
    assert np.diff(times) == pytest.approx(0.4 / float(settings(fps=fps).rate), rel=5e-3)
    assert 22.5 - 0.41 / fps <= times[-1] < 22.5
    assert set(settings(fps=fps).sequel_times(50.0, 50.0, 2.0)) == {50.0}


@pytest.mark.parametrize(
    ("words", "again"),
    [({}, True), ({"from_": 2.0}, False), ({"to": 9.0}, False), ({"view": "chase"}, False)],
)
@pytest.mark.usefixtures("installed")
def test_only_a_whole_race_as_television_shows_it_ends_with_replays_and_the_result(
    words: dict[str, Any], again: bool
) -> None:
    assert film_settings(MP4, **words).tells_result is again


NOON = datetime(2026, 11, 29, 12, 30, 15, 500_000, tzinfo=UTC)


@pytest.mark.parametrize(
    ("time", "rate", "begins", "code"),
    [
        (0.0, Fraction(50), None, "00:00:00:00"),
        (61.5, Fraction(50), None, "00:01:01:25"),
        (1.0, Fraction(50), NOON, "12:30:16:25"),
        (60.06, Fraction(60000, 1001), None, "00:01:00;04"),  # number 3600: the first four of the minute are dropped
        (600.6, Fraction(60000, 1001), None, "00:10:00;36"),
        (0.0, Fraction(25, 2), None, ""),
    ],
)
def test_a_time_code_is_that_of_the_clock(time: float, rate: Fraction, begins: datetime | None, code: str) -> None:
    assert time_code(time, rate, begins) == code


def test_a_time_code_that_drops_numbers_counts_up_and_never_strays_from_the_clock() -> None:
    rate, before = Fraction(60000, 1001), ""
    for number in itertools.chain(range(3590, 3610), range(35950, 35975), range(5_178_790, 5_178_815)):
        code = time_code(float(number / rate), rate)
        hours, minutes, rest = code.split(":")
        seconds, frame = rest.split(";")
        assert code > before
        assert not (seconds == "00" and int(minutes) % 10 and int(frame) < 4)
        on_code = 3600 * int(hours) + 60 * int(minutes) + int(seconds) + int(frame) / 60.0
        assert on_code == pytest.approx(float(number / rate), abs=0.1)
        before = code


class Slow:
    """A browser that answers with what it is asked, the later the sooner."""

    def value(self, expression: str) -> str:
        sleep(0.02 / (1 + int(expression)))
        if expression == "71":
            raise StorageError("the page fails")
        return expression


@pytest.mark.parametrize("count", [1, 5, 70])
def test_several_browsers_answer_in_the_order_in_which_they_were_asked(
    monkeypatch: pytest.MonkeyPatch, count: int
) -> None:
    opened: list[Slow] = []

    @contextlib.contextmanager
    def open_page(*_: object) -> Generator[Slow]:
        opened.append(Slow())
        yield opened[-1]

    monkeypatch.setattr(browser, "page_in_browser", open_page)
    monkeypatch.setattr(browser, "available_cores", lambda: 3)
    asked = [str(number) for number in range(count)]
    assert list(browser.values_in_browsers(Slow(), "", asked, "", ())) == asked  # pyright: ignore[reportArgumentType]
    assert len(opened) == (2 if count == 70 else 0)
    with pytest.raises(StorageError, match="the page fails"):
        list(browser.values_in_browsers(Slow(), "", [*asked, "71", "72"], "", ()))  # pyright: ignore[reportArgumentType]


def test_a_piece_of_a_race_is_as_long_as_was_asked_for() -> None:
    times = settings(2.0, 4.0, 25.0).times(10.0)
    assert len(times) == 50
    assert (times[0], times[-1]) == pytest.approx((2.0, 3.96))


@pytest.mark.parametrize(("begin", "end"), [(5.0, 5.0), (5.0, 4.0), (10.0, 12.0), (-1.0, 5.0), (float("nan"), None)])
def test_a_piece_that_holds_nothing_is_refused(begin: float, end: float | None) -> None:
    with pytest.raises(UsageError, match=r"10\.000 s"):
        settings(begin, end).times(10.0)


@pytest.mark.parametrize(("begin", "end"), [(None, 3600.0), (9.0, 12.0), (None, float("inf")), (None, 11.51)])
def test_a_film_that_goes_on_behind_the_finish_is_refused_with_the_last_instant(
    begin: float | None, end: float
) -> None:
    with pytest.raises(UsageError, match=r"longer than the flight of 10\.000 s, .* up to 11\.500 s"):
        settings(begin, end).times(10.0)


def test_the_end_of_a_film_may_be_that_of_the_whole_one() -> None:
    assert settings(None, 10.0 + FINISH_HOLD).times(10.0) == settings().times(10.0)


@pytest.mark.usefixtures("installed")
def test_a_film_without_end_is_refused_when_the_flight_is_known() -> None:
    with pytest.raises(UsageError, match="up to inf s"):
        film_settings(MP4, seconds=float("inf")).times(10.0)


def test_without_a_browser_or_ffmpeg_one_sentence_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shutil, "which", lambda _: None)
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(UsageError, match="films are drawn by Chromium, which is not found on the path"):
        film_settings(MP4)
    with pytest.raises(UsageError, match="cards are drawn by Chromium"):
        ensure_card(Path("card.png"))
    with pytest.raises(UsageError, match=r"pip install 'airrace\[film\]'"):
        ffmpeg_path()


def test_tests_of_pages_are_skipped_without_a_browser_and_fail_where_one_is_required(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(shutil, "which", lambda _: None)
    monkeypatch.delenv("AIRRACE_TEST_BROWSER", raising=False)
    with pytest.raises(pytest.skip.Exception, match="no browser is installed"):
        browser_path()
    monkeypatch.setenv("AIRRACE_TEST_BROWSER", "required")
    with pytest.raises(pytest.fail.Exception, match="no browser is installed"):
        browser_path()


def test_a_card_is_a_png() -> None:
    with pytest.raises(UsageError, match=r"must end in \.png"):
        ensure_card(Path("card.jpg"))


@pytest.mark.parametrize("script", ["exit 1", "sleep 60"])
def test_a_browser_that_ends_or_says_nothing_is_reported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, script: str
) -> None:
    broken = tmp_path / "chromium"
    broken.write_text(f"#!/bin/sh\n{script}\n", encoding="utf-8")
    broken.chmod(0o755)
    monkeypatch.setattr(browser, "browser_path", lambda *_: str(broken))
    monkeypatch.setattr(browser, "PATIENCE", 0.3)
    with pytest.raises(StorageError, match="Chromium has"), page_in_browser("<html></html>", "", ()):
        pass


LITTERING = """#!/bin/sh
touch "$TMPDIR/org.chromium.Chromium.abc"
for word; do case $word in --print-to-pdf=*) echo %PDF > "${word#--print-to-pdf=}"; esac; done
"""
"""A browser that leaves something in the folder for temporary files, and prints."""


def test_a_browser_leaves_nothing_in_the_folder_for_temporary_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    broken, temporary = tmp_path / "chromium", tmp_path / "temporary"
    broken.write_text(LITTERING, encoding="utf-8")
    broken.chmod(0o755)
    temporary.mkdir()
    monkeypatch.setenv("TMPDIR", str(temporary))
    monkeypatch.setattr(tempfile, "tempdir", None)  # which remembers the folder of before
    monkeypatch.setattr(browser, "browser_path", lambda *_: str(broken))
    assert print_pdf("<p>words</p>") == b"%PDF\n"
    with pytest.raises(StorageError, match="Chromium has"), page_in_browser("<html></html>", "", ()):
        pass
    assert os.listdir(temporary) == []


@pytest.mark.slow
def test_the_card_of_a_flight_is_the_same_in_every_bit(tmp_path: Path) -> None:
    browser_path()
    one, two = (half_cuban().card(tmp_path / name) for name in ("one.png", "two.png"))
    content = one.read_bytes()
    assert struct.unpack(">II", content[16:24]) == (1200, 630)
    assert content == two.read_bytes()
    with Image.open(one) as picture:
        assert len(picture.convert("RGB").getcolors(1 << 24)) > 5_000


@pytest.mark.slow
@pytest.mark.representative
def test_a_film_has_every_picture_and_none_twice(tmp_path: Path) -> None:
    browser_path()
    ffmpeg_path()
    (path, again) = (
        half_cuban().film(tmp_path / name, size="320x180", fps=10, from_=1.0, seconds=0.8, view="chase")
        for name in ("one.gif", "two.gif")
    )
    assert path.read_bytes() == again.read_bytes()
    with Image.open(path) as moving:
        pictures = [np.asarray(one.convert("RGB"), float) for one in ImageSequence.Iterator(moving)]
        assert moving.size == (320, 180)
    assert len(pictures) == 8
    assert min(np.abs(a - b).mean() for a, b in itertools.pairwise(pictures)) > 0.5


def stream_of(path: Path) -> str:
    """What ffmpeg says of a film."""
    told = subprocess.run([ffmpeg_path(), "-hide_banner", "-i", str(path)], capture_output=True, text=True, check=False)
    return told.stderr


def pixels_of(path: Path, width: int, height: int) -> Any:  # Any: an array of bytes
    """Red, green, blue and alpha of every picture of a film."""
    read = [ffmpeg_path(), "-v", "error", "-i", str(path), "-f", "rawvideo", "-pix_fmt", "rgba", "-"]
    return np.frombuffer(subprocess.run(read, check=True, capture_output=True).stdout, np.uint8).reshape(
        -1, height, width, 4
    )


@pytest.mark.slow
def test_films_are_what_a_chain_of_television_expects(tmp_path: Path) -> None:
    browser_path()
    words: dict[str, Any] = {"size": "320x180", "fps": 59.94, "from_": 1.0, "seconds": 0.05}
    said = stream_of(half_cuban().film(tmp_path / "race.mp4", **words))
    assert re.search(r"h264 .*yuv420p\(tv, bt709, progressive\), 320x180.* 59\.94 fps", said)
    assert "timecode        : 00:00:01;00" in said
    assert "ICC" not in said
    said = stream_of(half_cuban().film(tmp_path / "race.mov", **(words | {"fps": 50.0})))
    assert re.search(r"prores \(4444\).*yuva444p\d+le\(tv, bt709.*320x180.* 50 fps", said)
    assert "timecode        : 00:00:01:00" in said


@pytest.mark.slow
def test_graphics_alone_lie_over_any_picture_as_over_the_scene(laptop: Opened) -> None:
    """Pixel by pixel: the graphics with their alpha over the scene are the picture of both."""
    whole, scene, alone = laptop.run(
        """() => {
          const { film, graphics, scene } = airrace, view = scene.views.get("tv"), [w, h] = [640, 360];
          const pixels = (context) => Array.from(context.getImageData(0, 0, w, h).data);
          const context = film.drawn(3.0, view, w, h, [0, 0], 1);
          const under = pixels(context);
          graphics.draw(context, w, h, 3.0, view, { whole: true });
          graphics.stamp(w, h);
          return [pixels(context), under, film.frame(3.0, "tv", w, h, "png", true)];
        }"""
    )
    with Image.open(io.BytesIO(base64.b64decode(alone))) as picture:
        graphics = np.asarray(picture.convert("RGBA"), float)
    shape = 360, 640, 4
    alpha = graphics[..., 3:] / 255.0
    both = alpha * graphics[..., :3] + (1.0 - alpha) * np.reshape(scene, shape)[..., :3]
    assert np.abs(both - np.reshape(whole, shape)[..., :3]).max() <= 3.0
    assert 0.05 < (alpha > 0.0).mean() < 0.5


@pytest.mark.slow
def test_a_scene_laid_over_sky_and_ground_is_the_picture_that_is_drawn_at_once(laptop: Opened) -> None:
    over, at_once = laptop.run(
        """() => {
          const { film, scene } = airrace, view = scene.views.get("tv"), [w, h] = [640, 360];
          const pixels = (context) => Array.from(context.getImageData(0, 0, w, h).data);
          const over = pixels(film.drawn(3.0, view, w, h, [0, 0], 1));
          scene.draw(w, h, 1, view, [0, 0]);
          const context = Object.assign(document.createElement("canvas"), { width: w, height: h }).getContext("2d");
          context.drawImage(scene.canvas, 0, 0);
          return [over, pixels(context)];
        }"""
    )
    apart = np.abs(np.array(over, float) - np.array(at_once, float))
    assert apart.mean() < 1.0
    assert (apart > 12.0).mean() < 1e-3


@pytest.mark.slow
def test_the_alpha_channel_of_a_film_is_that_of_its_pictures(tmp_path: Path) -> None:
    browser_path()
    words: dict[str, Any] = {"size": "640x360", "fps": 25.0, "from_": 3.0, "seconds": 0.08, "graphics_only": True}
    with zipfile.ZipFile(half_cuban().film(tmp_path / "alone.zip", **words)) as archive:
        assert archive.namelist() == ["00000.png", "00001.png"]
        pictures = [np.asarray(Image.open(archive.open(name)).convert("RGBA"), int) for name in archive.namelist()]
    films = pixels_of(half_cuban().film(tmp_path / "alone.mov", **words), 640, 360).astype(int)
    for picture, in_film in zip(pictures, films, strict=True):
        assert np.abs(picture[..., 3] - in_film[..., 3]).max() <= 2
        opaque = picture[..., 3] > 150
        assert np.abs(picture - in_film)[opaque].mean() < 4.0
        assert (picture[..., 3] == 0).mean() > 0.5


@pytest.mark.slow
def test_the_command_films_two_flights_upright_and_overwrites_only_by_force(folder: Path, tmp_path: Path) -> None:
    browser_path()
    runner = importlib.import_module("typer.testing").CliRunner()
    path = tmp_path / "race.mp4"
    words = ["film", str(folder / "still.h5"), str(folder / "windy.h5"), "--output", str(path), "--no-verify"]
    words += ["--format", "9:16", "--size", "180x320", "--fps", "5", "--from", "2", "--to", "3"]
    done = runner.invoke(app, words)
    assert done.exit_code == 0, done.output
    read = [ffmpeg_path(), "-v", "error", "-i", str(path), "-f", "rawvideo", "-pix_fmt", "rgb24", "-"]
    pixels = subprocess.run(read, check=True, capture_output=True).stdout
    assert len(pixels) == 5 * 180 * 320 * 3
    assert runner.invoke(app, words).exit_code == 2
    assert os.listdir(tmp_path) == ["race.mp4"]
