"""The cost to go falls by the time that passes along an optimum, and no flight gains against it."""

from collections.abc import Iterator, Mapping
from contextlib import closing

import numpy as np
import pytest
from races import PLAN, SMALL, optimum

from airrace.optimal_control.solvers.service import SolverService
from airrace.procedure.cost_to_go import ITERATIONS_MAX, CostToGo, usual_deviations
from airrace.procedure.result import Silent
from airrace.procedure.solver_session import SolverSession
from airrace.procedure.stage_problem import formulate

RESULT = optimum(SMALL, PLAN)
REST = CostToGo(formulate(RESULT.stage, SMALL, PLAN, RESULT.trajectory, RESULT.pylon_conditions), RESULT)
T = RESULT.trajectory.race_time


@pytest.fixture(scope="module")
def session() -> Iterator[SolverSession]:
    with SolverService() as service, closing(SolverSession(service, PLAN, Silent())) as session:
        yield session


def state_at(node: int) -> dict[str, float]:
    trajectory = RESULT.trajectory
    return {state.name: float(trajectory[state.name][node]) for state in trajectory.states}


def leg_of(node: int) -> int:
    return int(np.searchsorted(RESULT.trajectory.first_node, node, side="right")) - 1


def nodes(count: int) -> list[int]:
    return np.linspace(0, len(RESULT.trajectory.time) - 2, count).astype(int).tolist()


@pytest.mark.parametrize("node", nodes(7))
def test_along_an_optimum_the_cost_falls_by_exactly_the_time_that_passes(session: SolverSession, node: int) -> None:
    rest = REST.solve(session, state_at(node), leg_of(node))
    assert rest.solved
    assert rest.cost + RESULT.trajectory.time[node] == pytest.approx(T, abs=1e-3)
    assert rest.text == ""


def test_guidance_to_a_gate_ahead_counts_what_follows_it(session: SolverSession) -> None:
    node = nodes(7)[1]
    assert leg_of(node) == 0
    rest = REST.solve(session, state_at(node), 0, gates=1)
    assert len(rest.trajectory.phases) == 1
    assert rest.cost + RESULT.trajectory.time[node] == pytest.approx(T, abs=1e-3)


def test_prices_are_the_slopes_of_the_cost(session: SolverSession) -> None:
    node = nodes(7)[2]
    state, leg = state_at(node), leg_of(node)
    costs: list[float] = []
    for change in (-0.5, 0.5):
        changed = REST.solve(session, {**state, "V_K": state["V_K"] + change}, leg)
        assert changed.relaxed < 1e-3
        costs.append(changed.cost)
    rest = REST.solve(session, state, leg)
    assert rest.prices["V_K"] < 0.0  # who is faster needs less time
    assert costs[1] - costs[0] == pytest.approx(rest.prices["V_K"], rel=0.05)


def test_a_flight_on_from_any_state_loses_nothing_against_its_own_cost_to_go(session: SolverSession) -> None:
    """What is left behind the first gate of the rest is what the rest still takes: Bellman's principle."""
    node = nodes(7)[1]
    slower = {**state_at(node), "V_K": state_at(node)["V_K"] - 3.0}
    rest = REST.solve(session, slower, leg_of(node))
    trajectory = rest.trajectory
    at = int(trajectory.first_node[1])
    passed = {state.name: float(trajectory[state.name][at]) for state in trajectory.states}
    behind = REST.solve(session, passed, leg_of(node) + 1)
    assert trajectory.time[at] + behind.cost == pytest.approx(rest.cost, abs=1e-3)
    assert rest.cost > T - RESULT.trajectory.time[node]


@pytest.mark.parametrize(
    "change",
    [{"V_K": 40.0}, {"n_z": 5.0}, {"x": 40.0}, {"z": -30.0}, {"q1": 0.5}],
    ids=lambda change: next(iter(change)),
)
def test_every_state_has_an_answer_that_says_what_gave_way(session: SolverSession, change: Mapping[str, float]) -> None:
    node = int(RESULT.trajectory.first_node[2]) - 3  # a gate is ahead that it can hardly make
    state = {name: value + change.get(name, 0.0) for name, value in state_at(node).items()}
    rest = REST.solve(session, state, leg_of(node))
    assert np.isfinite(rest.cost)
    assert rest.iterations <= 2 * ITERATIONS_MAX
    if rest.relaxed > 0.05:
        assert rest.text
        assert rest.changes or not rest.solved
    else:
        assert rest.solved


def test_what_gives_way_is_paid_for(session: SolverSession) -> None:
    """A state that is known less well gives way by fewer deviations; what it gains is counted at the usual prices."""
    node = int(RESULT.trajectory.first_node[2]) - 3
    state = {**state_at(node), "x": state_at(node)["x"] + 3.0}
    usual = usual_deviations(REST.states)
    near, wide = (
        REST.solve(session, state, leg_of(node), deviations={name: f * value for name, value in usual.items()})
        for f in (1.0, 4.0)
    )
    assert near.relaxed > 0.05  # three metres beside, that near, there is no flight
    assert wide.relaxed < near.relaxed
    for rest in (near, wide):
        begins = {quantity.name: float(rest.trajectory[quantity.name][0]) for quantity in rest.trajectory.states}
        gained = sum(price * (state[name] - begins[name]) for name, price in rest.prices.items())
        assert rest.cost == pytest.approx(float(rest.trajectory.durations.sum()) + gained, abs=1e-6)


def test_what_is_not_measured_is_the_optimums(session: SolverSession) -> None:
    node = nodes(7)[3]
    state = {name: value for name, value in state_at(node).items() if name not in ("delta_T", "n_y")}
    rest = REST.solve(session, state, leg_of(node))
    assert rest.cost + RESULT.trajectory.time[node] == pytest.approx(T, abs=2e-3)
