"""libyaml and PyYAML's own parser: fast and slow, the same tree, the same findings."""

import random
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import yaml

from airrace.errors import InputError
from airrace.inputs.nodes import Node
from airrace.inputs.yaml_reader import DEPTH_MAX, FAST, NODES_MAX, PLAIN_WORDS_MAX, PURE, Loader, read_yaml

ROOT = Path(__file__).parents[2]
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
    assert counted["get_event"] <= 2 * DEPTH_MAX + 3
    assert counted["fetch_more_tokens"] <= 1100


@pytest.mark.parametrize(("comments", "parsers"), [(1, [FAST, PURE]), (PLAIN_WORDS_MAX // 8, [FAST])])
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
    found = read("[" + "1," * (NODES_MAX + 10) + "]", FAST)
    assert found == [f"t.yaml:1:{2 * NODES_MAX}: more than {NODES_MAX} values; nothing behind this one is read"]


@pytest.mark.parametrize("loader", [FAST, PURE])
def test_a_key_as_long_as_a_text_is_refused(loader: Loader) -> None:
    found = read("? " + "x" * 5000 + "\n: 1\n", loader)
    assert found == ["t.yaml:1:3: a key is longer than 100 characters"]
