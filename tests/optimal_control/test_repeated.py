"""Sums found for one stage of each kind are those that are found for all stages, to the last bit."""

from dataclasses import replace

import numpy as np
import pytest
from small_problems import PROBLEMS, random_point

from airrace.optimal_control import sparse_assembly
from airrace.optimal_control.assembly import Assembly
from airrace.optimal_control.evaluation import Evaluation
from airrace.optimal_control.kernels import casadi_kernels
from airrace.optimal_control.layout import Layout
from airrace.optimal_control.solvers.fatrop.stages import INEQUALITIES, Bounds, PrimalDualPoint, Rows, Stages
from airrace.optimal_control.sparse_assembly import NO_FACTORS, COOBuilder, Entries, Memory, StageAssembly, unique_rows
from airrace.trajectory import Array

ROOM = 4000
"""More numbers than the matrices of any of these stages have."""


@pytest.fixture(params=PROBLEMS, scope="module")
def functions(request: pytest.FixtureRequest) -> Evaluation:
    """A program at some point."""
    problem = PROBLEMS[request.param]
    layout = Layout(problem)
    found = Evaluation(Assembly(layout, casadi_kernels(problem.system, problem.scheme)))
    found.at(random_point(layout, 1)[0], layout.parameter_values())
    found.lam_g[:] = np.random.default_rng(1).normal(size=layout.constraints)
    return found


def rows_of(functions: Evaluation, *, weighed: bool) -> Rows:
    layout = functions.assembly.layout
    bounds = Bounds(*layout.unknown_bounds(), *layout.constraint_bounds())
    known = None
    if weighed:
        values = np.concatenate([functions.g, functions.w])
        known = PrimalDualPoint(values, np.random.default_rng(2).normal(size=len(values)), 1e-3)
    return Rows(Stages(functions.assembly), bounds, known)


def empty(stages: int, families: int) -> Memory:
    begins = ROOM * np.arange(stages * families).reshape(stages, families)
    return Memory(np.full(begins.size * ROOM, np.pi), begins)


@pytest.fixture(params=["native", "numpy"])
def added_up_by(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    if request.param == "numpy":
        monkeypatch.setattr(sparse_assembly, "library", lambda: None)
    assert (sparse_assembly.library() is not None) == (request.param == "native")


@pytest.mark.usefixtures("added_up_by")
@pytest.mark.parametrize("weighed", [False, True])
def test_the_jacobian_of_every_stage_is_that_of_the_program(functions: Evaluation, *, weighed: bool) -> None:
    rows = rows_of(functions, weighed=weighed)
    memory = empty(rows.stages.count, 3)
    assert rows.jacobian.write(functions.linear(), memory, rows.weights)
    functions.linearise()
    whole = functions.assembly.jacobian
    numbers, items = rows.written(whole)
    places = rows.stages.place_in_stage[whole.columns[numbers]]
    at = memory.begins[rows.columns.stages[items], rows.columns.families[items]] + rows.offsets(items, places)
    assert memory.doubles[at].tolist() == (functions.jacobian[numbers] * rows.factors[items]).tolist()
    assert (np.delete(memory.doubles, at) == np.pi).all()


@pytest.mark.usefixtures("added_up_by")
def test_the_hessian_of_every_stage_is_that_of_the_program(functions: Evaluation) -> None:
    stages = Stages(functions.assembly)
    memory = empty(stages.count, 1)
    assert stages.hessian.write(functions.curved(), memory)
    functions.curve()
    whole = functions.assembly.hessian
    stage = stages.stage_of_unknown[whole.rows]
    row, column = stages.place_in_stage[whole.rows], stages.place_in_stage[whole.columns]
    at = memory.begins[stage, 0] + stages.matrices.offsets(stage, row, column)
    assert memory.doubles[at].tolist() == functions.hessian.tolist()
    assert (np.delete(memory.doubles, at) == np.pi).all()
    stages.hessian.fill(stages.on_diagonal.astype(np.float64), memory)
    assert memory.doubles[at].tolist() == (row == column).astype(np.float64).tolist()


@pytest.mark.usefixtures("added_up_by")
@pytest.mark.parametrize("number", [np.nan, np.inf])
def test_what_is_no_number_is_told_and_can_be_cleaned(functions: Evaluation, number: float) -> None:
    rows = rows_of(functions, weighed=False)
    memory, drawn = empty(rows.stages.count, 3), functions.linear()
    drawn[: len(drawn) // 2] = number
    assert not rows.jacobian.write(drawn, memory, rows.weights)
    assert not np.isfinite(memory.doubles).all()
    rows.jacobian.clean(memory)
    assert np.isfinite(memory.doubles).all()


def test_a_finer_mesh_has_stages_of_the_same_kinds() -> None:
    problem = PROBLEMS["one phase"]
    (phase,) = problem.phases
    counts: list[int] = []
    for intervals in (20, 80):
        finer = replace(problem, phases=(replace(phase, fractions=(1.0 / intervals,) * intervals, watches=()),))
        assembly = Assembly(Layout(finer), casadi_kernels(finer.system, finer.scheme))
        counts.append(len(unique_rows(assembly.alike(rows=True))[1]))
    assert counts[0] == counts[1] < 8


def test_inequalities_alone_have_factors(functions: Evaluation) -> None:
    rows = rows_of(functions, weighed=True)
    own = rows.columns.families == INEQUALITIES
    assert rows.weights.values.tolist() == rows.factors[own].tolist()
    first = rows.weights.begins[rows.columns.stages[own]] + rows.columns.numbers[own]
    assert first.tolist() == list(range(own.sum()))


def test_rows_are_of_a_kind_where_all_numbers_are_equal() -> None:
    kind, first = unique_rows(np.array([[1, 2], [3, 4], [1, 2], [1, 4]]))
    assert kind[0] == kind[2]
    assert len(set(kind.tolist())) == 3
    assert [kind[one] for one in first] == [0, 1, 2]
    assert sorted(first.tolist()) == [0, 1, 3]


def test_numbers_of_several_blocks_and_turns_are_added_in_order() -> None:
    """Two stages are alike: the third number of each is the sum of three, from two blocks."""
    contributions = COOBuilder(4, 1)
    numbers = np.arange(3)
    contributions.draw_from(6, np.array([0, 3]))
    contributions.add(numbers, np.zeros(3, dtype=np.int64), np.array([1.0, 10.0, 1e16]), numbers)
    contributions.draw_from(2, np.array([0, 1]))
    for weight in (1.0, -1e16):
        contributions.add(np.array([2]), np.array([0]), np.array([weight]), np.array([0]))
    sums = contributions.sums()
    nothing = np.zeros(3, dtype=np.int64)
    entries = Entries(nothing, nothing, numbers, nothing - 1)
    repeated, memory = (
        StageAssembly(sums, entries, np.zeros(2, dtype=np.int64)),
        Memory(np.zeros(8), np.array([[0], [4]])),
    )
    drawn: Array = np.array([1.0, 2.0, 1.0, 3.0, 4.0, 1.0, 1.0, 1.0])
    assert repeated.write(drawn, memory, NO_FACTORS)
    third = (1e16 + 1.0) - 1e16
    assert memory.doubles.tolist() == [1.0, 20.0, third, 0.0, 3.0, 40.0, third, 0.0]
