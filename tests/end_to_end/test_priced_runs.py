"""`airrace sensitivity` through the real command: as a table, as CSV, as JSON, and refused."""

import csv
import dataclasses
import io
import shutil
from pathlib import Path

import pytest
from airrace_command import ALONG_THE_PLAN, HALF_CUBAN, airrace, inside

from airrace.checkpoint import read_checkpoint, write_checkpoint
from airrace.procedure.result import Outcome

WIDEST = 100  # columns


@pytest.fixture(scope="module")
def run_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The half Cuban eight, flown."""
    folder = tmp_path_factory.mktemp("priced")
    assert airrace("optimize", HALF_CUBAN, *ALONG_THE_PLAN, "--quiet", cwd=folder).code == 0
    return folder / "half_cuban_eight.h5"


def test_the_object_and_the_csv_tell_the_same_prices(run_file: Path, tmp_path: Path) -> None:
    answer = airrace("sensitivity", run_file, "--json", cwd=tmp_path).answer
    assert list(answer) == ["track", "stage", "race_time_s", "sensitivities"]
    prices = answer["sensitivities"]
    assert isinstance(prices, dict)
    rows = list(csv.DictReader(io.StringIO(inside("sensitivity", run_file, "--csv", cwd=tmp_path).out)))
    assert [row.pop("key") for row in rows] == list(prices)
    told = [{name: "" if value is None else str(value) for name, value in one.items()} for one in prices.values()]
    assert rows == told
    assert prices["rules.start_speed_max_kt"]["s_per_unit"] < 0.0


def test_the_table_leaves_out_what_is_free_and_counts_it(run_file: Path, tmp_path: Path) -> None:
    prices = inside("sensitivity", run_file, "--json", cwd=tmp_path).answer["sensitivities"]
    assert isinstance(prices, dict)
    free = [key for key, one in prices.items() if one["activity"] == "free"]
    table = inside("sensitivity", run_file, cwd=tmp_path).out
    assert f"free: {len(free)} more numbers of {len(prices)}" in table
    assert max(map(len, table.splitlines())) <= WIDEST
    assert "rules.start_speed_max_kt " in table
    assert not any(f"{key} " in table for key in free)


def test_a_group_shows_its_own_numbers_alone(run_file: Path, tmp_path: Path) -> None:
    prices = inside("sensitivity", run_file, "--by", "rules", "--json", cwd=tmp_path).answer["sensitivities"]
    assert isinstance(prices, dict)
    assert {"rules.n_z_max", "rules.floor_m"} <= prices.keys()
    assert all(key.startswith("rules.") for key in prices)


def test_a_stage_that_the_run_does_not_have_is_wrong_usage(run_file: Path, tmp_path: Path) -> None:
    ran = inside("sensitivity", run_file, "--stage", "six-dof", cwd=tmp_path)
    assert (ran.code, ran.err) == (2, "airrace: this run has no stage 'six-dof'; it has: point-mass\n")


def test_json_and_csv_at_once_are_wrong_usage(run_file: Path, tmp_path: Path) -> None:
    assert inside("sensitivity", run_file, "--json", "--csv", cwd=tmp_path).code == 2


def test_an_uncertified_stage_has_no_prices(run_file: Path, tmp_path: Path) -> None:
    checkpoint = read_checkpoint(run_file)
    result = dataclasses.replace(checkpoint.stages[-1].result, outcome=Outcome.NOT_CERTIFIED)
    write_checkpoint(tmp_path / "run.h5", checkpoint.with_stage(result))
    ran = inside("sensitivity", "run.h5", "--json", cwd=tmp_path)
    assert ran.code == 5
    assert ran.err == "airrace: point-mass is not certified: only a certified or solved stage has sensitivities\n"
    assert ran.answer["error"] == "point-mass is not certified: only a certified or solved stage has sensitivities"


def test_a_damaged_file_has_no_prices(run_file: Path, tmp_path: Path) -> None:
    damaged = Path(shutil.copy(run_file, tmp_path / "run.h5"))
    content = bytearray(damaged.read_bytes())
    content[len(content) // 2] ^= 1
    damaged.write_bytes(content)
    ran = inside("sensitivity", damaged, cwd=tmp_path)
    assert ran.code == 7
    assert ran.err.count("\n") == 1
    assert inside("sensitivity", tmp_path / "none.h5", cwd=tmp_path).code == 7
