"""Flights with those who fly them, as they are named to a command."""

from pathlib import Path

import pytest

from airrace.errors import UsageError
from airrace.flights.results import Entrant
from airrace.runs.output import FlightName


@pytest.mark.parametrize(
    ("text", "stage", "entrant"),
    [
        ("run.h5", None, Entrant()),
        ("run.h5:six-dof", "six-dof", Entrant()),
        (
            'run.h5,name="A. Bee",nation=SUI,number=7,colour=#ff8800',
            None,
            Entrant("A. Bee", "SUI", "7", "#ff8800"),
        ),
        ("run.h5:six-dof,name=A. Bee,nation=sui", "six-dof", Entrant("A. Bee", "SUI")),
        ('run.h5, name="Bee, A.", number = 07', None, Entrant("Bee, A.", number="07")),
        ("run.h5,name=O'Brien", None, Entrant("O'Brien")),
    ],
)
def test_details_behind_commas_say_who_flies(text: str, stage: str | None, entrant: Entrant) -> None:
    assert FlightName.of(text) == FlightName(Path("run.h5"), stage, entrant)


def test_a_file_whose_name_holds_a_comma_comes_first(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("a,name=b.h5", "a,b.h5"):
        Path(name).touch()
        assert FlightName.of(name) == FlightName(Path(name), None)
    assert FlightName.of("c,d.h5") == FlightName(Path("c,d.h5"), None)


@pytest.mark.parametrize(
    ("details", "told"),
    [
        ("name=", "'' is no name: expected a name"),
        ("nation=Switzerland", "'Switzerland' is no nation: expected a code of two or three letters, such as SUI"),
        ("number=12345", "up to four letters or digits"),
        ("colour=red", "a colour such as #ff8800"),
        ("name=A,name=B", "the name is told twice"),
        ("name=A,team=B", "'team=B' tells nothing of an entrant; known are name, nation, number, colour"),
        ("name=A,B", "'B' tells nothing"),
    ],
)
def test_details_that_say_nothing_are_refused_with_what_would_be_right(details: str, told: str) -> None:
    with pytest.raises(UsageError, match=r"run\.h5") as raised:
        FlightName.of(f"run.h5,{details}")
    assert told in str(raised.value)
