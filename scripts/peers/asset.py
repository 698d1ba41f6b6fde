"""The race in ASSET: collocation on Legendre-Gauss-Lobatto points of order 5, solved by its own PSIOPT.

As its documentation advises: one phase object per leg with time from 0, units for automatic scaling, blockwise constant
controls, links of the states from leg to leg, and `solve_optimize`, which looks for a feasible point first.
"""

import time
from typing import Any

import numpy as np

from peers.measured import Answer, Flight
from peers.race import Gate, Race, crossing

STATES, CONTROLS = 12, 4
TIME = STATES
ATTITUDE = [4, 5, 6, 7]


def solve(race: Race, segments: int, tolerance: float) -> Answer:
    """Solve in this process with one thread.

    Raises:
        ImportError: ASSET is not installed.
    """
    import asset_asrl  # in the extra `peers`

    control = asset_asrl.OptimalControl
    began, spent = time.perf_counter(), time.process_time()
    ode = _equations(asset_asrl, race)
    guess = race.guess(segments)
    whole = control.OptimalControlProblem()
    whole.setThreads(1, 1)
    phases = [
        _phase(asset_asrl, race, ode, gate, _rows(guess.states[index], guess.durations[index], guess.control))
        for index, gate in enumerate(race.gates)
    ]
    phases[0].addBoundaryValue("Front", range(STATES), race.start)
    for phase in phases:
        whole.addPhase(phase)
    if len(phases) > 1:
        whole.addForwardLinkEqualCon(0, len(phases) - 1, range(STATES))
    whole.setAutoScaling(True, True)
    optimizer = whole.optimizer
    optimizer.set_PrintLevel(3)
    optimizer.set_MaxIters(1000)
    optimizer.set_tols(tolerance, tolerance, tolerance, tolerance)
    whole.transcribe(False, False)
    ready, ready_spent = time.perf_counter(), time.process_time()
    flag = whole.solve_optimize()
    done, done_spent = time.perf_counter(), time.process_time()
    converged = flag == asset_asrl.Solvers.ConvergenceFlags.CONVERGED
    return Answer(
        flight=_flight(phases, segments) if converged else None,
        status=str(flag),
        iterations=int(optimizer.LastIterNum),
        setup=ready - began,
        solve=done - ready,
        processor=done_spent - spent,
        processor_solve=done_spent - ready_spent,
    )


def _equations(asset: Any, race: Race) -> Any:
    """The equations of motion as ASSET's object."""
    arguments = asset.OptimalControl.ODEArguments(STATES, CONTROLS)
    x, u = arguments.XVec().tolist(), arguments.UVec().tolist()
    right_hand_side = asset.VectorFunctions.stack(race.rates(x, u))

    class PointMass(asset.OptimalControl.ODEBase):
        def __init__(self) -> None:
            super().__init__(right_hand_side, STATES, CONTROLS)

    return PointMass()


def _rows(states: Any, duration: float, control: Any) -> list[Any]:
    """A guess as ASSET takes it: a row of state, time and control per node."""
    times = np.linspace(0.0, duration, states.shape[1])
    return [np.concatenate([x, [t], control]) for x, t in zip(states.T, times, strict=True)]


def _phase(asset: Any, race: Race, ode: Any, gate: Gate, rows: list[Any]) -> Any:
    """One leg with its limits and its gate."""
    system = race.model.system
    phase = ode.phase("LGL5", rows, len(rows) - 1)
    phase.setControlMode("BlockConstant")
    phase.setThreads(1, 1)
    phase.setUnits(np.array([*(x.scale for x in system.states), 4.0, *(u.scale for u in system.controls)]))
    declared = [*enumerate(system.states), *enumerate(system.controls, start=STATES + 1)]
    for place, one in declared:
        if np.isfinite(one.lower) and np.isfinite(one.upper):
            phase.addLUVarBound("Path", place, one.lower, one.upper)
        elif np.isfinite(one.upper):
            phase.addUpperVarBound("Path", place, one.upper)
        elif np.isfinite(one.lower):
            phase.addLowerVarBound("Path", place, one.lower)
    arguments = asset.VectorFunctions.Arguments
    for one, value in zip(system.path, race.coefficients(arguments(STATES).tolist()), strict=True):
        phase.addLUFuncBound("Path", value, range(STATES), one.lower, one.upper)
    phase.addBoundaryValue("Front", [TIME], [0.0])
    phase.addBoundaryValue("Back", range(3), gate.position)
    if gate.fixed:
        q = arguments(4).tolist()
        seen = crossing(q, float(np.cos(gate.heading)), float(np.sin(gate.heading)))
        phase.addEqualCon("Back", asset.VectorFunctions.stack(list(seen)), ATTITUDE)
    phase.addLowerDeltaTimeBound(0.1)
    phase.addDeltaTimeObjective(1.0)
    return phase


def _flight(phases: list[Any], segments: int) -> Flight:
    """Read the optimum: the control of a segment is that at its interior node."""
    found = [np.array(phase.returnTraj()) for phase in phases]
    nodes = (len(found[0]) - 1) // segments
    return Flight(
        durations=np.array([one[-1, TIME] - one[0, TIME] for one in found]),
        starts=np.array([one[0, :STATES] for one in found]).T,
        ends=np.array([one[-1, :STATES] for one in found]).T,
        controls=np.array([one[1::nodes, STATES + 1 :] for one in found]).transpose(2, 0, 1),
    )
