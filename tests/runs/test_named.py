"""Flights as they are asked for."""

from pathlib import Path

import pytest

from airrace.errors import UsageError
from airrace.runs.output import FlightName


def test_stage_stands_behind_the_colon() -> None:
    assert FlightName.of("folder/run.h5:six-dof") == FlightName(Path("folder/run.h5"), "six-dof")
    assert FlightName.of("folder/run.h5") == FlightName(Path("folder/run.h5"), None)


def test_file_with_a_colon_in_its_name_comes_first(tmp_path: Path) -> None:
    file = tmp_path / "run.h5:six-dof"
    file.touch()
    assert FlightName.of(str(file)) == FlightName(file, None)


def test_nothing_behind_the_colon_is_no_stage(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"run\.h5: names no stage"):
        FlightName.of(f"{tmp_path}/run.h5:")
