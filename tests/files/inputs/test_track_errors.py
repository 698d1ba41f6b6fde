"""Errors in track files name file, line and key."""

import random
import re
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import pytest
from language_texts import AIRCRAFT, RICH, ROOT, TRACK, edited, edits, findings_of

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


REFUSED = r"""
    heading_deg: 90\n =>
> 7:3: gates.g0.heading_deg: missing; a level gate needs `heading_deg`: its axis in forward direction; or its two
> `pylons`
heading_deg: 90\n => heading_deg: 90\n    heigth_m: 20\n
> 12:5: gates.g0.heigth_m: unknown key `heigth_m`; did you mean `height_m`?
    east_m: 0\n =>     east_m: 0\n    north_m: 5\n
> 11:5: gates.g0.north_m: duplicate key; first in line 9
    north_m: 0\n =>     north_m: 0,5\n
> 9:14: gates.g0.north_m: must be a number at least -50000 and at most 50000, not the text `0,5`; write it with a
> decimal point, 0.5
    north_m: 0\n =>     north_m: -12,75\n
> 9:14: gates.g0.north_m: must be a number at least -50000 and at most 50000, not the text `-12,75`; write it with a
> decimal point, -12.75
    north_m: 0\n =>     north_m: '0,5,6'\n
> 9:14: gates.g0.north_m: must be a number at least -50000 and at most 50000, not the text `0,5,6`
course:\n => wind: {from_deg: 250, speed_m_s: 6}\ncourse:\n
> 15:1: wind: unknown key `wind`; it belongs in `environment`
start: g0 => start: top
> 16:10: course.start: a race must start somewhere: `top` needs north_m, east_m and height_m, or be a gate
n_z_max: 10 => n_z_max: ten
> 4:12: rules.n_z_max: must be a number above 1 and at most 25, not the text `ten`
n_z_max: 10 => n_z_max: 99
> 4:12: rules.n_z_max: must be above 1 and at most 25, not 99
n_z_max: 10 => n_z_max: yes
> 4:12: rules.n_z_max: must be a number above 1 and at most 25, not the text `yes`
n_z_max: 10 => n_z_max: true
> 4:12: rules.n_z_max: must be a number above 1 and at most 25, not `true`
n_z_max: 10 => n_z_max:
> 4:11: rules.n_z_max: has no value; give one, or leave the key out
  n_z_max: 10\n =>
> 3:1: rules.n_z_max: missing; a rule book needs `n_z_max`: the largest load factor
name: Test => name: 2014
> 2:7: name: must be text, not 2014; quote it if it is meant as text
type: level => type: levle
> 8:11: gates.g0.type: unknown type `levle`; did you mean `level`?
    type: level\n =>
> 7:3: gates.g0.type: missing; `type` is one of: level, knife-edge, quad, pylon, manoeuvre, high-turn, vertical-roll
bank: left => bank: leftt
> 13:77: gates.g2.bank: must be one of right, left, either, not the text `leftt`; did you mean `left`?
laps: 2 => laps: 1.5
> 18:9: course.laps: must be a whole number at least 1 and at most 100, not 1.5
laps: 2 => laps: 0
> 18:9: course.laps: must be at least 1 and at most 100, not 0
start: g0 => start: g00
> 16:10: course.start: unknown gate `g00`; did you mean `g0`?
lap: [g1, => lap: [g11,
> 17:9: course.lap.0: unknown gate `g11`; did you mean `g1`?
lap: [g1, => lap: [3,
> 17:9: course.lap.0: must be the name of a gate or {gate: NAME, direction: reverse}, not 3
lap: [g1, => lap: [g0, g1,
> 17:9: course.lap.0: `g0` is passed twice in a row; another element must come between
lap: [g1, => lap: [{gate: g1, direction: reverse},
> 17:31: course.lap.0.direction: only two-pylon gates have a direction; `g1` is none, leave it out
heading_deg: 90 => heading_deg: 90\n    height_m: 30\n    height_max_m: 25
> 12:15: gates.g0.height_m: must lie within the window's heights, 25 to 25 m, not 30
heading_deg: 90 => heading_deg: 90\n    width_m: 8
> 12:14: gates.g0.width_m: a width of 8 m less two clearances of 0.5 m leaves 7 m; the wing of Edge 540 class spans
> 7.43 m
heading_deg: 90 => heading_deg: 90\n    clearance_m: 7
> 7:3: gates.g0.width_m: a width of 13 m leaves nothing between two clearances of 7 m
heading_deg: 90 => heading_deg: 90\n    crossing_max_deg: 90
> 12:23: gates.g0.crossing_max_deg: must be above 0 and at most 85, not 90
  n_z_max: 10 =>   n_z_max: 10\n  ceiling_m: 12
> 8:3: gates.g0.height_m: lies at 15 to 25 m, outside of the race's heights of 10 to 12 m (rules: floor, ceiling)
inverted: true, height_min_m: 100 =>
> 14:3: gates.top: a manoeuvre needs at least one condition: climb_deg, bank_deg, inverted, heading_deg, ...
inverted: true, => inverted: true, climb_deg: 90,
> 14:36: gates.top.inverted: has no meaning on a vertical line; leave it out
inverted: true, => inverted: true, bank_deg: 0,
> 14:52: gates.top.bank_deg: not together with `inverted`, which says a bank of 180 degrees
height_min_m: 100 => height_min_m: 100, height_m: 120
> 14:71: gates.top.height_m: is exact; not together with `height_min_m` or `height_max_m`
  n_z_max: 10 =>   n_z_max: 10\n  alpha_min_deg: 18
> 5:18: rules.alpha_min_deg: must be at most 16.7, the angle at which Edge 540 class stalls; is 18
  n_z_max: 10 =>   n_z_max: 10\n  alpha_min_deg: 12\n  C_L_max: 0.5
> 5:18: rules.alpha_min_deg: must be at most 6.0, the angle of the largest lift coefficient; is 12
  n_z_max: 10 =>   n_z_max: 10\n  alpha_max_deg: 0.1
> 5:18: rules.alpha_max_deg: the wing cannot carry the aircraft: at 130 m/s, the envelope's top speed, C_L =
> 0.00837 lifts 789 N at sea level, the weight is 6845 N
  n_z_max: 10 =>   n_z_max: 3\n  pilot: {n_z_min_ends: 4}
> 5:25: rules.pilot.n_z_min_ends: must be at most 3, the largest load factor; is 4
  n_z_max: 10 =>   n_z_max: 3\n  pilot: {n_z_min_low: 4}
> 5:24: rules.pilot.n_z_min_low: must be at most 3, the largest load factor, for `g0` is passed near the ground; is 4
course:\n => margins: {rules: {floor_m: 30}}\ncourse:\n
> 15:18: margins.rules: the margins leave no room: `g0` lies at 15 to 25 m, outside of the race's heights of 40 m or
> above (rules: floor, ceiling)
  start_speed_max_kt: 200 =>   start_speed_max_kt: 60
> 5:23: rules.start_speed_max_kt: must be above 68.03 kt, the least speed of Edge 540 class; is 60
schema: airrace/track/1 => schema: airrace/track/3
> 1:9: schema: expected `schema: airrace/track/2`, found `airrace/track/3`
schema: airrace/track/1\n =>
> 1:1: schema: missing; the file must begin with `schema: airrace/track/2`
course:\n => environment: {wind: {from_deg: 0}}\ncourse:\n
> 15:15: environment.wind: missing; a wind needs `speed_kt` or `speed_m_s`
course:\n => environment: {wind: {from_deg: 0, speed_kt: 1, speed_m_s: 1}}\ncourse:\n
> 15:48: environment.wind.speed_m_s: the speed is given twice; keep one of `speed_kt` and `speed_m_s`
"""


@pytest.mark.parametrize(("old", "new", "message"), edits(REFUSED))
def test_an_error_in_a_track_says_where_what_and_what_would_be_right(old: str, new: str, message: str) -> None:
    findings = findings_of(edited(TRACK, old, new))
    assert str(findings[0]) == f"t.yaml:{message}"
    assert len(findings) == 1 or "ceiling_m" in new  # which concerns every element


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


def test_a_place_set_in_the_other_way_than_the_file_gives_it_is_told_so_and_not_the_file() -> None:
    origin = "origin: {latitude_deg: 45, longitude_deg: 13}\n"
    degrees = edited(TRACK, "    north_m: 0\n    east_m: 0\n", "    latitude_deg: 45\n    longitude_deg: 13\n")
    for text, key, message in (
        (degrees, "north_m=3", "by latitude and longitude; set `latitude_deg` and `longitude_deg`"),
        (TRACK, "latitude_deg=45.1", "by north and east; set `north_m` and `east_m`"),
    ):
        (finding,) = findings_of(text + origin, overrides=(f"gates.g0.{key}",))
        assert (finding.file, finding.key) == ("--set", f"gates.g0.{key.split('=')[0]}")
        assert finding.message == f"the file gives this position {message}"


def test_mass_that_no_body_of_that_size_has_is_refused() -> None:
    (finding,) = findings_of(aircraft=edited(AIRCRAFT, "mass_kg: 698 ", "mass_kg: 0.001 "))
    assert "airframe.mass_kg: is too little: nothing within a wing span of 7.43 m has I_x_kg_m2 = 520" in str(finding)
    findings = findings_of(aircraft=edited(AIRCRAFT, "wing_span_m: 7.43", "wing_span_m: 1e-308"))  # squared it is 0
    assert any("nothing within a wing span of 1e-308 m" in str(finding) for finding in findings)


def test_gate_that_no_lap_passes_is_named() -> None:
    assert load_inputs(ROVINJ).unused_gates == ()
    text = ROVINJ.read_text().replace(
        "gates:\n", "gates:\n  spare: {type: level, north_m: 9, east_m: 9, heading_deg: 0}\n"
    )
    assert load_inputs(Document(str(ROVINJ), text)).unused_gates == ("spare",)


@pytest.mark.parametrize("path", sorted((ROOT / "tracks").glob("*.yaml")), ids=lambda path: path.stem)
def test_shipped_courses_pass_all_their_gates(path) -> None:
    assert load_inputs(path).unused_gates == ()


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
