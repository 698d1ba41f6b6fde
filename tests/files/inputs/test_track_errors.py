"""Errors in track files name file, line and key."""

import random
import re
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import pytest
from language_texts import AIRCRAFT, OBSTACLES, RICH, ROOT, TRACK, TWO_GATES, Refusal, edited, findings_of, refusals

from airrace.errors import Finding, InputError
from airrace.files.inputs import Document, inputs_from_documents, load_inputs
from airrace.files.inputs.nodes import FINDINGS_MAX

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


BASES = {"TRACK": TRACK, "RICH": RICH, "RICH with OBSTACLES": RICH + OBSTACLES, "TWO_GATES": TWO_GATES}
REFUSED = refusals((Path(__file__).parent / "refusals.txt").read_text(encoding="utf-8"))


@pytest.mark.parametrize("case", REFUSED, ids=str)
def test_an_error_in_a_track_says_where_what_and_what_would_be_right(case: Refusal) -> None:
    text = BASES[case.base]
    for old, new in case.changes:
        text = edited(text, old, new)
    assert [str(finding) for finding in findings_of(text, overrides=case.overrides)] == case.findings


def test_all_findings_come_at_once() -> None:
    track = edited(edited(TRACK, "n_z_max: 10", "n_z_max: 0"), "pass_side_deg: 180", "pass_side: 180")
    aircraft = edited(AIRCRAFT, "mass_kg: 698 ", "mass_kg: -1 ")
    keys = [(finding.file, finding.key) for finding in findings_of(track, aircraft=aircraft, overrides=("laps",))]
    assert keys == [
        ("--set", "laps"),
        ("a.yaml", "airframe.mass_kg"),
        ("t.yaml", "rules.n_z_max"),
        ("t.yaml", "gates.g1.pass_side_deg"),
        ("t.yaml", "gates.g1.pass_side"),
    ]


def test_a_document_that_is_no_mapping_is_refused() -> None:
    (finding,) = findings_of("- a\n- b\n")
    assert str(finding) == "t.yaml:1:1: must be a mapping that begins with `schema: airrace/track/2`"


ROVINJ = ROOT / "tracks" / "rovinj_2014.yaml"


def test_decimal_comma_between_braces_is_called_one() -> None:
    text = ROVINJ.read_text().replace("north_m: 272.8,", "north_m: 272,8,")
    (finding,) = findings_of(text)
    assert "gates.g1.8: has no value" in str(finding)
    assert "a number has a decimal point, not a comma" in str(finding)


def test_mass_that_no_body_of_that_size_has_is_refused() -> None:
    (finding,) = findings_of(aircraft=edited(AIRCRAFT, "mass_kg: 698 ", "mass_kg: 0.001 "))
    assert "airframe.mass_kg: is too little: nothing within a wing span of 7.43 m has I_x_kg_m2 = 520" in str(finding)
    findings = findings_of(aircraft=edited(AIRCRAFT, "wing_span_m: 7.43", "wing_span_m: 1e-308"))  # squared it is 0
    assert any("nothing within a wing span of 1e-308 m" in str(finding) for finding in findings)


def test_gate_that_no_lap_passes_is_named() -> None:
    text = ROVINJ.read_text().replace(
        "gates:\n", "gates:\n  spare: {type: level, north_m: 9, east_m: 9, heading_deg: 0}\n"
    )
    assert load_inputs(Document(str(ROVINJ), text)).unused_gates == ("spare",)


SETTINGS = """\
schema: airrace/settings/1
guess: plan
regularisation: 1e-4
mesh: {interval_s: 0.1, intervals_min: 8}
solver: {primary: ipopt, fallback: interior-point, tolerance: 1e-8, stall_s: 60}
certificate: {angle_deg: 0.1}
"""
SHIPPED = [path.read_text(encoding="utf-8") for path in sorted((ROOT / "tracks").glob("*.yaml"))]
TRACKS = [*SHIPPED, *[RICH] * 6]


def survive(count: int, seed: int) -> Counter[str]:
    """Load so many spoilt inputs; how many were understood and refused, with some findings of bearable length."""
    choose = random.Random(seed)
    outcomes: Counter[str] = Counter()
    for index in range(count):
        texts = {"track": choose.choice(TRACKS), "aircraft": AIRCRAFT, "settings": SETTINGS}
        spoilt = choose.choices(list(texts), weights=(8, 1, 1))[0]
        texts[spoilt] = mutated(texts[spoilt], choose)
        documents = [Document(f"{kind[0]}.yaml", text) for kind, text in texts.items()]
        findings: list[Finding] | None = None
        try:
            inputs_from_documents(*documents, ())
        except InputError as error:
            findings = error.findings
        except Exception as error:
            raise AssertionError(f"seed {seed}, mutation {index}, {spoilt}:\n{texts[spoilt][:5000]}") from error
        outcomes["understood" if findings is None else "refused"] += 1
        assert findings != []
        for finding in findings or ():
            assert finding.message.strip()
            assert len(str(finding)) < 2000
            assert finding.file in ("t.yaml", "a.yaml", "s.yaml")
            assert (finding.line >= 1) == (finding.column >= 1)
        assert max(Counter(finding.file for finding in findings or ()).values(), default=0) <= FINDINGS_MAX + 1
    return outcomes


def test_three_hundred_spoilt_files_are_understood_or_refused() -> None:
    outcomes = survive(300, seed=1)
    assert outcomes["refused"] > 150
    assert outcomes["understood"] > 15


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2, 12))
def test_a_thousand_spoilt_files_are_understood_or_refused(seed: int) -> None:
    assert survive(1000, seed).total() == 1000


def test_files_of_any_bytes_are_refused(tmp_path: Path) -> None:
    choose = random.Random(3)
    for length in (0, 1, 2, 3, 10, 100, 10_000):
        file = tmp_path / "t.yaml"
        file.write_bytes(choose.randbytes(length))
        with pytest.raises(InputError) as raised:
            load_inputs(file, aircraft=ROOT / "configs/edge540.yaml")
        assert all(finding.message for finding in raised.value.findings)
