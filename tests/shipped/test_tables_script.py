"""The tables of the documents: made of runs as the script reads them, and in agreement with each other."""

import importlib.util
import re
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from airrace.inputs import load_inputs

ROOT = Path(__file__).parents[2]
Answer = dict[str, Any]  # Any: as the command prints it


@pytest.fixture
def script(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """`scripts/tables.py`."""
    spec = importlib.util.spec_from_file_location("tables_script", ROOT / "scripts" / "tables.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, spec.name, module)
    spec.loader.exec_module(module)
    return module


def table(text: str) -> list[dict[str, str]]:
    """The first table in Markdown."""
    lines = [line for line in text.splitlines() if line.startswith("|")]
    cells = [[cell.strip() for cell in line.removeprefix("|").removesuffix("|").split("|")] for line in lines]
    return [dict(zip(cells[0], row, strict=True)) for row in cells[2:]]


def documented(script: ModuleType, name: str) -> list[dict[str, str]]:
    """A table of the script where it stands."""
    text = (ROOT / script.TABLES[name].document).read_text(encoding="utf-8")
    (found,) = re.findall(rf"<!-- {script.TABLES[name].mark} -->\n((?:\|.*\n)+)", text)
    return table(found)


def answer(script: ModuleType, *, certified: bool = True) -> Callable[[Path], Answer]:
    """What `show` would say of runs whose stages take 50, 51, 52, ... s and stray by 0, 1, 2, ... m."""

    def shown(run: Path) -> Answer:
        if not certified:
            raise script.MissingRun(f"{run}: not certified")
        stages = [
            {
                "stage": stage,
                "race_time_s": 50.0 + number,
                "tracking_error_m": float(number) if number else None,
                "iterations": 10,
                "certificate": {
                    "items": [{"name": "kkt_error", "value": 1e-8 * (1 + number), "limit": 1e-6, "unit": "scaled"}]
                },
            }
            for number, stage in enumerate(script.STAGES)
        ]
        return {"certified": True, "stages": stages}

    return shown


def printed(script: ModuleType, name: str, capsys: pytest.CaptureFixture[str]) -> list[dict[str, str]]:
    assert script.main([name, "RUNS"]) == 0
    return table(capsys.readouterr().out)


def test_the_ladder_has_every_shipped_course_with_what_all_stages_cost(
    script: ModuleType, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(script, "shown", answer(script))
    rows = printed(script, "ladder", capsys)
    assert sorted(row["course"].strip("`") for row in rows) == sorted(one.stem for one in (ROOT / "tracks").iterdir())
    assert {(row["`point-mass`"], row["`six-dof`"], row["last - first"]) for row in rows} == {
        ("50.000", "54.000", "+4.000")
    }
    assert {(row["tracking error at most, m"], row["iterations"]) for row in rows} == {("4.0", "50")}


def test_real_courses_are_held_against_the_winner_that_their_file_names(
    script: ModuleType, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(script, "shown", answer(script))
    rows = {row["course"].strip("`"): row for row in printed(script, "courses", capsys)}
    assert rows["rovinj_2014"]["winner's official time s"] == "59.012"
    assert rows["rovinj_2014"]["difference"] == "-15.3 %"
    assert rows["abu_dhabi_2016"]["winner's official time s"] == "58.550"
    assert rows["air_race_x_2024"]["difference"] == ""


def test_the_evidence_is_the_worst_of_all_courses_by_stage(
    script: ModuleType, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    good = answer(script)

    def shown(run: Path) -> Answer:
        found = good(run)
        if run.stem == "gdynia_2014":
            found["stages"][2]["certificate"]["items"][0]["value"] = 5e-7
        return found

    monkeypatch.setattr(script, "shown", shown)
    (row,) = printed(script, "evidence", capsys)
    values = [row[f"`{stage}`"] for stage in script.STAGES]
    assert values == ["1e-08", "2e-08", "5e-07", "4e-08", "5e-08"]


def test_a_run_that_is_missing_or_not_certified_ends_the_script_and_changes_nothing(
    script: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    document = ROOT / script.TABLES["ladder"].document
    before = document.read_bytes()
    assert script.main(["ladder", str(tmp_path), "--write"]) == 1
    assert "rovinj_2014.h5: there is no such run" in capsys.readouterr().err
    monkeypatch.setattr(script, "shown", answer(script, certified=False))
    assert script.main(["ladder", str(tmp_path), "--write"]) == 1
    assert "rovinj_2014.h5: not certified" in capsys.readouterr().err
    assert document.read_bytes() == before


def test_a_run_without_all_stages_makes_no_ladder(
    script: ModuleType, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    full = answer(script)
    monkeypatch.setattr(script, "shown", lambda run: {"stages": full(run)["stages"][:1]})
    assert script.main(["ladder", "RUNS"]) == 1
    assert "it has not all stages, but point-mass" in capsys.readouterr().err


def test_writing_replaces_the_table_below_the_mark_and_nothing_else(
    script: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    document = tmp_path / "docs" / "ladder.md"
    document.parent.mkdir()
    old = "# One\n\n<!-- ladder -->\n| a |\n| --- |\n| 1 |\n\n| b |\n| --- |\n| 2 |\n"
    document.write_text(old, encoding="utf-8")
    monkeypatch.setattr(script, "shown", answer(script))
    monkeypatch.setattr(script, "ROOT", tmp_path)
    assert script.main(["ladder", "RUNS", "--write"]) == 0
    new = document.read_text(encoding="utf-8")
    begin, end = "# One\n\n<!-- ladder -->\n", "\n| b |\n| --- |\n| 2 |\n"
    assert new.startswith(begin)
    assert new.endswith(end)
    assert len(table(new.removesuffix(end))) == len(script.COURSES)
    document.write_text(old.replace("ladder -->", "other -->"), encoding="utf-8")
    with pytest.raises(ValueError, match="0 tables below"):
        script.main(["ladder", "RUNS", "--write"])


def test_every_change_of_abu_dhabi_changes_the_race(script: ModuleType) -> None:
    path = ROOT / "tracks" / "abu_dhabi_2016.yaml"
    (text, none), *changed = script.VARIANTS
    assert (text, none) == ("nothing", ())
    races = [load_inputs(path, overrides=overrides).race for _, overrides in [(text, none), *changed]]
    for number, race in enumerate(races):
        assert race not in races[:number], script.VARIANTS[number]


@pytest.mark.parametrize("name", ["ladder", "courses", "abu-dhabi"])
def test_the_documents_hold_the_tables_of_the_script(
    script: ModuleType, name: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Headings and first columns, that is; the times are those of the runs."""
    monkeypatch.setattr(script, "shown", answer(script))
    monkeypatch.setattr(script, "fly", lambda *_: None)
    ours, theirs = printed(script, name, capsys), documented(script, name)
    assert [list(row) for row in ours] == [list(row) for row in theirs]
    fixed = ("course", "year", "passages", "winner's official time s", "changed", "`--set`")
    for key in [key for key in fixed if key in ours[0]]:
        assert [row[key] for row in ours] == [row[key] for row in theirs]


def test_documented_differences_follow_from_the_times_beside_them(script: ModuleType) -> None:
    for row in documented(script, "courses"):
        if row["difference"]:
            difference = float(row["optimum s"]) / float(row["winner's official time s"]) - 1.0
            assert float(row["difference"].removesuffix(" %")) == pytest.approx(100.0 * difference, abs=0.051)
    for row in documented(script, "ladder"):
        difference = float(row["`six-dof`"]) - float(row["`point-mass`"])
        assert float(row["last - first"]) == pytest.approx(difference, abs=0.0011)


def test_a_course_has_the_same_optimum_in_all_tables(script: ModuleType) -> None:
    ladder = {row["course"]: row["`point-mass`"] for row in documented(script, "ladder")}
    real = {row["course"]: row["optimum s"] for row in documented(script, "courses")}
    assert real.items() <= ladder.items()
    assert documented(script, "abu-dhabi")[0]["s"] == real["`abu_dhabi_2016`"]
