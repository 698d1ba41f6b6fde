"""Reading YAML: values with places, both parsers, long files."""

import contextlib
import random
import string
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from language_texts import findings_of, understood
from operations import assert_grows_no_faster_than_its_input

from airrace.errors import Finding, InputError
from airrace.files.inputs.nodes import DEPTH_MAX, REREAD_MAX, VALUES_MAX, MappingNode, Node
from airrace.files.inputs.yaml_reader import FAST, PURE, Loader, read_yaml

KEYS = st.text(alphabet=string.ascii_letters + string.digits + "_-", min_size=1, max_size=12)
SCALARS = (
    st.none()
    | st.booleans()
    | st.integers(min_value=-(2**63) + 1, max_value=2**63 - 1)
    | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(alphabet=st.characters(codec="utf-8", exclude_categories=("Cc", "Cs")), max_size=20)
)
VALUES = st.recursive(
    SCALARS, lambda inner: st.lists(inner, max_size=4) | st.dictionaries(KEYS, inner, max_size=4), max_leaves=20
)


def value_of(text: str) -> object:
    node = read_yaml("t.yaml", f"key: {text}\n")
    assert isinstance(node, MappingNode)
    return node.scalar("key")


def findings_in(text: str) -> list[Finding]:
    with pytest.raises(InputError) as raised:
        read_yaml("t.yaml", text)
    return raised.value.findings


def write(value: object) -> str:
    """YAML flow style with all text quoted, as JSON is: what a strict reader must give back unchanged."""
    if isinstance(value, dict):
        return "{" + ", ".join(f'"{key}": {write(item)}' for key, item in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(write(item) for item in value) + "]"
    if isinstance(value, str):
        return yaml.safe_dump(value, default_style='"', allow_unicode=True, width=10**6).strip()
    if value is None or isinstance(value, bool):
        return str(value).lower().replace("none", "null")
    return repr(value)


@given(st.dictionaries(KEYS, VALUES, max_size=5))
def test_what_is_written_is_read_back(mapping: dict[str, object]) -> None:
    read = read_yaml("t.yaml", write(mapping)).plain()
    assert read == mapping
    assert repr(read) == repr(mapping)  # 1 is not 1.0 is not True


@given(st.dictionaries(KEYS, st.floats(-1e6, 1e6) | st.integers(-999, 999), min_size=1, max_size=8))
def test_every_key_keeps_its_line(mapping: dict[str, float]) -> None:
    node = read_yaml("t.yaml", "".join(f"{key}: {value!r}\n" for key, value in mapping.items()))
    assert isinstance(node, MappingNode)
    places = [(entry.key_place.line, entry.value.place.column) for entry in node.entries.values()]
    assert places == [(line, len(key) + 3) for line, key in enumerate(mapping, start=1)]


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1e3", 1000.0),
        ("1E-4", 1e-4),
        (".5", 0.5),
        ("-7.", -7.0),
        ("0x1F", 31),
        ("0o17", 15),
        ("0", 0),
        ("no", "no"),
        ("on", "on"),
        ("Yes", "Yes"),
        ("True", True),
        ("12:30", "12:30"),
        ("1_000", "1_000"),
        ("2014-04-13", "2014-04-13"),
        ("'012'", "012"),
        ("~", None),
        ("nan", "nan"),
    ],
)
def test_plain_scalars_follow_yaml_1_2(text: str, value: object) -> None:
    assert value_of(text) == value
    assert type(value_of(text)) is type(value)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("012", "write `12`"),
        ("-007", "ambiguous"),
        (".nan", "not a finite number"),
        ("-.inf", "not a finite number"),
        ("1e999", "too large"),
        ("9" * 30, "too large"),
        ("&a 1", "anchors"),
        ("*a", "aliases"),
        ("!!str 1", "tags"),
        ("!!python/object/apply:os.system [ls]", "tags"),
        ("! x", "tags"),
    ],
)
def test_dangerous_or_ambiguous_values_are_refused_where_they_stand(text: str, words: str) -> None:
    (finding,) = findings_in(f"first: 1\nkey: {text}\n")
    assert (finding.file, finding.line, finding.column, finding.key) == ("t.yaml", 2, 6, "key")
    assert words in finding.message


def test_nesting_up_to_the_limit_is_read() -> None:
    assert read_yaml("t.yaml", "[" * DEPTH_MAX + "]" * DEPTH_MAX)
    assert findings_in("[" * (DEPTH_MAX + 1) + "]" * (DEPTH_MAX + 1))


def test_a_text_beyond_the_size_limit_is_refused() -> None:
    assert "too large" in findings_in("a: " + "x" * 2_100_000)[0].message


@pytest.mark.parametrize(
    ("text", "line", "column", "words"),
    [
        ("", 0, 0, "empty"),
        ("# only a comment\n", 0, 0, "empty"),
        ("a: 1\n\tb: 2\n", 2, 1, "tab"),
        ("a: [1, 2\nb: 3\n", 2, 2, "not valid YAML"),
        ("a: 1\n---\nb: 2\n", 2, 1, "second YAML document"),
        ("? [a, b]\n: 1\n", 1, 3, "must be plain text"),
        ('"": 1\n', 1, 1, "key is empty"),
        ("a: 1\nb: \x07\n", 2, 4, "U+0007"),
    ],
)
def test_a_text_that_is_no_document_is_refused_with_its_place(text: str, line: int, column: int, words: str) -> None:
    finding = findings_in(text)[-1]
    assert (finding.line, finding.column) == (line, column)
    assert words in finding.message


@given(st.text(max_size=200))
def test_any_text_is_either_read_or_refused(text: str) -> None:
    with contextlib.suppress(InputError):
        assert read_yaml("t.yaml", text).place.line >= 1


ROOT = Path(__file__).parents[3]
SHIPPED = sorted([*(ROOT / "tracks").glob("*.yaml"), *(ROOT / "configs").glob("*.yaml")])

pytestmark = pytest.mark.skipif(FAST is PURE, reason="PyYAML comes without libyaml here")


def read(text: str, loader: Loader) -> Node | list[str]:
    """The tree, or what was found."""
    try:
        return read_yaml("t.yaml", text, loader)
    except InputError as error:
        return [str(finding) for finding in error.findings]


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_both_parsers_read_the_same_tree_with_the_same_places(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    assert read(text, FAST) == read(text, PURE)


@pytest.mark.parametrize(
    "text",
    [
        "a: &x 1\nb: *x\n",
        "a: !!str 1\nb: ! y\n",
        "a: 1\na: 2\n",
        "a: 012\nb: .nan\n",
        "? [a]\n: 1\n",
        "a: |\n  text\n  more\nb: >-\n  folded\n  text\n",
        "a: \"quo\\\"ted\"\nb: 'it''s'\n",
        "a:\n- 1\n-\n- - 2\n  - 3\n",
        "ä: ö\n😀: [ü, 'é']\n",
        "a: [1, 2\nb: 3\n",
        "a: 1\n\tb: 2\n",
        "a: {b: 1,, c: 2}\n",
        "a: 'open\n",
        "--- a\n...\n--- b\n",
        "a: \x07\n",
        "a: \ufeffb\n",
        "a: \ud800\n",
        "",
        "# nothing\n",
    ],
)
def test_both_parsers_find_the_same(text: str) -> None:
    assert read(text, FAST) == read(text, PURE)


def test_both_parsers_agree_on_spoilt_files() -> None:
    """Characters exchanged at random; libyaml is a little more generous, which is the only difference."""
    choose = random.Random(7)
    text = (ROOT / "tracks/half_cuban_eight.yaml").read_text(encoding="utf-8")
    compared = 0
    for _ in range(200):
        letters = list(text)
        for _ in range(3):
            letters[choose.randrange(len(letters))] = choose.choice(" \n:-[]{},#&*!|>'\"%@`ax1")
        fast, pure = read("".join(letters), FAST), read("".join(letters), PURE)
        if not isinstance(fast, list) and isinstance(pure, list):
            assert all("not valid YAML" in finding for finding in pure)
            continue
        compared += 1
        assert fast == pure
    assert compared > 190


@pytest.mark.parametrize("loader", [FAST, PURE])
@pytest.mark.parametrize("opening", ["[", "{", "{a: ", "- ", "? ", "[{"])
def test_sixty_thousand_brackets_are_refused_without_reading_them_all(opening: str, loader: Loader) -> None:
    """PyYAML's own parser looks up to 1024 characters ahead, for a key may end there."""
    counted = {"get_event": 0, "fetch_more_tokens": 0}

    def counting(name: str) -> Callable[[yaml.SafeLoader], object]:
        def count(self: yaml.SafeLoader) -> object:
            counted[name] += 1
            return getattr(super(Counted, self), name)()

        return count

    Counted: Loader = type("Counted", (loader,), {name: counting(name) for name in counted})
    found = read(opening * 60_000, Counted)
    assert isinstance(found, list)
    assert opening == "[{" or any("nested more than" in finding for finding in found)  # a mapping is no key
    assert counted["get_event"] <= 2 * DEPTH_MAX + 3
    assert counted["fetch_more_tokens"] <= 1100


@pytest.mark.parametrize(("comments", "parsers"), [(1, [FAST, PURE]), (REREAD_MAX // 8, [FAST])])
def test_a_text_that_is_no_yaml_is_read_again_unless_it_is_long(
    comments: int, parsers: list[Loader], monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[Loader] = []

    def parse(text: str, Loader: Loader) -> Iterator[yaml.Event]:
        asked.append(Loader)
        return parsed(text, Loader=Loader)

    parsed = yaml.parse
    monkeypatch.setattr(yaml, "parse", parse)
    found = read("a: 1\n" + "# comment\n" * comments + "b: [1\n", FAST)
    assert asked == parsers
    assert isinstance(found, list)
    assert "not valid YAML" in found[-1]


def test_a_document_of_too_many_values_is_left_where_they_become_too_many() -> None:
    found = read("[" + "1," * (VALUES_MAX + 10) + "]", FAST)
    assert found == [f"t.yaml:1:{2 * VALUES_MAX}: more than {VALUES_MAX} values; nothing behind this one is read"]


@pytest.mark.parametrize("loader", [FAST, PURE])
def test_a_key_as_long_as_a_text_is_refused(loader: Loader) -> None:
    found = read("? " + "x" * 5000 + "\n: 1\n", loader)
    assert found == ["t.yaml:1:3: a key is longer than 100 characters"]


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


def test_of_thousands_of_unknown_names_the_first_are_reported_and_all_are_counted() -> None:
    with pytest.raises(InputError) as raised:
        understood(long_course(unknown=4000))
    found = raised.value.findings
    assert raised.value.count == 4000
    assert len(found) == 101
    assert found[0].message.startswith("unknown gate `g1x`; did you mean `g1")
    assert found[-1].message == "and 3900 more findings from here on"
