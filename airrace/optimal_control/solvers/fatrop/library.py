"""The C interface of fatrop, as in its header `fatrop/ocp/OCPCInterface.h`, with two functions of blasfeo.

casadi brings both libraries along. Its own interface to fatrop takes time quadratic in the number of stages to set up,
so they are called directly here.
"""

import ctypes
import os
import sys
from collections.abc import Callable, Sequence
from ctypes import CFUNCTYPE, POINTER, Structure, c_char_p, c_double, c_int, c_size_t, c_void_p
from functools import cache
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from airrace.errors import SolverCrash
from airrace.trajectory import Array


class Dims(Structure):
    """The struct `FatropOcpCDims`: where stages begin in fatrop's vectors."""

    _fields_ = (
        *((name, POINTER(c_int)) for name in ("ux_offs", "g_offs", "dyn_offs", "dyn_eq_offs", "g_ineq_offs")),
        ("ineq_offs", POINTER(c_int)),
        *((name, c_int) for name in ("max_nu", "max_nx", "max_ng", "max_ngineq", "n_ineqs", "K")),
        *((name, POINTER(c_int)) for name in ("nu", "nx", "ng", "ng_ineq")),
    )


class Stats(Structure):
    """The struct `FatropOcpCStats`: times, numbers of calls and how the solve ended."""

    _fields_ = (
        *((f"{name}_time", c_double) for name in ("compute_sd", "duinf", "eval_hess", "eval_jac", "eval_cv")),
        *((name, c_double) for name in ("eval_grad_time", "eval_obj_time", "initialization_time", "time_total")),
        *((f"eval_{name}_count", c_int) for name in ("hess", "jac", "cv", "grad", "obj")),
        ("iterations_count", c_int),
        ("return_flag", c_int),
    )

    iterations_count: int
    return_flag: int


class BlasfeoVector(Structure):
    """The first members of the struct `blasfeo_dvec`."""

    _fields_ = (("mem", c_void_p), ("pa", c_void_p))

    pa: int


# Pointers arrive as addresses: numpy reads and writes what they point to.
_SIZE = CFUNCTYPE(c_int, c_int, c_void_p)
_TOTAL = CFUNCTYPE(c_int, c_void_p)
_BOUNDS = CFUNCTYPE(c_int, c_void_p, c_void_p, c_int, c_void_p)
_INITIAL = CFUNCTYPE(c_int, c_void_p, c_int, c_void_p)
_HESSIAN = CFUNCTYPE(c_int, c_double, *[c_void_p] * 7)
_JACOBIAN = CFUNCTYPE(c_int, *[c_void_p] * 8)
_VIOLATION = CFUNCTYPE(c_int, *[c_void_p] * 6)
_OBJECTIVE = CFUNCTYPE(c_int, c_double, *[c_void_p] * 6)
_WRITE = CFUNCTYPE(None, c_void_p, c_int)


_FIELDS: dict[str, Any] = {  # Any: ctypes' types have no common public base
    **dict.fromkeys(("get_nx", "get_nu", "get_ng"), _SIZE),
    **dict.fromkeys(("get_n_stage_params", "get_n_global_params"), c_void_p),
    **dict.fromkeys(("get_default_stage_params", "get_default_global_params"), c_void_p),
    "get_ng_ineq": _SIZE,
    "get_horizon_length": _TOTAL,
    **dict.fromkeys(("eval_BAbt", "eval_RSQrqt", "eval_Ggt", "eval_Ggt_ineq", "eval_b", "eval_g"), c_void_p),
    **dict.fromkeys(("eval_gineq", "eval_rq", "eval_L"), c_void_p),
    "get_bounds": _BOUNDS,
    "get_initial_xk": _INITIAL,
    "get_initial_uk": _INITIAL,
    "full_eval_lag_hess": _HESSIAN,
    "full_eval_constr_jac": _JACOBIAN,
    "full_eval_contr_viol": _VIOLATION,
    "full_eval_obj_grad": _OBJECTIVE,
    "full_eval_obj": _OBJECTIVE,
    "user_data": c_void_p,
}


class Interface(Structure):
    """The struct `FatropOcpCInterface`: the callbacks that state a problem; those not set are null.

    The `full_eval_` callbacks return 1 and leave nothing for the callbacks per stage.
    """

    _fields_ = tuple(_FIELDS.items())


Callback = Callable[..., int]


def interface(callbacks: dict[str, Callback]) -> Interface:
    """Make the interface with these callbacks by field name; it keeps them alive."""
    result = Interface()
    for name, callback in callbacks.items():
        setattr(result, name, _FIELDS[name](callback))
    return result


class Output:
    """The stream that fatrop prints to; fatrop has one per process, so it lives as long as the process.

    What Python raises while printing cannot pass through fatrop; it waits in `error`. While `muted`, nothing is
    printed; fatrop's own option for that would hold for all solves that follow. A `listener` receives what is printed.
    """

    def __init__(self) -> None:
        self.error: BaseException | None = None
        self.muted = False
        self.listener: Callable[[str], None] | None = None
        self.callback = _WRITE(self._write)

    def _write(self, address: int, count: int) -> None:
        if self.muted:
            return
        try:
            text = ctypes.string_at(address, count).decode(errors="replace")
            sys.stdout.write(text)
            if self.listener is not None:
                self.listener(text)
        except BaseException as error:
            self.error = error


OUTPUT = Output()


PROTOTYPES: Sequence[tuple[str, Any, tuple[Any, ...]]] = (  # Any: as above
    ("fatrop_ocp_c_create", c_void_p, (POINTER(Interface), _WRITE, c_void_p)),
    ("fatrop_ocp_c_solve", c_int, (c_void_p,)),
    ("fatrop_ocp_c_set_option_double", c_int, (c_void_p, c_char_p, c_double)),
    ("fatrop_ocp_c_set_option_int", c_int, (c_void_p, c_char_p, c_int)),
    ("fatrop_ocp_c_get_primal", POINTER(BlasfeoVector), (c_void_p,)),
    ("fatrop_ocp_c_get_dual", POINTER(BlasfeoVector), (c_void_p,)),
    ("fatrop_ocp_c_get_dims", POINTER(Dims), (c_void_p,)),
    ("fatrop_ocp_c_get_stats", POINTER(Stats), (c_void_p,)),
    ("fatrop_ocp_c_destroy", None, (c_void_p,)),
    ("blasfeo_memsize_dmat", c_size_t, (c_int, c_int)),
    ("blasfeo_create_dmat", None, (c_int, c_int, c_void_p, c_void_p)),
    ("blasfeo_pack_dmat", None, (c_int, c_int, c_void_p, c_int, c_void_p, c_int, c_int)),
)
"""The name, result and arguments of every function that is called, as in the headers."""


@cache
def fatrop() -> ctypes.CDLL:
    """Return the library with fatrop's and (by way of its dependency) blasfeo's functions.

    Raises:
        SolverCrash: casadi was installed without it.
    """
    try:
        library = ctypes.CDLL(_path("fatrop"))
    except FileNotFoundError as error:
        raise SolverCrash(f"the solver fatrop is not part of casadi: {error}") from error
    # Windows looks for no function in the libraries that a library depends on.
    for name, result, arguments in PROTOTYPES:
        function = (blasfeo() if name.startswith("blasfeo") and os.name == "nt" else library)[name]
        function.restype, function.argtypes = result, arguments
        setattr(library, name, function)
    return library


@cache
def blasfeo() -> ctypes.CDLL:
    """Return the library of small dense matrices that fatrop depends on."""
    return ctypes.CDLL(_path("blasfeo"))


def _path(name: str) -> str:
    """Return the path of a library that casadi brings along.

    Raises:
        FileNotFoundError: it does not.
    """
    folder = Path(ca.__file__).parent
    names = [f"lib{name}{suffix}" for suffix in (".so", ".so.0", ".dylib", ".0.dylib", ".dll")]
    path = next((folder / one for one in names if (folder / one).exists()), None)
    if path is None:
        raise FileNotFoundError(f"{folder} holds none of {', '.join(names)}")
    return str(path)


def doubles_at(address: int, count: int) -> Array:
    """Return the numbers at an address, not copied; valid as long as the memory is."""
    return np.ctypeslib.as_array((c_double * count).from_address(address))
