"""The texts of films and cards in five languages, and numbers as those write them."""

import tomllib

import pytest
from example_flights import half_cuban, windy
from report_pages import circle, read

from airrace.errors import UsageError
from airrace.flights.results import Entrant, Penalty
from airrace.flights.results.comparison import compare_flights
from airrace.flights.results.time_loss import FACTS, Cause
from airrace.pages.report.film import Language, language_named
from airrace.pages.report.flight_page import flight_page
from airrace.pages.report.languages import stamp_text
from airrace.pages.report.script import FOLDER
from airrace.pages.views.tables import RACE

TEXTS = tomllib.loads((FOLDER / "languages.toml").read_text(encoding="utf-8"))


@pytest.mark.parametrize("part", TEXTS)
def test_every_text_is_there_in_every_language_with_the_same_values(part: str) -> None:
    for key, texts in TEXTS[part].items():
        assert len(texts) == len(Language), key
        assert len({text.count("{}") for text in texts}) == 1, key
        assert all(text.strip() for text in texts), key


def test_the_rules_that_may_be_broken_have_their_texts() -> None:
    from airrace.flights.logs.violations import Violation

    rules = (Violation.__doc__ or "").partition("rule:")[2].partition("time:")[0].split("`")[1::2]
    assert len(rules) > 10
    assert set(rules) <= set(TEXTS["graphics"])


@pytest.mark.parametrize("language", [language for language in Language if language is not Language.EN])
def test_what_a_flight_is_has_no_english_word_and_a_decimal_comma(language: Language) -> None:
    for flight in (half_cuban().flight(), windy().flight()):
        text = stamp_text(flight, language, RACE)
        english = [texts[0] for texts in TEXTS["flight"].values() if texts[0] != texts[list(Language).index(language)]]
        words = [word for word in english if "{" not in word and f" {word}" in text and word != "reserve"]
        assert words == []
        assert "1,2" in text
        assert "1.2" not in text


def test_every_cause_of_a_loss_on_a_leg_and_every_fact_has_its_text() -> None:
    carried = {Cause.CARRIED.value}  # of several legs alone
    assert set(TEXTS["causes"]) == {cause.value for cause in Cause} - carried | {"wind"}
    assert set(TEXTS["facts"]) == {measure.name for measures in FACTS.values() for measure in measures}


@pytest.mark.parametrize("language", Language)
def test_the_page_knows_what_is_lost_on_every_leg_and_why(language: Language) -> None:
    flights = half_cuban().flight(), windy().flight()
    contents = read(flight_page(flights, language=language)).contents
    legs = contents["differences"][0]["legs"]
    compared = compare_flights(*flights)
    assert [leg["passing"] for leg in legs] == list(range(1, len(compared.legs) + 1))
    assert [leg["lost"] for leg in legs] == pytest.approx([leg.difference for leg in compared.legs])
    for leg in legs:
        assert len(leg["reasons"]) <= 2
        ranks = [reason["rank"] for reason in leg["reasons"]]
        assert ranks == sorted(ranks)
        for reason in leg["reasons"]:
            assert reason["cause"] in [texts[list(Language).index(language)] for texts in TEXTS["causes"].values()]
            assert reason["lost"] > 0.0
            assert reason["cause"] not in [cause["cause"] for cause in contents["differences"][0]["common"]]
            assert all("." not in fact or language is Language.EN for fact in reason["facts"])
    assert any(reason["facts"] for leg in legs for reason in leg["reasons"])


def test_in_english_a_film_says_what_the_stamp_says() -> None:
    assert stamp_text(circle(), Language.EN, RACE) == circle().stamp.text


def test_a_language_that_is_not_known_is_refused_with_those_that_are() -> None:
    with pytest.raises(UsageError, match="en, de, fr, it, es"):
        language_named("pt")


def test_the_page_knows_who_flies_and_what_was_broken() -> None:
    from dataclasses import replace

    flight = circle()
    entrant = Entrant("Ada", "SUI", "7", "#ff8800")
    passing = flight.crossings[3]
    penalties = (
        Penalty(passing.name, "too-high", passing.time, 2.0),
        Penalty("", "load-factor", 9.0, float("inf")),
        Penalty("", "crowd", 10.0, float("nan")),
    )
    source = replace(flight.source, entrant=entrant, called_penalties=penalties)
    told = read(flight_page([replace(flight, source=source)], language=Language.DE)).contents
    first = told["flights"][0]
    assert [first[name] for name in ("named", "nation", "number", "colour")] == [True, "SUI", "7", "#ff8800"]
    assert [penalty["seconds"] for penalty in first["penalties"]] == [2.0, None, 0.0]
    assert first["penalties"][0]["gate"] == passing.passage.element.name
    assert first["penalties"][0]["time"] == pytest.approx(first["passings"][3]["time"])
    assert told["broadcast"]["decimal"] == ","
    assert told["broadcast"]["texts"]["finish"] == "Ziel"
