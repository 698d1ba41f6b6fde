"""The layout of unknowns and constraints, the transcribed program, and what is refused of a problem."""

import math
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from casadi_program import NonlinearProgram, transcribe
from hypothesis import given
from hypothesis import strategies as st
from small_problems import PROBLEMS, ended_problem, random_iterate, random_point, rich_problem, staged_problem

from airrace.optimal_control.kernels import casadi_kernels
from airrace.optimal_control.layout import Layout
from airrace.optimal_control.mesh_refinement import transfer_multipliers
from airrace.optimal_control.problem import (
    WHOLE,
    Boundary,
    Iterate,
    Objective,
    Phase,
    Problem,
    interpolate,
    require_valid,
    uniform,
)
from airrace.optimal_control.quantities import Interval
from airrace.optimal_control.solvers.interface import Multipliers


@st.composite
def meshes(draw: st.DrawFn) -> Problem:
    """The rich system on any mesh."""
    counts = draw(st.lists(st.integers(1, 5), min_size=1, max_size=4))
    phases = tuple(Phase(str(number), (1.0 / n,) * n, Interval(0.1, 3.0)) for number, n in enumerate(counts))
    rich = PROBLEMS["everything"]
    return Problem(rich.system, rich.parameters, Boundary(), phases, time_scale=draw(st.floats(0.1, 10.0)))


@given(meshes(), st.integers(0, 2**32 - 1))
def test_packing_and_unpacking_undo_each_other(problem: Problem, seed: int) -> None:
    layout, iterate = Layout(problem), random_iterate(problem, seed)
    w = layout.pack(iterate)
    back = layout.unpack(w)
    for name in ("durations", "state", "control"):
        assert getattr(back, name) == pytest.approx(getattr(iterate, name), rel=1e-14)
    assert w[layout.duration_source] == pytest.approx(w[layout.duration_index[1:]], rel=1e-14)
    assert layout.pack(back) == pytest.approx(w, rel=1e-14)


@given(meshes())
def test_every_unknown_and_every_constraint_has_one_place(problem: Problem) -> None:
    layout = Layout(problem)
    places = [layout.state_index, layout.duration_index, layout.control_index, layout.phase_durations[1:]]
    assert sorted(np.concatenate([one.ravel() for one in places])) == list(range(layout.unknowns))
    rows: list[int] = np.concatenate([layout.gap_index.ravel(), layout.row_index]).tolist()
    assert sorted(rows) == list(range(layout.constraints))


@pytest.mark.parametrize("problem", [pytest.param(one, id=name) for name, one in PROBLEMS.items()])
def test_every_constraint_has_a_description(problem: Problem) -> None:
    layout = Layout(problem)
    described = [layout.describe(index) for index in range(layout.constraints)]
    places = {phase.name for phase in problem.phases} | {output_sample.name for output_sample in layout.output_samples}
    assert {text.split(": ")[0] for text in described} <= places
    assert all(text.split(": ")[1] for text in described)
    for gap in layout.gap_index.ravel():
        assert described[gap].endswith("continuity")


@pytest.mark.parametrize(
    ("name", "shape"),
    [("durations", (1,)), ("state", (3, 1)), ("state", (2, 7)), ("control", (2, 7)), ("control", (1, 6))],
)
def test_an_iterate_of_another_shape_is_refused(name: str, shape: tuple[int, ...]) -> None:
    """numpy would repeat some of them."""
    problem = rich_problem()
    wrong = replace(random_iterate(problem, 1), **{name: np.ones(shape)})
    with pytest.raises(ValueError, match=f"the iterate's {name} has the shape"):
        Layout(problem).pack(wrong)


def test_a_watch_looks_once_at_every_node_of_its_phases_unless_its_bounds_change() -> None:
    problem = rich_problem()
    first, second, third = problem.phases
    other = replace(second.path_constraints[0], bounds={"distance": Interval(-7.0, 9.0)})
    changed = replace(problem, phases=(first, replace(second, path_constraints=(other,)), third))

    def nodes(stated: Problem, name: str) -> list[int]:
        return [one.node for one in Layout(stated).output_samples if one.name.endswith(f", {name}")]

    assert nodes(problem, "lasting") == [0, 1, 2, 3, 4, 5]  # at node 3 the phases meet
    assert nodes(problem, "begun") == [3, 4, 5]
    assert nodes(changed, "lasting") == [0, 1, 2, 3, 3, 4, 5]


def test_a_constraint_is_described_by_its_place_and_its_quantity() -> None:
    layout = Layout(rich_problem())
    texts = [layout.describe(int(place)) for place in layout.row_index]
    expected = {"start: lean", "one: load", "one: height", "first: clearance", "second: distance from the gate"}
    assert expected <= set(texts)
    assert "finish: clearance" in texts
    # the load needs a control, which the last node has not
    loads = [row.node for row in layout.flat_rows if row.quantity.name == "load"]
    assert loads == list(range(layout.intervals))


def test_bounds_of_neighbouring_phases_both_hold_where_they_meet() -> None:
    layout = Layout(rich_problem())
    lower, upper = layout.unknown_bounds()
    limits = [Interval(*pair) for pair in zip(lower * layout.scale, upper * layout.scale, strict=True)]
    a, b, _ = layout.state_index.T
    s, _ = layout.control_index.T
    free, narrow = Interval(), Interval(-2.0, 2.0)
    assert [limits[place] for place in b] == [free, free, free, narrow, narrow, narrow, free]
    assert [limits[place] for place in s] == [narrow] * 3 + [Interval(-1.0, 1.0)] * 2 + [narrow]
    assert limits[a[0]] == Interval.exactly(0.5)
    assert [limits[place] for place in a[1:]] == [Interval(-9.0, 9.0)] * 6
    loads = {row.node: row.bounds for row in layout.flat_rows if row.quantity.name == "load"}
    own, narrow = Interval(-3.0, 8.0), Interval(-1.0, 2.0)
    assert loads == {0: own, 1: own, 2: own, 3: narrow, 4: narrow, 5: narrow}


def test_each_duration_is_bounded_once() -> None:
    layout = Layout(rich_problem())
    lower, upper = layout.unknown_bounds()
    places = layout.phase_durations
    found = np.array([lower[places] * 0.7, upper[places] * 0.7]).T
    assert found == pytest.approx(np.array([(0.1, 3.0), (0.2, 2.0), (0.1, 1.0)]))
    carried = np.setdiff1d(layout.duration_index, places)
    assert np.isinf(lower[carried]).all()
    assert np.isinf(upper[carried]).all()


def test_interpolation_meets_the_corners_and_is_straight_in_time() -> None:
    problem = rich_problem()
    corners = np.array([[0.0, 1.0, 3.0, -1.0], [2.0, 2.0, 0.0, 5.0], [1.0, 0.0, 0.0, 4.0]])
    guess: Iterate = interpolate(problem, [1.0, 2.0, 3.0], corners, [0.1, 0.2])
    assert guess.state[:, problem.first_node] == pytest.approx(corners)
    assert guess.state[0, :4] == pytest.approx([0.0, 0.2, 0.7, 1.0])
    assert guess.control.shape == (2, problem.intervals)


def test_structure_of_the_rows_tells_where_they_are_and_not_how_wide() -> None:
    problem = rich_problem()
    end = problem.phases[-1].end

    def structure(bounds: dict[str, Interval]) -> bytes:
        last = replace(problem.phases[-1], end=replace(end, bounds={**end.bounds, **bounds}))
        return Layout(replace(problem, phases=(*problem.phases[:-1], last))).rows.structure

    assert structure({"clearance": Interval(-1.0, 1.0)}) == structure({"clearance": Interval(upper=3.0)})
    assert structure({"clearance": Interval(-1.0, 1.0)}) != structure({"clearance": Interval()})


STEP = 1e-6
LAM_F = 0.6


def program_of(problem: Problem) -> tuple[Layout, NonlinearProgram]:
    layout = Layout(problem)
    return layout, transcribe(layout, casadi_kernels(problem.system, problem.scheme))


def differences(function, w: np.ndarray) -> np.ndarray:
    """Central differences of a vector function, shape (n, n_w)."""
    return np.stack([(function(w + STEP * e) - function(w - STEP * e)) / (2 * STEP) for e in np.eye(len(w))], axis=1)


def dense(value: ca.DM) -> np.ndarray:
    return np.asarray(value.full())


@pytest.fixture(params=PROBLEMS, scope="module")
def transcribed(request: pytest.FixtureRequest) -> tuple[Layout, NonlinearProgram, np.ndarray]:
    problem = PROBLEMS[request.param]
    layout, program = program_of(problem)
    return layout, program, layout.parameter_values()


@pytest.mark.parametrize("seed", [1, 2])
def test_derivatives_agree_with_differences(transcribed, seed: int) -> None:
    layout, program, p = transcribed
    w, lam_g = random_point(layout, seed)
    f, g = program.nlp(w, p)
    gradient = differences(lambda w: dense(program.nlp(w, p)[0]).ravel(), w).ravel()
    assert dense(program.grad_f(w, p)).ravel() == pytest.approx(gradient, abs=1e-8)
    value, slope = program.f_and_grad(w, p)
    assert dense(slope).ravel() == pytest.approx(gradient, abs=1e-8)
    assert float(value) == float(f)
    values, jacobian = program.jac_g(w, p)
    expected = differences(lambda w: dense(program.nlp(w, p)[1]).ravel(), w)
    assert dense(jacobian) == pytest.approx(expected, abs=1e-7)
    assert dense(values) == pytest.approx(dense(g), abs=1e-14)
    lagrangian = LAM_F * dense(slope) + dense(jacobian).T @ lam_g[:, None]
    curved, hessian = program.hess_l(w, p, LAM_F, lam_g)
    assert dense(curved) == pytest.approx(lagrangian, abs=1e-12)
    assert dense(program.grad(w, p, LAM_F, lam_g)[2]) == pytest.approx(lagrangian, abs=1e-12)
    full = dense(hessian)
    expected = differences(lambda w: dense(program.hess_l(w, p, LAM_F, lam_g)[0]).ravel(), w)
    assert full == pytest.approx(expected, abs=1e-7)
    assert (full == full.T).all()
    assert (dense(program.hess_l_upper(w, p, LAM_F, lam_g)) == np.triu(full)).all()


def test_each_stage_meets_the_next_only_through_an_identity(transcribed) -> None:
    """The structure that a Riccati recursion needs, of the Jacobian and of the Hessian."""
    layout, program, p = transcribed
    w, lam_g = random_point(layout, seed=3)
    jacobian = dense(program.jac_g(w, p)[1])
    hessian = dense(program.hess_l(w, p, LAM_F, lam_g)[1])
    columns = np.cumsum([0, *(layout.stage_states + layout.stage_controls)])
    gaps = [*layout.stage_states[1:], 0]
    rows = np.cumsum([0, *(layout.stage_rows + gaps)])
    for stage, gap in enumerate(gaps):
        here = slice(columns[stage], columns[stage + 1])
        block = jacobian[rows[stage] : rows[stage + 1]].copy()
        block[:, here] = 0.0
        block[:gap, columns[stage + 1] : columns[stage + 1] + gap] -= np.eye(gap)
        assert (block == 0.0).all()
        outside = hessian[here].copy()
        outside[:, here] = 0.0
        assert (outside == 0.0).all()
    row, column = (np.array(one) for one in program.hess_l.sparsity_out(1).get_triplet())
    stage = np.searchsorted(columns, [row, column], side="right")
    assert (stage[0] == stage[1]).all()


@pytest.mark.parametrize("problem", [rich_problem(), staged_problem()], ids=["continuous", "jumping"])
def test_gaps_are_the_jumps_when_each_interval_is_integrated_from_the_last(problem: Problem) -> None:
    layout, program = program_of(problem)
    step = casadi_kernels(problem.system, problem.scheme).step.value
    iterate = random_iterate(problem, seed=4)
    for k in range(layout.intervals):
        duration = iterate.durations[layout.phase_of_interval[k]]
        y = [*iterate.state[:, k], *iterate.control[:, k], duration]
        iterate.state[:, k + 1] = dense(step(y, layout.fractions[k], problem.parameters)).ravel()
        if k + 1 in problem.first_node[1:]:
            iterate.state[:, k + 1] += problem.jumps[:, layout.phase_of_interval[k]]
    g = dense(program.nlp(layout.pack(iterate), layout.parameter_values())[1]).ravel()
    for bounds in layout.constraint_bounds():
        assert g[layout.gap_index] == pytest.approx(bounds[layout.gap_index], abs=1e-14)


@pytest.mark.parametrize("problem", [rich_problem(), staged_problem()], ids=["continuous", "jumping"])
def test_constraints_are_path_and_boundary_values_in_units_of_their_scales(problem: Problem) -> None:
    layout, program = program_of(problem)
    iterate = random_iterate(problem, seed=5)
    g = dense(program.nlp(layout.pack(iterate), layout.parameter_values())[1]).ravel()
    for row, place in zip(layout.flat_rows, layout.row_index, strict=True):
        x = iterate.state[:, row.node]
        if row.source < 0:
            u = iterate.control[:, min(row.node, layout.intervals - 1)]
            values = problem.system.path_values(x, u, problem.parameters)
        else:
            output_sample = layout.output_samples[row.source]
            first = len(problem.parameters) + layout.intervals + output_sample.offset
            parameters = layout.parameter_values()[first : first + len(output_sample.observation.parameters)]
            seen = x if output_sample.jump is None else problem.states_before_jump(iterate.state)[:, row.node - 1]
            values = output_sample.observation.values(seen, parameters)
        assert g[place] == pytest.approx(float(values[row.component]) / row.quantity.scale, abs=1e-13)


def test_objective_is_time_terminal_values_and_regularisation() -> None:
    problem = rich_problem()
    layout, program = program_of(problem)
    iterate = random_iterate(problem, seed=6)
    lengths = layout.fractions * iterate.durations[layout.phase_of_interval]
    s, t = iterate.control / np.array([[4.0], [0.25]])
    b, c = iterate.state[1:, -1]
    begun = iterate.state[1, :-1] / problem.system.states[1].scale
    effort = lengths @ (0.3 * begun**2 + 0.05 * s**2 + 0.4 * t**2)
    expected = 0.8 * iterate.durations.sum() - 0.3 * b + 0.2 * c + effort
    assert float(program.nlp(layout.pack(iterate), layout.parameter_values())[0]) == pytest.approx(expected, abs=1e-13)


def test_objective_takes_what_is_observed_of_the_states_at_both_ends() -> None:
    problem = ended_problem()
    layout, program = program_of(problem)
    iterate = random_iterate(problem, seed=6)
    a, b, c = iterate.state[:, -1]
    w, p = layout.pack(iterate), layout.parameter_values()
    plain, same = program_of(staged_problem())
    without = float(same.nlp(plain.pack(iterate), plain.parameter_values())[0])
    effort, swing = np.exp(0.3 * a) * b - 0.7 * c**2, np.sin(a * c)
    start, middle, last = iterate.state[:, 0]
    at_start = -0.5 * (np.exp(0.3 * start) * middle - 0.4 * last**2) + 0.2 * middle
    assert float(program.nlp(w, p)[0]) == pytest.approx(without + 0.6 * effort - 0.4 * swing + at_start, abs=1e-13)


RICH, ENDED = rich_problem(), ended_problem()


def with_phase(**values: object) -> Problem:
    """The rich problem with its first phase changed."""
    first, *others = RICH.phases
    return replace(RICH, phases=(replace(first, **values), *others))  # type: ignore[arg-type]


def with_path_constraint(**values: object) -> Problem:
    """The rich problem with the path constraint of its first phase changed."""
    return with_phase(path_constraints=(replace(RICH.phases[0].path_constraints[0], **values),))  # type: ignore[arg-type]


def twice() -> Problem:
    """A path quantity that has the name of a state."""
    load, height = RICH.system.path
    return replace(RICH, system=replace(RICH.system, path=(load, replace(height, name="a"))))


def doubtful() -> Problem:
    """A cost of the final state that has the name of a state."""
    observation = ENDED.objective.observation
    assert observation is not None
    effort, *others = observation.quantities
    renamed = replace(observation, quantities=(replace(effort, name="a"), *others))
    return replace(ENDED, objective=replace(ENDED.objective, terminal={}, observation=renamed))


WRONG = [
    (replace(RICH, objective=Objective(terminal={"heigth": 1.0})), "weighs unknown states: heigth"),
    (replace(RICH, objective=Objective(regularisation={"x": 1.0})), "regularises unknown states or controls: x"),
    (replace(RICH, objective=Objective(regularisation={"load": 1.0})), "regularises unknown states or controls: load"),
    (replace(RICH, objective=Objective(terminal={"b": math.nan})), "weighs b by nan"),
    (replace(RICH, objective=Objective(time=math.inf)), "weighs time by inf"),
    (replace(RICH, objective=Objective(regularisation={"s": -0.1})), "must not be negative"),
    (replace(ENDED, objective=replace(ENDED.objective, values=())), "the objective declares 1 parameters, and 0"),
    (replace(RICH, objective=Objective(values=(1.0,))), "the objective declares 0 parameters, and 1"),
    (replace(ENDED, objective=replace(ENDED.objective, terminal={"efort": 1.0})), "weighs unknown states: efort"),
    (doubtful(), "may mean a state or what is observed: a"),
    (with_phase(bounds={"nothing": Interval(0.0, 1.0)}), "phase 'one' bounds unknown quantities: nothing"),
    (with_phase(fractions=(0.5, 0.4)), "do not add up to 1"),
    (with_phase(fractions=(1.5, -0.5)), "are not positive"),
    (with_phase(fractions=(0.0, 1.0)), "are not positive"),
    (with_phase(fractions=(math.nan, 1.0)), "are not positive"),
    (with_phase(fractions=()), "do not add up to 1"),
    (with_phase(duration=Interval(-1.0, 1.0)), "may not last -1.0 s"),
    (with_phase(duration=Interval(math.nan, 1.0)), "may not last nan s"),
    (with_phase(duration=Interval()), "may not last -inf s"),
    (with_phase(end=replace(RICH.phases[0].end, bounds={"claerance": Interval()})), "boundary 'first' bounds unknown"),
    (with_phase(end=replace(RICH.phases[0].end, values=())), "boundary 'first' declares 1 parameters, and 0"),
    (with_phase(end=replace(RICH.phases[0].end, observation=None, bounds={})), "declares 0 parameters, and 1"),
    (replace(RICH, start=replace(RICH.start, bounds={"load": Interval()})), "boundary 'start' bounds unknown"),
    (
        with_path_constraint(bounds={"distanse": Interval(upper=1.0)}),
        "path constraint 'lasting' bounds unknown quantities: distanse",
    ),
    (with_path_constraint(values=(0.1, 0.9, 0.5)), "path constraint 'lasting' declares 2 parameters, and 3"),
    (with_phase(jump={"heigth": 1.0}), "jump at the end of phase 'one' changes unknown states: heigth"),
    (with_phase(jump={"a": math.nan}), "jump at the end of phase 'one' changes a by nan"),
    (replace(RICH, phases=(replace(RICH.phases[0], jump={"a": 1.0}),)), "no phase follows the jump"),
    (replace(RICH, parameters=(0.7,)), "system 'rich' declares 2 parameters, and 1"),
    (replace(RICH, phases=()), "no phases"),
    (twice(), "declares twice: a"),
]


@pytest.mark.parametrize(("problem", "words"), WRONG, ids=[words for _, words in WRONG])
def test_what_would_silently_mean_something_else_is_refused(problem: Problem, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        require_valid(problem)


def test_a_layout_is_made_of_a_valid_problem_alone() -> None:
    with pytest.raises(ValueError, match="do not add up to 1"):
        Layout(with_phase(fractions=(0.5, 0.4)))


def test_rounding_and_contradicting_limits_are_not_refused() -> None:
    require_valid(with_phase(fractions=uniform(9999)))
    assert abs(sum(uniform(9999)) - 1.0) < 1e-3 * WHOLE
    require_valid(with_phase(duration=Interval(3.0, 2.0)))  # the solver's business


@pytest.mark.parametrize(("share", "node"), [(0.0, 0), (0.09, 0), (0.11, 1), (0.44, 1), (0.46, 2), (0.84, 2), (1.0, 3)])
def test_a_watch_at_a_share_of_a_phase_is_asked_for_at_the_nearest_node_alone(share: float, node: int) -> None:
    rich = rich_problem()
    first, *others = rich.phases
    alone = replace(first.path_constraints[0], at=share, name="alone")
    layout = Layout(replace(rich, phases=(replace(first, path_constraints=(alone,)), *others)))
    assert [one.node for one in layout.output_samples if one.name == "one, alone"] == [node]


def test_of_two_nodes_that_are_equally_near_the_first_is_asked() -> None:
    phase = replace(rich_problem().phases[0], fractions=(0.25, 0.25, 0.5))
    assert phase.nearest_node(0.375) == phase.nearest_node(0.375 + 1e-9) == 1


@pytest.mark.parametrize("share", [-0.1, 1.1, math.nan])
def test_a_watch_beyond_its_phase_is_refused(share: float) -> None:
    rich = rich_problem()
    first, *others = rich.phases
    constraints = (replace(first.path_constraints[0], at=share),)
    with pytest.raises(ValueError, match="lasting"):
        require_valid(replace(rich, phases=(replace(first, path_constraints=constraints), *others)))


def test_the_multiplier_at_one_node_is_carried_over_to_the_node_of_another_mesh_as_it_is() -> None:
    rich = rich_problem()
    first, *others = rich.phases
    constraints = (replace(first.path_constraints[0], at=0.7, name="alone"),)
    there = Layout(replace(rich, phases=(replace(first, path_constraints=constraints), *others)))
    here = Layout(replace(rich, phases=(replace(first, path_constraints=constraints, fractions=(0.1,) * 10), *others)))

    def places(layout: Layout) -> list[int]:
        rows = zip(layout.row_index.tolist(), layout.flat_rows, strict=True)
        return [at for at, row in rows if row.source >= 0 and layout.output_samples[row.source].name == "one, alone"]

    known = np.zeros(there.constraints)
    known[places(there)] = 0.3
    carried = transfer_multipliers(Multipliers(known, np.zeros(there.unknowns)), there, here)
    assert carried.constraints[places(here)] == pytest.approx(0.3)
