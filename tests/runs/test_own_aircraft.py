"""Aircraft of one's own by `airrace aircraft`: figures with units, the file and its numbers, and the comparison."""

import re
from pathlib import Path

import pytest
import yaml
from command import run as airrace

from airrace import estimate_aircraft
from airrace.errors import UsageError
from airrace.files.inputs.document import AIRCRAFT
from airrace.model.dynamics.handling import faults, remarks
from airrace.runs.aircraft_file import MEASURES, read_aircraft_file, read_measure

MANUAL = ("--mass", "730kg", "--span", "24.6ft", "--area", "10.44m2", "--power", "315hp", "--stall", "55kt")
SPEEDS = ("--speed-max", "343km/h", "--climb", "3200ft/min", "--roll-rate", "400", "--n-z", "10g")


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_a_manual_makes_a_file_that_says_where_every_number_comes_from(folder: Path) -> None:
    ran = airrace("aircraft", "My Extra", "--from", "edge540", *MANUAL, *SPEEDS, "--manual-mass", "820kg")
    assert (ran.code, ran.err) == (0, "")
    text = (folder / "my_extra.yaml").read_text(encoding="utf-8")
    groups, _, published = text.partition("published:")
    values = re.findall(r"^  (\w+): .*$", groups, re.MULTILINE)
    assert len(values) == len(re.findall(r"^  \w+: \S+ +# \S", groups, re.MULTILINE)) > 50
    assert re.search(r"C_L_max: 1\.5\d+ +# stall speed: 2 m g0/\(rho V_S\^2 S\)", groups)
    assert re.search(r"C_Ybeta: -0\.55 +# edge540", groups)
    assert re.search(r"mass_kg: 730 +# given", groups)
    assert re.search(r"mass_kg: 820", published)
    assert "stall                kt          55.0      55.0        +0.0" in ran.out
    assert airrace("check", "rovinj_2014", "--aircraft", "my_extra.yaml").code == 0


def test_a_file_that_is_written_is_compared_with_its_own_figures(folder: Path) -> None:
    made = estimate_aircraft("mine", from_="edge540", stall="55kt", speed_max="210kt", turn="4g")
    read = estimate_aircraft("mine.yaml")
    assert (made.path, read.path) == (Path("mine.yaml"), None)
    for before, after in zip(made.table.rows, read.table.rows, strict=True):
        assert after[3] == pytest.approx(before[3], rel=1e-4)
        assert after[2] == pytest.approx(before[2], rel=1e-4, nan_ok=True)
    assert read.figures.turn == 4.0
    (folder / "mine.yaml").write_text("schema: airrace/track/1\n")
    assert airrace("aircraft", "mine.yaml").code == 3


def test_an_aircraft_that_cannot_fly_level_has_no_top_speed(folder: Path) -> None:
    estimate_aircraft("mine", from_="edge540", mass="700kg")
    text = (folder / "mine.yaml").read_text(encoding="utf-8")
    (folder / "weak.yaml").write_text(re.sub(r"(  power_kW: )\S+", r"\g<1>20", text), encoding="utf-8")
    computed = {row["figure"]: row["computed"] for row in estimate_aircraft("weak.yaml").table.objects()}
    assert computed["top speed"] is None
    assert computed["sustained turn"] is None
    assert isinstance(climb := computed["rate of climb"], float)
    assert climb < 0.0


def test_a_name_of_any_signs_stays_a_name(folder: Path) -> None:
    name = 'Jim\'s "Extra": #1 \\ ü'
    made = estimate_aircraft(name, from_="edge540", output="mine.yaml", stall="58kt")
    assert yaml.safe_load((folder / "mine.yaml").read_text(encoding="utf-8"))["name"] == made.aircraft.name == name


def test_constants_of_linear_loops_are_not_taken_over(folder: Path) -> None:
    text = (AIRCRAFT.path / "edge540.yaml").read_text(encoding="utf-8")
    (folder / "start.yaml").write_text(text + "\nlinear:\n  speed_m_s: 90\n  tau_p_s: 0.07\n", encoding="utf-8")
    assert estimate_aircraft("mine", from_="start.yaml", stall="58kt").aircraft.linear is None
    assert "linear:" not in (folder / "mine.yaml").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        (["X", "--from", "edge540", "--stall", "57"], 2, "--stall: '57' has no unit"),
        (["X", "--from", "edge540", "--stall", "27kt"], 2, "takes a C_L_max of 6.37"),
        (["X", "--from", "edge540"], 2, "no figure of the aircraft is given"),
        (["X", "--stall", "57kt"], 2, "name that, too, e.g. --from edge540"),
        (["X", "--from", "edge54", "--stall", "57kt"], 3, "did you mean `edge540`, which comes with airrace?"),
        (["edge54"], 3, "did you mean `edge540`, which comes with airrace?"),
        (["X", "--from", "edge540", "--speed-limit", "60kt"], 2, "no aircraft that flies: envelope.speed_max_m_s"),
    ],
)
def test_what_makes_no_aircraft_gets_one_clear_error_and_no_file(
    folder: Path, words: list[str], code: int, message: str
) -> None:
    ran = airrace("aircraft", *words)
    assert (ran.code, ran.out) == (code, "")
    assert message in ran.err
    assert "Traceback" not in ran.err
    assert list(folder.iterdir()) == []


def test_a_file_that_exists_is_kept_and_figures_have_names(folder: Path) -> None:
    (folder / "x.yaml").write_text("mine")
    assert airrace("aircraft", "X", "--from", "edge540", "--stall", "57kt").code == 2
    assert (folder / "x.yaml").read_text() == "mine"
    with pytest.raises(TypeError, match="stal"):
        estimate_aircraft("Y", from_="edge540", stal="57kt")


@pytest.mark.parametrize("name", AIRCRAFT.names)
def test_aircraft_that_come_along_have_their_published_figures_within_five_per_cent(name: str) -> None:
    compared = estimate_aircraft(name)
    published = [row for row in compared.table.objects() if row["published"] is not None]
    assert len(published) >= 2
    for row in published:
        difference = row["difference_percent"]
        assert isinstance(difference, float)
        assert abs(difference) < 5.0, row


@pytest.mark.parametrize("name", AIRCRAFT.names)
def test_nothing_is_wrong_with_aircraft_that_come_along_and_all_name_their_sources(name: str) -> None:
    file = read_aircraft_file(name)
    assert faults(file.aircraft) == ()
    assert remarks(file.aircraft) == ()
    assert file.entry.published is not None
    assert file.entry.published.source
    text = (AIRCRAFT.path / f"{name}.yaml").read_text(encoding="utf-8")
    assert re.search(r"^  mass_kg: \S+ +# [SE]", text, re.MULTILINE)


@pytest.mark.parametrize(
    ("text", "figure", "value"),
    [
        ("100kt", "stall", 51.444444),
        ("100 KT", "stall", 51.444444),
        ("180km/h", "stall", 50.0),
        ("100 mph", "stall", 44.704),
        ("50.5 m/s", "stall", 50.5),
        ("3000ft/min", "climb", 15.24),
        ("900 m/min", "climb", 15.0),
        ("300hp", "power", 223709.96),
        ("300 PS", "power", 220649.63),
        ("1000lb", "mass", 453.59237),
        ("24ft", "span", 7.3152),
        ("100ft2", "area", 9.290304),
        ("9.1 m\N{SUPERSCRIPT TWO}", "area", 9.1),
        ("10", "n_z", 10.0),
        ("180", "roll_rate", 3.14159265),
        ("180 deg/s", "roll_rate", 3.14159265),
    ],
)
def test_a_number_with_its_unit_is_a_measure(text: str, figure: str, value: float) -> None:
    assert read_measure(text, MEASURES[figure], "--figure") == pytest.approx(value, rel=1e-7)


@pytest.mark.parametrize(
    ("text", "figure", "words"),
    [
        ("57", "stall", "--figure: '57' has no unit; give one of kt, km/h, mph, m/s, e.g. 57kt"),
        ("57 furlongs", "stall", "--figure: 'furlongs' is no unit of it; known are kt, km/h, mph, m/s"),
        ("fast", "stall", "--figure: 'fast' is no number with a unit (kt, km/h, mph, m/s)"),
        ("", "mass", "--figure: '' is no number with a unit (kg, lb)"),
        ("1e9kg", "mass", "is no unit of it"),
        ("1,5m", "span", "is no number with a unit (m, ft)"),
        ("nan kt", "stall", "is no number with a unit"),
        ("-50kt", "stall", "--figure: -50kt is beyond 10 to 550 kt"),
        ("0kg", "mass", "--figure: 0kg is beyond 50 to 50000 kg"),
        ("0.5", "n_z", "--figure: 0.5 is beyond 1.1 to 25 g"),
    ],
)
def test_what_is_no_measure_is_refused_with_what_would_be_right(text: str, figure: str, words: str) -> None:
    with pytest.raises(UsageError) as refused:
        read_measure(text, MEASURES[figure], "--figure")
    assert words in str(refused.value)
