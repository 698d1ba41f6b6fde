"""fatrop's C interface is laid out as the header in casadi's wheel says, and a library that is not is noticed."""

import ctypes
import tomllib
from pathlib import Path
from typing import Any

import casadi as ca
import pytest
from c_headers import BLASFEO, FATROP, fields, functions, pointers

from airrace.errors import SolverCrash
from airrace.optimal_control.solvers.fatrop import abi_check, library, solver
from airrace.optimal_control.solvers.fatrop.library import PROTOTYPES, Dims, Interface, Stats

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


def test_callbacks_that_are_set_have_the_signatures_of_the_header() -> None:
    kinds = dict(fields(FATROP, "FatropOcpCInterface"))
    callbacks = {name: kind for name, kind in Interface._fields_ if kind is not ctypes.c_void_p}
    assert len(callbacks) == 13
    for name, kind in callbacks.items():
        ours = (plain(kind._restype_), tuple(plain(one) for one in kind._argtypes_))
        assert ours == POINTERS[kinds[name]], name


def test_prototypes_are_those_of_the_headers() -> None:
    declared = functions(FATROP) | functions(BLASFEO)
    for name, result, arguments in PROTOTYPES:
        ours = (plain(result), tuple(plain(one) for one in arguments))
        assert ours == declared[name], name


def test_fatrop_writes_through_the_callback_of_the_header() -> None:
    write = library._WRITE
    assert (plain(write._restype_), tuple(plain(one) for one in write._argtypes_)) == POINTERS["FatropOcpCWrite"]


def test_a_vector_begins_as_in_blasfeos_header() -> None:
    source = (FATROP.parents[2] / "blasfeo_common.h").read_text(encoding="utf-8")
    bodies = [part.split("}")[0] for part in source.split("struct blasfeo_dvec\n")[1:]]
    assert bodies
    for body in bodies:
        names = [line.split(";")[0].split()[-1].lstrip("*") for line in body.splitlines() if ";" in line]
        assert names[:2] == [name for name, *_ in library.Vector._fields_]


def test_the_release_of_casadi_that_was_compared_is_the_one_that_is_asked_for() -> None:
    dependencies = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["dependencies"]
    (casadi,) = [one for one in dependencies if one.startswith("casadi")]
    major, minor, _ = abi_check.TESTED.split(".")
    assert casadi == f"casadi>={abi_check.TESTED},<{major}.{int(minor) + 1}"


# the probe


def test_the_probe_finds_nothing_wrong_and_prints_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    abi_check.require_known_interface.cache_clear()
    abi_check.require_known_interface()
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
    abi_check.require_known_interface.cache_clear()
    with monkeypatch.context() as patched:
        patched.setattr(getattr(library.fatrop(), function), "restype", ctypes.POINTER(struct))
        with pytest.raises(SolverCrash, match=words) as refusal:
            abi_check.require_known_interface()
    assert ca.CasadiMeta.version() in str(refusal.value)
    abi_check.require_known_interface()


def test_callbacks_in_each_others_places_are_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two of the same signature, whose exchange would not crash."""
    abi_check.require_known_interface.cache_clear()
    working = solver.interface

    def exchanged(callbacks: dict[str, Any]) -> Interface:
        return working({**callbacks, "get_ng": callbacks["get_ng_ineq"], "get_ng_ineq": callbacks["get_ng"]})

    with monkeypatch.context() as patched:
        patched.setattr(solver, "interface", exchanged)
        with pytest.raises(SolverCrash, match="sizes are read"):
            abi_check.require_known_interface()
    abi_check.require_known_interface()
