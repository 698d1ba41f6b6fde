"""The C interface to fatrop, against its headers, and blasfeo's matrices."""

import ctypes
import re
import tomllib
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest
from numpy.typing import NDArray

from airrace.errors import SolverCrash
from airrace.optimal_control.solvers.fatrop import library, solver
from airrace.optimal_control.solvers.fatrop.blasfeo import MatrixFamily, entry_offsets, memory_of, struct_size
from airrace.optimal_control.solvers.fatrop.library import PROTOTYPES, Dims, Interface, Stats, blasfeo, fatrop

INCLUDE = Path(ca.__file__).parent / "include"
FATROP = INCLUDE / "fatrop" / "ocp" / "OCPCInterface.h"
BLASFEO = INCLUDE / "blasfeo_d_aux.h"

NUMBERS: dict[str, Any] = {  # Any: ctypes' types have no common public base
    "double": ctypes.c_double,
    "int": ctypes.c_int,
    "fatrop_int": ctypes.c_int,
    "size_t": ctypes.c_size_t,
    "void": None,
}

Signature = tuple[Any, tuple[Any, ...]]


def text(header: Path) -> str:
    """A header without comments, preprocessor lines and words that change no layout."""
    source = re.sub(r"/\*.*?\*/|//[^\n]*", " ", header.read_text(encoding="utf-8"), flags=re.DOTALL)
    source = re.sub(r"^\s*#.*(?:\\\n.*)*$", "", source, flags=re.MULTILINE)
    return re.sub(r"\b(?:const|struct|FATROP_SYMBOL_EXPORT)\b", " ", source)


def pointers(header: Path) -> dict[str, Signature]:
    """Types of pointers to functions, by name."""
    found = re.findall(r"typedef\s+(\w+)\s*\(\*(\w+)\)\s*\(([^)]*)\)\s*;", text(header))
    return {name: (NUMBERS[result], arguments(listed)) for result, name, listed in found}


def functions(header: Path) -> dict[str, Signature]:
    """Functions that are declared, by name."""
    found = re.findall(r"(?<![\w(])(\w+)\s*(\*?)\s*\b(\w+)\s*\(([^()]*)\)\s*;", text(header))
    return {
        name: (ctypes.c_void_p if star else NUMBERS[result], arguments(listed))
        for result, star, name, listed in found
        if star or result in NUMBERS
    }


def fields(header: Path, struct: str) -> list[tuple[str, str]]:
    """(name, type) of every field of a struct that is declared as `struct NAME { ... };`, in order."""
    (body,) = re.findall(rf"\b{struct}\s*\{{([^}}]*)\}}", text(header))
    found = re.findall(r"(\w+\s*\**)\s*\b(\w+)\s*;", body)
    return [(name, "".join(kind.split())) for kind, name in found]


def arguments(listed: str) -> tuple[Any, ...]:
    """Types of a list of arguments, with names or without."""
    if listed.strip() in ("", "void"):
        return ()
    return tuple(argument(one) for one in listed.split(","))


def argument(one: str) -> Any:
    if "*" in one:
        return ctypes.c_void_p
    kind = one.split()[0]
    return NUMBERS.get(kind, ctypes.c_void_p)  # all else are pointers to functions


ROOT = Path(__file__).parents[2]
POINTERS = pointers(FATROP)


def plain(kind: Any) -> Any:
    """A ctypes type as `c_headers` tells it: pointers of all kinds are one."""
    if kind is None or kind in (ctypes.c_double, ctypes.c_int, ctypes.c_size_t):
        return kind
    return ctypes.c_void_p


def written(kind: str) -> Any:
    """The type of a field of a struct."""
    return {"double": ctypes.c_double, "int": ctypes.c_int, "fatrop_int": ctypes.c_int}.get(kind, ctypes.c_void_p)


@pytest.mark.parametrize(
    ("ours", "theirs"),
    [(Dims, "FatropOcpCDims"), (Stats, "FatropOcpCStats"), (Interface, "FatropOcpCInterface")],
)
def test_fields_of_a_struct_are_those_of_the_header(ours: type[ctypes.Structure], theirs: str) -> None:
    declared = fields(FATROP, theirs)
    assert [name for name, *_ in ours._fields_] == [name for name, _ in declared]
    assert [plain(kind) for _, kind, *_ in ours._fields_] == [written(kind) for _, kind in declared]


def signature(kind: Any) -> Signature:
    return plain(kind._restype_), tuple(plain(one) for one in kind._argtypes_)


def test_callbacks_and_prototypes_have_the_signatures_of_the_headers() -> None:
    kinds = dict(fields(FATROP, "FatropOcpCInterface"))
    callbacks = {name: kind for name, kind in Interface._fields_ if kind is not ctypes.c_void_p}
    assert len(callbacks) == 13
    for name, kind in callbacks.items():
        assert signature(kind) == POINTERS[kinds[name]], name
    assert signature(library._WRITE) == POINTERS["FatropOcpCWrite"]
    declared = functions(FATROP) | functions(BLASFEO)
    for name, result, arguments in PROTOTYPES:
        assert (plain(result), tuple(plain(one) for one in arguments)) == declared[name], name


def test_a_vector_begins_as_in_blasfeos_header() -> None:
    source = (FATROP.parents[2] / "blasfeo_common.h").read_text(encoding="utf-8")
    bodies = [part.split("}")[0] for part in source.split("struct blasfeo_dvec\n")[1:]]
    assert bodies
    for body in bodies:
        names = [line.split(";")[0].split()[-1].lstrip("*") for line in body.splitlines() if ";" in line]
        assert names[:2] == [name for name, *_ in library.BlasfeoVector._fields_]


def test_the_release_of_casadi_that_was_compared_is_the_one_that_is_asked_for() -> None:
    dependencies = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["dependencies"]
    (casadi,) = [one for one in dependencies if one.startswith("casadi")]
    major, minor, _ = solver.TESTED.split(".")
    assert casadi == f"casadi>={solver.TESTED},<{major}.{int(minor) + 1}"


# the probe


def test_the_probe_finds_nothing_wrong_and_prints_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    solver.require_known_interface.cache_clear()
    solver.require_known_interface()
    assert capsys.readouterr().out == ""


class Longer(ctypes.Structure):
    """Statistics of a release that keeps one more number before the others."""

    _fields_ = (("added", ctypes.c_double), *Stats._fields_)


class Wider(ctypes.Structure):
    """Dimensions of a release that keeps one more vector before them."""

    _fields_ = (("added", ctypes.POINTER(ctypes.c_int)), *Dims._fields_)


@pytest.mark.parametrize(
    ("function", "struct", "words"),
    [
        ("fatrop_ocp_c_get_stats", Longer, "the reason of its end is read"),
        ("fatrop_ocp_c_get_dims", Wider, "sizes are read"),
    ],
)
def test_a_library_of_another_layout_is_refused(
    monkeypatch: pytest.MonkeyPatch, function: str, struct: type[ctypes.Structure], words: str
) -> None:
    solver.require_known_interface.cache_clear()
    with monkeypatch.context() as patched:
        patched.setattr(getattr(library.fatrop(), function), "restype", ctypes.POINTER(struct))
        with pytest.raises(SolverCrash, match=words) as refusal:
            solver.require_known_interface()
    assert ca.CasadiMeta.version() in str(refusal.value)
    solver.require_known_interface()


def test_callbacks_in_each_others_places_are_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two of the same signature, whose exchange would not crash."""
    solver.require_known_interface.cache_clear()
    working = solver.interface

    def exchanged(callbacks: dict[str, Any]) -> Interface:
        return working({**callbacks, "get_ng": callbacks["get_ng_ineq"], "get_ng_ineq": callbacks["get_ng"]})

    with monkeypatch.context() as patched:
        patched.setattr(solver, "interface", exchanged)
        with pytest.raises(SolverCrash, match="sizes are read"):
            solver.require_known_interface()
    solver.require_known_interface()


Array = NDArray[np.int64]
SHAPES = [(1, 1), (3, 2), (5, 0), (9, 8), (3, 2), (4, 4), (18, 13)]


class Matrices:
    """Matrices that blasfeo created in an array of structs."""

    def __init__(self, shapes: list[tuple[int, int]]) -> None:
        self.shapes = shapes
        self.structs = np.zeros(struct_size() * len(shapes), dtype=np.uint8)
        self.address: int = self.structs.ctypes.data
        self.memory: list[NDArray[np.uint8]] = []
        for number, (rows, columns) in enumerate(shapes):
            size: int = fatrop().blasfeo_memsize_dmat(rows, columns)
            self.memory.append(np.zeros(size + 64, dtype=np.uint8))
            start = -(-self.memory[-1].ctypes.data // 64) * 64
            fatrop().blasfeo_create_dmat(rows, columns, self._struct(number), start)

    def _struct(self, number: int) -> int:
        return self.address + number * struct_size()

    def read(self, number: int) -> NDArray[np.float64]:
        """A matrix as blasfeo unpacks it."""
        rows, columns = self.shapes[number]
        result = np.zeros((rows, columns), order="F")
        unpack = blasfeo().blasfeo_unpack_dmat
        number_of, address = ctypes.c_int, ctypes.c_void_p
        unpack.argtypes = [number_of, number_of, address, number_of, number_of, address, number_of]
        unpack.restype = None
        unpack(rows, columns, self._struct(number), 0, 0, result.ctypes.data, rows)
        return result


def family(shapes: list[tuple[int, int]]) -> MatrixFamily:
    rows, columns = np.array(shapes, dtype=np.int64).T
    return MatrixFamily(rows, columns)


def every_entry(described: MatrixFamily) -> tuple[Array, Array, Array]:
    """Stage, row and column of all entries, matrix by matrix, column by column."""
    places = [
        (number, row, column)
        for number, (rows, columns) in enumerate(SHAPES)
        for column in range(columns)
        for row in range(rows)
    ]
    assert len(described.rows) == len(SHAPES)
    stage, row, column = np.array(places).T
    return stage, row, column


def test_entries_are_where_blasfeo_finds_them_and_nothing_else_is_touched() -> None:
    matrices, described = Matrices(SHAPES), family(SHAPES)
    entries = np.random.default_rng(1).normal(size=sum(rows * columns for rows, columns in SHAPES))
    whole = memory_of([described], [described.addresses(matrices.address)])
    stage, row, column = every_entry(described)
    whole.doubles[whole.begins[stage, 0] + described.offsets(stage, row, column)] = entries
    for number, (memory, (rows, columns)) in enumerate(zip(matrices.memory, SHAPES, strict=True)):
        own = entries[stage == number].reshape(rows, columns, order="F")
        assert (matrices.read(number) == own).all()
        assert np.count_nonzero(memory.view(np.float64)) == rows * columns
    for one in matrices.memory:
        one.view(np.float64)[one.view(np.float64) == 0.0] = np.pi
    described.clear(whole.doubles, whole.begins[:, 0])
    for number, (memory, (rows, columns)) in enumerate(zip(matrices.memory, SHAPES, strict=True)):
        assert np.count_nonzero(memory.view(np.float64) == np.pi) == len(memory) // 8 - rows * columns
        assert not matrices.read(number).any()


def test_families_of_several_lengths_share_a_memory() -> None:
    long, short = family(SHAPES), family(SHAPES[:3])
    one, other = Matrices(SHAPES), Matrices(SHAPES[:3])
    memory = memory_of([long, short], [long.addresses(one.address), short.addresses(other.address)])
    assert memory.begins.shape == (len(SHAPES), 2)
    memory.doubles[memory.begins[1, 0]], memory.doubles[memory.begins[1, 1]] = 2.0, 3.0
    assert (one.read(1)[0, 0], other.read(1)[0, 0]) == (2.0, 3.0)


def test_addresses_tell_matrices_apart() -> None:
    described = family(SHAPES)
    one, other = Matrices(SHAPES), Matrices(SHAPES)
    assert np.flatnonzero(described.addresses(one.address) == 0).tolist() == [2]  # one is empty
    assert set(described.addresses(one.address)).intersection(described.addresses(other.address)) == {0}


def test_matrices_of_other_shapes_are_refused() -> None:
    with pytest.raises(SolverCrash, match="unexpected shapes"):
        family([(3, 2), (2, 2)]).addresses(Matrices([(3, 2), (2, 3)]).address)


@pytest.mark.parametrize("shape", [(1, 1), (7, 3), (12, 12), (33, 5)])
def test_entries_have_a_place_each(shape: tuple[int, int]) -> None:
    offsets = entry_offsets(*shape)
    assert len(set(offsets.tolist())) == shape[0] * shape[1]
    assert offsets.min() == 0
