"""The faster products have blasfeo's bits, and blasfeo calls them."""

import ctypes
import subprocess
import sys
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

COUNTING = """
typedef double column __attribute__((vector_size(32), aligned(8)));
int calls = 0;
void kernel_dgemm_nt_4x4_lib4(int kmax, const double *alpha, const double *A, const double *B, const double *beta,
                              const double *C, double *D)
{
    calls++;
    for (int j = 0; j < 4; j++)
        for (int i = 0; i < 4; i++) {
            double sum = 0.0;
            for (int k = 0; k < kmax; k++) sum += A[4 * k + i] * B[4 * k + j];
            D[4 * j + i] = *beta * C[4 * j + i] + *alpha * sum;
        }
}
"""
SOLVE = """
import ctypes, sys
sys.path[:0] = sys.argv[2:]
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
calls = ctypes.c_int.in_dll(library, "calls").value if counted else 0
print("answer", calls, solution.iterate.state.tobytes().hex())
"""


def solved(library: Path | None) -> tuple[int, str]:
    """How often a library's function was called in a process that installs it and solves, and the answer's bits."""
    command = [sys.executable, "-c", SOLVE, "" if library is None else str(library), str(Path(__file__).parent)]
    output = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    _, calls, bits = output.splitlines()[-1].split()
    return int(calls), bits


@pytest.mark.parametrize("instructions", instruction_sets()[1:], ids=lambda one: str(one.lanes))
def test_products_have_the_bits_of_blasfeo(instructions: InstructionSet) -> None:
    assert products.same_bits(ctypes.CDLL(str(products.compiled(instructions))), ctypes.CDLL(str(BLASFEO)))


def test_other_bits_are_noticed(tmp_path: Path) -> None:
    text = COUNTING.replace("double sum = 0.0;", "double sum = 1e-13;")
    kernel_library.compile_library([kernel_library.Source("wrong", text, ("-O1",))], tmp_path / "wrong.so")
    assert not products.same_bits(ctypes.CDLL(str(tmp_path / "wrong.so")), ctypes.CDLL(str(BLASFEO)))


def test_solver_calls_what_is_installed_before_its_first_solve_and_finds_the_same(tmp_path: Path) -> None:
    kernel_library.compile_library([kernel_library.Source("counting", COUNTING, ("-O1",))], tmp_path / "counting.so")
    (none, own), (counted, counting), (_, faster) = (
        solved(library) for library in (None, tmp_path / "counting.so", products.compiled(instruction_set()))
    )
    assert none == 0
    assert counted > 0
    assert own == counting == faster


def test_without_a_compiler_everything_stays_as_it_is(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("CC", "")
    monkeypatch.setenv("AIRRACE_CACHE_DIR", str(tmp_path))
    with pytest.raises(KernelError):
        products.compiled(instruction_set())
    assert products.install.__wrapped__() is False
