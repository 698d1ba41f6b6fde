"""Every unknown and every constraint has one place, and a name."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from small_problems import PROBLEMS, random_iterate, rich_problem

from airrace.optimal_control.layout import Layout
from airrace.optimal_control.problem import Boundary, Iterate, Phase, Problem, interpolate
from airrace.quantities import Interval


@st.composite
def meshes(draw: st.DrawFn) -> Problem:
    """The rich system on any mesh."""
    counts = draw(st.lists(st.integers(1, 5), min_size=1, max_size=4))
    phases = tuple(Phase(str(number), (1.0 / n,) * n, Interval(0.1, 3.0)) for number, n in enumerate(counts))
    rich = PROBLEMS["everything"]
    return Problem(rich.system, rich.parameters, Boundary(), phases, time_scale=draw(st.floats(0.1, 10.0)))


@given(meshes(), st.integers(0, 2**32 - 1))
def test_unpacking_undoes_packing(problem: Problem, seed: int) -> None:
    layout, iterate = Layout(problem), random_iterate(problem, seed)
    back = layout.unpack(layout.pack(iterate))
    assert back.durations == pytest.approx(iterate.durations, rel=1e-14)
    assert back.state == pytest.approx(iterate.state, rel=1e-14)
    assert back.control == pytest.approx(iterate.control, rel=1e-14)


@given(meshes(), st.integers(0, 2**32 - 1))
def test_packing_undoes_unpacking_where_durations_are_carried_on(problem: Problem, seed: int) -> None:
    layout = Layout(problem)
    w = layout.pack(random_iterate(problem, seed))
    assert w[layout.duration_source] == pytest.approx(w[layout.duration_index[1:]], rel=1e-14)
    assert layout.pack(layout.unpack(w)) == pytest.approx(w, rel=1e-14)


@given(meshes())
def test_every_unknown_and_every_constraint_has_one_place(problem: Problem) -> None:
    layout = Layout(problem)
    resets = layout.duration_source[layout.first_node[1:-1] - 1]
    places = [layout.state_index, layout.duration_index, layout.control_index, resets]
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
        assert described[gap].endswith("continuity of the flight")


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


def test_a_watch_looks_once_at_every_node_of_its_phases() -> None:
    layout = Layout(rich_problem())
    watched = [(one.name.split(", ")[1], one.node) for one in layout.output_samples if ", " in one.name]
    lasting, begun = ([node for name, node in watched if name == wanted] for wanted in ("lasting", "begun"))
    assert lasting == [0, 1, 2, 3, 4, 5]  # at node 3 the phases meet
    assert begun == [3, 4, 5]


def test_a_watch_of_another_bound_looks_again_where_two_phases_meet() -> None:
    problem = rich_problem()
    first, second, third = problem.phases
    other = replace(second.watches[0], bounds={"distance": Interval(-7.0, 9.0)})
    changed = replace(problem, phases=(first, replace(second, watches=(other,)), third))
    nodes = [one.node for one in Layout(changed).output_samples if one.name.endswith("lasting")]
    assert nodes == [0, 1, 2, 3, 3, 4, 5]


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


def test_path_limits_of_neighbouring_phases_both_hold_where_they_meet() -> None:
    layout = Layout(rich_problem())
    limits = {row.node: row.bounds for row in layout.flat_rows if row.quantity.name == "load"}
    own, narrow = Interval(-3.0, 8.0), Interval(-1.0, 2.0)
    assert limits == {0: own, 1: own, 2: own, 3: narrow, 4: narrow, 5: narrow}


def test_each_duration_is_bounded_once() -> None:
    layout = Layout(rich_problem())
    lower, upper = layout.unknown_bounds()
    places = [layout.duration_index[0], *layout.duration_source[layout.first_node[1:-1] - 1]]
    found = [(lower[place] * 0.7, upper[place] * 0.7) for place in places]
    assert np.array(found) == pytest.approx(np.array([(0.1, 3.0), (0.2, 2.0), (0.1, 1.0)]))
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
