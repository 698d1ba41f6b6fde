"""`start_state` and `finish_state` of a course."""

import pytest
from language_texts import TRACK, edited, findings_of, understood

from airrace.track.course import EndState


def ends(*overrides: str) -> tuple[EndState, EndState]:
    course = understood(overrides=overrides).race.course
    return course.start_state, course.finish_state


def test_start_is_settled_and_finish_free_by_default() -> None:
    assert ends() == (EndState.SETTLED, EndState.FREE)


@pytest.mark.parametrize("start", EndState)
@pytest.mark.parametrize("finish", EndState)
def test_ends_are_what_the_file_says(start: EndState, finish: EndState) -> None:
    assert ends(f"course.start_state={start.value}", f"course.finish_state={finish.value}") == (start, finish)


def test_resolved_inputs_tell_both_ends() -> None:
    course = understood(overrides=("course.finish_state=settled",)).resolved["course"]
    assert isinstance(course, dict)
    assert (course["start_state"], course["finish_state"]) == ("settled", "settled")


@pytest.mark.parametrize("key", ["start_state", "finish_state"])
def test_a_state_that_does_not_exist_is_refused_where_it_stands(key: str) -> None:
    (found,) = findings_of(edited(TRACK, "  laps: 2\n", f"  laps: 2\n  {key}: setled\n"))
    assert (found.file, found.line, found.key) == ("t.yaml", 19, f"course.{key}")
    assert found.message == "must be one of settled, free, not the text `setled`; did you mean `settled`?"
