"""The reader: what it accepts means what YAML 1.2 says, everything else is a finding with its place."""

import contextlib
import string

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from airrace.errors import Finding, InputError
from airrace.inputs.nodes import MappingNode
from airrace.inputs.yaml_reader import DEPTH_MAX, read_yaml

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


def findings_of(text: str) -> list[Finding]:
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
    (finding,) = findings_of(f"first: 1\nkey: {text}\n")
    assert (finding.file, finding.line, finding.column, finding.key) == ("t.yaml", 2, 6, "key")
    assert words in finding.message


def test_a_duplicate_key_is_reported_with_both_lines() -> None:
    (finding,) = findings_of("gates:\n  g1: 1\n  g2: 2\n  g1: 3\n")
    assert str(finding) == "t.yaml:4:3: gates.g1: duplicate key; first in line 2"


def test_fifty_thousand_brackets_are_refused() -> None:
    for text in ("[" * 50_000, "{a: " * 50_000, "- " * 50_000, "? " * 50_000):
        assert any("nested more than" in finding.message for finding in findings_of(text))


def test_nesting_up_to_the_limit_is_read() -> None:
    assert read_yaml("t.yaml", "[" * DEPTH_MAX + "]" * DEPTH_MAX)
    assert findings_of("[" * (DEPTH_MAX + 1) + "]" * (DEPTH_MAX + 1))


def test_a_text_beyond_the_size_limit_is_refused() -> None:
    assert "too large" in findings_of("a: " + "x" * 2_100_000)[0].message


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
    finding = findings_of(text)[-1]
    assert (finding.line, finding.column) == (line, column)
    assert words in finding.message


@given(st.text(max_size=200))
def test_any_text_is_either_read_or_refused(text: str) -> None:
    with contextlib.suppress(InputError):
        assert read_yaml("t.yaml", text).place.line >= 1
