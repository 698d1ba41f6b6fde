"""Names of jobs are stable, readable, valid as files, and never shared."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from airrace.batch.sweep import job_name, refuse_clashes
from airrace.errors import UsageError

COURSE = Path("tracks/rovinj_2014.yaml")
SWEPT = (("environment.wind.speed_kt", "5"), ("environment.wind.from_deg", "45"))


def test_a_name_tells_course_aircraft_and_swept_values() -> None:
    assert job_name(COURSE, None, ()) == "rovinj_2014"
    assert job_name(COURSE, None, SWEPT) == "rovinj_2014,speed_kt=5,from_deg=45"
    assert job_name(COURSE, Path("configs/pc9.yaml"), SWEPT[:1]) == "rovinj_2014,pc9,speed_kt=5"


def test_keys_that_end_alike_are_told_in_full() -> None:
    swept = (("gates.a.height_m", "20"), ("gates.b.height_m", "30"))
    assert job_name(COURSE, None, swept) == "rovinj_2014,gates.a.height_m=20,gates.b.height_m=30"


@given(st.text(max_size=300), st.text(max_size=300))
def test_any_name_is_a_file_in_its_folder(value: str, stem: str) -> None:
    name = job_name(Path("x" + stem.replace("/", "").replace("\0", "")), None, (("notes", value),))
    assert Path(f"folder/{name}.h5").parent == Path("folder")
    assert len(f"{name}.h5".encode()) <= 200
    assert not name.startswith((".", "-"))


def test_long_names_that_begin_alike_are_told_apart() -> None:
    names = {job_name(COURSE, None, (("notes", "x" * 300 + end),)) for end in "ab"}
    assert len(names) == 2


def test_two_jobs_that_would_write_one_file_are_both_named() -> None:
    with pytest.raises(UsageError, match=r"x\.h5: a/x\.yaml and b/x\.yaml"):
        refuse_clashes([("x", "a/x.yaml"), ("y", "a/y.yaml"), ("x", "b/x.yaml")])
    with pytest.raises(UsageError, match="given twice"):
        refuse_clashes([("x", "a/x.yaml"), ("x", "a/x.yaml")])


def test_names_that_differ_by_case_alone_clash() -> None:
    with pytest.raises(UsageError, match="two jobs"):
        refuse_clashes([("Oval", "a/Oval.yaml"), ("oval", "a/oval.yaml")])
