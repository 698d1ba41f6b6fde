"""What the machine evaluates has the bits of what is compiled: any system, any scheme, any lanes, any threads."""

import itertools
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from kept import compile_quickly, keep_kernels
from kernel_comparison import needs_compiler
from same_bits import assert_same_bits, results
from small_problems import PROBLEMS, rich_system
from test_lanes import branching_system

from airrace.errors import KernelError, SolverCrash
from airrace.optimal_control.assembly import Assembly
from airrace.optimal_control.bytecode import bytecode, in_runs
from airrace.optimal_control.evaluation import Evaluation
from airrace.optimal_control.interpreted_rates import interpreted
from airrace.optimal_control.kernels import Kernels, build_kernels, path_functions
from airrace.optimal_control.lanes import InstructionSet, instruction_sets
from airrace.optimal_control.layout import Layout
from airrace.optimal_control.machine import Machine, compiled, machine, machine_unless_missing
from airrace.optimal_control.machine_kernels import function_kernel, machine_kernels, step_kernel
from airrace.optimal_control.mapping import Callee, Part
from airrace.optimal_control.runge_kutta import DORMAND_PRINCE_5, RK4, RK4_TWICE, RungeKutta
from airrace.quantities import Quantity
from airrace.system import System

VECTORS = instruction_sets()[1:]
pytestmark = [needs_compiler, pytest.mark.skipif(not VECTORS, reason="the processor has no vectors")]
SYSTEMS = {
    "rich": rich_system(),
    "branching": branching_system(),
    "unprojected": replace(rich_system(), projection=None),
}
CALLS = 5


@pytest.fixture(autouse=True)
def compiled_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Kernels compiled once, quickly; the machine as for flights."""
    keep_kernels(monkeypatch)
    compile_quickly(monkeypatch)
    machine.cache_clear()


def given(kernel: Callee, system: System, intervals: int) -> list[np.ndarray]:
    """Arguments of so many intervals, one after another; what they share once per call."""
    random = np.random.default_rng(3)
    n_y = kernel.hessian_pattern.size1()
    own = intervals if n_y > len(system.states) + len(system.controls) else 0
    shared = np.tile(random.normal(size=len(system.parameters)), intervals // kernel.lanes)
    return [
        random.normal(size=(intervals, n_y)),
        random.normal(size=own),
        shared,
        random.normal(size=(intervals, kernel.values)),
    ]


def machine_of(system: System, scheme: RungeKutta, instructions: InstructionSet) -> Kernels:
    found = Machine(compiled(instructions), instructions.lanes)
    path = path_functions(system)
    return Kernels(
        step_kernel(found, system, scheme),
        function_kernel(found, list(path.values())) if path else None,
        compiled=False,
    )


@pytest.mark.parametrize("instructions", VECTORS, ids=lambda one: f"{one.lanes} lanes")
@pytest.mark.parametrize("scheme", [RK4, RK4_TWICE, DORMAND_PRINCE_5], ids=lambda one: one.name)
@pytest.mark.parametrize("name", SYSTEMS)
def test_the_machine_has_the_bits_of_compiled_kernels(
    name: str, scheme: RungeKutta, instructions: InstructionSet
) -> None:
    system = SYSTEMS[name]
    mine = machine_of(system, scheme, instructions)
    theirs = build_kernels(system, scheme, compiled=True, instructions=instructions)
    assert theirs.compiled
    for one, other in ((mine.step, theirs.step), (mine.path, theirs.path)):
        if one is None or other is None:
            assert one is other
        else:
            assert_same_bits(one, other, CALLS, given(one, system, CALLS * one.lanes))


def test_threads_change_no_bit(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("airrace.optimal_control.mapping.MAP_IN_THREADS", 1)
    kernels = machine_kernels(rich_system(), RK4)
    assert kernels is not None
    arguments = given(kernels.step, rich_system(), CALLS * kernels.step.lanes)
    for part in Part:
        alone = results(kernels.step, part, CALLS, arguments)
        for threads in (2, 3, 8):
            for one, other in zip(alone, results(kernels.step, part, CALLS, arguments, threads), strict=True):
                assert np.array_equal(one, other)


def test_a_program_has_the_same_bits() -> None:
    layout, system = Layout(PROBLEMS["everything"]), PROBLEMS["everything"].system
    found: list[list[np.ndarray]] = []
    for kernels in (machine_kernels(system, RK4), build_kernels(system, RK4, compiled=True)):
        assert kernels is not None
        functions = Evaluation(Assembly(layout, kernels))
        random = np.random.default_rng(2)
        functions.at(random.normal(size=layout.unknowns), layout.parameter_values())
        functions.lam_g[:] = random.normal(size=layout.constraints)
        functions.linearise()
        functions.curve()
        found.append([functions.g, functions.jacobian, functions.gradient, functions.hessian])
    assert all(np.array_equal(one, other) for one, other in zip(*found, strict=True))


def test_arguments_of_another_size_are_refused() -> None:
    kernels = machine_kernels(rich_system(), RK4)
    assert kernels is not None
    arguments = given(kernels.step, rich_system(), kernels.step.lanes)
    with pytest.raises(SolverCrash, match="argument 0"):
        results(kernels.step, Part.VALUES, 2, arguments)


def test_a_system_with_an_operation_that_is_not_known_waits_for_its_compiled_kernels() -> None:
    x, u, p = ca.SX.sym("x"), ca.SX.sym("u"), ca.SX.sym("p", 0)
    rates = ca.Function("rates", [x, u, p], [ca.erf(x) + u])
    assert machine_kernels(System("strange", (Quantity("x", "1"),), (Quantity("u", "1"),), (), rates), RK4) is None
    with pytest.raises(KernelError, match="not known"):
        bytecode(rates)


def test_without_a_compiler_there_is_no_machine(monkeypatch: pytest.MonkeyPatch, tmp_path) -> None:
    monkeypatch.setenv("AIRRACE_CACHE_DIR", str(tmp_path))
    monkeypatch.setenv("CC", "")
    assert machine_kernels(rich_system(), RK4) is None
    machine.cache_clear()


def test_every_operation_follows_those_that_it_depends_on() -> None:
    random = np.random.default_rng(0)
    fixed = 3
    operations = [
        (int(random.integers(4)), int(random.integers(fixed + number)), int(random.integers(fixed + number)))
        for number in range(300)
    ]
    runs = in_runs(operations, fixed)
    order = list(itertools.chain.from_iterable(runs))
    assert sorted(order) == list(range(300))
    place = {number: time for time, number in enumerate(order)}
    for number, (_, a, b) in enumerate(operations):
        assert all(place[one - fixed] < place[number] for one in (a, b) if one >= fixed)
    assert all(len({operations[number][0] for number in run}) == 1 for run in runs)
    assert len(runs) < 150


@pytest.mark.parametrize("count", [1, 7, 8, 9, 30])
def test_rates_at_any_number_of_points_are_those_of_casadi(count: int) -> None:
    found = machine()
    assert found is not None
    assert machine_unless_missing() is found
    random = np.random.default_rng(count)
    system, p = rich_system(), np.array([0.7, -0.3])
    x, u = random.normal(size=(3, count)), random.normal(size=(2, count))
    for function in (system.rates, system.path_values):
        assert function is not None
        rows = found.rows(function, u, p)
        assert np.array_equal(rows(x), interpreted(function, u, p)(x))
        with pytest.raises(ValueError, match="points"):
            rows(np.zeros((3, count + 1)))
