"""The matrices of all stages: sums of what kernels return, found once for every kind of stage."""

from dataclasses import replace

import numpy as np
import pytest
from small_problems import PROBLEMS, random_point

from airrace.optimal_control import sparse_assembly
from airrace.optimal_control.assembly import Assembly, StageMatrices, begins_of
from airrace.optimal_control.evaluation import Evaluation
from airrace.optimal_control.kernels import casadi_kernels
from airrace.optimal_control.layout import Layout
from airrace.optimal_control.sparse_assembly import COOBuilder, Entries, Memory, StageAssembly, unique_rows
from airrace.optimal_control.trajectory import Array


@pytest.fixture(params=PROBLEMS, scope="module")
def functions(request: pytest.FixtureRequest) -> Evaluation:
    """A program at some point."""
    problem = PROBLEMS[request.param]
    layout = Layout(problem)
    found = Evaluation(Assembly(layout, casadi_kernels(problem.system, problem.scheme)))
    found.at(random_point(layout, 1)[0], layout.parameter_values())
    found.lam_g[:] = np.random.default_rng(1).normal(size=layout.constraints)
    return found


@pytest.fixture(params=["native", "numpy"])
def added_up_by(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    if request.param == "numpy":
        monkeypatch.setattr(sparse_assembly, "library", lambda: None)
    assert (sparse_assembly.library() is not None) == (request.param == "native")


def place_in_stage(layout: Layout) -> Array:
    sizes = layout.stage_states + layout.stage_controls
    return np.arange(layout.unknowns) - begins_of(sizes)[layout.stage_of_unknown]


@pytest.mark.usefixtures("added_up_by")
def test_the_hessian_of_every_stage_is_that_of_the_program(functions: Evaluation) -> None:
    layout, matrices = functions.assembly.layout, StageMatrices(functions.assembly)
    assert matrices.write(functions.jacobian_sources(), functions.hessian_sources())
    functions.curve()
    whole, place = functions.assembly.hessian, place_in_stage(layout)
    expected = np.zeros_like(matrices.hessian.doubles)
    stage = layout.stage_of_unknown[whole.rows]
    at = matrices.hessian.begins[stage, 0] + place[whole.columns] * matrices.sizes[stage] + place[whole.rows]
    expected[at] = functions.hessian
    assert matrices.hessian.doubles.tolist() == expected.tolist()


@pytest.mark.usefixtures("added_up_by")
def test_the_jacobians_of_every_stage_are_those_of_the_program(functions: Evaluation) -> None:
    layout, matrices = functions.assembly.layout, StageMatrices(functions.assembly)
    assert matrices.write(functions.jacobian_sources(), functions.hessian_sources())
    functions.linearise()
    J = np.zeros((layout.constraints, layout.unknowns))
    J[functions.assembly.jacobian.rows, functions.assembly.jacobian.columns] = functions.jacobian
    sizes = layout.stage_states + layout.stage_controls
    begins, numbers = begins_of(sizes), matrices.constraints.doubles
    for stage in range(layout.intervals + 1):
        own = slice(begins[stage], begins[stage] + sizes[stage])
        at, behind = matrices.constraints.begins[stage]
        if stage < layout.intervals:
            dynamics = numbers[at : at + matrices.states * sizes[stage]].reshape(sizes[stage], -1).T
            assert dynamics.tolist() == (-J[layout.gap_index.reshape(layout.intervals, -1)[stage], own]).tolist()
        rows = J[layout.row_index[layout.rows.node == stage], own]
        assert numbers[behind : behind + rows.size].tolist() == rows.ravel().tolist()


@pytest.mark.usefixtures("added_up_by")
@pytest.mark.parametrize("number", [np.nan, np.inf])
def test_what_is_no_number_is_reported(functions: Evaluation, number: float) -> None:
    matrices, linear = StageMatrices(functions.assembly), functions.jacobian_sources()
    linear[: len(linear) // 2] = number
    assert not matrices.write(linear, functions.hessian_sources())


def test_a_finer_mesh_has_stages_of_the_same_kinds() -> None:
    problem = PROBLEMS["one phase"]
    (phase,) = problem.phases
    counts: list[int] = []
    for intervals in (20, 80):
        finer = replace(
            problem, phases=(replace(phase, fractions=(1.0 / intervals,) * intervals, path_constraints=()),)
        )
        assembly = Assembly(Layout(finer), casadi_kernels(finer.system, finer.scheme))
        counts.append(len(unique_rows(assembly.structure_keys(rows=True))[1]))
    assert counts[0] == counts[1] < 8


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
    contributions.add_block(6, np.array([0, 3]))
    contributions.add(numbers, np.zeros(3, dtype=np.int64), np.array([1.0, 10.0, 1e16]), numbers)
    contributions.add_block(2, np.array([0, 1]))
    for weight in (1.0, -1e16):
        contributions.add(np.array([2]), np.array([0]), np.array([weight]), np.array([0]))
    sums = contributions.build()
    nothing = np.zeros(3, dtype=np.int64)
    entries = Entries(nothing, numbers)
    repeated, memory = (
        StageAssembly(sums, entries, np.zeros(2, dtype=np.int64)),
        Memory(np.zeros(8), np.array([[0], [4]])),
    )
    drawn: Array = np.array([1.0, 2.0, 1.0, 3.0, 4.0, 1.0, 1.0, 1.0])
    assert repeated.write(drawn, memory)
    third = (1e16 + 1.0) - 1e16
    assert memory.doubles.tolist() == [1.0, 20.0, third, 0.0, 3.0, 40.0, third, 0.0]
