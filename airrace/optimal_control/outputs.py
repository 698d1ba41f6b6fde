"""The samples of a problem: every look that it takes at an observation, at boundaries and along watched phases."""

from collections.abc import Mapping

from airrace.optimal_control.problem import Boundary, Problem
from airrace.quantities import Interval
from airrace.records import record
from airrace.system import Observation


@record
class OutputSample:
    """A look at an observation at one node.

    Attributes:
        node: where.
        name: of the boundary, or of phase and watch, for people.
        bounds: ranges by name of the observation's quantities.
        offset: place of the observation's parameters among those of all output samples; a watch shares them.
        jump: number, among the jumps of the problem, of that which follows at this node and is not seen yet; None
            where there is none, and where the phase after it is looked at.
    """

    node: int
    name: str
    observation: Observation
    bounds: Mapping[str, Interval]
    offset: int
    jump: int | None = None


def boundaries_of(problem: Problem) -> list[tuple[int, Boundary]]:
    """Return (node, boundary) of the start and of every phase's end."""
    ends = [(node, phase.end) for node, phase in zip(problem.first_node[1:], problem.phases, strict=True)]
    return [(0, problem.start), *ends]


def sightings_of(problem: Problem, jump_at: Mapping[int, int]) -> tuple[list[OutputSample], list[tuple[float, ...]]]:
    """Return all output samples, and the parameters that they share: at the boundaries in order, then watch by watch.

    Args:
        problem: whose boundaries and watches observe.
        jump_at: number of the jump at each node that has one.
    """
    output_samples: list[OutputSample] = []
    values: list[tuple[float, ...]] = []
    offset = 0
    for node, boundary in boundaries_of(problem):
        if boundary.observation is not None:
            before = jump_at.get(node)
            output_samples.append(
                OutputSample(node, boundary.name, boundary.observation, boundary.bounds, offset, before)
            )
            values.append(boundary.values)
            offset += len(boundary.values)
    for index, phase in enumerate(problem.phases):
        start, end = problem.first_node[index], problem.first_node[index + 1]
        watched_before = problem.phases[index - 1].watches if index and start not in jump_at else ()
        for watch in phase.watches:
            # Where a watch goes on from the phase before, the node between the two has its rows already.
            begun = any(watch.same_conditions(other) for other in watched_before)
            name = f"{phase.name}, {watch.name}"
            for node in range(start + (1 if begun else 0), end + 1):
                before = jump_at.get(node) if node == end else None
                output_samples.append(OutputSample(node, name, watch.observation, watch.bounds, offset, before))
            values.append(watch.values)
            offset += len(watch.values)
    return output_samples, values
