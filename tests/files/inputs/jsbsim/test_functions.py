"""JSBSim's functions, tables and units, read from small documents."""

import math
import random
from pathlib import Path

import pytest

from airrace.errors import InputError
from airrace.files.inputs.jsbsim.document import AREA, INERTIA, LENGTH, MASS, read_jsbsim
from airrace.files.inputs.jsbsim.functions import Functions, NotEvaluated

STATE = {"a": 0.7, "b": -1.3, "aero/alpha-rad": 0.1}


@pytest.fixture
def evaluate(tmp_path: Path):
    def value(formula: str, **more: float) -> float:
        path = tmp_path / "functions.xml"
        path.write_text(f"<aerodynamics><function name='f'>{formula}</function></aerodynamics>")
        document = read_jsbsim(path)
        return Functions(document, document).value(document.root[0], {**STATE, **more})

    return value


A, B = "<property>a</property>", "<p>b</p>"


@pytest.mark.parametrize(
    ("formula", "value"),
    [
        (f"<sum>{A}{B}<value>2</value></sum>", 0.7 - 1.3 + 2.0),
        (f"<difference>{A}{B}<v>2</v></difference>", 0.7 + 1.3 - 2.0),
        (f"<product>{A}{B}</product>", 0.7 * -1.3),
        (f"<quotient>{A}{B}</quotient>", 0.7 / -1.3),
        (f"<pow>{A}<v>3</v></pow>", 0.7**3),
        (f"<atan2>{A}{B}</atan2>", math.atan2(0.7, -1.3)),
        (f"<max>{A}{B}</max>", 0.7),
        (f"<sqrt>{A}</sqrt>", math.sqrt(0.7)),
        (f"<ln>{A}</ln>", math.log(0.7)),
        (f"<sign>{B}</sign>", -1.0),
        ("<property>-a</property>", -0.7),
        (f"<ifthen><lt>{A}{B}</lt><v>1</v><v>2</v></ifthen>", 2.0),
        (f"<switch><v>1</v>{A}{B}</switch>", -1.3),
        (f"<interpolate1d>{A}<v>0</v><v>1</v><v>1</v><v>3</v></interpolate1d>", 2.4),
        (f"<description>nothing</description><abs>{B}</abs>", 1.3),
        ("<property>unknown</property>", 0.0),
    ],
)
def test_operations_are_those_of_their_names(evaluate, formula: str, value: float) -> None:
    assert evaluate(formula) == pytest.approx(value, rel=1e-15)


def table(variables: str, data: str) -> str:
    names = {"row": "a", "column": "b", "table": "c"}
    looked_up = "".join(f"<independentVar lookup='{kind}'>{names[kind]}</independentVar>" for kind in variables.split())
    return f"<table>{looked_up}{data}</table>"


def test_a_table_reproduces_a_function_that_is_linear_in_each_variable_and_holds_its_ends(evaluate) -> None:
    def f(a: float, b: float, c: float) -> float:
        return (1.0 + 2.0 * a) * (3.0 - b) * (0.5 + c)

    rows, columns, sheets = (0.0, 1.0, 4.0), (-2.0, 0.0, 5.0), (0.0, 2.0)
    data = ""
    for c in sheets:
        lines = [" ".join(map(str, columns))]
        lines += [" ".join(map(str, (a, *(f(a, b, c) for b in columns)))) for a in rows]
        data += f"<tableData breakPoint='{c}'>\n{chr(10).join(lines)}\n</tableData>"
    numbers = random.Random(4)
    for _ in range(30):
        a, b, c = numbers.uniform(-1.0, 5.0), numbers.uniform(-3.0, 6.0), numbers.uniform(-1.0, 3.0)
        held = f(min(max(a, 0.0), 4.0), min(max(b, -2.0), 5.0), min(max(c, 0.0), 2.0))
        assert evaluate(table("row column table", data), a=a, b=b, c=c) == pytest.approx(held, rel=1e-12)


@pytest.mark.parametrize(
    ("formula", "message"),
    [
        (f"{A}{B}", "must hold one formula; holds 2"),
        (f"<quotient>{A}</quotient>", "has another number of operands than 1"),
        ("<value>much</value>", "must hold a number; holds 'much'"),
        (table("row", "<tableData>\n0 1 2\n</tableData>"), "must hold pairs of numbers"),
        (table("row", "<tableData>\n1 1\n0 2\n</tableData>"), "must have knots that increase"),
        (table("row table", "<tableData>\n1 1\n</tableData>"), "must look up row, column and table"),
        (table("row column table", "<tableData>\n1 1\n</tableData>"), "must hold tableData for 3 variables; holds 1"),
    ],
)
def test_what_is_no_function_is_refused_with_its_line(evaluate, formula: str, message: str) -> None:
    with pytest.raises(InputError, match=message) as refused:
        evaluate(formula)
    assert refused.value.findings[0].line > 0


@pytest.mark.parametrize("formula", ["<random/>", f"<quotient>{A}<v>0</v></quotient>"])
def test_what_cannot_be_evaluated_says_where(evaluate, formula: str) -> None:
    with pytest.raises(NotEvaluated, match=r"at functions\.xml:1"):
        evaluate(formula)


def test_a_function_that_depends_on_itself_does_not_end(evaluate) -> None:
    with pytest.raises(RecursionError):
        evaluate("<property>f</property>")


def test_units_are_those_of_the_attribute_or_jsbsims_own(tmp_path: Path) -> None:
    path = tmp_path / "units.xml"
    path.write_text(
        "<fdm_config><a unit='M2'>2</a><b>2</b><c unit='KG'>3</c><d>3</d><e unit='IN'>100</e><g>1</g>"
        "<location unit='FT'><x>1</x><y>2</y><z>3</z></location></fdm_config>"
    )
    document = read_jsbsim(path)
    root = document.root
    assert document.measure(root, "a", AREA) == 2.0
    assert document.measure(root, "b", AREA) == pytest.approx(2.0 * 0.3048**2)
    assert document.measure(root, "c", MASS) == 3.0
    assert document.measure(root, "d", MASS) == pytest.approx(3.0 * 0.45359237)
    assert document.measure(root, "e", LENGTH) == pytest.approx(2.54)
    assert document.measure(root, "g", INERTIA) == pytest.approx(1.35581795, rel=1e-7)
    assert document.place_of(root[-1]) == pytest.approx([0.3048, 0.6096, 0.9144])
    with pytest.raises(InputError, match="has the unit 'KG'; read are FT, IN, M"):
        document.measure(root, "c", LENGTH)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("<!DOCTYPE a [<!ENTITY b 'b'>]><fdm_config>&b;</fdm_config>", "holds a document type"),
        ("<fdm_config><metrics></fdm_config>", "is no XML"),
    ],
)
def test_documents_that_are_not_plain_xml_are_refused(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "bad.xml"
    path.write_text(text)
    with pytest.raises(InputError, match=message):
        read_jsbsim(path)
