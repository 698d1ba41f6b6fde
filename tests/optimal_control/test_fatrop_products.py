"""The native products have blasfeo's bits in every variant, and fatrop calls them."""

import ctypes
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from kernel_results import variants

from airrace.optimal_control.solvers.fatrop import interposition
from airrace.optimal_control.solvers.fatrop.interposition import PRODUCTS, load_lazily, same_bits

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="takes the place of functions on Linux")

SOLVE = """
import ctypes, sys
sys.path.insert(0, sys.argv[2])
from airrace.optimal_control.solvers.fatrop import interposition
from airrace.native.library import library, library_path
if sys.argv[1] == "native":
    assert interposition.install()
    counts = dict.fromkeys(interposition.PRODUCTS, 0)
    class Counting(type(library().evaluator)):
        pass
    counted = Counting.from_buffer_copy(library().evaluator)
    def counter(name):
        own = getattr(library().evaluator, name)
        def call(*given):
            counts[name] += 1
            own(*given)
        return type(own)(call)
    kept = {name: counter(name) for name in counts}
    for name, function in kept.items():
        setattr(counted, name, function)
    ctypes.CDLL(str(library_path())).products_begin(ctypes.byref(counted))
from small_problems import PROBLEMS, random_iterate
from airrace.optimal_control.kernels import build_kernels
from airrace.optimal_control.layout import Layout
from airrace.optimal_control.solvers.solver import SOLVERS, PreparedProblem, SolverOptions
problem = PROBLEMS["everything"]
kernels = build_kernels(problem.system, problem.scheme)
ready = PreparedProblem(Layout(problem), kernels, SOLVERS["fatrop"], SolverOptions(tolerance=1e-9), 1)
solution = ready.solve(Layout(problem), random_iterate(problem, 1))
assert solution.success
print("answer", *(counts.values() if sys.argv[1] == "native" else ()), solution.iterate.state.tobytes().hex())
"""


def blasfeos() -> list[Any]:
    return [load_lazily()[name] for name in PRODUCTS.values()]


def natives(variant: str) -> list[Any]:
    evaluator = variants()[variant].evaluator
    return [getattr(evaluator, name) for name in PRODUCTS]


@pytest.mark.parametrize("variant", variants())
def test_products_have_the_bits_of_blasfeo(variant: str) -> None:
    assert same_bits(natives(variant), blasfeos())


@pytest.mark.parametrize("wrong", range(3))
def test_other_bits_are_noticed(wrong: int) -> None:
    products = natives("baseline")
    right = products[wrong]

    def with_an_error(*given: Any) -> None:
        right(*given)
        first = ctypes.c_double.from_address(given[-1].value)
        first.value *= 1.0 + 1e-15

    products[wrong] = with_an_error
    assert not same_bits(products, blasfeos())


def solved(what: str) -> tuple[list[int], str]:
    """How often each product was called in a process that solves, and the bits of the answer."""
    command = [sys.executable, "-c", SOLVE, what, str(Path(__file__).parent)]
    output = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    _, *calls, bits = output.splitlines()[-1].split()
    return [int(count) for count in calls], bits


def test_fatrop_calls_what_is_installed_and_finds_the_same() -> None:
    (none, own), (calls, same) = solved("blasfeo"), solved("native")
    assert none == []
    assert len(calls) == 3
    assert all(calls)
    assert own == same


def test_a_blasfeo_that_computes_otherwise_keeps_its_functions(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(interposition, "same_bits", lambda *_: False)
    assert not interposition.install.__wrapped__()
