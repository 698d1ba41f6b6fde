"""Courses far longer than any race: read, checked and refused with work that grows with them and no faster."""

import random

import pytest
from language_texts import findings_of, understood
from operations import assert_grows_no_faster_than_its_input

from airrace.errors import InputError

GATES = 5000
FEW = 150
"""Gates of the courses whose work is counted, beside those with eight times as many."""


def long_course(count: int = GATES, *, unknown: int = 0) -> str:
    """Every gate flown once; the first names of the lap may be unknown ones."""
    choose = random.Random(1)
    gates: list[str] = []
    for index in range(count):
        place = f"north_m: {choose.uniform(-2e4, 2e4):.1f}, east_m: {choose.uniform(-2e4, 2e4):.1f}"
        level = f"{{type: level, {place}, heading_deg: {choose.randrange(360)}, width_m: 13, height_m: 20}}"
        pylon = f"{{type: pylon, {place}, pass_side_deg: {choose.randrange(360)}}}"
        gates.append(f"  g{index}: {level if index % 2 else pylon}")
    names = [f"g{index}x" if index <= unknown else f"g{index}" for index in range(1, count)]
    lap = [f"    - {{gate: {name}, direction: reverse}}" if index % 2 == 0 else f"    - {name}"
           for index, name in enumerate(names)]  # fmt: skip
    head = ["schema: airrace/track/1", "name: Long", "rules: rbar-2016", "gates:"]
    return "\n".join([*head, *gates, "course:", "  start: g0", "  lap:", *lap, ""])


def test_the_work_to_understand_a_course_grows_with_its_gates_and_no_faster() -> None:
    def understand(count: int) -> None:
        assert len(understood(long_course(count)).race.course.passages) == count

    assert_grows_no_faster_than_its_input(understand, FEW)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("heading_deg", "headin_deg"),
        pytest.param("north_m", "noth_m", marks=pytest.mark.slow),
        pytest.param("{gate: g", "{gate: h", marks=pytest.mark.slow),
    ],
)
def test_the_work_to_tell_faults_grows_with_their_number_and_no_faster(old: str, new: str) -> None:
    def tell(count: int) -> None:
        found = findings_of(long_course(count).replace(old, new))
        assert found
        assert all(finding.message for finding in found)

    assert_grows_no_faster_than_its_input(tell, FEW)


def test_the_work_to_tell_unknown_names_grows_with_their_number_and_no_faster() -> None:
    def tell(count: int) -> None:
        assert findings_of(long_course(count, unknown=4 * count // 5))

    assert_grows_no_faster_than_its_input(tell, FEW)


def test_of_thousands_of_unknown_names_the_first_are_told_and_all_are_counted() -> None:
    with pytest.raises(InputError) as raised:
        understood(long_course(unknown=4000))
    found = raised.value.findings
    assert raised.value.count == 4000
    assert len(found) == 101
    assert found[0].message.startswith("unknown gate `g1x`; did you mean `g1")
    assert found[-1].message == "and 3900 more findings from here on"
