"""Kernels, the sums over them and the program's functions, each against casadi's own."""

import math
import operator
import weakref
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from casadi_program import transcribed
from kernel_results import all_results, assert_as_casadi, assert_bitwise_equal, random_intervals, results, variants
from numpy.typing import NDArray
from small_problems import PROBLEMS, random_point, rich_system

from airrace.errors import KernelError, SolverCrash
from airrace.optimal_control import sparse_assembly as module
from airrace.optimal_control.assembly import Assembly
from airrace.optimal_control.evaluation import Evaluation
from airrace.optimal_control.kernels import (
    Kernel,
    NativeKernel,
    Observations,
    Part,
    bind,
    build_kernels,
    casadi_kernels,
    casadi_observation,
    native_kernels,
    native_observation,
    path_functions,
)
from airrace.optimal_control.layout import Layout
from airrace.optimal_control.native.interpreter import Interpreter, bytecode, interpreter, operation_numbers
from airrace.optimal_control.native.library import library
from airrace.optimal_control.quantities import Quantity
from airrace.optimal_control.runge_kutta import DORMAND_PRINCE_5, RK4, RK4_TWICE, VERNER_7, RungeKutta
from airrace.optimal_control.solvers.ipopt import ProgramFunctions
from airrace.optimal_control.sparse_assembly import COOBuilder, SparseAssembly
from airrace.optimal_control.system import System, at_points
from airrace.procedure.fidelity import LONGEST_INTERVAL

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
        assert_as_casadi([native.at_points(function, u, p)(x)], [at_points(function, x, u, p)])


@pytest.mark.parametrize("variant", VARIANTS)
def test_path_quantities_and_derivatives_have_the_bits_of_casadi(variant: str) -> None:
    _, mine = kernels_of(VARIANTS[variant], rich_system(), RK4)
    given = intervals(mine)
    theirs = Kernel(*path_functions(rich_system()))
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


def seen_from_a_place() -> ca.Function:
    """What does not depend on the third state beside what does, so that the pattern of the Hessian has gaps."""
    x, b = ca.SX.sym("x", 4), ca.SX.sym("b", 2)
    distance = ca.sqrt((x[0] - b[0]) ** 2 + (x[1] - b[1]) ** 2 + 1.0)
    return ca.Function("seen", [x, b], [ca.vertcat(distance, ca.sin(x[3]) / distance)])


@pytest.mark.parametrize("variant", VARIANTS)
def test_an_observation_is_interpreted_with_the_bits_of_casadi(variant: str) -> None:
    observations, values = Observations(VARIANTS[variant]), seen_from_a_place()
    mine, again, others = observations.kernel(values), observations.kernel(values), casadi_observation(values)
    assert isinstance(mine, NativeKernel)
    assert again is mine
    assert mine.hessian_pattern == others.hessian_pattern
    given = random_intervals(mine, 2, 0, COUNT)
    assert_as_casadi(all_results(mine, given), all_results(others, given))


@pytest.mark.parametrize("counting", [1, 3, 8, 9])
def test_the_hessian_of_an_observation_is_evaluated_where_it_counts(counting: int) -> None:
    native = list(VARIANTS.values())[-1]
    values = seen_from_a_place()
    mine, others = native_observation(native, values), casadi_observation(values)
    calls = -(-counting // native.lanes)
    y, own, _, lam = random_intervals(mine, 2, 0, calls * native.lanes)
    call, (gradient, hessian) = mine.bind(Part.HESSIAN, calls, 1, (y, own, np.zeros((calls, 0)), lam), counting)
    for _ in range(2):  # arguments are read anew by every call
        y += 0.25
        call()
        for number in range(counting):
            expected = others.hessian(y[number], own[number], [], lam[number])
            assert np.array_equal(gradient.reshape(-1, 4)[number], np.asarray(expected[0]).ravel())
            assert np.array_equal(hessian.reshape(-1, 6)[number], np.asarray(expected[1].nonzeros()))


def test_an_observation_that_depends_linearly_on_the_state_has_no_curvature() -> None:
    native = list(VARIANTS.values())[-1]
    x = ca.SX.sym("x", 2)
    mine = native_observation(native, ca.Function("seen", [x, ca.SX.sym("b", 0)], [x[0] - 2.0 * x[1]]))
    y, own, shared, lam = random_intervals(mine, 0, 0, native.lanes)
    call, (gradient, hessian) = mine.bind(Part.HESSIAN, 1, 1, (y, own, shared, lam), 1)
    call()
    assert hessian.size == 0
    assert np.array_equal(gradient.reshape(-1, 2)[0], [lam[0, 0], -2.0 * lam[0, 0]])


def test_an_observation_that_the_interpreter_does_not_know_stays_with_casadi(caplog: pytest.LogCaptureFixture) -> None:
    x = ca.SX.sym("x")
    values = ca.Function("seen", [x, ca.SX.sym("b", 0)], [ca.erf(x)])
    observations = Observations(list(VARIANTS.values())[-1])
    assert all(isinstance(observations.kernel(values), Kernel) for _ in range(3))
    assert caplog.text.count("casadi evaluates an observation, slower") == 1
    assert isinstance(Observations().kernel(values), Kernel)


def test_arguments_of_another_size_are_refused() -> None:
    step, _ = kernels_of(list(VARIANTS.values())[-1], rich_system(), RK4)
    y, own, shared, lam = intervals(step)
    with pytest.raises(SolverCrash, match="argument 1"):
        all_results(step, [y, own[1:], shared, lam])


def test_casadi_evaluates_without_the_library_and_what_the_interpreter_does_not_know(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    x, u, p = ca.SX.sym("x"), ca.SX.sym("u"), ca.SX.sym("p", 0)
    rates = ca.Function("rates", [x, u, p], [ca.erf(x) + u])
    with pytest.raises(KernelError, match="not known"):
        bytecode(rates)
    built = build_kernels(System("strange", (Quantity("x", "1"),), (Quantity("u", "1"),), (), rates), RK4)
    assert isinstance(built.step, Kernel)
    assert "casadi evaluates strange, slower" in caplog.text
    monkeypatch.setenv("AIRRACE_NATIVE", "off")
    library.cache_clear()
    interpreter.cache_clear()
    try:
        assert isinstance(build_kernels(rich_system(), RK4).step, Kernel)
    finally:
        library.cache_clear()
        interpreter.cache_clear()


def test_operations_of_a_kind_are_brought_together_without_another_bit() -> None:
    """Of 1,543 random operations, some of which are results twice, casadi's order has 1,214 runs."""
    random = np.random.default_rng(0)
    x = ca.SX.sym("x", 3)
    numbers = [x[0], x[1], x[2], ca.SX(0.5)]
    kinds: list[Callable[[ca.SX, ca.SX], ca.SX]] = [operator.add, operator.sub, operator.mul, ca.fmin, ca.atan2]
    for _ in range(2000):
        a, b = (numbers[max(0, len(numbers) - 1 - int(back))] for back in random.exponential(100.0, 2))
        numbers.append(kinds[random.integers(len(kinds))](a, b))
    results = ca.vertcat(*numbers[-300:], numbers[0], numbers[-1], numbers[3])
    function = ca.Function("random", [x, ca.SX.sym("u", 0), ca.SX.sym("p", 0)], [results])
    states = random.normal(size=(3, COUNT))
    for native in VARIANTS.values():
        found = native.at_points(function, np.zeros((0, COUNT)), np.zeros(0))(states)
        assert_as_casadi([found], [np.asarray(function(states, [], []))])
    code, at, runs = bytecode(function).code, 0, 0
    while code[at, 0] < len(operation_numbers()):
        at, runs = at + 1 + int(code[at, 1]), runs + 1
    assert at == len(code) - 1
    assert runs < 250


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


@pytest.fixture
def sums() -> SparseAssembly:
    """Sums of one to about ten numbers, of sizes that differ by many orders."""
    random = np.random.default_rng(3)
    contributions = COOBuilder(20, 30)
    for count in (300, 2000):
        contributions.add_block(500)
        weights = random.normal(size=count) * 10.0 ** random.integers(-9, 9, count)
        rows, columns = random.integers(0, 20, count), random.integers(0, 30, count)
        contributions.add(rows, columns, weights, random.integers(0, 500, count))
    return contributions.build()


def by_numpy(sums: SparseAssembly, drawn: np.ndarray, monkeypatch: pytest.MonkeyPatch) -> np.ndarray:
    assert module.library() is not None
    with monkeypatch.context() as patch:
        patch.setattr(module, "library", lambda: None)
        return sums.of(drawn)


def test_sums_and_chosen_sums_have_the_bits_of_numpy(sums: SparseAssembly, monkeypatch: pytest.MonkeyPatch) -> None:
    assert len(sums.turns) > 3
    random = np.random.default_rng(6)
    drawn = random.normal(size=1000)
    expected = by_numpy(sums, drawn, monkeypatch)
    assert sums.of(drawn).tobytes() == expected.tobytes()
    places = random.permutation(2 * len(expected))[: len(expected)]
    memory = np.full(2 * len(expected), np.pi)
    assert sums.into(drawn, memory, places)
    assert memory[places].tobytes() == expected.tobytes()
    assert (np.delete(memory, places) == np.pi).all()
    numbers = np.sort(random.integers(0, len(sums.rows), 400))
    chosen = sums.choose(numbers, random.normal(size=400))
    assert chosen.of(drawn).tobytes() == by_numpy(chosen, drawn, monkeypatch).tobytes()


@pytest.mark.parametrize("number", [np.nan, np.inf, -np.inf])
def test_both_tell_what_is_no_number(sums: SparseAssembly, number: float, monkeypatch: pytest.MonkeyPatch) -> None:
    drawn, memory = np.ones(1000), np.zeros(len(sums.rows))
    drawn[int(sums.turns[-1][2][0])] = number  # the last summand of a sum
    places = np.arange(len(memory))
    assert not sums.into(drawn, memory, places)
    monkeypatch.setattr(module, "library", lambda: None)
    assert not sums.into(drawn, memory, places)
    assert sums.into(np.ones(1000), memory, places)


def system(
    rates: Callable[[ca.SX, ca.SX, ca.SX], list[ca.SX]],
    sizes: tuple[int, int, int],
    projection: Callable[[ca.SX], list[ca.SX]] | None = None,
) -> System:
    """A system with so many states, controls and parameters."""
    x, u, p = (ca.SX.sym(name, size) for name, size in zip("xup", sizes, strict=True))
    named = [tuple(Quantity(f"{one}", "1") for one in ca.vertsplit(symbols)) for symbols in (x, u, p)]
    project = ca.Function("project", [x], [ca.vertcat(*projection(x))]) if projection is not None else None
    return System("some", *named, ca.Function("rates", [x, u, p], [ca.vertcat(*rates(x, u, p))]), projection=project)


def car(x: ca.SX, u: ca.SX, p: ca.SX) -> list[ca.SX]:
    """Place (2), heading, speed; nothing depends on the place."""
    return [x[3] * ca.cos(x[2]), x[3] * ca.sin(x[2]), u[0] * x[3], p[0] * u[1] - p[1] * x[3] ** 2]


def linear(x: ca.SX, u: ca.SX, p: ca.SX) -> list[ca.SX]:
    return [x[1], -2.0 * x[0] - 0.3 * x[1] + u[0]]


def coupled(x: ca.SX, u: ca.SX, p: ca.SX) -> list[ca.SX]:
    """Curved in the control, in products of control and state, and in the parameter."""
    return [ca.exp(0.2 * u[0]) * x[1] * x[2], ca.sin(x[0] * p[0]) * u[0] ** 2, ca.SX(0.0), x[0] / (2.0 + ca.cos(x[3]))]


STEP_SYSTEMS: Mapping[str, System] = {
    **{name: problem.system for name, problem in PROBLEMS.items() if name not in ("everything", "one phase")},
    "rich": rich_system(),
    "rich, not projected": replace(rich_system(), projection=None),
    "place passes through": system(car, (4, 2, 2)),
    "place passes through a projection": system(car, (4, 2, 2), lambda x: [x[0], x[1], ca.sin(x[2]), x[3]]),
    "projection scales and mixes the place": system(
        car, (4, 2, 2), lambda x: [2.0 * x[0], x[1] * x[3], x[2] + ca.cos(x[0]), x[3]]
    ),
    "linear": system(linear, (2, 1, 0)),
    "a rate that is zero": system(coupled, (4, 1, 1)),
    "nothing moves": system(lambda x, u, p: [ca.SX(0.0), ca.SX(0.0)], (2, 1, 0)),
}
EULER = RungeKutta("euler", 1, ((),), (1.0,))
THRICE = replace(RK4_TWICE, name="rk4x3", steps=3)


def assert_equal(of: System, scheme: RungeKutta, given: Sequence[np.ndarray] | None = None) -> None:
    """Patterns are equal, and every result differs by no more than 1e-12 of its largest entry."""
    composed, graph = build_kernels(of, scheme).step, casadi_kernels(of, scheme).step
    assert isinstance(composed, NativeKernel)
    given = given or random_intervals(graph, 1, len(of.parameters), 5 * composed.lanes)
    for pair in (
        (composed.jacobian_pattern, graph.jacobian_pattern),
        (composed.hessian_pattern, graph.hessian_pattern),
    ):
        mine, theirs = (set(zip(*one.get_triplet(), strict=True)) for one in pair)
        assert mine == theirs
    own, other = all_results(composed, given), all_results(graph, given)
    assert_bitwise_equal(own[-2:], own[1:3])  # behind the Hessian, values and Jacobian again
    for mine, theirs in zip(own[:-2], other, strict=True):
        assert np.isfinite(theirs).all()
        assert np.abs(mine - theirs).max(initial=0.0) <= 1e-12 * np.abs(theirs).max(initial=0.0)


@pytest.mark.parametrize("name", STEP_SYSTEMS)
def test_composed_derivatives_equal_those_of_the_whole_graph(name: str) -> None:
    assert_equal(STEP_SYSTEMS[name], DORMAND_PRINCE_5)


@pytest.mark.parametrize("scheme", [EULER, RK4, RK4_TWICE, THRICE], ids=lambda scheme: scheme.name)
def test_composed_derivatives_are_those_of_any_explicit_scheme(scheme: RungeKutta) -> None:
    assert_equal(rich_system(), scheme)


def test_an_interval_without_length_has_derivatives() -> None:
    step = casadi_kernels(rich_system(), DORMAND_PRINCE_5).step
    given = random_intervals(step, 1, len(rich_system().parameters), 8)
    given[0][:, -1] = 0.0
    assert_equal(rich_system(), DORMAND_PRINCE_5, given)


def test_step_derivatives_of_a_linear_system_are_the_scheme_s_polynomial() -> None:
    """x+ = R(h A) x, R the truncated exponential up to the order, for RK4."""
    step = build_kernels(system(linear, (2, 1, 0)), RK4).step
    h, rates = 0.4, np.array([[0.0, 1.0], [-2.0, -0.3]])
    expected = sum(np.linalg.matrix_power(h * rates, power) / math.factorial(power) for power in range(5))
    given = [np.tile(one, (step.lanes, 1)) for one in ([0.3, -0.7, 0.0, 1.6], [0.25], [], [0.0, 0.0])]
    given[2] = np.zeros(0)
    jacobian = np.zeros((2, 4))
    rows, columns = step.jacobian_pattern.get_triplet()
    jacobian[rows, columns] = results(step, Part.JACOBIAN, given)[1][0]
    assert jacobian[:, :2] == pytest.approx(expected, rel=1e-13, abs=1e-15)


LAM_F = 0.6


@pytest.fixture(params=PROBLEMS, scope="module")
def assembly(request: pytest.FixtureRequest) -> Assembly:
    problem = PROBLEMS[request.param]
    return Assembly(Layout(problem), casadi_kernels(problem.system, problem.scheme))


def test_functions_and_patterns_are_those_of_the_casadi_program(assembly: Assembly) -> None:
    layout, program, functions = assembly.layout, transcribed(assembly), Evaluation(assembly)
    assert assembly.jacobian.sparsity == program.jac_g.sparsity_out(1)
    assert assembly.hessian.sparsity == program.hess_l.sparsity_out(1)
    for seed, factor in ((1, 1.0), (2, 1.0), (2, 1.1)):  # the values follow a change of the parameters alone
        w, _ = random_point(layout, seed)
        p, lam_g = factor * layout.parameter_values(), np.random.default_rng(seed).normal(size=layout.constraints)
        functions.at(w, p)
        functions.lam_f, functions.lam_g[:] = LAM_F, lam_g
        functions.linearise()
        functions.objective_gradient()
        functions.curve()
        f, g = program.nlp(w, p)
        gradient, hessian = program.hess_l(w, p, LAM_F, lam_g)
        assert functions.f == float(f)
        assert functions.g.tolist() == np.asarray(g).ravel().tolist()
        assert functions.f_gradient.tolist() == np.asarray(program.grad_f(w, p)).ravel().tolist()
        assert functions.jacobian.tolist() == program.jac_g(w, p)[1].nonzeros()
        assert functions.hessian.tolist() == hessian.nonzeros()
        for _ in range(2):
            assert functions.gradient.tolist() == np.asarray(gradient).ravel().tolist()
            functions.gradient[:] = np.nan
            functions.forget()
            functions.slope()


def test_iterates_of_another_size_are_refused(assembly: Assembly) -> None:
    kernel = assembly.calls[0].kernel
    with pytest.raises(SolverCrash, match="argument 0 has another size"):
        bind(kernel.value, (np.zeros(1), np.zeros(1), np.zeros(kernel.value.nnz_in(2))))


@pytest.mark.parametrize("threads", [2, 3])
@pytest.mark.parametrize("calls", [1, 2, 5, 7, 9])
def test_calls_that_threads_cannot_share_evenly_are_made_as_well(
    assembly: Assembly, calls: int, threads: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("airrace.optimal_control.kernels.MAP_IN_THREADS", 1)
    kernel, random = assembly.calls[0].kernel, np.random.default_rng(calls)
    function = kernel.hessian
    sizes = [function.nnz_in(place) for place in range(function.n_in())]
    given = [random.uniform(0.5, 1.0, size=(calls, size)) for size in sizes]
    call, results = kernel.bind(Part.HESSIAN, calls, threads, given)
    call()
    for number in range(calls):
        alone, expected = bind(function, [one[number].copy() for one in given])
        alone()
        for one, other in zip(results, expected, strict=True):
            assert one.reshape(calls, -1)[number].tobytes() == other.tobytes()


def test_a_bound_call_keeps_what_it_reads_and_writes(assembly: Assembly) -> None:
    function = assembly.calls[0].kernel.value
    arguments = [np.ones(function.nnz_in(place)) for place in range(function.n_in())]
    results = [np.zeros(function.nnz_out(place)) for place in range(function.n_out())]
    arrays = [weakref.ref(array) for array in (*arguments, *results)]
    call, _ = bind(function, arguments, results)
    del arguments, results, _
    assert all(array() is not None for array in arrays)
    call()


def test_summands_that_meet_are_added_and_some_nonzeros_can_be_chosen() -> None:
    matrix = COOBuilder(2, 2, symmetric=True)
    matrix.add_block(2)
    matrix.add(np.array([0, 0]), np.array([0, 1]), np.array([2.0, 3.0]), np.array([0, 1]))
    matrix.add_block(1)
    matrix.add(np.array([0]), np.array([1]), np.array([10.0]), np.array([0]))
    sums, drawn = matrix.build(), np.array([1.0, 1.0, 1.0])
    assert list(zip(sums.rows.tolist(), sums.columns.tolist(), sums.of(drawn).tolist(), strict=True)) == [
        (0, 0, 2.0),
        (1, 0, 13.0),
        (0, 1, 13.0),
    ]
    chosen = sums.choose(np.array([0, 2]), np.array([1.0, -1.0]))
    assert chosen.of(drawn).tolist() == [2.0, -13.0]
    assert (chosen.rows.tolist(), chosen.columns.tolist()) == ([0, 0], [0, 1])


def arrays(results: ca.DM | tuple[ca.DM, ...]) -> list[np.ndarray]:
    """The nonzeros of a function's results."""
    every = results if isinstance(results, tuple) else (results,)
    return [np.array(one.nonzeros()) for one in every]


@pytest.mark.parametrize("name", PROBLEMS)
def test_all_functions_have_the_bits_of_casadis_own_program(name: str) -> None:
    problem = PROBLEMS[name]
    layout = Layout(problem)
    assembly = Assembly(layout, casadi_kernels(problem.system, problem.scheme))
    mine, theirs = ProgramFunctions(Evaluation(assembly)), transcribed(assembly)
    (w, lam_g), p = random_point(layout, 1), layout.parameter_values()
    mine.begin(p)
    pairs = [
        (mine.nlp(w, p), theirs.nlp(w, p)),
        (mine.derivatives["nlp_grad_f"](w, p), theirs.f_and_grad(w, p)),
        (mine.derivatives["nlp_jac_g"](w, p), theirs.jac_g(w, p)),
        (mine.derivatives["nlp_hess_l"](w, p, LAM_F, lam_g), theirs.hess_l_upper(w, p, LAM_F, lam_g)),
        (mine.derivatives["nlp_grad"](w, p, LAM_F, lam_g), theirs.grad(w, p, LAM_F, lam_g)),
    ]
    for one, other in pairs:
        for found, expected in zip(arrays(one), arrays(other), strict=True):
            assert np.array_equal(found, expected)


def test_ipopt_evaluates_what_the_interior_point_method_does() -> None:
    problem = PROBLEMS["everything"]
    layout = Layout(problem)
    assembly = Assembly(layout, build_kernels(problem.system, problem.scheme))
    (w, lam_g), p = random_point(layout, 2), layout.parameter_values()
    program, other = ProgramFunctions(Evaluation(assembly)), Evaluation(assembly)
    program.begin(p)
    jacobian, hessian = program.derivatives["nlp_jac_g"], program.derivatives["nlp_hess_l"]
    assert jacobian.sparsity_out(jacobian.n_out() - 1) == assembly.jacobian.sparsity
    assert hessian.sparsity_out(hessian.n_out() - 1) == ca.triu(assembly.hessian.sparsity)
    other.at(w, p)
    other.lam_f, other.lam_g[:] = LAM_F, lam_g
    other.curve()
    upper = assembly.hessian.rows <= assembly.hessian.columns
    assert np.array_equal(np.array(hessian(w, p, LAM_F, lam_g).nonzeros()), other.hessian[upper])


ROLL_MODE = 0.08  # s, its time constant


def left_of_a_mode(scheme: RungeKutta, step: float) -> float:
    """Difference to the true decay in one step."""

    def decay(y: NDArray[np.float64], _u: object, _p: object) -> NDArray[np.float64]:
        return -y / ROLL_MODE

    after = scheme.advance(decay, np.ones(1), None, None, step)
    return abs(float(after[0]) - math.exp(-step / ROLL_MODE))


@pytest.mark.parametrize(("scheme", "expected"), [(VERNER_7, 3e-5), (DORMAND_PRINCE_5, 1e-2)])
def test_the_longest_interval_is_short_enough_for_the_scheme_of_order_7_alone(
    scheme: RungeKutta, expected: float
) -> None:
    assert left_of_a_mode(scheme, LONGEST_INTERVAL) == pytest.approx(expected, rel=0.1)
