"""Files spoilt at random: as by a slip of the finger, a bad merge, a wrong tool, or ill will."""

import random
import re
from collections.abc import Callable

Mutation = Callable[[str, random.Random], str]

NUMBER = re.compile(r"-?\d+(?:\.\d+)?")
TOKEN = re.compile(r"[A-Za-z_][\w-]*|-?\d+(?:\.\d+)?|[^\w\s]")
KEY = re.compile(r"[A-Za-z_][\w-]*(?=:)")
VALUE = re.compile(r"(?<=: )[^\n,{}\[\]#]+")
ITEM = re.compile(r"[\[{][^\[\]{}]*[\]}]")

NUMBERS = (
    *("0", "-0", "-1", "1e308", "-1e308", "1e309", "1e-320", "99999999999999999999999", "9223372036854775808"),
    *(".nan", "-.inf", "nan", "NaN", "Infinity", "012", "0x1F", "0o17", "1_000", "12:30", "1e3", "1.", ".5", "+7"),
    *("true", "null", "~", "''", '"10"', "ten", "10 m", "10,5", "45.0000000001", "-179.99", "360", "90", "1e5"),
)
PIECES = (
    *("[", "]", "{", "}", ":", ": ", "- ", "? ", "& ", "&a", "*a", "!", "!!str ", "|", ">", "%", "@", "`", '"', "'"),
    *("#", ",", "\n", "\t", " ", "\r", "\0", "\x07", "\x85", "\u2028", "\ufeff", "ä", "😀", "---\n", "...\n", "<<: "),
)
WORDS = ("level", "pylon", "quad", "gate", "g0", "g1", "lap", "planned", "either", "schema", "airrace/track/1", "rules")


def _spliced(text: str, begin: int, end: int, new: str) -> str:
    return text[:begin] + new + text[end:]


def _somewhere(pattern: re.Pattern[str], text: str, choose: random.Random) -> tuple[int, int]:
    """A match of the pattern, or an empty place where there is none."""
    spans = [match.span() for match in pattern.finditer(text)]
    if spans:
        return choose.choice(spans)
    place = choose.randrange(len(text) + 1)
    return place, place


def byte(text: str, choose: random.Random) -> str:
    """One byte exchanged; what is no UTF-8 then is read as if it were Latin-1."""
    content = bytearray(text.encode("utf-8", errors="replace"))
    if content:
        content[choose.randrange(len(content))] = choose.randrange(256)
    try:
        return content.decode("utf-8")
    except UnicodeDecodeError:
        return content.decode("latin-1")


def piece(text: str, choose: random.Random) -> str:
    """A character that means something to YAML put in."""
    place = choose.randrange(len(text) + 1)
    return _spliced(text, place, place + choose.randrange(2), choose.choice(PIECES))


def cut(text: str, choose: random.Random) -> str:
    """The file ends early, or begins late."""
    place = choose.randrange(len(text) + 1)
    return text[:place] if choose.random() < 0.7 else text[place:]


def line(text: str, choose: random.Random) -> str:
    """A line left out, doubled, moved or indented otherwise."""
    lines = text.splitlines(keepends=True) or [""]
    index, other = choose.randrange(len(lines)), choose.randrange(len(lines))
    match choose.randrange(4):
        case 0:
            del lines[index]
        case 1:
            lines.insert(other, lines[index])
        case 2:
            lines.insert(other, lines.pop(index))
        case _:
            lines[index] = choose.choice(("  ", " ", "\t", "        ")) + lines[index]
    return "".join(lines)


def token(text: str, choose: random.Random) -> str:
    """A word, number or sign left out, doubled, or put in the place of another."""
    begin, end = _somewhere(TOKEN, text, choose)
    other = text[slice(*_somewhere(TOKEN, text, choose))]
    return _spliced(text, begin, end, choose.choice(("", text[begin:end] * 2, other, choose.choice(WORDS))))


def key(text: str, choose: random.Random) -> str:
    """A key misspelt or exchanged for another one."""
    begin, end = _somewhere(KEY, text, choose)
    name = text[begin:end] or "x"
    place = choose.randrange(len(name))
    misspelt = (name[:place] + name[place + 1 :], name[:place] + "x" + name[place:], name.upper(), "1", "")
    return _spliced(text, begin, end, choose.choice((*misspelt, text[slice(*_somewhere(KEY, text, choose))])))


def number(text: str, choose: random.Random) -> str:
    """A number that is huge, tiny, negative, none at all, or a text."""
    begin, end = _somewhere(NUMBER, text, choose)
    others = (f"{choose.uniform(-1e6, 1e6):.3g}", f"-{text[begin:end]}")
    return _spliced(text, begin, end, choose.choice((*NUMBERS, *others)))


def value(text: str, choose: random.Random) -> str:
    """The value of a key exchanged for something of another kind."""
    begin, end = _somewhere(VALUE, text, choose)
    kinds = ("[]", "{}", "", "x" * 3000, "[1, [2, [3]]]", "{a: {b: {c: 1}}}")
    others = (text[slice(*_somewhere(VALUE, text, choose))], choose.choice(NUMBERS), choose.choice(WORDS))
    return _spliced(text, begin, end, choose.choice((*kinds, *others)))


def nesting(text: str, choose: random.Random) -> str:
    """Brackets around, within or without end."""
    begin, end = _somewhere(ITEM, text, choose)
    inner, depth = text[begin:end], choose.choice((1, 2, 40, 20_000))
    nested = (f"{'[' * depth}{inner}{']' * depth}", "[" * depth, f"{'{a: ' * depth}{inner}{'}' * depth}", "- " * depth)
    return _spliced(text, begin, end, choose.choice((*nested, inner[1:-1])))


def repetition(text: str, choose: random.Random) -> str:
    """A part of the file many times over."""
    begin, end = _somewhere(choose.choice((ITEM, TOKEN, VALUE)), text, choose)
    times = choose.choice((2, 10, 1000))
    return _spliced(text, begin, end, choose.choice((", ", "\n", " ", "")).join([text[begin:end]] * times))


MUTATIONS: tuple[Mutation, ...] = (byte, piece, cut, line, token, key, number, value, nesting, repetition)


def mutated(text: str, choose: random.Random) -> str:
    """The text after one to four mutations."""
    for _ in range(choose.choice((1, 1, 1, 2, 3, 4))):
        text = choose.choice(MUTATIONS)(text, choose)
    return text
