"""What the native interpreter evaluates has the same bits in every variant, lane and thread, and those of casadi."""

import itertools
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from kernel_results import all_results, assert_as_casadi, assert_bitwise_equal, random_intervals, variants
from small_problems import PROBLEMS, rich_system

from airrace.errors import KernelError, SolverCrash
from airrace.native.interpreter import Interpreter, bytecode, in_runs, interpreter, operation_numbers
from airrace.native.library import library
from airrace.optimal_control.assembly import Assembly
from airrace.optimal_control.evaluation import Evaluation
from airrace.optimal_control.kernels import (
    Kernel,
    NativeKernel,
    build_kernels,
    native_kernels,
    path_functions,
)
from airrace.optimal_control.layout import Layout
from airrace.optimal_control.replay import casadi_function_at_points
from airrace.optimal_control.runge_kutta import DORMAND_PRINCE_5, RK4, RK4_TWICE, RungeKutta
from airrace.quantities import Quantity
from airrace.system import System

VARIANTS = {name: Interpreter(found) for name, found in variants().items()}
COUNT = 24  # intervals, a multiple of all lanes


def branching_system() -> System:
    """Two states, a control, a parameter, and all operations that the interpreter knows."""
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
    either += a / (3 + b * b) - p * b
    rates = ca.Function("rates", [x, u, p], [ca.vertcat(smooth + steps, either)])
    named = [tuple(Quantity(f"{one}", "1") for one in ca.vertsplit(symbols)) for symbols in (x, u, p)]
    return System("branching", named[0], named[1], named[2], rates)


SYSTEMS = {
    "rich": rich_system(),
    "branching": branching_system(),
    "unprojected": replace(rich_system(), projection=None),
}


def kernels_of(native: Interpreter, system: System, scheme: RungeKutta) -> list[NativeKernel]:
    found = native_kernels(native, system, scheme)
    assert isinstance(found.step, NativeKernel)
    return [found.step, *([found.path] if isinstance(found.path, NativeKernel) else [])]


def intervals(kernel: NativeKernel, count: int = COUNT) -> list[np.ndarray]:
    _, own, shared, _ = kernel.sizes
    return random_intervals(kernel, own, shared, count)


@pytest.mark.parametrize("scheme", [RK4, RK4_TWICE, DORMAND_PRINCE_5], ids=lambda one: one.name)
@pytest.mark.parametrize("name", SYSTEMS)
def test_all_variants_have_the_same_bits(name: str, scheme: RungeKutta) -> None:
    assert "baseline" in VARIANTS
    first, *others = (kernels_of(native, SYSTEMS[name], scheme) for native in VARIANTS.values())
    for kernels in others:
        for mine, theirs in zip(kernels, first, strict=True):
            given = intervals(mine)
            assert_bitwise_equal(all_results(mine, given), all_results(theirs, given))


@pytest.mark.parametrize("name", ["rich", "branching"])
@pytest.mark.parametrize("variant", VARIANTS)
def test_functions_have_the_bits_of_casadi(variant: str, name: str) -> None:
    system, native = SYSTEMS[name], VARIANTS[variant]
    functions = [system.rates] if system.path_values is None else [system.rates, system.path_values]
    random = np.random.default_rng(1)
    x, u = (random.normal(size=(len(part), COUNT)) for part in (system.states, system.controls))
    p = random.normal(size=len(system.parameters))
    for function in functions:
        assert_as_casadi([native.at_points(function, u, p)(x)], [casadi_function_at_points(function, u, p)(x)])


@pytest.mark.parametrize("variant", VARIANTS)
def test_path_quantities_and_derivatives_have_the_bits_of_casadi(variant: str) -> None:
    _, mine = kernels_of(VARIANTS[variant], rich_system(), RK4)
    given = intervals(mine)
    theirs = Kernel(*path_functions(rich_system()).values())
    assert_as_casadi(all_results(mine, given), all_results(theirs, given))


def test_the_branching_system_has_all_operations() -> None:
    rates = branching_system().rates
    used = {rates.instruction_id(number) for number in range(rates.n_instructions())}
    assert used >= operation_numbers().keys() - {ca.OP_ASSIGN}


@pytest.mark.parametrize("variant", VARIANTS)
def test_it_does_not_matter_in_which_lane_an_interval_stands(variant: str) -> None:
    native = VARIANTS[variant]
    step, _ = kernels_of(native, rich_system(), RK4)
    y, own, shared, lam = intervals(step, native.lanes)
    expected = all_results(step, [y, own, shared, lam])
    for turn in range(1, native.lanes):
        order = np.roll(np.arange(native.lanes), turn)
        assert_bitwise_equal(
            all_results(step, [y[order], own[order], shared, lam[order]]), [one[order] for one in expected]
        )


def test_an_interval_that_cannot_be_evaluated_spoils_no_other() -> None:
    step, _ = kernels_of(list(VARIANTS.values())[-1], rich_system(), RK4)
    given = intervals(step)
    expected = all_results(step, given)
    given[0][0] = np.nan
    found = all_results(step, given)
    assert np.isnan(found[0][0]).all()
    assert_bitwise_equal([one[1:] for one in found], [one[1:] for one in expected])


def test_threads_change_no_bit(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("airrace.optimal_control.kernels.MAP_IN_THREADS", 1)
    step, _ = kernels_of(list(VARIANTS.values())[-1], rich_system(), RK4)
    given = intervals(step, 5 * step.lanes)
    alone = all_results(step, given)
    for threads in (2, 3, 8):
        assert_bitwise_equal(all_results(step, given, threads), alone)


@pytest.mark.parametrize("name", PROBLEMS)
def test_a_program_has_the_same_bits_in_all_variants(name: str) -> None:
    """The numbers of intervals and nodes are no multiples of the lanes: some lanes are left over."""
    layout, problem = Layout(PROBLEMS[name]), PROBLEMS[name]
    found: list[list[np.ndarray]] = []
    for native in VARIANTS.values():
        functions = Evaluation(Assembly(layout, native_kernels(native, problem.system, RK4)))
        random = np.random.default_rng(2)
        functions.at(random.normal(size=layout.unknowns), layout.parameter_values())
        functions.lam_g[:] = random.normal(size=layout.constraints)
        functions.linearise()
        functions.curve()
        found.append([functions.g, functions.jacobian, functions.gradient, functions.hessian])
    for one in found[1:]:
        assert_bitwise_equal(one, found[0])


def test_arguments_of_another_size_are_refused() -> None:
    step, _ = kernels_of(list(VARIANTS.values())[-1], rich_system(), RK4)
    y, own, shared, lam = intervals(step)
    with pytest.raises(SolverCrash, match="argument 1"):
        all_results(step, [y, own[1:], shared, lam])


def test_casadi_evaluates_an_operation_that_the_interpreter_does_not_know(caplog: pytest.LogCaptureFixture) -> None:
    x, u, p = ca.SX.sym("x"), ca.SX.sym("u"), ca.SX.sym("p", 0)
    rates = ca.Function("rates", [x, u, p], [ca.erf(x) + u])
    with pytest.raises(KernelError, match="not known"):
        bytecode(rates)
    built = build_kernels(System("strange", (Quantity("x", "1"),), (Quantity("u", "1"),), (), rates), RK4)
    assert isinstance(built.step, Kernel)
    assert "casadi evaluates strange, slower" in caplog.text


def test_casadi_evaluates_without_the_library(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("AIRRACE_NATIVE", "off")
    library.cache_clear()
    interpreter.cache_clear()
    try:
        assert isinstance(build_kernels(rich_system(), RK4).step, Kernel)
    finally:
        library.cache_clear()
        interpreter.cache_clear()


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
def test_any_number_of_points_is_evaluated(count: int) -> None:
    random = np.random.default_rng(count)
    system, p = rich_system(), np.array([0.7, -0.3])
    x, u = random.normal(size=(3, count)), random.normal(size=(2, count))
    for native in VARIANTS.values():
        at = native.at_points(system.rates, u, p)
        assert_as_casadi(
            [at(x)], [np.hstack([np.asarray(system.rates(x[:, [c]], u[:, [c]], p)) for c in range(count)])]
        )
        with pytest.raises(ValueError, match="points"):
            at(np.zeros((3, count + 1)))
