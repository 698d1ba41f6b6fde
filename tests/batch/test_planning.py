"""From files, patterns and batch.yaml to jobs; what is wrong is told before anything is flown, the rest is flown."""

from pathlib import Path

import pytest
from batch_examples import AIRCRAFT, ROOT, finished, planned, write_course

from airrace.batch import checking
from airrace.batch.sources import Manner, find_sources, parse_sweeps
from airrace.errors import InputError, UsageError

WIND = ("environment.wind.speed_kt=0,5,10", "environment.wind.from_deg=0:360:90")


def test_every_combination_of_course_aircraft_and_values_is_a_job(tmp_path: Path) -> None:
    courses = [write_course(tmp_path, name) for name in ("a", "b")]
    aircraft = (ROOT / "configs" / "edge540.yaml", ROOT / "configs" / "pc9.yaml")
    plan = planned(*courses, folder=tmp_path / "out", aircraft=aircraft, sweeps=WIND)
    assert len({step.name for step in plan.steps}) == 2 * 2 * 3 * 4
    assert plan.steps[0].name == "a,edge540,speed_kt=0,from_deg=0"
    assert {step.action for step in plan.steps} == {"fly"}
    assert not (tmp_path / "out").exists()


def test_a_job_carries_the_texts_of_its_files(tmp_path: Path) -> None:
    course = write_course(tmp_path)
    (step,) = planned(course, folder=tmp_path, overrides=("rules.n_z_max=9",)).steps
    assert step.job is not None
    assert step.job.track.text == course.read_text()
    assert step.job.aircraft.text == AIRCRAFT.read_text()
    assert step.job.overrides == ("rules.n_z_max=9",)


def test_the_aircraft_a_track_names_may_be_swept(tmp_path: Path) -> None:
    course = write_course(tmp_path)
    names = ",".join(str(ROOT / "configs" / f"{name}.yaml") for name in ("edge540", "pc9"))
    plan = planned(course, folder=tmp_path, sweeps=[f"aircraft={names}"])
    texts = [step.job.aircraft.text for step in plan.steps if step.job]
    assert texts == [(ROOT / "configs" / f"{name}.yaml").read_text() for name in ("edge540", "pc9")]


def test_patterns_are_sorted_and_what_matches_nothing_is_told(tmp_path: Path) -> None:
    for name in ("b", "a"):
        write_course(tmp_path, name)
    plan = planned(tmp_path / "*.yaml", tmp_path / "x*.yaml", folder=tmp_path)
    assert [step.name for step in plan.steps] == ["a", "b"]
    assert [one.message for one in plan.findings] == ["no file matches this pattern"]


def test_a_broken_file_is_told_with_its_line_and_the_others_are_flown(tmp_path: Path) -> None:
    good, broken, torn = (write_course(tmp_path, name) for name in ("good", "broken", "torn"))
    broken.write_text(broken.read_text().replace("n_z_max", "n_z_mx"))
    torn.write_text(torn.read_text().replace("rules: {", "rules: ["))
    plan = planned(good, broken, torn, tmp_path / "nowhere.yaml", folder=tmp_path, sweeps=WIND)
    actions = {step.course: step.action for step in plan.steps}
    assert actions == {"good": "fly", "broken": "refuse", "torn": "refuse", "nowhere": "refuse"}
    findings = {finding for step in plan.steps if step.known for finding in step.known.findings}
    assert any(one.file == str(broken) and one.line == 5 and "`n_z_max`" in one.message for one in findings)
    assert any(one.file == str(torn) and one.line for one in findings)


def test_a_swept_key_that_nobody_knows_is_answered_with_the_right_one(tmp_path: Path) -> None:
    plan = planned(write_course(tmp_path), folder=tmp_path, sweeps=["environment.wind.sped_kt=0,5", WIND[1]])
    assert {step.action for step in plan.steps} == {"refuse"}
    findings = {finding for step in plan.steps if step.known for finding in step.known.findings}
    assert {(one.file, one.key) for one in findings} == {("--sweep", "environment.wind.sped_kt")}
    assert "did you mean `speed_kt`" in next(iter(findings)).message


def test_a_value_out_of_range_costs_only_its_own_jobs(tmp_path: Path) -> None:
    sweeps = ["environment.wind.speed_kt=0,5,500", "environment.wind.from_deg=0"]
    plan = planned(write_course(tmp_path), folder=tmp_path, sweeps=sweeps)
    assert [step.action for step in plan.steps] == ["fly", "fly", "refuse"]


def test_all_is_checked_before_it_is_flown_up_to_a_number(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(checking, "CHECKED_MAX", 2)
    courses = [write_course(tmp_path, name) for name in ("a", "b", "c")]
    for course in courses[1:]:
        course.write_text(course.read_text().replace("n_z_max", "n_z_mx"))
    plan = planned(*courses, folder=tmp_path)
    assert [step.action for step in plan.steps] == ["fly", "refuse", "fly"]  # the last one's own process tells


def test_two_courses_of_one_name_are_refused_before_anything_starts(tmp_path: Path) -> None:
    courses = [write_course(tmp_path / folder, "oval") for folder in ("x", "y")]
    with pytest.raises(UsageError, match=r"oval\.h5.*x/oval\.yaml.*y/oval\.yaml"):
        planned(*courses, folder=tmp_path)


def test_a_value_that_is_set_and_swept_is_refused(tmp_path: Path) -> None:
    overrides = ("environment.wind.speed_kt=3",)
    with pytest.raises(InputError, match="swept, and set as well"):
        planned(write_course(tmp_path), folder=tmp_path, sweeps=WIND, overrides=overrides)


def test_a_key_that_is_swept_twice_is_refused() -> None:
    with pytest.raises(InputError, match="swept twice"):
        parse_sweeps(["a.b=1,2", "a.b=3"])


def test_too_many_jobs_are_refused_at_once(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="1000000 jobs"):
        planned(write_course(tmp_path), folder=tmp_path, sweeps=["a=1:1000:1", "b=1:1000:1"])


def test_finished_jobs_are_kept_and_not_read_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    course = write_course(tmp_path)
    out = tmp_path / "out"
    for step in planned(course, folder=out, sweeps=WIND).steps[:-1]:
        assert step.job is not None
        finished(out, step.job)
    checked: list[str] = []
    monkeypatch.setattr(checking, "findings_of", lambda job, places: checked.append(job.name) or ())
    plan = planned(course, folder=out, sweeps=WIND)
    assert [step.action for step in plan.steps] == ["keep"] * 11 + ["fly"]
    assert checked == [plan.steps[-1].name]
    assert plan.steps[0].known is not None
    assert plan.steps[0].known.race_time == 10.0


BATCH = """schema: airrace/batch/1
courses: [tracks/*.yaml]
aircraft: [{aircraft}]
set: {{rules.n_z_max: 9, notes: '12'}}
sweep:
  environment.wind.speed_kt: [0, 5]
  environment.wind.from_deg: 0:360:180
until: point-mass
"""


def test_a_batch_file_says_all_that_the_command_line_says(tmp_path: Path) -> None:
    write_course(tmp_path / "tracks", "a")
    batch = tmp_path / "batch.yaml"
    batch.write_text(BATCH.format(aircraft=AIRCRAFT))
    plan = planned(batch, folder=tmp_path, until="six-dof")
    assert [step.name for step in plan.steps] == [
        f"a,edge540,speed_kt={speed},from_deg={degrees}" for speed in (0, 5) for degrees in (0, 180)
    ]
    job = plan.steps[-1].job
    assert job is not None
    assert job.until == "point-mass"
    assert job.overrides[:2] == ("rules.n_z_max=9", "notes='12'")


def test_the_command_line_comes_before_a_batch_file(tmp_path: Path) -> None:
    write_course(tmp_path / "tracks", "a")
    batch = tmp_path / "batch.yaml"
    batch.write_text(BATCH.format(aircraft=AIRCRAFT))
    pc9 = ROOT / "configs" / "pc9.yaml"
    sources = find_sources(
        [str(batch)], Manner((pc9,), None, (), parse_sweeps(["environment.wind.speed_kt=7"]), "six-dof")
    )
    (group,) = sources.groups
    assert group.manner.aircraft == (pc9,)
    assert group.manner.until == "six-dof"
    assert [sweep.values for sweep in group.manner.sweeps] == [("7",), ("0", "180")]


@pytest.mark.parametrize(
    ("old", "new", "line", "key"),
    [
        ("wind.speed_kt", "wind.sped_kt", 6, "environment.wind.sped_kt"),
        ("[0, 5]", "[0, 500]", 6, "environment.wind.speed_kt"),
        ("rules.n_z_max", "rules.n_z_mix", 4, "rules.n_z_mix"),
    ],
)
def test_a_value_that_courses_do_not_take_is_told_where_the_batch_file_gives_it(
    old: str, new: str, line: int, key: str, tmp_path: Path
) -> None:
    write_course(tmp_path / "tracks", "a")
    batch = tmp_path / "batch.yaml"
    batch.write_text(BATCH.format(aircraft=AIRCRAFT).replace(old, new))
    findings = {one for step in planned(batch, folder=tmp_path).steps if step.known for one in step.known.findings}
    assert {(one.file, one.line, one.key) for one in findings} == {(str(batch), line, key)}


@pytest.mark.parametrize(
    ("old", "new", "line", "word"),
    [
        ("courses:", "cources:", 2, "courses"),
        ("tracks/*.yaml", "trucks/*.yaml", 2, "no file matches"),
        ("[0, 5]", "[0, 0]", 6, "given twice"),
        ("0:360:180", "0:360:0", 7, "never arrives"),
        ("until: point-mass", "until: [1]", 8, "must be text"),
    ],
)
def test_what_is_wrong_in_a_batch_file_is_told_with_its_line(
    old: str, new: str, line: int, word: str, tmp_path: Path
) -> None:
    write_course(tmp_path / "tracks", "a")
    batch = tmp_path / "batch.yaml"
    batch.write_text(BATCH.format(aircraft=AIRCRAFT).replace(old, new))
    findings = find_sources([str(batch)], Manner()).findings
    assert any(one.file == str(batch) and one.line == line and word in one.message for one in findings), findings
