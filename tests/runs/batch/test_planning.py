"""What a batch is to fly: sources, patterns, sweeps, names, and what is done already."""

import json
import os
from dataclasses import asdict, fields, replace
from pathlib import Path

import pytest
from batch_examples import AIRCRAFT, ROOT, finished, job, planned, write_course
from hypothesis import given
from hypothesis import strategies as st

from airrace.errors import Finding, InputError, UsageError
from airrace.files.inputs import Document
from airrace.files.inputs.overrides import parse_overrides
from airrace.runs.batch import planning
from airrace.runs.batch.jobs import (
    Fingerprint,
    Job,
    combinations,
    cover,
    job_name,
    parse_sweep,
    refuse_clashes,
    sweep_of,
)
from airrace.runs.batch.planning import JobTemplate, find_sources, parse_sweeps
from airrace.runs.batch.record import (
    JobRecord,
    Repeat,
    checkpoint_path,
    read_record,
    reason_to_fly,
    record_path,
    write_record,
)

WIND = ("environment.wind.speed_kt=0,5,10", "environment.wind.from_deg=0:360:90")


def test_every_combination_of_course_aircraft_and_values_is_a_job_with_the_texts_of_its_files(tmp_path: Path) -> None:
    courses = [write_course(tmp_path, name) for name in ("a", "b")]
    aircraft = tuple(ROOT / "configs" / f"{name}.yaml" for name in ("edge540", "pc9"))
    plan = planned(*courses, folder=tmp_path / "out", aircraft=aircraft, sweeps=WIND, overrides=("rules.n_z_max=9",))
    assert len({step.name for step in plan.steps}) == 2 * 2 * 3 * 4
    assert {step.action for step in plan.steps} == {"fly"}
    first = plan.steps[0].job
    assert first is not None
    assert first.name == "a,edge540,speed_kt=0,from_deg=0"
    assert (first.track.text, first.aircraft.text) == (courses[0].read_text(), AIRCRAFT.read_text())
    assert first.overrides == ("rules.n_z_max=9", "environment.wind.speed_kt=0", "environment.wind.from_deg=0")
    assert not (tmp_path / "out").exists()
    plan = planned(courses[0], folder=tmp_path, sweeps=[f"aircraft={','.join(map(str, aircraft))}"])
    assert [step.job.aircraft.text for step in plan.steps if step.job] == [path.read_text() for path in aircraft]


def test_patterns_are_sorted_and_what_matches_nothing_is_reported(tmp_path: Path) -> None:
    for name in ("b", "a"):
        write_course(tmp_path, name)
    plan = planned(tmp_path / "*.yaml", tmp_path / "x*.yaml", folder=tmp_path)
    assert [step.name for step in plan.steps] == ["a", "b"]
    assert [one.message for one in plan.findings] == ["no file matches this pattern"]


def test_a_broken_file_is_reported_with_its_line_and_the_others_are_flown(tmp_path: Path) -> None:
    good, broken, torn = (write_course(tmp_path, name) for name in ("good", "broken", "torn"))
    broken.write_text(broken.read_text().replace("n_z_max", "n_z_mx"))
    torn.write_text(torn.read_text().replace("rules: {", "rules: ["))
    plan = planned(good, broken, torn, tmp_path / "nowhere.yaml", folder=tmp_path, sweeps=WIND)
    actions = {step.course: step.action for step in plan.steps}
    assert actions == {"good": "fly", "broken": "refuse", "torn": "refuse", "nowhere": "refuse"}
    findings = {finding for step in plan.steps if step.result for finding in step.result.findings}
    assert any(one.file == str(broken) and one.line == 5 and "`n_z_max`" in one.message for one in findings)
    assert any(one.file == str(torn) and one.line for one in findings)


@pytest.mark.parametrize(
    ("sweeps", "actions", "key", "word"),
    [
        (["environment.wind.sped_kt=0,5", WIND[1]], ["refuse"] * 8, "environment.wind.sped_kt", "mean `speed_kt`"),
        (["environment.wind.speed_kt=0,5,500", "environment.wind.from_deg=0"], ["fly", "fly", "refuse"], None, ""),
        (["gates.gx.north_m=1,2"], ["refuse"] * 2, "gates.gx.type", ""),  # half a gate is blamed on the sweep
    ],
)
def test_a_swept_value_that_is_wrong_costs_only_its_own_jobs(
    sweeps: list[str], actions: list[str], key: str | None, word: str, tmp_path: Path
) -> None:
    plan = planned(write_course(tmp_path), folder=tmp_path, sweeps=sweeps)
    assert [step.action for step in plan.steps] == actions
    findings = {finding for step in plan.steps if step.result for finding in step.result.findings}
    assert all(one.file == "--sweep" and key in (None, one.key) and word in one.message for one in findings)
    assert findings


def test_all_is_checked_before_it_is_flown_up_to_a_number(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(planning, "CHECKED_MAX", 2)
    courses = [write_course(tmp_path, name) for name in ("a", "b", "c")]
    for course in courses[1:]:
        course.write_text(course.read_text().replace("n_z_max", "n_z_mx"))
    plan = planned(*courses, folder=tmp_path)
    assert [step.action for step in plan.steps] == ["fly", "refuse", "fly"]  # the last one's own process tells


def test_what_cannot_be_planned_is_refused_before_anything_starts(tmp_path: Path) -> None:
    courses = [write_course(tmp_path / folder, "oval") for folder in ("x", "y")]
    with pytest.raises(UsageError, match=r"oval\.h5.*x/oval\.yaml.*y/oval\.yaml"):
        planned(*courses, folder=tmp_path)
    with pytest.raises(InputError, match="swept, and set as well"):
        planned(courses[0], folder=tmp_path, sweeps=WIND, overrides=("environment.wind.speed_kt=3",))
    with pytest.raises(InputError, match="swept twice"):
        parse_sweeps(["a.b=1,2", "a.b=3"])
    with pytest.raises(UsageError, match="1000000 jobs"):
        planned(courses[0], folder=tmp_path, sweeps=["a=1:1000:1", "b=1:1000:1"])


def test_finished_jobs_are_kept_and_not_read_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    course = write_course(tmp_path)
    out = tmp_path / "out"
    for step in planned(course, folder=out, sweeps=WIND).steps[:-1]:
        assert step.job is not None
        finished(out, step.job)
    checked: list[str] = []
    monkeypatch.setattr(planning, "findings_of", lambda job, places: checked.append(job.name) or ())
    plan = planned(course, folder=out, sweeps=WIND)
    assert [step.action for step in plan.steps] == ["keep"] * 11 + ["fly"]
    assert checked == [plan.steps[-1].name]
    assert plan.steps[0].result is not None
    assert plan.steps[0].result.race_time == 10.0


BATCH = """schema: airrace/batch/1
courses: [tracks/*.yaml]
aircraft: [{aircraft}]
set: {{rules.n_z_max: 9, notes: '12'}}
sweep:
  environment.wind.speed_kt: [0, 5]
  environment.wind.from_deg: 0:360:180
until: point-mass
"""


@pytest.fixture
def batch(tmp_path: Path) -> Path:
    """A batch file beside its course."""
    write_course(tmp_path / "tracks", "a")
    path = tmp_path / "batch.yaml"
    path.write_text(BATCH.format(aircraft=AIRCRAFT))
    return path


def test_a_batch_file_says_all_that_the_command_line_says_which_comes_before_it(batch: Path, tmp_path: Path) -> None:
    plan = planned(batch, folder=tmp_path, until="six-dof")
    assert [step.name for step in plan.steps] == [
        f"a,edge540,speed_kt={speed},from_deg={degrees}" for speed in (0, 5) for degrees in (0, 180)
    ]
    job = plan.steps[-1].job
    assert job is not None
    assert job.until == "point-mass"
    assert job.overrides[:2] == ("rules.n_z_max=9", 'notes="12"')
    pc9 = ROOT / "configs" / "pc9.yaml"
    template = JobTemplate((pc9,), None, (), parse_sweeps(["environment.wind.speed_kt=7"]), "six-dof")
    (group,) = find_sources([str(batch)], template).groups
    assert (group.template.aircraft, group.template.until) == ((pc9,), "six-dof")
    assert [sweep.values for sweep in group.template.sweeps] == [("7",), ("0", "180")]


@pytest.mark.parametrize(
    ("old", "new", "line", "key"),
    [
        ("wind.speed_kt", "wind.sped_kt", 6, "environment.wind.sped_kt"),
        ("[0, 5]", "[0, 500]", 6, "environment.wind.speed_kt"),
        ("rules.n_z_max", "rules.n_z_mix", 4, "rules.n_z_mix"),
    ],
)
def test_a_value_that_courses_do_not_take_is_reported_where_the_batch_file_gives_it(
    old: str, new: str, line: int, key: str, batch: Path, tmp_path: Path
) -> None:
    batch.write_text(batch.read_text().replace(old, new))
    findings = {one for step in planned(batch, folder=tmp_path).steps if step.result for one in step.result.findings}
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
def test_what_is_wrong_in_a_batch_file_is_reported_with_its_line(
    old: str, new: str, line: int, word: str, batch: Path
) -> None:
    batch.write_text(batch.read_text().replace(old, new))
    findings = find_sources([str(batch)], JobTemplate()).findings
    assert any(one.file == str(batch) and one.line == line and word in one.message for one in findings), findings


@pytest.mark.parametrize(
    ("pattern", "names"),
    [
        ("*.yaml", ["a"]),
        ("**/*.yaml", ["a", "b", "c"]),
        ("one/**/*.yaml", ["b", "c"]),
        ("**/two/*", ["c"]),
        ("x/**/*.yaml", []),
    ],
)
def test_pattern_means_these_files(pattern: str, names: list[str], tmp_path: Path) -> None:
    for folder, name in (("", "a"), ("one", "b"), ("one/two", "c"), (".hidden", "e")):
        write_course(tmp_path / folder, name)
    plan = planned(tmp_path / pattern, folder=tmp_path)
    assert [step.name for step in plan.steps] == names


def test_batch_that_lists_itself_is_told_so(tmp_path: Path) -> None:
    course = write_course(tmp_path)
    batch = tmp_path / "batch.yaml"
    batch.write_text(f"schema: airrace/batch/1\ncourses: [batch.yaml, {os.path.basename(course)}]\n")
    plan = planned(batch, folder=tmp_path)
    assert [step.name for step in plan.steps] == [course.stem]
    assert [f"{one.line}: {one.message}" for one in plan.findings] == [
        f"2: {batch} is a batch and no course; name the courses that it names"
    ]


SPEED = "environment.wind.speed_kt"
FROM = "environment.wind.from_deg"


@pytest.mark.parametrize(
    ("text", "values"),
    [
        (f"{SPEED}=0,5,10", ("0", "5", "10")),
        (f"{SPEED}=0:20:5", ("0", "5", "10", "15", "20")),
        (f"{SPEED}=0:18:5", ("0", "5", "10", "15")),
        (f"{SPEED}=20:0:-10", ("20", "10", "0")),
        (f"{SPEED}=3:3:1", ("3",)),
        ("rules.n_z_max=8:9:0.25", ("8", "8.25", "8.5", "8.75", "9")),
        (f"{SPEED}=0, 2 ,10:30:10", ("0", "2", "10", "20", "30")),
        ("settings.guess=plan,homotopy", ("plan", "homotopy")),
        ("rules=rbar-2014,rbar-2016", ("rbar-2014", "rbar-2016")),
        (f"{SPEED}=5.0,7.50,-0", ("5", "7.5", "0")),
        ("notes=12:30", ("12:30",)),
        # A full circle of directions is closed once; degrees that are no direction are no circle.
        (f"{FROM}=0:360:45", ("0", "45", "90", "135", "180", "225", "270", "315")),
        (f"{FROM}=-180:180:90", ("-180", "-90", "0", "90")),
        (f"{FROM}=360:0:-120", ("360", "240", "120")),
        (f"{FROM}=0:90:45", ("0", "45", "90")),
        (f"{FROM}=0:360:100", ("0", "100", "200", "300")),
        ("gates.f.roll_deg=0:360:180", ("0", "180", "360")),
    ],
)
def test_texts_stand_for_lists_and_ranges(text: str, values: tuple[str, ...]) -> None:
    assert parse_sweep(text).values == values


@pytest.mark.parametrize(
    ("text", "word"),
    [
        (SPEED, "form"),
        ("=1,2", "form"),
        ("a..b=1", "form"),
        (f"{SPEED}=", "no values"),
        (f"{SPEED}=1,,2", "missing between"),
        (f"{SPEED}=0:10:0", "never arrives"),
        (f"{SPEED}=0:10:-1", "never arrives"),
        (f"{SPEED}=5,5.0", "given twice"),
        (f"{SPEED}=0:10:5,10", "given twice"),
        (f"{SPEED}=0:100000:0.01", "more than"),
    ],
)
def test_what_is_no_sweep_is_refused_with_the_reason(text: str, word: str) -> None:
    with pytest.raises(ValueError, match=word):
        parse_sweep(text)


def test_a_batch_file_cannot_sweep_over_nothing() -> None:
    with pytest.raises(ValueError, match="no values"):
        sweep_of("a", [])


def test_several_sweeps_multiply_and_the_last_runs_fastest() -> None:
    sweeps = (sweep_of("a", ["1", "2"]), sweep_of("b", ["x", "y", "z"]))
    assert list(combinations(sweeps)) == [(("a", one), ("b", other)) for one in "12" for other in "xyz"]
    assert list(combinations(())) == list(cover(())) == [()]


@given(st.lists(st.integers(1, 9), min_size=1, max_size=4))
def test_every_value_occurs_in_the_cover_which_is_no_longer_than_the_longest_sweep(lengths: list[int]) -> None:
    sweeps = [sweep_of(f"k{number}", [*map(str, range(length))]) for number, length in enumerate(lengths)]
    covered = list(cover(sweeps))
    assert len(covered) == max(lengths)
    assert set(covered) <= set(combinations(sweeps))
    for sweep in sweeps:
        assert {dict(one)[sweep.key] for one in covered} == set(sweep.values)


@given(st.integers(-500, 500), st.integers(1, 40), st.integers(1, 30))
def test_ranges_are_exact_in_decimals(first: int, step: int, steps: int) -> None:
    last = first + step * steps
    values = parse_sweep(f"k={first / 10}:{last / 10}:{step / 10}").values
    assert len(values) == steps + 1
    assert [float(value) for value in values] == [(first + step * number) / 10 for number in range(steps + 1)]


@given(st.decimals(-1000, 1000, places=3))
def test_values_mean_to_set_what_they_were_written_as(value: object) -> None:
    (swept,) = parse_sweep(f"k={value:f}").values
    (override,) = parse_overrides([f"k={swept}"], [])
    assert override.value.value == float(str(value))


COURSE = Path("tracks/rovinj_2014.yaml")
SWEPT = (("environment.wind.speed_kt", "5"), ("environment.wind.from_deg", "45"))


def test_a_name_tells_course_aircraft_and_swept_values_and_keys_that_end_alike_in_full() -> None:
    assert job_name(COURSE, None, ()) == "rovinj_2014"
    assert job_name(COURSE, None, SWEPT) == "rovinj_2014,speed_kt=5,from_deg=45"
    assert job_name(COURSE, Path("configs/pc9.yaml"), SWEPT[:1]) == "rovinj_2014,pc9,speed_kt=5"
    swept = (("gates.a.height_m", "20"), ("gates.b.height_m", "30"))
    assert job_name(COURSE, None, swept) == "rovinj_2014,gates.a.height_m=20,gates.b.height_m=30"
    long = {job_name(COURSE, None, (("notes", "x" * 300 + end),)) for end in "ab"}
    assert len(long) == 2


@given(st.text(max_size=300), st.text(max_size=300))
def test_any_name_is_a_file_in_its_folder(value: str, stem: str) -> None:
    name = job_name(Path("x" + stem.replace("/", "").replace("\0", "")), None, (("notes", value),))
    assert Path(f"folder/{name}.h5").parent == Path("folder")
    assert len(f"{name}.h5".encode()) <= 200
    assert not name.startswith((".", "-"))


def test_two_jobs_that_would_write_one_file_are_both_named() -> None:
    with pytest.raises(UsageError, match=r"x\.h5: a/x\.yaml and b/x\.yaml"):
        refuse_clashes([("x", "a/x.yaml"), ("y", "a/y.yaml"), ("x", "b/x.yaml")])
    with pytest.raises(UsageError, match="given twice"):
        refuse_clashes([("x", "a/x.yaml"), ("x", "a/x.yaml")])
    with pytest.raises(UsageError, match="two jobs"):
        refuse_clashes([("Oval", "a/Oval.yaml"), ("oval", "a/oval.yaml")])


def reason(one: Job, folder: Path, repeat: Repeat = Repeat.NONE) -> str:
    return reason_to_fly(one, folder, repeat)[0]


def test_a_job_survives_its_own_plain_form() -> None:
    one = job(settings=Document("s.yaml", "ä\n"), overrides=("a=1",), swept=(("k", "v"),))
    assert Job.from_object(json.loads(json.dumps(asdict(one)))) == one


@pytest.mark.parametrize("code", [0, 4, 5])
def test_a_finished_job_is_kept_also_if_it_found_no_certified_flight(code: int, tmp_path: Path) -> None:
    assert reason(job(), tmp_path) == "new"
    finished(tmp_path, job(), code, "infeasible")
    assert reason(job(), tmp_path) == ""
    assert reason(job(track=Document("elsewhere/oval.yaml", "a track")), tmp_path) == ""
    assert reason(job(), tmp_path, Repeat.FAILED) == ("" if code == 0 else "asked for, since it failed: infeasible")
    assert reason(job(), tmp_path, Repeat.ALL) == "asked for"


@pytest.mark.parametrize(
    ("changed", "expected"),
    [
        ({"track": Document("oval.yaml", "another track")}, "the track changed"),
        ({"aircraft": Document("aircraft.yaml", "another one")}, "the aircraft changed"),
        ({"settings": Document("settings.yaml", "some")}, "the settings changed"),
        ({"overrides": ("rules.n_z_max=9",)}, "--set or --sweep changed"),
        ({"until": "six-dof"}, "the last stage was point-mass and is six-dof"),
        ({"versions": "airrace 9.9"}, "it was solved with other versions (airrace 0.1.0; now airrace 9.9)"),
    ],
)
def test_whatever_affects_the_result_is_noticed_and_named(
    changed: dict[str, object], expected: str, tmp_path: Path
) -> None:
    finished(tmp_path, job())
    assert reason(job(**changed), tmp_path) == expected


def test_every_part_of_the_fingerprint_has_its_words() -> None:
    one = Fingerprint(*("x" for _ in fields(Fingerprint)))
    for part in fields(Fingerprint):
        assert len(replace(one, **{part.name: "y"}).changes(one)) == 1


@pytest.mark.parametrize(
    ("code", "message", "expected"),
    [
        (8, "its process crashed (SIGSEGV)", "it failed: its process crashed (SIGSEGV)"),
        (6, "stopped after 5 s (--timeout)", "it failed: stopped after 5 s (--timeout)"),
        (130, "interrupted", "it was interrupted"),
        (3, "", "its input was not valid"),
    ],
)
def test_accidents_are_flown_again(code: int, message: str, expected: str, tmp_path: Path) -> None:
    finished(tmp_path, job(), code, message)
    assert reason(job(), tmp_path) == expected


def test_a_job_under_way_when_all_ended_is_flown_again(tmp_path: Path) -> None:
    write_record(tmp_path, "oval", JobRecord(job().fingerprint, ended=False))
    assert reason(job(), tmp_path) == "it was not finished"


def test_a_changed_checkpoint_is_noticed_but_a_copy_is_as_good(tmp_path: Path) -> None:
    finished(tmp_path, job())
    path = checkpoint_path(tmp_path, "oval")
    content = path.read_bytes()
    for changed, told in (
        (content, ""),
        (content[::-1], "its checkpoint has changed (in its content)"),
        (content + b"x", f"its checkpoint has changed (from {len(content)} to {len(content) + 1} bytes)"),
    ):
        path.write_bytes(changed)
        os.utime(path, ns=(1, 1))
        assert reason(job(), tmp_path) == told
    path.unlink()
    assert reason(job(), tmp_path) == "its checkpoint is missing"
    finished(tmp_path, job())
    record_path(tmp_path, "oval").unlink()
    assert reason(job(), tmp_path) == "its record is missing"


@pytest.mark.parametrize(
    "content", [b"", b"{", b"[]", b"null", b'{"schema": "airrace/job/1"}', b"\xff\xfe", b"[" * 9999]
)
def test_a_damaged_record_is_reported_and_never_a_crash(content: bytes, tmp_path: Path) -> None:
    finished(tmp_path, job())
    record_path(tmp_path, "oval").write_bytes(content)
    assert reason(job(), tmp_path) == "its record is damaged"


def test_any_truncation_of_a_record_is_noticed(tmp_path: Path) -> None:
    finished(tmp_path, job())
    content = record_path(tmp_path, "oval").read_bytes()
    for length in range(len(content)):
        record_path(tmp_path, "oval").write_bytes(content[:length])
        assert reason(job(), tmp_path) == "its record is damaged"


def test_a_record_says_after_a_round_trip_what_it_said(tmp_path: Path) -> None:
    findings = (Finding("a.yaml", 3, 4, "rules.n_z_max", "must be a number, not the text `ä`"),)
    run = {"race_time_s": 55.25, "stages": []}
    record = JobRecord(job().fingerprint, True, 3, "bad", 1.5, ("crashed",), run, findings, None)
    write_record(tmp_path, "oval", record)
    assert read_record(tmp_path, "oval") == record
