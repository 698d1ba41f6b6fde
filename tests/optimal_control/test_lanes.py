"""Several intervals at once have the bits of one at a time, in whatever lane and beside whatever others."""

import ctypes
import logging
from dataclasses import replace
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from kept import compile_quickly, keep_kernels
from kernel_comparison import needs_compiler
from small_problems import PROBLEMS, rich_system

from airrace.optimal_control.assembly import Assembly
from airrace.optimal_control.compiled_rates import PointFunctions, compiled_rows, interpreted
from airrace.optimal_control.evaluation import Evaluation
from airrace.optimal_control.kernel_library import find_compiler
from airrace.optimal_control.kernels import Kernel, Kernels, build_kernels, cached_rows, compile_kernels
from airrace.optimal_control.lane_code import LANE_BY_LANE, has_lanes
from airrace.optimal_control.lanes import SINGLE, InstructionSet, instruction_set, instruction_sets
from airrace.optimal_control.layout import Layout
from airrace.optimal_control.runge_kutta import RK4, RungeKutta
from airrace.quantities import Quantity
from airrace.system import System

VECTORS = instruction_sets()[1:]
IDS = [f"{one.lanes} lanes" for one in VECTORS]
VECTORLESS = """#!/bin/sh
for argument; do
    case "$argument" in *.c) if grep -q vector_size "$argument"; then exit 1; fi;; esac
done
exec {compiler} "$@"
"""

pytestmark = [needs_compiler, pytest.mark.skipif(not VECTORS, reason="the processor has no vectors")]


@pytest.fixture(autouse=True)
def compiled_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Kernels compiled once."""
    keep_kernels(monkeypatch)


def branching_system() -> System:
    """Two states, a control, a parameter, and all operations that are loops over the lanes."""
    x, u, p = ca.SX.sym("x", 2), ca.SX.sym("u"), ca.SX.sym("p")
    a, b = x[0], x[1]
    within = 0.9 * ca.tanh(a)
    smooth = ca.exp(0.1 * a) + ca.log(2 + a * a) + ca.sqrt(1 + b * b) + ca.sin(a) * ca.cos(b) + ca.tan(within)
    smooth += ca.asin(within) + ca.acos(within) + ca.atan(a) + ca.atan2(a, 1 + b * b) + ca.hypot(a, 1 + b)
    smooth += ca.sinh(within) + ca.cosh(within) + ca.asinh(a) + ca.acosh(2 + a * a) + ca.atanh(within)
    smooth += ca.log1p(a * a) + ca.expm1(within) + (2 + within) ** b + (2 + within) ** 2.5
    steps = ca.floor(3 * a) + ca.ceil(b) + ca.fmod(5 * a, 2) + ca.sign(a) * ca.fabs(b) + ca.copysign(a, b)
    either = ca.if_else(ca.logic_and(a < b, ca.logic_not(b <= p)), a * b, ca.fmin(a, b) * ca.fmax(a, u))
    either += ca.if_else(ca.logic_or(a == b, a != p), 1 / (2 + b * b), -b) + 2 * u
    rates = ca.Function("rates", [x, u, p], [ca.vertcat(smooth + steps, either)])
    named = [tuple(Quantity(f"{one}", "1") for one in ca.vertsplit(symbols)) for symbols in (x, u, p)]
    return System("branching", named[0], named[1], named[2], rates)


SYSTEMS = {"rich": rich_system(), "branching": branching_system(), "one phase": PROBLEMS["one phase"].system}


def kernels(of: System, instructions: InstructionSet, scheme: RungeKutta = RK4) -> Kernels:
    built = build_kernels(of, scheme, compiled=True, instructions=instructions)
    assert built.compiled
    assert built.step.lanes == instructions.lanes
    return built


def intervals(kernel: Kernel, count: int) -> list[np.ndarray]:
    """y, own and multipliers of so many intervals, one per column; `shared` third."""
    random = np.random.default_rng(5)
    sizes = [kernel.hessian.size1_in(place) for place in range(4)]
    return [random.normal(size=(size, 1 if place == 2 else count)) for place, size in enumerate(sizes)]


def evaluated(kernel: Kernel, given: list[np.ndarray]) -> list[np.ndarray]:
    """All nonzeros of a kernel's results for the columns of as many intervals as it takes at once."""
    several = kernel.several or kernel
    results = [several.value(*given[:3]), *several.jacobian(*given[:3]), *several.hessian(*given)]
    return [np.array(one.nonzeros()).reshape(kernel.lanes, -1) for one in results]


def one_by_one(kernel: Kernel, given: list[np.ndarray]) -> list[np.ndarray]:
    """The same by a kernel of one interval, in the same form."""
    columns = range(given[0].shape[1])
    each = [evaluated(kernel, [one if place == 2 else one[:, [c]] for place, one in enumerate(given)]) for c in columns]
    return [np.vstack(results) for results in zip(*each, strict=True)]


def assert_identical(mine: list[np.ndarray], theirs: list[np.ndarray]) -> None:
    for one, other in zip(mine, theirs, strict=True):
        assert np.isfinite(other).all()
        assert np.array_equal(one, other)


@pytest.mark.parametrize("instructions", VECTORS, ids=IDS)
@pytest.mark.parametrize("name", ["rich", "one phase", pytest.param("branching", marks=pytest.mark.slow)])
def test_lanes_have_the_bits_of_single_intervals(name: str, instructions: InstructionSet) -> None:
    several, single = kernels(SYSTEMS[name], instructions), kernels(SYSTEMS[name], SINGLE)
    pairs = [(several.step, single.step)]
    if several.path is not None and single.path is not None:
        pairs.append((several.path, single.path))
    for mine, theirs in pairs:
        given = intervals(mine, mine.lanes)
        assert_identical(evaluated(mine, given), one_by_one(theirs, given))


def test_every_operation_that_is_a_loop_has_the_bits_of_single_intervals() -> None:
    several, single = (kernels(branching_system(), one).step for one in (VECTORS[-1], SINGLE))
    given = intervals(several, several.lanes)
    assert_identical(evaluated(several, given), one_by_one(single, given))


def test_the_branching_system_has_all_loops_over_the_lanes() -> None:
    rates = branching_system().rates
    used = {rates.instruction_id(number) for number in range(rates.n_instructions())}
    assert used >= LANE_BY_LANE.keys()
    assert has_lanes(rates)


@pytest.mark.parametrize("instructions", VECTORS, ids=IDS)
def test_it_does_not_matter_in_which_lane_an_interval_stands(instructions: InstructionSet) -> None:
    step = kernels(rich_system(), instructions).step
    given = intervals(step, step.lanes)
    expected = evaluated(step, given)
    for turn in range(1, step.lanes):
        order = np.roll(np.arange(step.lanes), turn)
        turned = evaluated(step, [one if place == 2 else one[:, order] for place, one in enumerate(given)])
        assert_identical(turned, [one[order] for one in expected])


def test_an_interval_that_cannot_be_evaluated_spoils_no_other() -> None:
    step = kernels(rich_system(), instruction_set()).step
    given = intervals(step, step.lanes)
    expected = evaluated(step, given)
    given[0][:, 0] = np.nan
    spoilt = evaluated(step, given)
    assert np.isnan(spoilt[0][0]).all()
    assert_identical([one[1:] for one in spoilt], [one[1:] for one in expected])


def test_a_kernel_of_one_interval_is_any_lane() -> None:
    step = kernels(rich_system(), instruction_set()).step
    given = intervals(step, step.lanes)
    expected = evaluated(step, given)
    first = [one if place == 2 else one[:, :1] for place, one in enumerate(given)]
    results = [step.value(*first[:3]), *step.jacobian(*first[:3]), *step.hessian(*first)]
    assert_identical([np.array(one.nonzeros()) for one in results], [one[0] for one in expected])


def program_values(functions: Evaluation) -> list[np.ndarray]:
    random, layout = np.random.default_rng(2), functions.assembly.layout
    functions.at(random.normal(size=layout.unknowns), layout.parameter_values())
    functions.lam_g[:] = random.normal(size=layout.constraints)
    functions.linearise()
    functions.curve()
    results = (functions.g, functions.jacobian, functions.gradient, functions.hessian)
    return [np.array([functions.f]), *(one.copy() for one in results)]


@pytest.mark.parametrize("name", PROBLEMS)
def test_a_program_has_the_same_bits_with_lanes_and_without(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The numbers of intervals and of nodes are no multiples of the lanes: some lanes are left over."""
    compile_quickly(monkeypatch)
    layout, system = Layout(PROBLEMS[name]), PROBLEMS[name].system
    expected = program_values(Evaluation(Assembly(layout, kernels(system, SINGLE))))
    for instructions in VECTORS:
        several = kernels(system, instructions)
        assert_identical(program_values(Evaluation(Assembly(layout, several))), expected)


def test_a_program_has_the_same_bits_on_several_threads_and_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("airrace.optimal_control.mapping.MAP_IN_THREADS", 1)
    layout = Layout(PROBLEMS["everything"])
    several = kernels(rich_system(), VECTORS[0])
    expected = program_values(Evaluation(Assembly(layout, several)))
    threaded = Evaluation(Assembly(layout, several), 2)
    for _ in range(10):
        assert_identical(program_values(threaded), expected)


@pytest.mark.parametrize("count", [1, 7, 8, 9, 30])
def test_compiled_rates_are_those_of_casadi_at_any_number_of_points(count: int) -> None:
    random = np.random.default_rng(count)
    system, p = rich_system(), np.array([0.7, -0.3])
    x, u = random.normal(size=(3, count)), random.normal(size=(2, count))
    library = compile_kernels(system, RK4)
    assert library == cached_rows(system, RK4)
    for name, function in (("rates", system.rates), ("path", system.path_values)):
        assert function is not None
        expected = np.hstack([np.asarray(function(x[:, [c]], u[:, [c]], p)) for c in range(count)])
        found = compiled_rows(ctypes.CDLL(str(library)), name, len(expected), u, p)(x)
        assert np.array_equal(found, expected)
        assert np.array_equal(interpreted(function, u, p)(x), expected)


def test_states_of_another_number_of_points_are_refused() -> None:
    library = compile_kernels(rich_system(), RK4)
    rates = compiled_rows(ctypes.CDLL(str(library)), "rates", 3, np.zeros((2, 5)), np.zeros(2))
    with pytest.raises(ValueError, match="5 points"):
        rates(np.zeros((3, 4)))


def test_an_operation_that_lanes_do_not_know_is_done_one_by_one() -> None:
    x, u, p = ca.SX.sym("x"), ca.SX.sym("u"), ca.SX.sym("p", 0)
    rates = ca.Function("rates", [x, u, p], [ca.erf(x) + u])
    system = System("strange", (Quantity("x", "1"),), (Quantity("u", "1"),), (), rates)
    assert not has_lanes(rates)
    built = build_kernels(system, RK4, compiled=True)
    assert built.compiled
    assert built.step.lanes == 1
    assert cached_rows(system, RK4) is None


def test_a_compiler_without_vectors_compiles_single_intervals(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    compiler = tmp_path / "plain-compiler"
    compiler.write_text(VECTORLESS.format(compiler=find_compiler()))
    compiler.chmod(0o755)
    monkeypatch.setenv("CC", str(compiler))
    monkeypatch.setenv("AIRRACE_CACHE_DIR", str(tmp_path / "kernels"))
    with caplog.at_level(logging.WARNING, logger="airrace"):
        built = build_kernels(rich_system(), RK4, compiled=True)
    assert built.compiled
    assert built.step.lanes == 1
    assert not caplog.records


def test_every_number_of_lanes_has_its_own_library() -> None:
    libraries = {compile_kernels(rich_system(), RK4, one) for one in instruction_sets()}
    assert len(libraries) == len(instruction_sets())


def test_a_library_that_cannot_be_loaded_is_done_without(monkeypatch: pytest.MonkeyPatch) -> None:
    compile_kernels(rich_system(), RK4)
    problem = replace(PROBLEMS["everything"], scheme=RK4)
    x, u = np.full((3, 4), 0.3), np.full((2, 4), -0.2)
    expected = PointFunctions(problem).rates(u)(x)

    def refuse(*_: object) -> None:
        raise OSError("cannot map the file")

    monkeypatch.setattr(ctypes, "CDLL", refuse)
    assert np.array_equal(PointFunctions(problem).rates(u)(x), expected)
