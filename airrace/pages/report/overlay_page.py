"""The page of the live graphic: that of films, over nothing or a key colour, of a flight while it is flown."""

import hashlib
import html
import string
from collections.abc import Sequence
from dataclasses import asdict

from airrace.flights.results import Flight
from airrace.flights.results.flight import Entrant
from airrace.pages.report.contents import as_json, contents_of
from airrace.pages.report.film import Language
from airrace.pages.report.flight_page import STYLES, source_hash
from airrace.pages.report.languages import graphics_texts
from airrace.pages.report.script import FOLDER, join_modules
from airrace.pages.views.map_model import map_model
from airrace.pages.views.plain_text import plain

STYLE = """/* Nothing but the graphics. */
:root, body { margin: 0; padding: 0; max-width: none; overflow: hidden; background: transparent; color-scheme: normal; }
canvas { display: block; width: 100vw; height: 100vh; }
svg { position: absolute; }
"""


def overlay_page(flights: Sequence[Flight], entrant: Entrant, language: Language) -> tuple[str, str]:
    """Return the page as HTML, and a name of what it carries, by which it sees that it is to be loaded again.

    Args:
        flights: those beside the live one, the first by whose optimum is flown.
        entrant: who flies live.
        language: of texts and numbers.
    """
    first = flights[0]
    everything = contents_of(flights, [], map_model(first.race), language=language)
    contents = {key: everything[key] for key in ("units", "flights", "broadcast")}
    contents["title"] = plain(first.course.name)
    contents["live"] = {
        **{key: value for key, value in asdict(entrant).items() if key != "name"},
        "label": entrant.name or graphics_texts(language)["live"],
        "named": bool(entrant.name),
        "aircraft": {"name": first.aircraft.name, "span": first.aircraft.airframe.b},
        "penalties": [],
        "time": "",
        "histories": {},
    }
    contents["page"] = hashlib.sha256(as_json(contents).encode()).hexdigest()
    style, script = STYLES[-1].read_text(encoding="utf-8") + STYLE, join_modules(FOLDER / "script" / "overlay.js")
    page = string.Template((FOLDER / "overlay.html").read_text(encoding="utf-8")).substitute(
        policy=f"default-src 'none'; script-src {source_hash(script)}; style-src-elem {source_hash(style)}; "
        "style-src-attr 'unsafe-inline'; connect-src 'self'; base-uri 'none'; form-action 'none'",
        language=language,
        title=html.escape(contents["title"]),
        style=style,
        contents=as_json(contents),
        script=script,
    )
    return page, str(contents["page"])
