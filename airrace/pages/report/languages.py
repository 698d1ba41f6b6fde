"""The texts of films and cards in the languages of their audiences, and numbers as those write them."""

import functools
import math
import tomllib
from collections.abc import Callable, Collection, Mapping, Sequence

from airrace.flights.results import Flight
from airrace.flights.results.stamp import FREEZING
from airrace.flights.results.time_loss import Cause, Loss, Part
from airrace.model.environment import atmosphere_parameters, density, temperature
from airrace.pages.report.film import Language
from airrace.pages.report.script import FOLDER
from airrace.pages.views.comparison_tables import difference_value
from airrace.pages.views.tables import Units

REASONS_MAX, FACTS_MAX = 2, 2
"""The number of reasons that are told of the loss on a leg, and of facts that explain each of them."""


@functools.cache
def _texts() -> Mapping[str, Mapping[str, Sequence[str]]]:
    """Return the texts of all languages: of the graphics, which the page writes, of what a flight is, and of losses."""
    return tomllib.loads((FOLDER / "languages.toml").read_text(encoding="utf-8"))


def decimal_sign(language: Language) -> str:
    """Return what stands before the decimals of a number."""
    return "." if language is Language.EN else ","


def _translator(language: Language) -> Callable[[str], str]:
    """Return a function from what is to be said to the text of a language."""
    place, texts = list(Language).index(language), _texts()["flight"]
    return lambda key: texts[key][place]


def graphics_texts(language: Language) -> Mapping[str, str]:
    """Return the texts of the graphics by their keys."""
    place = list(Language).index(language)
    return {key: texts[place] for key, texts in _texts()["graphics"].items()}


def stamp_text(flight: Flight, language: Language, units: Units) -> str:
    """Return what a flight is in one line; in English as its stamp says it, in other languages in short."""
    stamp = flight.stamp
    if language is Language.EN:
        return stamp.text
    say, sign = _translator(language), decimal_sign(language)
    parameters = atmosphere_parameters(flight.air)
    degrees = f"{float(temperature(0.0, parameters)) - FREEZING:.0f} °C"
    air = f"{float(density(0.0, parameters)):.3f} kg/m³".replace(".", sign)
    head = stamp.stage or say("as flown")
    if stamp.certified is not None:
        head += f", {say('certified' if stamp.certified else 'not certified')}"
    texts = [head, flight.aircraft.name, f"{wind_text(flight, language, units)}, {degrees}, {air}"]
    if stamp.pilot:
        texts.append(f"{say('limits')}: {stamp.pilot}")
    if stamp.status is not None:
        reserve = say("none")
        if stamp.reserve is not None:
            reached = "" if stamp.reserve.reached else f" ({say('not reached')})"
            reserve = f"{stamp.reserve.asked:g}".replace(".", sign) + reached
        texts.append(f"{say('reserve')}: {reserve}")
    return "; ".join(texts)


def cause_text(cause: Cause, other_wind: bool, language: Language) -> str:
    """Return a cause of a loss; the rest of the energy is also that of the wind where it is `other_wind`."""
    name = "wind" if other_wind and cause is Cause.ENERGY else cause.value
    return _texts()["causes"][name][list(Language).index(language)]


def reason_texts(
    loss: Loss, common: Collection[Cause], other_wind: bool, language: Language, units: Units
) -> list[dict[str, object]]:
    """Return by what a flight loses its time on a leg, each with its rank and the facts that explain it.

    What is particular of the leg has the rank 0 and comes first, then the aircraft, and last the speed at its
    beginning, which earlier legs cost; those of one rank by what they cost.

    Args:
        loss: on one leg.
        common: causes that cost the flight time on every leg, which are left out.
        other_wind: whether the wind is not that of the other flight.
        language, units: of the texts.
    """
    place, sign = list(Language).index(language), decimal_sign(language)
    fact_texts = _texts()["facts"]
    begin = loss.legs[0].reference.before.passage.element.name
    reasons: list[dict[str, object]] = []

    def rank(part: Part) -> int:
        return 2 if part.cause is Cause.ENTRY else int(part.cause in (Cause.DRAG, Cause.POWER))

    for part in sorted(loss.parts, key=lambda part: (rank(part), -part.amount)):
        if part.cause is None or part.cause in common or part.amount <= 0.0:
            continue
        values = [(fact.name, difference_value(fact, units).replace(".", sign)) for fact in part.facts[:FACTS_MAX]]
        facts = [fact_texts[name][place].format(value, begin) for name, value in values]
        text = cause_text(part.cause, other_wind, language)
        reasons.append({"cause": text, "lost": part.amount, "rank": rank(part), "facts": facts})
    return reasons[:REASONS_MAX]


def wind_text(flight: Flight, language: Language, units: Units) -> str:
    """Return the wind in which a flight is flown."""
    wind, say = flight.air.wind, _translator(language)
    if wind is None or not wind.speed > 0.0:
        return say("still air")
    origin = f"{round(math.degrees(wind.origin)) % 360:03d}"
    return say("wind").format(f"{wind.speed * units.per_m_s:.0f}", units.speed, origin)


def state_text(flight: Flight, misses: int, language: Language) -> str:
    """Return whether a flight is certified and verified, and past how many pylons it is too near."""
    say, source = _translator(language), flight.source
    texts = [say("recorded")]
    if source.certified is not None:
        texts = [say("certified" if source.certified else "not certified")]
    if source.verification is not None:
        texts.append(say(source.verification.outcome))
    if misses:
        texts.append(say("pylons too near").format(misses))
    return ", ".join(texts)
