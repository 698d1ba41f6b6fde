"""Libraries that come along: the very files that were published, with their licences beside them."""

import hashlib
import json

import pytest

from airrace.report.script import LIBRARIES

KNOWN = json.loads((LIBRARIES / "libraries.json").read_text(encoding="utf-8"))


def test_every_library_is_declared() -> None:
    assert {path.name for path in LIBRARIES.iterdir() if path.is_dir()} == set(KNOWN)


@pytest.mark.parametrize("name", KNOWN)
def test_a_library_is_the_file_that_was_published(name: str) -> None:
    found = {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in (LIBRARIES / name).iterdir()}
    assert found == KNOWN[name]["files"]


@pytest.mark.parametrize("name", KNOWN)
def test_a_library_says_where_it_comes_from_and_under_which_licence(name: str) -> None:
    told = KNOWN[name]
    assert told["licence"] in (LIBRARIES / name / "LICENSE").read_text(encoding="utf-8")
    assert f"{name}@{told['version']}" in told["source"]
