"""What names of placemarks say, in English, German, French, Italian and Spanish: subjects, kinds of gates, sides.

Names are compared without accents and capitals, so that `Tribüne`, `tribüne` of a Mac and `TRIBUNE` are one word.
"""

import re
import unicodedata
from enum import Enum


class Subject(Enum):
    """What a placemark is on a course; `FLIGHT` is a recorded track."""

    ELEMENT = "gate or pylon"
    OBSTACLE = "obstacle"
    SAFETY_LINE = "safety line"
    CROWD = "people"
    AIRSPACE = "airspace"
    FLIGHT = "flight"


START = "start(tor|linie|ziel)?|depart|partenza|salida"
FINISH = "finish|(start)?ziel(tor|linie)?|arrivee|arrivo|traguardo|llegada|meta"
KNIFE_EDGE = "knife|messer\\w*|tranche|couteau|coltello|taglio|cuchillo|filo|vertical|vertikal\\w*|verticale"
QUAD = "quads?|viereck\\w*|quadrat|carre|quadro|quadrato|cuadrado|cuadro"
SLALOM = "slalom\\w*|eslalon|eslalom|zig ?zag|s?chi[ck]an[ea]"
LEVEL = "level|horizontal\\w*|waage?recht\\w*|orizzontale"
NOUNS = (
    "gates?|airgates?|(luft|messer\\w*)?tore?|portes?|portail|port[ae]|puertas?|pylons?|pylonen?|pilon[eio]?|pilones"
)
"""Words for gates and pylons, which two pylons of one gate may differ in."""
WORDS = (
    (
        Subject.OBSTACLE,
        "obstacles?|hazards?|hindernis(se)?|ostacol[oi]|obstaculos?|pylone electrique|stromm?ast|pilone elettrico",
    ),
    (
        Subject.SAFETY_LINE,
        "(safety|dead|display|show|no fly) ?(lines?|limit|border)|deadline|"
        "(sicherheits|schutz|sperr|abstands|flugverbots)\\w*linien?|"
        "(ligne|limite) de (securite|presentation)|(linea|limite) di (sicurezza|presentazione)|"
        "(linea|limite) de (seguridad|exhibicion|presentacion)",
    ),
    (
        Subject.CROWD,
        "crowds?|crowdline|spectators?|public|audience|grandstands?|zuschauer\\w*|publikum\\w*|besucher\\w*|"
        "spectateurs?|foule|spettatori|pubblico|folla|espectadores|publico",
    ),
    (
        Subject.AIRSPACE,
        "air ?space|(race|racing|display|flying|aerobatic) (area|box|zone)|boundary|border|perimet\\w+|luftraum|"
        "renngebiet|fluggebiet|flugraum|(renn|flug|kunstflug)box|begrenzung|grenze|"
        "espace aerien|zone de (course|vol)|spazio aereo|"
        "(area|zona|campo) di (gara|volo)|confine|espacio aereo|(area|zona) de (carrera|vuelo)|frontera|frontiere",
    ),
    (
        Subject.ELEMENT,
        f"{NOUNS}|{START}|{FINISH}|turn|wende\\w*|virage|virata|viraje|{QUAD}|{SLALOM}",
    ),
    (
        Subject.OBSTACLE,
        "\\w*mast(s|en)?|\\w*cranes?|\\w*kran|kraene|towers?|\\w*turm|tuerme|lighthouse|phare|faro|antenn?[ae]s?|antennae|"
        "chimneys?|schornstein|kamin|cheminee|ciminiera|chimenea|power ?lines?|\\w*leitung|wires?|cables?|seilbahn|"
        "lignes? (electrique|a?\\w* ?haute tension)|linea (elettrica|electrica)|(linea )?(di |de )?alta tension\\w?|"
        "buildings?|\\w*gebae?ude\\w*|hochhaus|"
        "hangars?|hotels?|tralicci\\w*|batiment|immeuble|edificio|bridge|brue?cke|pont|ponte|puente|(wind )?turbines?|"
        "windrad|windrae?der|windkraft\\w*|eolienne|eolica|aerogenerador|trees?|baum|bae?ume|arbres?|alber[oi]|arbol(es)?|silos?|"
        "tanks?|stacks?|steeple|church|kirche|eglise|clocher|chiesa|campanile|iglesia|campanario|tour|torre|grue|gru|"
        "grua|mat|pal[oi]|palo",
    ),
    (
        Subject.CROWD,
        "people|menschen\\w*|stands?|visitors?|visiteurs|visitatori|visitantes|vip|beach|\\w*strand|plage|spiaggia|"
        "playa|promenade|lungomare|\\w*tribue?n\\w*|tribun[ae]s?|gradins|gradinata|spalti|gradas?|car park|"
        "parking|parkplatz|parcheggio|aparcamiento|camp(ing|site)?(platz)?",
    ),
    # Adjectives of gates decide last: `Tribune level 1`, `Vertical mast`.
    (Subject.ELEMENT, f"{KNIFE_EDGE}|{LEVEL}"),
    (Subject.FLIGHT, "flights?|flight\\d+|passings?|tracks?"),
)
"""The words that name the subject of a placemark, as regular expressions; the first line with a match decides."""
_PATTERNS = [(subject, re.compile(rf"\b({words})\b")) for subject, words in WORDS]
_LABEL = re.compile(r"[a-z]{0,3} ?\d{1,3} ?[a-z]?|[a-z]|[ivx]{2,5}")
"""Names of elements without a word: `g4`, `P 12`, `7`, `wp3a`, `c`, `IV`."""

_LEFT = "left l links linke linker linkes li gauche izquierda izquierdo izq sinistra sinistro sx"
_RIGHT = "right r rechts rechte rechter rechtes re droite droit derecha derecho dcha destra destro dx"
SIDES = {**dict.fromkeys(_LEFT.split(), "l"), **dict.fromkeys(_RIGHT.split(), "r")}
"""Words that name one of the two pylons of a gate."""

_COMPASS = "north south east west nord sud ost est ovest ouest norte sur este oeste"
_BOUNDS = "inner outer inside outside innen aussen interieur exterieur interno esterno interior exterior"
POSITIONS = {*_COMPASS.split(), *_BOUNDS.split()}
"""Words that tell the pylons of one gate apart, but not which is the left one."""
_SIDE = re.compile(rf"[ _-]*(?<![^\W\d_])({'|'.join(SIDES)})(?![^\W\d_])", re.IGNORECASE)

UNIT = r"(m|ft|foot|feet|met(?:re|er)s?|meter|metres?|metr[oi]s?|fuss|pieds?|piedi|pies)\b"
HEIGHT = re.compile(rf"(\d+(?:[.,]\d+)?) ?{UNIT}")
"""A height in a plain text."""
_TWICE = re.compile(r"(?<!\d)(\d{1,3}) ?[/&+] ?(\d{1,3})(?!\d)")
"""The numbers of a gate that is passed twice: `Gate 4/11`."""


def plain_text(text: str) -> str:
    """Return a text without accents, in its capitals."""
    letters = unicodedata.normalize("NFKD", text.replace("ß", "ss"))
    return "".join(letter for letter in letters if not unicodedata.combining(letter))


def words_of(name: str) -> list[str]:
    """Return the words and numbers of a name in plain small letters: `g1_left`, `g1Left`, `G1 left` have the same."""
    return re.findall(r"[^\W\d_]+|\d+", split_words(plain_text(name)).lower())


def split_words(name: str) -> str:
    """Return a name with a space before every capital letter that follows on a small one."""
    return re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name)


def subject_in(text: str) -> Subject | None:
    """Return the subject that the words of a text name; None for none."""
    words = " ".join(words_of(text))
    return next((subject for subject, pattern in _PATTERNS if pattern.search(words)), None)


def is_label(name: str) -> bool:
    """Return whether a name is one of an element by its number or letter alone."""
    words = [word for word in words_of(name) if word not in SIDES and word not in POSITIONS]
    return bool(_LABEL.fullmatch(" ".join(words)))


def has_word(name: str, words: str) -> bool:
    """Return whether a name has one of some words, a regular expression such as `START`."""
    return bool(re.search(rf"\b({words})\b", " ".join(words_of(name))))


def side_in(name: str) -> str:
    """Return the side in a name: `l`, `r` or nothing."""
    sides = [SIDES[word] for word in words_of(name) if word in SIDES]
    return sides[0] if len(sides) == 1 else ""


def without_side(name: str) -> str:
    """Return a name without the words for sides."""
    return _SIDE.sub("", split_words(name)).strip(" _-")


def numbers_in(name: str) -> tuple[int, ...]:
    """Return the numbers at which an element is passed: the first of its name, or two as in `4/11`; none for none."""
    plain = HEIGHT.sub("", plain_text(name).lower())
    if twice := _TWICE.search(plain):
        return int(twice[1]), int(twice[2])
    first = re.search(r"\d+", plain)
    return (int(first[0]),) if first else ()


def gate_words(name: str, *, with_nouns: bool) -> tuple[str, ...]:
    """Return the words of a gate that its pylons share: no sides, on demand no nouns, nothing behind its number."""
    if has_word(name, START):
        return ("start",)
    if has_word(name, FINISH):
        return ("finish",)
    words = [word for word in words_of(name) if word not in SIDES]
    if with_nouns:
        number = next((index for index, word in enumerate(words) if word.isdigit()), len(words))
        return tuple(words[: number + 1])
    return tuple(word for word in words if not re.fullmatch(NOUNS, word))
