"""A problem that would silently mean something else than it says is refused, with the name of what is wrong."""

import math
from dataclasses import replace

import pytest
from small_problems import PROBLEMS, ended_problem, rich_problem

from airrace.optimal_control.layout import Layout
from airrace.optimal_control.problem import WHOLE, Objective, Problem, require_valid, uniform
from airrace.quantities import Interval

RICH, ENDED = rich_problem(), ended_problem()


def with_phase(**values: object) -> Problem:
    """The rich problem with its first phase changed."""
    first, *others = RICH.phases
    return replace(RICH, phases=(replace(first, **values), *others))  # type: ignore[arg-type]


def with_watch(**values: object) -> Problem:
    """The rich problem with the watch of its first phase changed."""
    return with_phase(watches=(replace(RICH.phases[0].watches[0], **values),))  # type: ignore[arg-type]


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
    (replace(RICH, objective=Objective(regularisation={"x": 1.0})), "regularises unknown controls: x"),
    (replace(RICH, objective=Objective(regularisation={"a": 1.0})), "regularises unknown controls: a"),
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
    (with_watch(bounds={"distanse": Interval(upper=1.0)}), "watch 'lasting' bounds unknown quantities: distanse"),
    (with_watch(values=(0.1, 0.9, 0.5)), "watch 'lasting' declares 2 parameters, and 3"),
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


@pytest.mark.parametrize("name", PROBLEMS)
def test_what_can_be_solved_is_not_refused(name: str) -> None:
    require_valid(PROBLEMS[name])


def test_a_layout_is_made_of_a_valid_problem_alone() -> None:
    with pytest.raises(ValueError, match="do not add up to 1"):
        Layout(with_phase(fractions=(0.5, 0.4)))


def test_rounding_does_not_make_a_mesh_incomplete() -> None:
    require_valid(with_phase(fractions=uniform(9999)))
    assert abs(sum(uniform(9999)) - 1.0) < 1e-3 * WHOLE


def test_limits_that_contradict_one_another_are_the_solvers_business() -> None:
    require_valid(with_phase(duration=Interval(3.0, 2.0)))
