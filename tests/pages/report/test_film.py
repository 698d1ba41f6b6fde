"""Films and cards: what their words mean, what is missing, and that the same flight gives the same pictures."""

import importlib
import itertools
import os
import shutil
import struct
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser_pages import browser_path
from example_flights import half_cuban
from PIL import Image, ImageSequence

from airrace.cli.main import app
from airrace.errors import StorageError, UsageError
from airrace.pages.report import browser, film
from airrace.pages.report.browser import page_in_browser, print_pdf
from airrace.pages.report.film import FINISH_HOLD, FilmSettings, FilmView, ensure_card, ffmpeg_path, film_settings

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
        ("race.avi", {}, ".mp4 or .gif"),
        ("race", {}, ".mp4 or .gif"),
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
    assert np.diff(flown) == pytest.approx(1.0 / fps)
    assert times[-1] == 10.0
    assert len(times) / fps == pytest.approx(10.0 + FINISH_HOLD, abs=1.0 / fps)


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
