"""What a C header declares: structs, pointers to functions and functions, read as far as ours are written.

Types are told as ctypes keeps them: pointers of any kind are `c_void_p`.
"""

import ctypes
import re
from pathlib import Path
from typing import Any

import casadi as ca

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
