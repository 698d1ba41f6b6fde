"""The faster products have blasfeo's bits, and blasfeo calls them."""

import ctypes
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import casadi as ca
import pytest

from airrace.errors import KernelError
from airrace.optimal_control import kernel_library
from airrace.optimal_control.fatrop import products
from airrace.optimal_control.lanes import InstructionSet, instruction_set, instruction_sets

BLASFEO = Path(ca.__file__).parent / "libblasfeo.so.0"

pytestmark = pytest.mark.skipif(
    sys.platform != "linux" or instruction_set().lanes == 1, reason="no vector registers, or another system"
)

FIRST_LINES = {
    products.MATRICES: "    column sums[4] = {all(0.0)",
    products.COLUMNS: "    column sums = all(0.0);\n    for (",
    products.ROWS: "    column sums = all(0.0);\n    int k",
}
"""How each function begins, in the order in which they stand in the source."""


def changed_source(first_line: Callable[[str, str], str]) -> str:
    """The source of the products with other first lines of its functions: made from name and first line."""
    text = products.FILE.read_text(encoding="utf-8")
    for name, line in FIRST_LINES.items():
        assert text.count(line) == 1
        text = text.replace(line, first_line(name, line))
    return text


def compiled(text: str, path: Path) -> Path:
    flags = ("-O3", *instruction_set().flags)
    kernel_library.compile_library([kernel_library.Source(path.stem, text, flags)], path)
    return path


SOLVE = """
import ctypes, sys
sys.path.insert(0, sys.argv[2])
from pathlib import Path
from airrace.optimal_control.fatrop import products
if sys.argv[1]:
    products.compiled = lambda _: Path(sys.argv[1])
    assert products.install()
    library = ctypes.CDLL(sys.argv[1])
from small_problems import PROBLEMS, random_iterate
from airrace.optimal_control.kernels import build_kernels
from airrace.optimal_control.layout import Layout
from airrace.optimal_control.solvers import SOLVERS, PreparedProblem, SolverOptions
problem = PROBLEMS["everything"]
kernels = build_kernels(problem.system, problem.scheme, compiled=False)
ready = PreparedProblem(Layout(problem), kernels, SOLVERS["fatrop"], SolverOptions(tolerance=1e-9), 1)
solution = ready.solve(Layout(problem), random_iterate(problem, 1))
assert solution.success
counted = Path(sys.argv[1]).name == "counting.so"
calls = [ctypes.c_int.in_dll(library, f"calls_of_{name}").value if counted else 0 for name in sys.argv[3].split()]
print("answer", *calls, solution.iterate.state.tobytes().hex())
"""


def solved(library: Path | None) -> tuple[list[int], str]:
    """How often each function was called in a process that installs a library and solves, and the answer's bits."""
    given = ("" if library is None else str(library), str(Path(__file__).parent), " ".join(FIRST_LINES))
    output = subprocess.run([sys.executable, "-c", SOLVE, *given], capture_output=True, text=True, check=True).stdout
    _, *calls, bits = output.splitlines()[-1].split()
    return [int(count) for count in calls], bits


@pytest.mark.parametrize("instructions", instruction_sets()[1:], ids=lambda one: str(one.lanes))
def test_products_have_the_bits_of_blasfeo(instructions: InstructionSet) -> None:
    assert products.same_bits(ctypes.CDLL(str(products.compiled(instructions))), ctypes.CDLL(str(BLASFEO)))


@pytest.mark.parametrize("wrong", FIRST_LINES)
def test_other_bits_are_noticed(wrong: str, tmp_path: Path) -> None:
    text = changed_source(lambda name, line: line.replace("all(0.0)", "all(1e-13)", 1) if name == wrong else line)
    assert not products.same_bits(ctypes.CDLL(str(compiled(text, tmp_path / "wrong.so"))), ctypes.CDLL(str(BLASFEO)))


def test_solver_calls_what_is_installed_before_its_first_solve_and_finds_the_same(tmp_path: Path) -> None:
    text = changed_source(lambda name, line: f"    calls_of_{name}++;\n{line}")
    counters = "".join(f"int calls_of_{name} = 0;\n" for name in FIRST_LINES)
    counting = compiled(counters + text, tmp_path / "counting.so")
    (none, own), (counted, same), (_, faster) = (
        solved(library) for library in (None, counting, products.compiled(instruction_set()))
    )
    assert none == [0, 0, 0]
    assert all(counted)
    assert own == same == faster


def test_without_a_compiler_everything_stays_as_it_is(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("CC", "")
    monkeypatch.setenv("AIRRACE_CACHE_DIR", str(tmp_path))
    with pytest.raises(KernelError):
        products.compiled(instruction_set())
    assert products.install.__wrapped__() is False
