"""libyaml and PyYAML's own parser: fast and slow, the same tree, the same findings."""

import random
import time
from pathlib import Path

import pytest

from airrace.documents.nodes import Node
from airrace.documents.yaml_reader import FAST, NODES_MAX, PLAIN_WORDS_MAX, PURE, Loader, read_yaml
from airrace.errors import InputError

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


def timed(text: str, loader: Loader) -> tuple[object, float]:
    """What a text is read as, and the processor time that it takes at its best of three: machines have slow moments."""
    taken: list[float] = []
    found: object = None
    for _ in range(3):
        started = time.process_time()
        found = read(text, loader)
        taken.append(time.process_time() - started)
    return found, min(taken)


@pytest.mark.parametrize(("loader", "seconds"), [(FAST, 0.2), (PURE, 1.0)])
@pytest.mark.parametrize("opening", ["[", "{", "{a: ", "- ", "? ", "[{"])
def test_sixty_thousand_brackets_are_refused_at_once(opening: str, loader: Loader, seconds: float) -> None:
    found, taken = timed(opening * 60_000, loader)
    assert taken < seconds
    assert isinstance(found, list)


def test_a_long_text_that_is_no_yaml_is_not_read_twice() -> None:
    text = "a: 1\n" + "# comment\n" * (PLAIN_WORDS_MAX // 8) + "b: [1\n"
    found, taken = timed(text, FAST)
    assert taken < 0.2
    assert isinstance(found, list)
    assert "not valid YAML" in found[-1]


def test_a_document_of_too_many_values_is_left_where_they_become_too_many() -> None:
    found = read("[" + "1," * (NODES_MAX + 10) + "]", FAST)
    assert found == [f"t.yaml:1:{2 * NODES_MAX}: more than {NODES_MAX} values; nothing behind this one is read"]


@pytest.mark.parametrize("loader", [FAST, PURE])
def test_a_key_as_long_as_a_text_is_refused(loader: Loader) -> None:
    found = read("? " + "x" * 5000 + "\n: 1\n", loader)
    assert found == ["t.yaml:1:3: a key is longer than 100 characters"]
