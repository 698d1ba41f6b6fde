"""The memory and the small matrix products that the native library gives to fatrop's linear algebra."""

import ctypes
import shutil
import subprocess
import sys
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from kernel_results import variants

from airrace.native.library import library_path
from airrace.optimal_control.solvers.fatrop import blasfeo
from airrace.optimal_control.solvers.fatrop.blasfeo import PRODUCTS, load_lazily, same_bits

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="takes the memory from Linux")

PAGE = 4096
LARGE, KEPT = 2**20, 2**23  # so that few matrices are many


class Piece(ctypes.Structure):
    """A blasfeo matrix as far as it matters here: its memory, and behind that what blasfeo keeps."""

    _fields_ = (("memory", ctypes.c_void_p), ("rest", ctypes.c_char * 64))


@cache
def copied(path: Path) -> ctypes.CDLL:
    """A copy of the native library in this process, asked by nobody but the tests."""
    found = library_path()
    assert found is not None
    shutil.copy(found, path)
    loaded = ctypes.CDLL(str(path))
    blasfeo.begin_arena(loaded, LARGE, KEPT)
    return loaded


@pytest.fixture
def small(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    return copied(tmp_path_factory.getbasetemp() / "airrace_native.so")


class Use(NamedTuple):
    """The memory that is handed out, the most that ever was, and what was given back to the system so far, bytes."""

    in_use: int
    most: int
    returned: int


def use_of(native: ctypes.CDLL) -> Use:
    numbers = (ctypes.c_size_t * 3)()
    native.arena_use(numbers)
    return Use(*numbers)


@dataclass
class Matrix:
    """A matrix that was asked for, filled with zeros as fatrop does."""

    library: ctypes.CDLL
    rows: int
    columns: int

    def __post_init__(self) -> None:
        self.piece = Piece()
        self.library.blasfeo_allocate_dmat(self.rows, self.columns, ctypes.byref(self.piece))
        size = blasfeo.load_lazily().blasfeo_memsize_dmat(self.rows, self.columns)
        self.numbers = np.ctypeslib.as_array((ctypes.c_double * (size // 8)).from_address(self.piece.memory))
        self.numbers[:] = 0.0

    def free(self) -> None:
        self.library.blasfeo_free_dmat(ctypes.byref(self.piece))


def resident() -> int:
    """Memory of this process, bytes."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * PAGE


def test_what_is_written_stays_though_zeros_around_it_are_given_back(small: ctypes.CDLL) -> None:
    random = np.random.default_rng(1)
    matrices, kept = list[Matrix](), list[np.ndarray]()
    for number in range(3000):  # 18 x 17 numbers each: 10 MB, ten times as many as are large here
        matrices.append(Matrix(small, 18 + number % 3, 17))
        if number % 7 == 0:  # at once, as nobody does, so that they lie in pages that are looked at
            matrices[-1].numbers[:] = random.normal(size=matrices[-1].numbers.shape)
        kept.append(matrices[-1].numbers.copy())
    assert use_of(small).returned > 0
    for matrix, numbers in zip(matrices, kept, strict=True):
        assert np.array_equal(matrix.numbers, numbers)
        matrix.numbers[:] = random.normal(size=numbers.shape)  # pages that were given back come again
        numbers[:] = matrix.numbers
    for matrix, numbers in zip(matrices, kept, strict=True):
        assert np.array_equal(matrix.numbers, numbers)
    for matrix in matrices:
        matrix.free()
    assert use_of(small).in_use == 0


def test_pieces_begin_at_lines_of_the_cache_and_overlap_nowhere(small: ctypes.CDLL) -> None:
    random = np.random.default_rng(2)
    matrices = [Matrix(small, int(rows), int(columns)) for rows, columns in random.integers(0, 90, size=(500, 2))]
    matrices += [Matrix(small, 1000, 1000), Matrix(small, 1200, 900)]  # larger than a chunk
    spans = sorted((one.piece.memory, one.piece.memory + one.numbers.nbytes) for one in matrices if one.numbers.size)
    assert all(begin % 64 == 0 for begin, _ in spans)
    assert all(end <= begin for (_, end), (begin, _) in pairwise(spans))
    order: list[int] = random.permutation(len(matrices)).tolist()
    for one in order:
        matrices[one].free()
    assert use_of(small).in_use == 0


def test_memory_that_is_never_written_is_given_back(small: ctypes.CDLL) -> None:
    before = resident()
    matrices = [Matrix(small, 18, 17) for _ in range(20_000)]
    filled = sum(one.numbers.nbytes for one in matrices)
    assert filled > 60 * 2**20
    assert resident() - before < 0.5 * filled  # what is left is mostly what Python keeps of the matrices
    for matrix in matrices:
        matrix.free()
    assert use_of(small).in_use == 0


SOLVE = """
import ctypes, sys
sys.path.insert(0, sys.argv[2])
from airrace.optimal_control.solvers.fatrop import blasfeo
from airrace.native.library import library, library_path
if sys.argv[1] == "native":
    assert blasfeo.interpose()
    counts = dict.fromkeys(blasfeo.PRODUCTS, 0)
    class Counting(type(library().evaluator)):
        pass
    counted = Counting.from_buffer_copy(library().evaluator)
    def counter(name):
        own = getattr(library().evaluator, name)
        def call(*given):
            counts[name] += 1
            own(*given)
        return type(own)(call)
    counters = {name: counter(name) for name in counts}
    for name, function in counters.items():
        setattr(counted, name, function)
    ctypes.CDLL(str(library_path())).products_begin(ctypes.byref(counted))
from small_problems import PROBLEMS, random_iterate
from airrace.optimal_control.kernels import build_kernels
from airrace.optimal_control.layout import Layout
from airrace.optimal_control.solvers.interface import SolverOptions
from airrace.optimal_control.solvers.solver import PreparedProblem
problem = PROBLEMS["everything"]
kernels = build_kernels(problem.system, problem.scheme)
for _ in range(2):
    ready = PreparedProblem(Layout(problem), kernels, "fatrop", SolverOptions(tolerance=1e-9), 1)
    solution = ready.solve(Layout(problem), random_iterate(problem, 1))
    assert solution.success
    print("answer", solution.iterations, solution.iterate.state.tobytes().hex())
if sys.argv[1] == "native":
    use = (ctypes.c_size_t * 3)()  # now, at most, returned
    ctypes.CDLL(str(library_path())).arena_use(use)
    assert use[0] == 0 and use[1] > 0
    assert len(counts) == 3 and all(counts.values())
"""


def answers(what: str) -> list[str]:
    """What two solves in a process of its own answered."""
    command = [sys.executable, "-c", SOLVE, what, str(Path(__file__).parent)]
    output = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    return [line for line in output.splitlines() if line.startswith("answer")]


def test_fatrop_calls_what_is_installed_and_finds_the_same_bits() -> None:
    first, second = answers("native")
    assert [first] * 2 == [first, second] == answers("blasfeo")


@pytest.mark.parametrize(("name", "instead"), [("library", lambda: None), ("same_bits", lambda *_: False)])
def test_blasfeo_keeps_its_functions_without_the_library_or_where_it_computes_otherwise(
    name: str, instead: object, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(blasfeo, name, instead)
    assert not blasfeo.interpose.__wrapped__()


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
